"""Flights that have just become possible: the gap opens on a triple root, and closes again soon."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import brentq

from vibroplat.bench.scenes import base
from vibroplat.bench.stability.checks import Limit, row, sound, steady
from vibroplat.scene import Scene

#: One at which F_c is known to less than the 1e-8 of its amplitude that it falls short by in the shortest flight.
CLOSE, USUAL = 1e-11, 1e-6
#: Supply frequencies (Hz) below lift-off from which least F_c and amplitude are extrapolated.
ATTACHED = (47.2, 48.2)
#: Seconds until the start has died out, and those that are measured.
SETTLE, MEASURE = 10.0, 0.5
#: Flights that are longer than this share of a turn are not missed at the usual tolerance either.
SEEN = 0.01
#: Relative error of a flight's share of a turn: what an error of 8e-9 of F_c's amplitude makes of the shortest ones,
#: and what the parabola leaves of the longest.
LEAST, SHORT, LONG = 2e-4, 4e-9 / (0.5 * (0.5 * math.pi) ** 2), 0.02


def release(count: int) -> list[dict[str, Any]]:
    """Pass lift-off with flights that take from 1e-4 to 1e-1 of a turn, closely and at the usual tolerance.

    Near its least value F_c ≈ F_min + ½ F″ t², and the gap's acceleration is −F_c over a mass: a flight begins
    where F_c = 0 and its gap closes after 4 √(−2 F_min/F″), twice the time below zero. Least F_c over its amplitude
    is extrapolated from attached motions below lift-off. At the usual tolerance the shortest flights are less than
    the error of F_c: there may be none in a turn, but never two.
    """
    supply = lift_off()
    rows = []
    for i, fraction in enumerate(np.logspace(-4.0, -1.0, count)):
        # F_c would fall below zero by this share of its amplitude
        depth = 0.5 * (0.25 * fraction * 2.0 * math.pi) ** 2
        tolerance = USUAL if i % 5 == 4 else CLOSE
        rows.append(judged(scene(supply(depth), tolerance), float(fraction)))
    return rows


def judged(case: Scene, fraction: float) -> dict[str, Any]:
    """Compare flights of the settled motion with what was predicted for it."""
    found = steady(case, SETTLE, MEASURE)
    turns = MEASURE * (found["excitation_frequency_hz"] or math.nan)
    close = case.solver.tolerance == CLOSE
    limits: dict[str, Limit] = {
        # one that is cut by an end of the measured part is counted once
        "liftoffs_too_many": (found["liftoffs"] - turns, 1.0),
        "impacts_too_many": (found["impacts"] - turns, 1.0),
        **sound(case, found),
    }
    if close or fraction > SEEN:
        limits["liftoffs_missed"] = (turns - found["liftoffs"], 1.0)
    if close:
        # of the part: the share over whole turns weighs a single flight too much
        error = abs(found["flight_fraction"] / fraction - 1.0)
        limits["fraction_error"] = (error, LEAST + SHORT / fraction**2 + LONG * fraction)
    return row(f"flights of {fraction:.3g} turns, tolerance {case.solver.tolerance:g}", found["outcome"], limits)


def scene(supply: float, tolerance: float) -> Scene:
    """Return the paper's machine at a supply frequency (Hz)."""
    return base(tolerance, SETTLE + MEASURE).replace({"drive.supply_frequency_hz": supply})


def lift_off() -> Callable[[float], float]:
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
