"""Branches as chains of tasks: each task makes a part of a branch, and the next one goes on from its last point.

A branch that is found at a special point becomes a chain of its own, after those that are known have ended.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vibroplat.errors import ConfigError
from vibroplat.flow.beginning import end_of
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.orbits_plan import OrbitsPlan
from vibroplat.scene import Scene
from vibroplat.study.execution import Pool
from vibroplat.study.orbits.branch import Branch, Point, Steps
from vibroplat.study.orbits.kinds import BRANCH_POINT, DOUBLING
from vibroplat.study.orbits.newton import ANGLE, Frame, MissedError, Problem, correct
from vibroplat.study.orbits.orbit import OrbitError, accurate, beginning_at, first_orbit, measures_of_orbit, told
from vibroplat.study.orbits.shooting import Shooter
from vibroplat.study.orbits.special import Special, specials
from vibroplat.study.orbits.words import spelled
from vibroplat.study.store import Record, Records
from vibroplat.study.tasks import StoredChain, Task, Tasks, run_stored

#: Points of a branch that a task makes.
PART = 100
#: Largest multipliers that are told.
TOLD = 4
#: First steps along a new branch, over the largest step, one after the other.
AWAY = (0.5, 1.0, 0.2, 0.05)
#: Least part of the way along a branch that must be covered across it by a point that has left it.
LEFT = 0.3
#: Distance of two special points, as a part of the key's range, within which they are one.
SAME_PLACE = 1e-4
#: Points back within which a branch that meets itself has not gone round, but come back from a corner.
RETURN = 8
RETURNED = "no point beyond a corner: the branch came back on itself"
#: Measures that tell points apart, and how far that of a point may lie from a former one, as a part of the step between
#: its neighbours, to be the same. Where impacts accumulate, the parts of a branch between its folds differ in stability
#: much more than in other measures.
MEASURES = ("period_s", "rms_x_m", "rms_y_m", "rms_phi_rad", "motor_power_w")
COMPARED = dict.fromkeys(MEASURES, 0.1) | {"multiplier_1_re": 0.3}


def orbits_plan(scene: Scene) -> OrbitsPlan:
    """Return the plan of a scene's branches of orbits.

    Raises
    ------
    ConfigError
        The scene has no section ``orbits``, a drive program, or no such key with a number.
    """
    plan = scene.orbits
    if plan is None:
        raise ConfigError("this configuration has no orbits section; add orbits: {key: …, start: …, stop: …}")
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given, but orbits have a constant supply; allowed: supply_frequency_hz")
    if plan.from_ == "state" and scene.run.initial.state is None:
        raise ConfigError("orbits.from = state but run.initial.state is not given; allowed: give it, or settled")
    keys = [("orbits.key", plan.key, (plan.start, plan.stop))]
    if plan.boundaries is not None:
        keys.append(("orbits.boundaries.key", plan.boundaries.key, (plan.boundaries.start, plan.boundaries.stop)))
    for place, key, ends in keys:
        for value in ends:
            held = value_of(scene, key)
            if held is not None and not isinstance(held, float):
                raise ConfigError(f"{place} = {key} holds no number that varies continuously; allowed: one that does")
            try:
                parameter_direction(scene.replace({key: float(value)}), key)
            except ConfigError as error:
                raise ConfigError(f"{place}: {error}") from None
    return plan


@dataclass(frozen=True)
class Family:
    """All branches of one combination of the grid's values.

    Attributes
    ----------
    number
        Of the combination.
    grid
        Dotted keys of the grid and their values.
    scene
        At the start of the key, with the tolerance that orbits need.
    """

    number: int
    grid: dict[str, Any]
    scene: Scene


def families(scene: Scene) -> list[Family]:
    """List the combinations of the grid's values; the first key is slowest."""
    plan = orbits_plan(scene)
    found: list[Family] = []
    for combination in itertools.product(*plan.grid.values()):
        values = dict(zip(plan.grid, combination, strict=True))
        try:
            placed = scene.replace(values | {plan.key: float(plan.start)})
            parameter_direction(placed, plan.key)
        except ConfigError as error:
            raise ConfigError(f"orbits.grid: {error}") from None
        if plan.from_ not in ("settled", "state"):
            placed = _at_end(placed, plan.from_)
        found.append(Family(len(found), values, accurate(placed, plan.tolerance)))
    return found


