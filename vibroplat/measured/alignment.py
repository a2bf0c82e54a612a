"""Where measured values lie on a computed curve: the shift in time at which they differ least from it.

The error at a shift s is that of all measured values m within the range of the curve c,

    E(s)² = Σ (c(t + s) − m)² / Σ m²,

and the sums are correlations of trains of impulses at the measured times with the curve, its square and 1, sampled at
the finer of the two intervals: measured values are nowhere interpolated, so that E is right for three samples of a turn
as well. Local minima are polished on the curve itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vibroplat.errors import TableError

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
#: A curve: abscissae in ascending order, and values.
Curve = tuple[FloatArray, FloatArray]

#: Most samples that are correlated, and most values that are compared while minima are polished.
MOST_SAMPLES, MOST_COMPARED = 2**22, 4 * 10**7
#: Minimum part of the shorter curve that lies on the other one, and minimum number of measured values there.
LEAST_OVERLAP, FEWEST = 0.5, 3
#: Unit of fitted shifts (s), and least and largest number of minima that are polished.
TICK, FEWEST_POLISHED, MOST_POLISHED = 1e-6, 4, 400
#: Samples of a turn below which a shift may be that of an alias, and below which a curve is smoothed by a spline.
FEW_A_TURN, COARSE = 3.0, 60.0
#: Difference of errors, as their squares add up, up to which they are the same.
SAME_ERROR = 1e-4
#: Error above which it is tried with any factor, since units or signs may differ.
LARGE_ERROR = 0.5


class Alignment(NamedTuple):
    """A shift (s), all shifts of the same error, in ascending order, and samples of a turn.

    ``more`` says that not all shifts were tried to the last digit.
    """

    shift: float
    alike: FloatArray
    samples_a_turn: float
    more: bool = False


def interpolant(curve: Curve) -> Callable[[Any], FloatArray]:
    """Return a curve as a function; between few samples of a turn it is a cubic spline, unless it jumps."""
    times, values = curve
    steps = np.diff(times)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if len(times) > FEWEST and steps.min() > 1e-6 * usual and 1.0 / (usual * main_frequency(curve)) < COARSE:
        from scipy.interpolate import CubicSpline  # noqa: PLC0415  (takes half a second, and few figures need it)

        spline: Callable[[Any], FloatArray] = CubicSpline(times, values)
        return spline
    return lambda at: np.asarray(np.interp(at, times, values), dtype=float)


def main_frequency(curve: Curve) -> float:
    """Return the frequency of the largest line of the spectrum of a curve (Hz), at least that of its length."""
    times, values = curve
    grid = np.linspace(times[0], times[-1], min(len(times), MOST_SAMPLES))
    sampled = np.interp(grid, times, values)
    sizes = np.abs(np.fft.rfft((sampled - sampled.mean()) * np.hanning(len(grid))))
    return max(int(sizes.argmax()), 1) / float(times[-1] - times[0])


def error_of(measured: FloatArray, computed: FloatArray) -> float | None:
    """Return the RMS of differences over that of measured values; None without two values, or if all are 0."""
    square = float(np.square(measured).sum())
    if len(measured) < 2 or square == 0.0:
        return None
    return float(np.sqrt(np.square(computed - measured).sum() / square))


def correlation_of(measured: FloatArray, computed: FloatArray) -> float:
    """Return the coefficient of correlation; 0 if one of them does not vary."""
    spread = float(measured.std() * computed.std())
    return float(np.cov(measured, computed, bias=True)[0, 1]) / spread if spread > 0.0 else 0.0


def on_curve(measured: Curve, computed: Curve) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return which measured values lie within the range of a curve."""
    x, places = measured[0], computed[0]
    return np.asarray((x >= places[0]) & (x <= places[-1]) if len(places) else np.zeros(len(x), dtype=bool))


def best_shift(measured: Curve, computed: Curve, *, offset: bool = False, overlap: float = LEAST_OVERLAP) -> Alignment:
    """Find the shift in time (s) at which measured values differ least from a computed curve.

    At least the part ``overlap`` of the shorter one lies on the other. Among equal errors, the smallest shift is taken.
    With ``offset`` a constant difference does not count. Where no shift makes the error small and one makes the
    correlation high, as when units differ, that one is taken.

    Raises
    ------
    TableError
        Nothing to compare, or a curve of one value.
    """
    if len(measured[0]) < FEWEST or not np.ptp(measured[0]) > 0.0:
        raise TableError("shift=fit needs values over time; allowed: shift=S in seconds")
    if not np.ptp(measured[1]) > 0.0 or not np.ptp(computed[1]) > 0.0:
        raise TableError("shift=fit finds nothing to correlate; allowed: shift=S in seconds")
    curve = interpolant(computed)
    sums = _Sums.of(measured, computed, curve, overlap)

    def error(shift: float) -> float:
        moved = measured[0] + shift, measured[1]
        inside = on_curve(moved, computed)
        values, places = measured[1][inside], curve(moved[0][inside])
        if offset and len(values):
            values = values - (values - places).mean()
        found = error_of(values, places)
        return np.inf if found is None else found

    def unlike(shift: float) -> float:
        inside = on_curve((measured[0] + shift, measured[1]), computed)
        values, places = measured[1][inside], curve(measured[0][inside] + shift)
        return float(np.sqrt(max(1.0 - correlation_of(values, places) ** 2, 0.0)))

    shifts, errors = sums.minima(sums.errors(offset=offset), error)
    if errors.min() > LARGE_ERROR:
        others, found = sums.minima(1.0 - sums.correlations() ** 2, unlike)
        if found.min() < LARGE_ERROR:
            shifts, errors = others, found
    equal = errors**2 <= errors.min() ** 2 + SAME_ERROR**2
    shift = float(shifts[equal][np.abs(shifts[equal]).argmin()])
    each = 1.0 / (main_frequency(computed) * float(np.median(np.diff(np.unique(measured[0])))))
    return Alignment(round(shift / TICK) * TICK, np.sort(shifts[equal]), each, len(shifts) >= MOST_POLISHED)


