"""The study ``basins``: attractors of a scene, their basin fractions, and the attractor of each initial condition.

Starts are followed in blocks of fixed size: one, then two side by side, then four, and so on. Each knows the attractors
that the rounds before have found, and what it finds besides is compared in the order of blocks, so that nothing depends
on who is first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import compress
from typing import Any, Unpack

import numpy as np

from vibroplat.basin.answer import TRANSIENT_MOTIONS, answer_of
from vibroplat.basin.attractors import AttractorSet, continue_attractors, name_attractors
from vibroplat.basin.fractions import clopper_pearson
from vibroplat.basin.initial_conditions import key_values, validated_base_scene
from vibroplat.basin.mapper import classify_unconverged, map_alone, map_initial_conditions, repeats
from vibroplat.columns import COUNT, PHASE_COLUMN, TEXT, Column, Columns
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import BasinsPlan
from vibroplat.continuation.orbit import with_orbit_tolerance
from vibroplat.errors import errors_about
from vibroplat.kernels.target import lanes
from vibroplat.report.data_sheet import SHEET, more_columns, point_columns
from vibroplat.results.result import Result
from vibroplat.study.branches import column_of, study_table
from vibroplat.study.point import ERRORS, MEASURED
from vibroplat.study.pool import Pool, Task, run_tasks
from vibroplat.study.store import Record, Store
from vibroplat.study.study import COMPARED, CrossCheckCase, Options, Progress, Study, choose_evenly, run_study
from vibroplat.study.sweep import SWEEP

#: Number of initial conditions in a task.
BLOCK = 100
#: Maximum number of motions of a group that are continued until one of them can be classified.
MAX_FOLLOWED = 3
#: Part of the turns after which an arrival counts as late: of a chaotic transient, perhaps.
LATE_FRACTION = 0.25
#: Columns of the tables after the key that varies.
ATTRACTORS: Columns = {
    "attractor": Column(
        "name of the attractor", "synchronization, motion and period; further words if these are ambiguous", kind=TEXT
    ),
    "motion": SWEEP["motion"],
    "period": SWEEP["period"],
    "sync": SWEEP["sync"],
    "count": Column("number of initial conditions that converge to the attractor", kind=COUNT),
    "fraction": Column("fraction of the initial conditions that converge to the attractor within within_turns"),
    "fraction_low": Column(
        "lower bound of the basin fraction in the box of initial conditions", "95 %, Clopper and Pearson (1934)"
    ),
    "fraction_high": Column(
        "upper bound of the basin fraction", "see fraction_low; 3/N if none of N initial conditions converges to it"
    ),
    "within_turns": Column("maximum number of turns of exciter 1 for each initial condition", kind=COUNT),
    "multiplier_max": SWEEP["multiplier_max"],
    "radius": Column(
        "radius of the smallest attraction ellipsoid of the orbit",
        "distance in left eigenvectors of the return map (scaled units); 0: no ellipsoid, each initial condition "
        "is settled",
    ),
    "ellipsoids": Column("crossings of the Poincaré section per period that have an attraction ellipsoid", kind=COUNT),
    **{name: SWEEP[name] for name in MEASURED},
    **{name: SWEEP[name] for name in (*ERRORS.values(), "outcome", "detail", "notes")},
    **{name: Column(f"{name} of a state of the attractor on the Poincaré section") for name in (*COORDINATES, *RATES)},
    **SHEET,
}
STARTS_TABLE: Columns = {
    "attractor": ATTRACTORS["attractor"],
    "turns": Column("turns of exciter 1 until the initial condition was assigned to an attractor"),
}

_OVER: Columns = {"…": Column("value of the key of basins.over, by dotted name")}
#: The tables of basins: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "attractors": (
        "`vibroplat basins`: one row per attractor, at each value of a key.",
        {**_OVER, **ATTRACTORS, **point_columns()},
    ),
    "starts": (
        "`vibroplat basins`: one row per initial condition.",
        {**_OVER, "… ": Column("keys of basins.initial_conditions, by dotted name"), **STARTS_TABLE},
    ),
}


class BasinsStudy(Study):
    """The basins of attraction of a section ``basins``.

    Raises
    ------
    ConfigError
        The scene has no section ``basins``, an initial condition is outside the model, or the supply is not constant.
    """

    kind = "basins"
    described = TABLES
    counted = "starts"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.plan = scene, scene.plan_of("basins")
        with_orbit_tolerance(scene, 1e-8)  # refuses a program of the drive
        over = self.plan.over
        if over is not None:
            scene.require_orbits("basins.over, a branch of each orbit,", "basins at each value, or sweep")
        self.key = None if over is None else over.key
        self.values: list[float] = [math.nan] if over is None else over.upward
        if over is not None and over.direction == ["down"]:
            self.values.reverse()
        self._scenes = [validated_base_scene(self._at(value), self.plan) for value in self.values]
        self._blocks = [(first, min(BLOCK, self.plan.number - first)) for first in range(0, self.plan.number, BLOCK)]

    def _at(self, value: float) -> Scene:
        plain = self.scene.model_copy(update={"basins": None, "sweep": None, "orbits": None})
        with errors_about("basins.over"):
            return plain if self.key is None else plain.replace({self.key: value})

    @property
    def conditions(self) -> dict[str, Any]:
        """What stored blocks depend on: also on how many motions go side by side."""
        return super().conditions | {"lanes": str(lanes())}

    def chains(self, store: Store) -> int:
        """Return how many blocks of starts there are."""
        return len(self._blocks) * len(self.values)

    def scenes(self) -> Sequence[Scene]:
        """Return the scenes at the values of the key."""
        return self._scenes

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Map all initial conditions to attractors, classify aperiodic motion, and make the tables.

        Over a key, the attractors found at a value are continued to the next one.
        """
        sets: list[AttractorSet] = []
        history: list[int] = []
        for index, scene in enumerate(self._scenes):
            now = AttractorSet(scene, self._continue(index, sets, store, workers))
            sets.append(now)
            done = 0
            while done < len(self._blocks):
                numbers = range(done, min(2 * done + 1, len(self._blocks)))
                now.add(self._map_blocks(index, store, workers, progress, now.attractors, history, numbers))
                assigned = [start["turns"] for start in now.starts if "outcome" not in start]
                history = history if done else assigned
                done = numbers.stop
            self._classify_groups(index, now, store, workers)
        return _make_result(self, sets)

    def _classify_groups(self, index: int, now: AttractorSet, store: Store, workers: Pool) -> None:
        """Follow a motion of each group longer; where it converges to an orbit of its own, another one."""
        groups = now.groups()
        for attempt in range(MAX_FOLLOWED):
            open_ = [group for group in groups if group.starts]
            tasks = [Task(classify_unconverged, (now.scene, group.starts[0]["state"])) for group in open_]
            records = run_tasks(tasks, store.namespace(f"{index} motion {attempt}"), workers)
            like = [now.find_alike(group, record) for group, record in zip(open_, records, strict=True)]
            tasks = [
                Task(repeats, (now.scene, [start["state"] for start in starts], record["row"].get("period") or 1))
                for starts, record in zip(like, records, strict=True)
            ]
            repeated = run_tasks(tasks, store.namespace(f"{index} repeating {attempt}"), workers)
            for group, record, starts, one in zip(open_, records, like, repeated, strict=True):
                now.take_continued(group, record, list(compress(starts, one["repeats"])))
        for group in groups:
            now.mark_undecided(group)

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose starts, as far from each other as they can be, that must converge to the same attractors.

        Chaos may be a transient, the end of which differs from engine to engine. Starts that are chaotic or arrive late
        are left out, and those whose motions ended early or are undecided.
        """
        attractors, starts = result.attractors, result.starts
        names = ["attractor"] if self.key is None else [column_of(self.key), "attractor"]
        joined = starts[[*names, "turns"]].merge(attractors, on=names, how="left")
        late = joined["period"].gt(0) & joined["turns"].gt(LATE_FRACTION * self.plan.max_turns)
        certain = joined["period"].gt(0) | ~joined["motion"].isin(TRANSIENT_MOTIONS)
        places = np.flatnonzero(certain & ~late & joined["outcome"].eq("ok"))
        count, order, cases = self.plan.number, self.order, list[CrossCheckCase]()
        for index in choose_evenly(places.tolist()):
            value, start = divmod(index, count)
            task = Task(map_alone, (other(self._scenes[value]), self.plan, int(order[start])))
            known = {name: joined[name].iloc[index] for name in (*COMPARED, PHASE_COLUMN) if name != "motion"}
            cases.append(CrossCheckCase(f"from start {index} of the table", task, known))
        return cases

    @property
    def order(self) -> Sequence[int]:
        """Numbers of the starts at a value of the key in the order of the table."""
        plan = self.plan
        if not plan.shape or plan.random:
            return range(plan.number)
        return [int(k) for k in np.lexsort(key_values(plan, range(plan.number)).T[::-1])]

    def _map_blocks(
        self,
        index: int,
        store: Store,
        workers: Pool,
        progress: Progress,
        known: Sequence[Record],
        history: Sequence[int],
        numbers: range,
    ) -> list[Record]:
        """Follow the starts of some blocks at a value of the key."""
        given = self._scenes[index], self.plan
        tasks = [Task(map_initial_conditions, (*given, *self._blocks[number], known, history)) for number in numbers]
        before, all_ = index * self.plan.number, self.plan.number * len(self._scenes)

        def tell(done: int) -> None:
            progress(before + min((numbers.start + done) * BLOCK, self.plan.number), all_)

        return run_tasks(tasks, store.namespace(f"{index} from {numbers.start}"), workers, tell)

    def _continue(self, index: int, sets: Sequence[AttractorSet], store: Store, workers: Pool) -> list[Record]:
        """Return the attractors at a value of the key that are continued from the one before."""
        if self.key is None or not sets:
            return []
        ends = self.values[index - 1 : index + 1]
        attractors = [{name: a[name] for name in ("row", "state")} for a in sets[-1].attractors]
        arguments = (self._scenes[index - 1], self._scenes[index], self.key, self.plan.max_turns, ends, attractors)
        [record] = run_tasks([Task(continue_attractors, arguments)], store.namespace(f"{index} carried"), workers)
        return list(record["found"])


# -- tables -----------------------------------------------------------------------------------------------


def _make_result(study: BasinsStudy, sets: Sequence[AttractorSet]) -> Result:
    """Make the tables and the printed answer."""
    plan, key = study.plan, study.key
    column = {} if key is None else {column_of(key): None}
    attractors, starts, places = [], [], key_values(plan, range(plan.number))
    for value, one, labels in zip(study.values, sets, name_attractors(sets), strict=True):
        at = dict.fromkeys(column, value)
        counts = one.counts
        order = sorted(range(len(counts)), key=lambda k: (-counts[k], k))
        attractors += [at | _row(one.attractors[k], labels[k], counts[k], plan) for k in order]
        starts += [
            at
            | dict(zip(plan.initial_conditions, places[k].tolist(), strict=True))
            | {"attractor": labels[one.starts[k]["attractor"]], "turns": one.starts[k]["turns"]}
            for k in study.order
        ]
    more = more_columns(study.scene)
    tables = {
        "attractors": study_table(attractors, [*column, *ATTRACTORS, *more], {**SWEEP, **ATTRACTORS, **more}),
        "starts": study_table(starts, [*column, *plan.initial_conditions, *STARTS_TABLE], {**SWEEP, **STARTS_TABLE}),
    }
    return Result("basins", study.scene, tables, answer_of(study.scene, tables, key, sets))


def _row(record: Record, label: str, count: int, plan: BasinsPlan) -> dict[str, Any]:
    """Return the row of an attractor to which a count of the starts converges."""
    low, high = clopper_pearson(count, plan.number)
    columns: dict[str, Any] = {"attractor": label, "count": count, "fraction": count / plan.number}
    columns |= {"fraction_low": low, "fraction_high": high, "within_turns": plan.max_turns}
    state = zip((*COORDINATES, *RATES), record["state"] or [None] * 14, strict=False)
    own = {name: record[name] for name in ("radius", "ellipsoids")}
    return {**record["row"], **dict(state), **columns, **own}


STUDY = BasinsStudy


def basins(scene: Scene, **options: Unpack[Options]) -> Result:
    """Find the attractors of a scene and the fractions of initial conditions that converge to them.

    Each initial condition of the section ``basins`` is integrated until its motion enters an ellipsoid around a stable
    periodic orbit from which convergence has been tested. Newton's method finds the orbits on the way. Motion that has
    not converged within ``max_turns`` is grouped by its last turns, and one motion of each group is classified.

    Parameters
    ----------
    scene
        A scene with a section ``basins``.
    options
        As in :func:`vibroplat.sweep`; ``progress`` is called with finished and total numbers of initial conditions.

    Returns
    -------
    Result
        Table ``attractors`` has one row per attractor and value of a key; each row can be a guess for
        :func:`vibroplat.orbit`. Table ``starts`` has one row per initial condition.

    Raises
    ------
    ConfigError
        The scene has no section ``basins``, an initial condition is outside the model, or the supply is not constant.

    Examples
    --------
    >>> from vibroplat import Scene, basins
    >>> starts = {"run.initial.phase_difference_rad": [-3.0, 3.0, 4]}
    >>> found = basins(Scene().replace({"basins": {"initial_conditions": starts}}))
    >>> found.starts["turns"].size
    4
    """
    return run_study(BasinsStudy, scene, **options)
