"""Where machine code is kept between processes, and when it is out of date.

Numba compares cached machine code with the file of the function itself, not with those of the functions it calls: a
changed motor would stay compiled into the old platform. Here the name of the cache's folder holds a digest of all that
determines the machine code, wherever it lies, so that any change compiles all kernels anew. The processor's features,
the version of Python and the types of arguments are in numba's own index.

Folders are tried in turn: ``NUMBA_CACHE_DIR``, the package's own, ``XDG_CACHE_HOME``, ``~/.cache`` and a temporary
one. Where none of them can be written, each process compiles for itself.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core import caching, config

PACKAGE = Path(__file__).parents[1]

#: Folders of the package whose functions are compiled.
ROOMS = ("kernels", "model", "hybrid", "integrate", "observe")
#: Files besides, with constants that are compiled into kernels: the numbers of the modes and of the coordinates.
SHARED = ("config/coordinates.py",)
#: The kernel that is compiled last, as it calls the others, by engine: its room, and its name in numba's index.
LAST = {"taylor": ("integrate", "taylor.drive"), "native": ("integrate", "ida.drive")}
#: Settings of numba that change machine code and are not in its index.
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DISABLE_INTEL_SVML")

#: Folders of other digests are removed once they have not been used for a day (s), except the last ones: a process that
#: has started before a change may still use them, and going back to a version need not compile it again.
UNUSED, SPARE = 86_400.0, 3


@cache
def digest() -> str:
    """Digest of every kernel's source, of the compiler's version and of its settings."""
    settings = {name: getattr(config, name, None) for name in SETTINGS}
    found = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {settings}".encode())
    sources = [file for room in ROOMS for file in (PACKAGE / room).glob("*.py")]
    for source in sorted((*sources, *(PACKAGE / name for name in SHARED))):
        found.update(source.relative_to(PACKAGE).as_posix().encode() + source.read_bytes())
    return found.hexdigest()


def _folders(room: Path) -> Iterator[Path]:
    """Folders that may keep the machine code of one room, best first."""
    name = f"vibroplat-{room.name}"  # the digest tells checkouts apart, so that those of one version share it
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        yield Path(chosen) / name
    yield room / "__pycache__"
    for variable, below in (("XDG_CACHE_HOME", ()), ("HOME", (".cache",))):
        if os.environ.get(variable):
            yield Path(os.environ[variable], *below, "numba", name)
    own = _own_temporary()
    if own is not None:
        yield own / name


def _own_temporary() -> Path | None:
    """Make this user's folder for temporary files; None where there is none, or where others can write to it.

    Machine code is loaded without question: whoever can write it can run anything.
    """
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(tempfile.gettempdir()) / f"numba-{'user' if user is None else user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    safe = user is None or (stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o022)
    return folder if safe else None


@cache
def folder_of(room: Path) -> Path | None:
    """Make the folder of a room's machine code, and tidy up around it; None where nothing can be written."""
    for folder in _folders(room):
        current = folder / f"kernels-{digest()[:16]}"
        try:
            current.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=current).close()
            os.utime(current)  # it is in use
        except OSError:
            continue
        with suppress(OSError):
            _remove_unused(folder, current)
            _remove_empty_files(current)
        return current
    return None


def _remove_unused(folder: Path, current: Path) -> None:
    """Remove folders of other digests that have not been used for long, except the last ones.

    They are renamed first: another process finds such a folder whole or not at all, and makes it again if it needs it.
    """
    others = [(path.stat().st_mtime, path) for path in folder.glob("kernels-*") if path != current]
    for used, path in sorted(others, reverse=True)[SPARE:]:
        if time.time() - used > UNUSED:
            with suppress(OSError):
                path.rename(folder / f".old-{path.name}-{os.getpid()}")
    for path in folder.glob(".old-kernels-*"):
        shutil.rmtree(path, ignore_errors=True)


def _remove_empty_files(folder: Path) -> None:
    """Remove files of which a crash of the machine has kept the names alone; numba would fail to read them."""
    for path in folder.glob("*.nb[ci]"):
        if path.stat().st_size == 0:
            path.unlink(missing_ok=True)


def kept(function: Callable[..., Any]) -> bool:
    """Whether the machine code of a function is kept: that of a kernel, where a folder can be written.

    Numba's own places would keep that of functions elsewhere beyond changes of the kernels that they call.
    """
    return KernelLocator.from_function(function, inspect.getfile(function)) is not None


def is_compiled(engine: str = "auto") -> bool:
    """Whether an engine's compiled kernels are kept on disk, so that a run need not wait; it loads none of them."""
    room, name = LAST.get(engine, LAST["native"])
    folder = folder_of(PACKAGE / room)
    return folder is not None and any(folder.glob(f"{name}-*.nbi"))


def notice() -> str:
    """Say in a clause where machine code is kept if that is not a lasting place; empty if it is."""
    folder = folder_of(PACKAGE / ROOMS[0])
    if folder is None:
        return "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"
    temporary = _own_temporary()
    if temporary is not None and folder.is_relative_to(temporary):
        return f"they are kept in {temporary}, the only folder that can be written; NUMBA_CACHE_DIR names another"
    return ""


class KernelLocator(caching._CacheLocator):
    """Finds the cache of this package's kernels; numba's own locators serve everyone else's."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._folder = folder

    def get_cache_path(self) -> str:  # noqa: D102
        return str(self._folder)

    def get_source_stamp(self) -> str:  # noqa: D102
        return digest()

    def get_disambiguator(self) -> str:  # noqa: D102
        return str(self._line)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> KernelLocator | None:
        """Make the locator of a kernel; None for other functions, and where no folder can be written."""
        room = Path(file).parent
        if room.parent != PACKAGE or room.name not in ROOMS:
            return None
        folder = folder_of(room)
        return None if folder is None else cls(function, folder)


caching.CacheImpl._locator_classes.insert(0, KernelLocator)
_listed = getattr(config, "CACHE_LOCATOR_CLASSES", "")
if _listed:  # NUMBA_CACHE_LOCATOR_CLASSES would be taken instead
    config.CACHE_LOCATOR_CLASSES = f"{__name__}.KernelLocator,{_listed}"  # type: ignore[attr-defined]
