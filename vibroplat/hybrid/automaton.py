"""How a scene fills the records of a run."""

from __future__ import annotations

import math

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.hybrid.initial import initial_state
from vibroplat.hybrid.scales import FORCE_NOISE, ROUND_OFF, absolute_tolerances, state_scales
from vibroplat.hybrid.starts import start_callback
from vibroplat.hybrid.state import EVENT, RUN, Automaton
from vibroplat.hybrid.steps import Steps
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import PARAMETERS
from vibroplat.model.systems import GAP, systems

#: Events between two readings of their list: an engine returns when its steps are full, well before that.
_EVENT_ROWS = 4096


def automaton(
    scene: Scene,
    p: np.record,
    steps: Steps,
    turns_per_segment: float,
    state: FloatArray | None = None,
    time: float = 0.0,
) -> Automaton:
    """Build the automaton of a scene at a full state, or at its own initial state.

    Parameters
    ----------
    p
        Parameters of the scene.
    steps
        Where steps are written.
    turns_per_segment
        Turns of the synchronous speed after which a segment without an event is ended and restarted.
    state
        Full state, shape (14,).
    time
        When it begins (s).
    """
    kept, runs = np.array([p, p], PARAMETERS), np.zeros(1, RUN)
    kept["restitution"][1] = 0.0
    runs["systems"], runs["tolerances"] = -1, 1.0
    for mode, system in systems(scene).items():
        runs["systems"][0, mode] = system.index
        runs["tolerances"][0, mode, : system.size] = absolute_tolerances(scene, system)
    runs["state"] = initial_state(scene) if state is None else state
    runs["now"], runs["end"] = time, time + scene.run.duration_s
    runs["speed"] = speed = scene.speed_scale
    runs["period"] = period = 2.0 * math.pi / speed
    runs["longest"] = turns_per_segment * period
    runs["tolerance"] = scene.solver.tolerance
    runs["force_noise"] = FORCE_NOISE * scene.force_scale
    runs["gap_scale"] = scale = state_scales(scene)[GAP]
    runs["slowest"] = math.sqrt(ROUND_OFF) * scale * speed
    runs["target"], runs["awaited"] = math.nan, -1
    return Automaton(
        p=kept[0],
        inelastic=kept[1],
        run=runs[0],
        recent=np.empty(scene.solver.max_events_per_period),
        events=np.zeros(_EVENT_ROWS, EVENT),
        steps=steps,
        start=start_callback.address,
        parameters=kept.ctypes.data,
    )
