"""β of the non-impact model: the viscous friction with which RMS y is that of the impact model at one frequency."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from vibroplat.paper.evidence import Evidence, F, Key
from vibroplat.scene import Scene
from vibroplat.study.branches import FREQUENCY, SUPPLY
from vibroplat.study.point import measure_point
from vibroplat.sweep_plan import SweepPlan

#: Excitation frequency (Hz) at which the paper makes both models' RMS y equal.
MATCHED = 30.9
#: Largest β that is tried (1/s).
LARGEST_BETA = 500.0
#: Excess of amplitude (m) that stands for a frequency that is not reached, and share of it that is none.
CAPTURED, SAME = 1.0, 0.01
#: By how much the impact model may stay below MATCHED (Hz): half a step of the paper.
SHORT = 0.25
#: Error of the excitation frequency at which it counts as matched (Hz).
WIDTH = 1e-3


def find_beta(evidence: Evidence, mass_ratio: float) -> float | None:
    """Find β (1/s) for the upward branch of a mass ratio with R = 0.

    The impact model's RMS y is read off its curve, whose last point is that before the jump; the non-impact
    motion is carried from frequency to frequency without perturbation until it has the same excitation frequency.

    Returns None where one of both does not reach the frequency in antiphase, or no β makes them equal.
    """
    key = Key(mass_ratio)
    wanted = matched_frequency(evidence, mass_ratio)
    if wanted is None:
        return None
    impact = float(evidence.curve(key, "rms_y_m", np.array([wanted])).values[0])
    course = evidence.courses[key]
    plan = course.plan.model_copy(update={"measure_s": 1.0, "lyapunov": False, "perturbation": 0.0})
    begin = min(evidence.rows(key), key=lambda row: abs(row[F] - wanted + 1.0))[SUPPLY]
    viscous = course.branch.scene.replace({"contact.model": "non-impact"})

    def excess(beta: float) -> float:
        found = _at_matched(viscous.replace({"contact.viscous_per_mass_per_s": beta}), plan, begin, wanted)
        # with too little friction the motors are captured below: as if the amplitude were too large
        return CAPTURED if found is None else found - impact

    if not excess(0.0) > 0.0 > excess(LARGEST_BETA):
        return None
    beta = float(brentq(excess, 0.0, LARGEST_BETA, xtol=1e-3))
    return beta if abs(excess(beta)) < SAME * impact else None


def matched_frequency(evidence: Evidence, mass_ratio: float) -> float | None:
    """Return where both models are made equal (Hz): at MATCHED, or as near below it as the impact model comes.

    None where it does not come within half a step of the paper.
    """
    key = Key(mass_ratio)
    end = evidence.end_of(key, "antiphase", 20.0)
    below = [float(end.before[F])] if end else [float(row[F]) for row in evidence.rows(key, high=31.0)]
    reached = min(MATCHED, max(below, default=0.0))
    return reached if reached >= MATCHED - SHORT else None


def _at_matched(scene: Scene, plan: SweepPlan, supply: float, wanted: float) -> float | None:
    """RMS y (m) where the excitation frequency is a wanted one, by the secant method from a supply frequency below."""
    state: list[float] | None = None
    known: list[tuple[float, float]] = []
    for number in range(12):
        point = measure_point(scene.replace({FREQUENCY: supply}), plan, state, (0, number))
        if point.state is None or point.row["sync"] != "antiphase":
            return None
        state, f = point.state, point.row[F]
        if abs(f - wanted) < WIDTH:
            return float(point.row["rms_y_m"])
        known = [*known, (supply, f)][-2:]
        (s0, f0), (s1, f1) = known[0], known[-1]
        slope = (f1 - f0) / (s1 - s0) if s1 != s0 else 0.5
        supply += min(max((wanted - f) / max(slope, 0.2), -1.0), 1.0)
    return None
