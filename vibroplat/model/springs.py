"""Springs and dampers: what those take from them who do not need accelerations.

Each resists one of the relative coordinates x, y, φ, y_w1, y_w2 (:func:`vibroplat.model.source.holds`). Loads of the
foundation and the balances of energy and momentum take means over a time, which :mod:`vibroplat.model.balances` writes;
the steps of the variational equations take slopes.
"""

from __future__ import annotations

from typing import Any

from vibroplat.kernels.compiled import FloatArray, inlined
from vibroplat.kernels.on_demand import as_written, written
from vibroplat.model import balances
from vibroplat.model.parameters import Parameters

#: One number for each of x, y, φ, y_w1, y_w2.
Relative = tuple[float, float, float, float, float]

#: Dampers: their names in the audit, the places of their coordinates among the relative ones, and what they are.
DAMPERS = {
    f"damping_{'layers' if name == 'upper' else name}": (place, words)
    for place, (name, words) in enumerate(
        {
            "x": "damper along x",
            "y": "damper along y",
            "phi": "damper of the rotation",
            "gap": "damper between platform and lower layer",
            "upper": "damper between the layers",
        }.items()
    )
    if name in balances.damped()
}

#: Places, among what :func:`curved_means` fills, of the first force and of its square; powers stand before.
CURVED_FORCE, CURVED_SQUARE = 5, 10


@inlined
@written(balances.slopes)
def slopes(p: Parameters) -> tuple[Relative, Relative]:  # type: ignore[empty-body]
    """Find stiffnesses and dampings: what resists each relative coordinate, by the coordinate and by its rate."""


@inlined
@written(balances.curved_means)
def curved_means(
    samples: FloatArray, weights: FloatArray, nodes: int, system: int, out: FloatArray, p: Parameters
) -> None:
    """Fill what means over a time have beyond the slopes where forces are not linear, shape (15 or more,).

    These are the powers of dampers, the forces, and their squares, each of all relative coordinates. Samples are
    unknowns, whose first row is left out; weights add up to 1. Where all forces are linear, nothing is filled.
    """


@as_written
@written(balances.foundation_forces)
def foundation_forces(x: Any, y: Any, x_rate: Any, y_rate: Any, p: Parameters) -> tuple[Any, Any]:  # type: ignore[empty-body]
    """Evaluate the forces of springs and dampers into the foundation along x and y (N), arrays or numbers."""
