"""The Taylor series against the model: accelerations and contact force evaluated again along their polynomials."""

import numpy as np
import pytest

from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lanes import as_lanes, lanes_record
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import record_words
from vibroplat.model.series import FORCE_COLUMN, MOTION, WORDS, expand, parameter_rows, room
from vibroplat.model.systems import SYSTEMS

from .helpers import EACH_PAIR, EACH_SYSTEM, PLAIN, TIME, random_states, record_of, settled

#: Degree at which the series of these states has converged to round-off over the times below.
DEGREE = 24

#: Fields of the parameters that switch a force off.
TERMS = (
    *("stiffness_x", "stiffness_y", "stiffness_phi", "damping_x", "damping_y", "damping_phi", "gravity"),
    *("torque", "speed_ramp", "slip_ramp", "friction", "layer_stiffness", "layer_damping"),
)


@compiled
def expand_lanes(motion, degree, room, rows):
    expand(as_lanes(motion), degree, as_lanes(room), as_lanes(rows), None)


def side_by_side(given, degree=DEGREE):
    """Coefficients (degree + 1, 8, lanes) of motions, each a system, its unknowns and parameters, and the records."""
    width = len(given)
    motion, formed, rows = lanes_record(width, MOTION, {}), room(width), parameter_rows(width)
    motion["t"] = TIME
    for lane, (system, y, p) in enumerate(given):
        full = system.full(y)
        motion["y"][:7, lane], motion["v"][:7, lane] = full[:7], full[7:]
        motion["attached"][lane], motion["two"][lane] = system.algebraic, system.layers == 2
        motion["flying"][lane] = system.layers > 0 and not system.algebraic
        motion["lower_share"][lane] = 1.0 / p["lower_mass"] if system.layers else 0.0
        rows["words"][:, lane] = record_words(p).ravel()[:WORDS]
    expand_lanes(motion, degree, formed, rows)
    return formed["q"][: degree + 1]


def series(system, y, p, degree=DEGREE):
    """Coefficients (degree + 1, n) of coordinates and (degree − 1,) of F_c."""
    q = side_by_side([(system, y, p)], degree)[:, :, 0]
    return q[:, system.places[: system.differential // 2]].copy(), q[: degree - 1, FORCE_COLUMN].copy()


def along(coefficients, elapsed, derivative=0):
    """Values of polynomials, or of their derivatives, at a time since their beginning (s)."""
    for _ in range(derivative):
        coefficients = coefficients[1:] * np.arange(1, len(coefficients)).reshape(-1, *[1] * (coefficients.ndim - 1))
    return np.polynomial.polynomial.polyval(elapsed, coefficients)


def missed(system, y, p, elapsed):
    """Largest difference between series and model at a time (s): accelerations and F_c over their largest values."""
    q, force = series(system, y, p)
    n = system.differential // 2
    there, rates = np.zeros(system.size), np.zeros(system.size)
    there[:n], there[n : 2 * n] = along(q, elapsed), along(q, elapsed, 1)
    assert accelerations(system.index, TIME + elapsed, there, rates, p)
    a = along(q, elapsed, 2)
    error = np.abs(a - rates[n : 2 * n]).max() / np.abs(rates[n : 2 * n]).max()
    if system.algebraic:
        error = max(error, abs(along(force, elapsed) - there[-1]) / max(abs(there[-1]), np.abs(force[0])))
    return error


def radius(system, y, p):
    """Time within which terms shrink by a half from one to the next (s)."""
    q, _ = series(system, y, p)
    last = (np.abs(q[-4:]) / np.abs(q[1]).max()).max(axis=1)
    return 0.5 * float(np.min(last ** (-1.0 / np.arange(DEGREE - 4, DEGREE))))


@EACH_PAIR
def test_series_is_the_motion(system, machine):
    p, n = record_of(system.layers, machine), system.differential // 2
    for state in random_states(seed=5, count=10):
        y, yp, ypp, found = settled(system, state[system.places], p)
        assert found
        assert missed(system, y, p, 0.3 * radius(system, y, p)) < 1e-12
        q, force = series(system, y, p)  # begins with accelerations and their derivatives
        for order, expected in ((2, yp), (3, ypp)):
            of = expected[n : 2 * n]
            np.testing.assert_allclose(
                q[order] * order * (order - 1) * max(order - 2, 1), of, atol=1e-12 * abs(of).max()
            )
        if system.algebraic:
            assert force[0] == pytest.approx(y[-1], rel=1e-12)
            assert force[1] == pytest.approx(yp[-1], rel=1e-10)


@EACH_SYSTEM
def test_each_force_has_its_recurrence(system):
    """A series without a force misses the motion with it; the test above is as sharp as that for each of them."""
    p = record_of(system.layers, "rising")
    y, *_ = settled(system, random_states(seed=8, count=1)[0][system.places], p)
    elapsed, with_force = 0.3 * radius(system, y, p), series(system, y, p)[0]
    for term in TERMS:
        without = p.copy()
        without[term] = 0.0
        change = along(with_force - series(system, y, without)[0], elapsed, 2)
        differs = np.abs(change).max() / np.abs(along(with_force, elapsed, 2)).max()
        assert differs > 1e-10 or (system.layers < 2 and term.startswith("layer")), term
        assert missed(system, y, without, elapsed) < 1e-12, term


def test_exciter_at_rest_resists_where_it_is_about_to_turn():
    system, p = SYSTEMS[0], record_of(0, "uneven")
    state = random_states(seed=9, count=1)[0]
    for speeds in ((0.0, -90.0), (150.0, 0.0), (0.0, 0.0)):
        y, *_ = settled(system, np.concatenate([state[:10], speeds, state[12:]])[system.places], p)
        assert missed(system, y, p, 0.1 * radius(system, y, p)) < 1e-12


def test_motor_without_supply_and_speed_has_no_torque():
    system, p = SYSTEMS[0], record_of(0, "uneven")
    p["speed"], p["slip_speed"] = 0.0, 0.0
    state = random_states(seed=9, count=1)[0]
    state[10:12] = 0.0
    q, _ = series(system, settled(system, state[system.places], p)[0], p, 6)
    assert np.isfinite(q).all()


@pytest.mark.parametrize("degree", [2, 3, 12, MAX_DEGREE])
def test_degree_only_cuts_the_series(degree):
    system, p = SYSTEMS[2], record_of(2, "rising")
    y, *_ = settled(system, random_states(seed=4, count=1)[0][system.places], p)
    longest, force = series(system, y, p, MAX_DEGREE)
    q, forces = series(system, y, p, degree)
    np.testing.assert_array_equal(q, longest[: degree + 1])
    np.testing.assert_array_equal(forces, force[: degree - 1])


@pytest.mark.parametrize("width", [pytest.param(2, marks=pytest.mark.long), 4, pytest.param(8, marks=pytest.mark.long)])
def test_motions_side_by_side_are_each_as_alone(width):
    """In contact, in flight and bare beside each other, one with an exciter at rest."""
    given = []
    for lane, state in enumerate(random_states(seed=11, count=width)):
        system = SYSTEMS[(3 * lane + 1) % len(PLAIN)]
        state[10] *= lane != 1
        p = record_of(system.layers, "rising" if lane % 2 else "uneven")
        given.append((system, settled(system, state[system.places], p)[0], p))
    for lane, alone in enumerate(given):
        expected = side_by_side([alone])[:, :, 0]
        np.testing.assert_allclose(
            side_by_side(given)[:, :, lane], expected, rtol=1e-9, atol=1e-12 * abs(expected).max()
        )
