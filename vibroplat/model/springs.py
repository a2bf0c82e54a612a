"""Springs and dampers of the machine, as those take them who need no more than their slopes at rest.

Each acts on one of the relative coordinates x, y, φ, y_w1, y_w2. Energies, powers, loads and the steps of the
variational equations take the slopes; rows and series of :mod:`vibroplat.model.source` have the forces. A damper on a
coordinate that has had none gets a line in :data:`DAMPERS`.
"""

from __future__ import annotations

from vibroplat.kernels.compiled import inlined
from vibroplat.kernels.on_demand import written
from vibroplat.model import straight
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


@inlined
@written(straight.slopes)
def slopes(p: Parameters) -> tuple[Relative, Relative]:  # type: ignore[empty-body]
    """Find stiffnesses and dampings: what resists each relative coordinate, by the coordinate and by its rate."""
