"""Time histories of the paper's Figs. 4, 5 and 7."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import static_rest
from vibroplat.motion.run import simulate
from vibroplat.paper.trial import BETA, paper_scene
from vibroplat.results.provenance import configuration_hash
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store

#: Frequencies (Hz) of the panels of each figure.
PANELS: dict[str, tuple[str, ...]] = {
    "fig4": ("25.75", "30.7", "38.75"),
    "fig5": ("25.75", "30.7", "38.75"),
    "fig7": ("25.75", "28.75", "30.7", "38.75"),
}
#: Scenes of the curves of each figure, in the paper's numbering.
CURVES: dict[str, tuple[str, ...]] = {
    "fig4": ("mu0.1", "mu0.2", "mu0"),
    "fig5": ("mu0.1", "mu0.2"),
    "fig7": ("mu0.2", "mu0.2-R0.3", "mu0.2-R0.5", "mu0.2-nonimpact"),
}
#: Turns of exciter 1 that a time history shows.
SHOWN = 8
#: Points per second.
RATE = 2000.0
#: Columns of a time history after its panel and curve.
COLUMNS = ("scene", "excitation_frequency_hz", "t_s", "y_m", "gap_m")


def histories(numbers: Mapping[str, Any], beta: float | None, records: Store, workers: Pool) -> dict[str, pd.DataFrame]:
    """Simulate the time histories that are not stored yet, each once for all figures that show it.

    Parameters
    ----------
    numbers
        Dotted keys and values of the machine.
    beta
        β of the non-impact model (1/s); without it the curves of this model are left out.
    records
        Where the time histories are stored.
    workers
        Where they are simulated.

    Returns
    -------
    dict
        Tables by scene, see :func:`history`.

    Raises
    ------
    WorkerLostError
        The worker of a time history died more than once.
    """
    scenes = {
        name: paper_scene(name, numbers, {BETA: beta} if name.endswith("nonimpact") else None)
        for figure, panels in PANELS.items()
        for name in (f"f{panel}-{curve}" for panel in panels for curve in CURVES[figure])
        if beta is not None or not name.endswith("nonimpact")
    }
    chains = [StoredChain(_recorded(scene), records, configuration_hash(scene)) for scene in scenes.values()]
    return dict(zip(scenes, run_stored(chains, workers), strict=True))


def _recorded(scene: Scene) -> Tasks[pd.DataFrame]:
    """Simulate a time history."""
    record = yield Task(_record, (scene,))
    return pd.DataFrame(record, columns=list(COLUMNS)).astype(dict.fromkeys(COLUMNS[1:], "float64"))


def _record(scene: Scene) -> Record:
    """Return a time history as lists by column, without the columns that the scene does not have."""
    table = history(scene).dropna(axis="columns", how="all")
    return {str(column): table[column].tolist() for column in table}


def by_figure(tables: Mapping[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Put the time histories of scenes together by figure.

    The columns are panel (the paper's frequency in Hz), curve (its number in the figure) and those of :func:`history`.
    """
    return {
        figure: pd.concat(
            [
                tables[name].assign(panel=float(panel), curve=number)[["panel", "curve", *COLUMNS]]
                for panel in panels
                for number, curve in enumerate(CURVES[figure], 1)
                if (name := f"f{panel}-{curve}") in tables
            ],
            ignore_index=True,
        )
        for figure, panels in PANELS.items()
    }


#: The tables of Figs. 4, 5 and 7, a row for each time.
HISTORY: Columns = {
    "panel": Column("the paper's excitation frequency of the panel, in Hz"),
    "curve": Column("number of the curve in the paper"),
    "scene": Column("name of the scene"),
    "excitation_frequency_hz": Column("mean speed of both exciters"),
    "t_s": Column("time", "from a whole turn of exciter 1"),
    "y_m": Column("displacement along y", "from the static rest"),
    "gap_m": Column("gap", "empty without contact"),
}


def history(scene: Scene) -> pd.DataFrame:
    """Simulate a scene and return its last turns of exciter 1.

    The columns are scene (its name), excitation_frequency_hz, t_s from a whole turn of exciter 1, y_m from the static
    rest, and gap_m, which is nan without contact.
    """
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
