"""Cost of sweeps: adaptive against fixed settling at equal results, one worker against several."""

from __future__ import annotations

import os
import statistics
import time

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.paper.scenes import machine_numbers, paper_scene
from vibroplat.study.sweep import sweep

#: Fixed settling times (s) compared with the adaptive one, and the one that serves as the truth.
FIXED, TRUTH = (1.0, 2.0, 4.0, 6.0, 10.0, 20.0), 60.0
#: Largest relative error of RMS y that counts as an equal result.
EQUAL = 1e-3


def base() -> Scene:
    """Return the curves of the paper's Fig. 3, upward in steps of 1 Hz, without Lyapunov exponents."""
    changes = {
        "sweep.supply_frequency_hz.step": 1.0,
        "sweep.supply_frequency_hz.direction": ["up"],
        "sweep.lyapunov": False,
        "sweep.measure_s": 1.0,
    }
    return paper_scene("fig3", machine_numbers("calibrated"), changes)


def settling() -> pd.DataFrame:
    """Compare settling times: simulated time, and errors of RMS y against very long settling.

    Errors are over the points that have period 1 in the long run; ``unequal`` counts those beyond EQUAL, and
    ``other_period`` all points whose period differs from that of the long run.
    """
    scene = base()
    truth = sweep(scene.replace({"sweep.settle_s": TRUTH}))
    # without vertical motion (in-phase rotation) a relative error is meaningless
    compared = ((truth["period"] == 1) & (truth["rms_y_m"] > 1e-3 * truth["rms_y_m"].max())).to_numpy(dtype=bool)
    rows = []
    for choice in ("auto", *FIXED):
        began = time.perf_counter()
        table = sweep(scene.replace({"sweep.settle_s": choice}))
        seconds = time.perf_counter() - began
        error = np.abs(table["rms_y_m"] / truth["rms_y_m"] - 1.0).to_numpy()[compared]
        rows.append(
            {
                "settle_s": str(choice),
                "mean_settle_s": table["settle_s"].mean(),
                "simulated_s": table["simulated_s"].sum(),
                "wall_s": seconds,
                "points": len(error),
                "unequal": int((error > EQUAL).sum()),
                "median_error": float(np.median(error)),
                "largest_error": float(error.max()),
                "other_period": int((table["period"] != truth["period"]).sum()),
            }
        )
    return pd.DataFrame(rows)


def workers(repeats: int = 3) -> pd.DataFrame:
    """Time the same sweep in this process and in worker processes, and check that the tables are equal."""
    scene = base().replace({"sweep.supply_frequency_hz.step": 0.25})
    sweep(scene.replace({"sweep.supply_frequency_hz.stop": 43.0}))  # loads the kernels
    first = None
    times: dict[int, list[float]] = {}
    counts = sorted({1, 2, os.cpu_count() or 1})
    for _ in range(repeats):
        for jobs in counts:
            began = time.perf_counter()
            table = sweep(scene, jobs=jobs)
            times.setdefault(jobs, []).append(time.perf_counter() - began)
            measured = table.drop(columns="wall_s")
            first = measured if first is None else first
            pd.testing.assert_frame_equal(measured, first, check_exact=True)
    assert first is not None
    rows = []
    for jobs in counts:
        seconds = statistics.median(times[jobs])
        rows.append(
            {
                "jobs": jobs,
                "wall_s_median": seconds,
                "ratio": statistics.median(a / b for a, b in zip(times[1], times[jobs], strict=True)),
                "points_per_s": len(first) / seconds,
                "simulated_s_per_s": first["simulated_s"].sum() / seconds,
                "events_per_s": first["events"].sum() / seconds,
            }
        )
    return pd.DataFrame(rows)
