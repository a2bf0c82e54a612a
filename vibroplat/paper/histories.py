"""Time histories of the paper's Figs. 4, 5 and 7."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.flow.run import simulate
from vibroplat.hybrid.initial import static_rest
from vibroplat.paper.trial import BETA, paper_scene
from vibroplat.scene import Scene
from vibroplat.study.execution import Pool
from vibroplat.study.store import Store
from vibroplat.study.tasks import Record, Task, run_tasks

#: Frequencies of the time histories' panels and, by figure, files of their curves in the paper's numbering.
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
#: Turns of exciter 1 that a time history shows, and its points a second.
SHOWN, RATE = 8, 2000.0
#: Columns of a time history after its panel and curve.
COLUMNS = ("scene", "excitation_frequency_hz", "t_s", "y_m", "gap_m")


def histories(numbers: Mapping[str, Any], beta: float | None, store: Store, workers: Pool) -> dict[str, pd.DataFrame]:
    """Return the time histories by figure: the last turns of exciter 1, time counted from a whole one.

    The columns are panel (the paper's frequency), curve (its number), scene, excitation_frequency_hz, t_s,
    y_m (from the static rest) and gap_m. Curves of the non-impact model are left out where there is no β.
    """
    curves = [
        (figure, panel, number, f"f{panel}-{curve}")
        for figure, panels in PANELS.items()
        for panel in panels
        for number, curve in enumerate(CURVES[figure], 1)
        if beta is not None or not curve.endswith("nonimpact")
    ]
    names = list(dict.fromkeys(name for *_, name in curves))  # figures share curves
    scenes = [paper_scene(name, numbers, {BETA: beta} if name.endswith("nonimpact") else None) for name in names]
    records = run_tasks([Task(store, i, _recorded, scene) for i, scene in enumerate(scenes)], workers)
    found = dict(zip(names, map(_table, records), strict=True))
    return {
        figure: pd.concat(
            [found[name].assign(panel=float(p), curve=n) for f, p, n, name in curves if f == figure], ignore_index=True
        )[["panel", "curve", *COLUMNS]]
        for figure in PANELS
    }


def _recorded(scene: Scene) -> Record:
    """Return a time history as a record: lists by column, without those that are not known."""
    table = history(scene).dropna(axis="columns", how="all")
    return {str(column): table[column].tolist() for column in table}


def _table(record: Record) -> pd.DataFrame:
    table = pd.DataFrame(record, columns=list(COLUMNS))
    return table.astype(dict.fromkeys(COLUMNS[1:], "float64"))


def history(scene: Scene) -> pd.DataFrame:
    """Simulate a scene and return its last turns of exciter 1."""
    run = simulate(scene)
    turns = run.section["t_s"].to_numpy()
    begin = turns[max(len(turns) - 1 - SHOWN, 0)] if len(turns) else 0.0
    times = np.arange(begin, run.segments[-1].end, 1.0 / RATE)
    rows = run(times)
    return pd.DataFrame(
        {
            "scene": scene.name,
            "excitation_frequency_hz": run.summary["excitation_frequency_hz"],
            "t_s": np.round(times - begin, 9),
            "y_m": np.round(rows["y_m"] - static_rest(scene)[1], 9),
            "gap_m": np.round(rows["gap_m"], 9) if "gap_m" in rows else np.nan,
        }
    )