class _Sums(NamedTuple):
    """Shifts on a grid of one step, and at each of them sums over the measured values that lie on the curve.

    Values are relative to the mean of the measured ones. ``square`` is the sum of the squares as they are given.
    """

    shifts: FloatArray
    step: float
    size: FloatArray
    square: FloatArray
    m: FloatArray
    c: FloatArray
    mm: FloatArray
    cc: FloatArray
    mc: FloatArray

    @classmethod
    def of(cls, measured: Curve, computed: Curve, through: Callable[[Any], FloatArray], overlap: float) -> _Sums:
        """Take the sums at all shifts at which enough of the curves lies on each other; raises TableError.

        The function ``through`` goes through the rows of the computed curve.
        """
        from scipy.signal import correlate  # noqa: PLC0415  (takes half a second, and few figures need it)

        steps = [float(np.median(np.diff(np.unique(times)))) for times, _ in (measured, computed)]
        step, spans = min(steps), [float(np.ptp(times)) for times, _ in (measured, computed)]
        if sum(spans) > MOST_SAMPLES * step:
            raise TableError(f"times span {spans[0]:g} s; allowed with shift=fit: seconds, as by t=NAME*0.001")
        (t, m), origin = measured, computed[0][0]
        places = np.rint((t - t[0]) / step).astype(int)
        mean, weights = float(m.mean()), [np.ones(len(m)), m - m.mean(), (m - m.mean()) ** 2, m * m]
        one, first, second, square = (np.bincount(places, weight).astype(float) for weight in weights)
        curve = through(origin + step * np.arange(int(spans[1] / step + 1e-9) + 1)) - mean
        there = np.ones(len(curve))

        def over(train: FloatArray, values: FloatArray) -> FloatArray:
            return np.asarray(correlate(values, train, "full", "fft"), dtype=float)

        count = np.rint(over(one, there))
        enough = count >= max(FEWEST, overlap * count.max())
        pairs = ((square, there), (first, there), (one, curve), (second, there), (one, curve * curve), (first, curve))
        shifts = origin - t[0] + step * (np.arange(len(count)) - (len(one) - 1))
        return cls(shifts[enough], step, count[enough], *(over(*pair)[enough] for pair in pairs))

    def errors(self, *, offset: bool) -> FloatArray:
        """Return the squares of the errors at all shifts."""
        difference, square = self.mm - 2.0 * self.mc + self.cc, self.square
        if offset:
            away = (self.m - self.c) / self.size
            difference = difference - self.size * away**2
        least = 1e-12 * float(square.max())
        return np.maximum(difference, 0.0) / np.maximum(square, least)

    def correlations(self) -> FloatArray:
        """Return the coefficients of correlation at all shifts."""
        spread = (self.mm - self.m**2 / self.size) * (self.cc - self.c**2 / self.size)
        least = 1e-12 * float(np.abs(spread).max())
        both = self.mc - self.m * self.c / self.size
        return np.asarray(np.where(spread > least, both / np.sqrt(np.maximum(spread, least)), 0.0))

    def minima(self, values: FloatArray, exactly: Callable[[float], float]) -> tuple[FloatArray, FloatArray]:
        """Return polished local minima of values at the shifts, the lowest ones, and what is ``exactly`` there."""
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  (few figures need it)

        padded = np.pad(values, 1, constant_values=np.inf)
        places = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
        most = MOST_COMPARED // int(self.size.max()) // 40
        rough = np.round(values[places], 5)
        lowest = places[np.lexsort((np.abs(self.shifts[places]), rough))]
        lowest = lowest[: int(np.clip(most, FEWEST_POLISHED, MOST_POLISHED))]
        shifts, found = [], []
        for shift in self.shifts[lowest].tolist():
            near = shift - self.step, shift + self.step
            polished = minimize_scalar(exactly, bounds=near, options={"xatol": 0.1 * TICK})
            shifts.append(float(polished.x))
            found.append(float(polished.fun))
        return np.array(shifts), np.array(found)
