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
from vibroplat.model.systems import GAP, SYSTEMS

# Modes as compiled code knows them. Integers of numpy: a function that is called with them is compiled once, not once
# for each.
_NUMBERS: Any = np.arange(4)
ATTACHED, FLIGHT, BARE = (_NUMBERS[mode] for mode in (Mode.ATTACHED, Mode.FLIGHT, Mode.BARE))

#: Kinds of events; that of a drive is a corner of its program.
LIFTOFF, IMPACT, CHATTER, SUPPLY = _NUMBERS
KINDS = ("liftoff", "impact", "chatter", "drive")


def _guard(mode: Mode, size: int) -> int:
    """Place of a mode's guard among its unknowns; −1 for none."""
    return {Mode.BARE: -1, Mode.ATTACHED: size - 1, Mode.FLIGHT: GAP}[mode]


#: Guards by the number of the system.
GUARDS = np.array([_guard(system.mode, system.size) for system in SYSTEMS])
#: Modes by the number of the system.
MODES = np.array([int(system.mode) for system in SYSTEMS])
