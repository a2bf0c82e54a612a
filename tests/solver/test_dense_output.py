"""Dense output: order of the interpolant, agreement with the integrator, tables."""

from __future__ import annotations

import numpy as np
import pytest
from vibroplat.integrate.interpolation import hermite, hermite_slope, interpolate, sample

from vibroplat import simulate


def wave(t):
    return np.sin(3.0 * t) + 0.3 * t


def slope(t):
    return 3.0 * np.cos(3.0 * t) + 0.3


def largest_error(steps):
    t = np.linspace(0.0, 2.0, steps + 1)
    times = np.linspace(0.0, 2.0, 1001)
    values = sample(t, wave(t)[:, np.newaxis], slope(t)[:, np.newaxis], times)[:, 0]
    return np.abs(values - wave(times)).max()


def test_interpolation_is_of_order_four():
    orders = np.log2([largest_error(n) / largest_error(2 * n) for n in (10, 20, 40)])
    assert orders == pytest.approx(4.0, abs=0.15)


def test_interpolant_reproduces_cubics():
    def cubic(t):
        return 2.0 - t + 3.0 * t**2 - 0.5 * t**3

    def rate(t):
        return -1.0 + 6.0 * t - 1.5 * t**2

    for s in (0.0, 0.3, 1.0):
        arguments = (s, 2.0, cubic(0.0), cubic(2.0), rate(0.0), rate(2.0))
        assert hermite(*arguments) == pytest.approx(cubic(2.0 * s))
        assert hermite_slope(*arguments) == pytest.approx(rate(2.0 * s))


def test_interpolate_fills_values_and_slopes():
    ends = [np.array([f(t)]) for f in (wave, slope) for t in (0.0, 0.1)]
    y, yp = np.empty(1), np.empty(1)
    interpolate(0.5, 0.1, *ends, y, yp)
    assert y[0] == pytest.approx(wave(0.05), abs=3e-5)  # h⁴ max|y⁗|/384 = 2.1e-5
    assert yp[0] == pytest.approx(slope(0.05), abs=1e-3)


def test_dense_output_is_as_accurate_as_the_steps(damped):
    """Between steps the error against a run at 1e-11 stays within a few times that at the steps' ends."""
    scene = damped.replace({"material.mass_ratio": 0.1, "drive.supply_frequency_hz": 44.0, "run.duration_s": 0.3})
    run = simulate(scene.replace({"solver.tolerance": 1e-6}))
    truth = simulate(scene.replace({"solver.tolerance": 1e-11}))
    ends = np.concatenate([segment.start + segment.t for segment in run.segments])
    ends = np.unique(ends[ends <= 0.3])
    between = 0.5 * (ends[1:] + ends[:-1])
    for column in ("y_m", "upper_m"):
        at_ends = np.abs(run(ends)[column] - truth(ends)[column]).max()
        inside = np.abs(run(between)[column] - truth(between)[column]).max()
        assert inside <= 3.0 * at_ends


def test_output_rate_does_not_touch_the_integration(quickstart):
    runs = [simulate(quickstart.replace({"run.duration_s": 0.3, "output.sample_rate_hz": r})) for r in (50.0, 5000.0)]
    assert runs[0].summary["steps"] == runs[1].summary["steps"]
    assert runs[0].events.equals(runs[1].events)
