"""What a multistep method needs beside its steps: polynomials through their ends, falls within them, first steps."""

import math

import numpy as np
import pytest

from vibroplat.config.scene import Scene
from vibroplat.hybrid.loop import AT_GUARD, AT_TARGET, automaton
from vibroplat.hybrid.modes import ATTACHED, BARE
from vibroplat.hybrid.state import CUBIC, empty_steps
from vibroplat.integrate.multistep import begin_steps, empty_step, estimate_flight, limit_force_slopes, transcribe
from vibroplat.model.parameters import parameters

#: A layer in contact, whose guard is F_c, and unknowns before that.
ONE_LAYER = Scene().replace({"material": {"mass_ratio": 0.1, "layers": 1}})
OTHERS = 10


def added(t, y, yp, at_guard=False, target=math.nan, scene=ONE_LAYER):
    """Steps through ends with unknowns y, shape (m, n), and derivatives, and why they stopped."""
    t, y, yp = (np.asarray(a, dtype=float) for a in (t, y, yp))
    steps, past = empty_steps(len(t) + 2, CUBIC), empty_step()
    begin_steps(past, y[0], yp[0])
    h = automaton(scene, parameters(scene), steps, 10)
    h.run["mode"] = ATTACHED if scene.has_contact else BARE
    return steps, transcribe(h, past, t[1:], y[1:], yp[1:], at_guard, target)


def columns(*unknowns):
    """Unknowns side by side, zeros before them."""
    return np.column_stack([np.zeros((len(unknowns[0]), OTHERS)), *unknowns])


def transcribed(g, rates, at_guard=False, target=math.nan, phi1=None):
    """Steps of 1 with one guard, and an angle of exciter 1; why they stopped, the ends in time, the guard there."""
    y, yp = columns(np.array(g)), columns(np.array(rates))
    if phi1 is not None:
        y[:, 3], yp[:, 3] = phi1, np.gradient(phi1)
    steps, stop = added(np.arange(len(g)), y, yp, at_guard=at_guard, target=target)
    rows = int(steps.used["steps"])
    return stop, steps.start[:rows] + steps.length[:rows], steps.ends[:rows]


@pytest.mark.parametrize(
    ("g", "rates", "found", "stop", "ends"),
    [
        ([1.0, 0.1, 0.1, 1.0], [-1.0, -1.0, 1.0, 1.0], False, AT_GUARD, [1.0, 1.5 - math.sqrt(0.25 - 0.1)]),
        ([1.0, 0.5, -0.5, -1.0], [-0.5, -1.0, -1.0, 0.0], False, AT_GUARD, [1.0, 1.5]),
        ([1.0, 0.6, 0.6, 1.0], [-1.0, -0.1, 0.1, 1.0], False, -1, [1.0, 2.0, 3.0]),
        ([1.0, 0.5, -1e-18], [-0.5, -0.5, -0.5], True, -1, [1.0, 2.0]),
    ],
    ids=["dips", "falls", "stays", "found by the integrator"],
)
def test_steps_end_where_the_guard_falls(g, rates, found, stop, ends):
    reason, t, at_ends = transcribed(g, rates, at_guard=found)
    assert reason == stop
    assert t == pytest.approx(ends, abs=1e-12)
    assert stop < 0 or abs(at_ends[-1, OTHERS]) < 1e-12


@pytest.mark.parametrize(
    ("target", "expected", "end"),
    [(2.2, AT_TARGET, 1.1), (2.8, AT_GUARD, 1.0 + 0.5 - math.sqrt(0.25 - 0.1)), (9.0, AT_GUARD, None)],
)
def test_the_first_of_a_fall_and_an_angle_ends_the_steps(target, expected, end):
    angle = np.array([0.0, 2.0, 4.0, 6.0])
    stop, t, ends = transcribed([1.1, 0.1, 0.1, 1.1], [-1.0, -1.0, 1.0, 1.0], target=target, phi1=angle)
    assert stop == expected
    assert end is None or t[-1] == pytest.approx(end, abs=1e-12)
    assert stop == AT_GUARD or ends[-1, 3] == target


