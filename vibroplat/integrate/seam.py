"""The engine seam: what a run asks of an integrator.

An engine drives the hybrid automaton of :mod:`vibroplat.hybrid.loop`: for each segment it calls
``begin``, integrates from the consistent state prepared there until the guard falls through zero or the
segment's time is up, writes the ends of its steps on a tape, and calls ``conclude``. Implement
:class:`Engine` and everything else works.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from vibroplat.hybrid.loop import Hybrid
from vibroplat.integrate.tape import Tape

#: What engines count, in the order of the summary.
WORK = ("steps", "residual_calls", "jacobian_calls", "error_test_failures", "newton_failures")


class Engine(Protocol):
    """An integrator for the systems of one scene.

    Attributes
    ----------
    name
        As in ``solver.engine``.
    turns_per_segment
        Turns of the synchronous speed after which a segment without an event is ended and restarted.
    work
        How much was done so far, by the names in :data:`WORK`; None for what this engine cannot count.
    detail
        Why the integrator failed, when it has.
    """

    name: str
    turns_per_segment: float

    @property
    def detail(self) -> str: ...  # noqa: D102

    @property
    def work(self) -> Mapping[str, int | None]: ...  # noqa: D102

    def advance(self, h: Hybrid) -> Tape:
        """Go on with a run for one or more segments, or part of one; the tape is read before the next call."""
        ...

    def close(self) -> None:
        """Free what the engine holds."""
        ...
