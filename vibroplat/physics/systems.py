"""The five systems of equations: which unknowns each has, its kernels, and how a scene picks them.

A *system* is a mode together with the number of layers. States cross between systems as the *full
state* of 14 numbers — the seven coordinates of :data:`vibroplat.scene.COORDINATES`, then their rates —
in which what a scene does not have is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vibroplat.physics import residuals as r
from vibroplat.physics.compiled import compiled
from vibroplat.physics.parameters import FloatArray
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


@compiled
def consistent(system: int, differential: int, y: FloatArray, yp: FloatArray, ypp: FloatArray, p: FloatArray) -> float:
    """Make (y, y′) consistent by a direct linear solve and find the next derivative.

    F(y, y′) is linear in z = (y′ of the differential unknowns, F_c), so one solve with A = ∂F/∂z gives
    z exactly; differentiating F = 0 along the motion, A z′ + (∂F/∂y) y′ = 0 gives y″ and F_c′.

    Parameters
    ----------
    system, differential
        Number of the system and of its differential unknowns, 2n.
    y, yp, ypp
        Shape (size,). The differential part of ``y`` is read; F_c in ``y`` and all of ``yp`` and
        ``ypp`` are filled. F_c″ is not needed and set to 0.

    Returns
    -------
    float
        Largest residual that is left, relative to the largest sum of the sizes of a row's terms: the
        backward error of the solve, some 1e-16; nan if anything is not finite.
    """
    size = y.size
    res, jac_0, jac_1 = np.empty(size), np.empty((size, size)), np.empty((size, size))
    y[differential:] = 0.0
    yp[:] = 0.0
    if not (r.finite(y) and evaluate_residual(system, y, yp, res, p)):
        return np.nan
    evaluate_jacobian(system, y, yp, 0.0, jac_0, p)
    sizes = np.abs(jac_0) @ np.abs(y)
    evaluate_jacobian(system, y, yp, 1.0, jac_1, p)
    lead = jac_1 - jac_0
    lead[:, differential:] = jac_0[:, differential:]
    z = np.linalg.solve(lead, -res)
    y[differential:] = z[differential:]
    yp[:differential] = z[:differential]
    sizes += np.abs(lead) @ np.abs(z)
    evaluate_jacobian(system, y, yp, 0.0, jac_0, p)
    yp[differential:] = 0.0
    z = np.linalg.solve(lead, -(jac_0 @ yp))
    yp[differential:] = z[differential:]
    ypp[:] = z
    ypp[differential:] = 0.0
    if not evaluate_residual(system, y, yp, res, p) or not np.isfinite(np.sum(z)):
        return np.nan
    largest = np.max(sizes)
    return np.max(np.abs(res)) / largest if largest > 0.0 else 0.0
