"""Errors between steps are those of their ends: the polynomials are as accurate as the integrator."""

from functools import cache

import numpy as np
import pytest
from common.references import REFERENCES

from vibroplat import load_config, simulate
from vibroplat.config.coordinates import COORDINATES
from vibroplat.hybrid.state import state_scales

#: Scenes without events.
SCENES = {"bare": ("bare-printed-fe60", {}), "attached": ("attached-mu01-fe46", {"drive.supply_frequency_hz": 40.0})}


def scene_of(name):
    reference, changes = SCENES[name]
    return load_config(REFERENCES / f"{reference}.yaml").replace({**changes, "run.duration_s": 0.5})


@cache
def truth(name):
    """The motion by a series at 1e-14, which those of other engines are compared with as well."""
    return simulate(scene_of(name).replace({"solver": {"tolerance": 1e-14, "engine": "taylor"}}))


def errors(name, engine, tolerance):
    """Largest errors over scales at ends of steps and between them, and what bends between.

    Of the first two, those of the coordinates and, over its largest value, of F_c. What a motion has gathered in errors
    is nearly straight within a step; what bends is the polynomial's own error.
    """
    run = simulate(scene_of(name).replace({"solver": {"tolerance": tolerance, "engine": engine}}))
    assert run.summary["events"] == 0
    starts = np.concatenate([segment.start + segment.t[:-1] for segment in run.segments])
    lengths = np.concatenate([segment.length[:-1] for segment in run.segments])
    fractions = np.array([0.0, 0.2, 0.5, 0.8, 1.0])
    times = (starts[:, np.newaxis] + lengths[:, np.newaxis] * fractions).ravel()
    apart = run(times).drop(columns="mode") - truth(name)(times).drop(columns="mode")
    scales = {q: scale for q, scale in zip(COORDINATES, state_scales(run.scene), strict=False) if q in apart}
    error = (apart[list(scales)] / list(scales.values())).to_numpy().reshape(-1, 5, len(scales))
    contact = np.zeros((len(starts), 5))
    if name == "attached":
        contact = np.abs(apart["contact_force_n"].to_numpy().reshape(-1, 5)) / run.scene.force_scale
    line = error[:, :1] + fractions[:, np.newaxis] * (error[:, -1:] - error[:, :1])
    found = [(np.abs(error[:, at]).max(), contact[:, at].max()) for at in ([4], [1, 2, 3])]
    return *found, np.abs(error - line).max()


@pytest.mark.parametrize(
    ("name", "engine", "tolerance"),
    [
        *(("bare", "taylor", 1e-6), ("attached", "taylor", 1e-10), ("bare", "native", 1e-10)),
        *(("attached", "native", 1e-10), ("attached", "sundae", 1e-10)),
    ],
)
def test_errors_between_steps_are_those_of_their_ends(name, engine, tolerance):
    """Steps of a series are a tenth of a turn and more, its polynomials the series itself: at most 1.1 and 0.22."""
    (at_ends, force_at_ends), (between, force_between), bent = errors(name, engine, tolerance)
    longest, most, bends = (1.5, 1.0, 0.4) if engine == "taylor" else (3.0, 3.0, 0.5)
    assert 0.0 < between <= longest * at_ends
    assert force_between <= most * force_at_ends
    assert 0.0 < bent <= bends * at_ends
