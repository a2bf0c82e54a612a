"""Values found by points that follow from one another: boundaries of regimes by bisection, β by Brent's method.

A boundary lies in a step of a sweep, which is halved repeatedly; each new point begins with the state of the point
before the change. β is the viscous friction with which RMS y of the non-impact model equals that of the impact model at
one excitation frequency.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import brentq

from vibroplat.config.plans import FREQUENCY, SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.paper.evidence import IMPACT_CURVE, MOTIONS, REGIMES, Evidence, F, RegimeChange, Step
from vibroplat.paper.scenes import BETA
from vibroplat.study.branches import SUPPLY
from vibroplat.study.point import point_task
from vibroplat.study.pool import Pool, StoredChain, Tasks, run_stored
from vibroplat.study.store import Store

#: Widths (Hz of supply frequency) to which boundaries are narrowed; in excitation frequency they are about half as
#: wide. The first is for jumps, as mass shifts them little (five points from the paper's step), the other for the rest
#: (three points).
JUMP_WIDTH, WIDTH = 0.02, 0.1

#: Excitation frequency (Hz) at which the paper makes RMS y of both models equal, and how far the impact model may stay
#: below it: half a step of the paper.
MATCHED_HZ, MAX_SHORTFALL_HZ = 30.9, 0.25
#: Error of the excitation frequency (Hz) up to which it counts as matched.
FREQUENCY_TOLERANCE = 1e-3
#: Largest β that is tried (1/s).
MAX_BETA = 500.0
#: Fraction of the amplitude up to which an excess counts as none.
EXCESS_TOLERANCE = 0.01
#: Excess of amplitude (m) that stands for a frequency that is not reached: with too little friction the motors stay
#: captured below.
CAPTURED_EXCESS = 1.0


def narrow(judged: Sequence[tuple[Evidence, Store]], workers: Pool) -> None:
    """Narrow the boundaries that have been read of each evidence and are not narrow yet, and add them to it."""
    searches = [(e, step, records) for e, records in judged for step in e.read if step not in e.boundaries]
    chains = [StoredChain(_bisect(e, step), records, json.dumps(step)) for e, step, records in searches]
    for (evidence, step, _), boundary in zip(searches, run_stored(chains, workers), strict=True):
        evidence.boundaries[step] = boundary


def _bisect(evidence: Evidence, step: Step) -> Tasks[RegimeChange]:
    """Halve a step until the change of regime in it is known to the width; a point that fails or is undecided ends it.

    The result is the boundary with the rows next to the change.
    """
    branch, rows = evidence.branches[step.curve]
    before, after = (next(row for row in rows if row[SUPPLY] == supply) for supply in (step.before, step.after))
    plan = branch.plan.model_copy(update={"lyapunov": branch.plan.lyapunov and step.regime in MOTIONS})
    width = JUMP_WIDTH if step.regime in ("antiphase", "in-phase") else WIDTH
    while abs(after[SUPPLY] - before[SUPPLY]) > width:
        middle = float(0.5 * (before[SUPPLY] + after[SUPPLY]))
        record = yield point_task(
            branch.scene.replace({FREQUENCY: middle}), plan, before["state"], branch.perturbation_key(middle)
        )
        row = record["row"] | {SUPPLY: middle, "state": record["state"]}
        if record["state"] is None or (step.regime in MOTIONS and row["motion"] == "undecided"):
            break
        before, after = (row, after) if REGIMES[step.regime](row) != step.begins else (before, row)
    return RegimeChange(before, after)


def match_beta(evidence: Evidence) -> Tasks[float | None]:
    """Find β (1/s) by the impact model's upward branch with R = 0, whose last point is that before the jump.

    The non-impact motion is continued from frequency to frequency, without perturbation, until it has the same
    excitation frequency. The result is None if one of the models does not reach the frequency in antiphase, or if no β
    makes them equal.
    """
    wanted = matched_frequency(evidence)
    if wanted is None:
        return None
    impact = float(evidence.amplitudes(IMPACT_CURVE, np.array([wanted]))[0][0])
    branch = evidence.branches[IMPACT_CURVE].branch
    # antiphase with viscous friction may be unstable near the jump: without perturbation the motion stays there
    changes = {"measure_s": 1.0, "lyapunov": False, "perturbation": 0.0, "settle_by": "section"}
    plan = branch.plan.model_copy(update=changes)
    begin = min(evidence.rows(IMPACT_CURVE), key=lambda row: abs(row[F] - wanted + 1.0))[SUPPLY]
    excess: dict[float, float] = {}
    while True:
        try:
            return beta_without_excess(excess, EXCESS_TOLERANCE * impact)
        except KeyError as missing:
            beta = missing.args[0]
            viscous = branch.scene.replace({"contact.model": "non-impact", BETA: beta})
            rms = yield from _rms_at(viscous, plan, begin, wanted)
            excess[beta] = CAPTURED_EXCESS if rms is None else rms - impact


def beta_without_excess(excess: Mapping[float, float], tolerance: float) -> float | None:
    """Return the β (1/s) whose excess of amplitude (m) is 0 within a tolerance, by Brent's method on a table.

    Returns None if there is no such β between 0 and MAX_BETA.

    Raises
    ------
    KeyError
        The table lacks a β that is needed.
    """
    if not excess[0.0] > 0.0 > excess[MAX_BETA]:
        return None
    beta = float(brentq(excess.__getitem__, 0.0, MAX_BETA, xtol=1e-3))
    return beta if abs(excess[beta]) < tolerance else None


def matched_frequency(evidence: Evidence) -> float | None:
    """Return where both models are made equal (Hz): at MATCHED_HZ, or as close below it as the impact model comes.

    Returns None if the impact model stays more than half a step of the paper below MATCHED_HZ.
    """
    end = evidence.jump(IMPACT_CURVE)
    below = [end.before] if end else evidence.rows(IMPACT_CURVE, high=31.0)
    reached = min(MATCHED_HZ, max((float(row[F]) for row in below), default=0.0))
    return reached if reached >= MATCHED_HZ - MAX_SHORTFALL_HZ else None


def _rms_at(scene: Scene, plan: SweepPlan, supply: float, wanted: float) -> Tasks[float | None]:
    """Find RMS y (m) at an excitation frequency (Hz) by the secant method from a supply frequency (Hz) below it.

    The result is None if the frequency is not reached in antiphase.
    """
    state: list[float] | None = None
    last: tuple[float, float] | None = None
    for number in range(12):
        record = yield point_task(scene.replace({FREQUENCY: supply}), plan, state, (0, number))
        state, row = record["state"], record["row"]
        if state is None or row["sync"] != "antiphase":
            return None
        if abs(row[F] - wanted) < FREQUENCY_TOLERANCE:
            return float(row["rms_y_m"])
        slope = (row[F] - last[1]) / (supply - last[0]) if last and last[0] != supply else 0.5
        last = supply, row[F]
        supply += min(max((wanted - row[F]) / max(slope, 0.2), -1.0), 1.0)
    return None
