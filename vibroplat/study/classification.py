"""Classify motions; where no class fits, say why.

* ``periodic`` — the Poincaré section repeats after n turns of exciter 1.
* ``chaotic`` — it does not repeat, and neighbouring trajectories diverge: the largest Lyapunov exponent is positive.
* ``quasi-periodic`` — it does not repeat, and neighbouring trajectories neither diverge nor converge.
* ``undecided`` — the error of the exponent leaves its sign open, or neighbours converge but no period is found, or the
  section still drifts, as while exciters synchronize slowly: the motion has not settled. Or it was measured in too few
  turns to show that it does not repeat.
* ``non-periodic`` — it does not repeat, and there is no exponent: the plan asks for none, or material is transported.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.circular import wrap
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.model.parameters import FloatArray
from vibroplat.observe.measures import MAX_FINAL_PERIOD, Accumulators, block_difference, measured_extremes
from vibroplat.observe.section import MAX_PERIOD, REPEAT_DISTANCE, few_turns, least_period, period
from vibroplat.report.summary import COHERENCE, statistics
from vibroplat.study.lyapunov import Exponent, largest_exponent
from vibroplat.study.settling import SettlingResult, contraction_period

#: Minimum ratio of the smaller to the larger extent of the section, in both halves of the measured part, at which it is
#: steady: a section that still shrinks or grows has not settled.
MIN_EXTENT_RATIO = 0.9
#: Distance between the means of both halves, as a fraction of the extent, above which the section drifts.
MAX_DRIFT = 0.25
#: The same ratio and fraction of chaotic motion, the extent of which varies more. Of 53 rows of random machines nine
#: drift so; among them are all three whose measures differ from those of the next 300 s by more than four standard
#: errors.
CHAOS_LIMITS = 0.7, 0.1
#: Largest growth per turn, with two errors added, at which an exponent without a clear sign counts as 0: neighbours
#: would need at least 350 turns to double or halve their distance.
ZERO_EXPONENT = 2e-3
#: Why motion with transport, which has no exponent, is undecided.
NOT_SETTLED = "not settled: the Poincaré section still drifts"
#: Distance of the mean phase differences (rad) up to which two motions are synchronized alike.
SAME_PHASE = 0.2
#: Number of blocks of a window; an aperiodic motion is measured in one.
BLOCKS = 24
#: RMS of the platform's displacements, of which settling may leave a remainder.
DISPLACEMENTS = ("rms_x_m", "rms_y_m", "rms_phi_rad")
#: Measures that are compared between both halves of a window of aperiodic motion, and the largest difference of their
#: means, in standard errors of independent blocks. The largest ratio of variances is that of measures not made of rare
#: events. Smallest difference of mean phase differences that counts (rad). Of 560 aperiodic rows of random machines, 30
#: change so; measured longer, two of them repeat and eight still change.
SCATTERING_MEASURES = (*DISPLACEMENTS, "excitation_frequency_hz", "motor_power_w")
EVENT_MEASURES = ("flight_fraction", "impacts_per_period")
COMPARED_MEASURES = (*SCATTERING_MEASURES, *EVENT_MEASURES, PHASE_COLUMN)
MAX_HALF_DIFFERENCE, MAX_VARIANCE_RATIO, MIN_PHASE_DIFFERENCE = 3.0, 10.0, 1e-3


class MotionClass(NamedTuple):
    """The class of a motion.

    Attributes
    ----------
    motion
        ``periodic``, ``quasi-periodic``, ``chaotic``, ``undecided`` or ``non-periodic``.
    period
        Turns of exciter 1 after which it repeats; 0 if it does not repeat, None if it makes no turns.
    exponent
        Largest Lyapunov exponent, if it was needed.
    reason
        Why it is undecided; otherwise empty.
    drifts
        Whether it does not repeat and its section changes its position or its extent, or may do so as it is undecided:
        its measures have no errors.
    note
        A warning: that it repeats far more closely after a multiple of the period, or that it may be a transient.
    """

    motion: str
    period: int | None
    exponent: Exponent | None = None
    reason: str = ""
    drifts: bool = False
    note: str = ""


def classify(
    scene: Scene, plan: SweepPlan, settling: SettlingResult, points: FloatArray, state: FloatArray, *, last: bool
) -> MotionClass | None:
    """Classify a measured motion, or return None if it must settle longer.

    It must settle longer if it looked settled but was not, and, unless this is the ``last`` time, if its neighbours
    converge but no period is found, or if its section drifts with transport, where there is no exponent.

    Parameters
    ----------
    scene, plan
        The scene, and how it was to settle and be measured.
    settling
        How it settled.
    points
        Its Poincaré section in scaled units, shape (turns, 14).
    state
        Full state at its end, shape (14,).
    last
        Whether it has settled for the longest time allowed.
    """
    if len(points) < 2:
        return MotionClass("undecided", None, reason="exciter 1 made fewer than two full turns while measured")
    n = period(points, REPEAT_DISTANCE)
    if settling.reason == "periodic":
        return _confirm(scene, plan, settling, points, state, n)
    if n > 0:
        return _periodic(points, n)
    if scene.transport is not None and not scene.transport.runs_away:
        return _by_section(points, last=last)
    if scene.transport is not None or not plan.lyapunov:
        return _without_period(points)
    kind = _by_exponent(largest_exponent(scene, state), points)
    contracts = kind.exponent is not None and kind.exponent.sign < 0 and kind.period == 0
    return None if contracts and not last else kind


def _confirm(
    scene: Scene, plan: SweepPlan, settling: SettlingResult, points: FloatArray, state: FloatArray, n: int
) -> MotionClass | None:
    """Confirm by the measured section, of period n, that a motion has settled; return None if it has not.

    A quick transient may hide a slow one, a spiral towards period 1 may come close to itself every n turns, and chaos
    near an unstable periodic motion looks periodic for a while.
    """
    still = contraction_period(points, scene, plan)
    if n == 0 or settling.period % n != 0 or still == 0 or (n > 1 and not _is_steady(points, plan.settle_tolerance)):
        return None
    if not (settling.late and plan.lyapunov) or scene.transport is not None:
        return _periodic(points, n)
    exponent = largest_exponent(scene, state)
    return None if exponent.sign > 0 else _periodic(points, n, exponent)


def _periodic(points: FloatArray, turns: int, exponent: Exponent | None = None) -> MotionClass:
    """Return the class of a motion the section of which repeats after some turns within REPEAT_DISTANCE."""
    found = least_period(points, turns, REPEAT_DISTANCE)
    return MotionClass("periodic", found.turns, exponent, note=found.note)


def _is_steady(points: FloatArray, tolerance: float, least: float = MIN_EXTENT_RATIO, drift: float = MAX_DRIFT) -> bool:
    """Whether the section keeps its extent and its position."""
    halves = points[: len(points) // 2], points[len(points) // 2 :]
    first, second = (float(np.ptp(half, axis=0).max()) for half in halves)
    way = float(np.abs(halves[1].mean(axis=0) - halves[0].mean(axis=0)).max())
    same_extent = abs(second - first) <= tolerance or min(first, second) >= least * max(first, second)
    return same_extent and way <= max(tolerance, drift * float(np.ptp(points, axis=0).max()))


def _by_exponent(exponent: Exponent, points: FloatArray) -> MotionClass:
    """Classify a motion that has no period up to MAX_PERIOD by the sign of its exponent."""
    if exponent.sign > 0:
        return MotionClass("chaotic", 0, exponent, drifts=not _is_steady(points, REPEAT_DISTANCE, *CHAOS_LIMITS))
    if exponent.sign < 0 or not (abs(exponent.value) + 2.0 * exponent.error) * exponent.turn <= ZERO_EXPONENT:
        n = _long_period(points)
        if n > 0:
            return _periodic(points, n, exponent)
        longest = min(MAX_FINAL_PERIOD, len(points) // 2)
        why = f"no period found up to {longest}" if exponent.sign < 0 else "sign unclear"
        return _undecided(exponent, why)
    few = few_turns(len(points) - 1)
    if few or not _is_steady(points, REPEAT_DISTANCE):
        return _undecided(exponent, few or "the section still drifts")
    return MotionClass("quasi-periodic", 0, exponent)


def _by_section(points: FloatArray, *, last: bool) -> MotionClass | None:
    """Classify a motion that has no period up to MAX_PERIOD, and no exponent; None if it must settle longer."""
    n = _long_period(points)
    if n > 0:
        return _periodic(points, n)
    # A motion that drifts only, beyond REPEAT_DISTANCE, moves by half of it from half to half.
    if _is_steady(points, 0.5 * REPEAT_DISTANCE, least=CHAOS_LIMITS[0]):
        return _without_period(points)
    return MotionClass("undecided", 0, reason=NOT_SETTLED, drifts=True) if last else None


def _without_period(points: FloatArray) -> MotionClass:
    """Return the class of a steady motion without a period and an exponent; few turns leave it open."""
    few = few_turns(len(points) - 1)
    return MotionClass("undecided" if few else "non-periodic", 0, reason=few, drifts=bool(few))


def _long_period(points: FloatArray) -> int:
    """Return the period above MAX_PERIOD after which the section repeats, or 0."""
    return period(points, REPEAT_DISTANCE, first=MAX_PERIOD + 1, last=MAX_FINAL_PERIOD)


def _undecided(exponent: Exponent, why: str) -> MotionClass:
    detail = f"exponent {exponent.value:.3g} ± {exponent.error:.2g} per s, {why}"
    if math.isnan(exponent.value):
        detail = "no exponent: the motion ended early or exciter 1 stopped turning"
    return MotionClass("undecided", 0, exponent, detail, drifts=True)


def same_phase(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two motions are synchronized alike: both not, or with nearly the same phase difference.

    Their classes may differ all the same, where the phase difference lies at a limit of them.
    """
    if "none" in (one["sync"], other["sync"]) or None in (one.get(PHASE_COLUMN), other.get(PHASE_COLUMN)):
        return bool(one["sync"] == other["sync"])
    return bool(abs(wrap(one[PHASE_COLUMN] - other[PHASE_COLUMN])) < SAME_PHASE)


