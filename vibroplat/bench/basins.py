"""Cost of basins beside an ensemble of heyoka, in which each of the same starts is followed for a fixed time."""

from __future__ import annotations

import importlib.util
import math
import time
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.basin.question import basins
from vibroplat.basin.starts import begun, states_of
from vibroplat.bench.peers import ensemble
from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import systems
from vibroplat.paper.scenes import machine_numbers, paper_scene
from vibroplat.results.result import Result

#: Turns that an ensemble is followed for: none says when a motion has settled.
TRANSIENTS = (100, 300, 1000)


def cost(repeats: int, starts: int = 400) -> pd.DataFrame:
    """Measure the processor time of basins and of ensembles of single starts and of four in one vector.

    The scene is the calibrated machine without material where it has two synchronous motions. ``unlike`` counts starts
    whose phase difference after the transient is nearer to that of another attractor than the one basins assign.
    """
    box = {"run.initial.phase_difference_rad": [-math.pi, math.pi], "run.initial.speed_ratio": [0.5, 1.1]}
    changes = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": 0.0, "solver.engine": "taylor", "sweep": None}
    scene = paper_scene("fig3", machine_numbers("calibrated"), {}).replace(
        {**changes, "basins": {"starts": box, "random": starts}}
    )
    basins(scene.replace({"basins.random": 2}))  # loads the kernels
    seconds = []
    for _ in range(repeats):
        began = time.process_time()
        found = basins(scene)
        seconds.append(time.process_time() - began)
    turns = found.starts["turns"].mean()
    rows: list[dict[str, Any]] = [{"what": "basins", "turns": turns, "processor_s": np.median(seconds), "unlike": 0}]
    if importlib.util.find_spec("heyoka") is not None:
        for batch in (1, 4):
            rows += [beside(scene, found, turns, batch, repeats) for turns in TRANSIENTS]
    table = pd.DataFrame(rows)
    table["ms_a_start"] = 1e3 * table["processor_s"] / starts
    return table.assign(times_basins=table["processor_s"] / table["processor_s"].iloc[0])


def beside(scene: Scene, found: Result, turns: int, batch: int, repeats: int) -> dict[str, Any]:
    """Measure an ensemble of starts in vectors of a length, and compare where they are after so many turns."""
    assert scene.basins is not None
    [system] = systems(scene).values()
    states = states_of(begun(scene, scene.basins), scene.basins, range(scene.basins.number))
    follow = ensemble(system, parameters(scene), scene.solver.tolerance, batch)
    seconds, ends = list[float](), states[:, system.places]
    for _ in range(repeats):
        began = time.process_time()
        ends = follow(states[:, system.places], 2.0 * math.pi * turns / scene.speed_scale)
        seconds.append(time.process_time() - began)
    reached = _nearest(ends[:, 3:5] @ scene.phase_weights, found.attractors[PHASE_COLUMN].to_numpy(float))
    unlike = found.attractors["attractor"].to_numpy()[reached] != found.starts["attractor"].to_numpy()
    what = "heyoka, one by one" if batch == 1 else f"heyoka, {batch} in a vector"
    return {"what": what, "turns": turns, "processor_s": np.median(seconds), "unlike": int(unlike.sum())}


def _nearest(phases: FloatArray, known: FloatArray) -> Any:
    """Places of the known phase differences that are nearest to some."""
    return np.cos(phases[:, np.newaxis] - known).argmax(axis=1)
