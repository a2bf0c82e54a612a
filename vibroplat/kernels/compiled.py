"""How the kernels are compiled: without the interpreter's lock, kept on disk between processes.

Numba makes machine code of every function that it compiles, and with it what turns Python's objects into arguments,
which for tuples of arrays is more than most kernels. Kernels that call a kernel need neither: LLVM links what it is
before it becomes machine code into each of them and optimizes it there. Without both a first run waits a third less.

C functions are called by addresses that come as arguments: that leaves compiled code free of them, so that it can be
kept on disk, and what is called that way is compiled once, not into each caller. Large kernels are called so as well,
and functions of Python where nothing compiled will do.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Generator, Iterable
from functools import cached_property
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from numba.core.types import unliteral
from numba.extending import intrinsic

from vibroplat.errors import VibroplatError
from vibroplat.kernels.cache import cache_of
from vibroplat.kernels.on_demand import as_written
from vibroplat.kernels.target import TARGET, WIDE_TARGET, InsideLibrary
from vibroplat.system.interrupts import handlers_put_off

if getattr(numba.config, "DISABLE_JIT", 0):
    raise VibroplatError(
        "NUMBA_DISABLE_JIT is set, but SUNDIALS calls the kernels by their addresses, which only compiled ones have; "
        "unset it"
    )

FloatArray = npt.NDArray[np.float64]

P = ParamSpec("P")
T = TypeVar("T")


#: Division by zero gives inf or nan, as in C, instead of an exception; no kernel is called through a C wrapper.
OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class _Dispatcher(CPUDispatcher):
    """Numba's, with the target and the cache of this package."""

    targetdescr = TARGET

    def enable_caching(self) -> None:
        """Keep what is compiled."""
        self._cache = cache_of(self.py_func)

    def compile(self, sig: Any) -> Any:
        """Compile for one signature, or load what was compiled.

        A time limit of a program ends it only when the kernel is there: an exception would be lost where LLVM calls
        Python, and numba would not find the attributes any more that it was about to register.
        """
        with handlers_put_off():
            return super().compile(sig)


class _Callback(CFunc):
    """A C function, with the same. It is compiled when its address is asked for."""

    _targetdescr = TARGET
    _wrapper_address: int | None

    def enable_caching(self) -> None:
        """Keep what is compiled."""
        self._cache = cache_of(self.__wrapped__)

    @property
    def address(self) -> int:
        """Where its machine code is."""
        if self._wrapper_address is None:
            with handlers_put_off():
                self.compile()
        assert self._wrapper_address is not None
        return self._wrapper_address


class Kernel(_Dispatcher):
    """A kernel that Python and other kernels call, each what is compiled for it; most have only one kind of caller."""

    def __init__(self, function: Callable[..., Any], *, inline: bool = False, fused: bool = False) -> None:
        # said in any case: numba else compiles what a fused kernel calls fused as well, if nobody has called it before
        self._options = OPTIONS | {"fastmath": {"contract"} if fused else False}
        super().__init__(function, targetoptions=self._options)
        self._inline = inline
        self.overload_of: dict[Any, _Overload] = {}  # by the kinds of arguments, for calls from Python and by address
        self.enable_caching()

    def compile(self, sig: Any) -> Any:
        """Compile for calls from Python."""
        if hasattr(self.py_func, "write"):
            raise TypeError(f"{self.py_func.__qualname__} is written for kernels alone")
        return super().compile(sig)

    @cached_property
    def _inside(self) -> Any:
        """The kernel as others call it; where all are on disk, none is needed."""
        function = as_written(self.py_func)
        twin = FunctionType(function.__code__, function.__globals__, closure=function.__closure__)
        # numba keeps a function by its name
        twin.__module__, twin.__qualname__ = function.__module__, f"{self.py_func.__qualname__}.inside"
        options = self._options | {"no_cpython_wrapper": True, "forceinline": self._inline}
        dispatcher = _Dispatcher(twin, targetoptions=options, pipeline_class=_InsideCompiler)
        dispatcher.enable_caching()
        return dispatcher

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Say how other kernels call it, and compile it for them, for all numbers of a type at once.

        What is known of a number, as of a degree, LLVM sees where it puts the kernel into its caller.
        """
        named = {name: unliteral(kind) for name, kind in kws.items()}
        return self._inside.get_call_template(tuple(unliteral(kind) for kind in args), named)

    def get_overload(self, sig: Any) -> Any:
        """Return what other kernels call."""
        return self._inside.get_overload(sig)


class _InsideCompiler(Compiler):
    """Numba's compiler, with a library of ours."""

    def __init__(self, typing_context: Any, context: Any, library: Any, *rest: Any) -> None:
        library = library or InsideLibrary(context.codegen(), "kernel")  # type: ignore[no-untyped-call]
        super().__init__(typing_context, context, library, *rest)  # type: ignore[no-untyped-call]


