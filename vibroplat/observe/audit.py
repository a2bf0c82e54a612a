"""The audit of a part of a motion: the balances of energy and of vertical momentum."""

from __future__ import annotations

from dataclasses import dataclass

from vibroplat.kernels.compiled import FloatArray
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
from vibroplat.model.parameters import Parameters
from vibroplat.observe.statistics import DISSIPATIONS, N_POWERS, Measures


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


def audit(ms: Measures, before: Energies, after: Energies) -> dict[str, float]:
    """Energies of a run (J), and the residuals of the balances of energy and of vertical momentum.

    Motor work + gravity's work + truncation = Δ(kinetic + elastic) + dissipation + impact losses;
    the residual is relative to the largest of the energy that motors and dampers exchanged and the
    energies, kinetic and elastic, at both ends. Springs, dampers and weight change the vertical momentum,
    and impacts must not; its residual is relative to the largest of the integral of those forces' sizes, the
    momentum and the sizes of the unbalances' momenta at both ends. Impact law ``printed`` does not keep the upper
    layer's momentum, and it shows here.
    """
    fed, taken = float(ms.work[:DISSIPATIONS].sum()), float(ms.work[DISSIPATIONS:N_POWERS].sum())
    loss = float(ms.marks["impact_loss"])
    gravity = before.gravity - after.gravity
    kinetic, elastic = after.kinetic - before.kinetic, after.elastic - before.elastic
    left = fed + gravity - taken - loss - kinetic - elastic
    scale = max(float(ms.marks["exchanged"]) + loss, *(e.kinetic + e.elastic for e in (before, after)))
    lost = float(ms.work[FORCE]) - (after.momentum - before.momentum)
    sizes = (size for e in (before, after) for size in (abs(e.momentum), e.unbalances))
    momentum = max(float(ms.work[FORCE_SIZE]), *sizes)
    return {f"{name}_work_j": float(w) for name, w in zip(POWERS, ms.work[:N_POWERS], strict=True)} | {
        "gravity_work_j": gravity,
        "impact_loss_j": loss,
        "kinetic_change_j": kinetic,
        "elastic_change_j": elastic,
        "energy_residual_j": left,
        "energy_residual": abs(left) / scale if scale > 0.0 else 0.0,
        "momentum_residual_n_s": lost,
        "momentum_residual": abs(lost) / momentum if momentum > 0.0 else 0.0,
    }
