"""Dense output between the ends of a step: cubic Hermite interpolation, order 4, for every engine."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from vibroplat.kernels.compiled import compiled, copy
from vibroplat.model.parameters import FloatArray


@compiled
def hermite(s: float, step: float, y0: float, y1: float, rate_0: float, rate_1: float) -> float:
    """Cubic Hermite interpolant at fraction s of a step."""
    r = 1.0 - s
    return r * r * ((1.0 + 2.0 * s) * y0 + s * step * rate_0) + s * s * ((1.0 + 2.0 * r) * y1 - r * step * rate_1)


@compiled
def hermite_slope(s: float, step: float, y0: float, y1: float, rate_0: float, rate_1: float) -> float:
    """Time derivative of :func:`hermite`."""
    r = 1.0 - s
    return 6.0 * s * r * (y1 - y0) / step + r * (1.0 - 3.0 * s) * rate_0 + s * (3.0 * s - 2.0) * rate_1


@compiled
def interpolate(
    s: float,
    step: float,
    y0: FloatArray,
    y1: FloatArray,
    yp0: FloatArray,
    yp1: FloatArray,
    y: FloatArray,
    yp: FloatArray,
) -> None:
    """Fill unknowns and their time derivatives at fraction s of a step."""
    for i in range(y0.size):
        y[i] = hermite(s, step, y0[i], y1[i], yp0[i], yp1[i])
        yp[i] = hermite_slope(s, step, y0[i], y1[i], yp0[i], yp1[i])


@compiled
def sample(t: FloatArray, y: FloatArray, yp: FloatArray, times: FloatArray) -> npt.NDArray[np.float64]:
    """Interpolate at ascending times inside [t[0], t[-1]]; returns shape (len(times), y.shape[1])."""
    out = np.empty((times.size, y.shape[1]))
    slope = np.empty(y.shape[1])
    k = 0
    for i in range(times.size):
        while k < t.size - 2 and times[i] > t[k + 1]:
            k += 1
        if t.size == 1 or times[i] == t[k]:
            copy(y[k], out[i])
            continue
        step = t[k + 1] - t[k]
        if times[i] == t[k + 1]:
            copy(y[k + 1], out[i])
        else:
            interpolate((times[i] - t[k]) / step, step, y[k], y[k + 1], yp[k], yp[k + 1], out[i], slope)
    return out


@compiled
def turning_points(step: float, f0: float, f1: float, rate_0: float, rate_1: float) -> tuple[float, float]:
    """Fractions of a step, in (0, 1) and ascending, at which the interpolant's slope is 0; 1 for one that is not."""
    a = 3.0 * (step * (rate_0 + rate_1) - 2.0 * (f1 - f0))
    b = 2.0 * (3.0 * (f1 - f0) - step * (2.0 * rate_0 + rate_1))
    c = step * rate_0
    first, second = 1.0, 1.0
    root = b * b - 4.0 * a * c
    if root >= 0.0:
        q = -0.5 * (b + math.copysign(math.sqrt(root), b))
        if a != 0.0 and 0.0 < q / a < 1.0:
            first = q / a
        if q != 0.0 and 0.0 < c / q < 1.0:
            second = c / q
    return min(first, second), max(first, second)


@compiled
def dip_below_zero(step: float, g0: float, g1: float, rate_0: float, rate_1: float) -> float:
    """First fall through zero of a guard inside one step, on its interpolant.

    An integrator's root finding compares signs at the ends of a step; a guard that falls and rises
    again in between, or that starts at exactly zero and is negative at the end, escapes it.

    Returns
    -------
    float
        Fraction of the step in [0, 1) at which the guard falls through zero, or −1 if it does not.
    """
    if g1 >= 0.0 and not rate_0 < 0.0 < rate_1:
        return -1.0
    if g1 < 0.0 and rate_1 >= 0.0:
        return -1.0
    first, second = turning_points(step, g0, g1, rate_0, rate_1)
    ends = (0.0, first, second, 1.0)  # between them it rises or falls all the way
    begin = 0
    if g0 < 0.0:  # by round-off or where it touched: it can fall only from where it is highest
        for i in range(1, 4):
            if hermite(ends[i], step, g0, g1, rate_0, rate_1) > hermite(ends[begin], step, g0, g1, rate_0, rate_1):
                begin = i
        if hermite(ends[begin], step, g0, g1, rate_0, rate_1) < 0.0:
            return ends[begin] if ends[begin] < 1.0 else -1.0
    for i in range(begin, 3):
        low, high = ends[i], ends[i + 1]
        if hermite(high, step, g0, g1, rate_0, rate_1) < 0.0:
            for _ in range(60):
                middle = 0.5 * (low + high)
                if hermite(middle, step, g0, g1, rate_0, rate_1) < 0.0:
                    high = middle
                else:
                    low = middle
            return low
    return -1.0
