"""A scene in motion, carried on part by part; a run is one part, a point of a sweep several."""

from __future__ import annotations

from collections.abc import Callable

from vibroplat.hybrid import loop as hy
from vibroplat.hybrid.automaton import automaton
from vibroplat.integrate.seam import Engine
from vibroplat.integrate.tape import Tape
from vibroplat.model.parameters import FloatArray, Parameters
from vibroplat.observe.statistics import Measures, copied, no_measures
from vibroplat.observe.summary import Energies, Part
from vibroplat.scene import Mode, Scene

#: Names of outcomes, by the automaton's number.
OUTCOMES = {
    hy.OK: "ok",
    hy.SOLVER_FAILURE: "solver-failure",
    hy.NON_FINITE: "non-finite",
    hy.INCONSISTENT: "non-finite",
    hy.EVENT_STORM: "event-storm",
    hy.BEYOND_MODEL: "beyond-model",
}


class Motion:
    """A scene in motion.

    Parameters
    ----------
    scene
        What moves; its duration is not used.
    p
        Parameters of the scene.
    engine
        An engine made for both, driven by this motion alone; whoever made it closes it.
    state
        Full state to begin with, shape (14,); that of ``run.initial`` without it.

    Attributes
    ----------
    automaton
        Where the motion is, in the arrays that the engine changes.
    events
        Liftoffs, impacts and latches so far.
    """

    def __init__(self, scene: Scene, p: Parameters, engine: Engine, state: FloatArray | None = None) -> None:
        self.scene = scene
        self.engine = engine
        self._p = p
        self.events = 0
        self.automaton = automaton(scene, p, engine.turns_per_segment, state)
        hy.first_mode(self.automaton)

    def go_on(
        self,
        seconds: float,
        *,
        settle: float = 0.0,
        blocks: int = 1,
        read: Callable[[Tape, hy.Hybrid], None] | None = None,
    ) -> Part:
        """Carry the motion on.

        Parameters
        ----------
        seconds
            How long, unless it ends early; see :attr:`outcome`.
        settle
            What is not measured of it at its beginning (s).
        blocks
            Equally long parts in which it is carried on; the sums at their ends are kept in the part that is returned.
        read
            Called with the tape and the automaton whenever the engine returns, before both lists are emptied.
        """
        begun = self.now
        h = self.automaton = self.automaton._replace(measures=no_measures(begun + settle))
        before = Energies.of(h.state, self._p)
        ends: list[Measures] = []
        for block in range(1, blocks + 1):
            self._reach(begun + seconds * block / blocks, read)
            if self.outcome != "ok":
                break
            if blocks > 1:
                ends.append(copied(h.measures))
        self.events += int(h.measures.totals[:3].sum())
        return Part(h.measures, before, Energies.of(h.state, self._p), ends)

    def _reach(self, end: float, read: Callable[[Tape, hy.Hybrid], None] | None) -> None:
        """Carry the motion on to a time (s), unless it ends early."""
        h = self.automaton
        h.clock[hy.DURATION] = end
        if h.flags[hy.OUTCOME] == hy.OK:
            h.flags[hy.OUTCOME] = hy.RUNNING
            h.flags[hy.JOINED_ON] = 1
        while h.flags[hy.OUTCOME] == hy.RUNNING:
            tape = self.engine.advance(h)
            if read is not None:
                read(tape, h)
            h.flags[hy.EVENTS] = 0

    @property
    def now(self) -> float:
        """Time since the beginning (s)."""
        return float(self.automaton.clock[hy.NOW])

    @property
    def state(self) -> FloatArray:
        """Full state, shape (14,), its exciter angles with all their turns."""
        state = self.automaton.state.copy()
        state[3:5] += self.automaton.turns
        return state

    @property
    def restarts(self) -> int:
        """Restarts of the integrator so far."""
        return int(self.automaton.flags[hy.RESTARTS])

    @property
    def outcome(self) -> str:
        """``ok``, or why the motion has ended early."""
        return OUTCOMES[int(self.automaton.flags[hy.OUTCOME])]

    @property
    def detail(self) -> str:
        """Why the motion has ended early, in which mode, when and where; empty if it has not."""
        h = self.automaton
        outcome = h.flags[hy.OUTCOME]
        if outcome == hy.OK:
            return ""
        oldest = h.recent[h.flags[hy.RESTARTS] % h.recent.size]
        safe = self._p.safe_rotation
        why = {
            hy.INCONSISTENT: "no consistent state (its accelerations are not finite)",
            hy.BEYOND_MODEL: f"the platform has turned by {h.state[2]:.3g} rad; beyond {safe:.3g} rad "
            "the mass matrix of the model, of first order in phi, need not be positive definite",
            hy.EVENT_STORM: f"{h.recent.size} restarts within {h.clock[hy.NOW] - oldest:.3g} s, less than one period; "
            "raise solver.max_events_per_period to follow them",
        }.get(int(outcome), self.engine.detail)
        state = ", ".join(f"{v:.6g}" for v in h.state)
        return f"{why}; mode {Mode(int(h.flags[hy.MODE])).label}, t = {h.clock[hy.NOW]:.9g} s, state [{state}]"
