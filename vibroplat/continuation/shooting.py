"""Shots: motions of an exact duration from a full state, with what a search for periodic orbits asks of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.continuation.event_sequence import word_of
from vibroplat.hybrid.modes import IMPACT, LATCH
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.sensitivity import Course, difference, with_value
from vibroplat.model.systems import FULL_SIZE, systems
from vibroplat.motion.motion import Motion, Observer
from vibroplat.motion.recorder import Recorder
from vibroplat.observe.audit import Energies
from vibroplat.observe.guard_margins import GuardMargins
from vibroplat.observe.statistics import Measures, Statistics
from vibroplat.observe.summary import Part
from vibroplat.observe.variation import Variation

#: Step of the difference that gives the derivative of the parameters by a key, over its value.
STEP = 1e-4

_TURN = 2.0 * math.pi
#: Derivative of a full state by itself.
_UNVARIED = np.eye(FULL_SIZE)


@dataclass
class Shot:
    """A motion of an exact duration.

    Attributes
    ----------
    start, state
        Full states at its ends, the angles with all their turns, shape (14,).
    begins, ends
        Systems at its ends, by their number.
    duration
        (s).
    outcome, detail
        As of a run.
    events
        Records of :data:`vibroplat.hybrid.state.EVENT`.
    restitution
        In the law of impact.
    rates, derivative
        Rates of the state, shape (14,), and its derivative by the start and by the keys, shape (14, 14 + keys);
        None if they were not asked for.
    part
        What was measured; None if it was not asked for.
    pieces
        System, beginning and end (s) of each piece between events; empty if nothing was measured.
    least_force, least_gap
        Least F_c (N) of contact and least gap (m) at a turning point in flight; inf without one.
    """

    start: FloatArray
    state: FloatArray
    begins: int
    ends: int
    duration: float
    outcome: str
    detail: str
    events: npt.NDArray[np.void]
    restitution: float
    rates: FloatArray | None = None
    derivative: FloatArray | None = None
    part: Part | None = None
    pieces: Sequence[tuple[int, float, float]] = ()
    least_force: float = math.inf
    least_gap: float = math.inf

    @cached_property
    def word(self) -> str:
        """Sequence of events."""
        return word_of(self.events, self.restitution)

    @property
    def landing_force(self) -> float:
        """Least F_c after an event with which contact begins (N); inf without one."""
        began = (self.events["kind"] == IMPACT) | (self.events["kind"] == LATCH)
        forces = self.events["force_after"][began & (self.events["mode_after"] == Mode.ATTACHED)]
        return float(forces.min()) if forces.size else math.inf

    @property
    def slowest_impact(self) -> float:
        """Least speed of an impact with a rebound (m/s); inf without one."""
        rebounds = (self.events["kind"] == IMPACT) & (self.events["mode_after"] == Mode.FLIGHT)
        speeds = -self.events["rate_before"][rebounds]
        return float(speeds.min()) if speeds.size else math.inf


class Shooter:
    """Takes shots of a scene, at any values of up to two of its keys.

    Scales and tolerances are those of the scene as it was given, so that shots depend smoothly on the values.

    Parameters
    ----------
    scene
        The scene.
    keys
        Dotted keys that vary.
    course
        Range of the first key that shots will mostly be in, if it is the only one.

    Attributes
    ----------
    turns
        Of exciter 1 in all shots so far, for the record.
    """

    def __init__(self, scene: Scene, keys: Sequence[str] = (), course: tuple[float, float] | None = None) -> None:
        self.scene = scene
        self.keys = tuple(keys)
        self.scales = state_scales(scene)
        self.p = parameters(scene)
        self.engine = make_engine(scene, self.p)
        self.motion = Motion(scene, self.p, self.engine)
        self.turns = 0.0
        self._variation = Variation([self.p.copy()] * len(self.keys))
        self._statistics = Statistics(0.0, points=1)
        self._numbers = {int(mode): system.index for mode, system in systems(scene).items()}
        self.held: dict[str, float] = {}
        self._course = None if course is None or len(self.keys) != 1 else Course(scene, self.keys[0], *course)

    def close(self) -> None:
        """Free what the engine holds."""
        self.engine.close()

    def scene_at(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with other values of keys, without a check of their ranges."""
        scene = self.scene
        for key, value in values.items():
            scene = with_value(scene, key.split("."), value)
        return scene

    def set(self, values: Mapping[str, float]) -> None:
        """Change the values of the keys for the shots to come."""
        if values == self.held:
            return
        self.held = dict(values)
        value = next(iter(values.values()), math.nan)
        course = self._known(value)
        self.motion.set_parameters(parameters(self.scene_at(values)) if course is None else course.at(value))

    def _known(self, value: float) -> Course | None:
        """Return the parameters' course if it can tell those at a value of its key."""
        return self._course if self._course is not None and self._course.exact and self._course.covers(value) else None

    def direction(self, key: str) -> Parameters:
        """Differentiate the parameters by a key at the present values."""
        value = self.held[key]
        course = self._known(value)
        if course is not None:
            return course.slope(value)
        step = STEP * abs(value) or STEP
        above, below = (parameters(self.scene_at(self.held | {key: value + s})) for s in (step, -step))
        return difference(above, below, 2.0 * step)

    def shot(self, start: FloatArray, duration: float, *, varied: bool = False, measured: bool = False) -> Shot:
        """Follow the motion from a full state for a duration (s).

        Parameters
        ----------
        varied
            Whether to find the rates, and the derivative by the start and by the keys.
        measured
            Whether to measure it.
        """
        motion, h = self.motion, self.motion.automaton
        recorder, near = Recorder(motion.scene, "events"), GuardMargins()
        observers: list[Observer] = [recorder]
        if varied:
            observers.append(self._variation)
        if measured:
            self._statistics.begin(0.0)
            observers += [self._statistics, near]
        motion.reset(start)
        begins = self._system
        if varied:
            self._variation.begin(_UNVARIED, [self.direction(key) for key in self.keys])
        before = Energies.of(h.run["state"], h.p) if measured else None
        motion.to_time(duration, observers)
        state = motion.state
        self.turns += abs(state[3] - start[3]) / _TURN
        found = Shot(
            start=start,
            state=state,
            begins=begins,
            ends=self._system,
            duration=duration,
            outcome=motion.outcome,
            detail=motion.detail,
            events=recorder.events,
            restitution=float(h.p["restitution"]),
        )
        if varied:
            found.rates, found.derivative = motion.rates, self._variation.derivative(h)
        if before is not None:
            found.part = Part(_undivided(self._statistics.measures), before, Energies.of(h.run["state"], h.p))
            found.pieces = near.pieces
            found.least_force, found.least_gap = near.least_force, near.least_gap
        return found

    @property
    def _system(self) -> int:
        """Number of the present system."""
        return self._numbers[int(self.motion.automaton.run["mode"])]


def _undivided(measures: Measures) -> Measures:
    """Return what was measured with the sums over all of it, not cut to whole turns of exciter 1."""
    total, none = measures.plain + measures.whole + measures.open_turn, np.zeros(len(measures.plain))
    return measures._replace(plain=total, whole=none, open_turn=none)
