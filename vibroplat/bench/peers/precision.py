"""Work–precision of the peers: run time beside errors of coordinates, event times and contact force."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from vibroplat.bench.peers.cases import LEVELS, Case, agreement, truth
from vibroplat.bench.peers.following import Followed
from vibroplat.bench.peers.peers import Peer, Runner
from vibroplat.bench.reference import event_errors
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import FloatArray, parameters
from vibroplat.model.systems import systems

Key = TypeVar("Key")

#: Our engine ``taylor`` among the peers.
TAYLOR = "vibroplat, Taylor"

#: Level of tight comparisons over the usual one.
FINE = 1e-3

#: What is compared with engine ``taylor``: peer, its run or its integrator alone, column, and least ratio.
BESIDE_TAYLOR = (
    ("heyoka", "ms_per_s", "heyoka", 1.6),
    ("heyoka", "core_ms_per_s", "heyoka_alone", 1.2),
    ("vibroplat", "ms_per_s", "native", 7.0),
    ("scipy DOP853", "ms_per_s", "dop853", None),
    ("scipy DOP853", "core_ms_per_s", "dop853_alone", None),
)

#: Runs longer than this are timed once (s).
LONG = 1.0

#: Fewest times in contact at which the contact force is compared.
FEWEST = 20

#: Least time that runs of one setting take in each round, one run or several (s).
LEAST = 0.02

#: A processor that has waited for another program's run takes some time to its full speed (s).
WARM_UP = 0.3


def forces(scene: Scene, found: Followed) -> FloatArray:
    """Contact force at the states of a run (N), nan where there is no contact; found from states if it is not given."""
    if found.forces is not None:
        return found.forces
    values = np.full(len(found.states), np.nan)
    if not scene.layers:
        return values
    p, system = parameters(scene), systems(scene)[Mode.ATTACHED]
    for i, (state, mode) in enumerate(zip(found.states, found.modes, strict=True)):
        if mode == Mode.ATTACHED.label:
            y = system.unknowns(state)
            accelerations(system.index, 0.0, y, np.empty(system.size), p)
            values[i] = y[-1]
    return values


def errors(scene: Scene, mine: Followed, theirs: Followed) -> dict[str, float]:
    """Largest errors of a run against another: coordinates over their scales, event times (s), F_c over its largest."""
    scales = state_scales(scene)[:7]
    difference = np.abs(mine.states[:, :7] - theirs.states[:, :7]) / scales
    found = {"coordinates": float(difference.max()), **event_errors(mine.events, theirs.events)}
    if scene.layers:
        both = np.array([a == b == Mode.ATTACHED.label for a, b in zip(mine.modes, theirs.modes, strict=True)])
        exact = forces(scene, theirs)
        difference = np.abs(forces(scene, mine) - exact)[both]
        # of a motion that has parted, or that is hardly ever in contact, this would say nothing
        known = both.sum() >= FEWEST and not np.isnan(found["event_time_s"])
        found["contact_force"] = float(difference.max() / np.nanmax(exact)) if known else np.nan
    return found


def precision(
    case: Case, peers: Sequence[Peer], repeats: int, *, quick: bool, tell: Callable[[str], None] = print
) -> pd.DataFrame:
    """Time and compare all peers on one case; a run that fails is a row with its reason."""
    exact = truth(case)
    runners: dict[tuple[str, float], Runner] = {}
    rows: dict[tuple[str, float], dict[str, Any]] = {}
    for peer in peers:
        for setting in peer.quick if quick else peer.settings:
            row = {"case": case.name, "peer": peer.name, "setting": setting, "failed": ""}
            row |= dict.fromkeys((*LEVELS, "impact_speed", "ms_per_s", "core_ms_per_s", "ms_per_event"), np.nan)
            try:
                runner = peer.prepare(case.scene, setting)
                found, free = runner(case.times), runner(None)
                if len(free.rows) != len(found.rows):
                    raise RuntimeError(f"{len(free.rows)} events in the timed run, {len(found.rows)} in the other")
                row |= errors(case.scene, found, exact)
                runners[peer.name, setting] = runner
            except Exception as reason:  # whatever a peer raises is its row's, not the bench's end
                row["failed"] = f"{type(reason).__name__}: {reason}".splitlines()[0]
                tell(f"{case.name}: {peer.name} at {setting:g}: {row['failed']}")
            rows[peer.name, setting] = row
    for key, (wall, core) in timed(runners, repeats).items():
        seconds = case.scene.run.duration_s
        rows[key] |= {
            "ms_per_s": 1e3 * wall / seconds,
            "core_ms_per_s": 1e3 * core / seconds,
            "ms_per_event": 1e3 * wall / len(exact.rows) if exact.rows else np.nan,
        }
    return pd.DataFrame(rows.values())


def timed(runners: dict[Key, Runner], repeats: int) -> dict[Key, tuple[float, float]]:
    """Median times of runs and of their integrators (s), by turns, so that a machine's drift meets all alike."""
    times: dict[Key, list[tuple[float, float]]] = {key: [] for key in runners}
    first = next(iter(runners.values()), None)
    for _ in range(repeats):
        began = time.perf_counter()
        while first is not None and time.perf_counter() - began < WARM_UP:
            first(None)
        for key, runner in runners.items():
            if times[key] and times[key][0][0] >= LONG:
                continue
            spent = 0.0
            while spent < LEAST:
                found = runner(None)
                times[key].append((found.wall_s, found.core_s))
                spent += found.wall_s
    return {
        key: (statistics.median(wall for wall, _ in of), statistics.median(core for _, core in of))
        for key, of in times.items()
    }


