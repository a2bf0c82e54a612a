"""Sweeps: branches of continued points, run in parallel and collected in one table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

import vibroplat
from vibroplat.integrate.choice import engine_name
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.study.branches import EXCITATION, SUPPLY, Branch, branches, sweep_plan
from vibroplat.study.execution import Pool, WorkerLostError, pool, run_chains
from vibroplat.study.point import ERRORS, MEASURED, Point, measure_point
from vibroplat.study.store import Store

#: Columns of text and of integers; all others hold floating-point numbers.
TEXTS = ("direction", "sync", "motion", "outcome", "detail")
COUNTS = ("branch", "period", "steps", "residual_calls", "events")
#: Columns after the swept keys.
COLUMNS = (
    "direction",
    "branch",
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
    "steps",
    "residual_calls",
    "events",
    "simulated_s",
    "wall_s",
)

#: Rows of the table in memory at a time.
CHUNK = 2000

#: Called after each point with the numbers of finished branches, finished points and events.
Progress = Callable[[int, int, int], None]


def sweep(
    scene: Scene,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Sweep a scene over the supply frequencies and the grid of its ``sweep`` section.

    Parameters
    ----------
    scene
        The scene, with a ``sweep`` section.
    jobs
        Number of worker processes; with 1, everything runs in this process.
    scheduler
        Address of a dask scheduler; its workers are used instead.
    progress
        Called after each point with the numbers of finished branches, points and events.

    Returns
    -------
    DataFrame
        One row per point, in the order of branches and of points within them; see ``COLUMNS``.

    Raises
    ------
    ConfigError
        The scene has no sweep, a value of its grid is not allowed, or the scheduler does not answer.

    Examples
    --------
    >>> from vibroplat import Scene, sweep
    >>> scene = Scene().replace({"sweep.supply_frequency_hz": {"start": 45.0, "stop": 46.0}})
    >>> sweep(scene)["outcome"].tolist()
    ['ok', 'ok', 'ok']
    """
    with Store(None, {}) as store, pool(jobs, scheduler) as workers:
        run_sweeps([(scene, store)], workers, progress)
        return pd.concat(tables(scene, store), ignore_index=True)


def conditions(scene: Scene) -> dict[str, Any]:
    """Return everything that the points of a sweep depend on."""
    return {"vibroplat": vibroplat.__version__, "engine": engine_name(scene), "configuration": scene.to_tree()}


def run_sweeps(sweeps: Sequence[tuple[Scene, Store]], workers: Pool, progress: Progress | None = None) -> None:
    """Run several sweeps in parallel; points that a store already has are not repeated. See :func:`sweep`."""
    stores = [store for _, store in sweeps]
    chains = [_Chain(branch, sweep_plan(scene), store) for scene, store in sweeps for branch in branches(scene)]

    done, points, events = (sum(getattr(c, name) for c in chains) for name in ("done", "point", "events"))
    if progress is not None:
        progress(done, points, events)
    for chain in run_chains(chains, workers):
        done, points, events = done + chain.done, points + 1, events + chain.latest_events
        if progress is not None:
            progress(done, points, events)
    for store in stores:
        store.finish()


class _Chain:
    """The points of a branch; each starts from the final state of the last good one."""

    def __init__(self, branch: Branch, plan: Sweep, store: Store) -> None:
        self._branch = branch
        self._plan = plan
        self._store = store
        self._state: list[float] | None = None
        self.point = 0
        self.events = self.latest_events = 0
        for point, record in store.read(branch.number):
            self.point = point + 1
            self._passed(record)

    @property
    def done(self) -> bool:
        """Whether all points are finished."""
        return self.point >= len(self._branch.frequencies)

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the next point as a task."""
        if self.done:
            return None
        scene = self._branch.at(self.point)
        key = self._branch.key(self._branch.frequencies[self.point])
        return measure_point, (scene, self._plan, self._state, key)

    def take(self, result: Point | WorkerLostError) -> None:
        """Store a finished point."""
        if isinstance(result, WorkerLostError):
            done = {"steps": 0, "residual_calls": 0, "events": 0, "simulated_s": 0.0, "settle_s": 0.0, "wall_s": 0.0}
            result = Point({"outcome": "worker-lost", "detail": str(result)} | done, None)
        record = vars(result)
        self._store.write(self._branch.number, self.point, record)
        self.point += 1
        self._passed(record)

    def _passed(self, record: Mapping[str, Any]) -> None:
        self._state = record["state"] or self._state
        self.latest_events = record["row"].get("events", 0)
        self.events += self.latest_events


def tables(scene: Scene, store: Store) -> Iterator[pd.DataFrame]:
    """Yield the sweep table in parts, in the order of branches and points."""
    yield from _parts(scene, store, lambda record: [record["row"]], COLUMNS)


def section_tables(scene: Scene, store: Store) -> Iterator[pd.DataFrame]:
    """Yield the table of Poincaré points of a bifurcation diagram in parts: y at whole turns of exciter 1."""
    yield from _parts(
        scene,
        store,
        lambda record: _each(record, "y_m", record["section_y"]),
        ("direction", "branch", EXCITATION, "y_m"),
    )


def impact_tables(scene: Scene, store: Store) -> Iterator[pd.DataFrame]:
    """Yield the table of impact speeds of a bifurcation diagram in parts."""
    columns = ("direction", "branch", EXCITATION, "impact_speed_m_per_s")
    yield from _parts(
        scene, store, lambda record: _each(record, "impact_speed_m_per_s", record["impact_speeds"]), columns
    )


def _each(record: dict[str, Any], column: str, values: list[float]) -> list[dict[str, Any]]:
    """Make one row per value, with the frequency of its point."""
    frequency = record["row"].get(EXCITATION)
    return [{EXCITATION: frequency, column: value} for value in values]


def _parts(
    scene: Scene, store: Store, rows_of: Callable[[dict[str, Any]], list[dict[str, Any]]], columns: Sequence[str]
) -> Iterator[pd.DataFrame]:
    """Yield parts of a table: swept keys, direction and branch, then these columns."""
    rows: list[dict[str, Any]] = []
    told = False
    for branch in branches(scene):
        for point, record in store.read(branch.number):
            place = {SUPPLY: branch.frequencies[point], **branch.grid}
            place |= {"direction": branch.direction, "branch": branch.number}
            rows += [place | row for row in rows_of(record)]
            if len(rows) >= CHUNK:
                yield _frame(rows, scene, columns)
                rows, told = [], True
    if rows or not told:
        yield _frame(rows, scene, columns)


def _frame(rows: list[dict[str, Any]], scene: Scene, columns: Sequence[str]) -> pd.DataFrame:
    """Make one part of a table; columns have the same types in all parts."""
    grid = sweep_plan(scene).grid
    table = pd.DataFrame(rows, columns=[SUPPLY, *grid, *columns])
    types: dict[Any, Any] = {key: pd.Series(values).dtype for key, values in grid.items()}
    types |= {column: "str" if column in TEXTS else "Int64" if column in COUNTS else "float64" for column in columns}
    return table.astype(types)