def negligible_differences(scene: Scene, plan: SweepPlan) -> FloatArray:
    """Return differences of DISPLACEMENTS that may be left of settling, shape (3,)."""
    differences: FloatArray = plan.settle_tolerance * state_scales(scene)[: len(DISPLACEMENTS)]
    return differences


def block_values(blocks: Sequence[Accumulators], names: Sequence[str] = DISPLACEMENTS) -> FloatArray:
    """Measures of each block, shape (blocks, measures), from the sums at their ends."""
    parts = [*blocks[:1], *(block_difference(a, b) for a, b in pairwise(blocks))]
    measures = [statistics(part, measured_extremes(part)) for part in parts]
    return np.array([[values[name] for name in names] for values in measures], dtype=float)


def compared_values(blocks: Sequence[Accumulators]) -> FloatArray:
    """COMPARED_MEASURES of each block, shape (blocks, measures); phase differences about the first of them.

    They are nan where they mean nothing.
    """
    values = block_values(blocks, (*COMPARED_MEASURES, "phase_coherence"))
    phase, coherence = values[:, -2], values[:, -1]
    phase = np.angle(np.exp(1j * (phase - phase[0]))) if coherence.min() >= COHERENCE else math.nan * phase
    return np.column_stack([values[:, :-2], phase])


