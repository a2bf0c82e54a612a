"""Wall time of runs: medians over repeats, and the work done."""

from __future__ import annotations

import math
import os
import platform
import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from vibroplat.bench.reference import Reference, coordinate_errors, event_errors
from vibroplat.bench.scenes import kinds, unknowns
from vibroplat.config.scene import Scene
from vibroplat.motion.run import simulate

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)

#: Engines, as named in a configuration.
DEFAULT = ("auto",)
ENGINES = ("native", "taylor", "sundae")


def with_engine(scene: Scene, engine: str) -> Scene:
    """Return a scene for another engine."""
    return scene.replace({"solver.engine": engine})


def side_by_side(scenes: Mapping[Any, Scene], repeats: int) -> dict[Any, tuple[list[float], dict[str, Any]]]:
    """Time scenes in turns, so that drift of the machine affects all of them equally.

    Returns
    -------
    dict
        Wall times (s) of each repeat and the summary of a run, by the scenes' keys.
    """
    summaries = {key: simulate(scene, keep="summary").summary for key, scene in scenes.items()}  # loads the kernels
    times: dict[Any, list[float]] = {key: [] for key in scenes}
    for _ in range(repeats):
        for key, scene in scenes.items():
            began = time.perf_counter()
            simulate(scene, keep="summary")
            times[key].append(time.perf_counter() - began)
    return {key: (times[key], summaries[key]) for key in scenes}


def runtime(
    tolerance: float = 1e-6, seconds: float = 2.0, repeats: int = 5, engines: Sequence[str] = DEFAULT
) -> pd.DataFrame:
    """Time each kind of scene and count unknowns, steps, residual calls and events.

    If ``native`` is among the engines, the column ``ratio`` of the others is their time over that of ``native`` (median
    over repeats).
    """
    scenes = {
        (name, engine): with_engine(scene, engine)
        for name, scene in kinds(tolerance, seconds).items()
        for engine in engines
    }
    measured = side_by_side(scenes, repeats)
    rows = []
    for (name, engine), (times, summary) in measured.items():
        per_second = [1e3 * t / seconds for t in times]
        native = measured.get((name, "native"))
        row = {
            "scene": name,
            "engine": summary["engine"],
            "tolerance": tolerance,
            "unknowns": unknowns(scenes[name, engine]),
            "ms_per_s_median": statistics.median(per_second),
            "ms_per_s_min": min(per_second),
            "ms_per_s_max": max(per_second),
            **{f"{k}_per_s": _over(summary[k], seconds) for k in ("steps", "residual_calls", "restarts", "events")},
            "us_per_step": 1e6 * statistics.median(times) / summary["steps"],
            "energy_residual": summary["energy_residual"],
        }
        if native is not None:
            row["ratio"] = statistics.median(mine / its for mine, its in zip(times, native[0], strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def _over(count: float | None, seconds: float) -> float:
    """Return a count per second; NaN where an engine has no such count, as ``taylor`` has no residual."""
    return math.nan if count is None else count / seconds


def precision(
    cases: Iterable[Reference],
    tolerances: Sequence[float] = TOLERANCES,
    repeats: int = 3,
    engines: Sequence[str] = DEFAULT,
) -> pd.DataFrame:
    """Measure errors against references, run time and work for a range of tolerances."""
    rows = []
    for case in cases:
        scenes = {
            (tolerance, engine): with_engine(case.scene.replace({"solver.tolerance": tolerance}), engine)
            for tolerance in tolerances
            for engine in engines
        }
        for (tolerance, engine), (times, summary) in side_by_side(scenes, repeats).items():
            run = simulate(scenes[tolerance, engine])
            rows.append(
                {
                    "case": case.name,
                    "engine": summary["engine"],
                    "tolerance": tolerance,
                    "ms_per_s_median": 1e3 * statistics.median(times) / case.scene.run.duration_s,
                    "steps": summary["steps"],
                    "residual_calls": summary["residual_calls"],
                    **coordinate_errors(run, case.trajectory),
                    **event_errors(run.events, case.events),
                    "energy_residual": summary["energy_residual"],
                }
            )
    return pd.DataFrame(rows)


def machine() -> str:
    """Describe the machine on which the figures were measured."""
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()}"
