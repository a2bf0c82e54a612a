"""Tables of the commands ``paper`` and ``calibrate``, and their overviews for the user."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.integrate import engine_name
from vibroplat.paper.reproduction import SWEEPS, Reproduction
from vibroplat.paper.trial import paper_scene
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import remove_table, write_table


def write_reproduction(found: Reproduction, numbers: Mapping[str, Any], directory: Path) -> None:
    """Write the tables of a reproduction, and its provenance with the machine's numbers.

    Wall times are left out, so that a repeated reproduction gives the same files.
    """
    scene = paper_scene(SWEEPS[0], numbers)
    beta = {"beta_per_s": found.beta, "beta_matched_hz": found.matched_hz}
    tables = {name: table.drop(columns="wall_s", errors="ignore") for name, table in found.tables.items()}
    write_result(directory, "paper", provenance(scene, engine_name(scene)) | beta, tables, form="csv")


def overview(name: str, found: Reproduction, seconds: float) -> Iterator[str]:
    """Yield the lines that summarize a reproduction: claims, machine and work; ``seconds`` is the wall time."""
    for _, row in found.tables["claims"].iterrows():
        yield f"{row['id']:<24}{row['verdict']:<32}{row['seeds']:<16}{row['measured']}"
    yield f"{'machine':<24}{name}; {_matched(found)}"
    yield f"{'computed':<24}{found.points} points, {found.simulated:.6g} s of motion, {found.events} events"
    yield f"{'not ok':<24}{found.failed} points, counted in the claims that they concern"
    yield f"{'wall time':<24}{seconds:.3g} s, {found.points / seconds:.3g} points per s"


def _matched(found: Reproduction) -> str:
    if found.beta is None or found.matched_hz is None:
        return "no β: 30.9 Hz is not reached in antiphase"
    return f"β = {found.beta:.2f} 1/s makes RMS y equal at f = {found.matched_hz:.2f} Hz"


def write_calibration(tables: Mapping[str, pd.DataFrame], directory: Path) -> None:
    """Write the tables of a calibration; empty ones are removed."""
    for name, table in tables.items():
        if len(table):
            write_table(table, directory, name, "csv")
        else:
            remove_table(directory, name)
