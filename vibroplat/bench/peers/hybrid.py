"""The transitions that every peer shares, and what a peer returns.

Modes, guards and the impact law are those of the package. Impacts are followed one by one. An impact is
inelastic below the scene's sticking speed, and where its rebound would be slower than :data:`SLOWEST_REBOUND`, as
in the reference trajectories.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pandas as pd

from vibroplat.hybrid.initial import initial_state
from vibroplat.model.accelerations import accelerations
from vibroplat.model.impact import impact
from vibroplat.model.parameters import FloatArray, parameters
from vibroplat.model.systems import FULL_SIZE, GAP, GAP_RATE, System, systems
from vibroplat.scene import Mode, Scene

#: Impacts with slower rebounds are taken as inelastic (m/s).
SLOWEST_REBOUND = 1e-7

#: Longest step in flight of integrators that could pass over a short flight, in turns.
FLIGHT_STEP = 0.05

#: Most transitions within a turn of the larger synchronous speed.
MOST_EVENTS = 2000


@dataclass(frozen=True)
class Leg:
    """One mode's stretch up to its end.

    Attributes
    ----------
    t
        Its end (s).
    y
        The system's differential unknowns there.
    fell
        Whether the guard fell through zero there.
    samples
        The unknowns at the times asked for that lie in the stretch, shape (times, 2n).
    """

    t: float
    y: FloatArray
    fell: bool
    samples: FloatArray


class Integrator(Protocol):
    """A peer, made for one scene and tolerance."""

    def advance(self, mode: Mode, t: float, y: FloatArray, until: float, times: FloatArray) -> Leg:
        """Integrate a mode from time ``t`` to its guard or to ``until``.

        ``times`` are those after ``t`` and up to ``until`` at which states are wanted; none in timed runs.
        """


@dataclass
class Followed:
    """What came of a run.

    Attributes
    ----------
    states
        Full states at the times asked for, shape (times, 14).
    modes
        Modes there.
    wall_s, core_s
        Time of the run, and of it in the integrator.
    rows
        Time, kind and gap rate before of each event.
    forces
        Contact force at those times, where a peer has it (N).
    """

    states: FloatArray
    modes: list[str]
    wall_s: float = 0.0
    core_s: float = 0.0
    rows: list[tuple[float, str, float]] = field(default_factory=list)
    forces: FloatArray | None = None

    @property
    def events(self) -> pd.DataFrame:
        """Liftoffs and impacts, in columns of the package's event table."""
        return pd.DataFrame(self.rows, columns=["t_s", "kind", "gap_rate_before_m_per_s"])


class StormError(RuntimeError):
    """More transitions within a turn than anyone would follow."""


def follow(scene: Scene, integrator: Integrator, times: FloatArray | None = None) -> Followed:
    """Integrate a scene with a peer.

    Parameters
    ----------
    times
        Ascending times at which states are wanted (s).

    Raises
    ------
    StormError
        Impacts do not come to an end.
    """
    times = np.empty(0) if times is None else times
    run = _Run(scene, integrator, times)
    began = time.perf_counter()
    run.go()
    run.found.wall_s = time.perf_counter() - began
    return run.found


class _Run:
    """A run on its way."""

    def __init__(self, scene: Scene, integrator: Integrator, times: FloatArray) -> None:
        self.p = parameters(scene)
        self.systems: dict[Mode, System] = systems(scene)
        self.integrator = integrator
        self.duration = scene.run.duration_s
        self.period = 2.0 * np.pi / scene.speed_scale
        self.times = times
        self.state = initial_state(scene)
        self.t = 0.0
        self.inelastic = self.p.copy()
        self.inelastic.restitution = 0.0
        self.found = Followed(np.zeros((times.size, FULL_SIZE)), [""] * times.size)

    def go(self) -> None:
        """Go through legs and transitions to the end."""
        mode = self.first_mode()
        sampled = int(np.searchsorted(self.times, 0.0, side="right"))
        self.keep(0, np.repeat(self.state[None], sampled, axis=0), mode)
        rows = self.found.rows
        while self.t < self.duration:
            system = self.systems[mode]
            wanted = self.times[sampled:]
            began = time.perf_counter()
            leg = self.integrator.advance(mode, self.t, self.state[system.places], self.duration, wanted)
            self.found.core_s += time.perf_counter() - began
            self.keep(sampled, system.full(leg.samples), mode)
            sampled += len(leg.samples)
            self.t, self.state = leg.t, system.full(leg.y)
            if leg.fell:
                mode = self.lift_off() if mode is Mode.ATTACHED else self.strike()
            if len(rows) > MOST_EVENTS and self.t - rows[-MOST_EVENTS][0] < self.period:
                raise StormError(f"{MOST_EVENTS} events within a turn at t = {self.t:.6g} s")

    def keep(self, first: int, states: FloatArray, mode: Mode) -> None:
        """Keep states at the next of the times asked for."""
        self.found.states[first : first + len(states)] = states
        self.found.modes[first : first + len(states)] = [mode.label] * len(states)

    def first_mode(self) -> Mode:
        """Choose the mode of the initial state."""
        if Mode.BARE in self.systems:
            return Mode.BARE
        flying = self.state[GAP] > 0.0 or self.state[GAP_RATE] > 0.0
        return Mode.ATTACHED if not flying and self.pressure() > 0.0 else Mode.FLIGHT

    def pressure(self) -> float:
        """F_c if the layer were attached (N)."""
        system = self.systems[Mode.ATTACHED]
        y = system.unknowns(self.state)
        accelerations(system.index, self.t, y, np.empty(system.size), self.p)
        return float(y[-1])

    def lift_off(self) -> Mode:
        """Release the lower layer."""
        self.found.rows.append((self.t, "liftoff", 0.0))
        return Mode.FLIGHT

    def strike(self) -> Mode:
        """Let the lower layer strike; it stays where it does not rebound and is pressed on."""
        before, after = self.state, np.empty(FULL_SIZE)
        approach = -before[GAP_RATE]
        self.found.rows.append((self.t, "impact", before[GAP_RATE]))
        slow = approach < self.p.sticking_speed or self.p.restitution * approach < SLOWEST_REBOUND
        impact(before, after, self.inelastic if slow else self.p)
        self.state = after
        return Mode.ATTACHED if slow and self.pressure() > 0.0 else Mode.FLIGHT
