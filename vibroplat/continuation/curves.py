"""Boundaries over two keys as tasks: each special point of the branches begins a curve, followed both ways."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroplat.config.plans import BoundariesPlan, OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.boundaries import Curve, Spot, follow
from vibroplat.continuation.boundary_validation import FAILED, across, check, chosen, others_outside
from vibroplat.continuation.crossings import Window, follow_crossings
from vibroplat.continuation.event_sequence import whole
from vibroplat.continuation.kinds import BRANCH_POINT
from vibroplat.continuation.loop_detection import same_special
from vibroplat.continuation.newton import Frame, MissedError, Problem
from vibroplat.continuation.shooting import Shooter
from vibroplat.continuation.tracing import Family, Progress, Traced, orbits_plan
from vibroplat.errors import ConfigError
from vibroplat.model.sensitivity import value_of
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store


@dataclass
class Boundary:
    """A boundary that has been followed.

    Attributes
    ----------
    family, branch
        Combination of the grid's values, and branch on which its special point lies.
    kind
        Of special points.
    rows
        Its points as plain values, in the order of the curve.
    ended
        Why it ended, at both ends.
    """

    family: Family
    branch: int
    kind: str
    rows: list[Record] = field(default_factory=list)
    ended: list[str] = field(default_factory=list)


def boundaries(
    scene: Scene, traced: Sequence[Traced], records: Store, workers: Pool, progress: Progress | None = None
) -> list[Boundary]:
    """Follow the boundaries that begin at the special points of branches; those that are stored are not repeated.

    Raises
    ------
    ConfigError
        The scene's value of the second key lies outside the range in which boundaries are wanted.
    """
    plan = orbits_plan(scene)
    if plan.boundaries is None:
        return []
    found: list[Boundary] = []
    chains: list[StoredChain[None]] = []
    for branch in traced:
        require_inside(branch.family.scene, plan.boundaries)
        for place, special in enumerate(branch.special):
            wanted = plan.boundaries.kinds is None or special["kind"] in plan.boundaries.kinds
            if not wanted or _known(special, branch, traced, place, plan):
                continue
            boundary = Boundary(branch.family, branch.number, special["kind"])
            found.append(boundary)
            name = f"boundary-{branch.family.number}-{branch.number}-{place}"
            chains.append(StoredChain(_both_ways(boundary, plan, special), records, name))
    run_stored(chains, workers)
    if progress is not None:
        progress(len(found), len(found), sum(len(b.rows) for b in found))
    return found


def require_inside(scene: Scene, plan: BoundariesPlan) -> None:
    """Refuse a range of the second key that does not hold the scene's value, where the curves begin."""
    value = value_of(scene, plan.key)
    if not min(plan.start, plan.stop) <= value <= max(plan.start, plan.stop):
        raise ConfigError(
            f"orbits.boundaries: {plan.key} = {value:g} in this scene, where the curves begin; "
            f"allowed: start and stop on both sides of it, not {plan.start:g} and {plan.stop:g}"
        )


def _known(special: Record, branch: Traced, traced: Sequence[Traced], place: int, plan: OrbitsPlan) -> bool:
    """Whether another branch has found the same special point before."""
    before = [s for b in traced if b.family is branch.family and b.number < branch.number for s in b.special]
    return any(same_special(special, other, plan) for other in [*before, *branch.special[:place]])


def _both_ways(boundary: Boundary, plan: OrbitsPlan, special: Record) -> Tasks[None]:
    """Follow a boundary both ways from a special point, then check it."""
    for sense in (-1, 1):
        record = yield Task(_one_way, (boundary.family.scene, plan, special, sense), _lost)
        rows = record["rows"]
        boundary.rows = [*reversed(rows), *boundary.rows] if sense < 0 else [*boundary.rows, *rows[1:]]
        boundary.ended.append(record["ended"])
    for place in chosen(boundary.rows, plan):
        row, way = boundary.rows[place], across(boundary.rows, place, plan)
        found = yield Task(check, (boundary.family.scene, plan, boundary.kind, row, way), _unchecked)
        boundary.rows[place] = row | found


def _lost(reason: str) -> Record:
    return {"rows": [], "ended": reason}


def _unchecked(reason: str) -> Record:
    return {"check": FAILED}


def _one_way(scene: Scene, plan: OrbitsPlan, special: Record, sense: int) -> Record:
    """Follow a boundary from a special point in one sense of the second key."""
    wanted = plan.boundaries
    assert wanted is not None
    unit = wanted.unit
    first, largest, least = wanted.step.lengths(abs(wanted.stop - wanted.start))
    record: Record = {"rows": [], "ended": ""}
    with closing(Shooter(scene, [plan.key, wanted.key])) as shooter:
        state, values = np.array(special["state"]), [special["value"], value_of(scene, wanted.key)]
        shooter.set({plan.key: values[0], wanted.key: values[1]})
        problem = Problem(shooter, tuple(special["turns"]), [plan.unit, unit], plan.tolerance)
        frame = Frame(state, shooter.shot(state, 0.0).begins)
        u = problem.pack(frame, state, special["period_s"], values)

        low, high = min(wanted.start, wanted.stop), max(wanted.start, wanted.stop)
        units = np.array([plan.unit, unit])
        window = Window(np.array([plan.range[0], low]) / units, np.array([plan.range[1], high]) / units)
        spots: Iterator[Spot]
        if special["kind"] == BRANCH_POINT:
            steps = first / unit, largest / unit, least / unit
            crossings = follow_crossings(problem, frame, u, sense, steps, window)
            spots = (Spot(f, found, problem.multipliers(f, found.shot)) for f, found in crossings)
        else:
            curve = Curve(problem, special["kind"], special["word"], largest / unit, least / unit)
            spots = follow(curve, frame, u, sense, first / unit, window)
        try:
            for spot in spots:
                record["rows"].append(_row(problem, spot, special["kind"]))
                if len(record["rows"]) >= wanted.max_points:
                    return record | {"ended": f"max_points = {wanted.max_points} reached"}
        except MissedError as error:
            return record | {"ended": f"no point beyond: {error}"}
    return record | {"ended": "end of a key's range"}


def _row(problem: Problem, spot: Spot, kind: str) -> dict[str, Any]:
    state, seconds, values = problem.unpack(spot.frame, spot.found.u)
    return {
        "value": values[0],
        "second": values[1],
        "excitation_frequency_hz": abs(problem.turns[0]) / seconds,
        "period": abs(problem.turns[0]),
        "period_s": seconds,
        "turns": list(problem.turns),
        "word": whole(spot.word, float(problem.shooter.p["restitution"])),
        "state": state.tolist(),
        "others_outside": others_outside(kind, spot.multipliers),
    }
