"""Kernels that Python calls: they read records where these are, and tell types of arguments apart."""

from typing import Any, NamedTuple, cast

import numpy as np
import pytest
from numba import types
from numba.core import boxing
from numba.core.pythonapi import _unboxers

from vibroplat.kernels.compiled import (
    NOWHERE,
    OTHER_TYPES,
    Address,
    address_of,
    call_kernel,
    compiled,
    quick_call,
)
from vibroplat.kernels.target import TARGET

KIND = np.dtype([("number", float), ("others", float, 3), ("count", np.int64)], align=True)


class Held(NamedTuple):
    record: Any
    numbers: Any


@compiled
def raise_count(held: Held) -> float:
    """Change the record, and sum up what there is."""
    held.record.count += 1
    return held.record.number + held.record.others[2] + held.numbers[0]


@compiled
def third(numbers: Any) -> Any:
    return numbers[0] / 3


def test_records_are_read_and_changed_in_place() -> None:
    many = np.zeros(4, KIND)
    many["number"], many["others"][:, 2] = [1.0, 2.0, 3.0, 4.0], 10.0
    sums = [raise_count(Held(record, np.array([100.0]))) for record in (many[0], many[3], many.view(np.recarray)[2])]
    assert sums == [111.0, 114.0, 113.0]
    assert many["count"].tolist() == [1, 0, 1, 1]


def test_kernels_of_others_read_records_in_the_way_of_numba() -> None:
    assert _unboxers.functions[types.Record] is boxing.unbox_record


@compiled
def raise_first(numbers: Any) -> None:
    """Change an array."""
    numbers[0] += 1


@compiled
def call_there(place: Address, numbers: Any) -> None:
    """Call what is there."""
    call_kernel(place, (numbers,))


def test_a_caller_gets_the_kernel_for_the_types_of_each_call() -> None:
    first = quick_call(third)
    assert [first(np.array([x])) for x in (3.0, 6.0)] == [1.0, 2.0]
    assert [first(np.array([x])) for x in (3.0 + 3j, 6.0, 9)] == [1.0 + 1j, 2.0, 3.0]
    assert first(np.array([[3.0, 6.0]])[:, ::2][0]) == first((3.0,)) == 1.0  # another layout; no array


def test_an_address_is_that_of_the_kernel_for_these_types_whatever_was_compiled_before() -> None:
    for numbers in (np.array([1.0]), np.array([1j]), np.array([1])):
        raise_first(numbers)
        call_there(address_of(raise_first, numbers), numbers)
        assert numbers[0] in (3.0, 2.0 + 1j)


def test_a_call_by_address_with_other_types_raises_and_calls_nothing() -> None:
    numbers = np.array([1j])
    for place in (address_of(raise_first, np.array([1.0])), NOWHERE):
        with pytest.raises(TypeError, match=OTHER_TYPES):
            call_there(place, numbers)
    assert numbers[0] == 1j


def test_what_kernels_call_has_no_machine_code_when_it_is_loaded() -> None:
    """A caller would call that instead of its own, which is optimized: three times slower."""
    inside, argument = cast("Any", third)._inside, types.Array(types.complex64, 1, "C")
    inside.compile((argument,))
    overload = inside.overloads[(argument,)]
    codegen = TARGET.target_context.codegen()
    loaded = codegen.unserialize_library(overload.library.serialize_using_object_code())
    name = overload.fndesc.llvm_func_name
    assert name in str(loaded._final_module)
    assert not codegen._engine.is_symbol_defined(name)
