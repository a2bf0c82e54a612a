"""What a part of a motion is summed up to: statistics, extremes, events, energy audit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.model.energy import (
    FORCE,
    FORCE_SIZE,
    POWERS,
    elastic_energy,
    gravity_energy,
    kinetic_energy,
    unbalance_momentum,
    vertical_momentum,
)
from vibroplat.model.parameters import FloatArray, Parameters
from vibroplat.observe import statistics as m
from vibroplat.observe.statistics import Measures


@dataclass(frozen=True)
class Energies:
    """Energies of a state (J), its vertical momentum and the size of the unbalances' momenta (N·s)."""

    kinetic: float
    elastic: float
    gravity: float
    momentum: float
    unbalances: float

    @classmethod
    def of(cls, state: FloatArray, p: Parameters) -> Energies:
        """Evaluate them at a full state."""
        terms = (kinetic_energy, elastic_energy, gravity_energy, vertical_momentum, unbalance_momentum)
        return cls(*(of(state, p) for of in terms))


class Part(NamedTuple):
    """A part of a motion: what was summed over it, the energies at its ends, and the sums at the ends of its blocks."""

    measures: Measures
    before: Energies
    after: Energies
    blocks: Sequence[Measures] = ()


def audit(ms: Measures, before: Energies, after: Energies) -> dict[str, float]:
    """Energies of a run (J), and what is left of their balance and of that of vertical momentum.

    Motor work + gravity's work + truncation = Δ(kinetic + elastic) + dissipation + impact losses;
    the residual is relative to the largest of the energy that motors and dampers exchanged and the
    energies, kinetic and elastic, at both ends. Springs, dampers and weight change the vertical momentum,
    and impacts must not; its residual is relative to the largest of the integral of those forces' sizes, the
    momentum and the sizes of the unbalances' momenta at both ends. Impact law ``printed`` does not keep the upper
    layer's momentum, and it shows here.
    """
    fed, taken = float(ms.work[: m.DISSIPATIONS].sum()), float(ms.work[m.DISSIPATIONS : m.N_POWERS].sum())
    loss = float(ms.totals[m.IMPACT_LOSS])
    gravity = before.gravity - after.gravity
    kinetic, elastic = after.kinetic - before.kinetic, after.elastic - before.elastic
    left = fed + gravity - taken - loss - kinetic - elastic
    scale = max(float(ms.marks[m.EXCHANGED]) + loss, *(e.kinetic + e.elastic for e in (before, after)))
    lost = float(ms.work[FORCE]) - (after.momentum - before.momentum)
    sizes = (size for e in (before, after) for size in (abs(e.momentum), e.unbalances))
    momentum = max(float(ms.work[FORCE_SIZE]), *sizes)
    return {f"{name}_work_j": float(w) for name, w in zip(POWERS, ms.work[: m.N_POWERS], strict=True)} | {
        "gravity_work_j": gravity,
        "impact_loss_j": loss,
        "kinetic_change_j": kinetic,
        "elastic_change_j": elastic,
        "energy_residual_j": left,
        "energy_residual": abs(left) / scale if scale > 0.0 else 0.0,
        "momentum_residual_n_s": lost,
        "momentum_residual": abs(lost) / momentum if momentum > 0.0 else 0.0,
    }


def statistics(ms: Measures) -> dict[str, float | None]:
    """RMS about the mean, amplitude, frequencies, phase of the measured part; None where it is too short."""
    marks = ms.marks
    turned = ms.whole[m.TIME] > 0.0
    sums = ms.whole if turned else ms.plain + ms.open_turn
    names = ("rms_x_m", "rms_y_m", "rms_phi_rad")
    if sums[m.TIME] <= 0.0:
        others = ("amplitude_y_m", "excitation_frequency_hz", "frequency_split_hz", "phase_difference_rad")
        return dict.fromkeys(
            (*names, *others, "phase_coherence", "flight_fraction", "motor_power_w", "impacts_per_period", "measured_s")
        )
    mean = sums / sums[m.TIME]
    result: dict[str, float | None] = {
        name: math.sqrt(max(mean[square] - mean[first] ** 2, 0.0))
        for name, first, square in zip(names, (m.X, m.Y, m.PHI), (m.XX, m.YY, m.PHI_PHI), strict=True)
    }
    result["amplitude_y_m"] = 0.5 * (marks[m.Y_MAX] - marks[m.Y_MIN])
    result["excitation_frequency_hz"] = result["frequency_split_hz"] = result["impacts_per_period"] = None
    if turned:
        seconds = 2.0 * math.pi * (marks[m.LAST_TIME] - marks[m.FIRST_TIME])
        first = abs(marks[m.LAST_1] - marks[m.FIRST_1]) / seconds
        second = abs(marks[m.LAST_2] - marks[m.FIRST_2]) / seconds
        result["excitation_frequency_hz"] = 0.5 * (first + second)
        result["frequency_split_hz"] = first - second
        result["impacts_per_period"] = (marks[m.LAST_IMPACTS] - marks[m.FIRST_IMPACTS]) / (marks[m.TURNS] - 1.0)
    result["phase_difference_rad"] = half_open(math.atan2(mean[m.SIN], mean[m.COS]))
    result["phase_coherence"] = math.hypot(mean[m.SIN], mean[m.COS])
    result["flight_fraction"] = mean[m.FLYING]
    result["motor_power_w"] = mean[m.MOTOR]
    result["measured_s"] = sums[m.TIME]
    return {k: None if v is None else float(v) for k, v in result.items()}


def block_errors(blocks: Sequence[Measures], names: Sequence[str]) -> dict[str, float | None]:
    """Estimate standard errors of statistics from their scatter over blocks; None where a block has none.

    Means of blocks that are long against the memory of the motion are independent, so that the error of their mean is
    their standard deviation over the root of their number (method of batch means).
    """
    parts = [*blocks[:1], *(m.between(a, b) for a, b in pairwise(blocks))]
    found = [statistics(part) for part in parts]
    errors: dict[str, float | None] = {}
    for name in names:
        values = np.array([math.nan if part[name] is None else part[name] for part in found], dtype=float)
        if name == "phase_difference_rad" and len(values):  # about one of them, for angles have no mean
            values = np.angle(np.exp(1j * (values - values[0])))
        error = float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else math.nan
        errors[name] = error if math.isfinite(error) else None
    return errors


def half_open(angle: float, near: float = 1e-12) -> float:
    """Put an angle into (−π, π]; what is no farther than ``near`` from −π is π."""
    return min(angle + 2.0 * math.pi, math.pi) if angle <= -math.pi + near else angle


def measured(part: Part) -> dict[str, Any]:
    """Gather what was measured over a part of a motion.

    Statistics are of its measured part, cut to whole turns of exciter 1 when there is one; extremes of
    force and gap, impulses and energies of the whole. What has no finite value is None.
    """
    marks, totals = part.measures.marks.tolist(), part.measures.totals.tolist()
    found = {
        **statistics(part.measures),
        "contact_force_min_n": marks[m.FORCE_MIN],
        "contact_force_max_n": marks[m.FORCE_MAX],
        "gap_min_m": marks[m.GAP_MIN],
        "gap_max_m": marks[m.GAP_MAX],
        "impulse_max_n_s": totals[m.IMPULSE_MAX],
        "impulse_sum_n_s": totals[m.IMPULSE_SUM],
        "liftoffs": int(totals[m.LIFTOFFS]),
        "impacts": int(totals[m.IMPACTS]),
        "latches": int(totals[m.LATCHES]),
        "events": int(sum(totals[:3])),
        **audit(part.measures, part.before, part.after),
    }
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in found.items()}
