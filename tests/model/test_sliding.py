"""Equations of contact with friction: residual, Jacobian, derivatives along the motion, impact."""

import numpy as np
import pytest

from vibroplat.config.sections import Transport
from vibroplat.model.energy import energies
from vibroplat.model.equations import jacobian, residual
from vibroplat.model.parameters import parameters
from vibroplat.model.sliding import strike
from vibroplat.model.systems import MOVING_SIZE, SYSTEMS

from .helpers import SIZES, TIME, central_difference, name_of, scene_of, settled

MOVING = [system for system in SYSTEMS if system.slides]
EACH_MOVING = pytest.mark.parametrize("system", MOVING, ids=name_of)
DECK = Transport(friction=0.4, static_friction=0.5, deck_angle_deg=9.0, deck_height_m=0.07)


def record(layers):
    return parameters(scene_of(layers, "uneven").model_copy(update={"transport": DECK}), TIME)


def states(seed, count):
    sizes = np.append(SIZES, [1e-2, 0.3])
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, MOVING_SIZE)) * sizes


def residual_of(system, y, yp, p):
    res = np.empty(system.size)
    assert residual(system.index, TIME, y, yp, res, p)
    return res


@EACH_MOVING
def test_accelerations_leave_no_residual_and_keep_the_law(system):
    p, n, d = record(system.layers), system.differential // 2, system.differential
    for state in states(1, 5):
        y, yp, _, found = settled(system, system.unknowns(state), p)
        assert found
        at_rest = np.zeros_like(yp)
        at_rest[:n] = y[n:d]
        size = np.abs(residual_of(system, y, at_rest, p)).max()
        assert np.abs(residual_of(system, y, yp, p)).max() < 1e-12 * size
        if system.mode.label == "stick":
            assert yp[d - 1] == 0.0
        elif system.algebraic:
            sense = 1.0 if system.mode.label == "slip+" else -1.0
            assert y[d + 1] == pytest.approx(-0.4 * sense * y[d], rel=1e-12)


@EACH_MOVING
def test_jacobian_is_that_of_the_residual(system):
    p, jac, cj = record(system.layers), np.empty((system.size, system.size)), 37.0
    (state,) = states(2, 1)
    y, yp, _, _ = settled(system, system.unknowns(state), p)
    yp += 1.0
    jacobian(system.index, TIME, y, yp, cj, jac, p)
    for j, unit in enumerate(np.eye(system.size)):
        expected = central_difference(
            lambda s, unit=unit: (
                residual_of(system, y + s * unit, yp, p) + cj * residual_of(system, y, yp + s * unit, p)
            ),
            1e-3,
        )
        np.testing.assert_allclose(jac[:, j], expected, atol=1e-7 * max(np.abs(jac[:, j]).max(), 1.0))


@EACH_MOVING
def test_second_derivatives_are_those_along_the_motion(system):
    p, d = record(system.layers), system.differential
    for state in states(3, 3):
        start = system.unknowns(state)
        y, yp, ypp, _ = settled(system, start, p)

        def along(time, y=y, rates=yp):
            y, yp, _, _ = settled(system, y[:d] + time * rates[:d], p, TIME + time)
            return np.append(yp[:d], y[d:])

        expected = central_difference(along, 2e-5)
        got = np.append(ypp[:d], yp[d:])
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("slip", [0.0, 0.01, -0.6, 3.0])
@pytest.mark.parametrize("layers", [1, 2])
def test_an_impact_keeps_momentum_and_its_cone_and_takes_the_energy_that_it_tells(layers, slip):
    p = record(layers)
    (before,) = states(4, 1)
    before[5], before[12], before[15] = 0.0, -0.7, slip
    if layers == 1:
        before[6] = before[13] = 0.0
    after = np.empty_like(before)
    blow = strike(before, after, p.restitution, p)
    assert (after[:7] == before[:7]).all()
    assert after[14] == before[14]
    assert blow.normal > 0.0
    assert after[12] == pytest.approx(0.7 * p.restitution)
    assert abs(blow.along) <= 0.4 * blow.normal * (1.0 + 1e-12)
    assert after[15] == 0.0 or after[15] * slip > 0.0
    assert (after[15] == 0.0) == (abs(blow.along) < 0.4 * blow.normal * (1.0 - 1e-12))
    # momentum along x and y of machine and material
    one, two = energies(before, p), energies(after, p)
    assert one[5] == pytest.approx(two[5], rel=1e-12)
    assert one[3] == pytest.approx(two[3], rel=1e-12)
    assert blow.loss == pytest.approx(one[0] - two[0], rel=1e-9)
    assert blow.loss > 0.0
