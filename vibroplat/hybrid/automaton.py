"""How a scene fills the arrays of the hybrid automaton."""

from __future__ import annotations

import math

import numpy as np

from vibroplat.hybrid import loop as hy
from vibroplat.hybrid.initial import initial_state
from vibroplat.hybrid.scales import ROUND_OFF, absolute_tolerances, state_scales
from vibroplat.model.parameters import FloatArray, Parameters
from vibroplat.model.systems import FULL_SIZE, GAP, systems
from vibroplat.observe.statistics import no_measures
from vibroplat.scene import Scene

#: Events between two readings of their list: an engine returns when its tape is full, well before that.
_EVENT_ROWS = 4096


def automaton(scene: Scene, p: Parameters, turns_per_segment: float, state: FloatArray | None = None) -> hy.Hybrid:
    """Build the hybrid automaton of a scene at a full state, or at its own initial state."""
    numbers = np.full(3, -1)
    tolerances = np.ones((3, FULL_SIZE))
    for mode, system in systems(scene).items():
        numbers[mode] = system.index
        tolerances[mode, : system.size] = absolute_tolerances(scene, system)
    dead = p.copy()
    dead.restitution = 0.0
    clock, flags = np.zeros(hy.CLOCKS), np.zeros(hy.FLAGS, dtype=np.int64)
    clock[hy.DURATION] = scene.run.duration_s
    clock[hy.PERIOD] = 2.0 * math.pi / scene.speed_scale
    clock[hy.LONGEST] = turns_per_segment * clock[hy.PERIOD]
    clock[hy.GAP_SCALE] = state_scales(scene)[GAP]
    clock[hy.SLOWEST] = math.sqrt(ROUND_OFF) * clock[hy.GAP_SCALE] * scene.speed_scale
    clock[hy.TOLERANCE] = scene.solver.tolerance
    clock[hy.FORCE_NOISE] = 1e-12 * scene.force_scale
    flags[hy.PREPARED] = -1
    return hy.Hybrid(
        p=p,
        p_dead=dead,
        systems=numbers,
        tolerances=tolerances,
        state=initial_state(scene) if state is None else state.copy(),
        turns=np.zeros(2),
        clock=clock,
        flags=flags,
        y=np.zeros((3, FULL_SIZE)),
        yp=np.zeros((3, FULL_SIZE)),
        ypp=np.zeros((3, FULL_SIZE)),
        atol=np.ones(FULL_SIZE),
        recent=np.empty(scene.solver.max_events_per_period),
        events=np.empty((_EVENT_ROWS, hy.IMPACTS + 1)),
        measures=no_measures(0.0),
    )
