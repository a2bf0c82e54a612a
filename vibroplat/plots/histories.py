"""Tables of runs, prepared for figures: an interval of them, thinned out, the range of values over time, and spectra.

The spectrum of accelerations is that of amplitudes: of the last whole turns of exciter 1 that are shown, at the times
of the output grid, without the mean, weighted with Hann's window, it is the size of numpy's real FFT over half the sum
of the weights. An oscillation that repeats within these turns so has its amplitude at its frequency, and nothing two
lines away from it (Harris, On the use of windows for harmonic analysis, Proc. IEEE 66, 1978). Impacts make
accelerations jump and have no upper frequency: what lies above half the sampling rate stands below it, with about the
amplitudes that are left there (:func:`folded_size`), and lines that are not larger have no name. With two samples of a
turn or fewer the excitation itself would stand at another frequency, and there is no spectrum.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import COORDINATES, FORCES
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import number, quantity
from vibroplat.config.plausibility import MIN_SAMPLES_OF_SPECTRUM
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.observe.tables import acceleration_columns
from vibroplat.plots.reading import Cut, Ends, Floats, ends_of, rest_of, turn_edges, with_forces
from vibroplat.results.answer import counted
from vibroplat.results.run import RunResult
from vibroplat.results.run_answer import rests

_LOG = logging.getLogger("vibroplat")

#: Most points of a line, more than a figure can show.
POINTS = 20_000
#: Most parts of an envelope, about; none is shorter than a turn, over which it would not be one.
BINS = 400
#: Turns shown next to a whole run; turns kept in detail if no interval is given, which are shown if the motion does not
#: repeat within them; and the minimum number of samples, which may need more turns.
LAST_TURNS, SHOWN_TURNS, FEWEST = 3, 10, 10

#: Decimals, in SI units, that are shown of lengths and other quantities of a machine that comes to rest.
LENGTHS, OTHERS = 9, 7
#: Distance of a time from the output grid that is round-off, over its step.
OFF_GRID = 1e-3

#: Speeds of both exciters, as in tables and as in figures.
RATES, SPEEDS = ("phi1_rate_rad_per_s", "phi2_rate_rad_per_s"), ("speed_1_hz", "speed_2_hz")
_ANGLES = ("phi1_rad", "phi2_rad")
_MOVING_RATES = ("x_rate_m_per_s", "y_rate_m_per_s", "phi_rate_rad_per_s")
#: Columns that the page shows in addition: the upper layer relative to the lower one, and powers of both motors.
FURTHER, POWERS = "upper_m", ("motor_power_1_w", "motor_power_2_w")
#: Minimum range of accelerations along an axis, and of lines of a spectrum, relative to the largest one, to be shown.
MATTERS = 1e-3
#: Relative difference of the accelerations of points that move alike, and number of spectral lines that are named.
SAME, NAMED_PEAKS = 0.015, 3
#: Upper part of a spectrum that shows what is left at its end, in half the sampling rate and at least in orders.
UPPER_PART, UPPER_ORDERS = 0.25, 2.0


@dataclass(frozen=True)
class RunTables:
    """Tables of a run over the interval of its figures.

    Attributes
    ----------
    name, scene
        Its name, and its scene if the configuration can be read.
    whole
        The trajectory in that interval, thinned out.
    envelope
        Its minima and maxima in whole turns: columns ``t_s``, ``y_m:min``, ``y_m:max`` …
    shown
        The rows shown in detail: all in the interval if one was given, otherwise the last turns.
    events
        The events among them.
    co_rotating
        Whether the exciters co-rotate.
    chosen
        Whether an interval was given.
    from_rest
        Whether y is counted from the static rest; if that is not known, it is as in the table.
    summary
        The summary of the whole run.
    ends
        First and last row of the whole run, and rows evenly over it.
    """

    name: str
    scene: Scene | None
    whole: pd.DataFrame
    envelope: pd.DataFrame
    shown: pd.DataFrame
    events: pd.DataFrame
    co_rotating: bool
    chosen: bool
    from_rest: bool
    summary: Mapping[str, Any] = field(default_factory=dict)
    ends: Ends | None = None

    @property
    def turns(self) -> float:
        """Turns of exciter 1 in the rows shown."""
        return turns_of(self.shown)

    @property
    def is_long(self) -> bool:
        """Whether it is much longer than its part shown in detail."""
        return float(np.ptp(self.whole["t_s"])) > 1.5 * float(np.ptp(self.last["t_s"]))

    @cached_property
    def last(self) -> pd.DataFrame:
        """Rows of the last turns, which are shown next to the whole run; all shown rows if an interval was given."""
        turns = (self.shown["phi1_rad"] - self.shown["phi1_rad"].iloc[-1]).abs() / TURN
        rows = self.shown[turns <= shown_turns(self.summary)]
        return self.shown if self.chosen or len(rows) < FEWEST else rows

    @cached_property
    def sample_rate(self) -> float:
        """Rows of the output grid in a second."""
        if self.scene is not None:
            return self.scene.output.sample_rate_hz
        return 1.0 / float(np.median(np.diff(self.shown["t_s"].unique())))

    @cached_property
    def samples(self) -> pd.DataFrame:
        """Rows shown that are on the output grid, over the last whole turns shown, or over all without one.

        Times are compared with multiples of the step, which is as exact late in a run as at its beginning.
        """
        places = self.shown["t_s"] * self.sample_rate
        away = (places - places.round()).abs()
        grid = self.shown.loc[away[away < OFF_GRID].groupby(places.round()).idxmin()]
        turns = math.floor(self.turns * (1.0 + 1e-9))
        count = round(turns / self.turns * float(np.ptp(self.shown["t_s"])) * self.sample_rate) if turns else len(grid)
        return grid.tail(count)

    @cached_property
    def speed(self) -> float:
        """Speed of exciter 1 in most of the rows shown (Hz), also where a start is shown."""
        return float(self.shown[SPEEDS[0]].abs().median())

    @property
    def too_coarse(self) -> str:
        """Which samples a spectrum lacks; "" if there are enough."""
        fastest = float(self.shown[[*SPEEDS]].abs().max().max())
        each = self.sample_rate / fastest if fastest > 0.0 else math.inf
        if each <= MIN_SAMPLES_OF_SPECTRUM:
            return f"{number(each, 2)} samples a turn"
        return counted(len(self.samples), "sample") if len(self.samples) < FEWEST else ""

    @property
    def arm(self) -> float:
        """Distance from the centre of mass at which rotations of the platform are compared with its motion (m)."""
        return self.scene.body.distance if self.scene else 0.1

    def range_of(self, column: str) -> float:
        """Return the range of a coordinate over the whole interval (m); for a rotation, that of the exciters' axes."""
        low, high = (self.envelope.get(f"{column}:{end}") for end in ("min", "max"))
        size = 0.0 if low is None or high is None else float(high.max() - low.min())
        return (self.arm if column == "phi_rad" else 1.0) * size if np.isfinite(size) else 0.0


