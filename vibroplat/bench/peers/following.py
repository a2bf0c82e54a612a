"""A peer's run: its integrator behind the seam, the package's automaton around it, what the comparison needs of it.

Modes, guards, impacts and latches are the automaton's own, at the tolerance that the peer is run with, so that peers
differ in how they integrate and in nothing else. Those that hand over steps are driven by
:class:`vibroplat.integrate.stepwise.Stepwise`; those that find events themselves, and would be slowed down by a return
to Python for each step, are engines of their own: :class:`Legs`.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import COORDINATES, RATES, Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.loop import AT_GUARD, AT_TIME, begin, conclude
from vibroplat.hybrid.state import RUNNING, Automaton, rewind
from vibroplat.integrate.seam import WORK, Integrator
from vibroplat.integrate.stepwise import Stepwise
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.accelerations import accelerations, explicit, linearize
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.systems import FULL_SIZE, GAP, SYSTEMS, System
from vibroplat.motion.motion import Motion
from vibroplat.motion.recorder import Recorder
from vibroplat.results.run import Trajectory


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
        """Liftoffs, impacts and latches, in columns of the package's event table."""
        return pd.DataFrame(self.rows, columns=["t_s", "kind", "gap_rate_before_m_per_s"])


#: Least tolerance of the automaton; peers' own may be lower.
FINEST = 1e-12


def at_tolerance(scene: Scene, tolerance: float) -> Scene:
    """Return a scene whose transitions are as accurate as a peer."""
    return scene.replace({"solver.tolerance": max(tolerance, FINEST)})


def follow(scene: Scene, peer: Timed | Legs, times: FloatArray | None = None) -> Followed:
    """Integrate a scene with a peer.

    Parameters
    ----------
    times
        Ascending times at which states are wanted (s).

    Raises
    ------
    RuntimeError
        The run ended early.
    """
    p = parameters(scene)
    engine = peer if isinstance(peer, Legs) else Stepwise(peer, p)
    if isinstance(peer, Legs):
        peer.times = times
    peer.alone_s = 0.0
    recorder = Recorder(scene, "events" if times is None else "segments")
    motion = Motion(scene, p, engine)
    began = time.perf_counter()
    motion.to_time(scene.run.duration_s, [recorder])
    wall = time.perf_counter() - began
    if motion.outcome != "ok":
        raise RuntimeError(f"{motion.outcome}: {motion.detail}")
    run = Trajectory(scene, {}, segments=recorder.segments, event_rows=recorder.events)
    found = sampled(run, times)
    found.wall_s, found.core_s, found.forces = wall, peer.alone_s, None
    return found


def sampled(run: Trajectory, times: FloatArray | None) -> Followed:
    """Evaluate a run at times, and list its events."""
    rows = list(run.events[["t_s", "kind", "gap_rate_before_m_per_s"]].itertuples(index=False, name=None))
    if times is None:
        return Followed(np.empty((0, FULL_SIZE)), [], rows=rows)
    table, states = run(times), np.zeros((times.size, FULL_SIZE))
    for place, name in enumerate((*COORDINATES, *RATES)):
        if name in table:
            states[:, place] = table[name]
    forces = table["contact_force_n"].to_numpy() if "contact_force_n" in table else None
    return Followed(states, list(table["mode"]), rows=rows, forces=forces)


class Timed(Integrator, Protocol):
    """An integrator that measures the time spent in its library (s)."""

    alone_s: float


class Leg(NamedTuple):
    """A mode's stretch up to its end.

    Attributes
    ----------
    fell
        Whether the guard fell through zero there.
    end
        The system's differential unknowns there.
    lengths, coefficients
        Its steps, as an integrator hands them over.
    """

    fell: bool
    end: FloatArray
    lengths: FloatArray
    coefficients: FloatArray


def straight(points: list[FloatArray], lengths: list[float], fell: bool) -> Leg:
    """Make a leg of which only some points are known: one more than lengths."""
    coefficients = [[a, b - a] for a, b in pairwise(points)]
    return Leg(fell, points[-1], np.array(lengths), np.array(coefficients))


class Legs(ABC):
    """An engine of a library that finds events itself.

    Attributes
    ----------
    rows, turns_per_segment
        As of an engine; a segment may take half of the rows.
    times
        Ascending times at which states are wanted (s); None in timed runs, where legs need only have ends.
    alone_s
        Time spent in the library (s).
    """

    name = "legs"
    degree = 3
    rows, turns_per_segment = 4096, 50.0
    detail = ""

    def __init__(self) -> None:
        self.times: FloatArray | None = None
        self.alone_s = 0.0

    @property
    def work(self) -> Mapping[str, int | None]:
        """Nothing is counted."""
        return dict.fromkeys(WORK)

    def close(self) -> None:  # noqa: B027  (most libraries need nothing)
        """Do nothing: Python frees what the library holds."""

    @abstractmethod
    def leg(self, mode: Mode, t: float, y: FloatArray, until: float) -> Leg:
        """Integrate a mode from time ``t`` of the run to its guard or to time ``until``; RuntimeError if it fails."""

    def advance(self, h: Automaton) -> None:
        """Carry a run on; see :class:`vibroplat.integrate.seam.Engine`."""
        rewind(h.steps)
        run, used = h.run, h.steps.used
        while run["outcome"] == RUNNING and 2 * used["steps"] < self.rows and begin(h):
            mode, origin = Mode(int(run["mode"])), float(run["origin"])
            system = SYSTEMS[run["systems"][mode]]
            start = run["y"][mode, : system.differential].copy()
            began = time.perf_counter()
            leg = self.leg(mode, origin, start, origin + float(run["until"]))
            self.alone_s += time.perf_counter() - began
            first, n = int(used["steps"]), system.differential
            used["steps"] += len(leg.lengths)
            rows = slice(first, first + len(leg.lengths))
            h.steps.start[rows] = np.cumsum(leg.lengths) - leg.lengths
            h.steps.length[rows] = leg.lengths
            h.steps.c[rows] = 0.0
            h.steps.c[rows, : leg.coefficients.shape[1], :n] = leg.coefficients
            h.steps.ends[rows, :n] = leg.coefficients.sum(axis=1)
            h.steps.ends[used["steps"] - 1, :n] = leg.end
            conclude(h, AT_GUARD if leg.fell else AT_TIME)


# -- explicit equations, as a user of an ODE solver writes them -------------------------------------------

#: y′ or a number, of time and differential unknowns.
Flow = Callable[[float, FloatArray], FloatArray]


def flow(system: System, p: Parameters) -> Flow:
    """Make y′ = f(t, y) of the differential unknowns, F_c eliminated."""
    number, n = system.index, system.differential
    return lambda t, y: explicit(number, t, y, p)[:n]


def guard(system: System, p: Parameters) -> Callable[[float, FloatArray], float]:
    """Make what ends a mode by its fall through zero: F_c (N) or the gap (m)."""
    number = system.index
    if system.mode is Mode.FLIGHT:
        return lambda t, y: float(y[GAP])
    return lambda t, y: float(explicit(number, t, y, p)[-1])


def jacobian(system: System, p: Parameters) -> Flow:
    """Make ∂f/∂y, shape (2n, 2n)."""

    def found(t: float, y: FloatArray) -> FloatArray:
        unknowns, yp, slopes = system.unknowns(system.full(y)), np.empty(system.size), np.empty((y.size, system.size))
        accelerations(system.index, t, unknowns, yp, p)
        linearize(system.index, t, unknowns, yp, slopes, p)
        return slopes[:, : y.size].T

    return found
