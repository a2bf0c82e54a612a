"""Sweeps: branches of continued points are measured side by side and become one table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pandas as pd

import vibroplat
from vibroplat.columns import Column, Columns, labelled
from vibroplat.config.keys import key_of
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.integrate import engine_name
from vibroplat.integrate.seam import WORK
from vibroplat.observe.summary import MEASURES
from vibroplat.study import WAIT
from vibroplat.study.branches import EXCITATION, SUPPLY, Branch, branches, sweep_plan
from vibroplat.study.confirming import CONFIRMED, confirmed_task
from vibroplat.study.execution import Pool, pool, run_chains
from vibroplat.study.point import ERRORS, MEASURED, POINT, point_task
from vibroplat.study.store import Record, Records, SpoiledError, Store
from vibroplat.study.tasks import StoredChain, Tasks

#: Columns of text and of whole numbers; all others hold floating-point numbers.
TEXTS = ("direction", "rotation", "sync", "motion", "outcome", "detail", "notes", "confirmation")
COUNTS = ("branch", "period", "steps", "residual_calls", "events", "orbit_unstable")
#: Columns of the table after the swept keys.
COLUMNS = (
    "direction",
    "branch",
    "rotation",
    *MEASURED[:8],
    "sync",
    "motion",
    "period",
    *MEASURED[8:],
    "lyapunov_per_s",
    "lyapunov_error_per_s",
    *ERRORS.values(),
    "settle_s",
    "outcome",
    "detail",
    "notes",
    "steps",
    "residual_calls",
    "events",
    "simulated_s",
    "wall_s",
)

#: What they mean; the swept keys come first, each as in a configuration.
SWEEP: Columns = {
    SUPPLY: Column("supply frequency"),
    "direction": Column("direction of the branch", "up or down: each point starts where the one before ended"),
    "branch": Column("number of the branch"),
    **{name: column for name, column in {**MEASURES, **POINT, **WORK}.items() if name in COLUMNS},
}
#: The tables of a bifurcation diagram.
DIAGRAM: Columns = {
    **{name: SWEEP[name] for name in (SUPPLY, "direction", "branch", EXCITATION)},
    "y_m": Column("y at a whole turn of exciter 1"),
    "impact_speed_m_per_s": Column("speed of an impact", "rate at which the gap closes"),
}

#: How many rows of a table are in memory at a time.
CHUNK = 2000

#: Called after each point with the numbers of finished branches, points and events.
Progress = Callable[[int, int, int], None]


def sweep(
    scene: Scene,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Sweep a scene over the supply frequencies and the grid of its ``sweep`` section.

    Parameters
    ----------
    scene
        A scene with a section ``sweep``.
    jobs
        Worker processes; with 1 the points are measured in this process.
    scheduler
        Address of a dask scheduler; its workers are used instead.
    wait
        Seconds after which a scheduler without workers is given up.
    progress
        Called after each point with the numbers of finished branches, points and events.

    Returns
    -------
    DataFrame
        A row for each point, in the order of branches and of points in them; columns as in ``COLUMNS``.

    Raises
    ------
    ConfigError
        The scene has no sweep, a value of its grid is not allowed, or the scheduler does not answer.
    LostError
        The scheduler has no workers, or has gone.
    ForeignWorkerError
        A worker would give other bits than this process.

    Examples
    --------
    >>> from vibroplat import Scene, sweep
    >>> scene = Scene().replace({"sweep.supply_frequency_hz": {"start": 45.0, "stop": 46.0}})
    >>> sweep(scene)["outcome"].tolist()
    ['ok', 'ok', 'ok']
    """
    opened = pool(jobs, scheduler, wait=wait, chains=len(branches(scene)))
    with Store(None, {}) as store, opened as workers:
        run_sweeps([(scene, store)], workers, progress)
        return pd.concat(tables(scene, store), ignore_index=True)


def conditions(scene: Scene) -> dict[str, Any]:
    """Return what the points of a sweep depend on: version, engine and configuration."""
    return {"vibroplat": vibroplat.__version__, "engine": engine_name(scene), "configuration": scene.to_tree()}


def run_sweeps(sweeps: Sequence[tuple[Scene, Records]], workers: Pool, progress: Progress | None = None) -> None:
    """Run sweeps side by side and store their points; points that are stored already are not repeated.

    Parameters
    ----------
    sweeps
        Scenes, and where to store the points of each.
    workers
        Where points are measured.
    progress
        Called after each point with the numbers of finished branches, points and events.
    """
    points = events = 0

    def count(record: Record) -> None:
        nonlocal points, events
        points, events = points + 1, events + record["row"].get("events", 0)

    chains = [
        StoredChain(branch_points(branch, sweep_plan(scene), count), records, branch.number)
        for scene, records in sweeps
        for branch in branches(scene)
    ]
    done = sum(chain.done for chain in chains)
    if progress is not None:
        progress(done, points, events)
    for chain in run_chains(chains, workers):
        done += chain.done
        if progress is not None:
            progress(done, points, events)


