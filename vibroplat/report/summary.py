"""Summary of a part of a motion: statistics, extremes, events, and the audit of energy and vertical momentum."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import COUNT, Column, Columns, sync_name
from vibroplat.config.circular import on_line, shown_angle
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import may_succeed
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import CHATTER, IMPACT
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.energy import ALONG_FORCE, ALONG_SIZE, DISSIPATIONS, FORCE_SIZE, FRICTION, POWERS, energies
from vibroplat.model.energy import FORCE as VERTICAL
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import DAMPERS
from vibroplat.observe.conveying import turn_speeds
from vibroplat.observe.extremes import CONTACT_FORCE, HEIGHT, IMPULSE, OPENING, ROTATION, merge_extremes
from vibroplat.observe.measures import (
    N_POWERS,
    SUMMED,
    TIME,
    WITH_EXTREMES,
    Accumulators,
    block_difference,
    measured_extremes,
    require,
)
from vibroplat.report.data_sheet import data_sheet, means, rms_about_mean

#: Phase coherence below which exciters are not synchronous: the mean of their phase difference is meaningless.
COHERENCE = 0.8
#: Drift of the phase difference over the measured part (rad) above which exciters are not synchronous.
MAX_DRIFT = math.pi / 2.0

#: Outcome of a motion that reached its end but does not keep the balances.
INACCURATE = "inaccurate"

#: Limit of the energy residual divided by the root of the tolerance, and its minimum and maximum. The largest residuals
#: of 35 scenes (the paper's time histories, the reference runs, each kind of scene) in 2 to 60 s were 0.13, 0.027 and
#: 0.0016 at tolerances 1e-2, 1e-3 and 1e-4, and 7e-10 at 1e-12: a quarter of the limit or less. Of 560 random scenes,
#: none exceeded it at 1e-6 (largest 0.037) and 2 % at 1e-2, where they had lost half of their energy and more.
ENERGY, MIN_ENERGY_LIMIT, MAX_ENERGY_LIMIT = 5.0, 0.05, 0.5
#: Largest momentum residual over the limit of the energy residual. In the same scenes it was at most 0.006 at
#: tolerance 1e-2 and 7e-4 at 1e-3; of the random ones 0.072 and 0.0046.
MOMENTUM = 0.2

#: The audit of a whole run or point.
AUDIT: Columns = {
    "motor_work_j": Column("work of both motors", "less what the platform takes where it bears a motor's reaction"),
    "truncation_work_j": Column(
        "work without a physical source", "the exciter axes turn with the platform to first order in phi only"
    ),
    **{f"{name}_work_j": Column(f"energy dissipated by the {damper}") for name, (_, damper) in DAMPERS.items()},
    "resistance_work_j": Column("energy dissipated by the resistance of both exciters"),
    "gravity_work_j": Column("work of gravity"),
    "impact_loss_j": Column("energy lost in impacts and chatters", "without friction along the deck"),
    "kinetic_change_j": Column("change of the kinetic energy"),
    "elastic_change_j": Column("change of the elastic energy"),
    "energy_residual_j": Column(
        "residual of the energy balance",
        "work of motors and gravity + truncation - dampers - resistance - impacts - changes of energy",
    ),
    "energy_residual": Column(
        "relative energy residual", "relative to the maximum of the exchanged energy and the energies at both ends"
    ),
    "momentum_residual_n_s": Column("residual of the balance of vertical momentum"),
    "momentum_residual": Column(
        "relative momentum residual", "relative to the maximum of the integral of forces and the momenta at both ends"
    ),
}

#: What :func:`measure` returns. Values are for the whole turns of exciter 1 in the measuring interval, if there are
#: any. Meanings that say "in the whole run" are the exception.
MEASURES: Columns = {
    "rms_x_m": Column("RMS of x", "about its mean"),
    "rms_y_m": Column("RMS of y", "about its mean"),
    "rms_phi_rad": Column("RMS of phi", "about its mean"),
    "amplitude_y_m": Column("amplitude of y", "half the difference of maximum and minimum"),
    "excitation_frequency_hz": Column(
        "mean speed of both exciters",
        "number of whole turns divided by their duration; fractions of a turn if exciter 1 completes none",
    ),
    "frequency_split_hz": Column("speed of exciter 1 minus that of exciter 2"),
    "impacts_per_period": Column(
        "impacts per turn of exciter 1",
        "impacts summed by a chatter do not count; solver.tolerance decides how many count before a chatter, so "
        "there is no standard error if the measuring interval has chatters",
    ),
    "phase_difference_rad": Column(
        "mean phase difference of the exciters",
        "circular mean in (-pi, pi] of phi_1 + phi_2 if counter-rotating, phi_1 - phi_2 if co-rotating",
    ),
    "phase_coherence": Column(
        "coherence of the phase difference", "length of its mean unit vector; 1: constant, 0: no preferred value"
    ),
    "flight_fraction": Column("fraction of the time in flight"),
    "motor_power_w": Column("mean mechanical power of both motors"),
    "measured_s": Column("length of the measuring interval"),
    "measured_from_s": Column("start of the measuring interval", "of all values except those in the whole run"),
    "measured_to_s": Column("end of the measuring interval"),
    "contact_force_min_n": Column("minimum contact force"),
    "contact_force_max_n": Column("maximum contact force", "impulses of impacts do not count"),
    "contact_pull_n": Column("largest tensile contact force in the whole run", "an audit: should be noise"),
    "gap_min_m": Column("minimum gap in the whole run", "an audit: should be 0"),
    "gap_max_m": Column("maximum gap"),
    "phi_max_rad": Column("maximum rotation of the platform in the whole run", "magnitude"),
    "impulse_max_n_s": Column("maximum impulse of an impact"),
    "impulse_sum_n_s": Column("sum of all impulses in the whole run"),
    "liftoffs": Column("number of liftoffs in the whole run"),
    "impacts": Column("number of impacts in the whole run", "without impacts summed by chatters"),
    "chatters": Column("number of chatters in the whole run", "accumulating impacts that end in contact"),
    "events": Column(
        "number of liftoffs, impacts and chatters in the whole run", "without impacts summed by chatters", kind=COUNT
    ),
    "measured_liftoffs": Column("number of liftoffs in the measuring interval"),
    "measured_impacts": Column("number of impacts in the measuring interval", "without impacts summed by chatters"),
    "measured_chatters": Column("number of chatters in the measuring interval"),
    "measured_turns": Column("number of whole turns of exciter 1 in the measuring interval"),
    **{
        name: Column(f"{c.meaning} in the whole run", c.definition) if name.endswith("_j") else c
        for name, c in AUDIT.items()
    },
}


class Energies(NamedTuple):
    """Energies of a state (J), its vertical momentum and the size of the unbalances' momenta (N·s).

    With transport also the momentum along the deck.
    """

    kinetic: float
    elastic: float
    gravity: float
    momentum: float
    unbalances: float
    along: float = 0.0

    @classmethod
    def of(cls, state: FloatArray, p: Parameters) -> Energies:
        """Evaluate them at a full state."""
        return cls(*energies(state, p))


class MeasuredInterval(NamedTuple):
    """A part of a motion: its accumulators, the energies at its ends, and the accumulators at the ends of blocks."""

    measures: Accumulators
    before: Energies
    after: Energies
    blocks: Sequence[Accumulators] = ()


#: What :func:`statistics` finds, and :func:`largest_values`.
STATISTICS = (
    *("rms_x_m", "rms_y_m", "rms_phi_rad", "amplitude_y_m", "excitation_frequency_hz", "frequency_split_hz"),
    *("impacts_per_period", "phase_difference_rad", "phase_coherence", "flight_fraction", "motor_power_w"),
    "measured_s",
)
LARGEST = ("contact_force_max_n", "gap_max_m", "impulse_max_n_s")
_PLACES_OF_LARGEST = np.array([CONTACT_FORCE, OPENING, IMPULSE])


def statistics(ms: Accumulators, extremes: Any) -> dict[str, float | None]:
    """RMS about the mean, amplitude, frequencies, phase of the measured part with its extremes; None if too short."""
    require(ms, SUMMED)
    marks, mean, turned = ms.marks, means(ms), ms.whole[TIME] > 0.0
    if not mean:
        return dict.fromkeys(STATISTICS)
    # without a whole turn: of exciters that swing or stand still
    passed = (marks["last"] - marks["first"]).tolist()
    seconds, one, two = passed[:3] if turned else (1.0, mean["speed_1"], mean["speed_2"])
    first, second = abs(one) / (TURN * seconds), abs(two) / (TURN * seconds)
    return {
        "rms_x_m": rms_about_mean(mean, "x", "xx"),
        "rms_y_m": rms_about_mean(mean, "y", "yy"),
        "rms_phi_rad": rms_about_mean(mean, "phi", "phi_phi"),
        "amplitude_y_m": 0.5 * float(extremes["largest"][HEIGHT] - extremes["least"][HEIGHT]),
        "excitation_frequency_hz": 0.5 * (first + second),
        "frequency_split_hz": first - second,
        "impacts_per_period": passed[3 + IMPACT] / (int(marks["turns"]) - 1.0) if turned else None,
        "phase_difference_rad": shown_angle(math.atan2(mean["sine"], mean["cosine"])),
        "phase_coherence": math.hypot(mean["sine"], mean["cosine"]),
        "flight_fraction": mean["flying"],
        "motor_power_w": mean["power_1"] + mean["power_2"],
        "measured_s": mean["time"],
    }


#: Maximum correlation of neighbouring blocks that is used; 24 blocks cannot resolve a larger one.
MAX_CORRELATION = 0.9
#: Measures that are the largest of their values in blocks.
MAXIMA = ("amplitude_y_m", *LARGEST)
#: Measures that follow from how many impacts are counted before they are summed up as chatter. In chaotic motion at
#: 62.5 Hz with restitution 0.3 impacts_per_period is 0.56 at tolerance 1e-4 and 0.73 at 1e-9, each with a scatter of
#: blocks of 0.02 … 0.05.
COUNTED = ("impacts_per_period",)


def block_errors(blocks: Sequence[Accumulators], names: Sequence[str]) -> dict[str, float | None]:
    """Estimate standard errors of measures from their scatter over blocks; None where a block has none.

    The measures COUNTED have none if any block has chatter: they depend on the tolerance more than they scatter. The
    error of means of blocks is that of :func:`batch_means_error`. The error of an RMS follows from that of its squares,
    and reaches down to 0 where one block outweighs the others: a remainder that still decays. The largest of several
    maxima scatters as each of them does (Gumbel's law). Angles of blocks without a circular mean have no error.
    """
    parts = [*blocks[:1], *(block_difference(a, b) for a, b in pairwise(blocks))]
    of_blocks = [known_of(part)[1] for part in parts]
    chatters = sum(part.marks["last"][3 + CHATTER] - part.marks["first"][3 + CHATTER] for part in parts)
    errors: dict[str, float | None] = {}
    for name in names:
        if name in COUNTED and chatters > 0.0:
            errors[name] = None
            continue
        block_values = [part[name] for part in of_blocks]
        values = on_line(name, [math.nan if v is None or math.isinf(v) else v for v in block_values])
        if is_rms := name.startswith("rms_"):
            values = values**2
        error = math.nan
        if len(values) > 1:
            error = float(values.std(ddof=1)) if name in MAXIMA else batch_means_error(values)
        if is_rms and len(values):
            mean = float(values.mean())
            error = math.sqrt(mean) - math.sqrt(max(mean - error, 0.0))
        errors[name] = error if math.isfinite(error) else None
    return errors


def batch_means_error(values: FloatArray) -> float:
    """Estimate the standard error of the mean of successive blocks' means (method of batch means).

    Blocks need not be long compared with the correlation time of the motion: bursts may last for several blocks. With a
    correlation r of neighbours, and rᵏ of blocks k apart, the variance of the mean is (1 + r)/(1 − r) times that of
    independent blocks. From n blocks r comes out too small by (1 + 3r)/n on average (Marriott and Pope 1954), which is
    added. An estimate below 0 counts as 0; above 0.6 it is still too small.
    """
    away, count = values - values.mean(), len(values)
    total = float(away @ away)
    if not total > 0.0:
        return total  # 0, or nan
    r = float(away[1:] @ away[:-1]) / total
    r = min(max(r + (1.0 + 3.0 * r) / count, 0.0), MAX_CORRELATION)
    return math.sqrt(total / (count - 1) / count * (1.0 + r) / (1.0 - r))


def largest_values(extremes: Any) -> dict[str, float | None]:
    """Largest contact force, gap and impulse; −inf where there is none."""
    return dict(zip(LARGEST, extremes["largest"][_PLACES_OF_LARGEST].tolist(), strict=True))


#: Counts of events, as :data:`vibroplat.hybrid.modes.KINDS`: a corner of the drive is no event of the motion.
_COUNTS = ("liftoffs", "impacts", "chatters")
_MEASURED_COUNTS = tuple(f"measured_{kind}" for kind in _COUNTS)

#: Extremes of a measured part, and its statistics with the largest values.
Known = tuple[Any, dict[str, float | None]]


def known_of(ms: Accumulators) -> Known:
    """Find the extremes of a measured part, and the measures that follow from its sums and extremes."""
    extremes = measured_extremes(ms)
    return extremes, statistics(ms, extremes) | largest_values(extremes)


def measure(part: MeasuredInterval, scene: Scene, *, brief: bool = False, known: Known | None = None) -> dict[str, Any]:
    """Gather the measures of a part of a scene's motion; None for values that are not finite.

    Statistics, extremes of contact force and impulse, the largest gap, and counts that begin with ``measured_`` are of
    the ``measured_turns`` whole turns of exciter 1 in the measured part where there are any, from ``measured_from_s``
    to ``measured_to_s``. All else is of the whole: other counts, the sum of impulses, energies, the largest rotation
    |φ|, and two checks, the smallest gap and how far the contact force fell below 0. If ``brief``, only
    statistics and extremes. What is ``known`` already of the measured part need not be found again (:func:`known_of`).
    """
    require(part.measures, WITH_EXTREMES)
    extremes, shown = known or known_of(part.measures)
    if brief:
        return _finite(shown)
    marks, whole = part.measures.marks, merge_extremes(part.measures.extremes)
    turned = part.measures.whole[TIME] > 0.0
    events = (marks["last"] - marks["first"])[3:] if turned else marks["measured"]
    counts = dict(zip(_COUNTS, marks["counts"].tolist(), strict=False))
    numbers = {
        **shown,
        "measured_from_s": float(marks["first"][0] if turned else marks["window"]),
        "measured_to_s": float(marks["last"][0] if turned else max(marks["until"], marks["window"])),
        "contact_force_min_n": float(extremes["least"][CONTACT_FORCE]),
        "contact_pull_n": max(0.0, -float(whole["least"][CONTACT_FORCE])),
        "gap_min_m": float(whole["least"][OPENING]),
        "phi_max_rad": float(max(whole["largest"][ROTATION], -whole["least"][ROTATION])),
        "impulse_sum_n_s": float(marks["impulse_sum"]),
        **counts,
        "events": sum(counts.values()),
        **dict(zip(_MEASURED_COUNTS, map(int, events.tolist()), strict=False)),
        "measured_turns": max(int(marks["turns"]) - 1, 0),
        **audit(part.measures, part.before, part.after),
        **data_sheet(part.measures, extremes, scene),
    }
    if scene.transport is not None:
        speeds = turn_speeds(part.measures, scene)
        numbers["conveying_speed_error_m_per_s"] = batch_means_error(speeds) if len(speeds) > 1 else None
        numbers |= sliding_audit(part.measures, part.before, part.after)
    return _finite(numbers)


def _finite(numbers: Mapping[str, Any]) -> dict[str, Any]:
    if math.isfinite(sum(filter(None, numbers.values()))):  # so are all numbers; to look at each takes far longer
        return {**numbers}
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in numbers.items()}


#: Columns of the work of :data:`vibroplat.model.energy.POWERS`.
_WORKS = tuple(f"{name}_work_j" for name in POWERS)


def audit(ms: Accumulators, before: Energies, after: Energies) -> dict[str, float]:
    """Energies of a run (J), and the residuals of the balances of energy and of vertical momentum.

    Motor work + gravity's work + truncation = Δ(kinetic + elastic) + dissipation + impact losses;
    the residual is relative to the largest of the energy that motors and dampers exchanged and the
    energies, kinetic and elastic, at both ends. Springs, dampers and weight change the vertical momentum,
    and impacts must not; its residual is relative to the largest of the integral of those forces' sizes, the
    momentum and the sizes of the unbalances' momenta at both ends. Impact law ``printed`` does not keep the upper
    layer's momentum, and it shows here.
    """
    fed, taken = float(ms.work[:DISSIPATIONS].sum()), float(ms.work[DISSIPATIONS:N_POWERS].sum())
    taken += float(ms.work[FRICTION])
    loss = float(ms.marks["impact_loss"])
    gravity = before.gravity - after.gravity
    kinetic, elastic = after.kinetic - before.kinetic, after.elastic - before.elastic
    left = fed + gravity - taken - loss - kinetic - elastic
    ends = before.kinetic + before.elastic, after.kinetic + after.elastic
    scale = max(float(ms.marks["exchanged"]) + loss, *ends)
    lost = float(ms.work[VERTICAL]) - (after.momentum - before.momentum)
    sizes = abs(before.momentum), before.unbalances, abs(after.momentum), after.unbalances
    momentum = max(float(ms.work[FORCE_SIZE]), *sizes)
    return {
        **dict(zip(_WORKS, ms.work.tolist(), strict=False)),
        "gravity_work_j": gravity,
        "impact_loss_j": loss,
        "kinetic_change_j": kinetic,
        "elastic_change_j": elastic,
        "energy_residual_j": left,
        "energy_residual": abs(left) / scale if scale > 0.0 else 0.0,
        "momentum_residual_n_s": lost,
        "momentum_residual": abs(lost) / momentum if momentum > 0.0 else 0.0,
    }


def sliding_audit(ms: Accumulators, before: Energies, after: Energies) -> dict[str, float]:
    """Energy that friction takes (J), and the residual of the balance of momentum along the deck."""
    lost = float(ms.work[ALONG_FORCE]) - (after.along - before.along)
    size = max(float(ms.work[ALONG_SIZE]), *(size for e in (before, after) for size in (abs(e.along), e.unbalances)))
    return {
        "friction_work_j": float(ms.work[FRICTION]),
        "momentum_along_residual_n_s": lost,
        "momentum_along_residual": abs(lost) / size if size > 0.0 else 0.0,
    }


def inaccuracy(measures: Mapping[str, Any], scene: Scene) -> str:
    """Say which residual of the audit is beyond its limit, and what to do; empty if none is.

    Parameters
    ----------
    measures
        Measures of a motion of the scene, ``energy_residual`` and ``momentum_residual`` among them; None has no limit.
    """
    tolerance = scene.solver.tolerance
    energy = min(max(ENERGY * math.sqrt(tolerance), MIN_ENERGY_LIMIT), MAX_ENERGY_LIMIT)
    # impact law printed does not keep the upper layer's momentum
    momentum = math.inf if scene.contact.impact_law == "printed" else MOMENTUM * energy
    for name, limit in (("energy", energy), ("momentum", momentum), ("momentum_along", momentum)):
        residual = measures.get(f"{name}_residual")
        if residual is not None and residual > limit:
            return (
                f"{name} residual {residual:.3g} exceeds {limit:.3g}, the limit at tolerance {tolerance:g}; lower "
                f"solver.tolerance, and check the orders of magnitude in the scene{may_succeed(scene)}"
            )
    return ""


def synchronization(measures: Mapping[str, Any]) -> str:
    """Name the synchronization: ``antiphase``, ``in-phase``, ``intermediate`` or ``none``.

    It is ``none`` if the phase difference drifts by more than MAX_DRIFT over the measured part or is incoherent, or if
    exciter 1 completes no turn.
    """
    split, seconds, phase = measures["frequency_split_hz"], measures["measured_s"], measures["phase_difference_rad"]
    if (
        measures["impacts_per_period"] is None
        or abs(split) * TURN * seconds > MAX_DRIFT
        or measures["phase_coherence"] < COHERENCE
    ):
        return "none"
    return sync_name(phase)
