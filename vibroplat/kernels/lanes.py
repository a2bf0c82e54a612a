"""Numbers of several motions side by side, for numba: a type ``Lanes(n)``, a vector of n numbers of the processor.

A kernel that is written for numbers takes lanes as well: numba's own typing is the template, and one source serves one
motion (a plain number), four and eight. A record whose fields have a last axis of n numbers is read and written by
lanes once :func:`as_lanes` has changed its type; code for one lane reads the same memory as arrays.

Where a formula holds for both exciters, theirs are side by side as well (:func:`join`, :func:`part`): twice as many.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from vibroplat.kernels.compiled import FloatArray, fused_inline, inlined
from vibroplat.kernels.lines import LINE, Rows, in_lines

_PLACE, _INDEX, _BIT, _DOUBLE = ir.IntType(32), ir.IntType(64), ir.IntType(1), ir.DoubleType()


class LanesType(types.Type):
    """Numba's type of n numbers, or of n truth values."""

    def __init__(self, count: int, number: Any = types.float64) -> None:
        self.count, self.number = count, number
        #: Of arrays' elements: numba asks for it.
        self.bitwidth = 64 * count
        super().__init__(f"lanes({count}, {number})")


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        number = _DOUBLE if kind.number == types.float64 else _BIT
        super().__init__(manager, kind, ir.VectorType(number, kind.count))  # type: ignore[no-untyped-call]


def lanes_of(count: int, number: Any = types.float64) -> Any:
    """Return the type of so many numbers; of one it is that number's own."""
    return number if count == 1 else LanesType(count, number)


def _count(kind: Any) -> int:
    return kind.count if isinstance(kind, LanesType) else 1


def _number(kind: Any) -> Any:
    return kind.number if isinstance(kind, LanesType) else kind


def _shuffle(builder: Any, value: Any, other: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(value, other, ir.Constant(ir.VectorType(_PLACE, len(places)), places))


def _spread(builder: Any, value: Any, count: int) -> Any:
    """Repeat a number, or fewer lanes, in all of so many lanes."""
    have = value.type.count if isinstance(value.type, ir.VectorType) else 1
    if have == count:
        return value
    value = _as_vector(builder, value)
    return _shuffle(builder, value, value, [i % have for i in range(count)])


def _as_vector(builder: Any, value: Any) -> Any:
    if isinstance(value.type, ir.VectorType):
        return value
    single = ir.Constant(ir.VectorType(value.type, 1), ir.Undefined)
    return builder.insert_element(single, value, ir.Constant(_PLACE, 0))


# -- operators, and functions of one to three arguments --------------------------------------------------------

Build = Callable[..., Any]


def _define(operation: Any, build: Build, arity: int, given: Any, result: Any) -> None:
    """Let an operator of Python take lanes, or lanes and numbers."""

    @infer_global(operation)
    class _Template(AbstractTemplate):
        def generic(self, arguments: Any, named: Any) -> Any:
            count = max(map(_count, arguments))
            if count == 1 or len(arguments) != arity or any(_number(kind) != given for kind in arguments):
                return None
            return signature(lanes_of(count, result), *arguments)

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        count = max(map(_count, sig.args))
        return build(builder, *[_spread(builder, value, count) for value in values])

    mixtures = [(LanesType,)] if arity == 1 else [(LanesType, LanesType), (LanesType, given), (given, LanesType)]
    for kinds in mixtures:
        lower_builtin(operation, *kinds)(generate)


def _instruction(name: str) -> Build:
    return lambda builder, *values: getattr(builder, name)(*values)


def _comparison(sign: str) -> Build:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


for _name, _called in {"add": "fadd", "sub": "fsub", "mul": "fmul", "truediv": "fdiv"}.items():
    for _operation in (getattr(operator, _name), getattr(operator, f"i{_name}")):
        _define(_operation, _instruction(_called), 2, types.float64, types.float64)
for _name, _sign in {"gt": ">", "ge": ">=", "lt": "<", "le": "<=", "eq": "=="}.items():
    _define(getattr(operator, _name), _comparison(_sign), 2, types.float64, types.boolean)
for _name in ("and_", "or_"):
    _define(getattr(operator, _name), _instruction(_name), 2, types.boolean, types.boolean)
_define(operator.neg, _instruction("fneg"), 1, types.float64, types.float64)


def _typed(build: Build, *kinds: Any) -> Any:
    """Type and build a function of numbers and lanes in any mixture."""
    count = max(map(_count, kinds))

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return build(builder, *[_spread(builder, value, count) for value in values])

    return signature(lanes_of(count), *kinds), generate


def _of_one(build: Build) -> Any:
    return intrinsic(lambda typing_context, a: _typed(build, a))


def _of_two(build: Build) -> Any:
    return intrinsic(lambda typing_context, a, b: _typed(build, a, b))


def _call(name: str) -> Build:
    def build(builder: Any, value: Any) -> Any:
        kind = f"v{value.type.count}f64" if isinstance(value.type, ir.VectorType) else "f64"
        function = ir.FunctionType(value.type, [value.type])
        return builder.call(builder.module.declare_intrinsic(f"llvm.{name}.{kind}", (), function), [value])

    return build


def _extreme(sign: str) -> Build:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, a, b), a, b)


