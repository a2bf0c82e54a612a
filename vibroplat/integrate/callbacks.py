"""What SUNDIALS calls back: residual, Jacobian and its solutions, weights, right-hand side, guard as C functions.

Their user data are integers: addresses and what else a callback must know of its system. The kernels
are those of :mod:`vibroplat.model`; a callback only finds the arrays behind the vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.scales import ROUND_OFF
from vibroplat.kernels.compiled import FloatArray, callback, compiled
from vibroplat.kernels.foreign import call_address, pointer, void_pointer
from vibroplat.kernels.linear import condense, condense_explicit, solve_condensed
from vibroplat.model.accelerations import accelerations
from vibroplat.model.equations import jacobian as evaluate_jacobian
from vibroplat.model.equations import residual as evaluate_residual
from vibroplat.model.parameters import PARAMETERS, Parameters
from vibroplat.model.systems import FULL_SIZE

# Places in the user data: addresses of N_VGetArrayPointer, the parameters, absolute tolerances and room for
# numbers; the system, its size and its guard; calls counted.
VECTOR, PARAMETER, TOLERANCES, ROOM, SYSTEM, SIZE, GUARD, RESIDUALS, JACOBIANS = range(9)
LINKS = 9

#: Place of the user data's address in the content of a SUNLinearSolver, after the three words of a dense one.
USER_DATA = 3

# Places in the room: c_j, the share of coordinates' right-hand sides, and matrices of the Jacobian's last evaluation.
CJ, SHARE, CONDENSED = 0, 1, 2
ROWS = CONDENSED + FULL_SIZE * FULL_SIZE
PARTIAL = ROWS + FULL_SIZE * FULL_SIZE
DYNAMIC = PARTIAL + FULL_SIZE * FULL_SIZE
ROOM_SIZE = DYNAMIC + FULL_SIZE * FULL_SIZE

#: SUNDIALS gives up at once on a negative value, and says which function it came from; it takes a smaller step
#: on a positive one.
_OK, _NOT_FINITE, _SINGULAR = 0, -1, 1


@compiled
def _values(vector: int, links: Any) -> FloatArray:
    return carray(pointer(call_address(links[VECTOR], (vector,))), (links[SIZE],))


@compiled
def _parameters(links: Any) -> Parameters:
    record: Parameters = carray(void_pointer(links[PARAMETER]), (1,), dtype=PARAMETERS)[0]
    return record


@callback("int32(float64, intp, intp, intp, CPointer(int64))")
def residual(t: float, y: int, yp: int, res: int, data: Any) -> int:
    """IDAResFn."""
    links = carray(data, (LINKS,))
    links[RESIDUALS] += 1
    values, slopes = _values(y, links), _values(yp, links)
    p = _parameters(links)
    return _OK if evaluate_residual(links[SYSTEM], t, values, slopes, _values(res, links), p) else _NOT_FINITE


@compiled
def _condensed(links: Any) -> FloatArray:
    size = links[SIZE]
    return carray(pointer(links[ROOM] + 8 * CONDENSED), (size - size // 2, size))


@compiled
def _matrices(links: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Room of a callback, and in it two matrices of full size and one of the dynamic rows."""
    size = links[SIZE]
    m = size - size // 2
    room = carray(pointer(links[ROOM]), (ROOM_SIZE,))
    rows = room[ROWS : ROWS + size * size].reshape((size, size))
    partial = room[PARTIAL : PARTIAL + size * size].reshape((size, size))
    return room, rows, partial, room[DYNAMIC : DYNAMIC + m * m].reshape((m, m))


