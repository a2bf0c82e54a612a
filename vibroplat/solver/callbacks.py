"""What SUNDIALS calls back: residual, Jacobian, right-hand side and guard as C functions.

Their user data are integers: addresses and what else a callback must know of its system. The kernels
are those of :mod:`vibroplat.physics`; a callback only finds the arrays behind the vectors.
"""

from __future__ import annotations

from typing import Any

from numba import carray  # type: ignore[attr-defined]

from vibroplat.physics.compiled import FloatArray, callback, compiled
from vibroplat.physics.foreign import call_address, pointer
from vibroplat.physics.parameters import SIZE as PARAMETERS
from vibroplat.physics.systems import evaluate_jacobian, evaluate_residual, explicit

# Places in the user data: addresses of N_VGetArrayPointer, SUNDenseMatrix_Data, the parameter vector
# and room for a matrix; the system, its size and its guard; calls counted.
VECTOR, MATRIX, PARAMETER, ROOM, SYSTEM, SIZE, GUARD, RESIDUALS, JACOBIANS = range(9)
LINKS = 9

#: SUNDIALS gives up at once on a negative value, and says which function it came from.
_OK, _NOT_FINITE = 0, -1


@compiled
def _values(vector: int, links: Any) -> FloatArray:
    return carray(pointer(call_address(links[VECTOR], (vector,))), (links[SIZE],))


@callback("int32(float64, intp, intp, intp, CPointer(int64))")
def residual(t: float, y: int, yp: int, res: int, data: Any) -> int:
    """IDAResFn."""
    links = carray(data, (LINKS,))
    links[RESIDUALS] += 1
    p = carray(pointer(links[PARAMETER]), (PARAMETERS,))
    values, slopes = _values(y, links), _values(yp, links)
    return _OK if evaluate_residual(links[SYSTEM], values, slopes, _values(res, links), p) else _NOT_FINITE


@callback("int32(float64, float64, intp, intp, intp, intp, CPointer(int64), intp, intp, intp)")
def jacobian(
    t: float, cj: float, y: int, yp: int, res: int, matrix: int, data: Any, work_1: int, work_2: int, work_3: int
) -> int:
    """IDALsJacFn; the library's matrices are stored by columns."""
    links = carray(data, (LINKS,))
    links[JACOBIANS] += 1
    n = links[SIZE]
    p = carray(pointer(links[PARAMETER]), (PARAMETERS,))
    rows = carray(pointer(links[ROOM]), (n, n))
    columns = carray(pointer(call_address(links[MATRIX], (matrix,))), (n, n))
    evaluate_jacobian(links[SYSTEM], _values(y, links), _values(yp, links), cj, rows, p)
    for i in range(n):
        for j in range(n):
            columns[j, i] = rows[i, j]
    return _OK


@callback("int32(float64, intp, intp, CPointer(int64))")
def right_hand_side(t: float, y: int, yp: int, data: Any) -> int:
    """CVRhsFn."""
    links = carray(data, (LINKS,))
    links[RESIDUALS] += 1
    p, room = carray(pointer(links[PARAMETER]), (PARAMETERS,)), carray(pointer(links[ROOM]), (links[SIZE],))
    return _OK if explicit(links[SYSTEM], _values(y, links), _values(yp, links), room, p) else _NOT_FINITE


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
