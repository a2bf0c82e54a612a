"""Wall time of runs: medians over repeats, with the work done beside it."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.bench.reference import coordinate_errors, event_errors, load_reference, names
from vibroplat.physics.systems import systems
from vibroplat.scene import Material, Scene, Solver
from vibroplat.solver.run import simulate

TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def runtime(tolerance: float = 1e-6, seconds: float = 2.0, repeats: int = 5) -> pd.DataFrame:
    """Time each kind of scene and say what it needs: unknowns, steps, residual calls, events.

    All run one after the other in each repeat, so that a machine's drift meets all alike.
    """
    scenes = _scenes(tolerance, seconds)
    for scene in scenes.values():
        simulate(scene, keep="summary")  # kernels and first-touch costs are not what is measured
    runs: dict[str, list[float]] = {name: [] for name in scenes}
    rows = []
    for _ in range(repeats):
        for name, scene in scenes.items():
            runs[name].append(_seconds(scene)[0])
    for name, scene in scenes.items():
        summary = _seconds(scene)[1]
        times = [1e3 * t / seconds for t in runs[name]]
        rows.append(
            {
                "scene": name,
                "tolerance": tolerance,
                "ms_per_s_median": statistics.median(times),
                "ms_per_s_min": min(times),
                "ms_per_s_max": max(times),
                "unknowns": _unknowns(scene),
                **{f"{k}_per_s": summary[k] / seconds for k in ("steps", "residual_calls", "restarts", "events")},
                "us_per_step": 1e3 * statistics.median(times) * seconds / summary["steps"],
                "energy_residual": summary["energy_residual"],
            }
        )
    return pd.DataFrame(rows)


def precision(
    reference: Path, tolerances: Sequence[float] = TOLERANCES, repeats: int = 3, only: Callable[[str], bool] = bool
) -> pd.DataFrame:
    """Errors against reference tables beside run time and work, for a range of tolerances."""
    rows = []
    for name in filter(only, names(reference)):
        case = load_reference(reference, name)
        for tolerance in tolerances:
            scene = case.scene.replace({"solver.tolerance": tolerance})
            run = simulate(scene)
            times = [_seconds(scene)[0] for _ in range(repeats)]
            rows.append(
                {
                    "case": name,
                    "tolerance": tolerance,
                    "ms_per_s_median": 1e3 * statistics.median(times) / scene.run.duration_s,
                    "steps": run.summary["steps"],
                    "residual_calls": run.summary["residual_calls"],
                    **coordinate_errors(run, case.trajectory),
                    **event_errors(run.events, case.events),
                    "energy_residual": run.summary["energy_residual"],
                }
            )
    return pd.DataFrame(rows)


def machine() -> str:
    """Say what the figures were measured on."""
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, {platform.system()}"


def _scenes(tolerance: float, seconds: float) -> dict[str, Scene]:
    base = Scene(solver=Solver(tolerance=tolerance)).replace(
        {
            "machine.damping_y_n_s_per_m": 400.0,
            "material": {"mass_ratio": 0.1, "natural_frequency_hz": 18.5, "damping_ratio": 0.05},
            "run.duration_s": seconds,
        }
    )
    changes: dict[str, dict[str, Any]] = {
        "attached, f_e 46": {"drive.supply_frequency_hz": 46.0},
        "impacts, f_e 50": {"drive.supply_frequency_hz": 50.0},
        "impacts, R 0.5, f_e 52": {"drive.supply_frequency_hz": 52.0, "contact.restitution": 0.5},
        "one layer, f_e 50": {
            "drive.supply_frequency_hz": 50.0,
            "material": Material(mass_ratio=0.1, layers=1).model_dump(exclude_unset=True),
        },
        "non-impact, f_e 50": {"drive.supply_frequency_hz": 50.0, "contact.model": "non-impact"},
        "bare, f_e 50": {"drive.supply_frequency_hz": 50.0, "material.mass_ratio": 0.0},
    }
    return {name: base.replace(change) for name, change in changes.items()}


def _unknowns(scene: Scene) -> str:
    return ", ".join(f"{system.size} {mode.label}" for mode, system in systems(scene).items())


def _seconds(scene: Scene) -> tuple[float, dict[str, Any]]:
    began = time.perf_counter()
    summary = simulate(scene, keep="summary").summary
    return time.perf_counter() - began, summary
