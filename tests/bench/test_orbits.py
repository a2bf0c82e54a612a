"""Orbits of bodies on a table beside formulas and MapPy, and the cost of branches beside heyoka's."""

from __future__ import annotations

import importlib.util
import math

import numpy as np
import pandas as pd
import pytest
import scipy.linalg

from bench import bouncing, maps
from vibroplat.bench import orbits
from vibroplat.motion.run import load_kernels


@pytest.fixture(scope="module", autouse=True)
def _kernels():
    load_kernels("taylor")


@pytest.fixture
def compared(monkeypatch):
    """The table without MapPy."""
    monkeypatch.setattr(bouncing, "missing", lambda: "not here")
    return bouncing.compare(1).set_index(["case", "program"])


def test_orbits_of_the_ball_are_those_of_formulas(compared):
    ours, exact = compared.loc[("ball on a table", "vibroplat")], compared.loc[("ball on a table", "formulas")]
    for name in ("rebound", "multiplier_re", "multiplier_im", "determinant", "fold_gamma", "doubling_gamma"):
        assert ours[name] == pytest.approx(exact[name], abs=2e-9)


def flight(state, seconds, case):
    """Heights and speeds of both masses after a time; in g/ω² and g/ω."""
    pull = case.spring.frequency**2, 2.0 * case.spring.damping * case.spring.frequency
    share = (1.0 - case.spring.share) / case.spring.share
    matrix = np.zeros((5, 5))
    matrix[0, 1] = matrix[2, 3] = 1.0
    for row, sign in ((1, share), (3, -1.0)):
        matrix[row] = [-sign * pull[0], -sign * pull[1], sign * pull[0], sign * pull[1], -1.0]
    return (scipy.linalg.expm(seconds * matrix) @ [*state, 1.0])[:4]


def test_orbit_of_two_masses_is_one_of_their_equations():
    """From one impact to the next one, in closed form."""
    case = bouncing.CASES[1]
    phase, *state = bouncing.impact(case)
    table = case.gamma * math.sin(phase)
    end = flight([table, *state], 2.0 * math.pi, case)
    speed = (1.0 + case.restitution) * case.gamma * math.cos(phase) - case.restitution * end[1]
    np.testing.assert_allclose([end[0], speed, *end[2:]], [table, *state], atol=1e-6)


def test_mappy_is_told_to_be_missing(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert maps.missing().startswith("mappy is not installed; clone https://github.com/")


@pytest.mark.peers
@pytest.mark.skipif(bool(maps.missing()), reason="MapPy is not there, or not for this numpy")
def test_mappy_finds_the_same():
    table = bouncing.compare(1).set_index(["case", "program"])
    for case in ("ball on a table", "two masses and a spring"):
        ours, theirs = table.loc[(case, "vibroplat")], table.loc[(case, "MapPy")]
        for name in ("rebound", "multiplier_re", "multiplier_im", "determinant", "doubling_gamma"):
            assert theirs[name] == pytest.approx(ours[name], abs=1e-8)


def test_time_of_heyoka_is_taken_between_the_frequencies_measured():
    brute = pd.DataFrame({orbits.MASS: [0.1, 0.1, 0.2], orbits.SUPPLY: [46.0, 50.0, 46.0], "ms_per_s": [1.0, 3.0, 9.0]})
    row = pd.Series({orbits.MASS: 0.1, orbits.SUPPLY: 47.0})
    assert orbits.at(brute, row, "ms_per_s") == pytest.approx(1.5)


@pytest.mark.peers
def test_heyoka_is_timed_on_settled_motion(monkeypatch):
    pytest.importorskip("heyoka")
    monkeypatch.setattr(orbits, "OVER", 0.2)
    scene = orbits.curves().replace({"sweep.grid": {orbits.MASS: [0.0, 0.2]}, "sweep.supply_frequency_hz.stop": 46.0})
    table = orbits.heyoka(scene)
    assert list(table[orbits.MASS].unique()) == [0.0, 0.2]
    assert (table["core_ms_per_s"] > 0.0).all()
    assert (table["ms_per_s"] > 0.5 * table["core_ms_per_s"]).all()
