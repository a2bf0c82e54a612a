"""A run on the page: its curves, its events and the machine that moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.page.thinning import FloatArray, extremes, packed
from vibroplat.plots.reading import read_parts
from vibroplat.results.files import Result

#: Most rows of all runs together that are kept as they are, each of 80 bytes: 25 s at 2000 Hz with their events.
ROWS = 52_000
#: Most impacts of a run, which are drawn one by one.
IMPACTS = 5000
#: Intervals over the whole run, of which the smallest and the largest value are kept where it has more rows.
INTERVALS = 1000
#: Turns of the exciters that are shown first.
SHOWN_TURNS = 10
#: Change of an exciter's speed over a run, as a share of its largest speed, from which on the run is a start or a stop.
CHANGE = 0.1

_SPEEDS = ["phi1_rate_rad_per_s", "phi2_rate_rad_per_s"]
_ANGLES = ("phi1_rad", "phi2_rad", *_SPEEDS)
_NEEDED = ("t_s", "x_m", "y_m", "phi_rad", *_ANGLES)
_OPTIONAL = ("gap_m", "upper_m", "contact_force_n", "motor_power_1_w", "motor_power_2_w", "supply_frequency_hz")

#: Panels: title, unit, and the columns of its curves with their labels.
PANELS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("platform y", "m", {"y_m": ""}),
    ("gap", "m", {"gap_m": ""}),
    ("contact force", "N", {"contact_force_n": ""}),
    ("impulse", "N·s", {}),  # stems, of the events
    ("platform x", "m", {"x_m": ""}),
    ("rotation φ", "rad", {"phi_rad": ""}),
    ("upper layer against lower one", "m", {"upper_m": ""}),
    ("speed", "Hz", {"speed_1": "exciter 1", "speed_2": "exciter 2", "synchronous": "synchronous"}),
    ("phase difference", "rad", {"phase": ""}),
    ("motor power", "W", {"motor_power_1_w": "exciter 1", "motor_power_2_w": "exciter 2"}),
)
#: Larger and smaller units of lengths and small angles, by their size in SI units.
_SCALED = {"m": {1e-6: "µm", 1e-3: "mm", 1.0: "m"}, "rad": {1e-6: "µrad", 1e-3: "mrad", 1.0: "rad"}}


@dataclass(frozen=True)
class Times:
    """The rows of a trajectory: how many, its first and last time (s), and the speeds of both exciters then (rad/s)."""

    rows: int
    first: float
    last: float
    speeds: tuple[FloatArray, FloatArray]

    def is_transient(self, scene: Scene) -> bool:
        """Whether the supply has a corner or a speed changes on the way: it is looked at from its beginning."""
        before, after = self.speeds
        changes = np.abs(after - before) > CHANGE * max(np.abs(before).max(), np.abs(after).max())
        supply = scene.drive.intervals
        ramps = any(one.ramp and one.start < self.last and one.end > self.first for one in supply)
        switches = any(self.first < one.start < self.last for one in supply)
        return bool(changes.any()) or ramps or switches


def run_data(
    result: Result,
    scene: Scene,
    summary: Mapping[str, Any],
    events: pd.DataFrame,
    times: Times,
    most: int,
    start: float | None,
    stop: float | None,
    *,
    first: bool = False,
) -> dict[str, Any]:
    """Return what the page shows of a run with two rows or more.

    Parameters
    ----------
    result, scene, summary, events
        The result of the run, what was simulated, its summary and its events.
    times
        The rows of its trajectory.
    most
        Most rows that are kept as they are: the last ones of the interval.
    start, stop
        The interval of these rows (s). Default: the whole run.
    first
        The first rows are kept instead of the last ones.

    Raises
    ------
    TableError
        A table is missing or of another run, or the interval is empty.
    """
    kept = _kept(result, scene, most if first else -most, times, start, stop)
    t = kept["t_s"].to_numpy()
    whole = len(kept) == times.rows
    frequency = summary.get("excitation_frequency_hz")
    return {
        "first": times.first,
        "last": times.last,
        "origin": t[0],
        "end": t[-1],
        "rows": len(kept),
        "of": times.rows,
        "turns": frequency if isinstance(frequency, int | float) and frequency > 0.0 else None,
        "columns": {name: packed(kept[name] - (t[0] if name == "t_s" else 0.0)) for name in kept if name != "mode"},
        "largest": {name: float(kept[name].abs().max()) for name in kept if name != "mode"},
        "modes": "".join(kept["mode"].map(initials).tolist()),
        "coarse": None if whole else _coarse(result, scene, times),
        "impacts": impacts_of(events, t[0], t[-1]),
        "machine": machine_of(scene),
    }


def impacts_of(events: pd.DataFrame, start: float, end: float) -> list[list[float]]:
    """Return times (s) and impulses (N·s) of the last impacts of an interval."""
    struck = events[(events["impulse_n_s"] > 0.0) & events["t_s"].between(start, end)]
    return struck[["t_s", "impulse_n_s"]].tail(IMPACTS).to_numpy(dtype=float).tolist()


def panels(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the panels of curves that the columns of some runs fill, with units that suit their size."""
    largest: dict[str, float] = {}
    for shown in runs:
        for name, size in shown["largest"].items():
            largest[name] = max(size, largest.get(name, 0.0))
    found = []
    for title, unit, labels in PANELS:
        curves = {name: label for name, label in labels.items() if name in largest}
        if curves or (title == "impulse" and any(shown["impacts"] for shown in runs)):
            size, of = 1.0, unit
            if title != "phase difference" and unit in _SCALED:
                size, of = _scaled(unit, max(largest[name] for name in curves))
            drawn = [{"column": name, "factor": 1.0 / size, "label": label} for name, label in curves.items()]
            found.append({"title": title, "unit": of, "curves": drawn})
    return found


