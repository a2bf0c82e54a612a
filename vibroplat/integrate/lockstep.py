"""Steps of motions side by side by their Taylor series.

A step is the series at its beginning, as far as its last coefficients allow; it ends earlier where the guard falls,
where an exciter comes to rest or reaches the angle that the run waits for. Each finished step is confirmed: its
polynomial's accelerations at the end against those of the equations there, which the next series begins with. One that
fails is halved.

One source carries one motion, and several side by side (:class:`~vibroplat.integrate.group.Group`), each with a step,
parameters and events of its own. Series, lengths and ends of steps are computed in vectors. What ends a segment, jumps
included, is the code for one motion: sums of sizes in the vector say which motions may have something of that kind in
their step. A motion with an event is confirmed at once, jumps, and goes on with the next expansion, so that no place in
the vector is lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.hybrid import loop
from vibroplat.hybrid.loop import AT_TARGET, FAILED, NOT_FINITE
from vibroplat.hybrid.starts import cut_piece
from vibroplat.hybrid.state import CONSISTENT, MARGIN, RUNNING, Automaton, Steps, rewind
from vibroplat.integrate.group import Group, is_due, keeps
from vibroplat.integrate.interface import count_from, count_within_period
from vibroplat.integrate.step_end import ERROR_COEFFICIENTS, ON, end_of_step, put_polynomials
from vibroplat.kernels.compiled import borrow, call_int, compiled, fused, fused_inline, inlined
from vibroplat.kernels.lanes import (
    Lanes,
    align_stack,
    as_lanes,
    at,
    exp2,
    four,
    greater,
    lesser,
    log2,
    part,
    select,
    size,
    some,
    total,
    zero,
)
from vibroplat.model.series import ALONG_COLUMN, FORCE_COLUMN, FRICTION_COLUMN, WORDS, expand
from vibroplat.model.systems import ALGEBRAIC, ALONG, ALONG_RATE, DIFFERENTIAL, LAYERS, SENSE, SERIES_COLUMNS, STICKS

#: Largest difference of accelerations at the end of a step, times its length over its degree, in tolerances of rates.
MAX_DEFECT = 5.0

#: Round-off of an acceleration over the sum of its polynomial's terms.
_NOISE = 1e3 * float(np.finfo(float).eps)

#: Shortest step, as a part of a period.
MIN_STEP = 1e-13

#: Length of a step that nothing limits, and a size of nothing whose logarithm is finite.
_LONG, _NOTHING = 1e300, 1e-300

# What is done with a motion alone: a segment is begun where there is none, a confirmed step is added, the end of a step
# is looked at before the motion goes there, and after it; the mode of a state is found.
_BEGIN, _ADD, _BEFORE, _BEHIND, FIRST = range(5)


@inlined
def attend(g: Group, lane: int, task: int) -> bool:
    """Do something with the motion in a lane; whether it goes on."""
    steps = Steps(g.begins[lane], g.lengths[lane], g.c[lane], g.ends[lane], g.pieces[lane], g.used[lane])
    address = g.parameters + 8 * lane * g.words.shape[1]
    h = Automaton(g.p[lane], g.runs[lane], g.recent[lane], g.events[lane], steps, g.start, address)
    if task == _BEGIN:
        return begin(h, g, lane)
    if task == _ADD:
        add_step(h, g, lane)
    elif task == _BEFORE:
        look_at_end(h, g, lane)
    elif task == FIRST:
        loop.first_mode(h)
    else:
        look_behind(h, g, lane)
    return True


@fused
def run_lanes(owned_g: Group) -> int:
    """Carry motions on until one has ended or has no room for more steps: its lane; −1 once all are idle."""
    g = borrow(owned_g)
    s, r, p = as_lanes(g.lanes), as_lanes(g.room), as_lanes(g.rows)
    align_stack(s.t)
    while True:
        for lane in range(g.status.size):
            open_ = g.status[lane].open == 1 and g.status[lane].full == 0
            if not (open_ or g.lanes.idle[lane] > 0.5 or attend(g, lane, _BEGIN)):
                return lane
        if not some(s.idle < 0.5):
            return -1
        expand(s, g.degree, r, p, g.moving)
        confirm(g, s, r)
        propose(g, s, r)


@inlined
def begin(h: Automaton, g: Group, lane: int) -> bool:
    """Begin a segment, unless the motion has ended or has no room for more steps."""
    status = g.status[lane]
    if status.full == 1:
        status.full = 0
        cut_piece(h)
        return False
    if h.run.outcome != RUNNING:
        return False
    if not keeps(h, g):
        rewind(h.steps)
    if not g.keep:
        h.run.events = 0
    elif h.steps.used.steps + 1 + MARGIN > h.steps.start.size or h.run.events + 2 > h.events.size or is_due(h.run):
        return False
    if not loop.begin_segment(h):
        return False
    if not keeps(h, g):
        rewind(h.steps)  # impacts that have been summed up took one
    start(h, g, lane)
    start_moving(h, g, lane, g.moving)
    return True


@inlined
def start_moving(h: Automaton, g: Group, lane: int, moving: Any) -> None:
    """Begin a segment of a motion with transport: the mode of contact, which is data in other fields."""
    run, s = h.run, g.lanes
    system = run.systems[run.mode]
    if moving is not None:
        s.y[ALONG_COLUMN, lane], s.v[ALONG_COLUMN, lane] = run.state[ALONG], run.state[ALONG_RATE]
        s.stuck[lane] = 1.0 if STICKS[system] else 0.0
        s.sliding[lane] = h.p.kinetic_friction * SENSE[system]
        s.slope[lane], s.height[lane], s.share[lane] = h.p.slope, h.p.deck_height, h.p.material_share


@compiled
def start(h: Automaton, g: Group, lane: int) -> None:
    """Begin a segment: its state, the tolerances of its rates, its mode as data, its parameters."""
    run, s = h.run, g.lanes
    system = run.systems[run.mode]
    n, layers = DIFFERENTIAL[system] // 2, LAYERS[system]
    for i in range(FORCE_COLUMN):
        s.y[i, lane], s.v[i, lane], s.weights[i, lane] = run.state[i], run.state[FORCE_COLUMN + i], 0.0
    for i in range(n):
        s.weights[SERIES_COLUMNS[system, i], lane] = 1.0 / run.atol[n + i]
    s.force_weight[lane] = 1.0 / run.atol[2 * n] if ALGEBRAIC[system] else 0.0
    s.attached[lane] = 1.0 if ALGEBRAIC[system] else 0.0
    s.flying[lane] = 1.0 if layers > 0 and not ALGEBRAIC[system] else 0.0
    s.two[lane] = 1.0 if layers == 2 else 0.0
    s.lower_share[lane] = 1.0 / h.p.lower_mass if layers > 0 else 0.0
    s.origin[lane], s.t[lane], s.done[lane], s.until[lane] = run.origin, run.origin, 0.0, run.until
    s.cap[lane], s.pending[lane], s.target[lane] = _LONG, 0.0, run.target - run.turns[0]
    s.period[lane], s.safe_rotation[lane] = run.period, h.p.safe_rotation
    g.status[lane].open, g.status[lane].before = 1, 0.0
    s.counted[lane], s.counted_from[lane] = count_from(s.counted[lane], s.counted_from[lane], run.origin)
    for i in range(WORDS):
        g.rows.words[i, lane] = g.words[lane, i]


@fused_inline
def quads_of(moving: Any) -> int:
    """How many sets of four columns motions have, with transport or without."""
    return 2 if moving is None else 3


@fused_inline
def largest(quad: Any) -> Lanes:
    """Largest of four columns."""
    first, second = part(quad)
    first, second = part(greater(first, second))
    return greater(first, second)


@fused_inline
def confirm(g: Group, s: Any, r: Any) -> None:
    """Confirm the last steps by the accelerations and F_c that the next series begin with, or take them back."""
    quads = r.quads
    share, sums = s.length * (1.0 / g.degree), zero(s.length)
    worst = size(s.y[FORCE_COLUMN] - r.q[0, FORCE_COLUMN]) * s.force_weight
    for i in range(quads_of(g.moving)):
        worst = greater(worst, largest(size(s.a4[i] - 2.0 * quads[2, i]) * s.weights4[i]) * share)
        sums += total(total(quads[2, i]))
    good = (worst <= greater(s.noise, MAX_DEFECT)) & is_finite(sums)
    kept = select(good, s.pending, 0.0)
    back = s.pending > kept
    # whether the difference is round-off, which few steps need to know, the same step says once more
    s.cap = select(back, select(s.noisy > 0.5, 0.5 * s.length, s.length), select(kept > 0.5, _LONG, s.cap))
    s.stale = select(back, 1.0, 0.0)
    if some(back):
        s.noisy = select(back, 1.0, s.noisy)
        s.rejected += s.pending - kept
        s.done = select(back, s.done0, s.done)
        s.t = s.origin + s.done
        for i in range(quads_of(g.moving)):
            s.y4[i], s.v4[i] = select(back, s.y04[i], s.y4[i]), select(back, s.v04[i], s.v4[i])
    s.counted += s.pending  # those taken back too: where all are, a motion takes as long
    s.pending = kept
    for lane in range(g.status.size):
        if g.lanes.pending[lane] > 0.5:
            attend(g, lane, _ADD)
    s.counted, s.counted_from = count_within_period(s.counted, s.counted_from, s.t, s.period)


@inlined
def add_step(h: Automaton, g: Group, lane: int) -> None:
    """Add a confirmed step to those that observers read, or note its duration."""
    s, status = g.lanes, g.status[lane]
    h.run.zeros = h.run.other_zeros = 0  # they were of the segment's start
    status.before = s.length[lane]
    if keeps(h, g):
        write_step(h, g, lane, h.steps.used.steps)
        h.steps.used.steps += 1
        status.full = 1 if h.steps.used.steps + MARGIN >= h.steps.start.size else 0


@inlined
def write_step(h: Automaton, g: Group, lane: int, row: int) -> None:
    """Write beginning, duration and end of a step whose polynomials are in a row already."""
    s, steps = g.lanes, h.steps
    system = h.run.systems[h.run.mode]
    n = DIFFERENTIAL[system] // 2
    steps.start[row], steps.length[row] = s.done0[lane], s.length[lane]
    for i in range(n):
        column = SERIES_COLUMNS[system, i]
        steps.ends[row, i], steps.ends[row, n + i] = s.y[column, lane], s.v[column, lane]
    if ALGEBRAIC[system]:
        steps.ends[row, 2 * n] = s.y[FORCE_COLUMN, lane]
        if g.moving is not None:
            steps.ends[row, 2 * n + 1] = s.y[FRICTION_COLUMN, lane]


@fused_inline
def longest_step(s: Any, q: Any, quads: Any, degree: int, moving: Any) -> Lanes:
    """Longest step with which none of the last coefficients of rates, and of F_c, is above its tolerance (s)."""
    none = zero(s.length)
    # rates have k times the coefficient of their coordinate of order k, and the exponent of F_c before it
    first, second = last_size(s, q, quads, degree, moving), last_size(s, q, quads, degree - 1, moving)
    third, fourth = last_size(s, q, quads, degree - 2, moving), last_size(s, q, quads, degree - 3, moving)
    fifth = size(q[at(degree - ERROR_COEFFICIENTS - 1), FORCE_COLUMN]) * s.force_weight
    shares = four(
        none + 1.0 / (degree - 1.0),
        none + 1.0 / (degree - 2.0),
        none + 1.0 / (degree - 3.0),
        none + 1.0 / (degree - 4.0),
    )
    least = largest(log2(greater(four(first, second, third, fourth), _NOTHING)) * shares)
    return exp2(-greater(least, log2(greater(fifth, _NOTHING)) * (1.0 / (degree - 5.0))))


@fused_inline
def last_size(s: Any, q: Any, quads: Any, k: int, moving: Any) -> Lanes:
    """Size of the last coefficients of rates, with k times that of their coordinates, and of F_c, in tolerances."""
    i = at(k)
    first, second = size(quads[i, 0]) * s.weights4[0], size(quads[i, 1]) * s.weights4[1]
    coordinates = greater(first, second)
    if moving is not None:
        coordinates = greater(coordinates, size(quads[i, 2]) * s.weights4[2])
    return greater(float(k) * largest(coordinates), size(q[at(k - 1), FORCE_COLUMN]) * s.force_weight)


@fused_inline
def may_end(s: Any, q: Any, degree: int, h: Lanes) -> Any:
    """Where a step may hold a fall of the guard, a standstill, or the angle that ends the run.

    What is left out by sums of sizes here has none of these for :func:`end_of_step` either.
    """
    attached = s.attached > 0.5
    none = zero(h)
    power, sizes, down, rest = h, none, none, none
    turned, faster, slower = none, none, none
    for k in range(1, degree + 1):
        i = at(k)
        c = select(attached, q[i, FORCE_COLUMN], q[i, 5]) * power
        sizes, down = sizes + size(c), down + lesser(c, 0.0)
        if k > degree - ERROR_COEFFICIENTS - 2:
            rest += size(c)
        following = power * (k + 1.0)
        turned += size(q[i, 3]) * power
        faster += size(q[at(k + 1), 3]) * following
        slower += size(q[at(k + 1), 4]) * following
        power *= h
    first = select(attached, q[0, FORCE_COLUMN], q[0, 5])
    falls = (first <= sizes + rest) & (first + down - rest <= 0.0) & (s.attached + s.flying > 0.5)
    stops = (size(s.v[3]) <= faster) | (size(s.v[4]) <= slower)
    return falls | stops | (s.y[3] + 2.0 * turned >= s.target)


@fused_inline
def propose(g: Group, s: Any, r: Any) -> None:
    """Choose the next steps, and move to their ends by their polynomials."""
    q, quads, degree = r.q, r.quads, g.degree
    left = s.until - s.done
    length = lesser(longest_step(s, q, quads, degree, g.moving), s.cap)
    singly = may_end(s, q, degree, lesser(length, left)) | (length >= left) | (s.counted > 1.0 * g.max_steps)
    if g.moving is not None:
        singly = s.length == s.length  # of two guards: each step is looked into
    s.singly = select(length >= MIN_STEP * s.period, select(singly, 1.0, 0.0), 2.0)
    s.length = lesser(length, left)
    s.pending = 1.0 - greater(
        s.idle, s.stale
    )  # a step that was taken back left a series that is not that of its beginning
    for lane in range(g.status.size):
        attend(g, lane, _BEFORE)
    s.steps += s.pending
    move(s, q, quads, degree, g.moving)
    good = (size(s.y[2]) <= s.safe_rotation) & is_finite(total(total(s.a4[0] + s.a4[1])))
    s.doubtful = select(good, 0.0, s.pending)
    if some(greater(s.singly, s.doubtful) > 0.5):
        for lane in range(g.status.size):
            if g.lanes.pending[lane] > 0.5 and (g.lanes.singly[lane] > 0.5 or g.lanes.doubtful[lane] > 0.5):
                attend(g, lane, _BEHIND)


@inlined
def is_finite(x: Lanes) -> Any:
    """Whether a number is finite."""
    return x - x == 0.0


@fused_inline
def move(s: Any, q: Any, quads: Any, degree: int, moving: Any) -> None:
    """Move to the ends of the steps, and note where they began."""
    length, goes = s.length, s.pending > 0.5
    for i in range(quads_of(moving)):
        y, v, a = quads[degree, i], zero(s.y4[i]), zero(s.y4[i])
        for k in range(degree - 1, -1, -1):
            a, v, y = a * length + v, v * length + y, y * length + quads[at(k), i]
        s.y04[i], s.v04[i], s.a4[i] = s.y4[i], s.v4[i], 2.0 * a
        s.y4[i], s.v4[i] = select(goes, y, s.y4[i]), select(goes, v, s.v4[i])
    s.done0 = s.done
    s.done = select(goes, s.done + length, s.done)
    s.t = s.origin + s.done
    if some(s.noisy > 0.5):
        s.noise = _NOISE * round_off(s, q, quads, degree, moving)


@fused_inline
def round_off(s: Any, q: Any, quads: Any, degree: int, moving: Any) -> Lanes:
    """Sum up the sizes of the terms that make the accelerations and F_c at the ends of the steps, in tolerances."""
    length, force, worst = s.length, zero(s.length), zero(s.length)
    for k in range(degree, -1, -1):
        force = force * length + size(q[at(k), FORCE_COLUMN])
    for i in range(quads_of(moving)):
        terms = zero(s.y4[i])
        for k in range(degree, 1, -1):
            terms = terms * length + k * (k - 1.0) * size(quads[at(k), i])
        worst = greater(worst, largest(terms * s.weights4[i]))
    return greater(worst * length * (1.0 / degree), force * s.force_weight)


@inlined
def look_at_end(h: Automaton, g: Group, lane: int) -> None:
    """Write the polynomials of a lane's step where they are needed, and find whether it ends earlier, or not at all."""
    s, status, degree = g.lanes, g.status[lane], g.degree
    status.stop, status.resting = ON, -1
    if status.full == 1 or s.pending[lane] < 0.5:
        s.pending[lane] = s.singly[lane] = 0.0
        return
    row = h.steps.used.steps if keeps(h, g) else (1 if status.before > 0.0 else 0)
    if s.singly[lane] > 1.5 or s.counted[lane] > g.max_steps:
        finite = True
        for i in range(FORCE_COLUMN):
            finite = finite and abs(g.room.q[2, i, lane]) < np.inf
        s.pending[lane] = s.singly[lane] = 0.0
        status.open, status.short = 0, 1 if finite else 0
        if not keeps(h, g) and status.before > 0.0:  # where the motion is
            s.done0[lane], s.length[lane] = s.done[lane] - status.before, status.before
            write_step(h, g, lane, 0)
            h.steps.used.steps = 1
        loop.end_segment(h, FAILED if finite else NOT_FINITE)
    elif s.singly[lane] > 0.5:
        length = end_of_step(h, status, g.room.q, lane, degree, s.done[lane], s.length[lane], h.steps.c[row])
        s.length[lane] = length
    elif keeps(h, g):
        write_series(h, g, lane, row)


