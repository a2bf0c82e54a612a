"""The loop of a run: how it begins, how a segment begins and what follows its end, for every integrator.

An engine calls :func:`begin_segment`, integrates from the start that is prepared there, adds its steps to ``steps``,
and calls :func:`end_segment` with the reason why it stopped.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import BARE, FLIGHT
from vibroplat.hybrid.resets import apply_chatter, apply_reset, contact_mode, meet_guard, take_mode
from vibroplat.hybrid.starts import close_piece, is_outside_model, last_end, prepare_consistent_start, start_callback
from vibroplat.hybrid.state import (
    CONSISTENT,
    EVENT,
    FORCE_NOISE,
    NON_FINITE,
    OK,
    OUTSIDE_MODEL,
    RESTARTED,
    ROUND_OFF,
    RUN,
    RUNNING,
    SOLVER_FAILURE,
    TOO_MANY_EVENTS,
    Automaton,
    Steps,
    absolute_tolerances,
    force_noise,
    initial_state,
    state_scales,
)
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.model.parameters import PARAMETERS, Parameters
from vibroplat.model.systems import GAP, GAP_RATE, gather, systems

#: Events between two readings of their list. Where steps are read, an engine returns well before that: they are full.
EVENT_ROWS = 2048


def automaton(
    scene: Scene,
    p: np.record,
    steps: Steps,
    turns_per_segment: float,
    state: FloatArray | None = None,
    time: float = 0.0,
    event_rows: int = EVENT_ROWS,
) -> Automaton:
    """Build the automaton of a scene at a full state and a time (s), or at its own initial state.

    Parameters
    ----------
    p, steps
        Parameters of the scene, and where steps are written.
    turns_per_segment
        Turns of the synchronous speed after which a segment without an event is ended and restarted.
    event_rows
        Events for which there is room until they are read.
    """
    kept, runs = np.array([p], PARAMETERS), beginning(scene, turns_per_segment, state, time, p)
    return Automaton(
        p=kept[0],
        run=runs[0],
        recent=np.empty(scene.solver.max_events_per_period),
        events=np.zeros(event_rows, EVENT),
        steps=steps,
        start=start_callback.address,
        parameters=kept.ctypes.data,
    )


def beginning(
    scene: Scene,
    turns_per_segment: float,
    state: FloatArray | None = None,
    time: float = 0.0,
    p: Parameters | None = None,
) -> npt.NDArray[np.void]:
    """Return the record of a run that begins, one of :data:`vibroplat.hybrid.state.RUN`; see :func:`automaton`."""
    runs = np.zeros(1, RUN)
    runs["systems"], runs["tolerances"] = -1, 1.0
    for mode, system in systems(scene).items():
        runs["systems"][0, mode] = system.index
        runs["tolerances"][0, mode, : system.size] = absolute_tolerances(scene, system)
    begun = initial_state(scene, p=p) if state is None else state
    runs["state"][:, : len(begun)] = begun
    runs["now"], runs["end"] = time, time + scene.run.duration_s
    runs["speed"] = speed = scene.speed_scale
    runs["period"] = period = TURN / speed
    runs["longest"] = turns_per_segment * period
    runs["tolerance"] = scene.solver.tolerance
    runs["force_noise"] = FORCE_NOISE * scene.force_scale
    if scene.transport is not None:
        runs["force_error"] = force_noise(scene, p)
    runs["gap_scale"] = scale = state_scales(scene)[GAP]
    runs["slowest"] = math.sqrt(ROUND_OFF) * scale * speed
    runs["target"] = math.nan
    return runs


# Why a segment ended: its guard fell through zero, its time is up, the angle that the run waits for is reached, the
# integrator has failed, something is not finite.
AT_GUARD, AT_TIME, AT_TARGET, FAILED, NOT_FINITE = range(5)


@compiled
def first_mode(h: Automaton) -> None:
    """Choose the mode of a state, which may say itself that it flies: its gap is open or opening."""
    run = h.run
    if run.systems[BARE] >= 0:
        run.mode = BARE
    elif run.state[GAP] > 0.0 or run.state[GAP_RATE] > 0.0:
        run.mode = FLIGHT
        run.zeros = 1 if run.state[GAP] == 0.0 else 0
    else:
        mode = contact_mode(h)
        if mode >= 0:
            take_mode(h, mode)


@compiled
def begin_segment(h: Automaton) -> bool:
    """Prepare a segment: its consistent start, its tolerances and how long it may take.

    Returns False, with the outcome set, where the run ends instead.
    """
    run = h.run
    if run.accumulating == 1:  # the run was to stop at the impact before
        run.accumulating = 0
        apply_chatter(h)
        if run.outcome != RUNNING:
            return False
    if run.now >= run.end:  # the last event was at the very end
        run.outcome = OK
        return False
    max_restarts = h.recent.size
    oldest = run.restarts % max_restarts  # all restarts count, so that nothing can go on for ever
    if run.restarts >= max_restarts and run.now - h.recent[oldest] < run.period:
        run.outcome = OUTSIDE_MODEL if is_outside_model(h) else TOO_MANY_EVENTS
        return False
    h.recent[oldest] = run.now
    run.restarts += 1
    mode = run.mode
    if not prepare_consistent_start(h, mode, CONSISTENT):
        return False
    for exciter in range(2):  # whole turns of its angle
        whole = TURN * math.floor(run.state[3 + exciter] / TURN)
        run.state[3 + exciter] -= whole
        run.turns[exciter] += whole
    gather(run.systems[mode], run.state, run.y[mode])
    left = run.end - run.now
    run.origin = run.now
    run.until = min(left, run.longest)
    run.final = left <= run.longest
    for i in range(run.atol.size):
        run.atol[i] = run.tolerances[mode, i]
    return True


@compiled
def end_segment(h: Automaton, stop: int) -> None:
    """Close the open piece and apply the reset at its end; ``stop`` is why the integrator has stopped."""
    run, last = h.run, h.steps.used.steps - 1
    if last >= h.steps.used.first:
        run.now = last_end(h)
    if stop == AT_GUARD:
        meet_guard(h, last)
    final = stop == AT_TIME and run.final == 1
    if h.steps.used.steps > h.steps.used.first:
        close_piece(h, run.end if final else last_end(h))
    if run.outcome != RUNNING:
        return
    if final or stop == AT_TARGET:
        run.outcome = OK
        run.joined = RESTARTED
    elif stop == AT_TIME:
        run.joined = RESTARTED
    elif stop == FAILED:
        run.outcome = OUTSIDE_MODEL if is_outside_model(h) else SOLVER_FAILURE
    elif stop == NOT_FINITE:
        run.outcome = OUTSIDE_MODEL if is_outside_model(h) else NON_FINITE
    else:
        apply_reset(h)
