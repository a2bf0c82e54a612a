"""What a command needs around it before it begins: streams to write to, memory to load libraries into."""

from __future__ import annotations

import errno
import os
import sys

from vibroplat.errors import VibroplatError

#: Address space (bytes) below which libraries cannot be loaded: with one thread of OpenBLAS a run and its figures need
#: 1.0 GB, with engine sundae 1.05 GB. With less it waits for memory for ever or ends the process, without a word.
LEAST_ADDRESSES = 1_200_000_000
#: The same where kernels have to be compiled: 1.33 GB are enough, with 1.13 GB Python runs out of memory.
COMPILING = 1_450_000_000

#: How the loader and libraries describe a lack of memory.
_LACKS = ("failed to map segment", "cannot allocate", "out of memory")


class MemoryShortError(VibroplatError):
    """Too little memory for what a command does."""

    exit_code = 1


def open_streams() -> None:
    """Give closed standard streams the null device, and let every character be printed.

    Otherwise a result file would get the number of a closed stream, with all that is printed to it. What a stream's
    encoding does not have is escaped.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w" if number else "r", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if getattr(stream, "errors", "") in ("strict", "surrogateescape"):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def require_memory(need: int = LEAST_ADDRESSES, what: str = "loading the libraries") -> None:
    """Refuse to begin what will not end well.

    Parameters
    ----------
    need, what
        Address space (bytes) that something needs, and what that is.

    Raises
    ------
    MemoryShortError
        The address space of the process is limited to too little.
    """
    try:
        import resource  # noqa: PLC0415  (not on Windows)
    except ImportError:
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # each further thread takes 0.3 GB, and none is of use
    if limit < need:
        raise MemoryShortError(
            f"memory is limited to {limit / 1e6:.0f} MB of addresses (ulimit -v {limit // 1024}); {what} takes "
            f"{need / 1e6:.0f} MB: raise the limit, or limit resident memory instead"
        )


def is_short_of_memory(error: BaseException) -> bool:
    """Whether an error says that there is not enough memory."""
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return True
    loading = isinstance(error, (ImportError, OSError, RuntimeError))
    return loading and any(words in str(error).lower() for words in _LACKS)
