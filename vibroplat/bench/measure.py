"""Run time against error: solvers by turns, on the same scenes, at several tolerances; tables, figure, and answer."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from vibroplat.config import digits
from vibroplat.config.coordinates import COORDINATES
from vibroplat.config.digits import number
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import make_engine
from vibroplat.integrate.interface import Engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.motion.motion import Simulator
from vibroplat.motion.run import SETTLE_FRACTION, simulate
from vibroplat.plots.style import head, legend_below, new_figure, save, styled
from vibroplat.report.summary import INACCURATE
from vibroplat.results.answer import counted, in_columns
from vibroplat.results.picture import CURVES, finite
from vibroplat.results.run import RunResult
from vibroplat.results.tables import write_table

#: Slower impacts (m/s) are not compared: each integration ends an accumulation at its own threshold.
MIN_IMPACT_SPEED = 1e-3
#: Tolerance of the reference.
CLOSEST = 1e-13
#: Errors of coordinates over their scales at which run times are compared: larger ones where a motion amplifies errors.
LEVEL, AMPLIFIED = 1e-6, {"chatters, R 0.5": 1e-3, "flights of many periods": 1e-2}
#: Shortest motion that is timed (s): what a run takes once, whatever its length, is a tenth of a run of one second.
TIMED_S = 10.0
#: Processor time of a turn (s) up to which a task is repeated.
MAX_TURN_S = 0.02

#: Columns of times: of all that a user waits for, of an engine with its statistics, of an engine alone.
RUN, ALONE = "simulate_ms_per_s", "bare_ms_per_s"
TIMES = (RUN, "ms_per_s", ALONE)

K = TypeVar("K")
T = TypeVar("T")
_SUPPLY, _MASS = "drive.supply_frequency_hz", "material.mass_ratio"
_RESTITUTION, _SECONDS = "contact.restitution", "run.duration_s"
_KINDS: dict[str, dict[str, Any]] = {
    "attached, f_e 46": {_SUPPLY: 46.0},
    "impacts, f_e 50": {_SUPPLY: 50.0},
    "impacts, R 0.5, f_e 52": {_SUPPLY: 52.0, _RESTITUTION: 0.5},
    "one layer, f_e 50": {_SUPPLY: 50.0, "material": {"mass_ratio": 0.1, "layers": 1}},
    "non-impact, f_e 50": {_SUPPLY: 50.0, "contact.model": "non-impact"},
    "bare, f_e 50": {_SUPPLY: 50.0, _MASS: 0.0},
}
_CASES: dict[str, dict[str, Any]] = {
    "bare run-up": {_MASS: 0.0, _SUPPLY: 60.0, "run.initial.speed_ratio": 0.2, _SECONDS: 2.0},
    "attached": {_SUPPLY: 46.0},
    "one impact a period": {_MASS: 0.2, _SUPPLY: 51.5, _SECONDS: 1.5},
    "chatters, R 0.5": {_MASS: 0.2, _SUPPLY: 51.5, _RESTITUTION: 0.5, _SECONDS: 0.6},
    "flights of many periods": {_SUPPLY: 78.0, _RESTITUTION: 0.3, _SECONDS: 0.6},
}
#: Most rows that are printed.
MAX_ROWS = 6
#: Error of coordinates at which engines are compared in the title.
MAX_ERROR = 1e-6
#: Errors shown, by column.
ERRORS = {
    "coordinates": "coordinates (over their scales)",
    "event_time_s": "event times (s)",
    "contact_force": "contact force (relative)",
}


class Timed(NamedTuple):
    """Processor times of a task (s), one a turn, and what its last run returned."""

    seconds: FloatArray
    value: Any


def timed(work: Callable[..., T], *arguments: Any, **options: Any) -> tuple[float, T]:
    """Return the processor time of a call (s), and what the call returned."""
    began = time.process_time()
    value = work(*arguments, **options)
    return time.process_time() - began, value


def by_turns(tasks: Mapping[K, Callable[[], tuple[float, Any]]], repeats: int) -> dict[K, Timed]:
    """Run tasks by turns, so that a machine's drift affects all of them alike.

    A task returns its time (s) and its value, as :func:`timed` does. Within a turn a short task is repeated until its
    runs have taken :data:`MAX_TURN_S`; the time of the turn is their median.
    """
    seconds: dict[K, list[float]] = {key: [] for key in tasks}
    values: dict[K, Any] = {}
    for _ in range(repeats):
        for key, task in tasks.items():
            spent: list[float] = []
            while sum(spent) < MAX_TURN_S:
                second, values[key] = task()
                spent.append(second)
            seconds[key].append(float(np.median(spent)))
    return {key: Timed(np.array(seconds[key]), values[key]) for key in tasks}


class Reference(NamedTuple):
    """A scene and its accurate motion: rows of the trajectory table at some times, and the events."""

    name: str
    scene: Scene
    trajectory: pd.DataFrame
    events: pd.DataFrame


def compared_events(events: pd.DataFrame) -> pd.DataFrame:
    """Liftoffs, and impacts faster than :data:`MIN_IMPACT_SPEED`."""
    impacts = (events["kind"] == "impact") & (events["gap_rate_before_m_per_s"] < -MIN_IMPACT_SPEED)
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


class TimedEngine:
    """A scene, what makes the engine that runs it, and how long a motion is timed: at least TIMED_S (s)."""

    def __init__(self, scene: Scene, make: Callable[[Scene, Parameters], Engine] = make_engine) -> None:
        self.scene, self.make, self.timed_s = scene, make, max(scene.run.duration_s, TIMED_S)

    def run(self, times: Iterable[float]) -> RunResult:
        """Run the scene, whose states at these times are compared; RuntimeError if it ends early."""
        run = simulate(self.scene, engine=self.make)
        if run.outcome not in ("ok", INACCURATE):  # the audit knows no more of another solver than its points
            raise RuntimeError(f"{run.outcome}: {run.summary['detail']}")
        return run

    def timed(self, column: str) -> tuple[float, Any]:
        """Return a processor time of a motion (s), for a column of times, and what it gave."""
        if column == RUN:  # with the notes that a user reads
            scene = self.scene.replace({"run.duration_s": self.timed_s})
            return timed(lambda: simulate(scene, keep="summary", engine=self.make).notes)
        p = parameters(self.scene)
        with closing(self.make(self.scene, p)) as engine:
            motion = Simulator(self.scene, p, engine)
            if column == ALONE:
                return timed(motion.to_time, self.timed_s)
            return timed(motion.advance, self.timed_s, settle=SETTLE_FRACTION * self.timed_s)


def of_engine(name: str, scene: Scene, tolerance: float) -> TimedEngine:
    """Return a solver of a scene by an engine of the package, at a tolerance."""
    return TimedEngine(scene.replace({"solver.engine": name, "solver.tolerance": tolerance}))


def truth(name: str, scene: Scene) -> Reference:
    """Run a scene by the most accurate engine; tests hold it against heyoka at round-off and other integrations."""
    times = np.linspace(0.0, scene.run.duration_s, round(100.0 * scene.run.duration_s) + 1)
    run = of_engine("taylor", scene, CLOSEST).run(times)
    return Reference(name, scene, run(times), run.events)


def precision(
    cases: Iterable[Reference],
    engines: Sequence[str],
    tolerances: Sequence[float],
    repeats: int,
    solver_of: Callable[[str, Scene, float], TimedEngine] = of_engine,
) -> pd.DataFrame:
    """Return a table of errors and run times by case, engine and tolerance; ``failed`` says why a run has none.

    Times are processor times per simulated second: ``simulate_ms_per_s`` of :func:`vibroplat.simulate` with notes,
    ``ms_per_s`` of the engine with statistics, ``bare_ms_per_s`` of the engine. Errors are those of the case's
    duration, times those of TIMED_S at least.

    ``solver_of`` makes the solver of an engine's name, a scene and a tolerance.
    """
    rows: list[dict[str, Any]] = []
    for case in cases:
        solvers, by_key, scales = {}, {}, dict(zip(COORDINATES, state_scales(case.scene), strict=False))
        for key in ((engine, tolerance) for engine in engines for tolerance in tolerances):
            row: dict[str, Any] = {"case": case.name, "engine": key[0], "tolerance": key[1], "failed": ""}
            try:
                solver = solver_of(key[0], case.scene, key[1])
                run = solver.run(case.trajectory["t_s"])
                row |= {"engine": run.summary["engine"], "steps": run.summary["steps"]}
                row |= coordinate_errors(run, case.trajectory) | event_errors(run.events, case.events)
                row["coordinates"] = max(row[c] / scales[c] for c in COORDINATES if c in row)
                solver.timed(RUN)  # it may fail later than the errors are measured
                solvers[key] = solver
            except Exception as reason:  # whatever a library raises is its row's, not the bench's end
                row["failed"] = f"{type(reason).__name__}: {reason}".splitlines()[0]
            by_key[key] = row
        tasks = {(key, column): partial(solver.timed, column) for key, solver in solvers.items() for column in TIMES}
        for (key, column), times in by_turns(tasks, repeats).items():
            by_key[key][column] = 1e3 * np.median(times.seconds) / solvers[key].timed_s
        rows += by_key.values()
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
    """Return times (ms per s) at equal errors of coordinates, two for each case, and multiples of ``taylor``'s.

    Columns begin as those of :func:`precision`.
    """
    rows = []
    for case, runs in table.groupby("case", sort=False):
        level = AMPLIFIED.get(str(case), LEVEL)
        for error in (level, 1e-3 * level):
            taken = {
                engine: {column: time_at(of["coordinates"], of[column], error) for column in TIMES}
                for engine, of in runs.groupby("engine", sort=False)
            }
            for engine, times in taken.items():
                row = {"case": case, "error": error, "engine": engine}
                for column, time_s in times.items():
                    own = taken["taylor"][column] if "taylor" in taken else math.nan
                    row |= {column: time_s, column.replace("ms_per_s", "over_taylor"): time_s / own}
                rows.append(row)
    return pd.DataFrame(rows)


def processor_name() -> str:
    """Return the name of this machine's processor and the number of its cores."""
    known = Path("/proc/cpuinfo")
    lines = known.read_text().splitlines() if known.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{(names or [platform.processor() or platform.machine()])[0]}, {os.cpu_count()} cores"


