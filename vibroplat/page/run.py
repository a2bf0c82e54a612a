"""A run on the page: the range of each turn over all of it, its last turns, and turns in which the machine moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.page.machine import FRAMES, MOVING, moving
from vibroplat.page.svg import Floats
from vibroplat.plots.reading import Cut, count_turns, ends_of, rest_of, turn_edges, with_forces
from vibroplat.results.picture import finite
from vibroplat.results.run import RunResult

#: Turns that are shown in detail, turns of the run in which the machine moves, and most turns that are its last ones.
LAST_TURNS, MOVING_TURNS, MOST_PERIODS = 3, 60, 4
#: Parts of the run of which the smallest and largest values are kept, about, and rows kept of the detail.
PARTS, ROWS = 400, 4000
#: Turns up to which the whole run shows its curves instead of the range of each turn.
FEW_TURNS = 12
#: Change of the stroke, over its last value, up to which it counts as steady.
STEADY = 0.01

SPEEDS = ("phi1_rate_rad_per_s", "phi2_rate_rad_per_s")
_NEEDED = ("t_s", "x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", *SPEEDS)
_OPTIONAL = (
    *("x_rate_m_per_s", "y_rate_m_per_s", "gap_m", "upper_m", "contact_force_n"),
    *("motor_power_1_w", "motor_power_2_w", "supply_frequency_hz"),
)
EXCITERS = {"speed_1_hz": "exciter 1", "speed_2_hz": "exciter 2", "synchronous_hz": "synchronous"}
#: Panels of all curves: their titles, and columns with what these are called beside each other.
PANELS: tuple[tuple[str, dict[str, str]], ...] = (
    ("Force into the foundation, y", {"force_y_n": "force y"}),
    ("Force into the foundation, x", {"force_x_n": "force x"}),
    ("Platform y from rest", {"y_m": "y"}),
    ("Platform x", {"x_m": "x"}),
    ("Rotation", {"phi_rad": "φ"}),
    ("Gap", {"gap_m": "gap"}),
    ("Upper layer over the lower one", {"upper_m": "upper layer"}),
    ("Contact force", {"contact_force_n": "contact force"}),
    ("Speed", EXCITERS),
    ("Phase difference", {PHASE_COLUMN: "phase difference"}),
    ("Motor power", {"motor_power_1_w": "motor 1", "motor_power_2_w": "motor 2"}),
)


@dataclass(frozen=True)
class RunCurves:
    """What the page shows of a run.

    Attributes
    ----------
    result, first, last
        The run, and its ends (s).
    frequency
        Of the exciters in the measured part (Hz); None if that is not known.
    few
        Whether it has few turns: then its curves are shown instead of the range of each turn.
    range
        Smallest and largest value of each curve (``y_m:min``, ``y_m:max`` …) in parts of the run, and their middles.
    detail
        Rows of the last turns, or of the interval that was asked for.
    impulses
        Times (s) and impulses (N·s) of all impacts.
    motion
        What moves the machine.
    """

    result: RunResult
    first: float
    last: float
    frequency: float | None
    few: bool
    range: pd.DataFrame
    detail: pd.DataFrame
    impulses: pd.DataFrame
    motion: Mapping[str, Any]

    def band(self, column: str, until: float = math.inf) -> tuple[Floats, Floats, Floats] | None:
        """Return times (s), up to one, smallest and largest values of a curve; None if the run has none."""
        if f"{column}:min" not in self.range or self.range[f"{column}:min"].isna().all():
            return None
        band = self.range[["t_s", f"{column}:min", f"{column}:max"]].to_numpy(dtype=float)
        band = band[band[:, 0] <= max(until, band[0, 0])]
        return band[:, 0], band[:, 1], band[:, 2]

    def turns(self, column: str) -> tuple[Floats, Floats, Floats] | None:
        """Return times in the detail (s), and values of a curve twice; None if the run has none."""
        if column not in self.detail or self.detail[column].isna().all():
            return None
        values = self.detail[column].to_numpy(dtype=float)
        return self.detail["t_s"].to_numpy(dtype=float), values, values

    def in_last(self, seconds: float) -> RunCurves:
        """Return it with only the last part of its detail, to compare several runs."""
        times = self.detail["t_s"]
        return replace(self, detail=self.detail[times >= times.iloc[-1] - seconds * (1.0 + 1e-9)])

    def size(self, column: str) -> float:
        """Return the range of a curve over the whole run; 0 if it has none."""
        band = self.band(column)
        return 0.0 if band is None else float(np.nanmax(band[2]) - np.nanmin(band[1]))

    @property
    def main(self) -> str:
        """The column of what moves most in operation: along x or y, or the exciters' axes as the machine rocks."""
        s, arm = self.result.summary, self.result.scene.body.distance
        sizes = {"y_m": s.get("rms_y_m"), "x_m": s.get("rms_x_m"), "phi_rad": arm * (s.get("rms_phi_rad") or 0.0)}
        return max(sizes, key=lambda column: sizes[column] or 0.0)

    @property
    def steady(self) -> float | None:
        """When the largest motion had come within 1 % of its last range for good (s); None if it did not."""
        low, high = (self.band(self.main) or (np.zeros(0),) * 3)[1:]
        known = np.isfinite(low) & np.isfinite(high)
        strokes = (high - low)[known]
        if len(strokes) < 20 or not strokes[-1] > 0.0:
            return None
        end = float(np.median(strokes[-5:]))
        away = np.flatnonzero(np.abs(strokes - end) > STEADY * end)
        if not len(away):
            return self.first
        return None if away[-1] >= 0.95 * len(strokes) else float(self.range["t_s"].to_numpy()[known][away[-1]])


