"""Wall time of runs: medians over repeats, and the work done."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from vibroplat.bench.reference import Reference, coordinate_errors, event_errors
from vibroplat.bench.scenes import kinds, unknowns
from vibroplat.flow.run import simulate
from vibroplat.scene import Scene

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)

#: Engine and integrator of modes without contact force, as named in a configuration.
Variant = tuple[str, str]
DEFAULT: tuple[Variant, ...] = (("auto", "auto"),)
VARIANTS: tuple[Variant, ...] = (("native", "ida"), ("native", "adams"), ("sundae", "ida"), ("sundae", "adams"))


def with_variant(scene: Scene, variant: Variant) -> Scene:
    """Return a scene for another engine and integrator."""
    return scene.replace({"solver.engine": variant[0], "solver.smooth_modes": variant[1]})


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
    tolerance: float = 1e-6, seconds: float = 2.0, repeats: int = 5, variants: Sequence[Variant] = DEFAULT
) -> pd.DataFrame:
    """Time each kind of scene and count unknowns, steps, residual calls and events.

    If engine ``native`` is among the variants, the column ``ratio`` of the others is their time over that of ``native``
    with the same integrator (median over repeats).
    """
    scenes = {
        (name, variant): with_variant(scene, variant)
        for name, scene in kinds(tolerance, seconds).items()
        for variant in variants
    }
    measured = side_by_side(scenes, repeats)
    rows = []
    for (name, variant), (times, summary) in measured.items():
        per_second = [1e3 * t / seconds for t in times]
        native = measured.get((name, ("native", variant[1])))
        row = {
            "scene": name,
            "engine": summary["engine"],
            "smooth_modes": variant[1],
            "tolerance": tolerance,
            "unknowns": unknowns(scenes[name, variant]),
            "ms_per_s_median": statistics.median(per_second),
            "ms_per_s_min": min(per_second),
            "ms_per_s_max": max(per_second),
            **{f"{k}_per_s": summary[k] / seconds for k in ("steps", "residual_calls", "restarts", "events")},
            "us_per_step": 1e6 * statistics.median(times) / summary["steps"],
            "energy_residual": summary["energy_residual"],
        }
        if native is not None:
            row["ratio"] = statistics.median(mine / its for mine, its in zip(times, native[0], strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def precision(
    cases: Iterable[Reference],
    tolerances: Sequence[float] = TOLERANCES,
    repeats: int = 3,
    variants: Sequence[Variant] = DEFAULT,
) -> pd.DataFrame:
    """Measure errors against references, run time and work for a range of tolerances."""
    rows = []
    for case in cases:
        scenes = {
            (tolerance, variant): with_variant(case.scene.replace({"solver.tolerance": tolerance}), variant)
            for tolerance in tolerances
            for variant in variants
        }
        for (tolerance, variant), (times, summary) in side_by_side(scenes, repeats).items():
            run = simulate(scenes[tolerance, variant])
            rows.append(
                {
                    "case": case.name,
                    "engine": summary["engine"],
                    "smooth_modes": variant[1],
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