def turns_of(table: pd.DataFrame) -> float:
    """Return the turns of exciter 1 in a trajectory."""
    angles = table["phi1_rad"]
    return abs(float(angles.iloc[-1] - angles.iloc[0])) / TURN


def shown_turns(summary: Mapping[str, Any]) -> int:
    """Return the turns that are shown in detail: several periods of the motion, as far as it repeats."""
    period = summary.get("period")
    return min(max(LAST_TURNS, 2 * period - 1), SHOWN_TURNS) if isinstance(period, int) and period else SHOWN_TURNS


def run_of(
    result: RunResult, start: float | None = None, stop: float | None = None, more: Iterable[str] = ()
) -> RunTables:
    """Cut the tables of a run from ``start`` to ``stop`` (s).

    Of the trajectory it has what figures show, and ``more`` columns if the table has them.

    Raises
    ------
    TableError
        A table is missing, the trajectory is empty, or the interval holds no data.
    """
    summary, scene = result.summary, result.known_scene
    frequency = summary.get("excitation_frequency_hz", "")
    known = frequency is None or (type(frequency) in (int, float) and frequency >= 0.0)
    if not known or not isinstance(summary.get("name"), str):
        raise TableError(f"{result.place}/summary.json is not the summary of a run")
    ends = ends_of(result.column_parts("trajectory", (), ("t_s", *_ANGLES)))
    if ends is None:
        raise TableError(f"{result.place} holds an empty trajectory; there is nothing to plot")
    first, last = float(ends.first["t_s"]), float(ends.last["t_s"])
    length = f"{result.place} runs from {first:g} to {last:g} s"
    given = {"start": start, "stop": stop}
    begin, end = _interval(first, last, {name: at for name, at in given.items() if at is not None}, length)
    chosen = start is not None or stop is not None
    sparse = 0.0 if scene is None else FEWEST / scene.output.sample_rate_hz
    detail = max(begin, end - max(SHOWN_TURNS / frequency, sparse)) if frequency and not chosen else begin
    sag = summary.get("static_sag_m") if scene is None else -rest_of(scene)
    moved = () if scene is None else acceleration_columns(scene.output.points)
    optional = {*COORDINATES, *_MOVING_RATES, FURTHER, *POWERS, *moved, *more} - {
        "t_s",
        "mode",
        "y_m",
        *_ANGLES,
        *RATES,
    }
    senses = [-1.0 if ends.last[angle] < ends.first[angle] else 1.0 for angle in _ANGLES]
    parts = (
        _with_more(part, scene, senses).assign(y_m=part["y_m"] + (sag or 0.0))
        for part in result.column_parts("trajectory", ("mode",), ("t_s", "y_m", *_ANGLES, *RATES), optional)
    )
    if scene is not None and rests(scene, summary):
        parts = (part.round({c: LENGTHS if str(c).endswith("_m") else OTHERS for c in part}) for part in parts)
    columns = (*COORDINATES, *FORCES, *SPEEDS, FURTHER, *POWERS)
    edges = turn_edges(ends.evenly, begin, end, BINS)
    curves = Cut(parts, (detail, end), edges, columns, every=math.ceil(ends.rows / POINTS))
    if curves.shown["t_s"].nunique() < 2:
        raise TableError(f"no data between {begin:g} and {end:g} s; {length}")
    events = result.column_parts("events", ("kind",), ("t_s", "impulse_n_s"))
    shown_events = pd.concat([part[part["t_s"].between(detail, end)] for part in events], ignore_index=True)
    co_rotating = summary.get("relative_rotation") == "co-rotating"
    cut = (curves.thinned, curves.envelope(), curves.shown, shown_events)
    return RunTables(summary["name"], scene, *cut, co_rotating, chosen, sag is not None, summary, ends)


