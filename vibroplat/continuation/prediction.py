"""Orbits of a branch beside those that are known: unknowns and Jacobian by polynomials through them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vibroplat.continuation.point import Point
from vibroplat.kernels.compiled import FloatArray

#: Points that a prediction rests on, at most.
MOST = 3
#: Least cosine between the tangent at a point and the direction in which its place is measured.
ALIGNED = 0.3
#: Least distance of two points, as a part of the way that is predicted.
APART = 0.05


def predicted(
    points: Sequence[Point], origin: FloatArray, direction: FloatArray, place: float
) -> tuple[FloatArray, FloatArray]:
    """Predict the orbit at a place along a direction from an origin.

    Parameters
    ----------
    points
        Of one branch, the nearest first; those in another frame or with other events than the first are left out.
    origin, direction, place
        Unknowns, a direction of length 1, and the distance along it, which the prediction has exactly.

    Returns
    -------
    u, jacobian
        The polynomial through the points with their tangents, and that through their Jacobians.
    """
    used, places = _usable(points, origin, direction, place)
    values = [p.found.u for p in used]
    slopes = [p.tangent / float(p.tangent @ direction) for p in used]
    return osculating(places, values, slopes, place), interpolated(places, [p.found.jacobian for p in used], place)


def _usable(
    points: Sequence[Point], origin: FloatArray, direction: FloatArray, place: float
) -> tuple[list[Point], list[float]]:
    """Choose the points that a prediction rests on, and their places."""
    first = points[0]
    used, places = [first], [float((first.found.u - origin) @ direction)]
    apart = APART * abs(place - places[0])
    for point in points[1:]:
        alike = point.frame is first.frame and point.word == first.word
        if len(used) == MOST or not alike or point.tangent @ direction < ALIGNED:
            break
        here = float((point.found.u - origin) @ direction)
        if min(abs(here - p) for p in places) > apart:
            used.append(point)
            places.append(here)
    return used, places


def osculating(
    places: Sequence[float], values: Sequence[FloatArray], slopes: Sequence[FloatArray], place: float
) -> FloatArray:
    """Evaluate the polynomial with given values and slopes at places (Hermite)."""
    found = np.zeros_like(values[0])
    for here, weight, value, slope in zip(places, _weights(places, place), values, slopes, strict=True):
        away = place - here
        steepness = sum(1.0 / (here - other) for other in places if other != here)
        found += weight**2 * ((1.0 - 2.0 * away * steepness) * value + away * slope)
    return found


def interpolated(places: Sequence[float], values: Sequence[FloatArray], place: float) -> FloatArray:
    """Evaluate the polynomial with given values at places (Lagrange)."""
    found = np.zeros_like(values[0])
    for weight, value in zip(_weights(places, place), values, strict=True):
        found += weight * value
    return found


def _weights(places: Sequence[float], place: float) -> list[float]:
    """Evaluate the polynomials that are 1 at one of the places and 0 at the others."""
    return [math.prod((place - other) / (here - other) for other in places if other != here) for here in places]
