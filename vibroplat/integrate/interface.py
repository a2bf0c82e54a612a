"""The interface: what a run asks of an integrator.

An *engine* drives the automaton of :mod:`vibroplat.hybrid`: for each segment it calls ``begin_segment``, integrates
from the consistent state prepared there until the guard falls through zero or the segment's time is up, adds its steps,
each with a polynomial, to ``h.steps``, and calls ``end_segment``. Whoever reads the steps knows no method.

``simulate(scene, engine=…)`` runs any :class:`Engine`. The tests make one of scipy's DOP853, in
``tests/integrate/stepwise.py`` and ``dop853.py``. One that users may choose has a line in
:mod:`vibroplat.config.engines`. Engines with a compiled loop of their own, as ``native``, save a return to Python in
each step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from vibroplat.columns import COUNT, Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import Automaton
from vibroplat.kernels.compiled import Callee, inlined
from vibroplat.kernels.lanes import select

#: What engines count, in the order of the summary.
WORK: Columns = {
    "steps": Column("number of steps of the integrator", kind=COUNT),
    "residual_calls": Column("number of evaluations of the residual", kind=COUNT),
    "jacobian_calls": Column("number of evaluations of the Jacobian"),
    "error_test_failures": Column("number of steps repeated because of their error"),
    "newton_failures": Column("number of steps repeated because Newton's iteration failed"),
}


#: Steps within a period after which an integrator is taken to be stuck, and those for each event that a scene allows
#: within a period, where that is more.
MAX_STEPS, STEPS_PER_EVENT = 300_000, 60


def most_steps(scene: Scene) -> int:
    """Return how many steps within a period an integrator may take."""
    return max(MAX_STEPS, STEPS_PER_EVENT * scene.solver.max_events_per_period)


@inlined
def count_within_period(counted: Any, since: Any, now: Any, period: Any) -> tuple[Any, Any]:
    """Return what is counted within a period, and since when (s), at a time of the run; numbers, or lanes of them."""
    over = now - since >= period
    return select(over, 0.0, counted), select(over, now, since)


@inlined
def count_from(counted: float, since: float, origin: float) -> tuple[float, float]:
    """Return the same where a segment begins; a motion that has begun, or begun again, counts anew."""
    return (0.0, origin) if origin <= since else (counted, since)


class Engine(Protocol):
    """What carries the automaton of one scene on."""

    name: str  # as in ``solver.engine``
    rows: int  # how many steps it adds before they are read
    degree: int  # of their polynomials
    turns_per_segment: float  # of the synchronous speed, after which a segment without an event is restarted

    @property
    def detail(self) -> str:
        """Why the integrator failed, when it has."""
        ...

    @property
    def work(self) -> Mapping[str, int | None]:
        """How much was done so far, by the names in :data:`WORK`; None for what this engine cannot count."""
        ...

    def advance(self, h: Automaton) -> None:
        """Carry a run on for some segments, or part of one; its steps and events are read before the next call."""
        ...

    def compiled_loop(self, h: Automaton) -> Callee:
        """Return the kernel that :meth:`advance` is, of a run and its arguments here; without arguments there is none.

        Compiled code that drives many short motions calls it by its address, or else :meth:`advance` through Python.
        """
        ...

    def close(self) -> None:
        """Free what the engine holds."""
        ...
