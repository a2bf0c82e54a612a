"""Errors between steps are those of their ends: the polynomials are as accurate as the integrator."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from oracle import REFERENCE
from scipy.integrate import solve_ivp

from vibroplat import load_config, simulate
from vibroplat.hybrid.state import initial_state, state_scales
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import systems

#: Scenes without events, and how long they are compared (s).
SCENES = {
    "bare": ("bare-printed-fe60", {}, 0.5),
    "attached": ("attached-mu01-fe46", {"drive.supply_frequency_hz": 40.0}, 0.5),
}


def scene_of(name):
    reference, changes, seconds = SCENES[name]
    return load_config(REFERENCE / f"{reference}.yaml").replace({**changes, "run.duration_s": seconds})


@cache
def truth(name):
    """The motion at round-off by another integrator: differential unknowns as a function of time, and F_c of them."""
    scene = scene_of(name)
    p = parameters(scene)
    (system,) = [s for s in systems(scene).values() if s.mode.label == name]

    def unknowns(u):
        y, yp = np.zeros(system.size), np.zeros(system.size)
        y[: system.differential] = u
        accelerations(system.index, 0.0, y, yp, p)
        return y, yp

    solution = solve_ivp(
        lambda _, u: unknowns(u)[1][: system.differential],
        (0.0, scene.run.duration_s),
        initial_state(scene)[system.places],
        method="DOP853",
        rtol=3e-14,
        atol=1e-16,
        max_step=2e-4,
        dense_output=True,
    )
    return system, solution.sol, lambda u: unknowns(u)[0][-1]


def bend(name, engine, tolerance):
    """Largest distance between the error within a step and the straight line between its errors at both ends.

    What a motion has gathered in errors is nearly straight within a step; what bends is the polynomial's own error.
    """
    scene = scene_of(name).replace({"solver": {"tolerance": tolerance, "engine": engine}})
    system, exact, _ = truth(name)
    half = system.differential // 2
    places, fractions, largest = system.places[:half], np.array([0.0, 0.2, 0.5, 0.8, 1.0]), 0.0
    for segment in simulate(scene).segments:
        times = segment.start + segment.t[:-1] + np.outer(fractions, segment.length[:-1])
        states = segment(times.T.ravel())[0][:, places].reshape(-1, len(fractions), half)
        error = states - exact(times.T.ravel())[:half].T.reshape(states.shape)
        line = error[:, :1] + fractions[:, np.newaxis] * (error[:, -1:] - error[:, :1])
        largest = max(largest, (np.abs(error - line) / state_scales(scene)[places]).max())
    return largest


def errors(name, engine, tolerance):
    """Largest error over scales at ends of steps and between them, of coordinates and, over its largest value, F_c."""
    scene = scene_of(name).replace({"solver": {"tolerance": tolerance, "engine": engine}})
    system, exact, force = truth(name)
    run = simulate(scene)
    assert run.summary["events"] == 0
    found = []
    for fractions in ([1.0], [0.2, 0.5, 0.8]):
        coordinate, contact = 0.0, 0.0
        for segment in run.segments:
            times = (segment.start + segment.t + np.outer(fractions, segment.length)).T.ravel()
            times = times[times < segment.end]
            states, forces = segment(times)
            expected = exact(times)
            half = system.differential // 2
            places = system.places[:half]
            difference = np.abs(states[:, places] - expected[:half].T) / state_scales(scene)[places]
            coordinate = max(coordinate, difference.max())
            if system.algebraic:
                contact = max(contact, np.abs(forces - [force(u) for u in expected.T]).max() / scene.force_scale)
        found.append((coordinate, contact))
    return found


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("name", ["bare", "attached"])
def test_series_are_as_accurate_within_their_long_steps(name, tolerance):
    """A step is a tenth of a turn and more, and its polynomial the series itself: measured are at most 1.1 and 0.22."""
    (at_ends, force_at_ends), (between, force_between) = errors(name, "taylor", tolerance)
    assert 0.0 < between <= 1.5 * at_ends
    assert force_between <= force_at_ends
    assert 0.0 < bend(name, "taylor", tolerance) <= 0.4 * at_ends


@pytest.mark.parametrize("engine", ["native", pytest.param("sundae", marks=pytest.mark.long)])
@pytest.mark.parametrize("tolerance", [1e-10, 1e-12])
@pytest.mark.parametrize("name", SCENES)
def test_errors_between_steps_are_those_of_their_ends(name, tolerance, engine):
    (at_ends, force_at_ends), (between, force_between) = errors(name, engine, tolerance)
    assert 0.0 < between <= 3.0 * at_ends
    assert force_between <= 3.0 * force_at_ends
    assert 0.0 < bend(name, engine, tolerance) <= 0.5 * at_ends
