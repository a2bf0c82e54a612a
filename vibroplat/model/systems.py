"""The five systems of equations: which unknowns each has, its kernels, and how a scene picks them.

A *system* is a mode together with the number of layers. States cross between systems as the *full
state* of 14 numbers — the seven coordinates of :data:`vibroplat.scene.COORDINATES`, then their rates —
in which what a scene does not have is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import carray  # type: ignore[attr-defined]

from vibroplat.kernels.compiled import callback, compiled
from vibroplat.kernels.linear import factorize, substitute
from vibroplat.model import residuals as r
from vibroplat.model.parameters import SIZE as PARAMETERS
from vibroplat.model.parameters import FloatArray
from vibroplat.model.platform import solve_mass_matrix
from vibroplat.scene import Mode, Scene

FULL_SIZE = 14
GAP, GAP_RATE = 5, 12  # places in the full state

BARE, ATTACHED_ONE, ATTACHED_TWO, FLIGHT_ONE, FLIGHT_TWO = range(5)


@dataclass(frozen=True)
class System:
    """One system of equations.

    Attributes
    ----------
    index
        The number by which compiled code knows the system.
    places
        Places of the differential unknowns in the full state, shape (2n,).
    guard
        Index of the unknown whose fall through zero ends the mode (F_c or the gap); None without one.
    """

    index: int
    mode: Mode
    layers: int
    places: npt.NDArray[np.int64]
    guard: int | None
    residual: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], bool]
    jacobian: Callable[[FloatArray, FloatArray, float, FloatArray, FloatArray], None]

    @property
    def differential(self) -> int:
        """Number of differential unknowns, 2n."""
        return len(self.places)

    @property
    def algebraic(self) -> bool:
        """Whether F_c is an unknown (then the last)."""
        return self.mode is Mode.ATTACHED

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.differential + self.algebraic

    def unknowns(self, state: FloatArray) -> FloatArray:
        """Pick this system's unknowns from a full state; F_c is left at 0."""
        y = np.zeros(self.size)
        y[: self.differential] = state[self.places]
        return y

    def full(self, y: FloatArray) -> FloatArray:
        """Return the full states of unknowns of shape (…, size), as shape (…, 14)."""
        state = np.zeros((*y.shape[:-1], FULL_SIZE))
        state[..., self.places] = y[..., : self.differential]
        return state


def _places(*coordinates: int) -> npt.NDArray[np.int64]:
    return np.array([*coordinates, *(7 + c for c in coordinates)], dtype=np.int64)


SYSTEMS: tuple[System, ...] = (
    System(BARE, Mode.BARE, 0, _places(0, 1, 2, 3, 4), None, r.bare_residual, r.bare_jacobian),
    System(
        ATTACHED_ONE,
        Mode.ATTACHED,
        1,
        _places(0, 1, 2, 3, 4),
        10,
        r.attached_one_residual,
        r.attached_one_jacobian,
    ),
    System(
        ATTACHED_TWO,
        Mode.ATTACHED,
        2,
        _places(0, 1, 2, 3, 4, 6),
        12,
        r.attached_two_residual,
        r.attached_two_jacobian,
    ),
    System(
        FLIGHT_ONE,
        Mode.FLIGHT,
        1,
        _places(0, 1, 2, 3, 4, 5),
        5,
        r.flight_one_residual,
        r.flight_one_jacobian,
    ),
    System(
        FLIGHT_TWO,
        Mode.FLIGHT,
        2,
        _places(0, 1, 2, 3, 4, 5, 6),
        5,
        r.flight_two_residual,
        r.flight_two_jacobian,
    ),
)


def systems(scene: Scene) -> dict[Mode, System]:
    """Return the systems of a scene by mode; a scene without contact has the bare one alone."""
    return {s.mode: s for s in SYSTEMS if s.layers == scene.layers and s.mode in scene.modes}


