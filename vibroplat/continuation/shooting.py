"""Shooting: motions of an exact duration from a full state, and the sequence of events on the way.

The sequence is a word of one letter an event: L is a liftoff, I an impact, S an impact, or impacts that accumulate,
after which contact holds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN, Mode
from vibroplat.config.engine_choice import chosen_engine
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import CHATTER, IMPACT, LIFTOFF
from vibroplat.hybrid.state import EVENT, state_scales
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray, PythonFunction, address_of, quick_call
from vibroplat.model.parameters import parameters
from vibroplat.model.sensitivity import NO_COURSE, course_of, flat, with_values
from vibroplat.model.systems import SYSTEMS
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import WITH_EXTREMES, Accumulators
from vibroplat.observe.statistics import Statistics
from vibroplat.observe.variation import Variation
from vibroplat.report.summary import Energies, Known, MeasuredInterval, known_of
from vibroplat.shooting.orbits import newton
from vibroplat.shooting.shots import (
    ADVANCE,
    PART,
    SET,
    SET_DIRECTIONS,
    contracts,
    packed,
    set_parameters,
    shoot,
    shot_records,
    unpacked,
)

#: What the letters of a word stand for in tables.
EVENT_NAMES = {"L": "liftoff", "I": "impact", "S": "stick"}
#: Step of the difference that gives the derivative of the parameters by a key, over its value.
KEY_STEP_RATIO = 1e-4
#: The section is moved when the piece it lies in ends nearer to it than this part of the piece, or when it lies in
#: flight while contact takes at least a fraction of the period.
MIN_SECTION_MARGIN, MIN_CONTACT_FRACTION = 0.15, 0.06
#: Turns in which an aperiodic motion is searched for near returns, and how many are tried. Of 65
#: motions of the calibrated machine from 56 to 62 Hz that do not repeat, 36 give an orbit of period 1; 24 in 400 turns.
RETURN_TURNS, MAX_RETURNS = 1600, 16

T = TypeVar("T")


@dataclass
class Shot:
    """A motion of an exact duration (s).

    Attributes
    ----------
    state
        Full state at its end, the angles with all their turns, shape (14,).
    begins, ends
        Numbers of the systems at its beginning and end.
    events
        Records of :data:`vibroplat.hybrid.state.EVENT`.
    rates, derivative
        Rates of the state, shape (14,), and its derivative by the start and by the keys, shape (14, 14 + keys);
        None if they were not asked for.
    measure, pieces
        Function that returns the measured interval, None if it was not asked for; and system, beginning and end (s) of
        each piece between events.
    least_force, least_gap
        Least F_c (N) of contact and least gap (m) at a turning point in flight; inf without one.
    """

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
    measure: Callable[[], MeasuredInterval] | None = None
    pieces: Sequence[tuple[int, float, float]] = ()
    least_force: float = math.inf
    least_gap: float = math.inf

    @property
    def event_sequence(self) -> str:
        """Sequence of events, as the period begins here."""
        letters = ""
        for kind, mode in zip(self.events["kind"].tolist(), self.events["mode_after"].tolist(), strict=True):
            if kind == LIFTOFF:
                letters += "L"
            elif kind in (IMPACT, CHATTER):
                letters += "S" if mode == Mode.ATTACHED else "I"
        return _shorten(letters, self.restitution)

    @cached_property
    def part(self) -> MeasuredInterval:
        """The measured interval."""
        assert self.measure is not None
        return self.measure()

    @cached_property
    def known(self) -> Known:
        """Extremes and statistics of what was measured; see :func:`vibroplat.report.summary.known_of`."""
        return known_of(self.part.measures)

    @property
    def landing_force(self) -> float:
        """Least F_c after an event with which contact begins (N); inf without one."""
        began = (self.events["kind"] == IMPACT) | (self.events["kind"] == CHATTER)
        forces = self.events["force_after"][began & (self.events["mode_after"] == Mode.ATTACHED)]
        return float(forces.min()) if forces.size else math.inf

    @property
    def slowest_impact(self) -> float:
        """Least speed of an impact with a rebound (m/s); inf without one."""
        rebounds = (self.events["kind"] == IMPACT) & (self.events["mode_after"] == Mode.FLIGHT)
        speeds = -self.events["rate_before"][rebounds]
        return float(speeds.min()) if speeds.size else math.inf

    def section_time(self, *, elsewhere: bool = False, longest: bool = False) -> float:
        """Return when to begin the period (s) so that the section is far from events.

        It is 0 if it is far already, unless it must be ``elsewhere`` all the same. It lies in the ``longest`` piece if
        that is asked for, otherwise in contact, where there are fewer unknowns.
        """
        if not self.events.size:
            return 0.0
        pieces = self._join_pieces()
        system, begin, end = pieces[0]
        fraction = math.inf if longest else MIN_CONTACT_FRACTION
        contact = [p for p in pieces if SYSTEMS[p[0]].algebraic and p[2] - p[1] >= fraction * self.duration]
        best = max(contact or pieces, key=lambda p: p[2] - p[1])
        far = min(-begin, end) > MIN_SECTION_MARGIN * (end - begin) and end - begin > 0.5 * (best[2] - best[1])
        if far and (SYSTEMS[system].algebraic or not contact) and not elsewhere:
            return 0.0
        return float((0.5 * (best[1] + best[2])) % self.duration)

    def _join_pieces(self) -> list[tuple[int, float, float]]:
        """Join the pieces between events; the first begins before 0, where the last piece of the period does."""
        times = set(self.events["t"].tolist())
        pieces: list[tuple[int, float, float]] = []
        for system, begin, end in self.pieces:
            if pieces and pieces[-1][0] == system and begin not in times:
                pieces[-1] = (system, pieces[-1][1], end)
            else:
                pieces.append((system, begin, end))
        if len(pieces) > 1 and pieces[0][0] == pieces[-1][0] and 0.0 not in times:
            _, begin, _ = pieces.pop()
            pieces[0] = (pieces[0][0], begin - self.duration, pieces[0][2])
        return pieces


@lru_cache
def canonical_sequence(word: str, restitution: float = 0.0) -> str:
    """Rotate a word so that it does not depend on where the period begins: the first rotation in the alphabet.

    With a restitution the period may begin between impacts that accumulate.
    """
    begin = word.rfind("S") + 1
    word = _shorten(word[begin:] + word[:begin], restitution)
    return min((word[k:] + word[:k] for k in range(len(word))), default="")


def _shorten(word: str, restitution: float) -> str:
    """Let impacts before one that sticks belong to it.

    They are infinitely many, and how many of them are followed one by one depends on the tolerance.
    """
    return re.sub("I+S", "S", word) if restitution > 0.0 else word


def event_sequence_text(word: str) -> str:
    """Write a word out for a table."""
    return " ".join(EVENT_NAMES[letter] for letter in word) or "none"


def _view_measured(record: npt.NDArray[np.void], like: Accumulators, energies: list[list[float]]) -> MeasuredInterval:
    """Return the measured interval of a shot from its record, with the energies of its ends."""
    before, after = (Energies(*numbers) for numbers in energies)
    return MeasuredInterval(unpacked(record, like), before, after)


#: Shooters that have been given back, and how many of them are kept: combinations of a grid take turns.
_IDLE: list[Shooter] = []
MAX_IDLE = 4


def _likeness_of(scene: Scene, keys: Sequence[str], course: tuple[float, float] | None) -> tuple[Any, ...]:
    """Return what scenes have in common whose shots one shooter can take: with keys, all of it."""
    own = (scene, *keys, course) if keys else ()
    return scene.solver, chosen_engine(scene), scene.modes, scene.coordinates, len(scene.measured_points), *own


class Shooter:
    """Takes shots of a scene, at any values of some of its keys.

    Scales and tolerances are those of the scene as it was given, so that shots depend smoothly on the values.

    Parameters
    ----------
    scene, keys
        The scene, and its dotted keys that vary.
    course
        Range of the first key that shots will mostly be in, if it is the only one.

    Attributes
    ----------
    p
        Parameters at present.
    records
        What compiled shots read and change.
    newton, contracts
        Compiled functions that take shots, for :meth:`call`.
    answers
        What is done for each wish of compiled code.
    """

    def __init__(self, scene: Scene, keys: Sequence[str] = (), course: tuple[float, float] | None = None) -> None:
        scene.require_orbits("a periodic orbit")
        self.scene = scene
        self.keys = tuple(keys)
        self._likeness = _likeness_of(scene, keys, course)
        self.scales = state_scales(scene)
        self.p = parameters(scene)
        self.engine = make_engine(scene, self.p)
        self.motion = Simulator(scene, self.p, self.engine)
        self.answers: dict[int, Callable[[], None]] = {
            ADVANCE: self.motion.go_on,
            SET: lambda: self.set(self.records.values.tolist()),
            SET_DIRECTIONS: self._set_with_directions,
        }
        self._variation = Variation([self.p.copy()] * len(self.keys))
        self._statistics = Statistics(0.0, 0, len(scene.measured_points), scope=WITH_EXTREMES)
        self._measured = packed(self._statistics.measures)
        self._statistics.measures = unpacked(self._measured, self._statistics.measures)
        answers = self.answers
        self._python = PythonFunction(lambda wish: answers[wish]())
        self.newton, self.contracts = quick_call(newton), quick_call(contracts)
        self._shoot, self._set_parameters = quick_call(shoot), quick_call(set_parameters)
        records = shot_records(
            self.motion.automaton,
            self.motion.beginning,
            self.engine.compiled_loop(self.motion.automaton),
            self._python.address,
            self._variation,
            self._statistics,
            self._measured.view(float),
            NO_COURSE if course is None or len(self.keys) != 1 else course_of(scene, self.keys[0], *course),
            self.motion.held_parameters,
        )
        place = address_of(shoot, records, records.end, 0.0, True, True, True)
        self.records = records._replace(shoot=place)

    @classmethod
    def borrow(cls, scene: Scene, keys: Sequence[str] = (), course: tuple[float, float] | None = None) -> Shooter:
        """Return one that was given back, if its scene was like this one, or the same with the same keys; or a new one.

        That saves two thirds of the time, and gives the same shots to the last bit.
        """
        likeness = _likeness_of(scene, keys, course)
        for idle in [one for one in _IDLE if one._likeness == likeness]:
            with suppress(ValueError):
                _IDLE.remove(idle)  # unless another thread has taken it
                idle.scene, idle.scales = scene, state_scales(scene)
                idle.motion.take(scene, parameters(scene))
                idle.records = idle.records._replace(statistics=idle._statistics.callee(idle.motion.automaton))
                idle.records.held[:] = math.nan
                idle.take_turns()
                return idle
        return cls(scene, keys, course)

    def give_back(self) -> None:
        """Take no more shots of this scene; it is kept for the next one that is borrowed, if its engine can be."""
        renew = getattr(self.engine, "renew", None)
        if renew is None:
            self.close()
            return
        renew()
        _IDLE.append(self)
        for other in _IDLE[:-MAX_IDLE]:
            with suppress(ValueError):
                _IDLE.remove(other)
                other.close()

    def close(self) -> None:
        """Free what the engine holds, and take no more shots."""
        self.engine.close()
        self.answers.clear()  # they hold this, which would wait for the garbage collector

    def scene_at(self, values: Mapping[str, float]) -> Scene:
        """Return the scene with other values of keys, without a check of their ranges."""
        return cast("Scene", with_values(self.scene, values))

    def set(self, values: Sequence[float]) -> None:
        """Change the values of the keys for the shots to come."""
        if not self.keys or self._set_parameters(self.records, values[0]):
            return
        wanted = dict(zip(self.keys, values, strict=True))
        if wanted != self.held:
            self.motion.set_parameters(parameters(self.scene_at(wanted)))
            self.records.held[:] = values

    @property
    def held(self) -> dict[str, float]:
        """Values of the keys at present, nan at first."""
        return dict(zip(self.keys, self.records.held.tolist(), strict=True))

    def direction(self, key: str) -> FloatArray:
        """Differentiate the parameters' numbers by a key at the present values."""
        value = self.held[key]
        step = KEY_STEP_RATIO * abs(value) or KEY_STEP_RATIO
        above, below = (parameters(self.scene_at(self.held | {key: value + s})) for s in (step, -step))
        slope: FloatArray = (flat(above) - flat(below)) / (2.0 * step)
        return slope

    def _set_with_directions(self) -> None:
        """Change the values of the keys, and the directions in which the next shot is varied."""
        self.set(self.records.values.tolist())
        self.vary()

    def vary(self) -> None:
        """Let the next full shot be differentiated by the keys at the present parameters."""
        if self.keys and not self._set_parameters(self.records, self.records.held[0]):
            self._variation.turn([self.direction(key) for key in self.keys])

    def returns(self, turns: int) -> Iterator[FloatArray]:
        """Yield full states on the section, φ₁ = 0, where the present motion nearly repeats after turns, nearest first.

        In chaos unstable orbits are there.
        """
        states = list[FloatArray]()
        while len(states) < RETURN_TURNS and self.motion.to_section(1, 4.0 * TURN / self.scene.speed_scale):
            states.append(self.motion.state)
        if len(states) > turns:
            points = np.array(states)
            away = points[turns:] - points[:-turns]
            away[:, 3:5] = wrap(away[:, 3:5])
            yield from points[np.abs(away / self.scales).max(axis=1).argsort()[:MAX_RETURNS]]

    def shot(
        self, start: FloatArray, duration: float, *, full: bool = False, measured: bool = False, events: bool = True
    ) -> Shot:
        """Follow the motion from a full state for a duration (s).

        It is ``measured`` if that is asked for; if ``full``, with rates, derivative and the margins of the guards too.
        Without ``events`` it has neither them nor these margins, and takes less time.
        """
        start, measured = np.ascontiguousarray(start, float), measured or full
        if full:
            self.vary()
        while True:
            self.call(self._shoot, start, duration, full, measured, events)
            if self.has_room():
                return self.last_shot(duration, full=full, measured=measured)

    def call(self, kernel: Callable[..., T], *arguments: Any) -> T:
        """Call a compiled function that takes shots, of their records and of these arguments."""
        result = kernel(self.records, *arguments)
        self._python.check()
        return result

    def has_room(self) -> bool:
        """Whether all events and pieces of the last shot were noted; if not, there is room for them from now on."""
        _, _, events, pieces, _ = self.records.shot.item()
        if events <= self.records.events.size and pieces <= self.records.pieces.size:
            return True
        self.records = self.records._replace(events=np.zeros(2 * events, EVENT), pieces=np.empty(2 * pieces, PART))
        return False

    def last_shot(self, duration: float, *, full: bool, measured: bool) -> Shot:
        """Copy the last shot from the records."""
        records, motion = self.records, self.motion
        begins, ends, events, pieces, _ = records.shot.item()
        h, state, happened = motion.automaton, records.end.copy(), records.events[:events].copy()
        restitution = float(h.p["restitution"])
        shot = Shot(state, begins, ends, duration, motion.outcome, motion.detail, happened, restitution)
        if measured:
            record = np.ndarray(1, self._measured.dtype, records.measured.copy())  # a view would be checked in Python
            shot.measure = partial(_view_measured, record, self._statistics.measures, records.energies.tolist())
        if full:
            shot.derivative, shot.rates = self._variation.arrived, self._variation.rates
            shot.pieces = records.pieces[:pieces].tolist()
            shot.least_force, shot.least_gap = records.least.tolist()
        return shot

    def take_turns(self) -> float:
        """Return the turns of exciter 1 in all shots since the last call."""
        turns, self.records.shot["turns"] = float(self.records.shot["turns"]), 0.0
        return turns
