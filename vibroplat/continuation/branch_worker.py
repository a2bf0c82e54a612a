"""A part of a branch, as a worker makes it: points, special points, and first points of branches that begin there."""

from __future__ import annotations

from contextlib import closing, suppress

import numpy as np

from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.branch import Branch, Steps
from vibroplat.continuation.event_sequence import spelled
from vibroplat.continuation.kinds import BRANCH_POINT, DOUBLING
from vibroplat.continuation.loop_detection import MEASURES, RETURNED, Known, same_special
from vibroplat.continuation.newton import ANGLE, Frame, MissedError, Problem, correct
from vibroplat.continuation.orbit import OrbitError, first_orbit, measures_of_orbit, told
from vibroplat.continuation.point import Point
from vibroplat.continuation.shooting import Shooter
from vibroplat.continuation.special import Special, specials
from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.store import Record

#: Points of a branch that a task makes.
PART = 100
#: Largest multipliers that are told.
TOLD = 4
#: First steps along a new branch, over the largest step, one after the other.
AWAY = (0.5, 1.0, 0.2, 0.05)
#: Least part of the way along a branch that must be covered across it by a point that has left it.
LEFT = 0.3


def part(scene: Scene, plan: OrbitsPlan, begin: Record | None, known: Known) -> Record:
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
