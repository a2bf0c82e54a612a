"""Errors between steps are those of their ends: the polynomials are as accurate as the integrator."""

from functools import cache

import numpy as np
import pytest
from common.references import REFERENCES
from scipy.integrate import solve_ivp

from vibroplat import load_config, simulate
from vibroplat.hybrid.state import initial_state, state_scales
from vibroplat.model.accelerations import explicit
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import systems

#: Scenes without events.
SCENES = {"bare": ("bare-printed-fe60", {}), "attached": ("attached-mu01-fe46", {"drive.supply_frequency_hz": 40.0})}


def scene_of(name):
    reference, changes = SCENES[name]
    return load_config(REFERENCES / f"{reference}.yaml").replace({**changes, "run.duration_s": 0.5})


@cache
def truth(name):
    """The motion at round-off by another integrator: differential unknowns as a function of time, and F_c of them."""
    scene = scene_of(name)
    p = parameters(scene)
    (system,) = [s for s in systems(scene).values() if s.mode.label == name]

    solution = solve_ivp(
        lambda t, u: explicit(system.index, t, u, p)[: u.size],
        (0.0, scene.run.duration_s),
        initial_state(scene)[system.places],
        method="DOP853",
        rtol=3e-14,
        atol=1e-16,
        max_step=2e-4,
        dense_output=True,
    )
    return system, solution.sol, lambda u: explicit(system.index, 0.0, u, p)[-1]


def errors(name, engine, tolerance):
    """Largest errors over scales at ends of steps and between them, and what bends between.

    Of the first two, those of the coordinates and, over its largest value, of F_c. What a motion has gathered in errors
    is nearly straight within a step; what bends is the polynomial's own error.
    """
    scene = scene_of(name).replace({"solver": {"tolerance": tolerance, "engine": engine}})
    system, exact, force = truth(name)
    places, half = system.places[: system.differential // 2], system.differential // 2
    fractions, bent, found = np.array([0.0, 0.2, 0.5, 0.8, 1.0]), 0.0, np.zeros((2, 2))
    run = simulate(scene)
    assert run.summary["events"] == 0
    for segment in run.segments:
        times = (segment.start + segment.t[:-1] + np.outer(fractions, segment.length[:-1])).T.ravel()
        states, forces, _ = segment(times)
        expected = exact(times)
        error = ((states[:, places] - expected[:half].T) / state_scales(scene)[places]).reshape(-1, 5, half)
        line = error[:, :1] + fractions[:, np.newaxis] * (error[:, -1:] - error[:, :1])
        bent = max(bent, np.abs(error - line).max())
        contact = np.zeros((len(error), 5))
        if system.algebraic:
            contact = (np.abs(forces - [force(u) for u in expected.T]) / scene.force_scale).reshape(-1, 5)
        for place, columns in enumerate(([4], [1, 2, 3])):
            found[place] = np.maximum(found[place], (np.abs(error[:, columns]).max(), contact[:, columns].max()))
    return *found, bent


@pytest.mark.parametrize(
    ("name", "engine", "tolerance"),
    [
        *(("bare", "taylor", 1e-6), ("attached", "taylor", 1e-10), ("bare", "native", 1e-10)),
        *(("attached", "native", 1e-10), pytest.param("attached", "sundae", 1e-10, marks=pytest.mark.long)),
    ],
)
def test_errors_between_steps_are_those_of_their_ends(name, engine, tolerance):
    """Steps of a series are a tenth of a turn and more, its polynomials the series itself: at most 1.1 and 0.22."""
    (at_ends, force_at_ends), (between, force_between), bent = errors(name, engine, tolerance)
    longest, most, bends = (1.5, 1.0, 0.4) if engine == "taylor" else (3.0, 3.0, 0.5)
    assert 0.0 < between <= longest * at_ends
    assert force_between <= most * force_at_ends
    assert 0.0 < bent <= bends * at_ends
