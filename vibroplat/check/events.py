"""The events of two runs are paired."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.config.digits import given
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import GAP_RATE

#: Angle of exciter 1 (rad) by which the times of an event may differ before it counts as another event.
MAX_EVENT_ANGLE: Final = 0.5


class ErrorBound(NamedTuple):
    """Errors of a motion, in the scales of its scene, that are allowed until each of some times (s)."""

    times: FloatArray
    allowed: FloatArray

    def at(self, times: FloatArray) -> FloatArray:
        """Return what is allowed at other times."""
        return np.asarray(self.allowed[np.minimum(np.searchsorted(self.times, times), self.allowed.size - 1)])


class EventMatches(NamedTuple):
    """Events that two runs have in common, from the first one on.

    Attributes
    ----------
    rows
        Their rows in both tables, shape (n, 2).
    differ_s
        When the sequences begin to differ (s); infinity if they do not.
    why
        What each has there; empty if they do not differ.
    """

    rows: npt.NDArray[np.int64]
    differ_s: float = math.inf
    why: tuple[str, str] = ("", "")


def compared_events(events: pd.DataFrame) -> pd.DataFrame:
    """Pick the events that runs are compared by: all but chatters and corners of a program.

    A chatter represents impacts, whose number depends on the time of its detection. A reversal counts as a slip: it
    is one after a stick of no duration.
    """
    renamed = events.replace({"kind": {"reversal": "slip"}})
    return renamed[~renamed["kind"].isin(["chatter", "drive"])].reset_index(drop=True)


def marginal_events(events: pd.DataFrame, errors: ErrorBound, scene: Scene) -> npt.NDArray[np.bool_]:
    """Tell which events an error of the motion may add or remove.

    With an error ε in scaled units, a gap that just misses 0 becomes an impact with √(2 ε) of the scale of
    speeds, and a contact force that just stays positive falls below 0 for √(8 ε) / ω₀. Impacts after shorter flights
    than that may be closed into contact in one run and followed in the other; how fast they are depends on what
    presses, which may be a stiff layer. A force of friction that just leaves its cone, by ε of what the contact force
    changes by, begins a slip of √(18 ε) / ω₀; slip that just ends begins a stick a third as long.
    """
    times = events["t_s"].to_numpy()
    errors_there = errors.at(times)
    speeds = np.abs(events["gap_rate_before_m_per_s"].to_numpy()) / state_scales(scene)[GAP_RATE]
    short = np.sqrt(8.0 * errors_there)
    before = scene.speed_scale * np.diff(times, prepend=-math.inf)
    after = scene.speed_scale * np.diff(times, append=math.inf)
    brief = np.sqrt(18.0 * errors_there * force_spread(scene) / scene.force_scale)
    kinds = events["kind"].to_numpy()
    return np.select(
        [kinds == "liftoff", kinds == "impact"],
        [after < short, (before < short) | (speeds < np.sqrt(2.0 * errors_there))],
        np.minimum(before, after) < brief,
    )


def match_events(one: pd.DataFrame, two: pd.DataFrame, errors: ErrorBound, scene: Scene, until: float) -> EventMatches:
    """Pair the events of two runs in their order until a time (s); slight ones that only one run has are left out."""
    tables = (one, two)
    kinds, times = ([table[column].to_numpy() for table in tables] for column in ("kind", "t_s"))
    may_lack = [marginal_events(table, errors, scene) for table in tables]
    apart = MAX_EVENT_ANGLE / scene.speed_scale
    rows: list[tuple[int, int]] = []
    at = [0, 0]
    differ, why = math.inf, ("", "")
    while any(left := [at[k] < len(times[k]) and times[k][at[k]] < until for k in (0, 1)]):
        i, j = at
        if all(left) and kinds[0][i] == kinds[1][j] and abs(times[0][i] - times[1][j]) <= apart:
            if may_lack[0][i] != may_lack[1][j]:  # a slight event leaves a clear one to a clear one that is nearer
                k = 0 if may_lack[0][i] else 1
                there = times[1 - k][at[1 - k]]
                later = slice(at[k], np.searchsorted(times[k], there + apart))
                away = np.abs(times[k][later] - there)
                if ((kinds[k][later] == kinds[0][i]) & ~may_lack[k][later] & (away < away[0])).any():
                    at[k] += 1
                    continue
            rows.append((i, j))
            at = [i + 1, j + 1]
        elif skipped := [k for k in (0, 1) if left[k] and may_lack[k][at[k]]]:
            at[skipped[0]] += 1
        else:
            first = float(min(times[k][at[k]] for k in (0, 1) if left[k]))
            if first < until - apart:  # otherwise the other may have it after the end
                has = [
                    f"{kinds[k][at[k]]} at {given(times[k][at[k]])} s" if left[k] else "no more events" for k in (0, 1)
                ]
                differ, why = first, (has[0], has[1])
            break
    return EventMatches(np.array(rows, dtype=np.int64).reshape(-1, 2), differ, why)
