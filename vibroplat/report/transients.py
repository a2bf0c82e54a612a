"""Transients in the strokes of a run that still decay during the measured part.

In steady motion the positions at whole turns of exciter 1 repeat. A transient oscillates about them at the natural
frequencies and decays, along an axis with inertia M and damping b at the rate b / 2M, faster with material; where
springs couple axes, as the modes in which the axis moves. Its range at the beginning of the measured part is the error
of the stroke.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes
from vibroplat.kernels.compiled import FloatArray
from vibroplat.observe.extremes import HEIGHT, SIDEWAYS, merge_extremes
from vibroplat.observe.measures import Accumulators, measured_extremes
from vibroplat.observe.section import section_rows

#: Range of places over the stroke up to which it is round-off, in which no decay is seen.
ROUND_OFF = 1e-6
#: Number of parts of the kept turns whose ranges are compared, and the ratio of the last to the first that is a decay.
STRETCHES, DECAYS = 4, 0.5


class Transient(NamedTuple):
    """A transient along an axis.

    Attributes
    ----------
    size
        Its range at the beginning of the measured part (m), at most the stroke.
    rate
        Rate of its decay (1/s).
    """

    size: float
    rate: float


def transients(ms: Accumulators, scene: Scene, begin: float, period: int) -> list[Transient]:
    """Estimate the transients along x and y of a run.

    If the ranges of positions do not decrease, they may belong to the motion itself. Then a transient is at most what
    the damping leaves of the largest stroke of the run.

    Parameters
    ----------
    ms
        What was measured of it.
    scene
        What was simulated.
    begin
        When it began, or when its supply changed for the last time (s).
    period
        Turns after which places repeat; 0 if they do not.
    """
    rows, whole, measured = section_rows(ms), merge_extremes(ms.extremes), measured_extremes(ms)
    since, turns = float(ms.marks["first"][0]), max(period, 1)
    if len(rows) < 2 * turns:
        return [Transient(0.0, 0.0)] * 2
    modes, found = natural_modes(scene), []
    rates, speeds = 0.5 * modes.damping / modes.inertia, modes.speeds
    for axis, k in enumerate((SIDEWAYS, HEIGHT)):
        own = modes.of(axis)
        expected, slowest = float(rates[own].min()), float(speeds[own].min())
        swing = TURN / slowest if slowest else math.inf
        stroke = float(measured["largest"][k] - measured["least"][k])
        size, seen = _range_at(since, rows["t"], rows["state"][:, axis], turns, (expected, swing, ROUND_OFF * stroke))
        left = 0.0
        if not seen:  # the largest stroke was before the measured part, or this motion has been so from its beginning
            last = max(float(whole["at_least"][k]), float(whole["at_largest"][k]))
            left = since - (last if last < since else begin)
            size = min(size, float(whole["largest"][k] - whole["least"][k]) * math.exp(-expected * max(left, 0.0)))
        found.append(Transient(min(size, stroke), seen or expected))
    return found


def _range_at(
    since: float, times: FloatArray, places: FloatArray, turns: int, axis: tuple[float, float, float]
) -> tuple[float, float]:
    """Return the range of places so many turns apart at a time (s), and the rate of its decay; 0 if none is seen.

    Of the axis are known the rate of decay (1/s) and the period (s) without material, and the range that is round-off.
    """
    length, (expected, swing, least) = len(times) // (STRETCHES * turns) * turns, axis
    if length < 2 * turns or times[length] - times[0] < swing:
        (size,), rate = _ranges(places[-(len(places) // turns) * turns :].reshape(1, -1, turns)), 0.0
    else:
        size, *_, last = _ranges(places[-STRETCHES * length :].reshape(STRETCHES, -1, turns))
        rate = (
            math.log(size / last) / float(times[-length] - times[-STRETCHES * length])
            if least < size and 0.0 < last < DECAYS * size
            else 0.0
        )
    # the last turns are kept, and the measured part may have begun long before
    earlier = (rate or expected) * float(times[0] - since)
    return size * math.exp(min(earlier, 50.0)), rate


def _ranges(places: FloatArray) -> list[float]:
    """Return the largest range of each part of places, shape (parts, periods, turns), that are whole periods apart."""
    ranges: list[float] = np.ptp(places, axis=1).max(axis=1).tolist()
    return ranges
