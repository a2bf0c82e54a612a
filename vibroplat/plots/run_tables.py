"""Reads what figures of a run need of its tables, in parts: tables of long runs do not fit into memory."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.names import COORDINATES, scene_of
from vibroplat.plots.reading import read_parts, read_result

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


class _Length(NamedTuple):
    """How long a run was.

    Attributes
    ----------
    rows
        Rows of its trajectory.
    first, last
        Its first and last time (s).
    subject
        The run in messages.
    option
        How messages call an end of an interval, with places for its name and value.
    """

    rows: int
    first: float
    last: float
    subject: str
    option: str

    def __str__(self) -> str:
        return f"{self.subject} from {self.first:g} to {self.last:g} s"


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
    length = _Length(rows, first, last, f"{directory} runs", "--{} {:g}")
    columns = [column for column in COORDINATES if column not in ("y_m", "x_m", "phi_rad")]
    trajectory = read_parts(result, "trajectory", "mode", ("t_s", "y_m", *_ANGLES), ("x_m", "phi_rad", *columns))
    events = read_parts(result, "events", "kind", ("t_s", "impulse_n_s"))
    return _run(summary, scene_of(result.provenance), trajectory, events, length, start, stop)


def run_of(
    summary: Mapping[str, Any],
    scene: Scene | None,
    trajectory: pd.DataFrame,
    events: pd.DataFrame,
    start: float | None = None,
    stop: float | None = None,
) -> Run:
    """Prepare the tables of a run in memory, from ``start`` to ``stop`` (s).

    Raises
    ------
    TableError
        The trajectory is empty, or the interval holds no data.
    """
    if trajectory.empty:
        raise TableError("the trajectory is empty; there is nothing to plot")
    times = trajectory["t_s"]
    length = _Length(len(times), float(times.min()), float(times.max()), "the run lasted", "{} = {:g}")
    return _run(summary, scene, [trajectory], [events], length, start, stop)


def _run(
    summary: Mapping[str, Any],
    scene: Scene | None,
    trajectory: Iterable[pd.DataFrame],
    events: Iterable[pd.DataFrame],
    length: _Length,
    start: float | None,
    stop: float | None,
) -> Run:
    """Cut the parts of the tables to an interval."""
    begin, end = _interval(length, start, stop)
    frequency = summary["excitation_frequency_hz"]
    chosen = start is not None or stop is not None
    detail = max(begin, end - SHOWN_TURNS / frequency) if frequency and not chosen else begin
    bins = min(max(int((end - begin) * frequency), 1), BINS) if frequency else BINS
    cut = _Cut(begin, end, detail, math.ceil(length.rows / POINTS), bins).read(trajectory)
    shown_events = [part[part["t_s"].between(detail, end)] for part in events]
    shown = pd.concat(cut.shown, ignore_index=True)
    if shown["t_s"].nunique() < 2:
        raise TableError(f"no data between {begin:g} and {end:g} s; {length}")
    return Run(
        summary["name"],
        scene,
        pd.concat(cut.whole, ignore_index=True),
        cut.envelope(),
        shown,
        pd.concat(shown_events, ignore_index=True),
        summary.get("rotation") == "co-rotating",
        chosen,
    )


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


def _interval(length: _Length, start: float | None, stop: float | None) -> tuple[float, float]:
    """Return the interval of the figures; say how long the run was where the one given lies outside, or in part."""
    first, last, option = length.first, length.last, length.option.format
    begin, end = first if start is None else start, last if stop is None else stop
    given = [(name, value) for name, value in (("start", start), ("stop", stop)) if value is not None]
    beyond = [("start", begin)] if begin > last else [("stop", end)] if end < first else []
    for name, value in [(name, value) for name, value in given if math.isnan(value)] + beyond:
        raise TableError(f"{option(name, value)}: {length}; allowed: a time within it")
    if begin >= end:
        raise TableError(f"{option('start', begin)} is not before {option('stop', end)}; {length}")
    for name, value in given:
        if not first <= value <= last:
            _LOG.warning("%s: %s; the figures show what there is", option(name, value), length)
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
