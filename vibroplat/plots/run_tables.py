"""Reads what figures of a run need of its tables, in parts: tables of long runs do not fit into memory."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from vibroplat.errors import TableError
from vibroplat.plots.names import COORDINATES, scene_of
from vibroplat.plots.reading import read_parts, read_result
from vibroplat.scene import Scene

_LOG = logging.getLogger("vibroplat")

#: Most points of a line, more than a figure can show.
POINTS = 20_000
#: Most intervals of an envelope; none is shorter than a turn, over which it would not be one.
BINS = 400
#: Turns of the exciters that are shown in detail if no interval is given.
SHOWN_TURNS = 10

_ANGLES = ("phi1_rad", "phi2_rad", "phi1_rate_rad_per_s", "phi2_rate_rad_per_s")


@dataclass(frozen=True)
class Run:
    """Tables of a run over the interval of its figures.

    Attributes
    ----------
    name, scene
        Its name, and its scene if the configuration can be read.
    whole
        The trajectory in that interval, thinned out.
    envelope
        Its least and largest values in short intervals: columns ``t_s``, ``y_m:min``, ``y_m:max`` …
    shown
        The rows shown in detail: all in the interval if one was given, otherwise the last turns.
    events
        The events among them.
    co_rotating
        Whether the exciters co-rotate.
    chosen
        Whether an interval was given.
    """

    name: str
    scene: Scene | None
    whole: pd.DataFrame
    envelope: pd.DataFrame
    shown: pd.DataFrame
    events: pd.DataFrame
    co_rotating: bool
    chosen: bool

    @property
    def turns(self) -> float:
        """Turns of exciter 1 in the rows shown."""
        angles = self.shown["phi1_rad"]
        return abs(float(angles.iloc[-1] - angles.iloc[0])) / (2.0 * math.pi)


def read_run(directory: Path, start: float | None = None, stop: float | None = None) -> Run:
    """Read the tables of a run from ``start`` to ``stop`` (s).

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval holds no data.
    """
    result = read_result(directory, "run")
    summary = result.document("summary")
    if not _is_summary(summary):
        raise TableError(f"{directory / 'summary.json'} is not the summary of a run")
    parts = (part["t_s"] for part in read_parts(result, "trajectory", (), ("t_s",)))
    times = [(len(part), part.min(), part.max()) for part in parts if len(part)]
    if not times:
        raise TableError(f"{directory} holds an empty trajectory; there is nothing to plot")
    rows, first, last = sum(n for n, *_ in times), float(min(t for _, t, _ in times)), float(max(t for *_, t in times))
    begin, end = _interval(directory, first, last, start, stop)
    frequency = summary["excitation_frequency_hz"]
    chosen = start is not None or stop is not None
    detail = max(begin, end - SHOWN_TURNS / frequency) if frequency and not chosen else begin
    columns = [column for column in COORDINATES if column not in ("y_m", "x_m", "phi_rad")]
    trajectory = read_parts(result, "trajectory", "mode", ("t_s", "y_m", *_ANGLES), ("x_m", "phi_rad", *columns))
    bins = min(max(int((end - begin) * frequency), 1), BINS) if frequency else BINS
    cut = _Cut(begin, end, detail, math.ceil(rows / POINTS), bins).read(trajectory)
    events = [part[part["t_s"].between(detail, end)] for part in read_parts(result, "events", "kind", _EVENTS)]
    shown = pd.concat(cut.shown, ignore_index=True)
    if shown["t_s"].nunique() < 2:
        raise TableError(f"no data between {begin:g} and {end:g} s; {directory} runs from {first:g} to {last:g} s")
    return Run(
        summary["name"],
        scene_of(result.provenance),
        pd.concat(cut.whole, ignore_index=True),
        cut.envelope(),
        shown,
        pd.concat(events, ignore_index=True),
        summary.get("rotation") == "co-rotating",
        chosen,
    )


_EVENTS = ("t_s", "impulse_n_s")


class _Cut:
    """Collects the interval of the figures from the parts of a trajectory."""

    def __init__(self, begin: float, end: float, detail: float, every: int, bins: int) -> None:
        self.whole: list[pd.DataFrame] = []
        self.shown: list[pd.DataFrame] = []
        self._begin, self._end, self._detail, self._every, self._bins = begin, end, detail, every, bins
        self._extremes: list[pd.DataFrame] = []
        self._rows = 0

    def read(self, parts: Iterable[pd.DataFrame]) -> _Cut:
        for part in parts:
            inside = part["t_s"].between(self._begin, self._end)
            thinned = part.iloc[-self._rows % self._every :: self._every]
            self.whole.append(thinned[inside.loc[thinned.index]])
            self.shown.append(part[part["t_s"].between(self._detail, self._end)])
            self._extremes.append(self._of_bins(part[inside]))
            self._rows += len(part)
        return self

    def _of_bins(self, part: pd.DataFrame) -> pd.DataFrame:
        """Return the extremes of the coordinates in each bin."""
        width = (self._end - self._begin) / self._bins or 1.0
        bins = ((part["t_s"] - self._begin) / width).clip(0, self._bins - 1).astype(int).rename("bin")
        found = part[[c for c in COORDINATES if c in part]].groupby(bins).agg(["min", "max"])
        found.columns = [":".join(names) for names in found.columns]
        return found

    def envelope(self) -> pd.DataFrame:
        """Return the extremes in the bins of all parts."""
        table = pd.concat(self._extremes)
        ends = {column: str(column).rpartition(":")[2] for column in table}
        found = table.groupby(level=0).agg(ends)
        middle = self._begin + (found.index.to_numpy() + 0.5) * (self._end - self._begin) / self._bins
        return found.assign(t_s=middle).reset_index(drop=True)


def _interval(
    directory: Path, first: float, last: float, start: float | None, stop: float | None
) -> tuple[float, float]:
    """Return the interval of the figures; say how long the run was where the one given lies outside, or in part."""
    begin, end = first if start is None else start, last if stop is None else stop
    length = f"{directory} runs from {first:g} to {last:g} s"
    for option, value in (("--start", start), ("--stop", stop)):
        if value is not None and math.isnan(value):
            raise TableError(f"{option} {value}: {length}; allowed: a time within it")
    if begin > last or end < first:
        option, value = ("--start", begin) if begin > last else ("--stop", end)
        raise TableError(f"{option} {value:g}: {length}; allowed: a time within it")
    if begin >= end:
        raise TableError(f"--start {begin:g} is not before --stop {end:g}; {length}")
    for option, value in (("--start", start), ("--stop", stop)):
        if value is not None and not first <= value <= last:
            _LOG.warning("%s %g: %s; the figures show what there is", option, value, length)
    return max(begin, first), min(end, last)


def _is_summary(found: object) -> bool:
    """Whether a document has what figures need of the summary of a run."""
    if not isinstance(found, dict) or not isinstance(found.get("name"), str) or "excitation_frequency_hz" not in found:
        return False
    frequency = found["excitation_frequency_hz"]
    return frequency is None or (type(frequency) in (int, float) and frequency >= 0.0)


def matters(runs: Iterable[Run], column: str) -> bool:
    """Whether a coordinate moves by a visible share of what the platform moves in any of these runs."""
    return any(_range(run, column) > 0.05 * max(_range(run, c) for c in ("x_m", "y_m", "phi_rad")) for run in runs)


def _range(run: Run, column: str) -> float:
    """Return the range of a coordinate over the whole interval (m)."""
    ends = [f"{column}:min", f"{column}:max"]
    return range_of(run.envelope[ends], run, column) if ends[0] in run.envelope else 0.0


def range_of(values: pd.DataFrame | pd.Series, run: Run, column: str) -> float:
    """Return the range of a coordinate's values (m); of a rotation, that of the exciters' axes."""
    arm = (run.scene.machine.exciter_distance_m if run.scene else 0.1) if column == "phi_rad" else 1.0
    found = values.to_numpy(dtype=float)
    found = found[np.isfinite(found)]
    return arm * float(np.ptp(found)) if len(found) else 0.0
