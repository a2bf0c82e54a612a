"""Tables of branches of periodic orbits, of their special points, and of boundaries in two keys."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

import vibroplat
from vibroplat.columns import Column, Columns
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.continuation.branch_worker import TOLD
from vibroplat.continuation.curves import Boundary, boundaries, require_inside
from vibroplat.continuation.kinds import KINDS
from vibroplat.continuation.orbit import columns_told
from vibroplat.continuation.tracing import Family, Progress, Traced, families, orbits_plan, trace
from vibroplat.observe.summary import MEASURES
from vibroplat.observe.tables import TRAJECTORY
from vibroplat.study import WAIT
from vibroplat.study.branches import EXCITATION, FREQUENCY, SUPPLY, study_table
from vibroplat.study.point import MEASURED, POINT
from vibroplat.study.pool import pool
from vibroplat.study.store import Record, Store

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Columns of the table of branches after the grid's keys and the key.
COLUMNS = (
    "branch",
    "parent",
    "point",
    EXCITATION,
    "period",
    "period_s",
    *(name for name in MEASURED if name != EXCITATION),
    "sync",
    "notes",
    "sequence",
    "stable",
    "unstable",
    *columns_told(TOLD),
    "residual",
    "turns",
)
#: Columns of what is found on both sides of a boundary.
SIDES = ("below", "above", "check")

#: The state of an orbit where its period begins, in the columns of a trajectory.
STATE: Columns = {name: TRAJECTORY[name] for name in (*COORDINATES, *RATES)}
#: What the columns mean, of the three tables.
BRANCHES: Columns = {
    "branch": Column("number of the branch", "among those of one combination of the grid's values"),
    "parent": Column("branch on which it was found", "-1 for the first"),
    "point": Column("number of the point on its branch"),
    **{name: MEASURES[name] for name in MEASURED},
    "period": Column("turns of exciter 1 in a period"),
    "period_s": Column("period"),
    "sync": POINT["sync"],
    "notes": POINT["notes"],
    "sequence": Column("events of a period", "stick: an impact, or several that accumulate, after which contact holds"),
    "stable": Column("whether disturbances decay"),
    "unstable": Column("number of Floquet multipliers outside the unit circle"),
    **columns_told(TOLD),
    "residual": Column("how far the orbit is from closing", "in the scales of the scene"),
    "turns": Column("turns of exciter 1 that were integrated for the point", "with those of special points before it"),
    **STATE,
}
SPECIAL: Columns = {
    "branch": BRANCHES["branch"],
    "kind": Column("kind of special point", "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS.items())),
    EXCITATION: BRANCHES[EXCITATION],
    "period": BRANCHES["period"],
    "point": Column("last point of the branch before it"),
    **STATE,
}
BOUNDARIES: Columns = {
    "curve": Column("number of the curve"),
    "kind": SPECIAL["kind"],
    "branch": Column("branch whose special point it goes through"),
    EXCITATION: BRANCHES[EXCITATION],
    "period": BRANCHES["period"],
    "below": Column(
        "motion to which a run settles beside the point", "where the first key is lower; empty if not checked"
    ),
    "above": Column("the same on the other side"),
    "check": Column(
        "whether both sides differ as the kind says",
        "agrees; differs; undecided: no period was found on either side; failed: no motion; unstable: so is the orbit "
        "on both sides, and no run stays there; empty if not checked",
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
        return vibroplat.figure_of(self)


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
    opened = pool(jobs, scheduler, wait=wait, chains=len(planned(scene)))
    with Store(None, {}) as store, opened as workers:
        traced = trace(scene, store, workers, progress)
        return tables(scene, traced, boundaries(scene, traced, store, workers))


def planned(scene: Scene) -> list[Family]:
    """List the combinations of the grid's values whose branches are followed.

    Raises
    ------
    ConfigError
        The section ``orbits`` cannot be followed, or ``from`` names no finished run that the scene can go on from.
    """
    found = families(scene)
    plan = orbits_plan(scene)
    if plan.boundaries is not None:
        for family in found:
            require_inside(family.scene, plan.boundaries)
    return found


def tables(scene: Scene, traced: Sequence[Traced], curves: Sequence[Boundary] = ()) -> OrbitTables:
    """Make the tables of branches and boundaries that have been followed."""
    return OrbitTables(branch_table(scene, traced), special_table(scene, traced), boundary_table(scene, curves))


def branch_table(scene: Scene, traced: Sequence[Traced]) -> pd.DataFrame:
    """Return the table of branches: the grid's keys, the key, COLUMNS, and the state where each period begins."""
    key = column_of(orbits_plan(scene).key)
    rows = [
        _place(branch)
        | {"parent": branch.parent, "point": point}
        | row
        | {key: row["value"]}
        | _state(branch, row["state"])
        for branch in traced
        for point, row in enumerate(branch.rows)
    ]
    return _frame(rows, scene, [key, *COLUMNS, *_state_columns(traced)], BRANCHES)


