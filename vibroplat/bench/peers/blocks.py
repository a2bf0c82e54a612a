"""PathSim: one ODE block for each mode, its right-hand side compiled, with a zero-crossing event.

PathSim weighs local errors in the maximum norm, finds events by shortening steps (regula falsi), and
has no dense output: states that are asked for end a run each, on steps of the size there was.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pathsim import Simulation
from pathsim.blocks import ODE
from pathsim.events import ZeroCrossingDown
from pathsim.solvers import RKCK54, RKDP87

from vibroplat.bench.peers.following import Leg, Legs, flow, guard, straight
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import ROUND_OFF, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.systems import GAP, System, systems

#: Longest step in a mode that may end, in turns: a longer one could pass over a short flight.
LONGEST = 0.1

#: First step of a stretch, in turns.
FIRST_STEP = 1e-3

#: Time that an event need not be located within (s); PathSim takes no steps below a tenth of it.
SHORTEST = 1e-15

#: How near to zero a guard is at its event, over the tolerance, in units of F_c's scale or the flight's height.
EVENT_SHARE = 0.1

#: The faster of its explicit solvers: order 8 where nothing ends a mode, order 5 where events keep steps short.
SOLVERS = {Mode.BARE: RKDP87, Mode.ATTACHED: RKCK54, Mode.FLIGHT: RKCK54}

TINY = float(np.finfo(float).tiny)


class PathSim(Legs):
    """One simulation for each mode, whose state is set at every restart; known only where it is asked for."""

    name = "PathSim"

    def __init__(self, scene: Scene, tolerance: float) -> None:
        super().__init__()
        self.p = p = parameters(scene)
        self.systems, scales = systems(scene), state_scales(scene)
        period = 2.0 * np.pi / scene.speed_scale
        self.share = EVENT_SHARE * tolerance
        self.scales = {Mode.ATTACHED: scene.force_scale, Mode.FLIGHT: scene.length_scale, Mode.BARE: 0.0}
        self.first = FIRST_STEP * period
        self.simulations = {
            mode: _Mode(
                system,
                p,
                Solver=SOLVERS[mode],
                dt_max=None if mode is Mode.BARE else LONGEST * period,
                tolerance_lte_abs=tolerance * scales[system.places],
                tolerance_lte_rel=ROUND_OFF,
            )
            for mode, system in self.systems.items()
        }

    def leg(self, mode: Mode, t: float, y: FloatArray, until: float) -> Leg:
        """See :class:`vibroplat.bench.peers.following.Legs`."""
        one = self.simulations[mode]
        step, near = self.first, self.share * self.scales[mode]
        rate = y.size // 2 + GAP
        if mode is Mode.FLIGHT and y[rate] > 0.0:
            # a step beyond the landing would not see the gap fall, and a low flight needs a near event
            rise = y[rate] / max(-flow(self.systems[mode], self.p)(t, y)[rate], TINY)
            step = min(step, rise)
            near = max(min(near, self.share * 0.5 * rise * y[rate]), SHORTEST * y[rate])
        one.start(t, y, step, near)
        points, ends = [y], [t]
        wanted = [] if self.times is None else self.times[(self.times > t) & (self.times < until)].tolist()
        for end in (*wanted, until):
            one.run(end)
            points.append(one.block.state.copy())
            ends.append(one.simulation.time)
            if one.fell:
                break
        return straight(points, np.diff(ends).tolist(), one.fell)


class _Mode:
    """Simulation of one mode."""

    def __init__(self, system: System, p: Parameters, **options: Any) -> None:
        rates, falling = flow(system, p), guard(system, p)
        self.block = ODE(lambda x, u, t: rates(t, x), np.zeros(system.differential))
        self.events = []
        self.fell = False
        if system.mode is not Mode.BARE:
            self.events = [ZeroCrossingDown(lambda t: falling(t, self.block.state), self.end)]
        self.simulation = Simulation([self.block], events=self.events, log=False, **options)

    def end(self, t: float) -> None:
        """End a run at its event."""
        self.fell = True
        self.simulation.stop()

    def start(self, t: float, y: FloatArray, step: float, near: float) -> None:
        """Set time and state, the first step, and how near an event is to be."""
        self.fell = False
        self.simulation.reset(t)
        self.block.state = y.copy()
        self.simulation.dt = step
        for event in self.events:
            event.tolerance = near

    def run(self, until: float) -> None:
        """Integrate until a time, or the event."""
        duration = until - self.simulation.time
        if duration > 0.0:
            self.simulation.dt = min(self.simulation.dt, duration)
            self.simulation.run(duration)
