"""Branches as chains of tasks: a worker makes a part of a branch, and the next task continues from its last point.

A branch that is found at a special point becomes a chain of its own, after those that are known have ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroplat.columns import Column, Columns
from vibroplat.config.circular import wrap
from vibroplat.config.engine_choice import chosen_engine, other_engine, with_second_engine
from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.arclength import LAW_JUMPS, Branch
from vibroplat.continuation.first_orbit import MissedOrbitError, OrbitError, first_orbit
from vibroplat.continuation.locate import find_special_points
from vibroplat.continuation.newton import NoConvergenceError, Problem, correct
from vibroplat.continuation.orbit import measures_of_orbit, orbit_near, read_guess, with_orbit_tolerance
from vibroplat.continuation.shooting import Shooter, event_sequence_text
from vibroplat.continuation.special_points import (
    DOUBLING,
    MIRROR_INVARIANTS,
    OrbitPoint,
    SpecialPoint,
    new_branches,
    tangent_of,
)
from vibroplat.kernels.compiled import FloatArray
from vibroplat.shooting.multipliers import n_unstable
from vibroplat.shooting.orbits import ANGLE_INDEX
from vibroplat.study.pool import Task, Tasks
from vibroplat.study.store import Record

#: Points of a branch that a task makes.
POINTS_PER_TASK = 100
#: Largest multipliers that tables have.
MAX_MULTIPLIERS = 4
#: Distance of two special points, as a part of the key's range, within which they are one.
SAME_POINT = 1e-4
#: Points back within which a branch that meets itself has not gone round, but come back from a corner.
CORNER_POINTS = 8
TURNED_BACK = "lost at a corner: the continuation turned back along the branch"
#: Measures that tell points apart, and how far that of a point may lie from a former one, as a part of the step between
#: its neighbours, to be the same. Where impacts accumulate, the parts of a branch between its folds differ in stability
#: much more than in other measures.
DEVIATIONS = dict.fromkeys(("period_s", *MIRROR_INVARIANTS), 0.1) | {"multiplier_1_re": 0.3}


@dataclass(frozen=True)
class GridCell:
    """All branches of one combination of the grid's values; the scene at the start, with the tolerance of orbits."""

    number: int
    grid: dict[str, Any]
    scene: Scene


# -- what has been passed before ---------------------------------------------------------------------------------------


def same_special(one: Record, other: Record, plan: OrbitsPlan) -> bool:
    """Whether two branches have found the same point where they cross."""
    near = abs(one["value"] - other["value"]) <= SAME_POINT * abs(plan.stop - plan.start)
    frequencies = one["excitation_frequency_hz"], other["excitation_frequency_hz"]
    return bool(near and one["kind"] == other["kind"] and abs(frequencies[0] / frequencies[1] - 1.0) < SAME_POINT)


class KnownPoints(NamedTuple):
    """What is known of a family: special points already switched at, other branches by number, and own points."""

    special: Sequence[Record]
    others: Sequence[tuple[int, Sequence[Record]]]
    own: Sequence[Record]


#: Separates the points of two branches: no value lies between nan and another one.
_NOWHERE: Record = {"value": math.nan}


class PassedPoints:
    """Points that were passed before: those of the other branches, and own ones; more own ones can be added.

    Attributes
    ----------
    own
        Points of this branch.
    """

    def __init__(self, known: KnownPoints, room: int) -> None:
        self.own = [*known.own]
        self._others, self._numbers = list[Record](), list[int]()
        for number, former in known.others:
            self._others += [*former, _NOWHERE]
            self._numbers += [number] * (len(former) + 1)
        values = [point["value"] for point in (*self._others, *self.own)]
        self._values: FloatArray = np.array([*values, *[math.nan] * room])

    def add(self, row: Record) -> None:
        """Add an own point."""
        self._values[len(self._others) + len(self.own)] = row["value"]
        self.own.append(row)

    def find_revisit(self, row: Record) -> str:
        """Say in which way a branch has passed a new point before; empty if it has not."""
        own = self.own[:-2]
        former = self._others + own
        found = _find_pass(row, former, self._values[: len(former)])
        if found is None:
            return ""
        place, mirrored = found
        if place < len(self._others):
            return f"{'mirror image of' if mirrored else 'joins'} branch {self._numbers[place]}"
        last = own[-CORNER_POINTS:]
        back = not mirrored and _find_pass(row, last, np.array([point["value"] for point in last])) is not None
        return TURNED_BACK if back else "mirror image" if mirrored else "loop"


