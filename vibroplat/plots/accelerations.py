"""Figures of accelerations of a run: over time, their spectra; and of all that was measured beside what was computed.

The spectrum is that of amplitudes: of the last whole turns of exciter 1 that are shown, at the times of the output
grid, without the mean, weighted with Hann's window, it is the size of numpy's real FFT over half the sum of the
weights. An oscillation that repeats within these turns so has its amplitude at its frequency, and nothing two lines
beside it (Harris, On the use of windows for harmonic analysis, Proc. IEEE 66, 1978). Impacts make accelerations jump
and have no upper frequency: amplitudes near half the sampling rate hold what lies above.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vibroplat.config.digits import quantity
from vibroplat.plots.histories import Drawn, Run, Shown
from vibroplat.plots.measured import FloatArray
from vibroplat.plots.style import new_figure
from vibroplat.plots.timelines import FROM_REST, TURN, coincide, draw_coordinate
from vibroplat.results.labels import plain
from vibroplat.results.picture import CURVES, REFERENCE

#: Range of accelerations along an axis, over the largest one, from which there is a panel.
MATTERS = 1e-3
#: Orders of the exciters up to which a spectrum is drawn, and up to which they are named.
ORDERS, NAMED = 20, 10
#: Largest lines of a spectrum that its title tells, and how far it reaches below and above the largest.
TOLD, BELOW, ABOVE = 3, 1e-4, 8.0

#: A line: run, its column, and what it is called.
_Line = tuple[Run, str, str]


def _lines(runs: Sequence[Run], names: Sequence[str]) -> dict[str, list[_Line]]:
    """Return the lines of each axis that has any acceleration to speak of; the vertical axis first.

    Points of a run that move alike have one line.
    """
    found: dict[str, list[_Line]] = {}
    for axis in "yx":
        for number, run in enumerate(runs):
            begin = f"acceleration_{axis}_"
            for column in (column for column in map(str, run.shown) if column.startswith(begin)):
                point = column.removeprefix(begin).removesuffix("m_per_s2").rstrip("_")
                who = f"point {point}" if point else "centre of mass"
                of = found.setdefault(axis, [])
                for k, (one, other, label) in enumerate(of):
                    if one is run and coincide(run.shown[other], run.shown[column]):
                        of[k] = (run, other, f"{label} = {who}")
                        break
                else:
                    of.append((run, column, f"{names[number]}, {who}" if names else who))
    sizes = {axis: max(float(run.shown[column].abs().max()) for run, column, _ in of) for axis, of in found.items()}
    return {axis: of for axis, of in found.items() if sizes[axis] >= MATTERS * max(sizes.values())}


def _panels(shown: Shown) -> tuple[dict[str, list[_Line]], Figure, list[Axes]]:
    lines = _lines(shown.runs, shown.names)
    figure, axes = new_figure(len(lines), 1, (8.0, 1.2 + 2.3 * len(lines)), sharex=True)
    return lines, figure, list(axes[:, 0])


def draw_accelerations(shown: Shown) -> Drawn:
    """Draw accelerations over time in the rows shown: a panel for each axis, a line for each point."""
    lines, figure, axes = _panels(shown)
    for axis, (along, of) in zip(axes, lines.items(), strict=False):
        for number, (run, column, label) in enumerate(of):
            draw_coordinate(axis, run.shown, column, color=CURVES[number % len(CURVES)], label=label, lw=1.0)
            if shown.data is not None:
                shown.data.draw(axis, "t_s", column, inside=True)
        largest = max(float(run.shown[column].abs().max()) for run, column, _ in of)
        axis.set_ylabel(f"acceleration along {along} (m/s²)")
        axis.set_title(f"up to {quantity(largest, 'm/s²')}", loc="left")
    axes[-1].set_xlabel("time (s)")
    return figure, axes[0]


def amplitude_spectrum(run: Run, column: str) -> tuple[FloatArray, FloatArray]:
    """Return frequencies (Hz) and amplitudes of a column over the last whole turns shown, or over all without one."""
    rows = run.shown.drop_duplicates("t_s", keep="last")
    step = float(np.median(np.diff(rows["t_s"])))
    places = rows["t_s"] / step
    grid = rows[(places - places.round()).abs() < 1e-3]
    turns = math.floor(run.turns * (1.0 + 1e-9))
    count = round(turns / run.turns * float(np.ptp(rows["t_s"])) / step) if turns else len(grid)
    values = grid[column].tail(count).to_numpy(dtype=float)
    weights = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(len(values)) / len(values))
    sizes: FloatArray = np.abs(np.fft.rfft((values - values.mean()) * weights)) / (0.5 * weights.sum())
    return np.asarray(np.fft.rfftfreq(len(values), step), dtype=float), sizes


def _peaks(frequencies: FloatArray, sizes: FloatArray) -> str:
    """Say the largest local maxima of a spectrum."""
    inner = sizes[1:-1]
    tops = 1 + np.flatnonzero((inner >= sizes[:-2]) & (inner > sizes[2:]) & (inner > MATTERS * sizes.max()))
    told = sorted(tops.tolist(), key=lambda place: -sizes[place])[:TOLD]
    return ", ".join(f"{quantity(sizes[k], 'm/s²')} at {quantity(frequencies[k], 'Hz')}" for k in told)


def draw_spectra(shown: Shown) -> Drawn:
    """Draw amplitude spectra of accelerations, with the orders of the exciters; of measured data there are none."""
    lines, figure, axes = _panels(shown)
    run = shown.runs[0]
    speed = float(run.shown["phi1_rate_rad_per_s"].abs().median()) / TURN  # also where a start is shown
    for axis, (along, of) in zip(axes, lines.items(), strict=False):
        found = [amplitude_spectrum(run, column) for run, column, _ in of]
        end = min(found[0][0][-1], ORDERS * speed if run.turns >= 1.0 else math.inf)
        orders = range(1, int(end / speed) + 1) if run.turns >= 1.0 else range(0)
        for order in orders:
            axis.axvline(order * speed, color=REFERENCE, lw=0.6, alpha=0.5)
            if order <= NAMED and axis is axes[0]:
                place = (order * speed, 0.99)
                axis.annotate(f" {order}×", place, xycoords=axis.get_xaxis_transform(), va="top", fontsize=7.5)
        for number, ((frequencies, sizes), (_, _, label)) in enumerate(zip(found, of, strict=True)):
            axis.plot(frequencies, sizes, lw=1.0, color=CURVES[number % len(CURVES)], label=label)
        top = max(float(sizes.max()) for _, sizes in found) or 1.0
        axis.set(xlim=(0.0, end), ylim=(BELOW * top, ABOVE * top), yscale="log")
        axis.set_ylabel(f"amplitude along {along} (m/s²)")
        axis.set_title(_peaks(*found[0]), loc="left")
    turns = f", Hann's window over {math.floor(run.turns)} turns" if run.turns >= 1.0 else ", Hann's window"
    axes[-1].set_xlabel(f"frequency (Hz){turns}; n×: orders of exciter 1")
    return figure, axes[0]


def draw_measured(shown: Shown) -> Drawn:
    """Draw each measured column beside what was computed, with their difference."""
    runs, names, data = shown.runs, shown.names, shown.data
    assert data is not None
    columns = [c for c in map(str, runs[0].shown.select_dtypes("number")) if c != "t_s" and c in data.table]
    figure, axes = new_figure(len(columns), 1, (8.0, 1.2 + 2.1 * len(columns)), sharex=True)
    for column, axis in zip(columns, axes[:, 0], strict=True):
        for number, run in enumerate(runs):
            if column in run.shown:
                look = {"color": CURVES[number % len(CURVES)], "label": names[number] if names else "computed"}
                draw_coordinate(axis, run.shown, column, lw=1.0, **look)
        data.draw(axis, "t_s", column, inside=True).lines[-1].set_label(f"measured: {plain(data.path.name)}")
        axis.set_title(data.told(column), loc="left")
        if column == "y_m" and all(run.from_rest for run in runs):
            axis.set_ylabel(FROM_REST)
    shifted = f"; measured data shifted by {quantity(data.shift, 's', digits=4)}" if data.shift else ""
    axes[-1, 0].set_xlabel(f"time (s){shifted}")
    return figure, axes[0, 0]
