"""Branches as chains of tasks: each task makes a part of a branch, and the next one goes on from its last point.

A branch that is found at a special point becomes a chain of its own, after those that are known have ended.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.branch_worker import part
from vibroplat.continuation.loop_detection import Known, compared, same_special, seen
from vibroplat.continuation.orbit import OrbitError, accurate, beginning_at
from vibroplat.errors import ConfigError
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.motion.initial_condition import end_of
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store


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


def trace(scene: Scene, records: Store, workers: Pool, progress: Progress | None = None) -> list[Traced]:
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


def _parts(
    branch: Traced,
    others: Sequence[Traced],
    switched: Sequence[Record],
    plan: OrbitsPlan,
    begin: Record | None,
    take: Callable[[Record], None],
) -> Tasks[None]:
    """Make a branch part by part."""
    passed = [(other.number, [compared(row) for row in other.rows]) for other in others]
    while not branch.ended:
        special = [seen(s) for s in [*switched, *branch.special] if s["branches"]]
        known = Known(special, passed, [compared(row) for row in branch.rows])
        record = yield Task(part, (branch.family.scene, plan, begin, known), _lost)
        branch.ended, branch.failed = record["ended"], record["failed"]
        branch.special += [special | {"after": special["after"] + len(branch.rows)} for special in record["special"]]
        branch.rows += record["rows"]
        if not branch.ended and len(branch.rows) >= plan.max_points:
            branch.ended = f"max_points = {plan.max_points} reached"
        begin = record["last"]
        take(record)


def _lost(reason: str) -> Record:
    return {"rows": [], "special": [], "last": None, "ended": reason, "failed": True}