def _find_pass(row: Record, former: Sequence[Record], values: FloatArray) -> tuple[int, bool] | None:
    """Where a branch has passed a point, and whether as its mirror image; None if it has not."""
    beyond = values - row["value"]
    for i in (beyond[:-1] * beyond[1:] <= 0.0).nonzero()[0].tolist():
        first, second = former[i], former[i + 1]
        if row["period"] != first["period"] or row["sequence"] not in (first["sequence"], second["sequence"]):
            continue
        low, high = sorted((first["value"], second["value"]))
        thirds = [
            p for p in (*former[max(i - 1, 0) : i], *former[i + 2 : i + 3]) if p["value"] < low or p["value"] > high
        ]
        ways = [[first, second], *([first, second, third] for third in thirds)]
        if any(all(_near(row, *alike, known) for alike in DEVIATIONS.items()) for known in ways):
            here, there = row["phase_difference_rad"], first["phase_difference_rad"]
            apart, mirrored = (abs(wrap(here - sign * there)) for sign in (1, -1))
            return i, bool(mirrored < apart - 1e-6)
    return None


def _near(row: Record, name: str, part: float, known: Sequence[Record]) -> bool:
    """Whether a measure lies on the polynomial through those of known points, as exactly as they give it."""
    expected = 0.0
    for point in known:
        others = (other["value"] for other in known if other is not point)
        expected += point[name] * math.prod((row["value"] - v) / (point["value"] - v or math.inf) for v in others)
    step = abs(known[1][name] - known[0][name])
    return bool(abs(row[name] - expected) <= part * step + 1e-7 * abs(expected) + 1e-12)


# -- a part of a branch ------------------------------------------------------------------------------------------------


def compute_part(scene: Scene, plan: OrbitsPlan, begin: Record | None, known: KnownPoints) -> Record:
    """Make a part of a branch: points, special points, and first points of branches that begin there.

    It begins at the start where ``begin`` is None, else at a place that :func:`_point_record` describes. The record has
    new ``rows`` and ``special`` points, the ``last`` place, and why the branch ``ended``, or has ``failed``.
    """

    def compute(tried: Scene) -> Record:
        shooter = Shooter.borrow(with_orbit_tolerance(tried, plan.tolerance), [plan.key], plan.range)
        try:
            return _compute_with(shooter, plan, begin, known)
        finally:
            shooter.give_back()

    return with_second_engine(scene, compute, lambda record: record["missed"], reason=lambda record: (record, "ended"))


def _compute_with(shooter: Shooter, plan: OrbitsPlan, begin: Record | None, known: KnownPoints) -> Record:
    """Make a part of a branch with a shooter (:func:`compute_part`)."""
    record: Record = {"rows": [], "special": [], "last": None, "ended": "", "failed": False, "missed": False}
    try:
        branch = _begin_branch(shooter, plan, begin)
    except (NoConvergenceError, OrbitError) as error:
        missed = isinstance(error, (NoConvergenceError, MissedOrbitError))
        return record | {"ended": str(error), "failed": True, "missed": missed}
    taken, ends, step = list[tuple[OrbitPoint, float]](), list[SpecialPoint](), list[OrbitPoint]()
    limit = min(POINTS_PER_TASK, plan.max_points - len(known.own))
    passed = PassedPoints(known, limit)
    own = passed.own

    def look(before: OrbitPoint, after: OrbitPoint, strictly: bool) -> None:
        step[:] = before, after
        for special in list(find_special_points(branch, before, after, strictly=strictly)):
            if not (plan.covers(special.value) or plan.covers(after.value)):
                return  # beyond the end of the branch
            special_record = branch.problem.describe(special.point) | {"kind": special.kind, "value": special.value}
            special_record |= {"after": len(own), "branches": []}
            old = any(same_special(special_record, other, plan) for other in (*known.special, *record["special"]))
            if special.kind in plan.switch and not old and not (special.kind == DOUBLING and special.mirrors):
                starts = new_branches(branch.problem, special, _steps(plan)[0], branch.largest)
                special_record["branches"] = [_point_record(*start) for start in starts]
            record["special"].append(special_record)
            if special.mirrors and len(own) > 1:
                ends.append(special)
                return

    def take() -> None:
        """Take the last point, unless it was passed before: then the branch ends."""
        point, turns = branch.points[-1], shooter.take_turns()
        marks = _marks_of(branch.problem, point)
        again = passed.find_revisit(marks)
        record["ended"], record["failed"] = again or branch.ended, again == TURNED_BACK
        if not again:
            taken.append((point, turns))
            passed.add(marks)

    if begin is None or begin["new"]:
        take()
    while len(taken) < limit and not record["ended"]:
        if not branch.extend(look):
            record["ended"], record["failed"] = _with_engine(branch.ended, shooter.scene), True
            break
        if ends:
            beyond = "half the period beyond" if ends[0].kind == DOUBLING else "mirror image beyond"
            branch.points[-1], branch.ended = ends[0].point, beyond
        else:
            _stop_at_end(branch, plan, *step)
        take()
    record["last"] = _point_record(branch.problem, branch.points[-1], branch.step, new=False)
    # one after the other, which takes two thirds of the time of each as its point is taken
    record["rows"] = [_row(branch.problem, *each) for each in taken]
    return record