def _at_end(scene: Scene, directory: str) -> Scene:
    """Return the scene at the end of a run, so that workers need not read it.

    Raises
    ------
    ConfigError
        The directory holds no finished run that the scene can go on from.
    """
    try:
        state = end_of(Path(directory), scene).state
    except ConfigError as error:
        text = str(error).replace("run.initial.from", "orbits.from", 1)
        raise ConfigError(text.replace("; allowed: ", "; allowed: settled, state, or ", 1)) from None
    return beginning_at(scene, state)


@dataclass
class Traced:
    """A branch that has been followed.

    Attributes
    ----------
    family, number, parent
        Its combination of the grid's values, its number there, and that of the branch it was found on, or −1.
    origin, source
        What it begins with: ``start``, or the kind of special point, and that point.
    rows, special
        Its points and special points, as plain values.
    ended
        Why it ended.
    failed
        Whether that is a failure.
    """

    family: Family
    number: int
    parent: int
    origin: str
    source: Record | None = None
    rows: list[Record] = field(default_factory=list)
    special: list[Record] = field(default_factory=list)
    ended: str = ""
    failed: bool = False

    def passes(self, source: Record | None, plan: OrbitsPlan) -> bool:
        """Whether it goes through a special point from elsewhere: all that begins there is known then."""
        if source is None or self.source is source:
            return False
        return any(same_special(source, special, plan) for special in self.special)


#: Called after each part of a branch with the numbers of finished branches, of known ones, and of points.
Progress = Callable[[int, int, int], None]


def trace(scene: Scene, records: Records, workers: Pool, progress: Progress | None = None) -> list[Traced]:
    """Follow all branches of a scene; parts that are stored already are not repeated.

    Raises
    ------
    OrbitError
        There is no orbit to begin with, for any combination of the grid's values.
    """
    plan = orbits_plan(scene)
    traced: list[Traced] = []

    def count(record: Record) -> None:
        if progress is not None:
            progress(sum(bool(b.ended) for b in traced), len(traced), sum(len(b.rows) for b in traced))

    chains = [
        StoredChain(_branches(family, plan, traced, count), records, str(family.number)) for family in families(scene)
    ]
    run_stored(chains, workers)
    if all(branch.failed and not branch.rows for branch in traced):
        raise OrbitError(traced[0].ended)
    return sorted(traced, key=lambda branch: (branch.family.number, branch.number))


def _branches(family: Family, plan: OrbitsPlan, traced: list[Traced], take: Callable[[Record], None]) -> Tasks[None]:
    """Follow the branches of a family, one after the other, and add them to those that are traced."""
    own: list[Traced] = []
    waiting: list[tuple[int, Record | None, Record | None]] = [(-1, None, None)]
    switched: list[Record] = []
    while waiting and len(own) < plan.max_branches:
        parent, source, begin = waiting.pop(0)
        if any(other.number != parent and other.passes(source, plan) for other in own):
            continue
        branch = Traced(family, len(own), parent, "start" if source is None else source["kind"], source)
        traced.append(branch)
        yield from _parts(branch, own, switched, plan, begin, take)
        if parent >= 0 and not branch.rows and not branch.failed:
            traced.remove(branch)  # a direction of a branch that is known
            continue
        own.append(branch)
        for special in branch.special:
            if special["branches"] and not any(same_special(special, other, plan) for other in switched):
                switched.append(special)
                waiting += [(branch.number, special, place) for place in special["branches"]]


def same_special(one: Record, other: Record, plan: OrbitsPlan) -> bool:
    """Whether two branches have found the same point where they cross."""
    near = abs(one["value"] - other["value"]) <= SAME_PLACE * abs(plan.stop - plan.start)
    frequencies = one["excitation_frequency_hz"], other["excitation_frequency_hz"]
    return bool(near and one["kind"] == other["kind"] and abs(frequencies[0] / frequencies[1] - 1.0) < SAME_PLACE)


def _seen(special: Record) -> Record:
    """Return what tells a special point from others, see :func:`same_special`."""
    return {name: special[name] for name in ("kind", "value", "excitation_frequency_hz")}


def _parts(
    branch: Traced,
    others: Sequence[Traced],
    switched: Sequence[Record],
    plan: OrbitsPlan,
    begin: Record | None,
    take: Callable[[Record], None],
) -> Tasks[None]:
    """Make a branch part by part."""
    passed = [(other.number, [_compared(row) for row in other.rows]) for other in others]
    while not branch.ended:
        special = [_seen(s) for s in [*switched, *branch.special] if s["branches"]]
        known = Known(special, passed, [_compared(row) for row in branch.rows])
        record = yield Task(_part, (branch.family.scene, plan, begin, known), _lost)
        branch.ended, branch.failed = record["ended"], record["failed"]
        branch.special += [special | {"after": special["after"] + len(branch.rows)} for special in record["special"]]
        branch.rows += record["rows"]
        if not branch.ended and len(branch.rows) >= plan.max_points:
            branch.ended = f"max_points = {plan.max_points} reached"
        begin = record["last"]
        take(record)