def changed_measure(one: FloatArray, other: FloatArray, negligible: FloatArray) -> str:
    """Name a measure by which two parts of an aperiodic motion differ more than by chance; empty if there is none.

    Parameters
    ----------
    one, other
        COMPARED_MEASURES of the blocks of each part, shape (blocks, measures).
    negligible
        RMS that may be left of settling, shape (3,).
    """
    means = [part.mean(axis=0) for part in (one, other)]
    variances = [part.var(axis=0, ddof=1) for part in (one, other)]
    joint = np.sqrt(variances[0] / len(one) + variances[1] / len(other))
    least = np.where(np.array(COMPARED_MEASURES) == PHASE_COLUMN, MIN_PHASE_DIFFERENCE, 0.0)
    changed = np.abs(means[1] - means[0]) > np.maximum(MAX_HALF_DIFFERENCE * joint, least)
    uneven = np.maximum(*variances) > MAX_VARIANCE_RATIO * np.minimum(*variances)
    changed |= uneven & np.isin(COMPARED_MEASURES, SCATTERING_MEASURES)
    changed[: len(negligible)] &= np.maximum(*means)[: len(negligible)] > negligible
    return next((name for name, differs in zip(COMPARED_MEASURES, changed, strict=True) if differs), "")


def transience(scene: Scene, plan: SweepPlan, kind: MotionClass, values: FloatArray) -> str:
    """Say what changes from half to half of a window of aperiodic motion with these COMPARED_MEASURES; or return ""."""
    if kind.drifts:
        return "the Poincaré section"
    if kind.exponent is not None and not kind.exponent.steady:
        return "the largest Lyapunov exponent"
    half = len(values) // 2
    return changed_measure(values[:half], values[half:], negligible_differences(scene, plan))


def rare_events(values: FloatArray) -> list[str]:
    """List the EVENT_MEASURES that are the same in all blocks of a half: events come too rarely to tell how often."""
    half = len(values) // 2
    still = (np.ptp(values[:half], axis=0) == 0.0) | (np.ptp(values[half:], axis=0) == 0.0)
    return [name for name in EVENT_MEASURES if still[COMPARED_MEASURES.index(name)]]