class _WideKernel(Kernel):
    """A kernel that Python alone calls, for the widest vectors of this machine."""

    targetdescr = WIDE_TARGET


def wide(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel that carries several motions."""
    return cast("Callable[P, T]", _WideKernel(function))


def compiled(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel; division by zero gives inf or nan, as in C, instead of an exception."""
    return cast("Callable[P, T]", Kernel(function))


def fused(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel whose products may be added without being rounded first, which shortens long chains of sums."""
    return cast("Callable[P, T]", Kernel(function, fused=True))


def inlined(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel into its callers.

    LLVM does so. Numba's own way, by source, copies the whole caller for each call: it took a fifth of the first run.
    """
    return cast("Callable[P, T]", Kernel(function, inline=True))


def fused_inline(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a kernel as both :func:`fused` and :func:`inlined` do."""
    return cast("Callable[P, T]", Kernel(function, inline=True, fused=True))


def _kind(argument: Any) -> Any:
    """Return what numba's type of an argument depends on, which takes a tenth of the time of the type itself."""
    if isinstance(argument, tuple):
        return (type(argument), *map(_kind, argument))
    if isinstance(argument, np.ndarray):
        return (type(argument), argument.dtype, argument.ndim, argument.flags.num)
    if isinstance(argument, np.void):
        return (type(argument), argument.dtype)
    return type(argument)


class _Overload:
    """What a kernel is compiled to for one list of types."""

    def __init__(self, result: Any) -> None:
        self._result = result
        self.entry_point = result.entry_point

    @cached_property
    def address(self) -> Address:
        """Where it is, for compiled callers."""
        place = self._result.library.get_pointer_to_function(self._result.fndesc.llvm_func_name)
        return Address(int(place), _key(self._result.signature.args))


def _overload(kernel: Any, arguments: tuple[Any, ...]) -> _Overload:
    """Return what a kernel is compiled to for arguments of exactly these types; compile it if it is not yet."""
    key = tuple(map(_kind, arguments))
    found: _Overload | None = kernel.overload_of.get(key)
    if found is None:
        kinds = tuple(numba.typeof(argument) for argument in arguments)
        kernel.compile(kinds)
        found = kernel.overload_of[key] = _Overload(kernel.overloads[kinds])
    return found


def quick_call(kernel: Callable[P, T]) -> Callable[P, T]:
    """Return a kernel for one caller, whose arguments are mostly the same objects from call to call.

    Only arguments that have changed have their types looked at. Numba looks at each array of a tuple at each call,
    which for some tuples takes 20 µs and more.
    """
    last_call: tuple[tuple[Any, ...], Any] = (), None

    def call(*arguments: Any) -> Any:
        nonlocal last_call
        known, entry_point = last_call  # another thread may change it
        if len(arguments) != len(known) or any(map(_is_other_kind, arguments, known)):
            entry_point = _overload(kernel, arguments).entry_point
        last_call = arguments, entry_point
        return entry_point(*arguments)

    return cast("Callable[P, T]", call)


def _is_other_kind(argument: Any, known: Any) -> bool:
    """Whether an argument has another type than a known one; parts that are the same objects are not looked at."""
    if argument is known:
        return False
    if type(argument) is not type(known):
        return True
    if isinstance(argument, tuple):
        return len(argument) != len(known) or any(map(_is_other_kind, argument, known))
    return bool(_kind(argument) != _kind(known))


class Address(NamedTuple):
    """Where a kernel is, and the number of the types that it is compiled for, which :func:`call_kernel` compares."""

    address: int
    key: int


#: Why :func:`call_kernel` raises a TypeError.
OTHER_TYPES = "a kernel was called with other types than it is compiled for"
#: Where no kernel is.
NOWHERE = Address(0, 0)


class Callee(NamedTuple):
    """A kernel for compiled callers: where it is, and those of its arguments that are always the same."""

    place: Address
    arguments: tuple[Any, ...] = ()


def address_of(kernel: Callable[..., None], *arguments: Any) -> Address:
    """Return where a kernel is, for :func:`call_kernel` with arguments of the types of these."""
    return _overload(kernel, arguments).address


def _key(kinds: Iterable[Any]) -> int:
    """Return a number of some types, which differs from that of others."""
    names = str([str(unliteral(kind)) for kind in kinds])
    return int.from_bytes(hashlib.blake2b(names.encode(), digest_size=7).digest())


class PythonFunction:
    """A function of Python that compiled code calls with a number, :func:`call_int`; 0 means that it has raised.

    The caller of the compiled code calls :meth:`check` afterwards, which raises that again.
    """

    def __init__(self, function: Callable[[int], None]) -> None:
        self._error: BaseException | None = None
        answers = self._answers(function)
        next(answers)
        self._kept = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int)(answers.send)
        self.address = ctypes.cast(self._kept, ctypes.c_void_p).value or 0

    def _answers(self, function: Callable[[int], None]) -> Generator[int, int, None]:
        """Call the function with each number that is sent, and yield whether it has returned.

        C would lose an exception. Handlers of signals that came meanwhile run when Python goes on, and may raise: in a
        generator that is where it waits, in a function before its first line.
        """
        answer = 1
        while True:
            try:
                while True:
                    number = yield answer
                    function(number)
                    answer = 1
            except GeneratorExit:
                return
            except BaseException as error:
                self._error, answer = error, 0

    def check(self) -> None:
        """Raise what the function has raised."""
        if self._error is not None:
            error, self._error = self._error, None
            raise error


def callback(signature: str) -> Callable[[Callable[P, T]], Any]:
    """Compile a kernel to a C function of a fixed signature, kept on disk; its ``address`` is callable from C."""

    def compiled_to(function: Callable[P, T]) -> Any:
        made = _Callback(function, normalize_signature(signature), {}, {"error_model": "numpy"})
        made.enable_caching()
        return made

    return compiled_to


@compiled
def copy(source: FloatArray, target: FloatArray) -> None:
    """Copy numbers; a loop compiles far faster than an assignment of slices, and runs alike."""
    for i in range(source.size):
        target[i] = source[i]


def _caller(returned: Any) -> Any:
    """Make the intrinsic that calls functions of one return type."""

    def call(typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            passed = cgutils.unpack_tuple(builder, values[1])
            function = ir.FunctionType(context.get_value_type(returned), [value.type for value in passed])
            return builder.call(builder.inttoptr(values[0], function.as_pointer()), passed)

        return returned(address, arguments), generate

    return intrinsic(call)


@intrinsic
def _call_kernel(typing_context: Any, place: Any, arguments: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        convention, kinds = context.call_conv, tuple(signature.args[1])
        function = convention.get_function_type(types.none, kinds).as_pointer()
        address, key = cgutils.unpack_tuple(builder, values[0])
        with cgutils.if_unlikely(builder, builder.icmp_unsigned("!=", key, key.type(_key(kinds)))):
            convention.return_user_exc(builder, TypeError, (OTHER_TYPES,))
        passed = cgutils.unpack_tuple(builder, values[1])
        status, _ = convention.call_function(builder, builder.inttoptr(address, function), types.none, kinds, passed)
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.none(place, arguments), generate


def _pointer_to(kind: Any) -> Any:
    """Make the intrinsic that turns addresses into pointers of one type."""

    def point(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return kind(address), generate

    return intrinsic(point)


def _disown(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Take the owner off an array, or off each array of a tuple."""
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for i, part in enumerate(parts):
            inside = _disown(context, builder, part, builder.extract_value(value, i))
            value = builder.insert_value(value, inside, i)
        return value
    if not isinstance(kind, types.Array):
        return value
    view = context.make_array(kind)(context, builder, value)
    view.meminfo = cgutils.get_null_value(view.meminfo.type)
    view.parent = cgutils.get_null_value(view.parent.type)
    return view._getvalue()


@intrinsic
def _borrow(typing_context: Any, owned: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _disown(context, builder, owned, values[0])

    return owned(owned), generate


if TYPE_CHECKING:

    def call_int(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns an int; pointers are passed as integers."""

    def call_address(address: int, arguments: tuple[Any, ...]) -> int:
        """Call a C function that returns a pointer."""

    def call_kernel(place: Address, arguments: tuple[Any, ...]) -> None:
        """Call a kernel that returns nothing, by :func:`address_of`; TypeError if its arguments had other types."""

    def pointer(address: int) -> Any:
        """Turn an address into a pointer to doubles, for ``numba.carray``."""

    def void_pointer(address: int) -> Any:
        """Turn an address into a pointer without type, for ``numba.carray`` of records."""

    def borrow(owned: T) -> T:
        """View an array, or all arrays of a tuple, without owning them; the caller keeps them alive.

        Every access to an array in a tuple counts a reference, with an atomic instruction, which took a
        quarter of the time of a run; what has no owner is not counted.
        """
else:
    call_int = _caller(types.int32)
    call_address = _caller(types.intp)
    call_kernel = _call_kernel
    pointer = _pointer_to(types.CPointer(types.float64))
    void_pointer = _pointer_to(types.voidptr)
    borrow = _borrow