#: c_j beside which ∂F/∂y vanishes, a power of two: with 1 the inertia of a small rotor would be lost in the slope of
#: a strong motor's torque.
DOMINANT = 2.0**100


@compiled
def evaluate_residual(system: int, y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill the residual of the system with this number; for restarts, where the mode is data."""
    if system == BARE:
        return r.bare_residual(y, yp, res, p)
    if system == ATTACHED_ONE:
        return r.attached_one_residual(y, yp, res, p)
    if system == ATTACHED_TWO:
        return r.attached_two_residual(y, yp, res, p)
    if system == FLIGHT_ONE:
        return r.flight_one_residual(y, yp, res, p)
    return r.flight_two_residual(y, yp, res, p)


@compiled
def evaluate_jacobian(system: int, y: FloatArray, yp: FloatArray, cj: float, jac: FloatArray, p: FloatArray) -> None:
    """Fill the Jacobian of the system with this number."""
    if system == BARE:
        r.bare_jacobian(y, yp, cj, jac, p)
    elif system == ATTACHED_ONE:
        r.attached_one_jacobian(y, yp, cj, jac, p)
    elif system == ATTACHED_TWO:
        r.attached_two_jacobian(y, yp, cj, jac, p)
    elif system == FLIGHT_ONE:
        r.flight_one_jacobian(y, yp, cj, jac, p)
    else:
        r.flight_two_jacobian(y, yp, cj, jac, p)


#: The same facts by number, for compiled code: places in the full state, then −1.
SIZES = np.array([s.size for s in SYSTEMS])
DIFFERENTIAL = np.array([s.differential for s in SYSTEMS])
GUARDS = np.array([-1 if s.guard is None else s.guard for s in SYSTEMS])
PLACES = np.array([[*s.places, *[-1] * (FULL_SIZE - s.differential)] for s in SYSTEMS])


@compiled
def gather(system: int, state: FloatArray, y: FloatArray) -> None:
    """Fill the differential unknowns of a system from a full state."""
    for i in range(DIFFERENTIAL[system]):
        y[i] = state[PLACES[system, i]]


@compiled
def spread(system: int, y: FloatArray, state: FloatArray) -> None:
    """Fill a full state from a system's unknowns; what the system does not have is 0."""
    for i in range(FULL_SIZE):
        state[i] = 0.0
    for i in range(DIFFERENTIAL[system]):
        state[PLACES[system, i]] = y[i]


@compiled
def consistent(system: int, y: FloatArray, yp: FloatArray, ypp: FloatArray, p: FloatArray) -> float:
    """Make (y, y′) consistent by a direct linear solve and find the next derivative.

    F(y, y′) is linear in z = (accelerations, F_c), so one solve with A = ∂F/∂z gives z exactly;
    differentiating F = 0 along the motion, A z′ + (∂F/∂y) y′ = 0 gives y″ and F_c′.

    Parameters
    ----------
    system
        Number of the system.
    y, yp, ypp
        Shape (size,). The differential part of ``y`` is read; F_c in ``y`` and all of ``yp`` and
        ``ypp`` are filled. F_c″ is not needed and set to 0.

    Returns
    -------
    float
        Largest residual that is left, relative to the largest sum of the sizes of a row's terms: the
        backward error of the solve, some 1e-16; nan if anything is not finite or A is singular.
    """
    size, differential = y.size, DIFFERENTIAL[system]
    n = differential // 2
    m = size - n
    res, z, rows = np.empty(size), np.empty(m), np.empty(m, dtype=np.int64)
    partial, lead, factors = np.empty((size, size)), np.empty((size, size)), np.empty((m, m))
    if not (dynamics(system, y, yp, res, partial, lead, factors, z, p) and factorize(factors, rows)):
        return np.nan
    substitute(factors, rows, z)
    largest = largest_row(partial, y, differential, lead, z)
    for i in range(m):
        if i < n:
            yp[n + i] = z[i]
        else:
            y[n + i] = z[i]
    if not evaluate_residual(system, y, yp, res, p):
        return np.nan
    evaluate_jacobian(system, y, yp, 0.0, partial, p)
    for i in range(m):
        z[i] = 0.0
        for j in range(differential):
            z[i] -= partial[n + i, j] * yp[j]
    substitute(factors, rows, z)
    for i in range(n):
        ypp[i], ypp[n + i] = yp[n + i], z[i]
    for i in range(n, m):
        yp[n + i], ypp[n + i] = z[i], 0.0
    if not r.finite(z):
        return np.nan
    worst = 0.0
    for i in range(size):
        worst = max(worst, abs(res[i]))
    return worst / largest if largest > 0.0 else 0.0


@compiled
def dynamics(
    system: int,
    y: FloatArray,
    yp: FloatArray,
    res: FloatArray,
    partial: FloatArray,
    lead: FloatArray,
    factors: FloatArray,
    z: FloatArray,
    p: FloatArray,
) -> bool:
    """Fill ∂F/∂y, and of the dynamic rows A = ∂F/∂z, twice, and −F at z = 0 in ``z``.

    F_c, accelerations and derivatives of F_c are set to 0. Returns False if anything is not finite.
    """
    differential, m = DIFFERENTIAL[system], z.size
    n = differential // 2
    for i in range(n):
        yp[i], yp[n + i] = y[n + i], 0.0
    for i in range(differential, y.size):
        y[i], yp[i] = 0.0, 0.0
    if not (r.finite(y) and evaluate_residual(system, y, yp, res, p)):
        return False
    evaluate_jacobian(system, y, yp, 0.0, partial, p)
    evaluate_jacobian(system, y, yp, DOMINANT, lead, p)
    for i in range(m):
        z[i] = -res[n + i]
        for j in range(m):
            if n + j >= differential:
                lead[i, j] = partial[n + i, n + j]
            else:
                lead[i, j] = (lead[n + i, n + j] - partial[n + i, n + j]) / DOMINANT
            factors[i, j] = lead[i, j]
    return True


@compiled
def largest_row(partial: FloatArray, y: FloatArray, differential: int, lead: FloatArray, z: FloatArray) -> float:
    """Largest sum of the sizes of a dynamic row's terms."""
    largest, n = 0.0, differential // 2
    for i in range(z.size):
        terms = 0.0
        for j in range(differential):
            terms += abs(partial[n + i, j] * y[j])
        for j in range(z.size):
            terms += abs(lead[i, j] * z[j])
        largest = max(largest, terms)
    return largest


@callback("float64(int64, CPointer(float64), CPointer(float64), CPointer(float64), CPointer(float64))")
def consistent_callback(system: int, y: Any, yp: Any, ypp: Any, p: Any) -> float:
    """:func:`consistent` on pointers, with the full length of y, y′ and y″ behind them."""
    size = SIZES[system]
    arrays = (carray(y, (size,)), carray(yp, (size,)), carray(ypp, (size,)))
    return consistent(system, *arrays, carray(p, (PARAMETERS,)))


@compiled
def explicit(system: int, y: FloatArray, yp: FloatArray, res: FloatArray, p: FloatArray) -> bool:
    """Fill y′ = f(y) of a system without algebraic unknown; False if it is not finite.

    The residual at zero accelerations is −(forces); platform and exciters are solved by their mass
    matrix, and each layer's row is the sum of the accelerations it is carried by.

    Parameters
    ----------
    y, yp, res
        Shape (size,): read, filled, and overwritten.
    """
    n = y.size // 2
    for i in range(n):
        yp[i], yp[n + i] = y[n + i], 0.0
    if not evaluate_residual(system, y, yp, res, p):
        return False
    for i in range(n):
        yp[n + i] = -res[n + i]
    solve_mass_matrix(yp[n:], y, p)
    carried = yp[n + 1]
    for i in range(5, n):
        yp[n + i] -= carried
        carried += yp[n + i]
    return r.finite(yp)
