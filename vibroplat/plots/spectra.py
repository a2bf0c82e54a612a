"""Accelerations of runs by axes, and their spectra.

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

from vibroplat.config.digits import quantity
from vibroplat.plots.axes import FloatArray
from vibroplat.plots.histories import Run

#: Range of accelerations along an axis, and of lines of a spectrum, over the largest one, from which they are shown.
MATTERS = 1e-3
#: Distance of points that move alike, over their accelerations, and the largest lines of a spectrum that are told.
SAME, TOLD = 0.015, 3


def lines_of(runs: Sequence[Run], names: Sequence[str]) -> dict[str, list[tuple[Run, str, str]]]:
    """Return runs, columns and names of lines for each axis that has any acceleration to speak of, the vertical first.

    Axes are called by the column of the centre of mass. Points of a run that move alike have one line.
    """
    found: dict[str, list[tuple[Run, str, str]]] = {}
    for axis in "yx":
        for number, run in enumerate(runs):
            begin = f"acceleration_{axis}_"
            for column in (column for column in map(str, run.shown) if column.startswith(begin)):
                point = column.removeprefix(begin).removesuffix("m_per_s2").rstrip("_")
                who = f"point {point}" if point else "centre of mass"
                of = found.setdefault(f"{begin}m_per_s2", [])
                values = run.shown[column]
                for k, (one, other, label) in enumerate(of):
                    if one is run and (run.shown[other] - values).abs().max() <= SAME * values.abs().max():
                        of[k] = (run, other, f"{label} = {who}")
                        break
                else:
                    of.append((run, column, f"{names[number]}, {who}" if names else who))
    sizes = {axis: max(float(run.shown[column].abs().max()) for run, column, _ in of) for axis, of in found.items()}
    return {axis: of for axis, of in found.items() if sizes[axis] >= MATTERS * max(sizes.values())}


def spectrum_of(run: Run, column: str) -> tuple[FloatArray, FloatArray]:
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


def peaks_of(frequencies: FloatArray, sizes: FloatArray) -> str:
    """Say the largest local maxima of a spectrum."""
    inner = sizes[1:-1]
    tops = 1 + np.flatnonzero((inner >= sizes[:-2]) & (inner > sizes[2:]) & (inner > MATTERS * sizes.max()))
    told = sorted(tops.tolist(), key=lambda place: -sizes[place])[:TOLD]
    return ", ".join(f"{quantity(sizes[k], 'm/s²')} at {quantity(frequencies[k], 'Hz')}" for k in told)