def _lost(reason: str) -> Record:
    return {"rows": [], "special": [], "last": None, "ended": reason, "failed": True}


def _compared(row: Record) -> Record:
    """Return what tells points apart."""
    return {name: row[name] for name in ("value", "period", "sequence", "phase_difference_rad", *COMPARED)}


class Known(NamedTuple):
    """What a part of a branch is told of all that is known of its family.

    Attributes
    ----------
    special
        Special points from which other branches have been followed.
    others
        Numbers and points of other branches.
    own
        Points of this branch.
    """

    special: Sequence[Record]
    others: Sequence[tuple[int, Sequence[Record]]]
    own: Sequence[Record]

    def met_again(self, rows: Sequence[Record]) -> str:
        """Say in which way a branch has passed the last of its new points before; empty if it has not."""
        row = rows[-1]
        for number, former in self.others:
            mirrored = _passed(row, former)
            if mirrored is not None:
                return f"{'mirror image of' if mirrored else 'joins'} branch {number}"
        own = [*self.own, *rows[:-1]][:-2]
        mirrored = _passed(row, own)
        if mirrored is None:
            return ""
        back = not mirrored and _passed(row, own[-RETURN:]) is not None
        return RETURNED if back else "mirror image" if mirrored else "loop"


def _passed(row: Record, former: Sequence[Record]) -> bool | None:
    """Whether a branch has passed a point: None if not, else whether as its mirror image."""
    for i, (first, second) in enumerate(itertools.pairwise(former)):
        low, high = sorted((first["value"], second["value"]))
        if not low <= row["value"] <= high or row["period"] != first["period"]:
            continue
        if row["sequence"] not in (first["sequence"], second["sequence"]):
            continue
        thirds = [p for p in (*former[max(i - 1, 0) : i], *former[i + 2 : i + 3]) if not low <= p["value"] <= high]
        ways = [[first, second], *([first, second, third] for third in thirds)]
        if any(all(_near(row, *alike, known) for alike in COMPARED.items()) for known in ways):
            here, there = row["phase_difference_rad"], first["phase_difference_rad"]
            apart, mirrored = (abs(np.angle(np.exp(1j * (here - sign * there)))) for sign in (1, -1))
            return bool(mirrored < apart - 1e-6)
    return None


def _near(row: Record, name: str, part: float, known: Sequence[Record]) -> bool:
    """Whether a measure lies on the polynomial through those of known points, as exactly as it can be told."""
    first, second = known[0][name], known[1][name]
    expected = 0.0
    for point in known:
        weight = 1.0
        for other in known:
            if other is not point:
                weight *= (row["value"] - other["value"]) / (point["value"] - other["value"] or math.inf)
        expected += weight * point[name]
    return bool(abs(row[name] - expected) <= part * abs(second - first) + 1e-7 * abs(expected) + 1e-12)


# -- what a worker does ------------------------------------------------------------------------------------------------


def _part(scene: Scene, plan: OrbitsPlan, begin: Record | None, known: Known) -> Record:
    """Make a part of a branch: from a start, from a special point, or going on from a last point.

    Branches that begin at its special points are looked for, but not at those that are known.
    """
    record: Record = {"rows": [], "special": [], "last": None, "ended": "", "failed": False}
    with closing(Shooter(scene, [plan.key], plan.range)) as shooter:
        try:
            branch = _first(shooter, plan) if begin is None else _again(shooter, plan, begin)
        except (MissedError, OrbitError) as error:
            return record | {"ended": str(error), "failed": True}
        rows, seen, ends, step = record["rows"], list(known.special), list[Special](), list[Point]()

        def look(before: Point, after: Point, *, strictly: bool) -> None:
            step[:] = before, after
            for special in list(specials(branch, before, after, strictly=strictly)):
                if not (plan.covers(special.value) or plan.covers(after.value)):
                    return  # beyond the end of the branch
                found = _special_record(branch, special, len(rows))
                old = any(same_special(found, other, plan) for other in seen)
                found["branches"] = [] if old else _new_branches(branch, special, plan)
                record["special"].append(found)
                seen.append(found)
                if special.mirrors and len(known.own) + len(rows) > 1:
                    ends.append(special)
                    return

        if begin is None or begin["new"]:
            _take(branch, known, record)
        while len(rows) < PART and not record["ended"]:
            if not branch.grow(look):
                return record | {"ended": branch.ended, "failed": True}
            if ends:
                beyond = "half the period beyond" if ends[0].kind == DOUBLING else "mirror image beyond"
                branch.points[-1], branch.ended = ends[0].point, beyond
            else:
                _stop_at_end(branch, plan, *step)
            _take(branch, known, record)
        record["last"] = _place(branch, branch.points[-1], branch.steps.now, new=False)
    return record


