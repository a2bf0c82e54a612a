"""What SUNDIALS calls back: residual, Jacobian and its solutions, weights, guard as C functions.

Their user data are a record of addresses and what else a callback must know of its system. The kernels
are those of :mod:`vibroplat.model`; a callback only finds the arrays behind the vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.scales import ROUND_OFF
from vibroplat.kernels.compiled import FloatArray, callback, compiled, inlined
from vibroplat.kernels.foreign import call_address, pointer, void_pointer
from vibroplat.kernels.linear import condense, solve_condensed
from vibroplat.model.equations import jacobian as fill_jacobian
from vibroplat.model.equations import residual as fill_residual
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import FULL_SIZE

#: What a callback knows of its mode: addresses, the system with its size and guard, calls counted, and matrices of
#: the Jacobian's last evaluation with their c_j.
LINKS = np.dtype(
    [
        ("vector", np.int64),  # N_VGetArrayPointer
        ("parameters", np.int64),
        ("tolerances", np.int64),
        ("origin", np.float64),  # of the segment's times (s)
        ("system", np.int64),
        ("size", np.int64),
        ("guard", np.int64),
        ("residuals", np.int64),
        ("jacobians", np.int64),
        ("solver", np.int64),  # of ``condensed``
        ("cj", np.float64),
        ("condensed", np.float64, FULL_SIZE * FULL_SIZE),
        ("rows", np.float64, FULL_SIZE * FULL_SIZE),
        ("dynamic", np.float64, FULL_SIZE * FULL_SIZE),
    ],
    align=True,
)

#: Place of the links' address in the content of a SUNLinearSolver, after the three words of a dense one.
USER_DATA = 3

#: SUNDIALS gives up at once on a negative value, and says which function it came from; it takes a smaller step
#: on a positive one.
_OK, _NOT_FINITE, _SINGULAR = 0, -1, 1


@compiled
def _values(vector: int, links: Any) -> FloatArray:
    return carray(pointer(call_address(links.vector, (vector,))), (links.size,))


@inlined
def _parameters(links: Any) -> Any:
    return carray(void_pointer(links.parameters), (1,), dtype=PARAMETERS)[0]


@callback("int32(float64, intp, intp, intp, voidptr)")
def residual(t: float, y: int, yp: int, res: int, data: Any) -> int:
    """IDAResFn."""
    links = carray(data, (1,), dtype=LINKS)[0]
    links.residuals += 1
    values, slopes, p = _values(y, links), _values(yp, links), _parameters(links)
    whole = fill_residual(links.system, links.origin + t, values, slopes, _values(res, links), p)
    return _OK if whole else _NOT_FINITE


@compiled
def _condensed(links: Any) -> FloatArray:
    return carray(pointer(links.solver), (links.size - links.size // 2, links.size))


@compiled
def _matrices(links: Any) -> tuple[FloatArray, FloatArray]:
    """Matrices of full size and of the dynamic rows."""
    size = links.size
    m = size - size // 2
    rows = links.rows[: size * size].reshape((size, size))
    return rows, links.dynamic[: m * m].reshape((m, m))


@callback("int32(float64, float64, intp, intp, intp, intp, voidptr, intp, intp, intp)")
def jacobian(
    t: float, cj: float, y: int, yp: int, res: int, matrix: int, data: Any, work_1: int, work_2: int, work_3: int
) -> int:
    """IDALsJacFn; leaves the library's matrix alone and prepares :func:`solve`."""
    links = carray(data, (1,), dtype=LINKS)[0]
    links.jacobians += 1
    rows, dynamic = _matrices(links)
    p = _parameters(links)
    fill_jacobian(links.system, links.origin + t, _values(y, links), _values(yp, links), cj, rows, p)
    links.cj = cj
    return _OK if condense(rows, cj, dynamic, _condensed(links)) else _SINGULAR


@callback("int32(CPointer(intp), intp)")
def setup(solver: Any, matrix: int) -> int:
    """Do nothing, as setup of a SUNLinearSolver: all was done with the Jacobian."""
    return _OK


@callback("int32(CPointer(intp), intp, intp, intp, float64)")
def solve(solver: Any, matrix: int, solution: int, right: int, tolerance: float) -> int:
    """Solve, as a SUNLinearSolver whose content ends with the address of the links."""
    content = carray(pointer(solver[0]), (USER_DATA + 1,)).view(np.int64)
    links = carray(void_pointer(content[USER_DATA]), (1,), dtype=LINKS)[0]
    solve_condensed(_condensed(links), links.cj, _values(right, links), _values(solution, links))
    return _OK


@callback("int32(intp, intp, voidptr)")
def weights(y: int, ewt: int, data: Any) -> int:
    """IDAEwtFn: one over the tolerances, absolute and that of round-off."""
    links = carray(data, (1,), dtype=LINKS)[0]
    values, weight = _values(y, links), _values(ewt, links)
    atol = carray(pointer(links.tolerances), (links.size,))
    for i in range(values.size):
        weight[i] = 1.0 / (ROUND_OFF * abs(values[i]) + atol[i])
    return _OK


@callback("int32(float64, intp, intp, CPointer(float64), voidptr)")
def guard(t: float, y: int, yp: int, value: Any, data: Any) -> int:
    """IDARootFn: the unknown whose fall through zero ends the mode."""
    links = carray(data, (1,), dtype=LINKS)[0]
    value[0] = _values(y, links)[links.guard]
    return _OK
