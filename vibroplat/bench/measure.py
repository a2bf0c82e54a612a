"""Run time beside error: engines and peers by turns, on the same scenes, at several tolerances."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.bench.peers import PEERS, Peer
from vibroplat.config.coordinates import COORDINATES
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator
from vibroplat.motion.run import SETTLE_FRACTION, simulate
from vibroplat.observe.summary import INACCURATE
from vibroplat.results.run import RunResult

#: Slower impacts (m/s) are not compared: each integration ends an accumulation at its own threshold.
SLOWEST = 1e-3
#: Tolerance of the reference, and the least of the automaton; that of a peer may be lower.
CLOSEST, FINEST = 1e-13, 1e-12
#: Errors of coordinates over their scales at which run times are compared: larger ones where a motion amplifies errors.
LEVEL, AMPLIFIED = 1e-6, {"latches, R 0.5": 1e-3, "flights of many periods": 1e-2}


class Reference(NamedTuple):
    """A scene and its accurate motion: rows of the trajectory table at some times, and the events."""

    name: str
    scene: Scene
    trajectory: pd.DataFrame
    events: pd.DataFrame


def compared_events(events: pd.DataFrame) -> pd.DataFrame:
    """Liftoffs, and impacts faster than :data:`SLOWEST`."""
    impacts = (events["kind"] == "impact") & (events["gap_rate_before_m_per_s"] < -SLOWEST)
    return events[(events["kind"] == "liftoff") | impacts].reset_index(drop=True)


def coordinate_errors(run: RunResult, trajectory: pd.DataFrame, until: float = np.inf) -> dict[str, float]:
    """Largest error of each coordinate, and of the contact force, while both are attached, over its largest value."""
    theirs = trajectory[trajectory["t_s"] <= min(until, run.scene.run.duration_s)].reset_index(drop=True)
    mine = run(theirs["t_s"])
    errors = {c: float((mine[c] - theirs[c]).abs().max()) for c in COORDINATES if c in mine}
    if "contact_force_n" in mine:
        attached = (mine["mode"] == "attached") & (theirs["mode"] == "attached")
        force = theirs["contact_force_n"][attached]
        errors["contact_force"] = float((mine["contact_force_n"][attached] - force).abs().max() / force.max())
    return errors


def event_errors(mine: pd.DataFrame, theirs: pd.DataFrame) -> dict[str, float]:
    """Largest error of event times (s) and largest relative error of impact speeds; nan if the sequences differ."""
    mine, theirs = compared_events(mine), compared_events(theirs)
    if list(mine["kind"]) != list(theirs["kind"]):
        return {"event_time_s": np.nan, "impact_speed": np.nan}
    impacts = mine["kind"] == "impact"
    speeds = mine["gap_rate_before_m_per_s"][impacts] / theirs["gap_rate_before_m_per_s"][impacts]
    late, faster = (mine["t_s"] - theirs["t_s"]).abs().max(), (speeds - 1.0).abs().max()
    return {"event_time_s": float(late) if len(mine) else 0.0, "impact_speed": float(faster) if len(speeds) else 0.0}


class Solver:
    """An engine of the package or a peer, at a tolerance of its own, with a scene to run."""

    def __init__(self, name: str, scene: Scene, tolerance: float) -> None:
        own = {"solver.tolerance": tolerance, "solver.engine": name}
        self.scene = scene.replace({"solver.tolerance": max(tolerance, FINEST)} if name in PEERS else own)
        self.p = parameters(self.scene)
        self.peer = Peer(name, self.scene, self.p, tolerance) if name in PEERS else None

    def run(self, times: Iterable[float]) -> RunResult:
        """Run the scene, states at these times wanted; RuntimeError if it ends early."""
        if (peer := self.peer) is not None:
            peer.wanted = np.asarray(times)
        run = simulate(self.scene, engine=lambda scene, p: peer or make_engine(scene, p))
        if run.outcome not in ("ok", INACCURATE):  # the audit knows no more of a peer than its points
            raise RuntimeError(f"{run.outcome}: {run.summary['detail']}")
        return run

    def timed(self) -> tuple[float, float]:
        """Time of a run with its statistics, and of a peer's integrator in it (s)."""
        duration = self.scene.run.duration_s
        with closing(self.peer or make_engine(self.scene, self.p)) as engine:
            if self.peer is not None:
                self.peer.wanted, self.peer.alone_s = np.empty(0), 0.0
            motion = Simulator(self.scene, self.p, engine)
            began = time.perf_counter()
            motion.advance(duration, settle=SETTLE_FRACTION * duration)
            wall = time.perf_counter() - began
        return wall, wall if self.peer is None else self.peer.alone_s