def show(table: pd.DataFrame, directory: Path, name: str, *, verbose: bool = True) -> None:
    """Write a table to a directory under a name, with the processor that its times are of, and print it if asked."""
    write_table(table.assign(processor=processor_name()), directory, name, "csv")
    if verbose:
        print(f"\n{name}\n{table.to_string(index=False, float_format='%.3g')}", flush=True)


def show_precision(table: pd.DataFrame, directory: Path, name: str, *, verbose: bool = True) -> pd.DataFrame | None:
    """Write, draw and, if asked, print a table of :func:`precision`.

    With engine ``taylor`` there is also a table of run times at equal errors, which is returned.
    """
    show(table, directory, name, verbose=verbose)
    plot_precision(table, directory, name, processor_name())
    if "taylor" not in set(table["engine"]):
        return None
    equal = at_equal_error(table)
    show(equal, directory, f"{name}-equal", verbose=verbose)
    return equal


def base(tolerance: float, seconds: float) -> Scene:
    """Return the paper's machine with ten times the printed b_y and a tenth of its mass in two layers."""
    return Scene().replace(
        {
            "machine.damping_y_n_s_per_m": 400.0,
            "material": {"mass_ratio": 0.1, "natural_frequency_hz": 18.5, "damping_ratio": 0.05},
            "run": {"duration_s": seconds, "perturbation": 0.0},
            "solver.tolerance": tolerance,
        }
    )


