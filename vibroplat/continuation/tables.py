"""A study of periodic orbits: what is planned, how it is followed, and the tables of what was found."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from vibroplat.columns import COUNT, FLAG, TEXT, Column, Columns
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.plans import OrbitsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import OrbitError, accurate, beginning_at
from vibroplat.continuation.special_points import KINDS
from vibroplat.continuation.two_keys import Boundary, follow_boundary
from vibroplat.continuation.worker import (
    MULTIPLIERS,
    RECORDS,
    Family,
    Traced,
    describe_multipliers,
    follow_family,
    found_again,
    same_special,
)
from vibroplat.errors import ConfigError
from vibroplat.extensions import figure_of
from vibroplat.integrate import engine_name
from vibroplat.model.sensitivity import parameter_direction, value_of
from vibroplat.motion.initial_condition import end_of
from vibroplat.observe.sheet import SHEET, of_points
from vibroplat.observe.summary import MEASURES
from vibroplat.observe.tables import TRAJECTORY
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import Format, Table
from vibroplat.study import WAIT, sweep
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of, study_table
from vibroplat.study.point import MEASURED, POINT
from vibroplat.study.pool import Pool, StoredChain, Task, pool, run_stored
from vibroplat.study.question import COMPARED, Repeat, spread
from vibroplat.study.store import Record, Store

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Called after each part of a branch with the numbers of finished branches, of known ones, and of points.
Progress = Callable[[int, int, int], None]

#: The state of an orbit where its period begins, in the columns of a trajectory.
STATE: Columns = {name: TRAJECTORY[name] for name in (*COORDINATES, *RATES)}
#: What the columns mean, of the three tables.
BRANCHES: Columns = {
    "branch": Column("number of the branch", "among those of one combination of the grid's values", kind=COUNT),
    "parent": Column("branch on which it was found", "-1 for the first", kind=COUNT),
    "point": Column("number of the point on its branch", kind=COUNT),
    EXCITATION: MEASURES[EXCITATION],
    "period": Column("turns of exciter 1 in a period", kind=COUNT),
    "period_s": Column("period"),
    **{name: MEASURES[name] for name in MEASURED if name != EXCITATION},
    "sync": POINT["sync"],
    "notes": POINT["notes"],
    "sequence": Column(
        "events of a period", "stick: an impact, or several that accumulate, after which contact holds", kind=TEXT
    ),
    "stable": Column("whether disturbances decay", kind=FLAG),
    "unstable": Column("number of Floquet multipliers outside the unit circle", kind=COUNT),
    **describe_multipliers(MULTIPLIERS),
    "residual": Column("how far the orbit is from closing", "in the scales of the scene"),
    "turns": Column("turns of exciter 1 that were integrated for the point", "with those of special points before it"),
    **STATE,
    **SHEET,
}
SPECIAL: Columns = {
    "branch": BRANCHES["branch"],
    "kind": Column(
        "kind of special point", "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items()), kind=TEXT
    ),
    EXCITATION: BRANCHES[EXCITATION],
    "period": BRANCHES["period"],
    "point": Column("last point of the branch before it", kind=COUNT),
    **STATE,
}
BOUNDARIES: Columns = {
    "curve": Column("number of the curve", kind=COUNT),
    "kind": SPECIAL["kind"],
    "branch": Column("branch whose special point it goes through", kind=COUNT),
    EXCITATION: BRANCHES[EXCITATION],
    "period": BRANCHES["period"],
    "unstable": Column(
        "number of Floquet multipliers outside the unit circle, besides those that pass it",
        "above 0: the orbit is unstable on both sides of the curve, and no motion converges to it",
        kind=COUNT,
    ),
}


class OrbitTables(NamedTuple):
    """What has been found of the orbits of a scene.

    Attributes
    ----------
    branches
        A row for each point of each branch, in their order.
    special
        A row for each special point, in the order of branches.
    boundaries
        A row for each point of the curves in two keys; empty without ``orbits.boundaries``.
    """

    branches: pd.DataFrame
    special: pd.DataFrame
    boundaries: pd.DataFrame

    def plot(self) -> Figure:
        """Draw the branches with their special points."""
        return figure_of(self)


def orbits(
    scene: Scene,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    progress: Progress | None = None,
) -> OrbitTables:
    """Follow branches of periodic orbits as the section ``orbits`` of a scene says.

    Parameters
    ----------
    scene
        A scene with a section ``orbits``.
    jobs
        Worker processes; with 1 the branches are followed in this process.
    scheduler
        Address of a dask scheduler; its workers are used instead.
    wait
        Seconds after which a scheduler without workers is given up.
    progress
        Called after each part of a branch with the numbers of finished branches, of known ones, and of points.

    Raises
    ------
    ConfigError
        The scene has no such section, a value of it is not allowed, or the scheduler does not answer.
    OrbitError
        There is no orbit to begin with.

    Examples
    --------
    >>> from vibroplat import Scene, orbits
    >>> plan = {"key": "drive.supply_frequency_hz", "start": 42.0, "stop": 44.0}
    >>> found = orbits(Scene().replace({"orbits": plan}))
    >>> found.branches["stable"].all()
    np.True_
    """
    study = planned(scene)
    with pool(jobs, scheduler, wait=wait, chains=len(study.families)) as workers:
        return follow(study, None, workers, progress)[0]


class Planned(NamedTuple):
    """What is to be followed of a scene: its plan, which has been validated, and the combinations of the grid."""

    plan: OrbitsPlan
    families: list[Family]

    @property
    def column(self) -> str:
        """Column of the key."""
        return column_of(self.plan.key)


def planned(scene: Scene) -> Planned:
    """Validate the section ``orbits`` of a scene, and list the combinations of the grid's values, the last key fastest.

    Raises
    ------
    ConfigError
        The section cannot be followed, or ``from`` names no finished run that the scene can go on from.
    """
    plan = scene.orbits
    if plan is None:
        raise ConfigError("this configuration has no orbits section; add orbits: {key: …, start: …, stop: …}")
    accurate(scene, plan.tolerance)  # has no program
    if plan.from_ == "state" and scene.run.initial.state is None:
        raise ConfigError("orbits.from = state but run.initial.state is not given; allowed: give it, or settled")
    if plan.boundaries is not None and plan.boundaries.key in plan.grid:
        raise ConfigError(f"orbits.grid.{plan.boundaries.key} is the key of boundaries; allowed: another key")
    for place, of in (("orbits", plan), ("orbits.boundaries", plan.boundaries)):
        if of is not None:
            for value in (of.start, of.stop):
                _require_continuous(scene, f"{place}.key", of.key, value)
    families: list[Family] = []
    for combination in itertools.product(*plan.grid.values()):
        values = dict(zip(plan.grid, combination, strict=True))
        try:
            placed = scene.replace(values | {plan.key: float(plan.start)})
            parameter_direction(placed, plan.key)
        except ConfigError as error:
            raise ConfigError(f"orbits.grid: {error}") from None
        if plan.from_ not in ("settled", "state"):
            placed = _at_end(placed, plan.from_)
        _require_inside(placed, plan)
        families.append(Family(len(families), values, accurate(placed, plan.tolerance)))
    return Planned(plan, families)


def _require_continuous(scene: Scene, place: str, key: str, value: float) -> None:
    """Refuse a key that does not vary continuously, or has no such value."""
    held = value_of(scene, key)
    if held is not None and not isinstance(held, float):
        raise ConfigError(f"{place} = {key} holds no number that varies continuously; allowed: one that does")
    try:
        parameter_direction(scene.replace({key: float(value)}), key)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


def _at_end(scene: Scene, directory: str) -> Scene:
    """Return the scene at the end of a run, so that workers need not read it."""
    try:
        state = end_of(Path(directory), scene).state
    except ConfigError as error:
        text = str(error).replace("run.initial.from", "orbits.from", 1)
        raise ConfigError(text.replace("; allowed: ", "; allowed: settled, state, or ", 1)) from None
    return beginning_at(scene, state)


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


def conditions(scene: Scene) -> dict[str, Any]:
    """Return what stored parts of branches depend on: all that points of a sweep do, and the version of records."""
    return {"version of records": RECORDS} | sweep.conditions(scene)


def follow(
    study: Planned, store: Store | None, workers: Pool, progress: Progress | None = None
) -> tuple[OrbitTables, dict[str, Any]]:
    """Follow the branches and boundaries of a study; parts that a store has already are not repeated.

    Returns
    -------
    tables, summary
        The summary is what is known of the branches besides their points, as plain values.

    Raises
    ------
    OrbitError
        There is no orbit to begin with, for any combination of the grid's values; the store is finished then.
    """
    traced = trace(study, store, workers, progress)
    curves = boundaries(study, traced, store, workers)
    return tables(study.plan, traced, curves), summary(study.plan, traced, curves)


def trace(study: Planned, store: Store | None, workers: Pool, progress: Progress | None = None) -> list[Traced]:
    """Follow the branches of a study; see :func:`follow`."""
    traced: list[Traced] = []

    def count() -> None:
        if progress is not None:
            progress(sum(bool(b.ended) for b in traced), len(traced), sum(len(b.rows) for b in traced))

    chains = ((follow_family(family, study.plan, traced, count), str(family.number)) for family in study.families)
    run_stored([StoredChain(chain, store, name) for chain, name in chains], workers)
    if all(branch.failed and not branch.rows for branch in traced):
        if store is not None:
            store.finish()  # nothing is left to resume
        raise OrbitError(traced[0].ended)
    return sorted(traced, key=lambda branch: (branch.family.number, branch.number))


def repeats(scene: Scene, branches: pd.DataFrame, other: Callable[[Scene], Scene]) -> list[Repeat]:
    """Choose points of the table of branches, as far from each other as they can be; their orbits are found anew."""
    assert scene.orbits is not None
    found = []
    for place in spread(range(len(branches))):
        (whole,) = branches.iloc[[place]].to_dict("records")
        row: Record = {str(name): value for name, value in whole.items() if pd.notna(value)}
        task = Task(found_again, (other(scene), row, scene.orbits.tolerance))
        swept = ", ".join(f"{key} = {row[key]}" for key in map(column_of, (*scene.orbits.grid, scene.orbits.key)))
        known = {name: row.get(name) for name in COMPARED if name != "motion"}
        found.append(Repeat(f"at {swept}, branch {row['branch']}, point {row['point']}", task, known))
    return found


def boundaries(study: Planned, traced: Sequence[Traced], store: Store | None, workers: Pool) -> list[Boundary]:
    """Follow the boundaries of a study, which begin at the special points of its branches; see :func:`follow`."""
    plan, found, chains = study.plan, list[Boundary](), list[StoredChain[None]]()
    if plan.boundaries is None:
        return found
    passed: list[tuple[Family, Record]] = []
    for branch, special in ((b, s) for b in traced for s in b.special):
        family, kind = branch.family, special["kind"]
        new = not any(of is family and same_special(special, other, plan) for of, other in passed)
        if new and (plan.boundaries.kinds is None or kind in plan.boundaries.kinds):
            boundary = Boundary(family.grid, branch.number, kind)
            found.append(boundary)
            name = f"boundary-{family.number}-{branch.number}-{branch.special.index(special)}"
            chains.append(StoredChain(follow_boundary(family.scene, plan, special, boundary), store, name))
        passed.append((family, special))
    run_stored(chains, workers)
    return found


def tables(plan: OrbitsPlan, traced: Sequence[Traced], curves: Sequence[Boundary] = ()) -> OrbitTables:
    """Make the tables of branches and boundaries that have been followed."""
    key, present = column_of(plan.key), sorted({i for branch in traced for i in branch.family.scene.coordinates})
    state = [names[i] for names in (COORDINATES, RATES) for i in present]  # coordinates that none has are absent
    columns = [key, *(name for name in BRANCHES if name not in STATE and name not in SHEET)]
    named = of_points(dict.fromkeys(name for branch in traced for name in branch.family.scene.output.points))
    points = [
        _columns(branch, row, key) | {"parent": branch.parent, "point": point}
        for branch in traced
        for point, row in enumerate(branch.rows)
    ]
    special = [
        _columns(branch, special, key) | {"point": special["after"] - 1}
        for branch in traced
        for special in branch.special
    ]
    keys = [key] if plan.boundaries is None else [key, column_of(plan.boundaries.key)]
    rows = [
        _named(curve.grid)
        | {"curve": number, "kind": curve.kind, "branch": curve.branch}
        | {**row, "unstable": row["others_outside"]}
        | dict(zip(keys, (row["value"], row["second"]), strict=True))
        for number, curve in enumerate(curves)
        for row in curve.rows
    ]
    return OrbitTables(
        _table(points, plan, [*columns, *state, *SHEET, *named], {**BRANCHES, **named}),
        _table(special, plan, ["branch", "kind", key, EXCITATION, "period", "point", *state], SPECIAL),
        _table(rows, plan, ["curve", "kind", "branch", *keys, EXCITATION, "period", "unstable"], BOUNDARIES),
    )


def _named(grid: Mapping[str, Any]) -> Record:
    """Return the grid's values by their columns."""
    return {column_of(key): value for key, value in grid.items()}