def _like(value: Any, number: float) -> Any:
    return ir.Constant(value, [number] * value.count if isinstance(value, ir.VectorType) else number)


def _whole(kind: Any) -> Any:
    return ir.VectorType(_INDEX, kind.count) if isinstance(kind, ir.VectorType) else _INDEX


def _exponent(builder: Any, value: Any) -> Any:
    whole = _whole(value.type)
    bits = builder.lshr(builder.bitcast(value, whole), _like(whole, 52))
    return builder.sitofp(builder.sub(bits, _like(whole, 1023)), value.type)


def _mantissa(builder: Any, value: Any) -> Any:
    whole = _whole(value.type)
    bits = builder.and_(builder.bitcast(value, whole), _like(whole, (1 << 52) - 1))
    return builder.bitcast(builder.or_(bits, _like(whole, 1023 << 52)), value.type)


def _power(builder: Any, value: Any) -> Any:
    whole = _whole(value.type)
    bits = builder.add(builder.fptosi(value, whole), _like(whole, 1023))
    return builder.bitcast(builder.shl(bits, _like(whole, 52)), value.type)


@intrinsic
def _bits(typing_context: Any, mask: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return builder.zext(builder.bitcast(values[0], ir.IntType(_count(mask))), _INDEX)

    return types.int64(mask), generate


@inlined
def _some(mask: Any) -> bool:
    return _bits(mask) != 0  # type: ignore[call-arg]


def _joined(builder: Any, context: Any, kind: Any, first: Any, second: Any) -> Any:
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        each = [
            _joined(builder, context, part, builder.extract_value(first, i), builder.extract_value(second, i))
            for i, part in enumerate(parts)
        ]
        return context.make_tuple(builder, kind, each)
    half = kind.count // 2
    first, second = (_as_vector(builder, _spread(builder, value, half)) for value in (first, second))
    return _shuffle(builder, first, second, [*range(kind.count)])


def _pair_kind(first: Any, second: Any) -> Any:
    if isinstance(first, types.BaseTuple):
        parts: Any = first
        kinds = [_pair_kind(*both) for both in zip(parts, second, strict=True)]
        return types.BaseTuple.from_types(kinds, getattr(first, "instance_class", None))
    return LanesType(2 * max(_count(first), _count(second)))


@intrinsic
def _join(typing_context: Any, first: Any, second: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return _joined(builder, context, sig.return_type, *values)

    return _pair_kind(first, second)(first, second), generate


@intrinsic
def _part(typing_context: Any, both: Any) -> Any:
    half = both.count // 2

    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        halves = [[*range(i * half, (i + 1) * half)] for i in (0, 1)]
        if half == 1:
            parts = [builder.extract_element(values[0], ir.Constant(_PLACE, i)) for i in (0, 1)]
        else:
            parts = [_shuffle(builder, values[0], values[0], places) for places in halves]
        return context.make_tuple(builder, sig.return_type, parts)

    return types.UniTuple(lanes_of(half), 2)(both), generate


@intrinsic
def _at(typing_context: Any, place: Any) -> Any:
    return types.uintp(types.intp), lambda context, builder, sig, values: values[0]


@intrinsic
def _align_stack(typing_context: Any, like: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        if _count(like) > 1:
            # without another attribute llvmlite does not write this one
            builder.function.attributes.add("nounwind")
            builder.function.attributes.alignstack = LINE
        return context.get_dummy_value()

    return types.void(like), generate


def _load(count: int) -> Any:
    @intrinsic
    def load(typing_context: Any, array: Any, row: Any, column: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            return Rows(context, builder, array, values[0], count).load(*values[1:])

        return lanes_of(count)(array, types.int64, types.int64), generate

    return load


@intrinsic
def _store(typing_context: Any, numbers: Any, array: Any, row: Any, column: Any) -> Any:
    def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        Rows(context, builder, array, values[1], numbers.count).store(values[2], values[0], values[3])
        return context.get_dummy_value()

    return types.void(numbers, array, types.int64, types.int64), generate


@intrinsic
def _select(typing_context: Any, mask: Any, a: Any, b: Any) -> Any:
    return _typed(lambda builder, *values: builder.select(*values), mask, a, b)


# -- records ---------------------------------------------------------------------------------------------------


class _LanesRecord(types.Record):
    """A record of lanes; numpy does not know what is in it."""

    @property
    def dtype(self) -> Any:
        return np.dtype((np.void, self.size))


register_model(_LanesRecord)(models.RecordModel)


def _field(kind: Any) -> Any:
    """Return the type of a field whose last axis is one value."""
    if not isinstance(kind, types.NestedArray):
        return kind
    if kind.ndim == 1:
        return lanes_of(kind.shape[-1])
    found = types.NestedArray(lanes_of(kind.shape[-1]), kind.shape[:-1])
    found.aligned = False  # any address will do
    return found


@intrinsic
def _as_lanes(typing_context: Any, record: Any) -> Any:
    fields: Any = [
        (name, {"type": _field(field.type), "offset": field.offset, "alignment": None, "title": None})
        for name, field in record.fields.items()
    ]
    return _LanesRecord(fields, record.size, False)(record), lambda context, builder, sig, values: values[0]


def lanes_record(
    width: int, fields: Mapping[str, tuple[int, ...]], views: Mapping[str, tuple[str, tuple[int, ...]]]
) -> Any:
    """Make a record of zeros for :func:`as_lanes`, in lines of the processor's cache.

    The last number of a field's shape says how many values a motion has side by side. A view is another name, and
    another shape, for the memory that begins with a field.
    """
    kind = _lanes_kind(width, tuple(fields.items()), tuple(views.items()))
    return in_lines((1,), kind)[0]


@cache
def _lanes_kind(width: int, fields: Sequence[Any], views: Sequence[Any]) -> np.dtype[np.void]:
    """Return the type of such a record."""
    whole = np.dtype([(name, float, (*shape[:-1], shape[-1] * width)) for name, shape in fields])
    parts: dict[str, Any] = {name: field[:2] for name, field in (whole.fields or {}).items()}
    for name, (below, shape) in views:
        parts[name] = np.dtype((float, (*shape[:-1], shape[-1] * width))), parts[below][1]
    formats, offsets = zip(*parts.values(), strict=True)
    return np.dtype({"names": [*parts], "formats": formats, "offsets": offsets, "itemsize": whole.itemsize})


if TYPE_CHECKING:
    #: A number in each lane.
    Lanes = float
    #: A number of each exciter in each lane: twice as many.
    Pair = float

    def zero(like: Any) -> Any:
        """Return 0 in as many lanes as something has."""

    def size(x: Any) -> Any:
        """Return the absolute value."""

    def nearest(x: Any) -> Any:
        """Round to the nearest whole number."""

    def exponent(x: Any) -> Any:
        """Return the exponent of 2."""

    def mantissa(x: Any) -> Any:
        """Return x over the power of 2 of its exponent."""

    def power(x: Any) -> Any:
        """Return 2 to the power of a whole number."""

    def greater(a: Any, b: Any) -> Any:
        """Return the greater of two numbers; b where either is none."""

    def lesser(a: Any, b: Any) -> Any:
        """Return the lesser of two numbers; b where either is none."""

    def select(mask: Any, a: Any, b: Any) -> Any:
        """Return a where the mask holds, otherwise b."""

    def bits(mask: Any) -> int:
        """Return the bits of the lanes in which a mask holds."""

    def some(mask: Any) -> bool:
        """Whether a mask holds in any lane."""

    def load_2(array: FloatArray, row: int, column: int) -> Any:
        """Load two numbers of a row of a contiguous array as lanes, from a column on; one of a line has any row."""

    def load_4(array: FloatArray, row: int, column: int) -> Any:
        """Load four."""

    def load_8(array: FloatArray, row: int, column: int) -> Any:
        """Load eight."""

    def load_16(array: FloatArray, row: int, column: int) -> Any:
        """Load sixteen."""

    def store(numbers: Any, array: FloatArray, row: int, column: int) -> None:
        """Store lanes into a row of a contiguous array, from a column on."""

    def join(first: Any, second: Any) -> Any:
        """Put two values, or two tuples value by value, side by side."""

    def part(both: Any) -> tuple[Any, Any]:
        """Take two values that are side by side apart."""

    def at(place: int) -> Any:
        """Return a place that is not negative: numba need not look whether it counts from the end."""

    def align_stack(like: Any) -> None:
        """Begin this function's stack with a line of the cache: otherwise LLVM spills vectors across lines."""

    def as_lanes(record: Any) -> Any:
        """View a record: the last axis of each of its fields is one value."""
else:
    Lanes = Pair = Any
    zero = _of_one(lambda builder, value: _like(value.type, 0.0))
    size, nearest = _of_one(_call("fabs")), _of_one(_call("rint"))
    exponent, mantissa, power = _of_one(_exponent), _of_one(_mantissa), _of_one(_power)
    greater, lesser = _of_two(_extreme(">")), _of_two(_extreme("<"))
    select, bits, some, join, part = _select, _bits, _some, _join, _part
    load_2, load_4, load_8, load_16, store = _load(2), _load(4), _load(8), _load(16), _store
    at, align_stack, as_lanes = _at, _align_stack, _as_lanes


# -- functions of lanes ----------------------------------------------------------------------------------------


@inlined
def total(both: Any) -> Any:
    """Add up two values that are side by side."""
    first, second = part(both)
    return first + second


@inlined
def four(first: Lanes, second: Lanes, third: Lanes, fourth: Lanes) -> Any:
    """Put four values side by side."""
    return join(join(first, second), join(third, fourth))


@fused_inline
def log2(x: Lanes) -> Lanes:
    """Logarithm to the base 2 of a positive number, to nine digits."""
    m, e = mantissa(x), exponent(x)
    low = m > 1.41421356237
    m, e = select(low, 0.5 * m, m), select(low, e + 1.0, e)
    z = (m - 1.0) / (m + 1.0)
    z2 = z * z
    series = 1.0 + z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 11.0)))))
    return e + 2.88539008177792681 * z * series


@fused_inline
def exp2(x: Lanes) -> Lanes:
    """Power of 2, to nine digits."""
    whole = nearest(x)
    f = (x - whole) * 0.693147180559945309
    rest = 1.0 / 120.0 + f * (1.0 / 720.0 + f * (1.0 / 5040.0 + f * (1.0 / 40320.0)))
    return (1.0 + f * (1.0 + f * (1.0 / 2.0 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * rest))))) * power(whole)
