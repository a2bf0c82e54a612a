"""Screening of steps: which quantities may have new extremes in one, as vectors of the processor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from vibroplat.kernels.compiled import FloatArray
from vibroplat.kernels.lanes import INDEX, PLACE, Rows, elementwise, loop, multiply_add, repeat

#: Part of what an unknown goes beyond its samples that is left where an end of a step is beyond all nodes, the first
#: and the last of which are next to the ends.
AT_ENDS = 0.0625
#: Where the bits of quantities below their limits begin.
LOWER = 32


def _larger(builder: Any, one: Any, other: Any) -> Any:
    """Make a vector of the larger numbers of two."""
    return builder.select(builder.fcmp_ordered(">", one, other), one, other)


def _smaller(builder: Any, one: Any, other: Any) -> Any:
    """Make a vector of the smaller numbers of two."""
    return builder.select(builder.fcmp_ordered("<", one, other), one, other)


def _squares(builder: Any, acceleration: Any) -> Any:
    """Make a vector of the squares of an acceleration and of its second component, and two numbers of no meaning."""
    square = builder.fmul(acceleration, acceleration)
    along = builder.shuffle_vector(square, square, ir.Constant(ir.VectorType(PLACE, 4), [1] * 4))
    return builder.fadd(builder.fmul(square, ir.Constant(square.type, [1.0, 0.0, 0.0, 0.0])), along)


def _next_square(builder: Any, known: list[Any], after: Any) -> list[Any]:
    """Go on to the next squares of mean accelerations.

    What is known are the last ones, the way to them from those before, and the largest that may have been met so far: a
    square at which the way turns counts with the longer of both ways added to it.
    """
    here, way, top = known
    size, none = elementwise(builder, "fabs", here.type), ir.Constant(here.type, [0.0] * here.type.count)
    following = builder.fsub(after, here)
    turn = builder.fcmp_ordered("<=", builder.fmul(way, following), none)
    longer = _larger(builder, builder.call(size, [way]), builder.call(size, [following]))
    above = builder.fadd(here, builder.select(turn, longer, none))
    return [after, following, _larger(builder, above, top)]


def _bounds(builder: Any, inside: list[Any], ends: list[Any], reach: Any) -> list[Any]:
    """Make vectors of the largest and the least that numbers may be, from those at nodes and those at both ends."""
    top, low = inside
    above, below = _larger(builder, *ends), _smaller(builder, *ends)
    span = builder.fsub(_larger(builder, top, above), _smaller(builder, low, below))
    over = builder.fmul(span, repeat(builder, reach, span.type))
    beside = builder.fmul(over, ir.Constant(span.type, [AT_ENDS] * span.type.count))
    highest = _larger(builder, builder.fadd(top, over), builder.fadd(above, beside))
    return [highest, _smaller(builder, builder.fsub(low, over), builder.fsub(below, beside))]


def _flags(builder: Any, limits: Rows, column: int, bounds: list[Any]) -> Any:
    """Make the bits of what is above its limits, and below them if the least is given, from a column of limits on."""
    flags = ir.Constant(INDEX, 0)
    for row, order, vector in zip((1, 0), (">", "<"), bounds, strict=False):
        limit = limits.load(ir.Constant(INDEX, row), ir.Constant(INDEX, column))
        bits = builder.bitcast(builder.fcmp_ordered(order, vector, limit), ir.IntType(vector.type.count))
        place = ir.Constant(INDEX, column + (1 - row) * LOWER)
        flags = builder.or_(flags, builder.shl(builder.zext(bits, INDEX), place))
    return flags


@intrinsic
def _exceeds_limits(
    typing_context: Any,
    beginning: Any,
    samples: Any,
    nodes: Any,
    end: Any,
    n: Any,
    springs: Any,
    gaps: Any,
    inverse: Any,
    reach: Any,
    limits: Any,
) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        nodes, n, kinds = values[2], values[4], signature.args
        one, zero = ir.Constant(INDEX, 1), ir.Constant(INDEX, 0)
        rows, quarters = ([Rows(context, builder, kinds[i], values[i], m) for i in (0, 1, 3)] for m in (16, 4))
        sixteen, four = rows[0].vector, quarters[0].vector
        springs = [Rows(context, builder, kinds[5], values[5], 4).load(row) for row in (zero, one)]
        shares = Rows(context, builder, kinds[6], values[6], 1)
        inverse = repeat(builder, values[7], four)

        def take_sample(which: int, row: Any) -> list[Any]:
            rates = quarters[which].load(row, n)
            force = multiply_add(builder, rates, springs[1], builder.fmul(quarters[which].load(row), springs[0]))
            return [rows[which].load(row), force, rates]

        def squares_between(rates: Any, after: Any, k: Any) -> Any:
            share = builder.fmul(repeat(builder, shares.load_one(zero, k), four), inverse)
            return _squares(builder, builder.fmul(builder.fsub(after, rates), share))

        def body(k: Any, known: list[Any]) -> list[Any]:
            *numbers, rates = take_sample(1, k)
            squares = _next_square(builder, known[4:7], squares_between(known[7], rates, k))
            wider = [
                f(builder, numbers[i], known[2 * i + j]) for i in (0, 1) for j, f in enumerate((_larger, _smaller))
            ]
            return [*wider, *squares, rates]

        first, last = take_sample(0, zero), take_sample(2, zero)
        squares = _squares(builder, builder.fmul(quarters[0].load(one, n), inverse))
        start = [
            *(ir.Constant(kind, [sign * math.inf] * kind.count) for kind in (sixteen, four) for sign in (-1, 1)),
            *(squares, ir.Constant(four, [0.0] * 4), squares, first[2]),
        ]
        *inside, rates = loop(builder, zero, builder.sub(nodes, one), 1, start, body)[1:]
        known = _next_square(builder, inside[4:], squares_between(rates, last[2], nodes))
        highest = _next_square(builder, known, known[0])[2]
        found = [_bounds(builder, inside[2 * i : 2 * i + 2], [first[i], last[i]], values[8]) for i in (0, 1)]
        flags = ir.Constant(INDEX, 0)
        for column, bounds in zip((0, 16, 20), (*found, [highest]), strict=True):
            limits = Rows(context, builder, kinds[9], values[9], bounds[0].type.count)
            flags = builder.or_(flags, _flags(builder, limits, column, bounds))
        return flags

    return types.int64(
        beginning, samples, types.int64, end, types.int64, springs, gaps, types.float64, types.float64, limits
    ), generate


if TYPE_CHECKING:

    def exceeds_limits(
        beginning: FloatArray,
        samples: FloatArray,
        nodes: int,
        end: FloatArray,
        n: int,
        springs: FloatArray,
        gaps: FloatArray,
        inverse: float,
        reach: float,
        limits: FloatArray,
    ) -> int:
        """Find out which quantities may go beyond their limits in a part of a step; bits of their columns.

        Bits from LOWER on are of those below their limits. Between samples a polynomial goes beyond all of them by less
        than some part of their range; the square of an acceleration, by less than its neighbours are below it. Without
        branches: what a step holds cannot be guessed.

        Parameters
        ----------
        beginning, samples, end
            Values and, by its fraction, derivatives at its beginning, values at its nodes and at its end: x, y, φ from
            column 0 on, rates from column n on.
        springs
            Stiffnesses, and dampings, of x, y, φ, then 0, shape (2, 4).
        gaps
            One over the distances between beginning, nodes and end, in fractions of the part.
        inverse
            One over its duration (1/s).
        reach
            This part; see :data:`vibroplat.observe.extremes.REACH`.
        limits
            Least and largest values of the 16 columns, then of three forces and of a number of no meaning, then of the
            squares of the acceleration of x and y and of y alone, shape (2, 24). These are means between samples.
        """
else:
    exceeds_limits = _exceeds_limits