def _columns(branch: Traced, row: Record, key: str) -> Record:
    """Return a row or a special point of a branch with the columns of its place and its state."""
    half = len(COORDINATES)
    state = {
        names[i]: row["state"][i + at]
        for names, at in ((COORDINATES, 0), (RATES, half))
        for i in branch.family.scene.coordinates
    }
    return _named(branch.family.grid) | {"branch": branch.number} | row | {key: row["value"]} | state


def _table(rows: list[Record], plan: OrbitsPlan, columns: Sequence[str], meant: Columns) -> pd.DataFrame:
    """Make a table with the grid's keys first."""
    grid = _named(plan.grid)
    return study_table(rows, [*grid, *columns], {SUPPLY: sweep.SWEEP[SUPPLY], **meant}, grid)


def summary(plan: OrbitsPlan, traced: Sequence[Traced], curves: Sequence[Boundary] = ()) -> dict[str, Any]:
    """Return what is known of the branches besides their points, as plain values."""
    branches = [
        {
            "grid": branch.family.grid,
            "branch": branch.number,
            "parent": None if branch.parent < 0 else branch.parent,
            "origin": branch.origin,
            "points": len(branch.rows),
            "stable": sum(row["stable"] for row in branch.rows),
            "least": min((row["value"] for row in branch.rows), default=None),
            "largest": max((row["value"] for row in branch.rows), default=None),
            "turns": sum(row["turns"] for row in branch.rows),
            "special": len(branch.special),
            "ended": branch.ended,
            "failed": branch.failed,
        }
        for branch in traced
    ]
    return {
        "key": plan.key,
        **{name: sum(branch[name] for branch in branches) for name in ("points", "turns", "failed")},
        "branches": branches,
        "boundaries": [
            {
                "grid": curve.grid,
                "kind": curve.kind,
                "branch": curve.branch,
                "points": len(curve.rows),
                "ended": curve.ended,
            }
            for curve in curves
        ],
    }


def write_orbits(
    scene: Scene,
    tables: OrbitTables,
    summary: Mapping[str, Any],
    directory: Path,
    form: Format,
    check: dict[str, Any] | None = None,
) -> None:
    """Write the tables, the summary ``orbits.json`` and the provenance with what a check has found."""
    found: dict[str, Table] = {"special": tables.special, "branches": tables.branches}
    absent = {"boundaries"}
    if scene.orbits is not None and scene.orbits.boundaries is not None:
        found, absent = {"boundaries": tables.boundaries, **found}, set()
    origin = provenance(scene, engine_name(scene)) | ({} if check is None else {"check": check})
    write_result(directory, "orbits", origin, found, {"orbits": summary}, form=form, absent=absent)