def _with_engine(ended: str, scene: Scene) -> str:
    """Say which engine has ended a branch midway, and which may go on, unless the law of impact ended it."""
    engine = chosen_engine(scene)
    hint = f"; engine {engine} ended it, solver.engine = {other_engine(engine)} may go on"
    return ended if ended.endswith(LAW_JUMPS) else ended + hint


def _steps(plan: OrbitsPlan) -> list[float]:
    """First, largest and least step along a branch, in units of the unknowns."""
    return [length / plan.unit for length in plan.step.lengths(abs(plan.stop - plan.start))]


def _begin_branch(shooter: Shooter, plan: OrbitsPlan, begin: Record | None) -> Branch:
    """Begin a branch towards the stop, or go on with one from one of its points."""
    first, largest, min_step = _steps(plan)
    if begin is None:
        initial = None if plan.from_ == "settled" else shooter.scene.run.initial.state
        shooter.set([float(plan.start)])
        _, state = read_guess(shooter.scene, None if initial is None else initial.model_dump())
        problem, result = first_orbit(shooter, state, plan.period, [plan.unit], plan.tolerance)
        towards = np.zeros(result.u.size)
        towards[-1] = np.sign(plan.stop - plan.start)
        branch = Branch(problem, first, min_step, largest)
        point = OrbitPoint.of(result, tangent_of(result.jacobian, towards))
    else:
        state, full = np.array(begin["state"]), np.array(begin["tangent"])
        shooter.set([begin["value"]])
        branch = Branch(Problem(shooter, begin["turns"], [plan.unit], plan.tolerance), begin["step"], min_step, largest)
        chart = branch.problem.chart(state)
        tangent = np.append(full[chart.places], full[-1])
        tangent[chart.phase] = full[-2]
        u = chart.pack(state, begin["period_s"], [begin["value"]])
        point = branch.correct(chart, u, tangent / np.linalg.norm(tangent), steps=20)
    branch.points.append(branch.centre_section(point))
    return branch


def _point_record(problem: Problem, point: OrbitPoint, step: float, new: bool) -> Record:
    """Describe a point of a branch, whether it is new or has a row already, so that a worker can go on from there."""
    chart, tangent = point.chart, point.tangent
    full = np.zeros(chart.base.size + 2)  # along the state, the period and the key
    full[chart.places] = tangent[: chart.places.size]
    full[ANGLE_INDEX], full[-2], full[-1] = 0.0, tangent[chart.phase], tangent[-1]
    return problem.describe(point) | {"tangent": full.tolist(), "step": step, "new": new}


def _stop_at_end(branch: Branch, plan: OrbitsPlan, before: OrbitPoint, last: OrbitPoint) -> None:
    """End a branch at the end of the key's range, if its last step, between points in one chart, has left it."""
    if plan.covers(last.value):
        return
    end = float(np.clip(last.value, *plan.range))
    branch.ended = "start of the key's range" if end == plan.start else "stop of the key's range"
    u = before.u + (end - before.value) / (last.value - before.value) * (last.u - before.u)
    u[-1] = end / plan.unit
    with suppress(NoConvergenceError):
        result = correct(branch.problem, last.chart, u, np.eye(u.size)[-1:], last.jacobian)
        branch.points[-1] = OrbitPoint.of(result, tangent_of(result.jacobian, last.tangent))


def _row(problem: Problem, point: OrbitPoint, turns: float) -> Record:
    """Return the row of a point in the table of branches; ``turns`` are those since the point before."""
    unstable = n_unstable(point.multipliers)
    return {
        **problem.describe(point),
        "value": _round(point.value),
        **measures_of_orbit(problem, point),
        "sequence": event_sequence_text(point.event_sequence),
        "stable": unstable == 0,
        "n_unstable": unstable,
        **multiplier_columns(point.multipliers, MAX_MULTIPLIERS),
        "residual": point.residuals[-1],
        "turns": turns,
    }


def _marks_of(problem: Problem, point: OrbitPoint) -> Record:
    """Return the measures that distinguish a point from others, as :func:`_measures` does for rows."""
    values = point.shot.known[1]
    return {
        **{name: values[name] for name in ("phase_difference_rad", *MIRROR_INVARIANTS)},
        "value": _round(point.value),
        "period": abs(problem.turns[0]),
        "period_s": point.shot.duration,
        "sequence": event_sequence_text(point.event_sequence),
        "multiplier_1_re": float(point.multipliers[0].real),
    }


