"""The hybrid loop: advance a mode, apply the transition at its guard, restart consistently."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from vibroplat.physics.impact import impact, latch
from vibroplat.physics.parameters import RESTITUTION, FloatArray, parameters
from vibroplat.physics.systems import FULL_SIZE, GAP, GAP_RATE, System, consistent, systems
from vibroplat.scene import Mode, Scene
from vibroplat.solver.engine import Control, Engine, Stop, Stretch
from vibroplat.solver.initial import begins_in_flight, initial_state, take_off_turns
from vibroplat.solver.scales import ROUND_OFF, absolute_tolerances, short_flight, state_scales
from vibroplat.solver.summary import Recorder, summarize
from vibroplat.solver.trajectory import Event, Segment, Trajectory
from vibroplat.solver.transitions import (
    ATTACH,
    LATCH,
    RETURN_SHARE,
    after_impact,
    curvature_step,
    excursion,
    presses,
)

#: What a run keeps besides its summary.
Keep = Literal["segments", "events", "summary"]

#: Largest backward error of a restart; a direct solve leaves about 1e-16.
CONSISTENT = 1e-11
#: Turns of the synchronous speed after which a stretch without events is restarted: angles are wrapped,
#: memory stays bounded and progress is told, for some thirty steps in thousands.
PERIODS_PER_STRETCH = 100


@dataclass
class Start:
    """A consistent state of one system, ready for an engine."""

    system: System
    y: FloatArray
    yp: FloatArray
    ypp: FloatArray

    @property
    def force(self) -> float:
        """F_c (N)."""
        return float(self.y[-1])

    @property
    def force_rate(self) -> float:
        """F_c′ (N/s)."""
        return float(self.yp[-1])


class _Ended(Exception):  # noqa: N818  (an outcome, not an error)
    """The run ends early, with a named outcome."""

    def __init__(self, outcome: str, detail: str) -> None:
        super().__init__(detail)
        self.outcome = outcome
        self.detail = detail


def simulate(
    scene: Scene, *, keep: Keep = "segments", progress: Callable[[float, int], None] | None = None
) -> Trajectory:
    """Integrate a scene in time.

    Parameters
    ----------
    scene
        What to simulate, how long and how accurately.
    keep
        ``segments``: all that tables and dense output need; ``events``: the event table and the summary;
        ``summary``: the summary alone, in memory that does not grow with the length of the run.
    progress
        Called now and then with the time reached (s) and the number of events so far.

    Returns
    -------
    Trajectory
        With ``summary["outcome"]`` ``ok``, or the reason why the run ended early: ``solver-failure``
        (the integrator gave up), ``non-finite`` (a state or residual is not finite), ``event-storm``
        (more events within a turn of the synchronous speed than ``solver.max_events_per_period``).
        What was computed until then is kept; ``summary["detail"]`` has mode, time and state.
    """
    return _Run(scene, keep, progress).trajectory()


class _Run:
    """One run: where it is, and what it has recorded."""

    def __init__(self, scene: Scene, keep: Keep, progress: Callable[[float, int], None] | None) -> None:
        self.scene = scene
        self.keep = keep
        self.progress = progress
        self.p = parameters(scene)
        self.p_dead = self.p.copy()
        self.p_dead[RESTITUTION] = 0.0
        self.systems = systems(scene)
        self.engine = _engine(self.p)
        self.tolerances = {s.mode: absolute_tolerances(scene, s) for s in self.systems.values()}
        self.gap_scale = float(state_scales(scene)[GAP])
        self.slowest = math.sqrt(ROUND_OFF) * self.gap_scale * scene.speed_scale
        self.t = 0.0
        self.state = initial_state(scene)
        self.turns = np.zeros(2)
        self.mode = scene.modes[0]
        self.joined = False
        self.segments: list[Segment] = []
        self.events: list[Event] = []
        self.period = 2.0 * math.pi / scene.speed_scale
        self.recent: deque[float] = deque(maxlen=scene.solver.max_events_per_period)
        self.recorder = Recorder(scene, self.p)

    def trajectory(self) -> Trajectory:
        """Integrate to the end of the run or to a named outcome."""
        began = time.perf_counter()
        outcome, detail = "ok", ""
        try:
            self.mode = self._first_mode()
            self.recorder.begin(self.state)
            while self._segment():
                pass
        except _Ended as ended:
            outcome, detail = ended.outcome, ended.detail
        except np.linalg.LinAlgError as error:
            singular = self._ended("non-finite", f"no consistent state ({error})")
            outcome, detail = singular.outcome, singular.detail
        self.recorder.finish(self.state)
        self.state[3:5] += self.turns
        run = Trajectory(self.scene, self.segments, self.events, self.state)
        run.summary = summarize(run, self.recorder, self.engine, outcome, detail, self.t, time.perf_counter() - began)
        return run

    # -- one segment --------------------------------------------------------------------------------

    def _segment(self) -> bool:
        """Integrate one smooth stretch and the transition at its end; False when the run is over."""
        self._count_restart()
        take_off_turns(self.state, self.turns)
        start = self._start(self.mode)
        duration = self.scene.run.duration_s
        left = duration - self.t
        until = min(left, PERIODS_PER_STRETCH * self.period)
        stretch = self.engine.advance(start.system, start.y, start.yp, self._control(start), until)
        if stretch.stop is Stop.GUARD and self.mode is Mode.ATTACHED:
            stretch = self._refine(start.system, stretch, until)
        elif stretch.stop is Stop.GUARD:
            stretch.y[-1, GAP] = 0.0  # the root is found to round-off
        ends = stretch.stop is Stop.TIME and until == left
        self._add(start.system, stretch, duration if ends else self.t + float(stretch.t[-1]))
        if stretch.stop is Stop.TIME:
            self.joined = True
        elif stretch.stop is not Stop.GUARD:
            outcome = "non-finite" if stretch.stop is Stop.NON_FINITE else "solver-failure"
            raise self._ended(outcome, stretch.detail)
        elif self.mode is Mode.ATTACHED:
            self._force_root()
        else:
            self._gap_root()
        return not ends

    def _refine(self, system: System, stretch: Stretch, until: float) -> Stretch:
        """Move the end of contact to where F_c by the algebra is 0.

        The integrator finds the root of its interpolated F_c, which satisfies the equations only to its
        tolerance; flight must begin without a force, or the gap begins with an acceleration.
        """
        here = self._start(Mode.ATTACHED, system.full(stretch.y[-1]))
        shift = -here.force / here.force_rate if here.force_rate < 0.0 else 0.0
        end = float(stretch.t[-1]) + shift
        if not stretch.t[-2] < end <= until:
            return stretch
        there = here.y + shift * here.yp + 0.5 * shift * shift * here.ypp
        moved = self._start(Mode.ATTACHED, system.full(there))
        t, y, yp = stretch.t.copy(), stretch.y.copy(), stretch.yp.copy()
        t[-1], y[-1], yp[-1] = end, moved.y, moved.yp
        return Stretch(t, y, yp, stretch.stop)

    def _add(self, system: System, stretch: Stretch, end: float) -> None:
        """Record a stretch and move to its end."""
        self.recorder.add(system, stretch, self.t, self.turns)
        if self.keep == "segments":
            t, y, yp = stretch.t, stretch.y, stretch.yp
            self.segments.append(Segment(system, self.t, end, t, y, yp, self.turns.copy(), self.joined))
        self.joined = False
        self.t = end
        self.state = system.full(stretch.y[-1])
        if self.progress is not None:
            self.progress(end, sum(self.recorder.counts.values()))

    def _start(self, mode: Mode, state: FloatArray | None = None) -> Start:
        """Make a state consistent for a mode; raises the outcome ``non-finite`` if that fails."""
        system = self.systems[mode]
        y = system.unknowns(self.state if state is None else state)
        yp, ypp = np.empty(system.size), np.empty(system.size)
        residual = consistent(system.index, system.differential, y, yp, ypp, self.p)
        if not residual <= CONSISTENT:
            raise self._ended("non-finite", f"no consistent state (relative residual {residual:.3g})")
        return Start(system, y, yp, ypp)

    def _control(self, start: Start) -> Control:
        """Tolerances and first step of a segment.

        The step follows from the curvature, and ends well before the gap can have closed again.
        """
        atol = self.tolerances[start.system.mode]
        step = 0.1 * self.period
        if start.system.mode is Mode.FLIGHT:
            place = start.system.differential // 2 + GAP
            gap, rate = start.y[GAP], start.y[place]
            acceleration, jerk = start.yp[place], start.ypp[place]
            snap = self._snap(start, jerk) if rate == 0.0 else 0.0  # a rebound does not need it
            duration, height = excursion(rate, acceleration, jerk, snap)
            if gap > 0.0:  # begun in the air, not at a contact
                falls = acceleration < 0.0
                duration = math.sqrt(2.0 * gap / -acceleration) if falls else np.inf
                height = gap + 0.5 * rate * rate / -acceleration if falls else np.inf
            atol = short_flight(atol, start.system, self.scene.solver.tolerance, height, self.gap_scale)
            step = min(step, RETURN_SHARE * duration)
        step = min(step, curvature_step(start.ypp, atol))
        return Control(atol, float(max(step, ROUND_OFF * self.period)))

    def _snap(self, start: Start, jerk: float) -> float:
        """Fourth derivative of the gap, as the difference of jerks a small step along the motion."""
        small = 1e-4 * self.period
        ahead = start.y + small * start.yp + 0.5 * small * small * start.ypp
        y, yp, ypp = ahead, np.empty_like(ahead), np.empty_like(ahead)
        consistent(start.system.index, start.system.differential, y, yp, ypp, self.p)
        return float((ypp[start.system.differential // 2 + GAP] - jerk) / small)

    # -- transitions --------------------------------------------------------------------------------

    def _first_mode(self) -> Mode:
        if not self.scene.has_contact:
            return Mode.BARE
        if begins_in_flight(self.state):
            return Mode.FLIGHT
        trial = self._start(Mode.ATTACHED)
        return Mode.ATTACHED if presses(trial.force, trial.force_rate, self.p) else Mode.FLIGHT

    def _force_root(self) -> None:
        """Lift off where F_c has fallen through zero, or go on if it only touched."""
        trial = self._start(Mode.ATTACHED)
        if trial.force_rate >= 0.0 and presses(trial.force, trial.force_rate, self.p):
            self.joined = True
            return
        self.mode = Mode.FLIGHT
        self._event("liftoff", 0.0, 0.0, 0.0, 0.0, 0.0, 0)

    def _gap_root(self) -> None:
        """Let the lower layer strike where the gap has fallen through zero, and see what follows."""
        before, after = self.state, np.empty(FULL_SIZE)
        before[GAP] = 0.0
        before[GAP_RATE] = min(before[GAP_RATE], 0.0)
        # a rebound that round-off of the platform's motion could not resolve is none
        dead = -before[GAP_RATE] < self.slowest
        impulse, loss = impact(before, after, self.p_dead if dead else self.p)
        self.state = after
        attached, flight = self._start(Mode.ATTACHED), self._start(Mode.FLIGHT)
        place = flight.system.differential // 2 + GAP
        rebound, acceleration, jerk = after[GAP_RATE], flight.yp[place], flight.ypp[place]
        following = after_impact(rebound, attached.force, attached.force_rate, acceleration, jerk, self.p)
        self.mode = Mode.ATTACHED if following == ATTACH else Mode.FLIGHT
        force = attached.force if following == ATTACH else 0.0
        self._event("impact", before[GAP_RATE], rebound, impulse, loss, force, 1)
        if following == LATCH:
            self._latch(flight)

    def _latch(self, flight: Start) -> None:
        """Close the impacts that accumulate, and carry the run to where they do."""
        after = np.empty(FULL_SIZE)
        rates = np.zeros(FULL_SIZE)
        rates[flight.system.places] = flight.yp
        rebound = self.state[GAP_RATE]
        duration, impulse, loss = latch(self.state, rates[7:], after, self.p)
        if self.t + duration >= self.scene.run.duration_s:
            return  # the run ends before they have closed: follow them
        end = flight.system.unknowns(after)
        rates_there = flight.yp.copy()
        coordinates = flight.system.differential // 2
        rates_there[:coordinates] = end[coordinates:]
        times = np.array([0.0, duration])
        stretch = Stretch(times, np.array([flight.y, end]), np.array([flight.yp, rates_there]), Stop.GUARD)
        self._add(flight.system, stretch, self.t + duration)
        self.state = after
        attached = self._start(Mode.ATTACHED)
        pressing = presses(attached.force, attached.force_rate, self.p)
        self.mode = Mode.ATTACHED if pressing else Mode.FLIGHT
        restitution = self.scene.contact.restitution
        skipped = math.ceil(math.log(np.finfo(float).eps) / math.log(restitution))
        self._event("latch", -rebound, 0.0, impulse, loss, attached.force if pressing else 0.0, skipped)

    def _event(
        self, kind: str, before: float, after: float, impulse: float, loss: float, force: float, impacts: int
    ) -> None:
        event = Event(
            t_s=self.t,
            kind=kind,
            gap_rate_before_m_per_s=float(before),
            gap_rate_after_m_per_s=float(after),
            impulse_n_s=float(impulse),
            energy_loss_j=float(loss),
            contact_force_after_n=float(force),
            mode_after=self.mode.label,
            impacts=impacts,
        )
        if self.keep != "summary":
            self.events.append(event)
        self.recorder.event(event)

    # -- ends ---------------------------------------------------------------------------------------

    def _count_restart(self) -> None:
        """End the run when restarts pile up; all of them count, so that nothing can go on for ever."""
        recent = self.recent
        if len(recent) == recent.maxlen and self.t - recent[0] < self.period:
            raise self._ended(
                "event-storm",
                f"{recent.maxlen} restarts within {self.t - recent[0]:.3g} s, less than one period; "
                "raise solver.max_events_per_period to follow them",
            )
        recent.append(self.t)

    def _ended(self, outcome: str, detail: str) -> _Ended:
        state = ", ".join(f"{v:.6g}" for v in self.state)
        return _Ended(outcome, f"{detail}; mode {self.mode.label}, t = {self.t:.9g} s, state [{state}]")


def _engine(p: FloatArray) -> Engine:
    """Build the engine; there is one so far, whatever ``solver.engine`` says."""
    from vibroplat.solver.sundae import SundaeEngine  # noqa: PLC0415  (loads SUNDIALS)

    return SundaeEngine(p)