def special_table(scene: Scene, traced: Sequence[Traced]) -> pd.DataFrame:
    """Return the table of special points, with the state of the orbit there.

    ``point`` is the last point of the branch before it.
    """
    key = column_of(orbits_plan(scene).key)
    rows = [
        _place(branch)
        | special
        | {"point": special["after"] - 1, key: special["value"]}
        | _state(branch, special["state"])
        for branch in traced
        for special in branch.special
    ]
    columns = ["branch", "kind", key, EXCITATION, "period", "point", *_state_columns(traced)]
    return _frame(rows, scene, columns, SPECIAL)


def _state_columns(traced: Sequence[Traced]) -> list[str]:
    """List the columns of a state; coordinates that no combination of the grid's values has are absent."""
    present = sorted({i for branch in traced for i in branch.family.scene.coordinates})
    return [names[i] for names in (COORDINATES, RATES) for i in present]


def _state(branch: Traced, state: Sequence[float]) -> Record:
    """Return a state by its columns; coordinates that the branch does not have are left out."""
    own, half = branch.family.scene.coordinates, len(COORDINATES)
    return {COORDINATES[i]: state[i] for i in own} | {RATES[i]: state[i + half] for i in own}


def boundary_table(scene: Scene, curves: Sequence[Boundary]) -> pd.DataFrame:
    """Return the table of boundaries: the points of each curve in their order."""
    plan = orbits_plan(scene)
    keys = [column_of(key) for key in [plan.key, *([plan.boundaries.key] if plan.boundaries else [])]]
    rows = []
    for number, curve in enumerate(curves):
        place = {column_of(key): value for key, value in curve.family.grid.items()}
        place |= {"curve": number, "kind": curve.kind, "branch": curve.branch}
        rows += [
            place | dict.fromkeys(SIDES, "") | row | dict(zip(keys, (row["value"], row["second"]), strict=True))
            for row in curve.rows
        ]
    return _frame(rows, scene, ["curve", "kind", "branch", *keys, EXCITATION, "period", *SIDES], BOUNDARIES)


def column_of(key: str) -> str:
    """Return the column of a key: its name, and the supply frequency as in the table of a sweep."""
    return SUPPLY if key == FREQUENCY else key


def summary(scene: Scene, traced: Sequence[Traced], curves: Sequence[Boundary] = ()) -> dict[str, Any]:
    """Return what is told of the branches besides their points, as plain values."""
    branches = [_told(branch) for branch in traced]
    return {
        "key": orbits_plan(scene).key,
        "points": sum(b["points"] for b in branches),
        "turns": sum(b["turns"] for b in branches),
        "failed": sum(b["failed"] for b in branches),
        "branches": branches,
        "boundaries": [
            {
                "grid": c.family.grid,
                "kind": c.kind,
                "branch": c.branch,
                "points": len(c.rows),
                "ended": c.ended,
                "checks": dict(Counter(row["check"] for row in c.rows if "check" in row)),
            }
            for c in curves
        ],
    }


def _told(branch: Traced) -> dict[str, Any]:
    values = [row["value"] for row in branch.rows]
    return {
        "grid": branch.family.grid,
        "branch": branch.number,
        "parent": None if branch.parent < 0 else branch.parent,
        "origin": branch.origin,
        "points": len(values),
        "stable": sum(row["stable"] for row in branch.rows),
        "least": min(values, default=None),
        "largest": max(values, default=None),
        "turns": sum(row["turns"] for row in branch.rows),
        "special": len(branch.special),
        "ended": branch.ended,
        "failed": branch.failed,
    }


def _place(branch: Traced) -> Record:
    """Return the columns that say which branch a row belongs to."""
    return {column_of(key): value for key, value in branch.family.grid.items()} | {"branch": branch.number}


def _frame(rows: list[Record], scene: Scene, columns: Sequence[str], meant: Columns) -> pd.DataFrame:
    """Make a table with the grid's keys first."""
    grid = {column_of(key): values for key, values in orbits_plan(scene).grid.items()}
    return study_table(rows, [*grid, *columns], grid, {SUPPLY: Column("supply frequency"), **meant})