def branch_points(branch: Branch, plan: SweepPlan, take: Callable[[Record], object]) -> Tasks[None]:
    """Measure the points of a branch, each begun with the state in which the last good one ended.

    ``take`` is called with the record of each point.
    """
    task = confirmed_task if plan.confirm else point_task
    state: list[float] | None = None
    for place, frequency in enumerate(branch.frequencies):
        record = yield task(branch.at(place), plan, state, branch.key(frequency))
        state = record["state"] or state
        take(record)


def branch_records(branch: Branch, records: Records) -> Iterator[Record]:
    """Yield the records of all points of a branch.

    Raises
    ------
    SpoiledError
        One of them is missing or damaged.
    """
    wanted = len(branch.frequencies)
    found = 0
    for place, record in records.read(branch.number):
        if place != found or found == wanted:
            break
        yield record
        found += 1
    if found < wanted:
        raise SpoiledError(f"point {found} of branch {branch.number} is not stored; --resume computes it")


def tables(scene: Scene, records: Records) -> Iterator[pd.DataFrame]:
    """Yield the sweep table in parts, in the order of branches and points."""
    yield from _parts(scene, records, lambda record: [record["row"]], columns_of_sweep(sweep_plan(scene)))


def columns_of_sweep(plan: SweepPlan) -> tuple[str, ...]:
    """List the columns of a sweep table after the swept keys."""
    return (*COLUMNS, *CONFIRMED) if plan.confirm else COLUMNS


def branch_tables(scene: Scene, records: Records, columns: Sequence[str]) -> Iterator[pd.DataFrame]:
    """Yield the sweep table of each branch, of these columns and those that name its points."""
    for branch in branches(scene):
        place = branch.grid | {"direction": branch.direction, "branch": branch.number}
        measured = zip(branch.frequencies, branch_records(branch, records), strict=True)
        rows = [{SUPPLY: f} | place | {c: record["row"].get(c) for c in columns} for f, record in measured]
        yield _frame(rows, scene, ("direction", "branch", *columns))


def section_tables(scene: Scene, records: Records) -> Iterator[pd.DataFrame]:
    """Yield in parts the table of Poincaré points of a bifurcation diagram: y (m) at whole turns of exciter 1."""
    yield from _diagram(scene, records, "section_y", "y_m")


def impact_tables(scene: Scene, records: Records) -> Iterator[pd.DataFrame]:
    """Yield in parts the table of impact speeds (m/s) of a bifurcation diagram."""
    yield from _diagram(scene, records, "impact_speeds", "impact_speed_m_per_s")


def _diagram(scene: Scene, records: Records, values: str, column: str) -> Iterator[pd.DataFrame]:
    """Yield the values that records have under a name in a column, each with the excitation frequency of its point."""

    def rows(record: Record) -> list[Record]:
        return [{EXCITATION: record["row"].get(EXCITATION), column: value} for value in record[values]]

    yield from _parts(scene, records, rows, ("direction", "branch", EXCITATION, column))


def _parts(
    scene: Scene, records: Records, rows_of: Callable[[Record], list[Record]], columns: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Yield the rows of all records in parts, as tables with the swept keys and these columns."""
    rows: list[Record] = []
    yielded = False
    for branch in branches(scene):
        for point, record in enumerate(branch_records(branch, records)):
            place = {SUPPLY: branch.frequencies[point], **branch.grid}
            place |= {"direction": branch.direction, "branch": branch.number}
            rows += [place | row for row in rows_of(record)]
            if len(rows) >= CHUNK:
                yield _frame(rows, scene, columns)
                rows, yielded = [], True
    if rows or not yielded:
        yield _frame(rows, scene, columns)


def _frame(rows: list[Record], scene: Scene, columns: Sequence[str]) -> pd.DataFrame:
    """Make one part of a table; the columns have the same types in all parts."""
    grid = sweep_plan(scene).grid
    table = pd.DataFrame(rows, columns=[SUPPLY, *grid, *columns])
    types: dict[Any, Any] = {key: pd.Series(values).dtype for key, values in grid.items()}
    types |= {column: "str" if column in TEXTS else "Int64" if column in COUNTS else "float64" for column in columns}
    swept = {key: Column(key_of(key).meaning) for key in grid}
    return labelled(table.astype(types), {**SWEEP, **DIAGRAM, **CONFIRMED, **swept})
