"""Extremes of quantities that are linear in the unknowns and their rates, in a part of a step; others are followed.

Their samples show, for all quantities at once, which may have a new extreme. Only for these, polynomials are formed,
and peaks are searched for side by side in lanes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.hybrid.modes import FLIGHT, MODES
from vibroplat.kernels.compiled import FloatArray, compiled, fused_inline, inlined
from vibroplat.kernels.lanes import (
    Lanes,
    as_lanes,
    bits,
    four,
    greater,
    join,
    lesser,
    load_2,
    load_4,
    load_8,
    part,
    select,
    size,
    store,
    zero,
)
from vibroplat.kernels.polynomial import MAX_DEGREE, slope, turning_point
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import BENT, foundation_forces_at
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, GAP
from vibroplat.observe.curves import follow
from vibroplat.observe.extremes import (
    CONTACT_FORCE,
    DRIVEN_1,
    GAPS,
    OPENING,
    POINTS,
    PULL_X,
    SPEED_1,
    Span,
    place_of,
    remember,
    vertex,
)

#: How many quantities have columns, and how many of them are compared at once.
COLUMNS, EIGHT = 32, 8
#: Factor of the bound on how far an unknown exceeds its samples, for the ends of a step, which lie outside of all nodes
#: but next to the first and the last one.
AT_ENDS = 0.0625
#: Number of peaks that are searched for side by side.
SIDE_BY_SIDE = 4
#: Fields for samples near which there may be a new extreme: the polynomials, with the sign by which it is a maximum;
#: the samples' values; place of the peak and interval of the search; the peak's value; the sign; the quantity.
TOPS = [
    ("series", float, (MAX_DEGREE + 1, 1, SIDE_BY_SIDE)),
    *((name, float, SIDE_BY_SIDE) for name in ("top", "place", "low", "high", "peak", "sense")),
    ("quantity", np.int64, SIDE_BY_SIDE),
]


@fused_inline
def put_quantities(samples: FloatArray, row: int, system: int, room: Any) -> None:
    """Put the quantities of a row of unknowns into the same row of those.

    What the system does not have is nan, which is beyond no limit.
    """
    n = DIFFERENTIAL[system] // 2
    gap = samples[row, GAP] if MODES[system] == FLIGHT else np.nan
    force = samples[row, 2 * n] if ALGEBRAIC[system] else np.nan
    first = four(samples[row, 0], samples[row, 1], samples[row, 2], gap)
    second = four(force, samples[row, n + 3], samples[row, n + 4], np.nan)
    pulls = load_4(samples, row, 0) * load_4(room.springs, 0, 0) + load_4(samples, row, n) * load_4(room.springs, 1, 0)
    store(join(first, second), room.quantities, row, 0)
    store(join(pulls, zero(pulls) + np.nan), room.quantities, row, PULL_X)
    if room.named > 0:
        for j in range(POINTS, COLUMNS, EIGHT):
            moved = load_2(samples, row, 0) + samples[row, 2] * load_8(room.levers, 0, j - POINTS)
            store(moved, room.quantities, row, j)


@fused_inline
def beyond_limits(quantities: FloatArray, nodes: int, reach: float, limits: FloatArray, first: int) -> tuple[int, int]:
    """Find out which of eight quantities may go above their limits in a part of a step, and which below: bits.

    Between samples a polynomial goes beyond all of them by less than some part of their range. Without branches: what
    a step holds cannot be guessed.

    Parameters
    ----------
    quantities, nodes
        Quantities at the beginning, at the nodes, and at the end; number of nodes.
    reach
        This part; see :data:`vibroplat.observe.extremes.REACH`.
    limits, first
        Least and largest values, shape (2, COLUMNS), and from which column on.
    """
    top = low = load_8(quantities, 1, first)
    for i in range(2, nodes + 1):
        here = load_8(quantities, i, first)
        top, low = greater(here, top), lesser(here, low)
    start, end = load_8(quantities, 0, first), load_8(quantities, nodes + 1, first)
    above, below = greater(start, end), lesser(start, end)
    over = reach * (greater(top, above) - lesser(low, below))
    highest, lowest = greater(top + over, above + AT_ENDS * over), lesser(low - over, below - AT_ENDS * over)
    return bits(highest > load_8(limits, 1, first)), bits(lowest < load_8(limits, 0, first))


@fused_inline
def largest_squares(samples: FloatArray, span: Span) -> Lanes:
    """Bound the square of the acceleration of x and y, and of y alone, from rates at samples: the lanes of a pair.

    The square of an acceleration goes beyond its means between samples by less than its neighbours are below it.
    """
    n, inverse = DIFFERENTIAL[span.system] // 2, 1.0 / (span.length * (span.last - span.first))
    rates = load_2(samples, 1, n)
    here = _squares((rates - load_2(samples, 0, n)) * (inverse * GAPS[span.nodes, 0]))
    top = way = zero(here)
    for i in range(1, span.nodes + 1):
        after = load_2(samples, i + 1, n)
        following = _squares((after - rates) * (inverse * GAPS[span.nodes, i]))
        top = greater(_peak(here, way, following - here), top)
        way, here, rates = following - here, following, after
    return greater(_peak(here, way, zero(way)), top)


@fused_inline
def _squares(acceleration: Lanes) -> Lanes:
    x, y = part(acceleration * acceleration)
    return join(x + y, y)


@fused_inline
def _peak(here: Lanes, way: Lanes, following: Lanes) -> Lanes:
    """Bound the values near a sample: where the differences change sign, the larger one is added to the sample."""
    return here + select(way * following <= 0.0, greater(size(way), size(following)), 0.0)


@compiled
def cover(extremes: Any, above: int, below: int, room: Any, span: Span, p: Parameters) -> None:
    """Let the extremes of columns whose bits are set, above or below limits, cover a part of a step.

    Parameters
    ----------
    extremes, above, below
        Record of :data:`vibroplat.observe.extremes.EXTREMES`, and the bits of :func:`beyond_limits`.
    room, span, p
        Record of :data:`vibroplat.observe.room.ROOM` with quantities at the samples, and the limits beyond which
        an extreme is new; the part; the parameters.
    """
    count = 0
    for sense in (1.0, -1.0):
        k, left = 0, above if sense > 0.0 else below
        while left != 0:
            if left & 1 and PULL_X <= k < SPEED_1 and BENT[min(max(k - PULL_X, 0), 2)]:
                follow(extremes, k, room, span, p)
            elif left & 1:
                count = find_tops(extremes, k, sense, room, span, count, p)
            k, left = k + 1, left >> 1
    if count > 0:
        polish(extremes, room, span, count)


@inlined
def find_tops(extremes: Any, k: int, sense: float, room: Any, span: Span, count: int, p: Parameters) -> int:
    """Gather the samples of quantity k near which there may be a new extreme, after ``count`` others; return how many.

    They are not below their neighbours, and exceed the limit if the larger difference from a neighbour is added.
    """
    samples, known, last = room.quantities, sense * room.limits[1 if sense > 0.0 else 0, k], span.nodes + 1
    before, bit, near = sense * samples[0, k], 1, 0
    here = before
    for i in range(last + 1):
        after = sense * samples[min(i + 1, last), k]
        near |= bit * ((here >= before) & (here >= after) & (here + max(here - before, here - after) > known))
        before, here, bit = here, after, 2 * bit
    for i in range(last + 1):
        if near >> i & 1:
            if count == SIDE_BY_SIDE:
                polish(extremes, room, span, count)
                count = 0
            put_series(k, sense, room, count, span, p)
            low, place, high = place_of(i - 1, span), place_of(i, span), place_of(i + 1, span)
            remember(extremes, k, samples[i, k], place, span)
            leaving = slope(room.series[:, 0], span.degree, count, place) if not 0 < i < last else 0.0
            if (i == 0 and leaving <= 0.0) or (i == last and leaving >= 0.0):
                continue  # an end that the polynomial comes to straight has no peak beside it
            around = samples[max(i - 1, 0), k], samples[i, k], samples[min(i + 1, last), k]
            room.quantity[count], room.sense[count], room.top[count] = k, sense, sense * samples[i, k]
            room.low[count], room.place[count], room.high[count] = low, vertex((low, place, high), around), high
            count += 1
    return count


@inlined
def put_series(k: int, sense: float, room: Any, lane: int, span: Span, p: Parameters) -> None:
    """Put ``sense`` times the polynomial of quantity k into a lane: an unknown, or what is linear in several."""
    n = DIFFERENTIAL[span.system] // 2
    c, first, other = span.c, k, 0.0
    if PULL_X <= k < SPEED_1:
        for i in range(span.degree + 1):  # a linear force makes its own coefficients of those of unknowns
            forces = foundation_forces_at(c[i, 0], c[i, 1], c[i, 2], c[i, n], c[i, n + 1], c[i, n + 2], p)
            room.series[i, 0, lane] = sense * forces[k - PULL_X]
        return
    if k >= POINTS:
        first, other = (k - POINTS) % 2, room.levers[k - POINTS]
    elif k >= DRIVEN_1:
        first = n + 3 + k - DRIVEN_1
    elif k == CONTACT_FORCE:
        first = 2 * n
    elif k == OPENING:
        first = GAP
    for i in range(span.degree + 1):
        room.series[i, 0, lane] = sense * (c[i, first] + other * c[i, 2])


@compiled
def polish(extremes: Any, room: Any, span: Span, count: int) -> None:
    """Update the extremes with the peaks near a number of samples, all found at once."""
    r = as_lanes(room)
    r.peak, r.place = turning_point(r.series, span.degree, 0, r.place, r.low, r.high, r.top)
    for i in range(count):
        if room.peak[i] > room.top[i]:
            remember(extremes, room.quantity[i], room.sense[i] * room.peak[i], room.place[i], span)
