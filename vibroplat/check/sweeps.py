"""Points of a sweep are checked: another engine repeats them from the same starts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from vibroplat.check.changes import Other, by_other_engine, with_other_tolerance
from vibroplat.check.measures import CLASS, Difference, Row, class_of, compared
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.integrate import engine_name
from vibroplat.study import WAIT
from vibroplat.study.branches import Branch, branches, sweep_plan
from vibroplat.study.choice import Place, chosen, require_share
from vibroplat.study.execution import Pool, pool, run_chains
from vibroplat.study.point import point_task
from vibroplat.study.store import Record, Records, Store
from vibroplat.study.sweep import Progress, branch_records, run_sweeps
from vibroplat.study.tasks import StoredChain, Task, Tasks


class PointCheck(NamedTuple):
    """What the check of a point has found.

    Attributes
    ----------
    place
        The point.
    first, other
        Classes of its row and of that of the other engine: outcome, synchronization, motion, period.
    differences
        Of measures, between the rows or between repetitions of them that are of one class.
    explained
        Whether some repetitions of both are of one class.
    """

    place: Place
    first: tuple[Any, ...]
    other: tuple[Any, ...]
    differences: list[Difference]
    explained: bool

    @property
    def reclassified(self) -> bool:
        """Whether both rows are of different classes."""
        return self.first != self.other

    @property
    def agrees(self) -> bool:
        """Whether errors of the tolerance explain all differences."""
        return self.explained and all(d.difference <= d.allowed for d in self.differences)


@dataclass(frozen=True)
class SweepCheck:
    """What the check of a sweep has found.

    Attributes
    ----------
    engine, other
        Names of the engine of the sweep and of that which checked it.
    points
        Number of points of the sweep.
    checked
        What was found at each point that was checked.
    """

    engine: str
    other: str
    points: int
    checked: tuple[PointCheck, ...]

    @property
    def agrees(self) -> bool:
        """Whether errors of the tolerance explain all differences."""
        return all(point.agrees for point in self.checked)

    @property
    def largest(self) -> dict[str, tuple[Difference, Place]]:
        """The largest difference of each column, and where it is."""
        found: dict[str, tuple[Difference, Place]] = {}
        for point in self.checked:
            for d in point.differences:
                if d.column not in found or d.difference > found[d.column][0].difference:
                    found[d.column] = d, point.place
        return found

    @property
    def disagreements(self) -> list[str]:
        """What errors of the tolerance do not explain: a line for each point, with the measure farthest beyond."""
        return [self._told(point) for point in self.checked if not point.agrees]

    def _told(self, point: PointCheck) -> str:
        if not point.explained:
            pairs = zip(CLASS, point.first, point.other, strict=True)
            name, one, two = next(pair for pair in pairs if pair[1] != pair[2])
            values, most = (str(one), str(two)), "the same in some repetitions"
        else:
            d = max(point.differences, key=lambda d: d.difference / d.allowed)
            name, values, most = d.column, (f"{d.first:.12g}", f"{d.other:.12g}"), f"a difference of {d.allowed:.2g}"
        told = f"{name} = {values[0]} ({self.engine}) and {values[1]} ({self.other})"
        return f"engines disagree at {point.place.text}: {told}; allowed: {most}"

    @property
    def reclassified(self) -> list[str]:
        """The rows that both engines classify differently, a line for each."""
        return [
            f"{point.place.text}: {_class_text(point.first)} ({self.engine}), {_class_text(point.other)} "
            f"({self.other}){', but some repetitions alike' if point.explained else ''}"
            for point in self.checked
            if point.reclassified
        ]

    def to_tree(self) -> dict[str, Any]:
        """Return a summary as nested plain values."""
        return {
            "engine": self.engine,
            "other": self.other,
            "points": self.points,
            "checked": len(self.checked),
            "agrees": self.agrees,
            "largest": {
                column: {k: v for k, v in d._asdict().items() if k != "column"} | {"at": place.text}
                for column, (d, place) in self.largest.items()
            },
            "reclassified": self.reclassified,
            "disagreements": self.disagreements,
        }

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield lines that summarize it: label and text."""
        yield "checked by", f"engine {self.other}, {len(self.checked)} of {self.points} points"
        for column, (d, place) in self.largest.items():
            yield f"  {column}", f"within {d.difference / d.scale:.2g} of its scale, {d.difference:.2g} at {place.text}"
        yield "  classified differently", f"{len(self.reclassified)} of {len(self.checked)} points"


def _class_text(found: Iterable[Any]) -> str:
    return ", ".join("none" if value is None else str(value) for value in found)


