"""Angles on their circle, against samples that were unwrapped by hand."""

import math

import numpy as np
import pytest

from vibroplat.cli.data_dictionary import TABLES
from vibroplat.columns import is_angle, unit_of
from vibroplat.config.circular import beyond, bound_meaning, circular_mean, degrees_text, on_line, ranked, wrap
from vibroplat.config.coordinates import TURN

PHASE = "phase_difference_rad"
SHARES = (0.05, 0.5, 0.95)


def test_statistics_are_those_of_samples_that_are_unwrapped_by_hand():
    for seed in range(150):
        random = np.random.default_rng(seed)
        count, width = int(random.integers(2, 300)), float(random.choice([1e-3, 0.3, 1.5]))
        by_hand = random.uniform(-math.pi, math.pi) + width * random.uniform(-1.0, 1.0, count)
        angles = by_hand + TURN * random.integers(-3, 4, count)
        mean = np.angle(np.exp(1j * (by_hand - by_hand[0])).mean()) + by_hand[0]
        found = on_line(PHASE, angles)
        assert math.remainder(circular_mean(angles) - mean, TURN) == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(found, by_hand - mean, rtol=0.0, atol=1e-12)
        assert found.std() == pytest.approx(by_hand.std(), abs=1e-12)
        order, quantiles = ranked(PHASE, angles, SHARES)
        assert order.tolist() == np.argsort(by_hand, kind="stable").tolist()
        apart = [math.remainder(a - b, TURN) for a, b in zip(quantiles, np.quantile(by_hand, SHARES), strict=True)]
        assert apart == pytest.approx([0.0] * 3, abs=1e-12)


def test_samples_all_around_the_circle_have_no_mean():
    for seed in range(50):
        random = np.random.default_rng(seed)
        count = int(random.integers(10, 300))
        around = random.uniform(-math.pi, math.pi, count)
        evenly = random.uniform() + TURN * np.arange(count) / count
        opposite = random.uniform() + math.pi * (np.arange(2 * count) % 2)
        for angles in (around, evenly, opposite):
            assert math.isnan(circular_mean(angles))
            assert np.isnan(on_line(PHASE, angles)).all()
            assert ranked(PHASE, angles, SHARES)[1].size == 0


def test_what_lies_within_half_a_turn_has_a_mean_and_what_is_missing_does_not_count():
    assert circular_mean([3.1, -3.1]) == pytest.approx(math.pi)
    assert circular_mean([0.0, math.nan, 3.1]) == pytest.approx(1.55)
    assert math.isnan(circular_mean([]))
    assert on_line("rms_y_m", [3.1, -3.1]).tolist() == [3.1, -3.1]


def test_a_bound_of_an_angle_parts_the_circle_in_halves():
    assert [beyond(PHASE, angle, 3.12) > 0.0 for angle in (-3.09, 3.11, 0.0, -0.1)] == [True, False, False, True]
    assert beyond(PHASE, np.array([-3.0, 3.0]), -3.0).tolist() == pytest.approx([0.0, 6.0 - TURN])
    assert beyond("rms_y_m", -3.09, 3.12) < 0.0
    assert bound_meaning(PHASE, -1.0, 3.12) == (
        f"{PHASE} is an angle: the half turn from −0.0216 to 3.12 rad is below 3.12, the other one is not"
    )
    assert [wrap(angle) for angle in (-math.pi, math.pi, 1e-20, 7.0 - TURN)] == [math.pi, math.pi, 1e-20, 7.0 - TURN]
    assert [degrees_text(angle) for angle in (-3.14, 3.14, -3.12)] == ["180 °", "180 °", "−179 °"]


def test_phase_differences_are_the_only_columns_with_angles_on_a_circle():
    names = {name for _, columns in TABLES.values() for name in columns if unit_of(name) in ("rad", "°")}
    lines = {"phi_rad", "phi1_rad", "phi2_rad", "rms_phi_rad", "phi_max_rad", "stroke_phi_rad", "throw_angle_rad"}
    lines |= {"loaded_stroke_phi_rad", "rms_phi_error_rad", "phase_difference_error_rad"}
    assert {name for name in names if is_angle(name)} == {PHASE, f"below_{PHASE}", f"above_{PHASE}"}
    assert {name for name in names if not is_angle(name)} == lines, "decide of a new column whether it is an angle"