def _take(branch: Branch, known: Known, record: Record) -> None:
    """Add the row of the last point, unless it was passed before: then the branch ends."""
    rows = record["rows"]
    rows.append(row_of_point(branch, branch.points[-1], branch.problem.shooter))
    again = known.met_again(rows)
    record["ended"], record["failed"] = again or branch.ended, again == RETURNED
    if again:
        rows.pop()


def _branch(problem: Problem, plan: OrbitsPlan) -> Branch:
    """Begin a branch without points."""
    first, largest, least = plan.step.lengths(abs(plan.stop - plan.start))
    return Branch(problem, Steps(first / plan.unit, least / plan.unit, largest / plan.unit))


def _first(shooter: Shooter, plan: OrbitsPlan) -> Branch:
    """Find the first orbit of the first branch, towards the stop."""
    state = shooter.scene.run.initial.state
    shooter.set({plan.key: float(plan.start)})
    guess = None if plan.from_ == "settled" or state is None else state.model_dump()
    problem, frame, found = first_orbit(shooter, guess, plan.period, [plan.unit], plan.tolerance)
    branch = _branch(problem, plan)
    towards = np.zeros(found.u.size)
    towards[-1] = np.sign(plan.stop - plan.start)
    branch.points.append(branch.in_middle(branch.point(frame, found, towards)))
    return branch


def _again(shooter: Shooter, plan: OrbitsPlan, begin: Record) -> Branch:
    """Go on with a branch from one of its points, with the direction in which it goes."""
    state = np.array(begin["state"])
    shooter.set({plan.key: begin["value"]})
    branch = _branch(Problem(shooter, tuple(begin["turns"]), [plan.unit], plan.tolerance), plan)
    branch.steps.now = begin["step"]
    frame = Frame(state, shooter.shot(state, 0.0).begins)
    full = np.array(begin["tangent"])
    tangent = np.append(full[frame.places], full[-1])
    tangent[frame.phase] = full[-2]
    u = branch.problem.pack(frame, state, begin["period_s"], [begin["value"]])
    branch.begin(frame, u, tangent / np.linalg.norm(tangent))
    return branch


def _place(branch: Branch, point: Point, step: float, *, new: bool) -> Record:
    """Describe a point of a branch so that another worker can go on from there."""
    state, seconds, values = branch.problem.unpack(point.frame, point.u)
    return {
        "turns": list(branch.problem.turns),
        "state": state.tolist(),
        "period_s": seconds,
        "value": values[0],
        "tangent": _full_tangent(branch.problem, point.frame, point.tangent).tolist(),
        "step": step,
        "new": new,
    }


def _full_tangent(problem: Problem, frame: Frame, tangent: FloatArray) -> FloatArray:
    """Write a direction of unknowns as one of the full state, then the period, then the key."""
    full = np.zeros(problem.shooter.scales.size + 2)
    full[frame.places] = tangent[: frame.places.size]
    full[ANGLE], full[-2], full[-1] = 0.0, tangent[frame.phase], tangent[-1]
    return full


def _stop_at_end(branch: Branch, plan: OrbitsPlan, before: Point, last: Point) -> None:
    """End a branch at the end of the key's range, if its last step, between points in one frame, has left it."""
    if plan.covers(last.value):
        return
    low, high = plan.range
    end = low if last.value < low else high
    branch.ended = "start of the key's range" if end == plan.start else "stop of the key's range"
    share = (end - before.value) / (last.value - before.value)
    u = before.u + share * (last.u - before.u)
    u[-1] = end / branch.problem.units[0]
    border = np.zeros((1, u.size))
    border[0, -1] = 1.0
    with suppress(MissedError):
        found = correct(branch.problem, last.frame, u, border, last.found.jacobian)
        branch.points[-1] = branch.point(last.frame, found, last.tangent)


