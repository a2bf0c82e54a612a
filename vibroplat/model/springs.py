"""Springs and dampers: every linear force of the machine, written once.

Each acts on one of the relative coordinates x, y, φ, y_w1, y_w2 and depends on that coordinate and its rate alone. Rows
of the equations and terms of series take the forces themselves; Jacobian, energies, powers, loads and the steps of the
variational equations take their slopes.

To add a force, add its coefficient to :mod:`vibroplat.model.parameters` and its term to :func:`restoring`. A damper on
a coordinate that has had none gets a line in :data:`DAMPERS` as well.
"""

from __future__ import annotations

from vibroplat.kernels.compiled import compiled, fused_inline
from vibroplat.model.parameters import Parameters

#: One number for each of x, y, φ, y_w1, y_w2.
Relative = tuple[float, float, float, float, float]

#: Dampers: their names in the audit, the places of their coordinates among the relative ones, and what they are.
DAMPERS = {
    "damping_x": (0, "damper along x"),
    "damping_y": (1, "damper along y"),
    "damping_phi": (2, "damper of the rotation"),
    "damping_layers": (4, "damper between the layers"),
}


@fused_inline
def restoring(q: Relative, v: Relative, p: Parameters) -> Relative:
    """Evaluate the forces with which springs and dampers resist coordinates and rates (N, N, N·m, N, N/kg).

    What resists y_w1 pulls the lower layer to the platform, and the platform to it; the last one is S/m_w2. Zeros are
    literal: the compiler leaves out what is subtracted of them.
    """
    return (
        p.damping_x * v[0] + p.stiffness_x * q[0],
        p.damping_y * v[1] + p.stiffness_y * q[1],
        p.damping_phi * v[2] + p.stiffness_phi * q[2],
        0.0,
        p.layer_stiffness * q[4] + p.layer_damping * v[4],
    )


@compiled
def slopes(p: Parameters) -> tuple[Relative, Relative]:
    """Find stiffnesses and dampings: the slopes of :func:`restoring` by coordinates and by rates."""
    ones, none = (1.0, 1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0, 0.0)
    return restoring(ones, none, p), restoring(none, ones, p)
