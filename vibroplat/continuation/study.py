"""The study ``orbits`` of a scene: branches of periodic orbits, and boundaries of special points in two keys."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Unpack

import pandas as pd

from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.answer import answer_of
from vibroplat.continuation.branch_tasks import (
    ComputedBranch,
    GridCell,
    find_orbit_again,
    follow_family,
    same_special,
)
from vibroplat.continuation.codim2 import ComputedBoundary, follow_boundary
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.orbit import with_initial_state, with_orbit_tolerance
from vibroplat.continuation.tables import TABLES, make_tables, summarize
from vibroplat.errors import ConfigError, errors_about
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.motion.initial_condition import end_of
from vibroplat.results.result import Result
from vibroplat.study.branches import column_of
from vibroplat.study.pool import Pool, StoredChain, Task, run_stored
from vibroplat.study.store import Record, Store
from vibroplat.study.study import COMPARED, CrossCheckCase, Options, Progress, Study, choose_evenly, run_study


class OrbitsStudy(Study):
    """Branches of periodic orbits, and boundaries, of a section ``orbits``.

    Attributes
    ----------
    plan
        The section, which has been validated.
    families
        The combinations of the grid's values, the last key fastest.

    Raises
    ------
    ConfigError
        The section cannot be followed, or ``from`` names no finished run that the scene can continue from.
    """

    kind = "orbits"
    described = TABLES
    counted = "branches"

    def __init__(self, scene: Scene) -> None:
        scene.require_orbits("a branch of orbits")
        self.scene, self.plan = scene, _required_plan(scene)
        self.families: list[GridCell] = []
        for combination in itertools.product(*self.plan.grid.values()):
            values = dict(zip(self.plan.grid, combination, strict=True))
            with errors_about("orbits.grid"):
                placed = scene.replace(values | {self.plan.key: float(self.plan.start)})
                parameter_direction(placed, self.plan.key)
            if self.plan.from_ not in ("settled", "state"):
                placed = _scene_at_end(placed, self.plan.from_)
            _require_inside(placed, self.plan)
            self.families.append(
                GridCell(len(self.families), values, with_orbit_tolerance(placed, self.plan.tolerance))
            )

    def scenes(self) -> list[Scene]:
        """Return the scenes of the first branches."""
        return [family.scene for family in self.families]

    def chains(self, store: Store) -> int:
        """Return how many combinations of the grid's values there are."""
        return len(self.families)

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Follow branches and boundaries.

        Raises
        ------
        OrbitError
            There is no orbit to begin with, for any combination of the grid's values; the store is finished then.
        """
        traced = self.trace(store, workers, progress)
        curves = self.follow_boundaries(traced, store, workers)
        tables, summary = make_tables(self.plan, traced, curves), summarize(self.plan, traced, curves)
        rotation = "" if any("rotation" in key for key in self.plan.grid) else self.scene.rotation
        answer = answer_of(self.plan, tables, summary, rotation)
        return Result("orbits", self.scene, tables, answer, documents={"orbits": summary})

    def trace(self, store: Store, workers: Pool, progress: Progress = lambda done, known: None) -> list[ComputedBranch]:
        """Follow the branches; see :meth:`run`."""
        traced: list[ComputedBranch] = []

        def count() -> None:
            progress(sum(bool(b.ended) for b in traced), len(traced))

        chains = ((follow_family(family, self.plan, traced, count), str(family.number)) for family in self.families)
        run_stored([StoredChain(chain, store, name) for chain, name in chains], workers)
        if all(branch.failed and not branch.rows for branch in traced):
            store.finish()  # nothing is left to resume
            raise OrbitError(traced[0].ended)
        return sorted(traced, key=lambda branch: (branch.family.number, branch.number))

    def follow_boundaries(
        self, traced: Sequence[ComputedBranch], store: Store, workers: Pool
    ) -> list[ComputedBoundary]:
        """Follow the boundaries, which begin at the special points of branches."""
        plan, curves, chains = self.plan, list[ComputedBoundary](), list[StoredChain[None]]()
        if plan.boundaries is None:
            return curves
        passed: list[tuple[GridCell, Record]] = []
        for branch, special in ((b, s) for b in traced for s in b.special):
            family, kind = branch.family, special["kind"]
            new = not any(of is family and same_special(special, other, plan) for of, other in passed)
            if new and (plan.boundaries.kinds is None or kind in plan.boundaries.kinds):
                boundary = ComputedBoundary(family.grid, branch.number, kind)
                curves.append(boundary)
                name = f"boundary-{family.number}-{branch.number}-{branch.special.index(special)}"
                chains.append(StoredChain(follow_boundary(family.scene, plan, special, boundary), store, name))
            passed.append((family, special))
        run_stored(chains, workers)
        return curves

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose points of branches, as far from each other as they can be; their orbits are found anew."""
        cases = []
        for index in choose_evenly(range(len(result.branches))):
            (whole,) = result.branches.iloc[[index]].to_dict("records")
            row: Record = {str(name): value for name, value in whole.items() if pd.notna(value)}
            task = Task(find_orbit_again, (other(self.scene), row, self.plan.tolerance))
            swept = ", ".join(f"{key} = {row[key]}" for key in map(column_of, (*self.plan.grid, self.plan.key)))
            known = {name: row.get(name) for name in COMPARED if name != "motion"}
            cases.append(CrossCheckCase(f"at {swept}, branch {row['branch']}, point {row['point']}", task, known))
        return cases


