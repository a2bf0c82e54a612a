"""Motions that do not repeat: which windows are of one motion, and what becomes of the starts."""

import math

import numpy as np
import pytest

from vibroplat.basin.attractors import AperiodicGroup, AttractorSet
from vibroplat.basin.windows import classify_windows, components
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales

SCENE = Scene()
SCALES = state_scales(SCENE)


def window(height, sync="antiphase"):
    phase = None if sync == "none" else math.pi
    sizes = {"rms_x_m": 1e-5, "rms_y_m": height, "rms_phi_rad": 1e-4}
    return sizes | {"flight_fraction": 0.0, "sync": sync, "phase_difference_rad": phase}


def bursts(level, count, seed, scatter=0.45):
    """Windows of a motion that comes in bursts: neighbours are alike, all together scatter by half of themselves."""
    random, path, at = np.random.default_rng(seed), [], 0.0
    for _ in range(count):
        at = 0.5 * at + random.normal(0.0, scatter)
        path.append(window(level * math.exp(at)))
    return path


def ends_of(motions):
    return components(classify_windows(motions, SCALES))


@pytest.mark.parametrize("count", [4, 8])
def test_one_motion_in_bursts_is_one_closed_component(count):
    """Windows of single starts would make several classes of it."""
    motions = [bursts(1e-3, count, seed) for seed in range(200)]
    ends, closed = ends_of(motions)
    assert len({path[-1] for path in classify_windows(motions, SCALES)}) > 2
    assert {min(closed[end]) for end in ends} == {ends[0]} == closed[ends[0]]


def test_two_motions_together_stay_two():
    """Of one the exciters drift, of the other they do not."""
    one, two = ([bursts(level, 4, seed) for seed in range(100)] for level in (1e-3, 1e-3))
    two = [[row | {"sync": "none", "phase_difference_rad": None} for row in path] for path in two]
    ends, closed = ends_of([*one, *two])
    assert {frozenset(closed[end]) for end in ends} == {frozenset({ends[0]}), frozenset({ends[-1]})}
    assert len(set(ends[:100])) == len(set(ends[100:])) == 1 != len({ends[0], ends[-1]})


def test_a_motion_that_is_left_for_good_is_no_attractor_of_its_own():
    ends, closed = components([[0, 0, 1], [0, 0], [1, 1], [2, 3], [3, 2]])
    assert ends[0] == ends[2] != ends[1]
    assert closed[ends[1]] == closed[ends[0]] == {ends[0]}
    assert ends[3] == ends[4]
    assert closed[ends[3]] == {ends[3]}


def test_classes_in_which_no_motion_was_seen_to_stay_are_a_way_out():
    """The last window of a motion that leaves chaos is no attractor; neither are those of motions that converge."""
    ends, closed = components([[0, 0, 0, 1], [0, 0, 0, 0], [2, 3, 4, 5], [6]])
    assert ends == [ends[1], ends[1], -1, -1]
    assert closed[ends[1]] == {ends[1]}
    assert closed[-1] == set()


def start(*windows):
    return {"attractor": None, "turns": 1000, "outcome": "ok", "state": [0.0] * 14, "windows": list(windows)}


def record(period=0, height=1e-3):
    motion = {"motion": "periodic" if period else "chaotic", "period": period, "outcome": "ok"}
    errors = dict.fromkeys((f"rms_{name}_error_{unit}" for name, unit in (("x", "m"), ("y", "m"), ("phi", "rad"))), 0.0)
    return {"row": window(height) | motion | errors, "state": [0.0] * 14}


def test_starts_behind_those_of_the_closed_component():
    """A group is told by a motion of the class that is not left."""
    found = AttractorSet(SCENE, [])
    found.starts = [start(window(1e-3), window(1e-3)), start(window(1e-3), window(2e-3)), start(*[window(2e-3)] * 2)]
    [group] = found.groups()
    assert group.starts == [found.starts[1], found.starts[2], found.starts[0]]


def test_a_motion_that_escapes_to_an_orbit_takes_no_other_one_along():
    """It has left chaos by chance; the others are where they were."""
    found = AttractorSet(SCENE, [])
    found.starts = [start(window(1e-3)) for _ in range(3)]
    group = AperiodicGroup(list(found.starts), [])
    assert found.find_alike(group, record(6, 5e-3)) == []
    found.take_continued(group, record(6, 5e-3), [])
    assert [one["attractor"] for one in found.starts] == [None] * 3
    found.take_continued(group, record(), [])
    assert [one["attractor"] for one in found.starts] == [1] * 3
    assert found.counts == [0, 3]
    assert found.attractors[1]["escaped"] == 1


def test_starts_that_are_on_an_orbit_of_many_turns_come_to_it():
    """A window that is like it is not enough: chaos beside it has one, too."""
    found = AttractorSet(SCENE, [])
    found.starts = [start(window(1e-3)), start(window(2e-3)), start(window(1.001e-3)), start(window(1.001e-3))]
    group = AperiodicGroup(list(found.starts), [])
    like = found.find_alike(group, record(12, 1e-3))
    assert like == [found.starts[0], *found.starts[2:]]
    found.take_continued(group, record(12, 1e-3), like[:2])
    assert [one["attractor"] for one in found.starts] == [0, None, 0, None]
    assert group.escaped == []


def test_where_all_escape_the_motion_is_undecided_and_says_why():
    found = AttractorSet(SCENE, [])
    found.starts = [start(window(1e-3)) for _ in range(2)]
    group = AperiodicGroup(list(found.starts), [])
    for _ in range(2):
        found.take_continued(group, record(6, 5e-3), [])
    found.mark_undecided(group)
    assert found.counts == [0, 2]
    row = found.attractors[1]["row"]
    assert (row["motion"], row["period"]) == ("undecided", 0)
    assert row["detail"] == "2 such motions were continued, and all converged to an orbit"