@inlined
def write_series(h: Automaton, g: Group, lane: int, row: int) -> None:
    """Write the series of a lane as the polynomials of its step."""
    system = h.run.systems[h.run.mode]
    put_polynomials(g.room.q, lane, g.degree, g.lanes.length[lane], system, h.steps.c[row])


@inlined
def look_behind(h: Automaton, g: Group, lane: int) -> None:
    """Confirm the step of a lane at once where its segment ends, and end that; take back a step out of the model."""
    s, status = g.lanes, g.status[lane]
    if status.resting >= 0:
        s.v[3 + status.resting, lane] = 0.0
    if status.stop == ON and s.doubtful[lane] < 0.5:
        return
    if not agrees(h, g, lane):
        take_back(g, lane)
        return
    if status.stop == ON:
        return
    row = h.steps.used.steps
    if not keeps(h, g) and status.before > 0.0:
        h.steps.start[0], h.steps.length[0] = s.done0[lane] - status.before, status.before
        row = h.steps.used.steps = 1
    write_step(h, g, lane, row)
    if status.stop == AT_TARGET:
        h.steps.ends[row, 3] = h.run.target - h.run.turns[0]
    h.steps.used.steps += 1
    h.run.zeros = h.run.other_zeros = 0  # they were of the segment's start
    s.pending[lane] = 0.0
    status.open = 0
    loop.end_segment(h, status.stop)


