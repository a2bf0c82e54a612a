"""Memory: how much there is, how much of it a run may keep, and how much a command needs before it begins."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

from vibroplat.errors import VibroplatError

#: Fraction of the available memory that a run may keep. The rest is for tables made of it, and for other programs.
FRACTION = 0.5
#: Memory (bytes) after which a run looks again how much is available.
INTERVAL = 16 * 2**20

#: Where control groups are.
GROUPS = Path("/sys/fs/cgroup")
#: What is told where the system has refused memory.
NO_MORE = "the system gave no more memory; end other programs, or run on a machine with more"

#: Address space (bytes) below which libraries cannot be loaded: with one thread of OpenBLAS a run and its figures need
#: 1.0 GB, with engine sundae 1.05 GB. With less it waits for memory for ever or ends the process, without a word.
MIN_ADDRESS_SPACE = 1_200_000_000
#: The same where kernels have to be compiled: 1.33 GB are enough, with 1.13 GB Python runs out of memory.
MIN_COMPILING_ADDRESS_SPACE = 1_450_000_000

#: How the loader and libraries describe a lack of memory.
_LACKS = ("failed to map segment", "cannot allocate", "out of memory")

_UNITS = ("bytes", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB")


class OutOfMemoryError(MemoryError):
    """More would be kept than memory allows; the message says what takes it and what to change."""


class MemoryShortError(VibroplatError):
    """Too little memory for what a command does."""

    exit_code = 1


def size_text(size: float) -> str:
    """Format a number of bytes.

    >>> size_text(3.2 * 2**30)
    '3.2 GiB'
    """
    place = 0
    while size >= 1000.0 and place < len(_UNITS) - 1:
        size, place = size / 1024.0, place + 1
    return f"{size:.3g} {_UNITS[place]}"


def available() -> float:
    """Return the memory (bytes) that this process may still take without swapping; infinity if nothing tells.

    It is the least of what the machine has, what its control group leaves (a container's limit), and what the limit of
    the process's address space leaves.
    """
    return max(min(_of_machine(), _of_group(), _of_address_space()), 0.0)


def free_memory(there: float) -> float:
    """Return how much of the available memory may be taken (bytes)."""
    return FRACTION * there


def _of_machine() -> float:
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    with suppress(OSError, ValueError, AttributeError):  # what is free is not told, but what there is
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return float("inf")


def _of_group() -> float:
    """Return what the control group of this process leaves, of version 2 or 1, as seen in a container or outside."""
    least = float("inf")
    for limit, used in (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    ):
        for group in control_groups():
            with suppress(OSError, ValueError):  # "max" is no number
                most = int((group / limit).read_text(encoding="ascii"))
                least = min(least, most - int((group / used).read_text(encoding="ascii")) + _cache(group / limit))
    return least


def control_groups() -> list[Path]:
    """List the directories of the process's control group and of those it is in."""
    root = GROUPS
    with suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
            if line.startswith("0::"):
                own = root / line[3:].lstrip("/")
                return [own, *(path for path in own.parents if root in (path, *path.parents))]
    return [root]


def _cache(limit: Path) -> int:
    """Return the part of a control group's memory that holds copies of files and can be dropped."""
    for line in (limit.parent / "memory.stat").read_text(encoding="ascii").splitlines():
        name, _, number = line.partition(" ")
        if name in ("inactive_file", "total_inactive_file"):
            return int(number)
    return 0


def _of_address_space() -> float:
    limit = _limit_of_addresses()
    with suppress(OSError, ValueError):
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        return limit - pages * os.sysconf("SC_PAGE_SIZE")
    return limit


def _limit_of_addresses() -> float:
    """Return the address space (bytes) that this process may have in all; infinity without a limit."""
    try:
        import resource  # noqa: PLC0415  (not on Windows)
    except ImportError:
        return float("inf")
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return float("inf") if limit == resource.RLIM_INFINITY else limit


class MemoryBudget:
    """The memory that a run may keep, for all that it keeps.

    Parameters
    ----------
    advice
        What to change if it is not enough.
    bounded
        Whether there is a bound at all.
    """

    def __init__(self, advice: str = "", *, bounded: bool = True) -> None:
        self.taken = 0
        self._bounded = bounded
        self._advice = advice
        self._checked = 0

    def take(self, size: int) -> None:
        """Count memory that is about to be kept (bytes).

        Raises
        ------
        OutOfMemoryError
            All that is kept would be more than :data:`FRACTION` of what is available to it.
        """
        taken = self.taken + size
        if self._bounded and taken - self._checked > INTERVAL:
            most = free_memory(available() + self.taken)
            if taken > most:
                raise OutOfMemoryError(
                    f"the data that the run keeps would need more than {size_text(most)}, {FRACTION:g} of the memory "
                    f"that is available{self._advice and '; '}{self._advice}"
                )
            self._checked = taken
        self.taken = taken


def require_memory(need: int = MIN_ADDRESS_SPACE, what: str = "loading the libraries") -> None:
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
    limit = _limit_of_addresses()
    if limit < need:
        raise MemoryShortError(
            f"memory is limited to {limit / 1000000.0:.0f} MB of addresses (ulimit -v {limit // 1024:.0f}); {what} "
            f"takes {need / 1000000.0:.0f} MB: raise the limit, or limit resident memory instead"
        )


def is_short_of_memory(error: BaseException) -> bool:
    """Whether an error says that there is not enough memory."""
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return True
    loading = isinstance(error, (ImportError, OSError, RuntimeError))
    return loading and any(words in str(error).lower() for words in _LACKS)