def whole_of(result: RunResult, more: Iterable[str] = ()) -> pd.DataFrame:
    """Return all rows of a run as figures have them; raises TableError as :func:`run_of`."""
    times = [part["t_s"] for part in result.column_parts("trajectory", (), ("t_s",)) if len(part)]
    return run_of(result, float(times[0].iloc[0]) if times else None, None, more).shown


def _with_more(part: pd.DataFrame, scene: Scene | None, senses: Sequence[float]) -> pd.DataFrame:
    """Add to a part of a trajectory the exciters' speeds, and the forces into the foundation if they are known.

    Speeds (Hz) are positive in the direction in which an exciter turns on the whole.
    """
    speeds = {name: sense * part[rate] / TURN for name, rate, sense in zip(SPEEDS, RATES, senses, strict=True)}
    part = part.assign(**speeds)
    return part if scene is None else with_forces(part, scene)


def _interval(first: float, last: float, given: Mapping[str, float], length: str) -> tuple[float, float]:
    """Return the interval of the figures; log the length of the run if the given interval is not inside of it."""
    begin, end = given.get("start", first), given.get("stop", last)
    wrong = {name: at for name, at in given.items() if math.isnan(at) or (at > last if name == "start" else at < first)}
    for name, at in wrong.items():
        raise TableError(f"--{name} {at:g}: {length}; allowed: a time within it")
    if begin >= end:
        raise TableError(f"--start {begin:g} is not before --stop {end:g}; {length}")
    for name, at in given.items():
        if not first <= at <= last:
            _LOG.warning("--%s %g: %s; the figures show what there is", name, at, length)
    return max(begin, first), min(end, last)