def _scaled(unit: str, largest: float) -> tuple[float, str]:
    """Return the unit in which the largest value is at least a fifth, and its size."""
    fitting = [(size, name) for size, name in _SCALED[unit].items() if largest >= 0.2 * size]
    return fitting[-1] if fitting else next(iter(_SCALED[unit].items()))


def initials(mode: object) -> str:
    """Return the letter of a mode."""
    return str(mode)[:1]


def run_times(result: Result) -> Times:
    """Count the rows of a trajectory."""
    rows = 0
    ends: list[pd.Series] = []
    for part in read_parts(result, "trajectory", (), ("t_s", *_SPEEDS)):
        if len(part):
            rows += len(part)
            ends = [ends[0] if ends else part.iloc[0], part.iloc[-1]]
    if not ends:
        return Times(0, math.nan, math.nan, (np.zeros(2), np.zeros(2)))
    (first, before), (last, after) = ((float(row["t_s"]), row[_SPEEDS].to_numpy(dtype=float)) for row in ends)
    return Times(rows, first, last, (before, after))


def _parts(result: Result, scene: Scene) -> Iterator[pd.DataFrame]:
    """Read the trajectory in parts, with what follows from its columns."""
    sign = -1.0 if scene.co_rotating else 1.0
    for part in read_parts(result, "trajectory", "mode", _NEEDED, _OPTIONAL):
        table = part.assign(
            phase=np.mod(part["phi1_rad"] + sign * part["phi2_rad"] + 0.5 * np.pi, 2.0 * np.pi) - 0.5 * np.pi,
            speed_1=part["phi1_rate_rad_per_s"].abs() / (2.0 * np.pi),
            speed_2=part["phi2_rate_rad_per_s"].abs() / (2.0 * np.pi),
            phi1_rad=np.mod(part["phi1_rad"], 2.0 * np.pi),
            phi2_rad=np.mod(part["phi2_rad"], 2.0 * np.pi),
        )
        if "supply_frequency_hz" in part:
            table["synchronous"] = part["supply_frequency_hz"] / scene.exciter_pair[0].pole_pairs
        yield table.drop(columns=[*_ANGLES[2:], "supply_frequency_hz"], errors="ignore")


def _kept(
    result: Result, scene: Scene, most: int, times: Times, start: float | None, stop: float | None
) -> pd.DataFrame:
    """Return the first rows of an interval; with a negative number of them, the last ones."""
    begin, end = times.first if start is None else start, times.last if stop is None else stop
    kept: pd.DataFrame | None = None
    for part in _parts(result, scene):
        inside = part[part["t_s"].between(begin, end)]
        kept = _end(inside if kept is None else pd.concat((kept, inside), ignore_index=True), most)
    if kept is None or kept["t_s"].nunique() < 2:
        raise TableError(
            f"no data between {begin:g} and {end:g} s in {result.directory}; "
            f"allowed: an interval within {times.first:g} … {times.last:g} s"
        )
    return kept


def _end(table: pd.DataFrame, most: int) -> pd.DataFrame:
    return table.head(most) if most > 0 else table.tail(-most)


def _coarse(result: Result, scene: Scene, times: Times) -> dict[str, Any]:
    """Return the extremes of all curves over the whole run: for each column times from its beginning, and values."""
    edges = np.linspace(times.first, times.last, INTERVALS + 1)[1:-1]
    found: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for part in _parts(result, scene):
        t = part["t_s"].to_numpy()
        for name in part.columns.drop(["t_s", "mode", "phi1_rad", "phi2_rad"]):
            found.setdefault(str(name), []).append(extremes(t, part[name].to_numpy(dtype=float), edges))
    return {
        name: {"t": packed(np.concatenate(t) - times.first), "values": packed(np.concatenate(values))}
        for name, (t, values) in ((name, zip(*pieces, strict=True)) for name, pieces in found.items())
    }


def machine_of(scene: Scene) -> dict[str, Any]:
    """Return what the drawing of the machine needs; lengths in m."""
    return {
        "axis": scene.machine.exciter_axis,
        "radii": [exciter.unbalance_radius_m for exciter in scene.exciter_pair],
        "directions": [exciter.direction for exciter in scene.exciter_pair],
        "layers": scene.layers,
        "lower_share": scene.material.lower_share if scene.layers == 2 else 1.0,
        "contact_initial": initials(Mode.ATTACHED.label),
    }
