"""Jacobians against differences of the residuals, and consistent starts against the motion."""

import numpy as np

from vibroplat.model.accelerations import linearize
from vibroplat.model.equations import jacobian
from vibroplat.model.equations import residual as evaluate_residual
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP

from .helpers import EACH_PAIR, EACH_SYSTEM, TIME, central_difference, random_states, record_of, scene_of, settled

#: Largest accelerations in the order of the coordinates (m/s², rad/s²), for random y′.
ACCELERATIONS = np.array([50.0, 80.0, 200.0, 2000.0, 2000.0, 80.0, 80.0])
#: Steps of the differences, in the order of the full state. Large where the residual is a polynomial; the
#: exciter angles stand in sines, and the exciter speeds in Kloss's quotient, of width s_c ω₀ ≈ 20 rad/s.
STEPS = np.array([1e-2, 1e-2, 0.1, 1e-2, 1e-2, 1e-2, 1e-2, 1.0, 1.0, 1.0, 0.1, 0.1, 1.0, 1.0])


def random_point(system, rng):
    """Return random unknowns and derivatives that need not be consistent."""
    state, other = random_states(rng, count=2)
    n = system.differential // 2
    y, yp = system.unknowns(state), system.unknowns(other)
    yp[n : 2 * n] = ACCELERATIONS[system.places[:n]] * rng.uniform(-1.0, 1.0, n)
    y[2 * n :], yp[2 * n :] = 30.0 * rng.normal(), 1e4 * rng.normal()
    return y, yp


def residual(system, y, yp, p):
    res = np.empty(system.size)
    assert evaluate_residual(system.index, TIME, y, yp, res, p)
    return res


def numerical_jacobians(system, y, yp, p):
    """Return ∂F/∂y and ∂F/∂y′ by differences, column by column; F is linear in y′, so that step is free."""
    steps = np.append(STEPS[system.places], 1.0)[: system.size]
    units = np.eye(system.size)
    by_y = [
        central_difference(lambda s, unit=unit: residual(system, y + s * unit, yp, p), step)
        for step, unit in zip(steps, units, strict=True)
    ]
    by_yp = [central_difference(lambda s, unit=unit: residual(system, y, yp + s * unit, p), 1.0) for unit in units]
    return np.column_stack(by_y), np.column_stack(by_yp)


@EACH_PAIR
def test_jacobian_is_that_of_the_residual(system, machine):
    p = record_of(system.layers, machine)
    rng = np.random.default_rng(2)
    jac = np.empty((system.size, system.size))
    for _ in range(4):
        y, yp = random_point(system, rng)
        by_y, by_yp = numerical_jacobians(system, y, yp, p)
        for cj in (1.0, 1e4):
            jacobian(system.index, TIME, y, yp, cj, jac, p)
            expected = by_y + cj * by_yp
            # relative to the largest entry of the row; what is left is sixth-order terms (0.01 rad)⁶/140 ~ 1e-14
            # and the round-off of the residual's terms over the step
            assert np.max(np.abs(jac - expected) / np.max(np.abs(expected), axis=1, keepdims=True)) < 1e-11


@EACH_PAIR
def test_next_derivative_is_that_along_the_motion(system, machine):
    p, d = record_of(system.layers, machine), system.differential
    wanted, got = [], []
    for full in random_states(seed=3, count=10):
        start = full[system.places]
        y, yp, ypp, _ = settled(system, start, p)
        assert np.array_equal(y[:d], start)

        def along(time, start=start, rates=yp[:d]):
            # y′ and F_c are functions of the state and of time, so their derivative along the tangent is that in time
            y, yp, _, _ = settled(system, start + time * rates, p, TIME + time)
            return np.append(yp[:d], y[d:])

        wanted.append(central_difference(along, step=2e-5))
        got.append(np.append(ypp[:d], yp[d:]))
        assert np.all(ypp[d:] == 0.0)
    # round-off: accelerations to 1e-14 over 2e-5 s, against derivatives about 150/s times larger
    assert np.max(np.abs(np.array(got) - wanted) / np.max(np.abs(wanted), axis=0)) < 1e-9


@EACH_PAIR
def test_linearized_accelerations_are_those_of_the_state(system, machine):
    p, n = record_of(system.layers, machine), system.differential // 2
    jac, mass = np.empty((system.size, system.size)), np.empty((n, n))
    for full in random_states(seed=3, count=3):
        start = full[system.places]
        y, yp, _, _ = settled(system, start, p)
        linearize(system.index, TIME, y, yp, jac, mass, p)
        slopes = -np.linalg.solve(mass, jac[n : 2 * n, : 2 * n]).T

        def of(state):
            _, yp, _, _ = settled(system, state, p)
            return yp[n : 2 * n]

        steps = np.minimum(STEPS[system.places], 1e-2)  # accelerations are no polynomials
        for slope, step, unit in zip(slopes, steps, np.eye(2 * n), strict=True):
            expected = central_difference(lambda s, unit=unit, start=start: of(start + s * unit), step)
            np.testing.assert_allclose(slope, expected, rtol=0.0, atol=1e-8 * np.abs(slopes).max())


@EACH_PAIR
def test_accelerations_leave_no_residual(system, machine):
    p, n = record_of(system.layers, machine), system.differential // 2
    for full in random_states(seed=4, count=20):
        y, yp, _, found = settled(system, full[system.places], p)
        assert found
        yp[2 * n :] = 0.0
        at_rest = np.zeros_like(yp)
        at_rest[:n] = y[n : 2 * n]  # with y′ = rates the kinematic rows vanish, and all that is left are forces
        forces = residual(system, y, at_rest, p)
        assert np.max(np.abs(residual(system, y, yp, p))) < 1e-12 * np.max(np.abs(forces))


@EACH_SYSTEM
def test_what_is_not_finite_has_no_start_and_no_residual(system):
    (state,), p = random_states(seed=5, count=1), parameters(scene_of(system.layers))
    for place in system.places:
        for value in (np.nan, *([np.inf, -np.inf] if place != GAP else [])):
            broken = state.copy()
            broken[place] = value
            assert not settled(system, broken[system.places], p)[-1]
    y, yp = random_point(system, np.random.default_rng(6))
    yp[system.differential // 2] = np.nan
    assert not evaluate_residual(system.index, TIME, y, yp, np.empty(system.size), p)
