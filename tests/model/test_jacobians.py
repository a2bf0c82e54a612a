"""Jacobians against differences of the residuals, and consistent starts against the motion."""

import numpy as np
import pytest

from vibroplat.model.accelerations import linearize
from vibroplat.model.equations import jacobian
from vibroplat.model.equations import residual as evaluate_residual
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP, SYSTEMS

from .helpers import (
    EACH_RECORD,
    EACH_SYSTEM,
    TIME,
    central_difference,
    random_states,
    record_of,
    scene_of,
    settled,
)

#: Largest accelerations in the order of the coordinates (m/s², rad/s²), for random y′.
ACCELERATIONS = np.array([50.0, 80.0, 200.0, 2000.0, 2000.0, 80.0, 80.0])
#: Steps of the differences, in the order of the full state. Large where the residual is a polynomial; the
#: exciter angles stand in sines, and the exciter speeds in Kloss's quotient, of width s_c ω₀ ≈ 20 rad/s.
STEPS = np.array([1e-2, 1e-2, 0.1, 1e-2, 1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0, 0.1, 0.1, 1.0, 1.0])


def random_point(system, rng):
    """Return random unknowns and derivatives that need not be consistent."""
    state, other = random_states(rng, count=2)
    n = system.differential // 2
    y = system.unknowns(state)
    yp = system.unknowns(other)
    yp[n : 2 * n] = ACCELERATIONS[system.places[:n]] * rng.uniform(-1.0, 1.0, n)
    y[2 * n :] = 30.0 * rng.normal()
    yp[2 * n :] = 1e4 * rng.normal()
    return y, yp


def residual(system, y, yp, p):
    res = np.empty(system.size)
    assert evaluate_residual(system.index, TIME, y, yp, res, p)
    return res


def numerical_jacobian(system, y, yp, cj, p):
    """Return ∂F/∂y + c_j ∂F/∂y′ by differences, column by column."""
    steps = np.append(STEPS[system.places], 1.0)[: system.size]
    columns = []
    for step, unit in zip(steps, np.eye(system.size), strict=True):
        by_y = central_difference(lambda s, unit=unit: residual(system, y + s * unit, yp, p), step)
        # F is linear in y′, so the step is free
        by_yp = central_difference(lambda s, unit=unit: residual(system, y, yp + s * unit, p), 1.0)
        columns.append(by_y + cj * by_yp)
    return np.column_stack(columns)


@EACH_RECORD
@EACH_SYSTEM
@pytest.mark.parametrize("cj", [1.0, 3e2, 1e4, 1e6])
def test_jacobian_is_that_of_the_residual(system, machine, cj):
    p = record_of(system.layers, machine)
    rng = np.random.default_rng(2)
    jac = np.empty((system.size, system.size))
    for _ in range(8):
        y, yp = random_point(system, rng)
        jacobian(system.index, TIME, y, yp, cj, jac, p)
        expected = numerical_jacobian(system, y, yp, cj, p)
        # relative to the largest entry of the row; what is left is sixth-order terms (0.01 rad)⁶/140 ~ 1e-14
        # and the round-off of the residual's terms over the step
        row = np.max(np.abs(expected), axis=1, keepdims=True)
        worst = np.max(np.abs(jac - expected) / row)
        assert worst < 1e-11


@EACH_RECORD
@EACH_SYSTEM
def test_next_derivative_is_that_along_the_motion(system, machine):
    p = record_of(system.layers, machine)
    wanted, got = [], []
    for full in random_states(seed=3, count=20):
        start = full[system.places]
        y, yp, ypp, _ = settled(system, start, p)
        assert np.array_equal(y[: system.differential], start)

        def along(time, start=start, rates=yp[: system.differential]):
            # y′ and F_c are functions of the state and of time, so their derivative along the tangent is that in time
            y, yp, _, _ = settled(system, start + time * rates, p, TIME + time)
            return np.append(yp[: system.differential], y[system.differential :])

        wanted.append(central_difference(along, step=2e-5))
        got.append(np.append(ypp[: system.differential], yp[system.differential :]))
        assert np.all(ypp[system.differential :] == 0.0)
    scale = np.max(np.abs(wanted), axis=0)
    # round-off: accelerations to 1e-14 over 2e-5 s, against derivatives about 150/s times larger
    worst = np.max(np.abs(np.array(got) - wanted) / scale)
    assert worst < 1e-9


