"""Consistent starts: the unknowns of a mode at the present state, with the derivatives that are asked for."""

from __future__ import annotations

from typing import Any

from numba import carray  # type: ignore[attr-defined]

from vibroplat.hybrid.modes import ATTACHED
from vibroplat.hybrid.rules import presses
from vibroplat.hybrid.state import BEYOND_MODEL, CONSISTENT, INCONSISTENT, STALE, Automaton
from vibroplat.kernels.compiled import FloatArray, callback, compiled, inlined
from vibroplat.kernels.foreign import call_int
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import SIZES, gather, scatter


@callback("int32(int64, float64, CPointer(float64), CPointer(float64), CPointer(float64), voidptr, int64)")
def start_callback(system: int, t: float, y: Any, yp: Any, ypp: Any, parameters: Any, order: int) -> int:
    """Fill F_c and first derivatives, with ``order`` DIFFERENTIATED second ones too; 0 where there are none."""
    size = SIZES[system]
    p = carray(parameters, (1,), dtype=PARAMETERS)[0]
    unknowns, rates = carray(y, (size,)), carray(yp, (size,))
    if not accelerations(system, t, unknowns, rates, p):
        return 0
    if order == CONSISTENT:
        return 1
    return 1 if second_derivatives(system, t, unknowns, rates, carray(ypp, (size,)), p) else 0


@compiled
def derivatives(h: Automaton, system: int, y: FloatArray, yp: FloatArray, ypp: FloatArray, order: int) -> bool:
    """Call :func:`start_callback` by address, so that the model is compiled into one place only."""
    addresses = (y.ctypes.data, yp.ctypes.data, ypp.ctypes.data)
    return call_int(h.start, (system, h.run.now, *addresses, h.parameters, order)) != 0


@compiled
def prepare(h: Automaton, mode: int, order: int) -> bool:
    """Prepare the start of a mode at the present state; False, with the outcome set, if there is none.

    ``order`` is CONSISTENT (F_c and first derivatives) or DIFFERENTIATED (second derivatives as well).
    """
    run = h.run
    system = run.systems[mode]
    if run.fresh[mode] >= order:
        return True
    if run.fresh[mode] == STALE:
        gather(system, run.state, run.y[mode])
    if not derivatives(h, system, run.y[mode], run.yp[mode], run.ypp[mode], order):
        run.outcome = BEYOND_MODEL if turned_far(h) else INCONSISTENT
        return False
    run.fresh[mode] = order
    return True


@compiled
def move_to(h: Automaton, system: int, y: FloatArray) -> None:
    """Make a system's unknowns the present state."""
    scatter(system, y, h.run.state)
    forget_starts(h)


@inlined
def forget_starts(h: Automaton) -> None:
    """Say that the present state is another."""
    for mode in range(3):
        h.run.fresh[mode] = STALE


@inlined
def turned_far(h: Automaton) -> bool:
    """Whether the platform has turned so far that the model may have no motion there."""
    return abs(h.run.state[2]) > h.p.safe_rotation


@inlined
def contact_force(h: Automaton) -> tuple[float, float]:
    """F_c and its rate at the prepared start of contact (N, N/s)."""
    force = SIZES[h.run.systems[ATTACHED]] - 1
    return h.run.y[ATTACHED, force], h.run.yp[ATTACHED, force]


@inlined
def pressing(h: Automaton) -> bool:
    """Whether contact holds at the prepared start of it."""
    force, rate = contact_force(h)
    return presses(force, rate, h.run.force_noise, h.run.speed)
