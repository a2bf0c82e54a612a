"""A run on the page: its tables, and turns in which the machine moves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.page.machine import FRAMES, MOVING, moving
from vibroplat.page.svg import Floats
from vibroplat.plots.histories import RunTables, run_of
from vibroplat.plots.reading import rest_of
from vibroplat.results.picture import finite
from vibroplat.results.run import RunResult

#: Turns of the run in which the machine moves, and maximum number of turns that are its last ones.
MOVING_TURNS, MOST_PERIODS = 60, 4
#: Change of the stroke relative to its last value up to which it counts as steady.
STEADY = 0.01


@dataclass(frozen=True)
class ShownRun:
    """What the page shows of a run.

    Attributes
    ----------
    result, tables
        The run, and its tables over the interval of its curves.
    motion
        What moves the machine.
    """

    result: RunResult
    tables: RunTables
    motion: Mapping[str, Any]

    @property
    def first(self) -> float:
        """Time of its first row (s)."""
        assert self.tables.ends is not None
        return float(self.tables.ends.first["t_s"])

    @property
    def frequency(self) -> float | None:
        """Frequency of the exciters in the measured part (Hz); None if that is not known."""
        return self.result.summary.get("excitation_frequency_hz") or None

    @property
    def main(self) -> str:
        """The column of what moves most in operation: along x or y, or the exciters' axes as the machine rocks."""
        s, arm = self.result.summary, self.tables.arm
        sizes = {"y_m": s.get("rms_y_m"), "x_m": s.get("rms_x_m"), "phi_rad": arm * (s.get("rms_phi_rad") or 0.0)}
        return max(sizes, key=lambda column: sizes[column] or 0.0)

    @cached_property
    def steady(self) -> float | None:
        """When the largest motion had come within 1 % of its last range for good (s); None if that is not known."""
        ranges = self.tables.envelope[["t_s", f"{self.main}:min", f"{self.main}:max"]].dropna()
        times, low, high = ranges.to_numpy(dtype=float).T
        strokes = high - low
        if self.tables.chosen or len(strokes) < 20 or not strokes[-1] > 0.0:
            return None
        end = float(np.median(strokes[-5:]))
        away = np.flatnonzero(np.abs(strokes - end) > STEADY * end)
        if not len(away):
            return self.first
        return None if away[-1] >= 0.95 * len(strokes) else float(times[away[-1]])


def shown_run(
    result: RunResult, events: pd.DataFrame, start: float | None = None, stop: float | None = None
) -> ShownRun | None:
    """Return what the page shows of a run, None if it has less than two rows.

    Parameters
    ----------
    result, events
        The run and its events.
    start, stop
        Interval of the curves, and in which the machine moves (s). Default: the whole run and its last turns.

    Raises
    ------
    TableError
        A table is missing or of another run, or the interval is empty.
    """
    if not any(np.ptp(part["t_s"]) > 0.0 for part in result.column_parts("trajectory", (), ("t_s",)) if len(part)):
        return None
    tables = run_of(result, start, stop)
    assert tables.ends is not None
    struck, evenly = events.loc[events["impulse_n_s"] > 0.0, ["t_s", "impulse_n_s"]], tables.ends.evenly
    begin, end = (evenly["t_s"].iloc[at] if given is None else given for at, given in ((0, start), (-1, stop)))
    thin = evenly[evenly["t_s"].between(begin, end)]
    return ShownRun(result, tables, _motion(result, struck, thin))


# -- turns in which the machine moves ----------------------------------------------------------------------------------


def _motion(result: RunResult, struck: pd.DataFrame, thin: pd.DataFrame) -> dict[str, Any]:
    """Return turns evenly over the interval of thinned rows, and the last ones, as what moves the machine.

    They begin where exciter 1 passes the same angle, so that one goes on where another one ends.
    """
    turns = result.scene.exciter_pair[0].direction * thin["phi1_rad"].to_numpy(dtype=float) / TURN
    period = result.summary.get("period")
    last = min(period, MOST_PERIODS) if isinstance(period, int) and period > 0 else MOST_PERIODS if period == 0 else 1
    windows = windows_of(thin["t_s"].to_numpy(dtype=float), turns, result.summary.get("excitation_frequency_hz"), last)
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
    """Return begin, end (s) and frames of turns evenly over a run, the last one of ``last`` turns.

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