def _round(value: float) -> float:
    """Leave out what units leave of a round number."""
    return float(f"{value:.15g}")


# -- all parts of all branches -----------------------------------------------------------------------------------------


@dataclass
class ComputedBranch:
    """A branch that has been followed: its points and special points, as plain values, and why it ended."""

    family: GridCell
    number: int
    parent: int  # that on which it was found, or −1
    origin: str  # start, or the kind of the special point at which it begins
    source: Record | None = None  # that point
    rows: list[Record] = field(default_factory=list)
    special: list[Record] = field(default_factory=list)
    ended: str = ""
    failed: bool = False

    def passes(self, source: Record | None, plan: OrbitsPlan) -> bool:
        """Whether it goes through a special point from elsewhere: all that begins there is known then."""
        if source is None or self.source is source:
            return False
        return any(same_special(source, special, plan) for special in self.special)


def follow_family(
    family: GridCell, plan: OrbitsPlan, traced: list[ComputedBranch], progress: Callable[[], None]
) -> Tasks[None]:
    """Follow the branches of a family, one after the other, and add them to those that are traced.

    Branches that begin at special points wait until those found before have ended, as one of these may pass there. One
    of which nothing is new is a direction of a branch that is known.
    """
    own, scene = list[ComputedBranch](), family.scene
    waiting: list[tuple[int, Record | None, Record | None]] = [(-1, None, None)]
    switched: list[Record] = []
    nothing: Record = {"rows": [], "special": [], "last": None, "failed": True}
    while waiting and len(own) < plan.max_branches:
        parent, source, begin = waiting.pop(0)
        if any(other.number != parent and other.passes(source, plan) for other in own):
            continue
        branch = ComputedBranch(family, len(own), parent, "start" if source is None else source["kind"], source)
        traced.append(branch)
        while not branch.ended:
            left = [special for special in (*switched, *branch.special) if special["branches"]]
            known = KnownPoints(left, [(other.number, _measures(other.rows)) for other in own], _measures(branch.rows))
            record = yield Task(compute_part, (scene, plan, begin, known), lambda reason: nothing | {"ended": reason})
            branch.ended, branch.failed, begin = record["ended"], record["failed"], record["last"]
            branch.special += record["special"]
            branch.rows += record["rows"]
            if not branch.ended and len(branch.rows) >= plan.max_points:
                branch.ended = f"max_points = {plan.max_points} reached"
            progress()
        if parent >= 0 and not branch.rows and not branch.failed:
            traced.remove(branch)
            continue
        own.append(branch)
        for special in branch.special:
            if special["branches"] and not any(same_special(special, other, plan) for other in switched):
                switched.append(special)
                waiting += [(branch.number, special, start) for start in special["branches"]]


def _measures(rows: Sequence[Record]) -> list[Record]:
    """Return what tells points apart."""
    return [{n: row[n] for n in ("value", "period", "sequence", "phase_difference_rad", *DEVIATIONS)} for row in rows]


def multiplier_columns(multipliers: NDArray[np.complex128], count: int) -> dict[str, float | None]:
    """Return the columns of so many of the largest multipliers; the last is left out if it is half of a pair."""
    whole = multipliers[:count]
    if multipliers.size > count and multipliers[count] == multipliers[count - 1].conjugate() != multipliers[count - 1]:
        whole = whole[:-1]
    columns: dict[str, float | None] = {}
    for i, multiplier in enumerate([*whole.tolist(), *[None] * (count - whole.size)], 1):
        columns[f"multiplier_{i}_re"] = None if multiplier is None else multiplier.real
        columns[f"multiplier_{i}_im"] = None if multiplier is None else multiplier.imag
    return columns


def describe_multipliers(count: int) -> Columns:
    """Describe the columns of :func:`multiplier_columns`."""
    meanings = dict.fromkeys(range(1, count), "sorted by magnitude, the largest first")
    meanings[count] = "empty if it is one half of a complex pair whose other half has no column"
    return {
        f"multiplier_{i}_{part}": Column(f"{which} part of Floquet multiplier {i}", meaning)
        for i, meaning in meanings.items()
        for part, which in (("re", "real"), ("im", "imaginary"))
    }


def find_orbit_again(scene: Scene, row: Record, tolerance: float) -> Record:
    """Find the orbit of a row of the table of branches anew; the ``row`` of the result is empty if there is none."""
    try:
        orbit = orbit_near(scene, row, row["period"], tolerance)
    except OrbitError:
        return {"row": {}}
    return {"row": {**orbit.measures, "period": orbit.period}}