STUDY = OrbitsStudy


def orbits(scene: Scene, **options: Unpack[Options]) -> Result:
    """Continue branches of periodic orbits of a scene over a key.

    The section ``orbits`` of the scene has the key and its range. Branches are continued by pseudo-arclength; special
    points are located on them, new branches start at branch points. With ``orbits.boundaries``, special points are
    continued in a second key.

    Parameters
    ----------
    scene
        Scene with a section ``orbits``.
    options
        As in :func:`vibroplat.sweep`; ``progress`` is called with the numbers of finished and of known branches.

    Returns
    -------
    Result
        Table ``branches`` has one row per point of each branch, in order. Table ``special`` has one row per special
        point. With ``orbits.boundaries``, table ``boundaries`` has one row per point of the curves in two keys.

    Raises
    ------
    ConfigError
        The scene has no section ``orbits``, a value of it is not allowed, or the scheduler does not answer.
    OrbitError
        No first orbit was found.

    Examples
    --------
    >>> from vibroplat import Scene, orbits
    >>> plan = {"key": "drive.supply_frequency_hz", "start": 42.0, "stop": 44.0}
    >>> orbits(Scene().replace({"orbits": plan})).branches["stable"].all()
    np.True_
    """
    return run_study(OrbitsStudy, scene, **options)


def _required_plan(scene: Scene) -> OrbitsPlan:
    """Return the plan of a scene, if its keys vary continuously; see :class:`OrbitsStudy`."""
    plan: OrbitsPlan = scene.plan_of("orbits")
    with_orbit_tolerance(scene, plan.tolerance)  # has no program
    if plan.from_ == "state" and scene.run.initial.state is None:
        raise ConfigError("orbits.from = state but run.initial.state is not given; allowed: give it, or settled")
    if plan.boundaries is not None and plan.boundaries.key in plan.grid:
        raise ConfigError(f"orbits.grid.{plan.boundaries.key} is the key of boundaries; allowed: another key")
    for section, of in (("orbits", plan), ("orbits.boundaries", plan.boundaries)):
        if of is not None:
            for value in (of.start, of.stop):
                _require_continuous(scene, f"{section}.key", of.key, value)
    return plan


def _require_continuous(scene: Scene, section: str, key: str, value: float) -> None:
    """Refuse a key that does not vary continuously, or has no such value."""
    own = value_of(scene, key)
    if own is not None and not isinstance(own, float):
        raise ConfigError(f"{section} = {key} does not vary continuously; allowed: a key that does")
    with errors_about(section):
        parameter_direction(scene.replace({key: float(value)}), key)


def _scene_at_end(scene: Scene, directory: str) -> Scene:
    """Return the scene at the end of a run, so that workers need not read it."""
    try:
        state = end_of(Path(directory), scene).state
    except ConfigError as error:
        text = str(error).replace("run.initial.from", "orbits.from", 1)
        raise ConfigError(text.replace("; allowed: ", "; allowed: settled, state, or ", 1)) from None
    return with_initial_state(scene, state)


def _require_inside(scene: Scene, plan: OrbitsPlan) -> None:
    """Refuse a range of the second key that does not hold the scene's value, where the curves begin."""
    second = plan.boundaries
    if second is None:
        return
    value = value_of(scene, second.key)
    if not min(second.start, second.stop) <= value <= max(second.start, second.stop):
        raise ConfigError(
            f"orbits.boundaries: {second.key} = {value:g} in this scene, where the curves begin; "
            f"allowed: start and stop on both sides of it, not {second.start:g} and {second.stop:g}"
        )
