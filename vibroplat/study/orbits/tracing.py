"""Branches as chains of tasks: each task makes a part of a branch, and the next one goes on from its last point.

A branch that is found at a special point becomes a chain of its own, after those that are known have ended.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import parameter_direction
from vibroplat.orbits_plan import OrbitsPlan
from vibroplat.scene import Scene
from vibroplat.study.execution import Pool, run_chains
from vibroplat.study.orbits.branch import Branch, Point, Steps
from vibroplat.study.orbits.newton import ANGLE, Frame, MissedError, Problem, correct
from vibroplat.study.orbits.orbit import OrbitError, accurate, first_orbit, measures_of_orbit
from vibroplat.study.orbits.shooting import Shooter
from vibroplat.study.orbits.special import BRANCH_POINT, DOUBLING, Special, specials
from vibroplat.study.orbits.words import spelled
from vibroplat.study.store import Record, Records
from vibroplat.study.tasks import StoredChain, Task, Tasks

#: Points of a branch that a task makes.
PART = 20
#: Largest multipliers that are told.
TOLD = 4
#: Steps along a new branch at a branch point, over the largest step, one after the other.
AWAY = (0.02, 0.05, 0.1)
#: How far apart, as a part of the step between its neighbours, a point may lie from a former one to be the same.
SAME = 0.1
#: Measures that tell points apart.
COMPARED = ("period_s", "rms_x_m", "rms_y_m", "rms_phi_rad", "motor_power_w")


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
        found.append(Family(len(found), values, accurate(placed, plan.tolerance)))
    return found


@dataclass
class Traced:
    """A branch that has been followed.

    Attributes
    ----------
    family, number, parent
        Its combination of the grid's values, its number there, and that of the branch it was found on, or −1.
    origin
        What it begins with: ``start``, or the kind of special point.
    rows, special, seeds
        Its points, special points and the beginnings of other branches there, as plain values.
    ended
        Why it ended.
    failed
        Whether that is a failure.
    """

    family: Family
    number: int
    parent: int
    origin: str
    rows: list[Record] = field(default_factory=list)
    special: list[Record] = field(default_factory=list)
    seeds: list[Record] = field(default_factory=list)
    ended: str = ""
    failed: bool = False


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
    points = finished = 0
    known = [Traced(family, 0, -1, "start") for family in families(scene)]
    seeds: list[Record | None] = [None] * len(known)
    while known:

        def count(record: Record) -> None:
            nonlocal points
            points += len(record["rows"])

        chains = [
            StoredChain(_parts(branch, plan, seed, count), records, f"{branch.family.number}-{branch.number}")
            for branch, seed in zip(known, seeds, strict=True)
        ]
        for chain in run_chains(chains, workers):
            finished += chain.done
            if progress is not None:
                progress(finished, len(traced) + len(known), points)
        traced += known
        if len(traced) == len(known) and all(branch.failed and not branch.rows for branch in known):
            raise OrbitError(known[0].ended)
        known, seeds = _new_branches(plan, traced, known)
    return sorted(traced, key=lambda branch: (branch.family.number, branch.number))


def _new_branches(
    plan: OrbitsPlan, traced: Sequence[Traced], last: Sequence[Traced]
) -> tuple[list[Traced], list[Record | None]]:
    """Collect branches that begin at special points of the last ones, each once."""
    found: list[Traced] = []
    seeds: list[Record | None] = []
    for branch in last:
        for seed in branch.seeds:
            others = [b for b in (*traced, *found) if b.family.number == branch.family.number]
            if len(others) >= plan.max_branches:
                break
            found.append(Traced(branch.family, len(others), branch.number, seed["kind"]))
            seeds.append(seed)
    return found, seeds


def _parts(branch: Traced, plan: OrbitsPlan, seed: Record | None, take: Callable[[Record], None]) -> Tasks[None]:
    """Make a branch part by part."""
    begin = seed
    while True:
        record = yield Task(_part, (branch.family.scene, plan, begin), _lost)
        again = _met_again(branch.rows, record["rows"])
        rows = record["rows"] if again is None else record["rows"][: again[0]]
        take(record | {"rows": rows})
        branch.rows += rows
        branch.ended, branch.failed = record["ended"], record["failed"]
        if again is not None:
            branch.ended, branch.failed = again[1], False
        reached = len(branch.rows)
        branch.special += [s for s in record["special"] if s["after"] + reached - len(rows) < reached + 1]
        branch.seeds += record["seeds"]
        if not branch.ended and len(branch.rows) >= plan.max_points:
            branch.ended = f"max_points = {plan.max_points} reached"
        if branch.ended:
            return
        begin = record["last"]


def _lost(reason: str) -> Record:
    return {"rows": [], "special": [], "seeds": [], "last": None, "ended": reason, "failed": True}


def _met_again(former: Sequence[Record], new: Sequence[Record]) -> tuple[int, str] | None:
    """Find the first new point that a branch has passed before, itself or in a mirror: its place, and which."""
    for place, row in enumerate(new):
        before = [*former, *new[:place]][:-2]
        for first, second in itertools.pairwise(before):
            if not min(first["value"], second["value"]) <= row["value"] <= max(first["value"], second["value"]):
                continue
            share = (row["value"] - first["value"]) / (second["value"] - first["value"] or 1.0)
            if not all(_near(row[name], first[name], second[name], share) for name in COMPARED):
                continue
            here, there = row["phase_difference_rad"], first["phase_difference_rad"]
            apart = abs(np.angle(np.exp(1j * (here - there))))
            return place, "loop" if apart <= abs(np.angle(np.exp(1j * (here + there)))) + 1e-6 else "mirror image"
    return None


def _near(value: float, first: float, second: float, share: float) -> bool:
    expected = first + share * (second - first)
    return abs(value - expected) <= SAME * abs(second - first) + 1e-7 * abs(expected) + 1e-12


# -- what a worker does ------------------------------------------------------------------------------------------------


def _part(scene: Scene, plan: OrbitsPlan, begin: Record | None) -> Record:
    """Make a part of a branch: from a start, from a special point, or going on from a last point."""
    record: Record = {"rows": [], "special": [], "seeds": [], "last": None, "ended": "", "failed": False}
    with closing(Shooter(scene, [plan.key])) as shooter:
        try:
            branch = _first(shooter, plan) if begin is None else _again(shooter, plan, begin)
        except (MissedError, OrbitError) as error:
            return record | {"ended": str(error), "failed": True}
        new = begin is None or "kind" in begin
        if new:
            record["rows"].append(row_of_point(branch, branch.points[0], shooter))

        def look(before: Point, after: Point) -> None:
            for special in specials(branch, before, after):
                record["special"].append(_special_record(branch, special, len(record["rows"])))
                record["seeds"] += _seeds(branch, special, plan)

        while len(record["rows"]) < PART and not branch.ended:
            if not branch.grow(look):
                record["failed"] = True
                break
            _stop_at_end(branch, plan)
            record["rows"].append(row_of_point(branch, branch.points[-1], shooter))
        record["ended"] = branch.ended
        record["last"] = _last(branch)
    return record


def _branch(problem: Problem, plan: OrbitsPlan) -> Branch:
    """Begin a branch without points."""
    first, largest, least = plan.step.lengths(abs(plan.stop - plan.start))
    return Branch(problem, Steps(first / plan.unit, least / plan.unit, largest / plan.unit))


def _first(shooter: Shooter, plan: OrbitsPlan) -> Branch:
    """Find the first orbit of the first branch, towards the stop."""
    guess: Any = {"settled": None, "state": shooter.scene.run.initial.state}.get(plan.from_, plan.from_)
    shooter.set({plan.key: float(plan.start)})
    if plan.from_ == "state":
        guess = {k: v for k, v in shooter.scene.run.initial.state.model_dump().items() if v is not None}  # type: ignore[union-attr]
    problem, frame, found = first_orbit(shooter, guess, plan.period, [plan.unit], plan.tolerance)
    branch = _branch(problem, plan)
    towards = np.zeros(found.u.size)
    towards[-1] = np.sign(plan.stop - plan.start)
    branch.points.append(branch.in_middle(branch.point(frame, found, towards)))
    return branch


def _again(shooter: Shooter, plan: OrbitsPlan, begin: Record) -> Branch:
    """Begin, or go on with, a branch at a state near it and a direction."""
    state = np.array(begin["state"])
    shooter.set({plan.key: begin["value"]})
    problem = Problem(shooter, tuple(begin["turns"]), [plan.unit], plan.tolerance)
    branch = _branch(problem, plan)
    frame = Frame(state, shooter.shot(state, 0.0).begins)
    tangent = np.array(begin["tangent"])
    packed = np.append(tangent[frame.places], tangent[-1])
    packed[frame.phase] = tangent[-2]
    packed /= np.linalg.norm(packed)
    u = problem.pack(frame, state, begin["period_s"], [begin["value"]])
    if "kind" not in begin:
        branch.steps.now = begin["step"]
        branch.begin(frame, u, packed)
        return branch
    why: MissedError | None = None
    for share in AWAY:
        try:
            branch.begin(frame, u + share * branch.steps.largest * packed, packed)
        except MissedError as error:
            why = error
            continue
        if begin["kind"] == BRANCH_POINT or _is_double(branch):
            return branch
        branch.points.clear()
        why = MissedError("the branch of twice the period was not found")
    assert why is not None
    raise why


def _is_double(branch: Branch) -> bool:
    """Whether the first orbit of a branch does not repeat after half of its period."""
    point, problem = branch.points[0], branch.problem
    state, seconds, _ = problem.unpack(point.frame, point.u)
    shot = problem.shooter.shot(state, 0.5 * seconds)
    difference = shot.state - state - np.pi * np.concatenate([[0, 0, 0], problem.turns, np.zeros(9)])
    return bool(np.abs(difference / problem.shooter.scales).max() > 1e3 * problem.tolerance)


def _last(branch: Branch) -> Record:
    """Describe the last point of a branch so that another worker can go on from there."""
    point = branch.points[-1]
    return _place(branch, point, _full_tangent(branch.problem, point.frame, point.tangent)) | {"step": branch.steps.now}


def _place(branch: Branch, point: Point, tangent: FloatArray) -> Record:
    state, seconds, values = branch.problem.unpack(point.frame, point.u)
    return {
        "turns": list(branch.problem.turns),
        "state": state.tolist(),
        "period_s": seconds,
        "value": values[0],
        "tangent": tangent.tolist(),
    }


def _full_tangent(problem: Problem, frame: Frame, tangent: FloatArray) -> FloatArray:
    """Write a direction of unknowns as one of the full state, then the period, then the key."""
    full = np.zeros(problem.shooter.scales.size + 2)
    full[frame.places] = tangent[: frame.places.size]
    full[ANGLE], full[-2], full[-1] = 0.0, tangent[frame.phase], tangent[-1]
    return full


def _stop_at_end(branch: Branch, plan: OrbitsPlan) -> None:
    """End a branch that has left the range of the key with a point at the end of it."""
    low, high = plan.range
    last, before = branch.points[-1], branch.points[-2]
    if low <= last.value <= high:
        return
    end = low if last.value < low else high
    branch.ended = "start of the key's range" if end == plan.start else "stop of the key's range"
    if last.frame is before.frame:
        share = (end - before.value) / (last.value - before.value)
        u = before.u + share * (last.u - before.u)
        u[-1] = end / branch.problem.units[0]
        border = np.zeros((1, u.size))
        border[0, -1] = 1.0
        try:
            found = correct(branch.problem, last.frame, u, border, last.found.jacobian)
        except MissedError:
            return
        branch.points[-1] = branch.point(last.frame, found, last.tangent)


def _seeds(branch: Branch, special: Special, plan: OrbitsPlan) -> list[Record]:
    """Describe the branches that begin at a special point and are to be followed."""
    if special.kind not in plan.switch:
        return []
    if special.kind == BRANCH_POINT:
        return _crossing_branches(branch, special)
    return _doubled_branches(branch, special) if special.kind == DOUBLING else []


def _crossing_branches(branch: Branch, special: Special) -> list[Record]:
    """Describe both directions of the branch that crosses: along the other null vector of the Jacobian."""
    point = special.point
    null = np.linalg.svd(point.found.jacobian)[2][-2:]
    along = null @ point.tangent
    across = null.T @ np.array([-along[1], along[0]])
    across /= np.linalg.norm(across)
    return [
        _place(branch, point, sign * _full_tangent(branch.problem, point.frame, across)) | {"kind": special.kind}
        for sign in (1.0, -1.0)
    ]


def _doubled_branches(branch: Branch, special: Special) -> list[Record]:
    """Describe the branch of twice the period: along the eigenvector of the multiplier −1."""
    point, problem = special.point, branch.problem
    values, vectors = np.linalg.eig(problem.section_map(point.frame, point.shot))
    vector = vectors[:, np.argmin(np.abs(values + 1.0))].real
    tangent = np.insert(vector / np.linalg.norm(vector), point.frame.phase, 0.0)
    place = _place(branch, point, _full_tangent(problem, point.frame, np.append(tangent, 0.0)))
    doubled = {"turns": [2 * n for n in problem.turns], "period_s": 2.0 * place["period_s"]}
    return [place | doubled | {"kind": special.kind}]


def _special_record(branch: Branch, special: Special, after: int) -> Record:
    state, seconds, _ = branch.problem.unpack(special.point.frame, special.point.u)
    frequency = abs(branch.problem.turns[0]) / seconds
    return {
        "kind": special.kind,
        "value": special.value,
        "excitation_frequency_hz": frequency,
        "period": abs(branch.problem.turns[0]),
        "state": state.tolist(),
        "after": after,
    }


def row_of_point(branch: Branch, point: Point, shooter: Shooter) -> Record:
    """Return the row of a point in the table of branches; ``turns`` are those since the point before."""
    problem = branch.problem
    state, seconds, values = problem.unpack(point.frame, point.u)
    scene = shooter.scene_at(dict(zip(shooter.keys, values, strict=True)))
    turns, shooter.turns = shooter.turns, 0.0
    multipliers: dict[str, float | None] = {}
    for i in range(TOLD):
        known = i < point.multipliers.size
        multipliers[f"multiplier_{i + 1}_re"] = float(point.multipliers[i].real) if known else None
        multipliers[f"multiplier_{i + 1}_im"] = float(point.multipliers[i].imag) if known else None
    return {
        "value": values[0],
        "period": abs(problem.turns[0]),
        "period_s": seconds,
        **measures_of_orbit(scene, point.shot, problem.turns),
        "sequence": spelled(point.word),
        "stable": point.unstable == 0,
        "unstable": point.unstable,
        **multipliers,
        "residual": point.found.residuals[-1],
        "turns": turns,
        "state": state.tolist(),
    }


def traced_rows(traced: Sequence[Traced]) -> Iterator[tuple[Traced, Record]]:
    """Yield all points with their branches."""
    for branch in traced:
        for row in branch.rows:
            yield branch, row
