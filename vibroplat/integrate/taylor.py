"""Engine ``taylor``: the Taylor series of the index-reduced DAE itself, in compiled code.

A one-step method of high order: it has its full order at once after an impact, its steps are polynomials without
further work, and it takes four to six of them a turn where IDA, of order 5, takes hundreds. It is explicit: a layer or
motor that is stiff against the excitation makes its steps short even where it does not move, which the run then says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import Automaton
from vibroplat.integrate.group import Group, group_of
from vibroplat.integrate.interface import WORK, most_steps
from vibroplat.integrate.lockstep import run_lanes
from vibroplat.kernels.compiled import Address, Callee, address_of, call_kernel, compiled, quick_call
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.model.parameters import Parameters

#: Degree of the series at tolerance 1e-6, and degrees more for each power of ten below it. At equal errors degrees from
#: 14 to 22 take equal times within a tenth at this tolerance, and higher ones at tighter tolerances.
DEGREE, DEGREES_PER_DECADE = 17, 1.5
MIN_DEGREE = 10


def degree_of(tolerance: float) -> int:
    """Choose the degree of the series for a tolerance."""
    return min(max(round(DEGREE - DEGREES_PER_DECADE * (math.log10(tolerance) + 6.0)), MIN_DEGREE), MAX_DEGREE)


class TaylorEngine:
    """Taylor series of high order, driven in compiled code."""

    name = "taylor"
    #: Few enough to stay in the processor's cache (0.3 MB at tolerance 1e-6) until they are read; 512 take 8 % longer.
    rows = 128
    #: A restart costs nothing, and angles lose digits as they grow.
    turns_per_segment: float = 10

    def __init__(self, scene: Scene, p: Parameters) -> None:
        self.degree = degree_of(scene.solver.tolerance)
        self.max_steps = most_steps(scene)
        self._p = p  # not a copy: a drive's program changes it in place
        self._h: Automaton | None = None
        self._carry = quick_call(carry)
        self._groups: list[Group] = []  # of several motions, the last of one

    def side_by_side(self, automata: Sequence[Automaton]) -> Group:
        """Make a group of motions of the scene, none of which is there yet; observers read none of their steps."""
        group = group_of(automata, self.degree, self.max_steps, keep=False)
        group.lanes["idle"][:] = 1.0
        self._groups.insert(0, group)
        return group

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        steps, rejected = (sum(int(g.lanes[name].sum()) for g in self._groups) for name in ("steps", "rejected"))
        return dict.fromkeys(WORK) | {"steps": steps, "error_test_failures": rejected}

    @property
    def detail(self) -> str:
        """Why the integrator failed."""
        if any(g.lanes["counted"].max() > self.max_steps for g in self._groups):
            return f"taylor: more than {self.max_steps} steps within a period"
        short = any(g.status["short"].any() for g in self._groups)
        return "taylor: no step is short enough" if short else "the series is not finite"

    def advance(self, h: Automaton) -> None:
        """Go on with a run; see :class:`vibroplat.integrate.interface.Engine`."""
        group = self._group_of(h)
        self._carry(group)

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return what :meth:`advance` calls."""
        group = self._group_of(h)
        place = address_of(carry, group)
        return Callee(address_of(run_loop, h, place, group), (place, group))

    def _group_of(self, h: Automaton) -> Group:
        if self._h is not h:
            self._groups = [
                *(g for g in self._groups if not g.keep),
                group_of([h], self.degree, self.max_steps, keep=True),
            ]
            self._h = h
        return self._groups[-1]

    def renew(self) -> None:
        """Forget the motions so far: what the engine holds is as new, for another scene of the same tolerance."""
        for group in self._groups:
            for record in (group.lanes, group.status):
                np.asarray(record).reshape(-1).view(np.uint8)[:] = 0
            group.lanes["idle"][:] = 0.0 if group.keep else 1.0

    def close(self) -> None:
        """Do nothing: Python frees what the engine holds."""


@compiled
def carry(owned_g: Group) -> None:
    """Carry the motion of an automaton, a group of its own, on until it has ended or has no room for more steps."""
    used = owned_g.used[0]
    used.steps = used.first = used.pieces = 0
    run_lanes(owned_g)


@compiled
def run_loop(h: Automaton, place: Address, g: Group) -> None:
    """Call :func:`carry` where it is, for callers who know engines by their automaton."""
    call_kernel(place, (g,))
