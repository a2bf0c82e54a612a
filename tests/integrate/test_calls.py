"""Kernels that Python calls: they read records where these are, and tell types of arguments apart."""

from typing import Any, NamedTuple, cast

import numpy as np
from numba import types

from vibroplat.kernels.compiled import compiled, same_types
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


def test_a_caller_with_arguments_of_its_own_type_gets_the_kernel_for_it() -> None:
    first = same_types(third)
    assert [first(np.array([x])) for x in (3.0, 6.0)] == [1.0, 2.0]
    other = same_types(third)  # there are two by then, and none is taken for the other
    assert [other(np.array([x + 3j])) for x in (3.0, 6.0)] == [1.0 + 1j, 2.0 + 1j]
    assert first(np.array([9.0])) == 3.0


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