def run_curves(
    result: RunResult, events: pd.DataFrame, start: float | None = None, stop: float | None = None
) -> RunCurves | None:
    """Return what the page shows of a run, None if it has less than two rows.

    Parameters
    ----------
    found, events
        The run and its events.
    start, stop
        Interval shown in detail, and in which the machine moves (s). Default: the last turns, and the whole run.

    Raises
    ------
    TableError
        A table is missing or of another run, or the interval is empty.
    """
    ends = ends_of(result.column_parts("trajectory", (), ("t_s", "phi1_rad", "phi2_rad")))
    if ends is None or ends.rows < 2 or ends.first["t_s"] == ends.last["t_s"]:
        return None
    first, last = float(ends.first["t_s"]), float(ends.last["t_s"])
    known = result.summary.get("excitation_frequency_hz")
    frequency = float(known) if isinstance(known, int | float) and known > 0.0 else None
    begin, end = first if start is None else start, last if stop is None else stop
    detail = begin
    if start is None and stop is None and frequency is not None:
        detail = max(first, last - LAST_TURNS / frequency)
    few = bool(count_turns(ends.evenly).max(initial=0.0) <= FEW_TURNS)
    edges = np.linspace(first, last, PARTS + 1) if few else turn_edges(ends.evenly, first, last, PARTS)
    columns = [column for _, panel in PANELS for column in panel]
    cut = Cut(curves_of(result), (detail, end), edges, (*columns, *accelerations(result.scene)))
    if cut.shown["t_s"].nunique() < 2:
        allowed = f"allowed: an interval within {first:g} … {last:g} s"
        raise TableError(f"no data between {begin:g} and {end:g} s in {result.directory}; {allowed}")
    struck = events.loc[events["impulse_n_s"] > 0.0, ["t_s", "impulse_n_s"]]
    motion = _motion(result, struck, max(begin, first), min(end, last), frequency, ends.evenly)
    shown = cut.shown.iloc[np.unique([*range(0, len(cut.shown), max(1, len(cut.shown) // ROWS)), len(cut.shown) - 1])]
    return RunCurves(result, first, last, frequency, few, cut.envelope(), shown, struck, motion)


def curves_of(result: RunResult) -> Iterator[pd.DataFrame]:
    """Read a trajectory in parts, with the curves that follow from its columns."""
    scene = result.scene
    rest = rest_of(scene)
    forward = [exciter.direction / (2.0 * math.pi) for exciter in scene.exciter_pair]
    weights = scene.phase_weights
    optional = (*_OPTIONAL, *accelerations(scene))
    for part in map(finite, result.column_parts("trajectory", ("mode",), _NEEDED, optional)):
        angles = part[["phi1_rad", "phi2_rad"]].to_numpy(dtype=float)
        table = with_forces(part, scene).assign(
            y_m=part["y_m"] - rest,
            speed_1_hz=forward[0] * part[SPEEDS[0]],
            speed_2_hz=forward[1] * part[SPEEDS[1]],
            **{PHASE_COLUMN: wrap_phase(angles @ np.asarray(weights))},
        )
        if "gap_m" in part:
            table["underside_m"] = table["y_m"] + part["gap_m"]
        if "supply_frequency_hz" in part:
            table["synchronous_hz"] = part["supply_frequency_hz"] / scene.exciter_pair[0].pole_pairs
        yield table


def accelerations(scene: Scene) -> dict[str, str]:
    """Return the columns of accelerations that a trajectory may have, and whose they are."""
    points = {"": "centre of mass"} | {f"{name}_": name for name in scene.output.points}
    return {f"acceleration_{axis}_{name}m_per_s2": f"{axis}, {text}" for name, text in points.items() for axis in "xy"}


def wrap_phase(phase: Any) -> Floats:
    """Return angles from -π/2 to 3π/2, so that 0 and π, near which exciters synchronize, are well inside."""
    angle: Floats = np.mod(np.asarray(phase, dtype=float) + 0.5 * math.pi, 2.0 * math.pi) - 0.5 * math.pi
    return angle


# -- turns in which the machine moves ----------------------------------------------------------------------------------


def _motion(
    result: RunResult, struck: pd.DataFrame, begin: float, end: float, frequency: float | None, evenly: pd.DataFrame
) -> dict[str, Any]:
    """Return turns evenly over an interval, and the last ones, as what moves the machine.

    They begin where exciter 1 passes the same angle, so that one goes on where another one ends.
    """
    thin = evenly[evenly["t_s"].between(begin, end)]
    turns = result.scene.exciter_pair[0].direction * thin["phi1_rad"].to_numpy(dtype=float) / (2.0 * math.pi)
    period = result.summary.get("period")
    last = min(period, MOST_PERIODS) if isinstance(period, int) and period > 0 else MOST_PERIODS if period == 0 else 1
    windows = windows_of(thin["t_s"].to_numpy(dtype=float), turns, frequency, last)
    times = np.concatenate([np.linspace(a, b, count, endpoint=False) for a, b, count in windows])
    frames = frames_at(result, times)
    firsts = np.cumsum([0, *(count for *_, count in windows)]).tolist()
    if "along_m" in frames:
        frames["along_m"] -= np.repeat(frames["along_m"].to_numpy()[firsts[:-1]], np.diff(firsts))
    places = [[round(a, 6), round(b - a, 7), first, n] for (a, b, n), first in zip(windows, firsts, strict=False)]
    hits = [
        hit
        for (a, b, n), first in zip(windows, firsts, strict=False)
        for hit in impulses_of(struck, a, b - a, n, first)
    ]
    return moving(frames, result.scene, hits, windows=places, turns=last)


def windows_of(t: Floats, turns: Floats, frequency: float | None, last: int) -> list[tuple[float, float, int]]:
    """Return begin, end (s) and frames of turns evenly over a run, the last one of so many turns.

    Where exciter 1 does not turn, they are as long as its turns in the measured part.
    """
    grown, start, stop = np.maximum.accumulate(turns), float(t[0]), float(t[-1])
    rate = frequency or max(float(grown[-1] - grown[0]), 1.0) / (stop - start)
    usual = min(1.0 / rate, stop - start)
    end = float(np.floor(grown[-1] + 1e-6))
    windows: list[tuple[float, float, int]] = []
    for begin in np.linspace(start, max(stop - last * usual, start), MOVING_TURNS + 1)[:-1].tolist():
        turn = math.ceil(float(np.interp(begin, t, grown)) - 1e-6)
        a, b = np.interp([turn, turn + 1], grown, t).tolist()
        if turn + 1 > end or b - a > 4.0 * usual or a - begin > 4.0 * usual:
            a, b = begin, min(begin + usual, stop)
        if b > a and (not windows or a >= windows[-1][1] - 1e-9):
            windows.append((a, b, FRAMES))
    turn = max(end - last, math.ceil(grown[0]))
    a, b = np.interp([turn, turn + last], grown, t).tolist()
    if not 0.0 < b - a <= 4.0 * last * usual or stop - b > 2.0 * usual:
        a, b = max(stop - last * usual, start), stop
    return [*(one for one in windows if one[1] <= a + 1e-9), (a, b, FRAMES * last)]


def frames_at(result: RunResult, times: Floats) -> pd.DataFrame:
    """Return what moves a machine at some times, which ascend; of each part of a trajectory the rows around them."""
    frames = []
    for part in result.column_parts("trajectory", (), ("t_s", *MOVING[:5]), MOVING[5:]):
        after = np.searchsorted(part["t_s"], times)
        places = np.unique(np.clip([after - 1, after], 0, max(len(part) - 1, 0)))
        frames.append(finite(part.iloc[places[: len(part)]]))
    return resample(pd.concat(frames), result.scene, times)


def resample(trajectory: pd.DataFrame, scene: Scene, times: Floats, *more: str) -> pd.DataFrame:
    """Return what moves a machine, and more columns, at some times; between rows it changes evenly."""
    t = trajectory["t_s"].to_numpy(dtype=float)
    names = [name for name in (*MOVING, *more) if name in trajectory]
    frames = pd.DataFrame({name: np.interp(times, t, trajectory[name].to_numpy(dtype=float)) for name in names})
    return frames.assign(**{name: frames[name] - rest_of(scene, axis) for axis, name in enumerate(MOVING[:3])})


def impulses_of(struck: pd.DataFrame, begin: float, seconds: float, frames: int, first: int = 0) -> list[list[float]]:
    """Return frames, counted from the first one of a time, at which material strikes, and its impulses (N·s)."""
    inside = struck[struck["t_s"].between(begin, begin + seconds, inclusive="left") & (struck["impulse_n_s"] > 0.0)]
    at = first + (inside["t_s"] - begin) / seconds * frames
    return [[round(float(a), 2), float(f"{p:.3g}")] for a, p in zip(at, inside["impulse_n_s"], strict=True)]