def time_at(found: pd.Series, times: pd.Series, level: float) -> float:
    """Run time at an error, between the fastest runs for each error; nan where no run is that accurate.

    Where all runs are more accurate it is the fastest one's.
    """
    points = pd.DataFrame({"error": found, "time": times}).dropna().sort_values("time")
    points = points[points["error"] > 0.0]
    points = points[points["error"] < points["error"].cummin().shift(fill_value=np.inf)]
    if points.empty or points["error"].iloc[-1] > level:
        return float("nan")
    shown = points.iloc[::-1]
    return float(np.exp(np.interp(np.log(level), np.log(shown["error"]), np.log(shown["time"]))))


def at_equal_error(table: pd.DataFrame, compared: Sequence[Case]) -> pd.DataFrame:
    """Run times of all peers at the cases' levels of errors (ms per s), and their ratios to vibroplat's.

    ``core`` is the time in the integrator alone, at the level of coordinates.
    """
    levels = {case.name: case.levels for case in compared}
    rows = []
    for (case, peer), runs in table.groupby(["case", "peer"], sort=False):
        row: dict[str, Any] = {"case": case, "peer": peer}
        for column, level in levels[str(case)].items():
            if column in runs and runs[column].gt(0.0).any():
                row[column] = time_at(runs[column], runs["ms_per_s"], level)
        row["core"] = time_at(runs["coordinates"], runs["core_ms_per_s"], levels[str(case)]["coordinates"])
        per_event = (runs["ms_per_event"] / runs["ms_per_s"]).median()
        row["ms_per_event"] = row["coordinates"] * per_event
        rows.append(row)
    found = pd.DataFrame(rows)
    own = found[found["peer"] == "vibroplat"].set_index("case")
    for column in ("coordinates", "event_time_s", "contact_force", "core"):
        if column in found:
            of = "coordinates" if column == "core" else column
            found[f"{column}_ratio"] = found[column] / found["case"].map(own[of])
    return found


def beside_taylor(table: pd.DataFrame, compared: Sequence[Case]) -> pd.DataFrame:
    """Run times over that of engine ``taylor`` at equal errors of coordinates, beside the targets.

    Errors are those of :func:`at_equal_error`, and a thousandth of them.
    """
    rows = []
    for case in compared:
        runs = {str(name): of for name, of in table[table["case"] == case.name].groupby("peer")}
        for level in (case.levels["coordinates"], FINE * case.levels["coordinates"]):
            times = {
                (name, column): time_at(of["coordinates"], of[column], level)
                for name, of in runs.items()
                for column in ("ms_per_s", "core_ms_per_s")
            }
            own = times[TAYLOR, "ms_per_s"]
            row: dict[str, Any] = {"case": case.name, "coordinates": level, "taylor_ms_per_s": own}
            for peer, column, name, least in BESIDE_TAYLOR:
                ratio = times.get((peer, column), np.nan) / own
                row[name] = ratio
                if least is not None:
                    row[f"{name}_met"] = "" if np.isnan(ratio) else str(ratio >= least)
            rows.append(row)
    return pd.DataFrame(rows)


def statistics_of(case: Case, peers: Sequence[Peer], setting: float) -> pd.DataFrame:
    """Statistics of a motion that is not periodic, by each peer: those of the halves of its second half beside them."""
    rows = []
    for peer in peers:
        nearest = min(peer.settings, key=lambda s: abs(np.log(s / setting)))
        row: dict[str, Any] = {"case": case.name, "peer": peer.name, "setting": nearest, "failed": ""}
        try:
            runner = peer.prepare(case.scene, nearest)
            found, free = runner(case.times), runner(None)
        except Exception as reason:  # as above
            rows.append(row | {"failed": f"{type(reason).__name__}: {reason}".splitlines()[0]})
            continue
        row["ms_per_s"] = 1e3 * free.wall_s / case.scene.run.duration_s
        rows.append(row | _statistics(case, found))
    return pd.DataFrame(rows)


def _statistics(case: Case, found: Followed) -> dict[str, float]:
    """RMS of y (m), share of flight, impacts per turn over the second half, and half the difference of its halves."""
    half = len(case.times) // 2
    parts = (slice(half, None), slice(half, half + half // 2), slice(half + half // 2, None))
    y, flying = found.states[:, 1], np.array([mode == Mode.FLIGHT.label for mode in found.modes])
    turns = np.abs(found.states[:, 3]) / (2.0 * np.pi)
    events = found.events
    impacts = events["t_s"][(events["kind"] == "impact") & (events["gap_rate_before_m_per_s"] < -1e-2)].to_numpy()
    values: dict[str, list[float]] = {"rms_y_m": [], "flight_fraction": [], "impacts_per_turn": []}
    for part in parts:
        values["rms_y_m"].append(float(np.std(y[part])))
        values["flight_fraction"].append(float(np.mean(flying[part])))
        inside = (impacts >= case.times[part][0]) & (impacts < case.times[part][-1])
        values["impacts_per_turn"].append(float(inside.sum() / (turns[part][-1] - turns[part][0])))
    return {
        name + suffix: value
        for name, of in values.items()
        for suffix, value in (("", of[0]), ("_scatter", 0.5 * abs(of[1] - of[2])))
    }


def references(directory: Path, found: Sequence[Case]) -> pd.DataFrame:
    """Distance of the oracle from the reference tables."""
    return pd.DataFrame([agreement(case, truth(case), directory) for case in found if case.reference])
