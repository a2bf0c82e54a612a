"""Rows of the differential-algebraic equations F(t, y, y′) = 0, their Jacobian and rates, as kernels.

The equations are those of :mod:`vibroplat.model.source`, from which :mod:`vibroplat.model.straight` writes them.

====================  ==================================================  ========
system                unknowns                                            how many
====================  ==================================================  ========
bare                  x, y, φ, φ₁, φ₂ and rates                           10
attached, one layer   the same and F_c                                    11
attached, two layers  x, y, φ, φ₁, φ₂, y_w2 and rates, F_c                13
flight, one layer     x, y, φ, φ₁, φ₂, y_w1 and rates                     12
flight, two layers    x, y, φ, φ₁, φ₂, y_w1, y_w2 and rates               14
====================  ==================================================  ========

Of n coordinates, the first n rows say that rates are their derivatives; the dynamic rows after them are inertia
times acceleration less forces. While attached, gap and gap rate are zero and are not integrated; the position
constraint is reduced to acceleration level, so that F_c is an algebraic unknown of index 1 and the lower layer's row is
its equation (paper (5), (6); there the damper of (6b) has the wrong sign).
"""

from __future__ import annotations

from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.kernels.on_demand import written
from vibroplat.model import straight
from vibroplat.model.parameters import Parameters
from vibroplat.model.platform import is_definite
from vibroplat.model.systems import DIFFERENTIAL


@compiled
def finite(values: FloatArray) -> bool:
    """Whether no value is nan or infinite."""
    total = 0.0
    for value in values:
        total += value * 0.0
    return total == 0.0


@compiled
def residual(system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, p: Parameters) -> bool:
    """Fill F(t, y, y′) of the system with this number.

    Returns False, which an integrator must not pass over, if anything is not finite or if the platform has turned to
    where the mass matrix is not positive definite (:func:`vibroplat.model.platform.is_definite`).
    """
    rows(system, t, y, yp, res, p)
    return finite(res) and is_definite(y, p)


@compiled
def rows(system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, p: Parameters) -> None:
    """Fill the rows of F(t, y, y′)."""
    all_rows(system, t, y, yp, res, p)


@inlined
@written(straight.all_rows)
def all_rows(system: int, t: float, y: FloatArray, yp: FloatArray, res: FloatArray, p: Parameters) -> None:
    """Do as :func:`rows`."""


@compiled
def jacobian(system: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: Parameters) -> None:
    """Fill ∂F/∂y + c_j ∂F/∂y′ of the system with this number, shape (size, size)."""
    n = DIFFERENTIAL[system] // 2
    for i in range(n):
        for j in range(y.size):
            jac[i, j] = 0.0
        jac[i, i] = cj
        jac[i, n + i] = -1.0
    dynamic_jacobian(system, t, y, yp, cj, jac, p)


@inlined
@written(straight.dynamic_jacobian)
def dynamic_jacobian(
    system: int, t: float, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: Parameters
) -> None:
    """Fill those of its rows that are dynamic."""


@inlined
@written(straight.loads_on_rows)
def loads(system: int, t: float, y: FloatArray, b: FloatArray, p: Parameters) -> None:
    """Fill ``b`` from place n on with forces: minus the dynamic rows without accelerations and forces of contact."""


@compiled
@written(straight.rates_of_rows)
def rates_of_rows(system: int, t: float, y: FloatArray, yp: FloatArray, b: FloatArray, p: Parameters) -> None:
    """Fill ``b`` from place n on with minus the rates of the dynamic rows at constant y″ and forces of contact."""


@compiled
@written(straight.mass_matrix)
def mass_matrix(system: int, y: FloatArray, mass: FloatArray, p: Parameters) -> None:
    """Fill what multiplies the n accelerations in the dynamic rows without that of F_c, shape (n, n) or more."""
