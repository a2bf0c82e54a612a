"""Tables of a reproduction besides curves and claims: time histories and synchronization."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import COUNT, TEXT, Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import static_rest
from vibroplat.motion.run import simulate
from vibroplat.paper.claims import CLAIMS
from vibroplat.paper.evidence import Evidence, F
from vibroplat.paper.scenes import BETA, paper_scene
from vibroplat.results.provenance import configuration_hash
from vibroplat.study.branches import SUPPLY
from vibroplat.study.pool import Pool, Task, run_tasks
from vibroplat.study.store import Record, Store

#: Frequencies (Hz) of the panels of Figs. 4, 5 and 7, and the scenes of their curves in the paper's numbering.
PANELS: dict[str, tuple[str, ...]] = {
    "fig4": ("25.75", "30.7", "38.75"),
    "fig5": ("25.75", "30.7", "38.75"),
    "fig7": ("25.75", "28.75", "30.7", "38.75"),
}
CURVES: dict[str, tuple[str, ...]] = {
    "fig4": ("mu0.1", "mu0.2", "mu0"),
    "fig5": ("mu0.1", "mu0.2"),
    "fig7": ("mu0.2", "mu0.2-R0.3", "mu0.2-R0.5", "mu0.2-nonimpact"),
}
#: Turns of exciter 1 that a time history shows, and its points per second.
SHOWN_TURNS, POINTS_PER_SECOND = 8, 2000.0

#: The tables of Figs. 4, 5 and 7, a row for each time.
HISTORY: Columns = {
    "panel": Column("excitation frequency of the panel in the paper (Hz)", kind=TEXT),
    "curve": Column("number of the curve in the paper", kind=COUNT),
    "scene": Column("name of the scene", kind=TEXT),
    "excitation_frequency_hz": Column("mean speed of both exciters"),
    "t_s": Column("time", "since a whole turn of exciter 1"),
    "y_m": Column("displacement along y", "relative to static rest"),
    "gap_m": Column("gap", "empty if the model has no contact"),
}
#: The table ``sync-bands``, a row for each stretch of points with the same synchronization.
SYNC_BANDS: Columns = {
    "mass_ratio": Column("mass of the material divided by the mass of the machine"),
    "restitution": Column("coefficient of restitution"),
    "model": Column("contact model", kind=TEXT),
    "law": Column("impact law", kind=TEXT),
    "direction": Column("direction of the branch", kind=TEXT),
    "sync": Column("synchronization of the exciters", kind=TEXT),
    "points": Column("number of points", kind=COUNT),
    "first_hz": Column("excitation frequency at the first point"),
    "last_hz": Column("excitation frequency at the last point"),
    "first_supply_hz": Column("supply frequency at the first point"),
    "last_supply_hz": Column("supply frequency at the last point"),
    "rms_y_largest_m": Column("maximum RMS of y"),
}

#: The tables of a reproduction: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "claims": ("`vibroplat paper`: one row per claim.", CLAIMS),
    "fig4, fig5, fig7": (
        "`vibroplat paper`: time histories. The tables `fig2`, `fig3` and `fig6` have the columns of `sweep`.",
        HISTORY,
    ),
    "sync-bands": ("`vibroplat paper`: where the exciters synchronize how.", SYNC_BANDS),
}


def histories(numbers: Mapping[str, Any], beta: float | None, records: Store, workers: Pool) -> dict[str, pd.DataFrame]:
    """Return the tables of Figs. 4, 5 and 7; time histories that are not stored yet are simulated, each once.

    Without β of the non-impact model (1/s) the curves of this model are left out.
    """
    curves = {
        (figure, panel, number): f"f{panel}-{curve}"
        for figure, panels in PANELS.items()
        for panel in panels
        for number, curve in enumerate(CURVES[figure], 1)
        if beta is not None or not curve.endswith("nonimpact")
    }
    scenes = {
        name: paper_scene(name, numbers, {BETA: beta} if name.endswith("nonimpact") else None)
        for name in dict.fromkeys(curves.values())
    }
    tasks = {configuration_hash(scene): Task(history, (scene,)) for scene in scenes.values()}
    shown = dict(zip(scenes, run_tasks(tasks, records, workers), strict=True))
    columns = list(HISTORY)[2:]
    parts: dict[str, list[pd.DataFrame]] = {figure: [] for figure in PANELS}
    for (figure, panel, number), name in curves.items():
        table = pd.DataFrame(shown[name], columns=columns).astype(dict.fromkeys(columns[1:], "float64"))
        parts[figure].append(table.assign(panel=float(panel), curve=number)[list(HISTORY)])
    return {figure: pd.concat(tables, ignore_index=True) for figure, tables in parts.items()}


def history(scene: Scene) -> Record:
    """Simulate a scene and return its last turns of exciter 1 as lists by column; without contact there is no gap."""
    run = simulate(scene)
    turns = run.section["t_s"].to_numpy()
    begin = turns[max(len(turns) - 1 - SHOWN_TURNS, 0)] if len(turns) else 0.0
    times = np.arange(begin, run.segments[-1].end, 1.0 / POINTS_PER_SECOND)
    rows = run(times)
    table = pd.DataFrame(
        {
            "scene": scene.name,
            "excitation_frequency_hz": run.summary["excitation_frequency_hz"],
            "t_s": np.round(times - begin, 9),
            "y_m": np.round(rows["y_m"] - static_rest(scene)[1], 9),
            "gap_m": np.round(rows["gap_m"], 9) if "gap_m" in rows else np.nan,
        }
    )
    return {str(name): column.tolist() for name, column in table.dropna(axis="columns", how="all").items()}


def sync_bands(evidence: Evidence) -> pd.DataFrame:
    """List the synchronization along each branch: a row for each stretch, with its first and last point.

    Upward and downward branches follow each other, so that their difference shows the hysteresis.
    """
    rows = []
    for curve in sorted(evidence.branches):
        for sync, stretch in groupby(evidence.rows(curve), key=lambda row: str(row["sync"])):
            points = list(stretch)
            ends = [points[end][column] for column in (F, SUPPLY) for end in (0, -1)]
            rows.append((*curve, sync, len(points), *ends, max(row["rms_y_m"] for row in points)))
    return pd.DataFrame(rows, columns=list(SYNC_BANDS))
