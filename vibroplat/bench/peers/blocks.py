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

from vibroplat.bench.peers.equations import flow, guard
from vibroplat.bench.peers.hybrid import Leg
from vibroplat.hybrid.scales import ROUND_OFF, state_scales
from vibroplat.model.parameters import FloatArray, Parameters, parameters
from vibroplat.model.systems import GAP, System, systems
from vibroplat.scene import Mode, Scene

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


class PathSim:
    """One simulation for each mode, whose state is set at every restart."""

    def __init__(self, scene: Scene, tolerance: float) -> None:
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

    def advance(self, mode: Mode, t: float, y: FloatArray, until: float, times: FloatArray) -> Leg:
        """See :class:`vibroplat.bench.peers.hybrid.Integrator`."""
        one = self.simulations[mode]
        step, near = self.first, self.share * self.scales[mode]
        rate = y.size // 2 + GAP
        if mode is Mode.FLIGHT and y[rate] > 0.0:
            # a step beyond the landing would not see the gap fall, and a low flight needs a near event
            rise = y[rate] / max(-flow(self.systems[mode].index, t, y, self.p)[rate], TINY)
            step = min(step, rise)
            near = max(min(near, self.share * 0.5 * rise * y[rate]), SHORTEST * y[rate])
        one.start(t, y, step, near)
        samples = []
        for wanted in times:
            if not one.run(float(wanted)):
                break
            samples.append(one.block.state.copy())
        if not one.fell:
            one.run(until)
        kept = np.array(samples) if samples else np.empty((0, y.size))
        return Leg(one.simulation.time, one.block.state.copy(), one.fell, kept)


class _Mode:
    """Simulation of one mode."""

    def __init__(self, system: System, p: Parameters, **options: Any) -> None:
        number = system.index
        self.block = ODE(lambda x, u, t: flow(number, t, x, p), np.zeros(system.differential))
        self.events = []
        self.fell = False
        if system.mode is not Mode.BARE:
            self.events = [ZeroCrossingDown(lambda t: guard(number, t, self.block.state, p), self.end)]
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

    def run(self, until: float) -> bool:
        """Integrate until a time; whether the event has not ended it before."""
        duration = until - self.simulation.time
        if duration > 0.0:
            self.simulation.dt = min(self.simulation.dt, duration)
            self.simulation.run(duration)
        return not self.fell