def _new_branches(branch: Branch, special: Special, plan: OrbitsPlan) -> list[Record]:
    """Find the first points of the branches that begin at a special point, where they are to be followed."""
    if special.kind not in plan.switch or (special.kind == DOUBLING and special.mirrors):
        return []
    if special.kind == BRANCH_POINT:
        assert special.across is not None
        new = _branch(branch.problem, plan)
        ahead, back = (_first_away(new, special, special.point.u, sign * special.across) for sign in (1.0, -1.0))
        if ahead is None or back is None:
            return [_place(new, point, new.steps.now, new=True) for point in (ahead, back) if point is not None]
        if _mirrors(branch, ahead, back):
            return [_place(new, ahead, new.steps.now, new=True)]
        return _through(new, ahead, back)
    problem = branch.problem
    doubled = Problem(problem.shooter, (2 * problem.turns[0], 2 * problem.turns[1]), problem.units, problem.tolerance)
    u = special.point.u.copy()
    u[special.point.frame.phase] *= 2.0
    new = _branch(doubled, plan)
    point = _first_away(new, special, u, _doubling_direction(problem, special.point))
    return [] if point is None else [_place(new, point, new.steps.now, new=True)]


def _through(branch: Branch, ahead: Point, back: Point) -> list[Record]:
    """Describe a branch that goes through a branch point, from a point on one side of it: both ways from there."""
    forth = Point(back.frame, back.found, -back.tangent, back.multipliers, back.value)
    return [
        _place(branch, forth, float(np.linalg.norm(ahead.u - back.u)), new=True),
        _place(branch, back, branch.steps.now, new=False),
    ]


def _first_away(branch: Branch, origin: Special, u: FloatArray, direction: FloatArray) -> Point | None:
    """Find a point of a branch that leaves another one in a direction; None if it cannot be found."""
    for share in AWAY:
        step = share * branch.steps.largest
        try:
            found = correct(branch.problem, origin.point.frame, u + step * direction, direction[np.newaxis], most=20)
            point = branch.point(origin.point.frame, found, direction)
        except MissedError:
            continue
        way = point.u - u
        apart = abs(way @ direction) > LEFT * abs(way @ origin.direction)
        if not branch.problem.halves(point.frame, point.u) if origin.kind == DOUBLING else apart:
            return point
    return None


def _doubling_direction(problem: Problem, point: Point) -> FloatArray:
    """Direction of the branch of twice the period: the eigenvector of the multiplier −1."""
    values, vectors = np.linalg.eig(problem.section_map(point.frame, point.shot))
    vector = vectors[:, np.argmin(np.abs(values + 1.0))].real
    direction = np.append(np.insert(vector, point.frame.phase, 0.0), 0.0)
    return np.asarray(direction / np.linalg.norm(direction))


def _mirrors(branch: Branch, one: Point, other: Point) -> bool:
    """Whether two orbits are mirror images of each other."""
    rows = [row_of_point(branch, point, branch.problem.shooter, count=False) for point in (one, other)]
    return all(abs(rows[0][n] - rows[1][n]) <= 1e-3 * abs(rows[0][n]) for n in ("value", *MEASURES))


def _special_record(branch: Branch, special: Special, after: int) -> Record:
    state, seconds, _ = branch.problem.unpack(special.point.frame, special.point.u)
    frequency = abs(branch.problem.turns[0]) / seconds
    return {
        "kind": special.kind,
        "value": special.value,
        "excitation_frequency_hz": frequency,
        "period": abs(branch.problem.turns[0]),
        "period_s": seconds,
        "turns": list(branch.problem.turns),
        "word": special.point.word,
        "state": state.tolist(),
        "after": after,
    }


def row_of_point(branch: Branch, point: Point, shooter: Shooter, *, count: bool = True) -> Record:
    """Return the row of a point in the table of branches; ``turns`` are those since the point before, if they count."""
    problem = branch.problem
    state, seconds, values = problem.unpack(point.frame, point.u)
    scene = shooter.scene_at(dict(zip(shooter.keys, values, strict=True)))
    turns = shooter.turns
    if count:
        shooter.turns = 0.0
    return {
        "value": float(f"{values[0]:.15g}"),  # without what units leave of a round number
        "period": abs(problem.turns[0]),
        "period_s": seconds,
        **measures_of_orbit(scene, point.shot, problem.turns),
        "sequence": spelled(point.word),
        "stable": point.unstable == 0,
        "unstable": point.unstable,
        **told(point.multipliers, TOLD),
        "residual": point.found.residuals[-1],
        "turns": turns,
        "state": state.tolist(),
    }
