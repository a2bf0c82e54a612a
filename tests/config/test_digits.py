"""Numbers for people, by the one rule."""

import math

import pytest

from vibroplat.config.digits import given, interval, number, pair, percent, quantity, spread


@pytest.mark.parametrize(
    ("value", "unit", "more", "told"),
    [
        (0.00302247, "m", {}, "3.02 mm"),
        (9.4e-9, "m", {"largest": 3e-3}, "0"),
        (15713.9, "N", {}, "15.7 kN"),
        (999.7, "N", {}, "1.00 kN"),
        (999.4, "N", {}, "999 N"),
        (24.5211, "Hz", {}, "24.52 Hz"),
        (1471.26, "1/min", {}, "1471 1/min"),
        (1.529511, "N·m", {"error": 3e-5, "digits": 9}, "1.52951 N·m"),
        (0.57391, "", {"error": 0.019}, "0.57"),
        (0.01, "N", {"error": 0.02}, "0"),
        (-0.0004, "m", {}, "−0.400 mm"),
        (123456.0, "Hz", {}, "123500 Hz"),
        (500.0, "N", {"size": 15e3}, "0.500 kN"),
        (0.0, "W", {}, "0"),
        (None, "N", {}, "–"),
        (math.nan, "N", {}, "–"),
        (math.inf, "N", {}, "–"),
    ],
)
def test_a_quantity_has_three_digits_a_prefix_and_no_more_than_its_error_allows(value, unit, more, told):
    assert quantity(value, unit, **more) == told


def test_a_number_without_a_unit():
    assert [number(v) for v in (3.80912, 0.0123456, 9.996, 12345.6, -0.0)] == ["3.81", "0.0123", "10.0", "12300", "0"]


def test_shares_are_exact_at_their_ends():
    shares = (0.8462, 0.0192, 0.99994, 1.0, 0.0, 1e-5, -1e-5, 0.953, 1.34, None)
    told = ["85 %", "1.9 %", "> 99.9 %", "100 %", "0 %", "< 0.1 %", "> −0.1 %", "95.3 %", "134 %", "–"]
    assert [percent(one) for one in shares] == told


def test_a_spread_has_one_unit_and_two_digits_of_the_smaller():
    assert spread(14126.0, 853.0, "N") == "14.13 ± 0.85 kN"
    assert spread(147.2, 313.4, "N") == "147 ± 313 N"
    assert spread(0.12, 10450.0, "N") == "0.00 ± 10.45 kN"
    assert [spread(14126.0, 1.2, "N"), spread(122.7, 0.0, "N")] == ["14.1 kN", "123 N"], "1/1000 of it is nothing"


def test_an_interval_has_the_decimals_of_its_larger_end():
    assert interval(0.02, 9.231, "m") == "20 … 9230 mm"
    assert interval(42.0, 80.0, "Hz") == "42.00 … 80.00 Hz"
    assert interval(0.5, 0.5) == "0.500"


def test_a_number_stands_as_it_was_given_and_one_that_was_computed_has_six_digits():
    told = [given(v) for v in (50.0, 49.99975, 0.1, 0.3 - 0.1, 5e7, 1e-13, 12559432.1575, 1.0 / 3.0)]
    assert told == ["50", "49.99975", "0.1", "0.2", "50000000", "1e-13", "12559400", "0.333333"]


def test_numbers_that_are_compared_have_two_digits_of_their_difference():
    assert pair(1.2345678e-3, 1.2345999e-3, "m") == ("1.234568 mm", "1.234600 mm")
    assert pair(0.5, 0.5, "Hz") == ("0.5000 Hz", "0.5000 Hz")
    assert pair(0.0, float("inf")) == ("0", "–")
