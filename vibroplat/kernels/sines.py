"""Sines and cosines of two angles at once, as a vector of the processor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from vibroplat.kernels.lanes import INDEX, PLACE, elementwise, multiply_add

#: π/2 in three parts, the first ones with so many zeros at their ends that their products with a number of quarter
#: turns are exact, and coefficients of sine and cosine on [−π/4, π/4], highest first (Moshier, Cephes, 1989).
_QUARTER = (1.57079625129699707031, 7.54978941586159635335e-8, 5.39030285815811905290e-15)
_SINE = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
_COSINE = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)


@intrinsic
def _sincos_pair(typing_context: Any, first: Any, second: Any) -> Any:
    four = ir.VectorType(ir.DoubleType(), 4)
    whole = ir.VectorType(INDEX, 4)

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        def constant(number: float) -> Any:
            return ir.Constant(four, [number] * 4)

        def polynomial(z: Any, coefficients: tuple[float, ...]) -> Any:
            total = constant(coefficients[0])
            for coefficient in coefficients[1:]:
                total = multiply_add(builder, total, z, constant(coefficient))
            return total

        x = ir.Constant(four, ir.Undefined)
        for i in range(4):
            x = builder.insert_element(x, values[i // 2], ir.Constant(PLACE, i))
        rint = elementwise(builder, "rint", four)
        quarters = builder.call(rint, [builder.fmul(x, constant(0.63661977236758134308))])
        r = x
        for part in _QUARTER:
            r = multiply_add(builder, quarters, constant(-part), r)
        z = builder.fmul(r, r)
        sine = multiply_add(builder, builder.fmul(r, z), polynomial(z, _SINE), r)
        flat = multiply_add(builder, z, constant(-0.5), constant(1.0))
        cosine = multiply_add(builder, builder.fmul(z, z), polynomial(z, _COSINE), flat)
        # the cosine is the sine a quarter turn later
        turn = builder.add(builder.fptosi(quarters, whole), ir.Constant(whole, [0, 1, 0, 1]))
        none = ir.Constant(whole, [0] * 4)
        odd = builder.icmp_signed("!=", builder.and_(turn, ir.Constant(whole, [1] * 4)), none)
        below = builder.icmp_signed("!=", builder.and_(turn, ir.Constant(whole, [2] * 4)), none)
        rotated = builder.select(odd, cosine, sine)
        rotated = builder.select(below, builder.fmul(rotated, constant(-1.0)), rotated)
        numbers = [builder.extract_element(rotated, ir.Constant(PLACE, i)) for i in range(4)]
        return context.make_tuple(builder, signature.return_type, numbers)

    return types.UniTuple(types.float64, 4)(types.float64, types.float64), generate


if TYPE_CHECKING:

    def sincos_pair(first: float, second: float) -> tuple[float, float, float, float]:
        """Sine and cosine of an angle, then of another, in the time of one of them; to round-off below 1e5 rad."""
else:
    sincos_pair = _sincos_pair