def check_sweep(
    scene: Scene,
    share: float = 1.0,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    other: Other = by_other_engine,
    progress: Progress | None = None,
) -> SweepCheck:
    """Sweep a scene, and repeat a share of the points with another engine from the same starts.

    Parameters
    ----------
    scene
        A scene with a section ``sweep``.
    share
        Of the points, more than 0 and at most 1.
    jobs, scheduler, wait
        As in :func:`vibroplat.study.sweep.sweep`.
    other
        Returns the scene that checks a point's scene; by default the same one with another engine.
    progress
        Called after each point of the sweep and then of the check with the numbers of finished branches or checks, of
        points and of events.

    Raises
    ------
    ConfigError
        The share is not allowed; and as for ``sweep``.

    Examples
    --------
    >>> from vibroplat import Scene, check_sweep
    >>> scene = Scene().replace({"sweep.supply_frequency_hz": {"start": 45.0, "stop": 46.0}})
    >>> check_sweep(scene, 0.1).agrees
    True
    """
    require_share(share)
    places = chosen(scene, share)
    opened = pool(jobs, scheduler, wait=wait, chains=max(len(branches(scene)), len(places)))
    with Store(None, {}) as store, opened as workers:
        run_sweeps([(scene, store)], workers, progress)
        return check_points(scene, places, store, store.part("check"), workers, other=other, progress=progress)


def check_points(
    scene: Scene,
    places: Sequence[Place],
    records: Records,
    kept: Records,
    workers: Pool,
    *,
    other: Other = by_other_engine,
    progress: Progress | None = None,
) -> SweepCheck:
    """Repeat points of a finished sweep with another engine.

    Parameters
    ----------
    scene
        That of the sweep.
    places
        The points, by branches.
    records
        Where the points of the sweep are stored.
    kept
        Where repetitions are stored; those that are stored already are not done again.
    workers
        Where they are done.
    other, progress
        As in :func:`check_sweep`.
    """
    plan = sweep_plan(scene)
    chains = [
        StoredChain(_checked(place, plan, *begun, other), kept, f"{place.branch.number}/{place.point}")
        for place, begun in zip(places, _beginnings(places, records), strict=True)
    ]
    done = sum(chain.done for chain in chains)
    for chain in run_chains(chains, workers):
        done += chain.done
        if progress is not None:
            progress(done, done, 0)
    points = sum(len(branch.frequencies) for branch in branches(scene))
    names = engine_name(scene), engine_name(other(scene))
    return SweepCheck(*names, points, tuple(chain.result for chain in chains))


def _beginnings(places: Sequence[Place], records: Records) -> Iterator[tuple[list[float] | None, Row]]:
    """Yield for each point the state at the end of the last good point before it, and its row."""
    wanted: dict[int, tuple[Branch, set[int]]] = {}
    for place in places:
        wanted.setdefault(place.branch.number, (place.branch, set()))[1].add(place.point)
    for branch, points in wanted.values():
        state: list[float] | None = None
        for point, record in enumerate(branch_records(branch, records)):
            if point in points:
                yield state, record["row"]
            state = record["state"] or state


def _checked(place: Place, plan: SweepPlan, state: list[float] | None, row: Row, other: Other) -> Tasks[PointCheck]:
    """Compare a point's row with that of the other engine, and if they differ, with repetitions of both.

    Both rows must be of one class, or repetitions of both; of these, or of the rows, the measures are compared.
    """
    branch, point = place
    scene = branch.at(point)
    key = branch.key(branch.frequencies[point])
    tolerance = scene.solver.tolerance

    def task(scene: Scene, off: float = 0.0) -> Task:
        start = plan.model_copy(update={"perturbation": plan.perturbation + off})
        return point_task(scene, start, state, key)

    def repetitions(scene: Scene) -> Iterator[Task]:
        yield task(with_other_tolerance(scene))
        for off in (tolerance, -tolerance, 2.0 * tolerance):
            yield task(scene, off)

    first: list[Row] = [row]
    record: Record = yield task(other(scene))
    others: list[Row] = [record["row"]]
    found = _conclude(place, plan, scene, first, others)
    if found.agrees:
        return found
    for again in repetitions(scene):
        first.append((yield again)["row"])
    more = repetitions(other(scene))
    others.append((yield next(more))["row"])
    found = _conclude(place, plan, scene, first, others)
    if found.explained:
        return found
    for again in more:
        others.append((yield again)["row"])
    return _conclude(place, plan, scene, first, others)


def _conclude(place: Place, plan: SweepPlan, scene: Scene, first: list[Row], other: list[Row]) -> PointCheck:
    """Compare the first rows of both that are of one class, with the repetitions that are of it too."""
    classes = [class_of(row) for row in first], [class_of(row) for row in other]
    common = next((c for c in classes[0] if c in classes[1]), None)
    of_it = [[row for row in rows if class_of(row) == common] for rows in (first, other)]
    differences = [] if common is None else compared(scene, plan, *of_it)
    return PointCheck(place, classes[0][0], classes[1][0], differences, common is not None)
