"""A simulator: a scene in motion, carried on to a time, to a point of its section, to an event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN, Mode
from vibroplat.config.drive import interval_at
from vibroplat.config.engine_choice import FAILED, may_succeed
from vibroplat.config.scene import Scene
from vibroplat.hybrid import state as hy
from vibroplat.hybrid.loop import automaton, beginning, first_mode
from vibroplat.hybrid.resets import apply_supply_corner, record_restart_events
from vibroplat.hybrid.state import empty_steps, rewind
from vibroplat.integrate.interface import Engine
from vibroplat.kernels.compiled import FloatArray, quick_call
from vibroplat.model.parameters import Parameters, record_words, supply
from vibroplat.model.systems import FULL_SIZE, SYSTEMS, System
from vibroplat.observe.measures import FASTEST, MAX_FINAL_PERIOD, SECTION_ROWS, WHOLE_RUN, Accumulators
from vibroplat.observe.section import ON_SECTION, section_angle
from vibroplat.observe.statistics import Statistics
from vibroplat.report.summary import Energies, MeasuredInterval
from vibroplat.system.memory import NO_MORE, OutOfMemoryError

#: Names of outcomes, by the automaton's number.
OUTCOMES = {
    hy.RUNNING: "ok",
    hy.OK: "ok",
    hy.SOLVER_FAILURE: "solver-failure",
    hy.NON_FINITE: "non-finite",
    hy.INCONSISTENT: "non-finite",
    hy.TOO_MANY_EVENTS: "too-many-events",
    hy.OUTSIDE_MODEL: "outside-model-validity",
    hy.OUT_OF_MEMORY: "out-of-memory",
}


class Observer(Protocol):
    """What reads a motion during the run."""

    def read(self, h: hy.Automaton) -> None:
        """Read the closed pieces of ``h.steps`` and the first ``run.events`` of ``h.events``, before they go."""


class Simulator:
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
    time
        When it begins (s).
    mode
        Mode to begin with, where the state alone does not tell: a gap of 0 may be about to open.

    Attributes
    ----------
    automaton
        Where the motion is, in the records that the engine changes.
    beginning
        Where a motion begins anew: a record of :data:`vibroplat.hybrid.state.RUN`.
    events
        Events so far.
    held_parameters
        The records of parameters of all who hold them, as numbers: that which was given, and the automaton's.
    """

    def __init__(
        self,
        scene: Scene,
        p: Parameters,
        engine: Engine,
        state: FloatArray | None = None,
        time: float = 0.0,
        mode: Mode | None = None,
    ) -> None:
        self.scene = scene
        self.engine = engine
        self.events = 0
        self._lack = ""
        self._first_mode, self._rewind = quick_call(first_mode), quick_call(rewind)
        self._observer: Statistics | None = None
        steps = empty_steps(engine.rows, engine.degree)
        self._p = p
        self._intervals = scene.drive.intervals
        self._interval = interval_at(self._intervals, time)
        supply(p, scene, self._interval)
        self.automaton = automaton(scene, p, steps, engine.turns_per_segment, state, time)
        self._run = np.asarray(self.automaton.run).reshape(1)
        self.beginning = record_words(self.automaton.run).copy().view(self._run.dtype)[0]  # numpy copies words faster
        # several times as quick to reach as the fields of a record
        self._field = {name: self._run[name] for name in ("now", "outcome", "mode", "events", "unread", "systems")}
        self.held_parameters = record_words(p), record_words(self.automaton.p)
        self._first_mode(self.automaton)
        if mode is Mode.FLIGHT and self._field["mode"][0] != mode:  # it has just lifted off: gap and its rate are 0
            self._run["mode"], self._run["zeros"] = mode, 2
        if mode is not None:
            at_corner = self._interval.start == time and self._interval.corner
            record_restart_events(self.automaton, mode not in (Mode.FLIGHT, Mode.BARE), at_corner)

    def set_parameters(self, p: Parameters) -> None:
        """Change the parameters for all who hold them: of another scene of the same modes, with the same tolerances."""
        for held in self.held_parameters:
            held[:] = record_words(p)

    def take(self, scene: Scene, p: Parameters) -> None:
        """Go over to another scene of the same systems, tolerance and engine, whose drive has no program.

        Its motions begin with :meth:`reset`.
        """
        self.scene, self._intervals, self._interval = scene, scene.drive.intervals, scene.drive.at(0.0)
        self._run[:] = beginning(scene, self.engine.turns_per_segment, self._state)
        record_words(self.beginning)[:] = record_words(self.automaton.run)
        self.set_parameters(p)

    def reset(self, state: FloatArray) -> None:
        """Begin anew at another full state, shape (14,), at the time and in the interval of the drive as before.

        It saves making records and steps for each of many short motions. What the engine has counted goes on.
        """
        self._run[0] = self.beginning
        self._run["state"][:, : len(state)] = state
        self.events = 0
        if not self._interval.start <= self.now < self._interval.end:
            self._change_supply()
        self._first_mode(self.automaton)

    def beginnings(self, states: FloatArray) -> npt.NDArray[np.void]:
        """Return records of :data:`vibroplat.hybrid.state.RUN` of motions from full states, shape (motions, 14)."""
        runs = np.repeat(self.beginning.reshape(1), len(states))
        runs["state"][:, : states.shape[1]] = states
        return runs

    def resume(self, run: np.void, recent: FloatArray) -> None:
        """Go on from where another motion of the scene is: its record of RUN and the times of its last restarts."""
        self._run[0] = run
        self.automaton.recent[:] = recent
        self.events = 0

    def find_mode(self) -> None:
        """Find the mode of the present state, as at the beginning of a motion."""
        self._first_mode(self.automaton)

    def _change_supply(self) -> None:
        """Change the supply of the motors to that of the present, for all who hold the parameters."""
        self._interval = interval_at(self._intervals, self.now)
        for p in (self._p, self.automaton.p):
            supply(p, self.scene, self._interval)

    def advance(
        self,
        seconds: float,
        *,
        settle: float = 0.0,
        blocks: int = 1,
        observers: Sequence[Observer] = (),
        scope: int = WHOLE_RUN,
    ) -> MeasuredInterval:
        """Carry the motion on for a time, and measure it.

        Parameters
        ----------
        seconds
            How long, unless it ends early; see :attr:`outcome`.
        settle
            What is not measured of it at its beginning (s).
        blocks
            Equally long parts in which it is carried on; what was measured is kept at their ends in the part that is
            returned: sums since the beginning, extremes of each block.
        observers
            What else reads it.
        scope
            What is measured, from :data:`vibroplat.observe.measures.SECTION_POINTS` to ``WHOLE_RUN``.
        """
        start, before, ends = self.now, self._energies, list[Accumulators]()
        statistics = self._statistics(start + settle, seconds - settle, scope, blocks)
        for block in range(1, blocks + 1):
            self.to_time(start + seconds * block / blocks, (statistics, *observers))
            if self.outcome != "ok":
                break
            if blocks > 1:
                ends.append(statistics.end_block())
        return MeasuredInterval(statistics.measures, before, self._energies, ends)

    def advance_turns(
        self, turns: int, longest: float, observers: Sequence[Observer] = (), scope: int = WHOLE_RUN
    ) -> MeasuredInterval:
        """Carry the motion on to the next point of its section and for whole turns of exciter 1 from there; measure it.

        Parameters
        ----------
        turns
            How many whole turns.
        longest, observers
            As in :meth:`to_section`.
        scope
            As in :meth:`advance`.
        """
        statistics, before = self._statistics(self.now, longest, scope), self._energies
        self.to_section(turns + 1, longest, (statistics, *observers))
        return MeasuredInterval(statistics.measures, before, self._energies)

    def _statistics(self, window: float, seconds: float, scope: int, blocks: int = 1) -> Statistics:
        """Begin statistics of a part that begins at a time (s) and takes some time (s).

        There is room for the last SECTION_ROWS points of its section; for fewer where a part of a run has no more turns
        at FASTEST times the largest synchronous speed.
        """
        turns = SECTION_ROWS if scope >= WHOLE_RUN else FASTEST * self.scene.speed_scale / TURN * seconds
        points = int(min(max(turns, MAX_FINAL_PERIOD) + 2.0, SECTION_ROWS))
        if self._observer is None:
            self._observer = Statistics(window, points, len(self.scene.measured_points), blocks, scope)
        else:
            self._observer.begin(window, points, blocks, scope)
        return self._observer

    def to_time(self, time: float, observers: Sequence[Observer] = ()) -> None:
        """Carry the motion on to a time (s), unless it ends early, through the corners of the drive's program."""
        h, outcome, end = self.automaton, self._field["outcome"], -math.inf
        self._field["unread"][0] = not observers
        while end < time and self.outcome == "ok" and self.now >= end:
            if time > self.now >= self._interval.end:
                self._change_supply()
                apply_supply_corner(h, self._interval.corner)
                self._rewind(h.steps)  # they have been read
                self._tell(observers)
                continue  # an observer may have run out of memory
            h.run["end"] = end = min(time, self._interval.end)
            outcome[0] = hy.RUNNING
            while outcome.item() == hy.RUNNING:
                self._rewind(h.steps)  # should memory run out before the engine does so
                self.go_on()
                self._tell(observers)

    def go_on(self) -> None:
        """Let the engine carry the motion on until its steps are to be read."""
        try:
            self.engine.advance(self.automaton)
        except MemoryError as error:
            self._end_without_memory(error)

    def _tell(self, observers: Sequence[Observer]) -> None:
        """Let observers read the new steps and events, all of them even if one runs out of memory."""
        h = self.automaton
        for observer in observers:
            try:
                observer.read(h)
            except MemoryError as error:
                self._end_without_memory(error)
        self.events += self._field["events"].item()
        self._field["events"][0] = 0

    def _end_without_memory(self, error: MemoryError) -> None:
        """End the motion early; what was computed is kept."""
        self.automaton.run["outcome"] = hy.OUT_OF_MEMORY
        self._lack = str(error) if isinstance(error, OutOfMemoryError) else NO_MORE

    def to_section(self, turns: int, longest: float, observers: Sequence[Observer] = ()) -> bool:
        """Carry the motion on until exciter 1 has completed so many whole turns more, exactly.

        Parameters
        ----------
        turns
            How many points of the Poincaré section, φ₁ = 0 modulo 2π, are passed; the motion stops at the last.
        longest
            Time after which it stops in any case (s).

        Returns
        -------
        bool
            Whether it got there.
        """
        run = self.automaton.run
        run["target"] = target = section_angle(float(run["state"][3] + run["turns"][0]), turns)
        self.to_time(self.now + longest, observers)
        run["target"] = math.nan
        return self.outcome == "ok" and self.state[3] > target - TURN * ON_SECTION

    @property
    def now(self) -> float:
        """Time since the beginning (s)."""
        return float(self._field["now"].item())

    @property
    def state(self) -> FloatArray:
        """Full state, shape (14,), with transport (16,), its exciter angles with all their turns."""
        state = self._state.copy()
        state[3:5] += self.automaton.run["turns"]
        return state

    @property
    def _state(self) -> FloatArray:
        state: FloatArray = self.automaton.run["state"]
        return state if self.scene.transport is not None else state[:FULL_SIZE]

    @property
    def system(self) -> System:
        """The present equations."""
        return SYSTEMS[int(self._field["systems"][0, self._field["mode"].item()])]

    @property
    def _energies(self) -> Energies:
        return Energies.of(self._state, self.automaton.p)

    @property
    def restarts(self) -> int:
        """Restarts of the integrator so far."""
        return int(self.automaton.run["restarts"])

    @property
    def outcome(self) -> str:
        """``ok``, or why the motion has ended early."""
        return OUTCOMES[self._field["outcome"].item()]

    @property
    def detail(self) -> str:
        """Why the motion has ended early, in which mode, when and where; empty if it has not."""
        if self.outcome == "ok":
            return ""
        h, run = self.automaton, self.automaton.run
        oldest = h.recent[run["restarts"] % h.recent.size]
        safe = h.p["safe_rotation"]
        why = {
            hy.INCONSISTENT: "there are no finite accelerations",
            hy.OUTSIDE_MODEL: f"the platform has turned by {run['state'][2]:.3g} rad, and turns at "
            f"{run['state'][9]:.3g} rad/s; beyond {safe:.3g} rad the mass matrix of the model, of first order in phi, "
            "need not be positive definite",
            hy.TOO_MANY_EVENTS: f"{h.recent.size} restarts within {run['now'] - oldest:.3g} s, less than one period; "
            "raise solver.max_events_per_period to follow them",
            hy.OUT_OF_MEMORY: self._lack,
        }.get(int(run["outcome"]), self.engine.detail)
        state, helps = ", ".join(f"{v:.6g}" for v in self._state), self.outcome in FAILED and may_succeed(self.scene)
        place = f"mode {Mode(int(run['mode'])).label}, t = {run['now']:.9g} s{helps or ''}"
        return f"{why}; {place}, state [{state}]"