@inlined
def take_back(g: Group, lane: int) -> None:
    """Take a step back, for one of half its length."""
    s = g.lanes
    for i in range(s.y.shape[0]):
        s.y[i, lane], s.v[i, lane] = s.y0[i, lane], s.v0[i, lane]
    s.done[lane], s.cap[lane], s.pending[lane] = s.done0[lane], 0.5 * s.length[lane], 0.0
    s.t[lane] = s.origin[lane] + s.done[lane]
    s.rejected[lane] += 1.0


@compiled
def agrees(h: Automaton, g: Group, lane: int) -> bool:
    """Whether a step ends where the model holds, with the accelerations and F_c that the equations have there."""
    s, status, system = g.lanes, g.status[lane], h.run.systems[h.run.mode]
    n, y, yp = DIFFERENTIAL[system] // 2, g.status[lane].y, g.status[lane].yp
    for i in range(n):
        column = SERIES_COLUMNS[system, i]
        y[i], y[n + i] = s.y[column, lane], s.v[column, lane]
    addresses = (y.ctypes.data, yp.ctypes.data, status.ypp.ctypes.data)
    if call_int(h.start, (system, s.t[lane], *addresses, h.parameters, CONSISTENT)) == 0:
        return False
    worst = 0.0
    for i in range(n):
        column = SERIES_COLUMNS[system, i]
        difference = abs(s.a[column, lane] - yp[n + i])
        if not difference < np.inf:
            return False
        worst = max(worst, difference * s.weights[column, lane])
    worst *= s.length[lane] / g.degree
    if ALGEBRAIC[system]:
        worst = max(worst, abs(s.y[FORCE_COLUMN, lane] - y[2 * n]) * s.force_weight[lane])
    return worst <= max(MAX_DEFECT, s.noise[lane])
