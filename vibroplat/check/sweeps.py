"""Points of a sweep are checked: another engine repeats them from the same starts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final, NamedTuple

from vibroplat.check import FLOOR, MULTIPLE, Other, by_other_engine, with_other_tolerance
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.integrate import engine_name
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.observe.summary import COHERENCE, MAXIMA
from vibroplat.study import WAIT
from vibroplat.study.branches import Branch, Place, branches, chosen, require_share
from vibroplat.study.point import ERRORS, point_task
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, pool, run_stored
from vibroplat.study.store import Store
from vibroplat.study.sweep import Progress, branch_records, run_sweeps

#: Standard errors of the difference of two means over blocks that are allowed. With 24 blocks each it follows
#: Student's distribution with 46 degrees of freedom, beyond six of them once in three million cases.
SIGMAS: Final = 6.0
#: Change under repetitions, over the standard error, from which on they count as independent motions: of these, all
#: stay below it once in 10 000 cases.
CHANCE: Final = 0.1
#: Columns that say what kind of motion a row is.
CLASS: Final = ("outcome", "sync", "motion", "period")

_EXPONENT: Final = "lyapunov_per_s"
_PHASE: Final = "phase_difference_rad"
_ERRORS: Final = {name: error for name, error in ERRORS.items() if name not in MAXIMA} | {
    _EXPONENT: "lyapunov_error_per_s"
}

#: A row of the sweep table.
Row = Mapping[str, Any]


class Deviation(NamedTuple):
    """The difference of a column between two engines, and what is allowed, in units of the column."""

    column: str
    first: float
    other: float
    difference: float
    allowed: float
    scale: float


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
    differences: list[Deviation]
    explained: bool

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
    def largest(self) -> dict[str, tuple[Deviation, Place]]:
        """The largest difference of each column, and where it is."""
        found: dict[str, tuple[Deviation, Place]] = {}
        for point in self.checked:
            for d in point.differences:
                if d.column not in found or d.difference > found[d.column][0].difference:
                    found[d.column] = d, point.place
        return found

    @property
    def disagreements(self) -> list[str]:
        """What errors of the tolerance do not explain: a line for each point, with the measure farthest beyond."""
        return [self._disagreement(point) for point in self.checked if not point.agrees]

    def _disagreement(self, point: PointCheck) -> str:
        if not point.explained:
            pairs = zip(CLASS, point.first, point.other, strict=True)
            name, one, two = next(pair for pair in pairs if pair[1] != pair[2])
            most = "the same in some repetitions"
        else:
            d = max(point.differences, key=lambda d: d.difference / d.allowed)
            name, one, two, most = d.column, f"{d.first:.12g}", f"{d.other:.12g}", f"a difference of {d.allowed:.2g}"
        found = f"{name} = {one} ({self.engine}) and {two} ({self.other})"
        return f"engines disagree at {point.place.text}: {found}; allowed: {most}"

    @property
    def reclassified(self) -> list[str]:
        """The rows that both engines classify differently, a line for each."""
        lines = []
        for point in self.checked:
            if point.first != point.other:
                one, two = (
                    ", ".join("none" if value is None else str(value) for value in found)
                    for found in (point.first, point.other)
                )
                alike = ", but some repetitions alike" if point.explained else ""
                lines.append(f"{point.place.text}: {one} ({self.engine}), {two} ({self.other}){alike}")
        return lines

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
        Makes the scene that checks a point's scene; by default the same one with another engine.
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
    planned = branches(scene)
    places = chosen(planned, share)
    chains = max(len(planned), len(places))
    with Store(None, {}) as store, pool(jobs, scheduler, wait=wait, chains=chains) as workers:
        run_sweeps([(planned, store)], workers, progress)
        return check_points(planned, places, store, workers, other=other, progress=progress)


def check_points(
    planned: Sequence[Branch],
    places: Sequence[Place],
    store: Store,
    workers: Pool,
    *,
    other: Other = by_other_engine,
    progress: Progress | None = None,
) -> SweepCheck:
    """Repeat points of a finished sweep with another engine; those that are stored already are not done again.

    Parameters
    ----------
    planned
        The branches of the sweep.
    places
        The points, by branches.
    store
        Where the points of the sweep are stored, and repetitions in a part of their own.
    workers
        Where they are done.
    other, progress
        As in :func:`check_sweep`.
    """

    def tell(done: int) -> None:
        if progress is not None:
            progress(done, done, 0)

    kept = store.part("check")
    chains = [
        StoredChain(_checked(place, *begun, other), kept, f"{place.branch.number}/{place.point}")
        for place, begun in zip(places, _beginnings(places, store), strict=True)
    ]
    found = run_stored(chains, workers, tell)
    points = sum(len(branch.along) for branch in planned)
    scene = planned[0].scene
    return SweepCheck(engine_name(scene), engine_name(other(scene)), points, tuple(found))


def _beginnings(places: Sequence[Place], store: Store) -> Iterator[tuple[list[float] | None, Row]]:
    """Yield for each point the state at the end of the last good point before it, and its row."""
    for _, group in groupby(places, key=lambda place: place.branch.number):
        wanted = list(group)
        points = {place.point for place in wanted}
        state: list[float] | None = None
        for point, record in enumerate(branch_records(wanted[0].branch, store)):
            state = wanted[0].branch.begin(state, point)
            if point in points:
                yield state, record["row"]
            state = record["state"] or state


def _checked(place: Place, state: list[float] | None, row: Row, other: Other) -> Tasks[PointCheck]:
    """Compare a point's row with that of the other engine, and if they differ, with repetitions of both.

    Both rows must be of one class, or repetitions of both; of these, or of the rows, the measures are compared.
    """
    branch, point = place
    scene, plan = branch.at(point), branch.plan
    tolerance = scene.solver.tolerance

    def task(scene: Scene, off: float = 0.0) -> Task:
        start = plan.model_copy(update={"perturbation": plan.perturbation + off})
        return point_task(scene, start, state, branch.key(branch.along[point]))

    def repetitions(scene: Scene) -> Iterator[Task]:
        yield task(with_other_tolerance(scene))
        for off in (tolerance, -tolerance, 2.0 * tolerance):
            yield task(scene, off)

    one, two = [row], [(yield task(other(scene)))["row"]]
    found = _conclusion(place, scene, one, two)
    if found.agrees:
        return found
    for again in repetitions(scene):
        one.append((yield again)["row"])
    more = repetitions(other(scene))
    for group in ([next(more)], more):  # starts of the other engine only if another tolerance does not explain it
        for again in group:
            two.append((yield again)["row"])
        found = _conclusion(place, scene, one, two)
        if found.explained:
            break
    return found


def _conclusion(place: Place, scene: Scene, first: list[Row], other: list[Row]) -> PointCheck:
    """Compare the first rows of both that are of one class, with the repetitions that are of it too."""
    common = next((kind for kind in map(_class, first) if kind in map(_class, other)), None)
    one, two = ([row for row in rows if _class(row) == common] for rows in (first, other))
    differences = [] if common is None else deviations(scene, place.branch.plan.settle_tolerance, one, two)
    return PointCheck(place, _class(first[0]), _class(other[0]), differences, common is not None)


def _class(row: Row) -> tuple[Any, ...]:
    return tuple(map(row.get, CLASS))


# -- measures ---------------------------------------------------------------------------------------------


def deviations(scene: Scene, settled: float, first: Sequence[Row], other: Sequence[Row]) -> list[Deviation]:
    """Compare two rows of one class, each with repetitions of the class, which show what is allowed.

    Means over blocks of chaotic motion may differ by SIGMAS of their standard errors. So may those of other motion that
    does not repeat, if repetitions differ by more than CHANCE of these errors; if they do not, both motions are the
    same from start to end and so are their means, however blocks scatter. Extremes of motion that does not repeat have
    no standard error and are not compared. Motions that settled for different times are compared to the settling
    tolerance, which is how far from the steady motion either may be.

    Parameters
    ----------
    scene
        Of the point.
    settled
        Settling tolerance.
    first, other
        Rows of the first engine and of the other one, each with its repetitions after it.
    """
    one, two = first[0], other[0]
    floor = FLOOR * scene.solver.tolerance
    turn = 2.0 * math.pi / scene.speed_scale
    if abs((one.get("settle_s") or 0.0) - (two.get("settle_s") or 0.0)) > turn:
        floor = max(floor, settled)
    found = []
    for column, scale in scales_of(scene).items():
        if scale == 0.0 or _absent(one, column) or _absent(two, column):
            continue
        pairs = [(rows[0], row) for rows in (first, other) for row in rows[1:] if not _absent(row, column)]
        change = max((_apart(column, *pair) for pair in pairs), default=0.0)
        error = math.hypot(*(row.get(_ERRORS.get(column, "")) or 0.0 for row in (one, two)))
        by_chance = one.get("motion") == "chaotic" or column == _EXPONENT or change > CHANCE * error
        allowed = floor * scale + MULTIPLE * change + (SIGMAS * error if by_chance else 0.0)
        found.append(Deviation(column, one[column], two[column], _apart(column, one, two), allowed, scale))
    return found


def scales_of(scene: Scene) -> dict[str, float]:
    """Return the scales of the columns that are compared, in their units."""
    scales, speed = state_scales(scene), scene.speed_scale
    torque = sum(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    frequency = speed / (2.0 * math.pi)
    return {
        "excitation_frequency_hz": frequency,
        "frequency_split_hz": frequency,
        "rms_x_m": float(scales[0]),
        "rms_y_m": float(scales[1]),
        "rms_phi_rad": float(scales[2]),
        "amplitude_y_m": float(scales[1]),
        _PHASE: 1.0,
        "phase_coherence": 1.0,
        "flight_fraction": 1.0,
        "impacts_per_period": 1.0,
        "gap_max_m": float(scales[GAP]),
        "contact_force_max_n": force_spread(scene),
        "impulse_max_n_s": scene.material_mass * float(scales[GAP_RATE]),
        "motor_power_w": torque * speed,
        _EXPONENT: frequency,
    }


def _absent(row: Row, column: str) -> bool:
    """Whether a row has no value of a column that can be compared."""
    if row.get(column) is None:
        return True
    if column == _PHASE and (row.get("sync") == "none" or (row.get("phase_coherence") or 0.0) < COHERENCE):
        return True
    return row.get("period") == 0 and row.get(_ERRORS.get(column, "")) is None


def _apart(column: str, one: Row, two: Row) -> float:
    """Return how far two values are apart; angles at most half a turn."""
    difference = abs(float(one[column]) - float(two[column]))
    return abs(math.remainder(difference, 2.0 * math.pi)) if column == _PHASE else difference
