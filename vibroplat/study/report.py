"""The tables of a finished sweep, and its overview for the user."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.plausibility import notes_on_inputs
from vibroplat.config.scene import Scene
from vibroplat.integrate import engine_name
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import Format, Table
from vibroplat.study.bands import NEEDED, band_lines, band_tables
from vibroplat.study.branches import FREQUENCY, SUPPLY, Branch, sweep_plan
from vibroplat.study.store import Records
from vibroplat.study.sweep import branch_tables, impact_tables, section_tables, tables

#: Branches whose bands are told; the table ``bands`` holds those of all.
TOLD_BRANCHES = 6


def write_sweep(
    scene: Scene, records: Records, directory: Path, form: Format, *, check: dict[str, Any] | None = None
) -> None:
    """Write the tables and the provenance of a finished sweep into its directory.

    ``check`` is what another engine has found.

    Raises
    ------
    SpoiledError
        A record is missing or damaged; nothing is written.
    """
    found: dict[str, Table] = {}
    if sweep_plan(scene).kind == "bifurcation":
        found |= {"section": section_tables(scene, records), "impacts": impact_tables(scene, records)}
    found["bands"] = band_tables(branch_tables(scene, records, NEEDED))
    found["sweep"] = tables(scene, records)
    absent = {"section", "impacts"} - found.keys()
    origin = provenance(scene, engine_name(scene)) | ({} if check is None else {"check": check})
    write_result(directory, "sweep", origin, found, form=form, absent=absent)


def overview(table: pd.DataFrame) -> dict[str, str]:
    """Summarize a sweep table in a few lines: label and text."""
    frequency, height = table["excitation_frequency_hz"], 1e3 * table["rms_y_m"]
    lines = {
        "points": f"{len(table)} in {table['branch'].nunique()} branches",
        "outcomes": _counts(table["outcome"]),
        "synchronization": _counts(table["sync"]),
        "motions": _counts(table["motion"]),
        "periods": _counts(table["period"].map({0: "none"}).fillna(table["period"].astype("str"))),
        "simulated": f"{table['simulated_s'].sum():.6g} s, {table['events'].sum()} events, "
        f"{table['steps'].sum()} steps",
    }
    if height.notna().any():
        lines |= {
            "excitation frequency": f"{frequency.min():.2f} … {frequency.max():.2f} Hz",
            "RMS y": f"{height.min():.3g} … {height.max():.3g} mm",
            "energy residual": f"at most {table['energy_residual'].max():.2g}",
        }
    return {label: text for label, text in lines.items() if text}


def band_report(bands: pd.DataFrame) -> Iterator[str]:
    """Yield the lines on the bands of a sweep, those of the first branches if there are many."""
    branches = bands["branch"].unique()
    yield from band_lines(bands[bands["branch"].isin(branches[:TOLD_BRANCHES])])
    if len(branches) > TOLD_BRANCHES:
        yield f"bands of {len(branches) - TOLD_BRANCHES} more branches are in the table bands"


def failures(table: pd.DataFrame) -> list[str]:
    """Describe each point that did not end ``ok``: its outcome, its place in the sweep and the reason."""
    failed = table[table["outcome"] != "ok"]
    swept = list(table.columns[: list(table.columns).index("direction") + 1])
    return [
        f"{row['outcome']} at {', '.join(f'{key} {row[key]}' for key in swept)}: {row['detail']}"
        for _, row in failed.iterrows()
    ]


def notes_on_branches(planned: Sequence[Branch]) -> list[str]:
    """Return the notes on the input of a sweep; supply frequencies are unusual if they are large."""
    return notes_on_inputs(branch.scene.replace({FREQUENCY: max(branch.frequencies)}) for branch in planned)


def notes_on_points(table: pd.DataFrame) -> list[str]:
    """Sum up the notes in a sweep table: each kind of note once, with its points and an example."""
    lines: list[str] = []
    noted = table[table["notes"].notna() & (table["notes"] != "")]
    if noted.empty:
        return lines
    noted = noted[[SUPPLY]].assign(note=noted["notes"].str.split("; ")).explode("note")
    for _, rows in noted.groupby(noted["note"].map(_kind), sort=False):
        points, low, high = rows.index.nunique(), rows[SUPPLY].min(), rows[SUPPLY].max()
        place = "1 point" if points == 1 else f"{points} points"
        ends = f"{low:g}" if low == high else f"{low:g} … {high:g}"
        first = ", the first" if points > 1 else ""
        lines.append(f"{place} at a supply of {ends} Hz{first}: {rows['note'].iloc[0]}")
    return lines


def note_on_undecided(table: pd.DataFrame) -> list[str]:
    """Say where the kind of motion is undecided, and why at the first of these points."""
    rows = table[(table["motion"] == "undecided") & (table["outcome"] == "ok")]
    if rows.empty:
        return []
    first = rows.iloc[0]
    count = "1 point is" if len(rows) == 1 else f"{len(rows)} points are"
    where = "at" if len(rows) == 1 else "the first at"
    return [
        f"{count} undecided, {where} a supply of {first[SUPPLY]:g} Hz: {first['detail']}; sweep.max_settle_s may help"
    ]


def _kind(note: str) -> str:
    """Return what notes of one kind have in common: their text without numbers."""
    return re.sub(r"\d[\d.e+-]*", "", note)


def _counts(column: pd.Series) -> str:
    return ", ".join(f"{name} {count}" for name, count in column.dropna().value_counts().items())
