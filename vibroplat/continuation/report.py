"""The files of finished branches of orbits, and their overview for the user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.plausibility import notes_on_inputs
from vibroplat.config.scene import Scene
from vibroplat.continuation.tables import OrbitTables, column_of
from vibroplat.continuation.tracing import Family, orbits_plan
from vibroplat.integrate import engine_name
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import Format, Table
from vibroplat.study.branches import EXCITATION


def write_orbits(scene: Scene, tables: OrbitTables, summary: Mapping[str, Any], directory: Path, form: Format) -> None:
    """Write the tables, the summary ``orbits.json`` and the provenance into a directory."""
    found: dict[str, Table] = {"special": tables.special}
    if orbits_plan(scene).boundaries is not None:
        found["boundaries"] = tables.boundaries
    found["branches"] = tables.branches
    origin = provenance(scene, engine_name(scene))
    absent = {"boundaries"} - found.keys()
    write_result(directory, "orbits", origin, found, {"orbits": summary}, form=form, absent=absent)


def overview(table: pd.DataFrame, summary: Mapping[str, Any]) -> dict[str, str]:
    """Summarize branches in a few lines: label and text."""
    points = len(table)
    frequency, height = table[EXCITATION], 1e3 * table["rms_y_m"]
    failed = f", {summary['failed']} failed" if summary["failed"] else ""
    return {
        "branches": f"{len(summary['branches'])}{failed}",
        "points": f"{points}, {int(table['stable'].sum())} of them stable",
        "turns": f"{summary['turns']:.0f}, {summary['turns'] / max(points, 1):.1f} per point",
        "excitation frequency": f"{frequency.min():.2f} … {frequency.max():.2f} Hz",
        "RMS y": f"{height.min():.3g} … {height.max():.3g} mm",
        "residual": f"at most {table['residual'].max():.2g}",
    }


def branch_lines(scene: Scene, summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of a table for people with a row for each branch."""
    plan = orbits_plan(scene)
    keys = varied(scene)
    header = [*(key.rpartition(".")[2] for key in keys), "branch", "begins at", column_of(plan.key)]
    rows = [
        [
            *(f"{branch['grid'][key]}" for key in keys),
            str(branch["branch"]),
            branch["origin"] + ("" if branch["parent"] is None else f" of branch {branch['parent']}"),
            "" if branch["least"] is None else f"{branch['least']:.6g} … {branch['largest']:.6g}",
            str(branch["points"]),
            str(branch["stable"]),
            ("failed: " if branch["failed"] else "") + branch["ended"],
        ]
        for branch in summary["branches"]
    ]
    return [*header, "points", "stable", "ended"], rows


def special_lines(scene: Scene, special: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Return header and rows of a table for people with a row for each special point."""
    keys = [column_of(key) for key in varied(scene)]
    value = column_of(orbits_plan(scene).key)
    header = [*(key.rpartition(".")[2] for key in keys), "branch", "special point", value, EXCITATION, "period"]
    rows = [
        [
            *(f"{row[key]}" for key in keys),
            str(row["branch"]),
            str(row["kind"]),
            f"{row[value]:.8g}",
            f"{row[EXCITATION]:.8g}",
            str(row["period"]),
        ]
        for _, row in special.iterrows()
    ]
    return header, rows


def failures(summary: Mapping[str, Any]) -> list[str]:
    """Describe each branch that failed: which it is, and the reason."""
    return [
        f"branch {branch['branch']}{''.join(f', {key} {value}' for key, value in branch['grid'].items())} failed "
        f"after {branch['points']} points: {branch['ended']}"
        for branch in summary["branches"]
        if branch["failed"]
    ]


def notes_on_families(planned: Sequence[Family]) -> list[str]:
    """Return the notes on the input."""
    return notes_on_inputs(family.scene for family in planned)


def varied(scene: Scene) -> list[str]:
    """List the keys of the grid that have several values."""
    return [key for key, values in orbits_plan(scene).grid.items() if len(values) > 1]
