"""Points of a sweep confirmed by Newton's method: where the motion repeats, its orbit; elsewhere its exponents."""

from __future__ import annotations

import math
from contextlib import closing
from typing import Any

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.config.sweep_plan import SweepPlan
from vibroplat.continuation.newton import n_unstable
from vibroplat.continuation.orbit import (
    accurate,
    describe_multipliers,
    first_orbit,
    measures_of_orbit,
    multiplier_columns,
)
from vibroplat.continuation.shooting import Shooter
from vibroplat.errors import VibroplatError
from vibroplat.results.columns import Column, Columns
from vibroplat.study.lyapunov import lyapunov
from vibroplat.study.point import Point, lost, measure_point
from vibroplat.study.tasks import Task

#: Residual of the orbits, in the scales of the scene.
TOLERANCE = 1e-8
#: Multipliers and exponents that are told, the largest ones.
TOLD = 3

#: Columns that a confirmed sweep has besides those of every sweep.
CONFIRMED: Columns = {
    "orbit_excitation_frequency_hz": Column("excitation frequency of the periodic orbit", "by Newton's method"),
    "orbit_rms_x_m": Column("RMS of x about its mean, of the orbit"),
    "orbit_rms_y_m": Column("RMS of y about its mean, of the orbit"),
    "orbit_distance": Column("distance of the settled motion from the orbit", "largest, in the scales of the scene"),
    "orbit_residual": Column("how far the orbit is from closing", "in the scales of the scene"),
    "orbit_unstable": Column("number of Floquet multipliers outside the unit circle"),
    **describe_multipliers(TOLD),
    **{
        f"exponent_{i + 1}_per_s": Column(f"Lyapunov exponent {i + 1}", "of motion that does not repeat")
        for i in range(TOLD)
    },
    "confirmation": Column("why there is no orbit, or are no exponents", "empty if they were found"),
}


def confirmed_task(scene: Scene, plan: SweepPlan, state: list[float] | None, key: tuple[int, ...]) -> Task:
    """Return the task of :func:`confirmed_point`."""
    return Task(confirmed_point, (scene, plan, state, key), lost)


def confirmed_point(scene: Scene, plan: SweepPlan, state: list[float] | None, key: tuple[int, ...]) -> Point:
    """Measure a point of a sweep, and confirm it; see :func:`vibroplat.study.point.measure_point`."""
    point = measure_point(scene, plan, state, key)
    period = point.row.get("period")
    if point.state is None or period is None:
        return point
    try:
        found = _orbit(scene, point.state, period) if period else _exponents(scene, point.state)
    except VibroplatError as error:
        found = {"confirmation": str(error)}
    point.row.update({"confirmation": ""} | found)
    return point


def _orbit(scene: Scene, state: list[float], period: int) -> dict[str, Any]:
    """Find the orbit near a settled state."""
    with closing(Shooter(accurate(scene, TOLERANCE))) as shooter:
        problem, found = first_orbit(shooter, np.array(state), period, (), TOLERANCE)
        near, _, _ = found.chart.unpack(found.u)
        measures = measures_of_orbit(problem, found)
        row: dict[str, Any] = {
            f"orbit_{name}": measures[name] for name in ("excitation_frequency_hz", "rms_x_m", "rms_y_m")
        }
        row["orbit_distance"] = float(np.abs((near - found.chart.base) / shooter.scales).max())
        row["orbit_residual"] = found.residuals[-1]
        row["orbit_unstable"] = n_unstable(found.multipliers)
        return row | multiplier_columns(found.multipliers, TOLD)


def _exponents(scene: Scene, state: list[float]) -> dict[str, Any]:
    """Find the largest Lyapunov exponents of a motion that does not repeat."""
    values = lyapunov(scene, state)["exponent_per_s"].to_numpy()[:TOLD]
    return {f"exponent_{i + 1}_per_s": float(v) for i, v in enumerate(values) if math.isfinite(v)}
