"""β of the non-impact model: the viscous friction with which RMS y equals that of the impact model at one frequency."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.paper.evidence import Evidence, F, Key
from vibroplat.study.branches import FREQUENCY, SUPPLY
from vibroplat.study.point import point_task
from vibroplat.study.pool import Tasks

#: Excitation frequency (Hz) at which the paper makes RMS y of both models equal.
MATCHED = 30.9
#: Largest β that is tried (1/s).
LARGEST_BETA = 500.0
#: Excess of amplitude (m) that stands for a frequency that is not reached.
CAPTURED = 1.0
#: Share of the amplitude up to which an excess counts as none.
SAME = 0.01
#: How far the impact model may stay below MATCHED (Hz): half a step of the paper.
SHORT = 0.25
#: Error of the excitation frequency (Hz) up to which it counts as matched.
WIDTH = 1e-3


def match_beta(evidence: Evidence, mass_ratio: float) -> Tasks[float | None]:
    """Find β (1/s) for the upward branch of a mass ratio with R = 0.

    RMS y of the impact model is read off its curve, whose last point is that before the jump. The non-impact motion is
    continued from frequency to frequency, without perturbation, until it has the same excitation frequency.

    The result is None if one of the models does not reach the frequency in antiphase, or if no β makes them equal.
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
    excess: dict[float, float] = {}
    while True:
        try:
            return beta_without_excess(excess, SAME * impact)
        except UnknownError as unknown:
            scene = viscous.replace({"contact.viscous_per_mass_per_s": unknown.beta})
            found = yield from _at_matched(scene, plan, begin, wanted)
            # with too little friction the motors stay captured below: as if the amplitude were too large
            excess[unknown.beta] = CAPTURED if found is None else found - impact


class UnknownError(Exception):
    """The excess of this β is not in the table."""

    def __init__(self, beta: float) -> None:
        super().__init__(beta)
        self.beta = beta


def beta_without_excess(excess: Mapping[float, float], tolerance: float) -> float | None:
    """Return the β (1/s) whose excess of amplitude (m) is 0 within a tolerance, by Brent's method on a table.

    Returns None if there is no such β between 0 and LARGEST_BETA.

    Raises
    ------
    UnknownError
        The table lacks a β that is needed.
    """

    def at(beta: float) -> float:
        if beta not in excess:
            raise UnknownError(beta)
        return excess[beta]

    if not at(0.0) > 0.0 > at(LARGEST_BETA):
        return None
    beta = float(brentq(at, 0.0, LARGEST_BETA, xtol=1e-3))
    return beta if abs(at(beta)) < tolerance else None


def matched_frequency(evidence: Evidence, mass_ratio: float) -> float | None:
    """Return where both models are made equal (Hz): at MATCHED, or as close below it as the impact model comes.

    Returns None if the impact model stays more than half a step of the paper below MATCHED.
    """
    key = Key(mass_ratio)
    end = evidence.end_of(key, "antiphase", 20.0)
    below = [float(end.before[F])] if end else [float(row[F]) for row in evidence.rows(key, high=31.0)]
    reached = min(MATCHED, max(below, default=0.0))
    return reached if reached >= MATCHED - SHORT else None


def _at_matched(scene: Scene, plan: SweepPlan, supply: float, wanted: float) -> Tasks[float | None]:
    """Find RMS y (m) at an excitation frequency (Hz) by the secant method from a supply frequency (Hz) below it.

    The result is None if the frequency is not reached in antiphase.
    """
    state: list[float] | None = None
    known: list[tuple[float, float]] = []
    for number in range(12):
        record = yield point_task(scene.replace({FREQUENCY: supply}), plan, state, (0, number))
        state, row = record["state"], record["row"]
        if state is None or row["sync"] != "antiphase":
            return None
        if abs(row[F] - wanted) < WIDTH:
            return float(row["rms_y_m"])
        known = [*known, (supply, row[F])][-2:]
        (s0, f0), (s1, f1) = known[0], known[-1]
        slope = (f1 - f0) / (s1 - s0) if s1 != s0 else 0.5
        supply += min(max((wanted - row[F]) / max(slope, 0.2), -1.0), 1.0)
    return None