def truth(name: str, scene: Scene) -> Reference:
    """Run a scene by the most accurate engine; tests hold it against heyoka at round-off and other integrations."""
    times = np.linspace(0.0, scene.run.duration_s, round(100.0 * scene.run.duration_s) + 1)
    run = Solver("taylor", scene, CLOSEST).run(times)
    return Reference(name, scene, run(times), run.events)


def medians(solvers: dict[Any, Solver], repeats: int) -> dict[Any, tuple[float, float]]:
    """Median times of runs and of their integrators (s), by turns, so that a machine's drift affects all alike."""
    times: dict[Any, list[tuple[float, float]]] = {key: [] for key in solvers}
    for _ in range(repeats):
        for key, solver in solvers.items():
            spent = 0.0
            while spent < 0.02:  # s; short runs are repeated
                times[key].append(solver.timed())
                spent += times[key][-1][0]
    return {key: tuple(np.median(of, axis=0)) for key, of in times.items()}


def precision(cases: Iterable[Reference], engines: Sequence[str], tolerances: Sequence[float], repeats: int) -> Any:
    """Return a table of errors and run times by case, engine and tolerance; ``failed`` says why a run has none."""
    rows: list[dict[str, Any]] = []
    for case in cases:
        solvers, found, scales = {}, {}, dict(zip(COORDINATES, state_scales(case.scene), strict=False))
        for key in ((engine, tolerance) for engine in engines for tolerance in tolerances):
            row: dict[str, Any] = {"case": case.name, "engine": key[0], "tolerance": key[1], "failed": ""}
            try:
                solver = Solver(key[0], case.scene, key[1])
                run = solver.run(case.trajectory["t_s"])
                row |= {"engine": run.summary["engine"], "steps": run.summary["steps"]}
                row |= coordinate_errors(run, case.trajectory) | event_errors(run.events, case.events)
                row["coordinates"] = max(row[c] / scales[c] for c in COORDINATES if c in row)
                solvers[key] = solver
            except Exception as reason:  # whatever a library raises is its row's, not the bench's end
                row["failed"] = f"{type(reason).__name__}: {reason}".splitlines()[0]
            found[key] = row
        for key, (wall, alone) in medians(solvers, repeats).items():
            seconds = case.scene.run.duration_s
            found[key] |= {"ms_per_s": 1e3 * wall / seconds, "integrator_ms_per_s": 1e3 * alone / seconds}
        rows += found.values()
    return pd.DataFrame(rows)


def time_at(errors: pd.Series, times: pd.Series, level: float) -> float:
    """Run time at an error, between the fastest runs for each: the fastest if all are better, nan if none is."""
    points = pd.DataFrame({"error": errors, "time": times}).dropna().sort_values("time")
    points = points[points["error"] > 0.0]
    points = points[points["error"] < points["error"].cummin().shift(fill_value=np.inf)].iloc[::-1]
    if points.empty or points["error"].iloc[0] > level:
        return float("nan")
    return float(np.exp(np.interp(np.log(level), np.log(points["error"]), np.log(points["time"]))))


def at_equal_error(table: pd.DataFrame) -> pd.DataFrame:
    """Return run times (ms per s) at equal errors of coordinates, two for each case, and multiples of ``taylor``'s."""
    rows = []
    for case, runs in table.groupby("case", sort=False):
        level = AMPLIFIED.get(str(case), LEVEL)
        for error in (level, 1e-3 * level):
            own = runs[runs["engine"] == "taylor"]
            unit = time_at(own["coordinates"], own["ms_per_s"], error)
            for engine, of in runs.groupby("engine", sort=False):
                rows.append((case, error, engine, time_at(of["coordinates"], of["ms_per_s"], error), unit))
    table = pd.DataFrame(rows, columns=["case", "error", "engine", "ms_per_s", "over_taylor"])
    return table.assign(over_taylor=table["ms_per_s"] / table["over_taylor"])