def kinds(tolerance: float, seconds: float) -> dict[str, Scene]:
    """Return one scene of each kind, by name."""
    return {name: base(tolerance, seconds).replace(changes) for name, changes in _KINDS.items()}


def cases() -> dict[str, Scene]:
    """Return the scenes on which solvers are compared, by name; the last two amplify errors most."""
    return {name: base(1e-8, 1.0).replace(changes) for name, changes in _CASES.items()}


def brief_precision(table: pd.DataFrame, equal: pd.DataFrame | None) -> list[str]:
    """Return the answer of a comparison: run times at equal error, or errors by tolerance of a single engine.

    Parameters
    ----------
    table
        Errors and run times, as of :func:`vibroplat.bench.measure.precision`.
    equal
        Run times at equal errors, as of :func:`vibroplat.bench.measure.at_equal_error`; None if ``taylor`` has none.
    """
    failed = int(table["failed"].astype(str).ne("").sum())
    more = f"; {counted(failed, 'run')} FAILED" if failed else ""
    if equal is None:
        errors = table.pivot_table("coordinates", "case", "tolerance", sort=False).iloc[:, ::2]
        head = f"{counted(len(errors), 'case')}: error of coordinates, over their scales, by tolerance{more}"
        return [head, *_lines(errors.rename(columns="{:.0e}".format).map("{:.1e}".format))]
    first = equal.groupby(["case", "engine"], sort=False).first().reset_index()
    others = first.loc[first["engine"] != "taylor"].dropna(subset="simulate_over_taylor")
    ratios, names = others["simulate_over_taylor"], ", ".join(dict.fromkeys(others["engine"]))
    ends = f": {names} {number(ratios.min(), 2)} to {number(ratios.max(), 2)} times taylor" if names else ""
    times = first.assign(times=[" / ".join(map(number, row)) for row in first[[*TIMES]].to_numpy().tolist()])
    return [
        f"processor time of simulate at equal error{ends}{more}",
        "  ms per s of motion: simulate / engine with statistics / engine alone",
        *_lines(times.pivot_table("times", "case", "engine", sort=False, aggfunc="first")),
    ]


