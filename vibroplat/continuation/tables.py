"""A study of periodic orbits: what is planned, how it is followed, and the tables of what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from vibroplat.columns import COUNT, FLAG, TEXT, Column, Columns
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.plans import OrbitsPlan
from vibroplat.continuation.branch_tasks import MAX_MULTIPLIERS, ComputedBranch, describe_multipliers
from vibroplat.continuation.codim2 import ComputedBoundary
from vibroplat.continuation.special_points import KINDS
from vibroplat.observe.tables import TRAJECTORY
from vibroplat.report.data_sheet import SHEET, point_columns, points_of
from vibroplat.report.summary import MEASURES
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of, study_table
from vibroplat.study.point import MEASURED, POINT
from vibroplat.study.store import Record
from vibroplat.study.sweep import SWEEP

#: The state of an orbit at the start of its period, in the columns of a trajectory.
STATE: Columns = {name: TRAJECTORY[name] for name in (*COORDINATES, *RATES)}
#: Columns of the three tables.
BRANCHES: Columns = {
    "branch": Column("number of the branch", "counted for each combination of the grid's values", kind=COUNT),
    "parent": Column("branch from which this branch starts", "-1 for the first branch", kind=COUNT),
    "point": Column("number of the point on its branch", kind=COUNT),
    EXCITATION: MEASURES[EXCITATION],
    "period": Column("period, in turns of exciter 1", kind=COUNT),
    "period_s": Column("period"),
    **{name: MEASURES[name] for name in MEASURED if name != EXCITATION},
    "sync": POINT["sync"],
    "notes": POINT["notes"],
    "sequence": Column("event sequence of a period", "stick: an impact or a chatter that ends in contact", kind=TEXT),
    "stable": Column("whether the orbit is stable", kind=FLAG),
    "n_unstable": Column("number of Floquet multipliers outside the unit circle", kind=COUNT),
    **describe_multipliers(MAX_MULTIPLIERS),
    "residual": Column("residual of the orbit: distance between its ends", "scaled units"),
    "turns": Column("turns of exciter 1 integrated for the point", "including special points before it"),
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
    "point": Column("last point of the branch before the special point", kind=COUNT),
    **STATE,
}
BOUNDARIES: Columns = {
    "curve": Column("number of the curve", kind=COUNT),
    "kind": SPECIAL["kind"],
    "branch": Column("branch with the special point from which the curve starts", kind=COUNT),
    EXCITATION: BRANCHES[EXCITATION],
    "period": BRANCHES["period"],
    "n_unstable": Column(
        "number of Floquet multipliers outside the unit circle, without those that cross it",
        "above 0: the orbit is unstable on both sides of the curve, and no motion converges to it",
        kind=COUNT,
    ),
}


_KEYS: Columns = {
    "…": Column("values of the grid's keys and of the keys that vary, by dotted name", "see configuration.md")
}
#: The tables of orbits: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "branches": (
        "`vibroplat orbits`: one row per point of each branch.",
        {**_KEYS, **BRANCHES, **point_columns()},
    ),
    "special": ("`vibroplat orbits`: one row per special point.", {**_KEYS, **SPECIAL}),
    "boundaries": (
        "`vibroplat orbits` with `boundaries`: points of each curve, in their order.",
        {**_KEYS, **BOUNDARIES},
    ),
}


def make_tables(
    plan: OrbitsPlan, traced: Sequence[ComputedBranch], curves: Sequence[ComputedBoundary]
) -> dict[str, pd.DataFrame]:
    """Make the tables of branches, special points and boundaries."""
    key, present = column_of(plan.key), sorted({i for branch in traced for i in branch.family.scene.coordinates})
    state = [names[i] for names in (COORDINATES, RATES) for i in present]  # coordinates that none has are absent
    columns = [key, *(name for name in BRANCHES if name not in STATE and name not in SHEET)]
    named = {name: c for branch in traced for name, c in points_of(branch.family.scene).items()}
    points = [
        _columns(branch, row, key, parent=branch.parent, point=point)
        for branch in traced
        for point, row in enumerate(branch.rows)
    ]
    special = [
        _columns(branch, special, key, point=special["after"] - 1) for branch in traced for special in branch.special
    ]
    keys = [key] if plan.boundaries is None else [key, column_of(plan.boundaries.key)]
    rows = [
        _grid_columns(curve.grid)
        | {"curve": number, "kind": curve.kind, "branch": curve.branch}
        | {**row, "n_unstable": row["others_outside"]}
        | dict(zip(keys, (row["value"], row["second"]), strict=True))
        for number, curve in enumerate(curves)
        for row in curve.rows
    ]
    tables = {
        "branches": _table(points, plan, [*columns, *state, *SHEET, *named], {**BRANCHES, **named}),
        "special": _table(special, plan, ["branch", "kind", key, EXCITATION, "period", "point", *state], SPECIAL),
        "boundaries": _table(
            rows, plan, ["curve", "kind", "branch", *keys, EXCITATION, "period", "n_unstable"], BOUNDARIES
        ),
    }
    order = ("special", "branches") if plan.boundaries is None else ("boundaries", "special", "branches")
    return {name: tables[name] for name in order}


def _grid_columns(grid: Mapping[str, Any]) -> Record:
    """Return the grid's values by their columns."""
    return {column_of(key): value for key, value in grid.items()}


def _columns(branch: ComputedBranch, row: Record, key: str, **others: int) -> Record:
    """Return a row or a special point of a branch with the columns of its place and its state, and others."""
    half = len(COORDINATES)
    state = {
        names[i]: row["state"][i + at]
        for names, at in ((COORDINATES, 0), (RATES, half))
        for i in branch.family.scene.coordinates
    }
    grid = _grid_columns(branch.family.grid)
    return {**grid, "branch": branch.number, **row, key: row["value"], **state, **others}


def _table(rows: list[Record], plan: OrbitsPlan, columns: Sequence[str], meant: Columns) -> pd.DataFrame:
    """Make a table with the grid's keys first."""
    grid = _grid_columns(plan.grid)
    return study_table(rows, [*grid, *columns], {SUPPLY: SWEEP[SUPPLY], **meant}, grid)


def summarize(
    plan: OrbitsPlan, traced: Sequence[ComputedBranch], curves: Sequence[ComputedBoundary] = ()
) -> dict[str, Any]:
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
