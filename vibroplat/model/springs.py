"""Springs and dampers: what those take from them who do not need accelerations.

Each resists one of the relative coordinates x, y, φ, y_w1, y_w2 (:func:`vibroplat.model.source.holds`). Loads of the
foundation and the balances of energy and momentum take means over a time, which :mod:`vibroplat.model.balances` writes;
the steps of the variational equations take slopes.
"""

from __future__ import annotations

from typing import Any

from vibroplat.kernels.compiled import FloatArray, inlined
from vibroplat.kernels.on_demand import as_written, written
from vibroplat.model import balances, straight
from vibroplat.model.parameters import Parameters

#: One number for each of x, y, φ, y_w1, y_w2.
Relative = tuple[float, float, float, float, float]

#: Dampers: their names in the audit, and what they are.
DAMPERS = {
    f"damping_{'layers' if name == 'upper' else name}": words
    for name, words in {
        "x": "damper along x",
        "y": "damper along y",
        "phi": "damper of the rotation",
        "gap": "damper between platform and lower layer",
        "upper": "damper between the layers",
    }.items()
    if balances.dissipated(name)
}


@inlined
@written(straight.slopes)
def slopes(p: Parameters) -> tuple[Relative, Relative]:  # type: ignore[empty-body]
    """Find stiffnesses and dampings: what resists each relative coordinate, by the coordinate and by its rate."""


@inlined
@written(balances.curved_means)
def curved_means(
    samples: FloatArray, weights: FloatArray, nodes: int, system: int, out: FloatArray, p: Parameters
) -> None:
    """Fill the means of terms of forces that are not linear, which the other functions take in row 4 of ``means``.

    Samples are unknowns of the system; the first row is left out. Weights add up to 1.
    """


@inlined
@written(balances.dissipation)
def dissipation(means: FloatArray, system: int, out: FloatArray, p: Parameters) -> None:
    """Fill the mean powers that :data:`DAMPERS` take (W).

    ``means`` are those of the unknowns, of their squares, of their sizes, of products of x, y, φ with their rates, and
    of what is not linear.
    """


@inlined
@written(balances.resisting_forces)
def resisting_forces(  # type: ignore[empty-body]
    means: FloatArray, n: int, p: Parameters
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Find the mean forces that resist x and y (N), each with the mean of the sizes of its terms."""


@inlined
@written(balances.add_foundation_forces)
def add_foundation_forces(sums: FloatArray, means: FloatArray, n: int, duration: float, p: Parameters) -> None:
    """Add forces into the foundation along x and y and the moment, and then their squares, over a time (s)."""


@as_written
@written(balances.foundation_forces)
def foundation_forces(x: Any, y: Any, x_rate: Any, y_rate: Any, p: Parameters) -> tuple[Any, Any]:  # type: ignore[empty-body]
    """Evaluate the forces of springs and dampers into the foundation along x and y (N), arrays or numbers."""