def brief_costs(table: pd.DataFrame, name: str) -> list[str]:
    """Return the answer of a comparison of costs: processor time of each way, and its multiple of the first one's."""
    ratio = next(str(column) for column in table if str(column).startswith(("times_", "over_")))
    costs = table.set_index(table.columns[0])[["processor_s", ratio]].map(number)
    return [f"{name}: processor time, and multiples of it", *_lines(costs)]


def _lines(table: pd.DataFrame) -> list[str]:
    """Write the first rows of a table of texts."""
    rows = [
        ["", *map(str, table.columns)],
        *([str(name), *row] for name, row in zip(table.index, table.to_numpy(), strict=True)),
    ]
    return [f"  {line}" for line in in_columns(rows[: MAX_ROWS + 1])]


def plot_precision(table: pd.DataFrame, directory: Path, name: str, processor: str = "") -> Path:
    """Draw run time against error, and return the file: a row for each case, a panel for each of its errors.

    The name of the ``processor`` stands with the title.
    """
    table = finite(table)
    engines, cases = (list(dict.fromkeys(table[column])) for column in ("engine", "case"))
    with styled():
        figure, axes, _ = new_figure(len(cases), len(ERRORS), (11.0, 2.6 * len(cases) + 1.0))
        for row, case in zip(axes, cases, strict=True):
            row[0].set(title=case, ylabel="ms per simulated second")
            for axis, (column, label) in zip(row, ERRORS.items(), strict=True):
                known = (table[RUN] > 0.0) & (table.get(column, pd.Series(0.0, table.index)) > 0.0)
                runs = table[known & (table["case"] == case)]
                for i, engine in enumerate(engines):
                    of = runs[runs["engine"] == engine]
                    axis.plot(of.get(column, []), of[RUN], ".-", lw=1.0, ms=4, color=CURVES[i % 7], label=engine)
                scale = "log" if len(runs) else "linear"
                axis.set(xscale=scale, yscale=scale, xlabel=f"largest error of {label}", visible=len(runs) > 0)
                axis.invert_xaxis()
        head(figure, fastest(table), f"run time over error; more accurate to the right, faster below; {processor}")
        legend_below(figure, axes[0, 0].lines)
        return save(figure, directory, name)


def fastest(table: pd.DataFrame) -> str:
    """Say which engine takes the least time in most cases, of runs whose coordinates have errors up to MAX_ERROR."""
    good = table[(table[RUN] > 0.0) & (table["coordinates"] <= MAX_ERROR)] if "coordinates" in table else table[:0]
    best = good.groupby(["case", "engine"])[RUN].min()
    firsts = [rows.nsmallest(2).droplevel("case") for _, rows in best.groupby("case", sort=False)]
    names = pd.Series([str(rows.index[0]) for rows in firsts], dtype=object)
    if names.empty:
        return f"No run has an error of coordinates up to {MAX_ERROR:.0e}"
    name = names.mode()[0]
    ratios = [float(rows.iloc[1] / rows.iloc[0]) for rows in firsts if rows.index[0] == name and len(rows) > 1]
    text = f"At errors up to {MAX_ERROR:.0e} {name} is the fastest in {(names == name).sum()} of {len(names)} cases"
    return (
        f"{text}, {digits.interval(min(ratios), max(ratios), digits=2)} times as fast as the next" if ratios else text
    )
