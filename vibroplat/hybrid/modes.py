"""The automaton of a run on one screen.

=========  ===================================  =========  ==========================================================
mode       unknowns                             guard      reset where the guard falls through zero
=========  ===================================  =========  ==========================================================
bare       x, y, φ, φ₁, φ₂ and rates            none       none
attached   the same, y_w2 and rate, F_c         F_c        liftoff: to flight; a touch (F_c rises again): goes on
flight     the same, y_w1, y_w2 and rates       gap y_w1   impact: with a rebound to flight, without one to attached
                                                           or, where nothing presses the layer on, to flight;
                                                           chatter is summed up: to attached or flight
=========  ===================================  =========  ==========================================================

With transport contact is stick, slip+ or slip−, each with two guards. All guards are linear forms of unknowns
(:func:`guard_form`):

=========  ===================================  =============================  ======================================
mode       unknowns                             guards                         reset
=========  ===================================  =============================  ======================================
stick      as attached, s, F_t                  μ_s F_c ∓ F_t                  slip to slip∓; liftoff if both fall
slip, σ    the same                             F_c; σ ṡ                       liftoff; stick, reversal, or a touch
flight     as above, s                          gap y_w1                       impact to flight, stick or slip
=========  ===================================  =============================  ======================================

In any mode a corner of the drive's program is an event as well: integration restarts there, and contact ends if the
jump of the torques leaves no force to hold it.

One layer has no y_w2. The equations of a mode with its layers are a :class:`vibroplat.model.systems.System`. What a
guard's fall means is decided in :mod:`vibroplat.hybrid.transitions`, pure functions of numbers; the resets themselves
are in :mod:`vibroplat.hybrid.resets`; :func:`vibroplat.hybrid.loop.end_segment` picks a mode's reset.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.config.coordinates import Mode
from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.parameters import Parameters
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, GAP, SENSE, STICKS, SYSTEMS

# Modes as compiled code knows them. Integers of numpy: a function that is called with them is compiled once, not once
# for each.
_NUMBERS: Any = np.arange(7)
ATTACHED, FLIGHT, BARE, STICK, SLIP_PLUS, SLIP_MINUS = (_NUMBERS[mode] for mode in Mode)

#: Kinds of events; that of a drive is a corner of its program.
LIFTOFF, IMPACT, CHATTER, SUPPLY, SLIP, STOP, REVERSAL = _NUMBERS
KINDS = ("liftoff", "impact", "chatter", "drive", "slip", "stick", "reversal")


#: Guards by the number of the system: their places among the unknowns, with transport that of the first unknown of the
#: first guard; −1 for none.
GUARDS = np.array([{Mode.BARE: -1, Mode.FLIGHT: GAP}.get(system.mode, system.differential) for system in SYSTEMS])
#: How many guards a system has.
COUNTS = np.array([(system.layers > 0) + (system.slides and system.algebraic) for system in SYSTEMS])
#: Modes by the number of the system.
MODES = np.array([int(system.mode) for system in SYSTEMS])


#: A linear form of unknowns: two places with their weights.
Form = tuple[int, float, int, float]


@compiled
def guard_form(system: int, which: int, p: Parameters) -> Form:
    """Return a guard of a system with material as a linear form.

    On a smooth deck slip has no sense, and the form of its rate is 0.
    """
    force, sense = DIFFERENTIAL[system], SENSE[system]
    if not ALGEBRAIC[system]:
        return GAP, 1.0, GAP, 0.0
    if STICKS[system]:
        return force, p.static_friction, force + 1, -1.0 if which == 0 else 1.0
    if which == 0:
        return force, 1.0, force, 0.0
    return force - 1, sense if p.static_friction > 0.0 else 0.0, force, 0.0


@inlined
def guard_value(system: int, which: int, y: FloatArray, p: Parameters) -> float:
    """Evaluate a guard of a system with material."""
    first, weight, second, other = guard_form(system, which, p)
    return weight * y[first] + other * y[second]
