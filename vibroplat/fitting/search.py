"""Searches for the keys with which runs differ least from data, and what the data say of them.

A search begins with the first part of the data and goes on to all of it: over few oscillations a wrong frequency does
not yet make the difference a function with many minima. Least squares are those of scipy's trust region with bounds.

What remains of a sampled signal is correlated. It is described by an autoregressive process (Yule and Walker, order by
Akaike's criterion), and the covariance of the estimate is (JᵀJ)⁻¹ JᵀΣJ (JᵀJ)⁻¹ with the covariance Σ of that process.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.config.fit_plan import FitPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.fitting.misfit import Misfit
from vibroplat.measured.alignment import FloatArray, main_frequency
from vibroplat.model.sensitivity import value_of
from vibroplat.study.store import Record

#: Parts of the data, one after the other, and most evaluations of each.
PARTS, MOST_EVALUATIONS = (0.12, 0.35, 1.0), 25
#: Difference (RMS over RMS) up to which a search suffices.
SMALL = 0.2
#: Part of what is left up to which another shift is better, and how much more leaves it as good.
BETTER, AS_GOOD = 1.0 - 1e-6, 1e-3
#: Errors from which on values that leave as little are other values.
SEVERAL = 3.0
#: Relative changes of squares and unknowns that end a search over a part of the data, and over all of them.
ROUGH, FINE = 1e-3, 1e-8
#: Distance from the ends of ranges at which searches begin, over these.
INSIDE = 0.02
#: Largest order of the process of what remains, and most rows of a curve in the result.
MOST_ORDER, MOST_ROWS = 40, 5000
#: Variance of a number evenly anywhere in its range, over the square of that: what is known without data.
EVENLY = 1.0 / 12.0


def starting_places(scene: Scene, plan: FitPlan) -> list[list[float]]:
    """Return where searches begin: the values of the scene, then points of a Sobol sequence."""
    from scipy.stats import qmc  # noqa: PLC0415  (takes half a second)

    own = []
    for key, (low, high) in plan.keys.items():
        value = value_of(scene, key)
        own.append(0.5 if value is None else (float(value) - low) / (high - low))
    drawn = qmc.Sobol(len(own), seed=plan.seed).random_base2(max(plan.starts - 1, 1).bit_length())
    return np.clip([own, *drawn[: plan.starts - 1].tolist()], INSIDE, 1.0 - INSIDE).tolist()  # type: ignore[no-any-return]


def search(scene: Scene, plan: FitPlan, places: list[float]) -> Record:
    """Search from some places of keys in their ranges; a run that fails ends it."""
    misfit = Misfit(scene, plan)
    weights = np.array([float(np.sqrt(np.mean(np.square(part.values)))) for part in misfit.parts])
    try:
        begun = u = misfit.begin(np.array(places))
        for until in PARTS:
            u, cost = _least(misfit, u, weights, until)
        if cost > SMALL**2:  # the first part of the data may say little, as before a start
            u, cost = min((u, cost), _least(misfit, begun, weights, 1.0), key=lambda of: of[1])
        u, cost, alike = _other_turns(misfit, u, weights, cost)
    except ArithmeticError as error:
        return {"failed": str(error), "cost": None, "u": None, "alike": [], "simulations": misfit.simulations}
    return {"failed": "", "cost": cost, "u": u.tolist(), "alike": alike, "simulations": misfit.simulations}


def _least(misfit: Misfit, u: FloatArray, weights: FloatArray, until: float) -> tuple[FloatArray, float]:
    """Go to the nearest least squares; return the unknowns and the mean square of what is left."""
    u = u.copy()
    from scipy.optimize import least_squares  # noqa: PLC0415  (takes half a second)

    count, (least, most) = len(misfit.keys), misfit.shift_bounds()
    free = np.full(len(u) - count - len(least), np.inf)
    u[count : count + len(least)] = np.clip(u[count : count + len(least)], least + 1e-9, most - 1e-9)
    found = least_squares(
        lambda v: misfit.residuals(v, weights, until),
        u,
        lambda v: misfit.slopes(v, weights, until),
        bounds=(
            np.concatenate([np.zeros(count), least, -free]),
            np.concatenate([np.ones(count), most, free]),
        ),
        x_scale="jac",
        ftol=ROUGH if until < 1.0 else FINE,
        xtol=ROUGH if until < 1.0 else FINE,
        max_nfev=MOST_EVALUATIONS,
    )
    return np.asarray(found.x), 2.0 * float(found.cost) / len(found.fun)


def _other_turns(
    misfit: Misfit, u: FloatArray, weights: FloatArray, cost: float
) -> tuple[FloatArray, float, list[list[float]]]:
    """Shift files by half and whole oscillations, as long as less is left: other keys may make up for a wrong one.

    Returns the best unknowns, what is left, and the places of keys that leave as little.
    """
    count, (least, most) = len(misfit.keys), misfit.shift_bounds()
    tried = [(cost, u)]
    for number in range(len(least)):
        part = max((p for p in misfit.parts if p.file == number), key=lambda p: len(p.times))
        turn = 1.0 / main_frequency((part.times, part.values))
        for step in (turn, -turn, 0.5 * turn, -0.5 * turn):
            better = True
            while better and least[number] < u[count + number] + step < most[number]:
                moved = u.copy()
                moved[count + number] += step
                moved, other = _least(misfit, moved, weights, 1.0)
                tried.append((other, moved))
                better = other < BETTER * cost
                u, cost = (moved, other) if better else (u, cost)
    return u, cost, [one[:count].tolist() for other, one in tried if other <= cost * (1.0 + AS_GOOD)]


def refine(scene: Scene, plan: FitPlan, start: list[float], before: list[float], alike: list[list[float]]) -> Record:
    """Weight each curve by what remains of it, search once more, and say what the data tell of keys.

    Places of keys that leave as little are part of the errors.
    """
    misfit = Misfit(scene, plan)
    begun, u = misfit.begin(np.array(before)), np.array(start)
    sizes = [len(part.times) for part in misfit.parts]
    ones = np.ones(len(sizes))

    def rms(unknowns: FloatArray) -> FloatArray:
        parts = np.split(misfit.residuals(unknowns, ones), np.cumsum(sizes)[:-1])
        return np.array([max(float(np.sqrt(np.mean(part * part))), 1e-300) for part in parts])

    largest = np.array([float(np.abs(part.values).max()) for part in misfit.parts])
    weights = np.maximum(rms(u), 1e-9 * largest)
    u, _ = _least(misfit, u, weights, 1.0)
    left = np.split(misfit.residuals(u, weights), np.cumsum(sizes)[:-1])
    slopes = np.split(misfit.slopes(u, weights, both=True), np.cumsum(sizes)[:-1])
    count = len(misfit.keys)
    bread, meat = np.zeros((len(u), len(u))), np.zeros((len(u), len(u)))
    for part, slope in zip(left, slopes, strict=True):
        bread += slope.T @ slope
        meat += slope.T @ correlated(part, slope)
    known = np.diag(np.append(np.full(count, 1.0 / EVENLY), np.zeros(len(u) - count)))
    white = np.linalg.pinv(bread + known)
    covariance = white @ (meat + known) @ white
    errors = np.sqrt(np.maximum(np.diag(covariance)[:count], 0.0))
    spread = np.sqrt(np.maximum(np.diag(white)[:count], 0.0))
    scale = np.where(errors > 0.0, errors, 1.0)
    places, shifts, offsets, factors = misfit.unpack(u)
    ranges, away = misfit.high - misfit.low, np.abs(np.array([*alike, places.tolist()]) - places).max(axis=0)
    rows = [_curve(misfit, k, u, begun) for k in range(len(sizes))]
    return {
        "values": (misfit.low + places * ranges).tolist(),
        "errors": (np.hypot(errors, away) * ranges).tolist(),
        "ambiguous": [key for key, far, error in zip(misfit.keys, away, errors, strict=True) if far > SEVERAL * error],
        "correlations": (covariance[:count, :count] / np.outer(scale, scale)).tolist(),
        "independent": float(sum(sizes) * np.median((spread / scale) ** 2)) if count else 0.0,
        "samples": int(sum(sizes)),
        "shifts": shifts.tolist(),
        "offsets": offsets.tolist(),
        "factors": factors.tolist(),
        "parts": rows,
        "simulations": misfit.simulations,
    }


def _curve(misfit: Misfit, k: int, u: FloatArray, begun: FloatArray) -> dict[str, Any]:
    """Return a measured curve beside the computed ones before and after, and what remains of it."""
    part = misfit.parts[k]
    ones = np.ones(len(misfit.parts))
    begin = sum(len(one.times) for one in misfit.parts[:k])
    rows = slice(begin, begin + len(part.times))
    size = float(np.sqrt(np.mean(np.square(part.values))))
    left = misfit.residuals(u, ones)[rows]
    first = misfit.residuals(begun, ones)[rows]
    _, shifts, offsets, factors = misfit.unpack(u)
    measured = factors[k] * part.values - offsets[k]
    chosen = np.unique(np.linspace(0, len(left) - 1, MOST_ROWS).astype(int))
    return {
        "file": part.file,
        "column": part.column,
        "error": float(np.sqrt(np.mean(left * left)) / size),
        "error_before": float(np.sqrt(np.mean(first * first)) / size),
        "remains_hz": main_frequency((part.times, left)),
        "remains": float(np.sqrt(2.0 * np.mean(left * left))),
        "t_s": (part.times + shifts[part.file])[chosen].tolist(),
        "measured": measured[chosen].tolist(),
        "computed": (measured - left)[chosen].tolist(),
    }


def correlated(left: FloatArray, columns: FloatArray) -> FloatArray:
    """Multiply columns by the covariance of the process whose sample is what is left."""
    from scipy.linalg import matmul_toeplitz, solve_toeplitz  # noqa: PLC0415  (takes half a second)

    count = len(left)
    spectrum = np.abs(np.fft.rfft(left, 2 * count)) ** 2
    lags = np.fft.irfft(spectrum)[: min(MOST_ORDER, count // 10) + 1] / count
    if not lags[0] > 0.0:
        return 0.0 * columns
    best: tuple[float, FloatArray, float] = (np.inf, np.zeros(0), lags[0])
    for order in range(len(lags)):
        own = np.asarray(solve_toeplitz(lags[:order], lags[1 : order + 1])) if order else np.zeros(0)
        noise = float(lags[0] - own @ lags[1 : order + 1])
        if noise > 0.0:
            best = min(best, (count * np.log(noise) + 2.0 * order, own, noise), key=lambda of: of[0])
    _, own, noise = best
    size = 4 * count
    transfer = np.fft.rfft(np.append(1.0, -own), size)
    covariances = np.fft.irfft(noise / np.abs(transfer) ** 2, size)[:count]
    return np.asarray(matmul_toeplitz(covariances, columns))


def error_with(scene: Scene, plan: FitPlan, values: dict[str, float]) -> Record:
    """Return the errors of data beside runs with some values of keys, of another engine."""
    misfit = Misfit(scene, plan)
    places = (np.array([values[key] for key in misfit.keys]) - misfit.low) / (misfit.high - misfit.low)
    u = misfit.begin(places)
    u, _ = _least_extras(misfit, u)
    parts = [_curve(misfit, k, u, u) for k in range(len(misfit.parts))]
    return {"row": {f"error_{k}": part["error"] for k, part in enumerate(parts, 1)}}


def _least_extras(misfit: Misfit, u: FloatArray) -> tuple[FloatArray, float]:
    """Find shifts, offsets and factors alone."""
    from scipy.optimize import least_squares  # noqa: PLC0415  (takes half a second)

    count, ones = len(misfit.keys), np.ones(len(misfit.parts))
    if len(u) == count:
        return u, 0.0
    found = least_squares(lambda v: misfit.residuals(np.append(u[:count], v), ones), u[count:], x_scale="jac")
    return np.append(u[:count], found.x), float(found.cost)


def require_numbers(scene: Scene, plan: FitPlan) -> None:
    """Refuse keys that the scene does not have as numbers (ConfigError)."""
    for key in plan.keys:
        value = value_of(scene, key)
        if value is not None and not isinstance(value, float):
            raise ConfigError(f"fit.keys.{key} = {value} does not vary continuously; allowed: a key that does")