@EACH_RECORD
@EACH_SYSTEM
def test_linearized_accelerations_are_those_of_the_state(system, machine):
    p = record_of(system.layers, machine)
    size, differential = system.size, system.differential
    for full in random_states(seed=3, count=8):
        start = full[system.places]
        y, yp, _, _ = settled(system, start, p)
        slopes = np.empty((differential, size))
        linearize(system.index, TIME, y, yp, slopes, p)

        def of(state):
            y, yp, _, _ = settled(system, state, p)
            return np.append(yp[:differential], y[differential:])

        steps = np.minimum(STEPS[system.places], 1e-2)  # accelerations are no polynomials
        for slope, step, unit in zip(slopes, steps, np.eye(differential), strict=True):
            expected = central_difference(lambda s, unit=unit, start=start: of(start + s * unit), step)
            np.testing.assert_allclose(slope, expected, rtol=0.0, atol=1e-8 * np.abs(slopes).max())


@EACH_RECORD
@EACH_SYSTEM
def test_accelerations_leave_no_residual(system, machine):
    p = record_of(system.layers, machine)
    n = system.differential // 2
    for full in random_states(seed=4, count=50):
        start = full[system.places]
        y, yp, _, found = settled(system, start, p)
        assert found
        yp[system.differential :] = 0.0
        at_rest = np.zeros_like(yp)
        at_rest[:n] = y[n : 2 * n]  # with y′ = rates the kinematic rows vanish, and all that is left are forces
        forces = residual(system, y, at_rest, p)
        worst = np.max(np.abs(residual(system, y, yp, p)))
        assert worst < 1e-12 * np.max(np.abs(forces))


@EACH_SYSTEM
def test_static_rest_is_an_equilibrium(system):
    # attached: every spring carries what lies on it; in flight the layers fall with g
    scene = scene_of(system.layers)
    machine, p = scene.machine, parameters(scene)
    full = np.zeros(14)
    full[3], full[4] = 0.5 * np.pi, -0.5 * np.pi  # unbalances above and below: no moment about the axes
    load = scene.material_mass if system.algebraic else 0.0
    full[1] = -(machine.total_mass + load) * machine.gravity_m_per_s2 / machine.stiffness_y_n_per_m
    p.torque = 0.0  # supply off
    if system.layers == 2 and system.algebraic:
        full[6] = -machine.gravity_m_per_s2 / scene.layer_spring[0]
    y, yp, _, _ = settled(system, full[system.places], p)
    n = system.differential // 2
    assert yp[n : n + 5] == pytest.approx(np.zeros(5), abs=1e-10)
    if system.algebraic:
        assert y[-1] == pytest.approx(load * machine.gravity_m_per_s2, rel=1e-12)
        assert yp[n + 5 : 2 * n] == pytest.approx(np.zeros(n - 5), abs=1e-10)
    elif system.layers:
        fall = [-machine.gravity_m_per_s2, 0.0][: system.layers]
        assert yp[n + 5 : 2 * n] == pytest.approx(fall, abs=1e-10)


def starts_from_a_broken_state(system, place, value):
    """Return whether there is a consistent start if one place of the full state has this value."""
    (state,) = random_states(seed=5, count=1)
    state[place] = value
    *_, found = settled(system, state[system.places], parameters(scene_of(system.layers)))
    return found


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@EACH_SYSTEM
def test_a_state_that_is_not_finite_has_no_start(system, value):
    for place in set(system.places) - {GAP}:
        assert not starts_from_a_broken_state(system, place, value)


@pytest.mark.parametrize("system", [s for s in SYSTEMS if GAP in s.places], ids=["one layer", "two layers"])
def test_a_gap_that_is_not_finite_has_no_start(system):
    assert not starts_from_a_broken_state(system, GAP, np.nan)


@EACH_SYSTEM
def test_residual_tells_of_a_value_that_is_not_finite(system):
    p = parameters(scene_of(system.layers))
    y, yp = random_point(system, np.random.default_rng(6))
    res = np.empty(system.size)
    assert evaluate_residual(system.index, TIME, y, yp, res, p)
    yp[system.differential // 2] = np.nan
    assert not evaluate_residual(system.index, TIME, y, yp, res, p)