def lines_of(runs: Sequence[RunTables], names: Sequence[str]) -> dict[str, list[tuple[RunTables, str, str]]]:
    """Return runs, columns and names of lines for each axis that has any acceleration to speak of, the vertical first.

    Axes are called by the column of the centre of mass. Points of a run that move alike have one line.
    """
    groups: dict[str, list[tuple[RunTables, str, str]]] = {}
    for axis in "yx":
        for place, run in enumerate(runs):
            begin = f"acceleration_{axis}_"
            for column in (column for column in map(str, run.shown) if column.startswith(begin)):
                point = column.removeprefix(begin).removesuffix("m_per_s2").rstrip("_")
                who = f"point {point}" if point else "centre of mass"
                of = groups.setdefault(f"{begin}m_per_s2", [])
                values = run.shown[column]
                for k, (one, other, label) in enumerate(of):
                    if one is run and (run.shown[other] - values).abs().max() <= SAME * values.abs().max():
                        of[k] = (run, other, f"{label} = {who}")
                        break
                else:
                    of.append((run, column, f"{names[place]}, {who}" if names else who))
    sizes = {axis: max(float(run.shown[column].abs().max()) for run, column, _ in of) for axis, of in groups.items()}
    return {axis: of for axis, of in groups.items() if sizes[axis] >= MATTERS * max(sizes.values())}


def spectrum_of(run: RunTables, column: str) -> tuple[Floats, Floats]:
    """Return frequencies (Hz) and amplitudes of a column over the last whole turns shown, or over all without one."""
    values = run.samples[column].to_numpy(dtype=float)
    weights = 0.5 - 0.5 * np.cos(TURN * np.arange(len(values)) / len(values))
    sizes: Floats = np.abs(np.fft.rfft((values - values.mean()) * weights)) / (0.5 * weights.sum())
    return np.asarray(np.fft.rfftfreq(len(values), 1.0 / run.sample_rate), dtype=float), sizes


def folded_size(frequencies: Floats, sizes: Floats, speed: float) -> float:
    """Return the amplitude up to which lines of a spectrum may be orders above its end that are folded back.

    It is the largest one in its upper part, without the line at the speed of an exciter (Hz): with fewer than four
    samples of a turn that has no other order, and all lines may be folded. Of 80 motions at 46 … 75 Hz of supply, in
    steady motion and chaos, sampled 2 to 90 times a turn, none of 1580 lines above it was folded; of all, 234 of 2331.
    """
    end = float(frequencies[-1])
    if end < UPPER_ORDERS * speed:
        return float(sizes.max())
    upper = frequencies >= min((1.0 - UPPER_PART) * end, end - UPPER_ORDERS * speed)
    beside = np.abs(frequencies - speed) > 2.0 * frequencies[1]
    return float(sizes[upper & beside].max(initial=0.0))


def peaks_of(frequencies: Floats, sizes: Floats, speed: float) -> str:
    """Say the largest local maxima of a spectrum at the speed of an exciter (Hz), and those that are not folded."""
    inner, least = sizes[1:-1], max(MATTERS * sizes.max(), folded_size(frequencies, sizes, speed))
    known = (inner > least) | (np.abs(frequencies[1:-1] - speed) <= frequencies[1])
    tops = 1 + np.flatnonzero((inner >= sizes[:-2]) & (inner > sizes[2:]) & known)
    peaks = sorted(tops.tolist(), key=lambda peak: -sizes[peak])[:NAMED_PEAKS]
    return ", ".join(f"{quantity(sizes[k], 'm/s²')} at {quantity(frequencies[k], 'Hz')}" for k in peaks)
