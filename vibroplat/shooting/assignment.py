"""Follows motions until each is in an ellipsoid around an orbit and comes nearer there, in compiled code.

A motion stops on the Poincaré section, where :func:`decide` returns how to continue. Motions by engine ``taylor`` run
side by side in lanes: after the decision a stopped motion continues, or another one takes its lane.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.hybrid.state import OK, RUNNING
from vibroplat.integrate.group import Group
from vibroplat.integrate.lockstep import FIRST, attend, run_lanes
from vibroplat.kernels.compiled import FloatArray, borrow, compiled, copy, inlined, wide
from vibroplat.observe.section import ellipsoid_of, form_of, section_angle

# Decisions on a motion: it continues; it is assigned to an ellipsoid; an orbit is to be searched for; it has not
# converged; it has ended early.
GO_ON, ASSIGNED, SEARCH, UNCONVERGED, ENDED = range(5)

#: A motion that is followed.
FOLLOWED = np.dtype(
    [
        ("turns", np.int64),  # of exciter 1 so far, and when an orbit is searched for
        ("search", np.int64),
        ("stride", np.int64),  # turns to the next stop; 0 at first
        ("place", np.int64),  # ellipsoid that the motion has been found in, or −1
        ("before", np.float64),  # its form then
        ("more", np.int64),  # turns that were taken there, if they are not among ``turns``
        ("fresh", np.int64),  # whether the mode of the state is to be found
    ]
)


class Ellipsoids(NamedTuple):
    """Ellipsoids as :func:`vibroplat.observe.section.ellipsoid_of` takes them, and what must be seen in each.

    ``turns`` are those in which a motion must come nearer; ``bound`` is the largest part of its form after that.
    """

    centres: FloatArray
    forms: FloatArray
    systems: npt.NDArray[np.int64]
    turns: npt.NDArray[np.int64]
    bound: FloatArray


class Limits(NamedTuple):
    """How long motions are followed.

    Turns between two stops before and after ``late`` turns; turns without a search at the end, and at most; duration of
    a turn and longest time between two stops (s); form that is near enough.
    """

    early: int
    later: int
    late: int
    unsearched: int
    most: int
    turn: float
    longest: float
    near: float


@inlined
def go_on(run: Any, turns: int, longest: float) -> int:
    """Let a motion stop after a number of turns, or after a time."""
    run.target, run.end, run.outcome = section_angle(run.state[3] + run.turns[0], turns), run.now + longest, RUNNING
    return GO_ON


@compiled
def decide(run: Any, followed: Any, limits: Limits, e: Ellipsoids) -> int:
    """Decide what becomes of a motion that has stopped."""
    if run.outcome not in (OK, RUNNING):
        followed.turns += followed.stride if followed.place < 0 else 0
        return ENDED
    more, place, system = 0, followed.place, run.systems[run.mode]
    if place >= 0:
        form = form_of(run.state, e.centres[place], e.forms[place])
        if e.systems[place] == system and form < max(e.bound[place] * followed.before, limits.near):
            return ASSIGNED
        more, followed.place = e.turns[place], -1
    elif followed.stride > 0:
        followed.turns += followed.stride
        place = ellipsoid_of(run.state, system, e.centres, e.forms, e.systems)
        if place >= 0:
            followed.place = place
            followed.before = form_of(run.state, e.centres[place], e.forms[place])
            return go_on(run, e.turns[place], limits.longest * (e.turns[place] + 1.0))
    searched = followed.stride > 0 and followed.search <= followed.turns + more
    followed.stride = 0
    if searched and followed.turns + more < limits.most - limits.unsearched:
        followed.more = more
        return SEARCH
    followed.turns += more
    if followed.turns >= limits.most or run.now >= limits.most * limits.turn:
        return UNCONVERGED
    stride = limits.early if followed.turns < limits.late else limits.later
    followed.stride = min(stride, limits.most - followed.turns)
    return go_on(run, followed.stride, limits.longest * (limits.later + 1.0))


class Followers(NamedTuple):
    """Motions to be followed, and those in the lanes of a group.

    Attributes
    ----------
    runs, lanes
        Records of :data:`vibroplat.hybrid.state.RUN` as numbers, of all motions and of those in the lanes.
    followed
        Records of :data:`FOLLOWED`.
    waiting, taken
        Numbers of motions in the order in which they are taken; how many have been taken, and how many there are.
    held
        Numbers of the motions in the lanes, or −1.
    recent
        Times of the last restarts of the motion that was given back last (s).
    """

    runs: FloatArray
    lanes: FloatArray
    followed: npt.NDArray[np.void]
    waiting: npt.NDArray[np.int64]
    taken: npt.NDArray[np.int64]
    held: npt.NDArray[np.int64]
    recent: FloatArray


def numbers_of(runs: npt.NDArray[np.void]) -> FloatArray:
    """View records as numbers, a row each."""
    return runs.view(np.float64).reshape(len(runs), -1)


@wide
def follow(owned_g: Group, owned_f: Followers, limits: Limits, e: Ellipsoids) -> tuple[int, int]:
    """Follow motions until one is not assigned but needs more: its number, −1 without one, and what it needs."""
    g, f = borrow(owned_g), borrow(owned_f)
    while True:
        for lane in range(f.held.size):
            if f.held[lane] < 0 and f.taken[0] < f.taken[1]:
                number = f.waiting[f.taken[0]]
                f.taken[0] += 1
                f.held[lane], g.lanes.idle[lane] = number, 0.0
                copy(f.runs[number], f.lanes[lane])
                g.recent[lane][:] = -np.inf  # what restarted there was another motion
                g.lanes.counted[lane], g.lanes.counted_from[lane] = 0.0, g.runs[lane].now
                g.lanes.noisy[lane] = 0.0
                if f.followed[number].fresh == 1:
                    f.followed[number].fresh = 0
                    attend(g, lane, FIRST)
                fate = decide(g.runs[lane], f.followed[number], limits, e)
                if fate != GO_ON:
                    return give_back(g, f, lane), fate
        lane = run_lanes(g)
        if lane < 0:
            return -1, GO_ON
        fate = decide(g.runs[lane], f.followed[f.held[lane]], limits, e)
        if fate == GO_ON:
            continue
        number = give_back(g, f, lane)
        if fate != ASSIGNED:
            return number, fate


@compiled
def give_back(g: Group, f: Followers, lane: int) -> int:
    """Free a lane, and write where its motion is: the number of that."""
    number = f.held[lane]
    g.runs[lane].target = math.nan
    copy(f.lanes[lane], f.runs[number])
    copy(g.recent[lane], f.recent)
    f.held[lane], g.lanes.idle[lane] = -1, 1.0
    return number
