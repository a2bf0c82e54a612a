"""The audit of a part of a motion: the balances of energy and of vertical momentum."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vibroplat.columns import Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.energy import FORCE, FORCE_SIZE, POWERS, energies
from vibroplat.model.parameters import Parameters
from vibroplat.observe.statistics import DISSIPATIONS, N_POWERS, Measures

#: Outcome of a motion that reached its end but does not keep the balances.
INACCURATE = "inaccurate"

#: Largest energy residual over the root of the tolerance, and its least and largest value. The largest residuals of 35
#: scenes (the paper's time histories, the reference runs, each kind of scene) in 2 to 60 s were 0.13, 0.027 and 0.0016
#: at tolerances 1e-2, 1e-3 and 1e-4, and 7e-10 at 1e-12: a quarter of the limit or less. Of 560 random scenes, none
#: exceeded it at 1e-6 (largest 0.037) and 2 % at 1e-2, where they had lost half of their energy and more.
ENERGY, LEAST_ENERGY, LARGEST_ENERGY = 5.0, 0.05, 0.5
#: Largest momentum residual over the limit of the energy residual. In the same scenes it was at most 0.006 at
#: tolerance 1e-2 and 7e-4 at 1e-3; of the random ones 0.072 and 0.0046.
MOMENTUM = 0.2

#: The audit of a whole run or point.
AUDIT: Columns = {
    "motor_work_j": Column("work of both motors"),
    "truncation_work_j": Column(
        "work without a physical source", "the exciter axes turn with the platform to first order in phi only"
    ),
    "damping_x_work_j": Column("energy taken by the damper along x"),
    "damping_y_work_j": Column("energy taken by the damper along y"),
    "damping_phi_work_j": Column("energy taken by the damper of the rotation"),
    "damping_layers_work_j": Column("energy taken by the damper between the layers"),
    "resistance_work_j": Column("energy taken by the resistance of both exciters"),
    "gravity_work_j": Column("work of gravity"),
    "impact_loss_j": Column("energy lost in impacts and latches"),
    "kinetic_change_j": Column("change of the kinetic energy"),
    "elastic_change_j": Column("change of the elastic energy"),
    "energy_residual_j": Column(
        "what is left of the energy balance",
        "work of motors and gravity + truncation - dampers - resistance - impacts - changes of energy",
    ),
    "energy_residual": Column(
        "relative energy residual", "over the larger of the energy exchanged and the energies at both ends"
    ),
    "momentum_residual_n_s": Column("what is left of the balance of vertical momentum"),
    "momentum_residual": Column(
        "relative momentum residual", "over the largest of the forces' integral and the momenta at both ends"
    ),
}


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
        return cls(*energies(state, p))


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


def inaccuracy(found: Mapping[str, Any], scene: Scene) -> str:
    """Say which residual of the audit is beyond its limit, and what to do; empty if none is.

    Parameters
    ----------
    found
        Measures of a motion of the scene, ``energy_residual`` and ``momentum_residual`` among them; None has no limit.
    """
    tolerance = scene.solver.tolerance
    energy = min(max(ENERGY * math.sqrt(tolerance), LEAST_ENERGY), LARGEST_ENERGY)
    limits = {"energy": energy}
    if scene.contact.impact_law != "printed":  # which does not keep the upper layer's momentum
        limits["momentum"] = MOMENTUM * energy
    for name, limit in limits.items():
        residual = found[f"{name}_residual"]
        if residual is not None and residual > limit:
            return (
                f"{name} residual {residual:.3g} is beyond {limit:.3g}, the limit at tolerance {tolerance:g}; lower "
                "solver.tolerance, and check the scene for sizes that are far apart"
            )
    return ""
