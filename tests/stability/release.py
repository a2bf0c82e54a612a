"""Flights just above lift-off: the gap opens at a triple root and soon closes again."""

import math
from functools import cache

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from stability.checks import row, sound, steady, with_engine
from vibroplat.bench.scenes import base

#: A tolerance at which the error of F_c is below 1e-8 of its amplitude, its shortfall in the shortest flight.
CLOSE, USUAL = 1e-11, 1e-6
#: Supply frequencies (Hz) below lift-off from which the minimum and amplitude of F_c are extrapolated.
ATTACHED = (47.2, 48.2)
#: Settling time and measuring time (s).
SETTLE, MEASURE = 10.0, 0.5
#: Flights longer than this share of a turn must be found at the default tolerance too.
SEEN = 0.01
#: Largest relative error of a flight's share of a turn: for the shortest, the effect of an error of 8e-9 of F_c's
#: amplitude; for the longest, the error of the parabola.
LEAST, SHORT, LONG = 2e-4, 4e-9 / (0.5 * (0.5 * math.pi) ** 2), 0.02


def release(count, engine):
    """Simulate flights of 1e-4 to 1e-1 of a turn just above lift-off, at a small and at the default tolerance.

    Near its minimum F_c ≈ F_min + ½ F″ t², and the gap's acceleration is −F_c over a mass. A flight starts where
    F_c = 0, and its gap closes after 4 √(−2 F_min/F″), twice the time that F_c would be below zero. F_min over the
    amplitude of F_c is extrapolated from attached motion below lift-off. At the default tolerance the shortest flights
    are smaller than the error of F_c: a turn may have none, but never two.
    """
    supply = lift_off()
    rows = []
    for i, fraction in enumerate(np.logspace(-4.0, -1.0, count)):
        # share of its amplitude by which F_c would fall below zero
        depth = 0.5 * (0.25 * fraction * 2.0 * math.pi) ** 2
        tolerance = USUAL if i % 5 == 4 else CLOSE
        rows.append(judged(with_engine(scene(supply(depth), tolerance), engine), float(fraction)))
    return rows


def judged(case, fraction):
    """Compare flights of the settled motion with the prediction."""
    found = steady(case, SETTLE, MEASURE)
    turns = MEASURE * (found["excitation_frequency_hz"] or math.nan)
    close = case.solver.tolerance == CLOSE
    limits = {
        # a flight cut by an end of the measured part counts once
        "liftoffs_too_many": (found["liftoffs"] - turns, 1.0),
        "impacts_too_many": (found["impacts"] - turns, 1.0),
        **sound(case, found),
    }
    if close or fraction > SEEN:
        limits["liftoffs_missed"] = (turns - found["liftoffs"], 1.0)
    if close:
        # over the whole part: over whole turns a single flight would weigh too much
        error = abs(found["flight_fraction"] / fraction - 1.0)
        limits["fraction_error"] = (error, LEAST + SHORT / fraction**2 + LONG * fraction)
    return row(f"flights of {fraction:.3g} turns, tolerance {case.solver.tolerance:g}", found["outcome"], limits)


def scene(supply, tolerance):
    """Return the paper's machine at a supply frequency (Hz)."""
    return base(tolerance, SETTLE + MEASURE).replace({"drive.supply_frequency_hz": supply})


@cache
def lift_off():
    """Supply frequency (Hz) over the share of its amplitude by which F_c would fall below zero."""
    middle, half = 0.5 * (ATTACHED[1] + ATTACHED[0]), 0.5 * (ATTACHED[1] - ATTACHED[0])
    supply = middle + half * np.polynomial.chebyshev.chebpts1(10)
    least = []
    for f in supply:
        found = steady(scene(float(f), 1e-12), SETTLE, MEASURE)
        low, high = found["contact_force_min_n"], found["contact_force_max_n"]
        least.append(2.0 * low / (high - low))
    share = Polynomial.fit(supply, least, len(supply) - 1)
    return lambda depth: float(brentq(lambda f: share(f) + depth, ATTACHED[1], ATTACHED[1] + 2.0, xtol=1e-13))