@callback("int32(float64, float64, intp, intp, intp, intp, CPointer(int64), intp, intp, intp)")
def jacobian(
    t: float, cj: float, y: int, yp: int, res: int, matrix: int, data: Any, work_1: int, work_2: int, work_3: int
) -> int:
    """IDALsJacFn; leaves the library's matrix alone and prepares :func:`solve`."""
    links = carray(data, (LINKS,))
    links[JACOBIANS] += 1
    room, rows, _, dynamic = _matrices(links)
    p = _parameters(links)
    evaluate_jacobian(links[SYSTEM], t, _values(y, links), _values(yp, links), cj, rows, p)
    room[CJ], room[SHARE] = cj, 1.0
    return _OK if condense(rows, cj, dynamic, _condensed(links)) else _SINGULAR


@callback("int32(float64, intp, intp, intp, int32, CPointer(int32), float64, CPointer(int64), intp, intp, intp)")
def linear_system(
    t: float,
    y: int,
    yp: int,
    matrix: int,
    reusable: int,
    renewed: Any,
    gamma: float,
    data: Any,
    work_1: int,
    work_2: int,
    work_3: int,
) -> int:
    """CVLsLinSysFn, as :func:`jacobian`."""
    links = carray(data, (LINKS,))
    links[JACOBIANS] += 2
    room, rows, partial, dynamic = _matrices(links)
    p, cj = _parameters(links), 1.0 / gamma
    values, slopes = _values(y, links), _values(yp, links)
    evaluate_jacobian(links[SYSTEM], t, values, slopes, cj, rows, p)
    evaluate_jacobian(links[SYSTEM], t, values, slopes, 0.0, partial, p)
    room[CJ], room[SHARE] = cj, cj
    carray(renewed, (1,))[0] = 1
    return _OK if condense_explicit(rows, partial, cj, dynamic, _condensed(links)) else _SINGULAR


@callback("int32(CPointer(intp), intp)")
def setup(solver: Any, matrix: int) -> int:
    """Do nothing, as setup of a SUNLinearSolver: all was done with the Jacobian."""
    return _OK


@callback("int32(CPointer(intp), intp, intp, intp, float64)")
def solve(solver: Any, matrix: int, solution: int, right: int, tolerance: float) -> int:
    """Solve, as a SUNLinearSolver whose content ends with the address of user data."""
    content = carray(pointer(solver[0]), (USER_DATA + 1,)).view(np.int64)
    links = carray(pointer(content[USER_DATA]), (LINKS,)).view(np.int64)
    room = carray(pointer(links[ROOM]), (CONDENSED,))
    solve_condensed(_condensed(links), room[CJ], room[SHARE], _values(right, links), _values(solution, links))
    return _OK


@callback("int32(intp, intp, CPointer(int64))")
def weights(y: int, ewt: int, data: Any) -> int:
    """IDAEwtFn: one over the tolerances, absolute and that of round-off."""
    links = carray(data, (LINKS,))
    values, weight = _values(y, links), _values(ewt, links)
    atol = carray(pointer(links[TOLERANCES]), (links[SIZE],))
    for i in range(values.size):
        weight[i] = 1.0 / (ROUND_OFF * abs(values[i]) + atol[i])
    return _OK


@callback("int32(float64, intp, intp, CPointer(int64))")
def right_hand_side(t: float, y: int, yp: int, data: Any) -> int:
    """CVRhsFn."""
    links = carray(data, (LINKS,))
    links[RESIDUALS] += 1
    values, slopes = _values(y, links), _values(yp, links)
    return _OK if accelerations(links[SYSTEM], t, values, slopes, _parameters(links)) else _NOT_FINITE


@callback("int32(float64, intp, intp, CPointer(float64), CPointer(int64))")
def ida_guard(t: float, y: int, yp: int, value: Any, data: Any) -> int:
    """IDARootFn: the unknown whose fall through zero ends the mode."""
    links = carray(data, (LINKS,))
    value[0] = _values(y, links)[links[GUARD]]
    return _OK


@callback("int32(float64, intp, CPointer(float64), CPointer(int64))")
def cvode_guard(t: float, y: int, value: Any, data: Any) -> int:
    """CVRootFn: as :func:`ida_guard`."""
    links = carray(data, (LINKS,))
    value[0] = _values(y, links)[links[GUARD]]
    return _OK