def calmed(forces, given_slopes):
    """Slopes of F_c at the ends of steps of 1, of all steps' both sides, after they have been limited."""
    count = len(forces)
    y, yp = np.zeros((2, count, 11))
    y[:, 0], yp[:, 0] = 7.0, 50.0
    y[:, 10], yp[:, 10] = forces, given_slopes
    steps, _ = added(np.arange(count), y, yp, scene=Scene())  # which has no guard
    h = automaton(ONE_LAYER, parameters(ONE_LAYER), steps, 100.0)
    h.run["mode"] = ATTACHED
    before = steps.c[:, :, :10].copy()
    limit_force_slopes(h, False)
    assert (steps.c[:, :, :10] == before).all()
    at_ends = np.array(
        [[np.polynomial.Polynomial(c[:, 10]).deriv()(s) for c in steps.c[: count - 1]] for s in (0.0, 1.0)]
    )
    return steps, np.append(at_ends[0], at_ends[1, -1]), at_ends


def test_slopes_of_the_force_that_belong_to_its_values_stay():
    times = np.arange(12.0)
    expected = 0.3 * np.cos(0.3 * times)
    _, slopes_found, at_ends = calmed(2.0 + np.sin(0.3 * times), expected)
    assert slopes_found == pytest.approx(expected, abs=1e-12)
    assert at_ends[1, :-1] == pytest.approx(at_ends[0, 1:], abs=1e-12)


@pytest.mark.parametrize(
    ("slopes_given", "expected"),
    [
        ([-9.0, 0.0, 0.0], [-3.0, 0.0, 0.0]),  # thrice the secant
        ([0.0, 80.0, 0.0], [0.0, 3.0, 0.0]),  # the larger secant counts, and F_c = 1 before a step of 1
        ([0.0, -80.0, 0.0], [0.0, -3.0, 0.0]),
        ([0.0, 0.0, 9.0], [0.0, 0.0, 0.0]),  # nothing that ends at 0 has come from below
    ],
)
def test_wild_slopes_of_the_force_are_limited(slopes_given, expected):
    _, found, at_ends = calmed([2.0, 1.0, 0.0], slopes_given)
    assert found == pytest.approx(expected, abs=1e-12)
    assert at_ends[1, 0] == pytest.approx(expected[1], abs=1e-12)


def test_a_force_that_presses_at_all_steps_presses_between_them():
    """Some forces are 0, and slopes of all sizes."""
    rng = np.random.default_rng(0)
    for count in rng.integers(2, 9, 100):
        forces = rng.uniform(0.0, 1e3, count) * rng.choice((0.0, 1e-6, 1.0), count)
        steps, _, _ = calmed(forces, rng.choice((-1.0, 1.0), count) * 10.0 ** rng.uniform(-3.0, 6.0, count))
        for row in range(count - 1):
            force = np.polynomial.Polynomial(steps.c[row, :, 10])
            turns = force.deriv().roots()
            inside = turns.real[(np.abs(turns.imag) < 1e-9) & (turns.real > 0.0) & (turns.real < 1.0)]
            assert min(forces[row], forces[row + 1], *force(inside)) >= -1e-9 * forces.max()


def test_excursion_after_rebound_and_release():
    assert estimate_flight(0.2, -10.0, 5.0, 1.0) == pytest.approx((0.04, 0.002))
    duration, height = estimate_flight(0.0, 0.0, 6.0, -24.0)  # gap = t³ − t⁴
    assert (duration, height) == pytest.approx((1.0, 27.0 / 256.0))
    assert estimate_flight(0.0, 2.0, -6.0, 0.0) == pytest.approx((1.0, 4.0 / 27.0))  # gap = t² − t³
    assert estimate_flight(0.0, 0.0, 6.0, 24.0) == (math.inf, math.inf)
