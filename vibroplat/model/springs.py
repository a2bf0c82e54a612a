"""Springs and dampers: what those take from them who do not need accelerations.

Each resists one of the relative coordinates x, y, φ, y_w1, y_w2 (:func:`vibroplat.model.source.holds`). Loads of the
foundation and the balances of energy and momentum take means over a time, which :mod:`vibroplat.model.balances` writes;
the steps of the variational equations take slopes.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
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
@written(balances.has_beyond)
def has_beyond(p: Parameters) -> bool:  # type: ignore[empty-body]
    """Whether forces are more than the slopes, which :func:`curved_means` and :func:`add_pulls_beyond` add."""


@compiled
@written(balances.curved_means)
def curved_means(
    samples: FloatArray, weights: FloatArray, nodes: int, system: int, out: FloatArray, p: Parameters
) -> None:
    """Fill what means over a time have beyond the slopes where forces are not linear, shape (15 or more,).

    These are the powers of dampers, the forces, and their squares, each of all relative coordinates. Samples are
    unknowns, whose first row is left out; weights add up to 1. Where all forces are linear, nothing is filled.
    """


@compiled
@written(balances.pulls_beyond)
def add_pulls_beyond(
    samples: FloatArray, row: int, system: int, quantities: FloatArray, first: int, p: Parameters
) -> None:
    """Add what forces into the foundation and their moment are beyond the slopes to columns ``first`` on of a row."""


@inlined
@written(balances.between_layers)
def between_layers(y: FloatArray, system: int, p: Parameters) -> float:  # type: ignore[empty-body]
    """Evaluate the force between the layers over the upper one's mass (m/s²)."""


@written(balances.foundation_forces)
def forces_into_foundation(  # type: ignore[empty-body]
    x: Any, y: Any, phi: Any, x_rate: Any, y_rate: Any, phi_rate: Any, p: Parameters
) -> tuple[Any, Any, Any]:
    """Evaluate the forces of springs and dampers into the foundation along x and y (N), and their moment (N·m)."""


#: The same as a kernel, and for arrays and numbers of Python.
foundation_forces_at = inlined(forces_into_foundation)
foundation_forces: Any = as_written(forces_into_foundation)

#: Whether these three are not linear in coordinates and rates.
BENT = np.array(balances.bent())


@as_written
@written(balances.resist)
def resist(  # type: ignore[empty-body]
    q: Sequence[float], v: Sequence[float], p: SimpleNamespace
) -> tuple[Relative, tuple[Relative, ...]]:
    """Evaluate what resists the relative coordinates, and its slopes by them, with plain parameters."""
