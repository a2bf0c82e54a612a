"""Pairs: one number for each exciter, side by side in a vector of the processor.

A pair computes as a number does: a formula that is written for numbers takes pairs as well, and both exciters then
cost what one does. LLVM does not find that by itself in long chains of scalars.
"""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any, TypeVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

T = TypeVar("T")

_VECTOR = ir.VectorType(ir.DoubleType(), 2)
_PLACES = ir.Constant(ir.IntType(32), 0), ir.Constant(ir.IntType(32), 1)


class PairType(types.Type):
    """Numba's type of pairs."""

    def __init__(self) -> None:
        super().__init__("pair")


#: The type of all pairs.
PAIR = PairType()


@register_model(PairType)
class _PairModel(models.PrimitiveModel):
    """A pair is a vector of LLVM."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def pair_of(builder: Any, first: Any, second: Any) -> Any:
    """Make a pair of two numbers of LLVM."""
    whole = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), first, _PLACES[0])
    return builder.insert_element(whole, second, _PLACES[1])


def _computes(function: Any, instruction: str) -> None:
    """Let two pairs, or a pair and a number, be computed with."""

    @infer_global(function)
    class _Template(AbstractTemplate):
        def generic(self, arguments: Any, named: Any) -> Any:
            if PAIR in arguments and all(kind in (PAIR, types.float64) for kind in arguments):
                return signature(PAIR, *arguments)
            return None

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        whole = [v if kind == PAIR else pair_of(builder, v, v) for kind, v in zip(sig.args, values, strict=True)]
        return getattr(builder, instruction)(*whole)

    for kinds in ((PAIR, PAIR), (PAIR, types.float64), (types.float64, PAIR)):
        lower_builtin(function, *kinds)(generate)


_computes(operator.add, "fadd")
_computes(operator.sub, "fsub")
_computes(operator.mul, "fmul")


def _kind_of_pairs(kind: Any) -> Any:
    """Return the type of a number, or of a tuple, with a pair for each number."""
    if isinstance(kind, types.BaseNamedTuple):
        parts: Any = kind
        return types.BaseTuple.from_types([_kind_of_pairs(part) for part in parts], parts.instance_class)
    return PAIR


@intrinsic
def _pack_pair(typing_context: Any, first: Any, second: Any) -> Any:
    def joined(context: Any, builder: Any, kind: Any, a: Any, b: Any) -> Any:
        if kind == PAIR:
            return pair_of(builder, a, b)
        parts = [cgutils.unpack_tuple(builder, whole) for whole in (a, b)]
        return context.make_tuple(
            builder, kind, [joined(context, builder, *each) for each in zip(kind, *parts, strict=True)]
        )

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return joined(context, builder, sig.return_type, *values)

    return _kind_of_pairs(first)(first, second), generate


@intrinsic
def _unpack_pair(typing_context: Any, both: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return context.make_tuple(builder, sig.return_type, [builder.extract_element(values[0], i) for i in _PLACES])

    return types.UniTuple(types.float64, 2)(both), generate


if TYPE_CHECKING:
    #: One number for each exciter.
    Pair = float

    def pack_pair(first: T, second: T) -> T:
        """Join two numbers, or two tuples of them number by number, to pairs."""

    def unpack_pair(both: Pair) -> tuple[float, float]:
        """Take a pair apart."""
else:
    Pair = Any
    pack_pair, unpack_pair = _pack_pair, _unpack_pair
