"""Where machine code is kept between processes, and when it is out of date.

Numba compares cached machine code with the file of the function itself, not with those of the functions it calls: a
changed motor would stay compiled into the old platform. Here the name of the cache's folder holds a digest of all that
determines machine code, wherever the sources lie: any change compiles all kernels anew, and all checkouts of a version
share what one of them has compiled. Each kernel has a file for each of its signatures, which is written whole: without
numba's index, which processes that compile at the same time take from each other.

A wheel can bring machine code (``.ci/wheel.py``), which is read first. It is in a folder of the same name, so it is
taken only where the sources, the compiler, its settings, Python and the processor are those that it was made for.

What is compiled is kept in the first folder that can be written: ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME``, ``~/.cache``,
the package's own, or a temporary one. Where there is none, each process compiles for itself.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import pickle
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numba
from numba.core import config, serialize, sigutils
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys

from vibroplat.kernels.target import processor

PACKAGE = Path(__file__).parents[1]
#: Folder of the machine code that came with the package.
SHIPPED = "kernels/machine_code"

#: Folders of the package whose functions are compiled.
ROOMS = ("kernels", "model", "hybrid", "integrate", "observe")
#: Files besides, with constants that are compiled into kernels: the numbers of the modes and of the coordinates.
SHARED = ("config/coordinates.py",)
#: The kernel that calls most of the others, by engine.
LOOPS = {"taylor": "integrate.taylor.drive", "native": "integrate.ida.drive"}
#: Settings of numba that change machine code. With Intel's SVML it calls a library that other machines may lack.
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "USING_SVML")

#: Folders of other digests are removed once they have not been used for a day (s), except the last ones: a process that
#: has started before a change may still use them, and going back to a version need not compile it again.
UNUSED, SPARE = 86_400.0, 3


@cache
def digest() -> str:
    """Digest of all that determines machine code: every kernel's source, the compiler, its settings, the processor."""
    settings = {name: getattr(config, name, None) for name in SETTINGS}
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
    found = hashlib.sha256(f"{versions} {settings} {llvm.get_process_triple()} {processor()}".encode())
    sources = [file for room in ROOMS for file in (PACKAGE / room).glob("*.py")]
    for source in sorted((*sources, *(PACKAGE / name for name in SHARED))):
        found.update(source.relative_to(PACKAGE).as_posix().encode() + source.read_bytes())
    return found.hexdigest()


def _folders() -> Iterator[Path]:
    """Folders that may keep machine code, best first."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        yield Path(chosen) / "vibroplat"
    for variable, below in (("XDG_CACHE_HOME", ()), ("HOME", (".cache",))):
        if os.environ.get(variable) and _is_own(Path(os.environ[variable])):
            yield Path(os.environ[variable], *below, "vibroplat")
    yield PACKAGE / "__pycache__"
    own = _own_temporary()
    if own is not None:
        yield own / "vibroplat"


def _is_own(folder: Path) -> bool:
    """Whether a folder is this user's, or can be made.

    With ``sudo`` it may be another user's, who could then write what root runs, and not what root leaves there.
    """
    try:
        return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
    except FileNotFoundError:
        return folder != folder.parent and _is_own(folder.parent)
    except OSError:
        return False


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


def _name() -> str:
    return f"kernels-{digest()[:16]}"


@cache
def folder() -> Path | None:
    """Make the folder that keeps machine code, and tidy up around it; None where nothing can be written."""
    for place in _folders():
        current = place / _name()
        try:
            current.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=current).close()
            os.utime(current)  # it is in use
        except OSError:
            continue
        with suppress(OSError):
            _remove_unused(place, current)
        return current
    return None


@cache
def _readable() -> list[Path]:
    """Folders with machine code that fits, best first."""
    return [place for place in (PACKAGE / SHIPPED / _name(), folder()) if place is not None and place.is_dir()]


def _remove_unused(place: Path, current: Path) -> None:
    """Remove folders of other digests that have not been used for long, except the last ones.

    They are renamed first: another process finds such a folder whole or not at all, and makes it again if it needs it.
    """
    others = [(path.stat().st_mtime, path) for path in place.glob("kernels-*") if path != current]
    for used, path in sorted(others, reverse=True)[SPARE:]:
        if time.time() - used > UNUSED:
            with suppress(OSError):
                path.rename(place / f".old-{path.name}-{os.getpid()}")
    for path in place.glob(".old-kernels-*"):
        shutil.rmtree(path, ignore_errors=True)


def is_compiled(engine: str = "auto") -> bool:
    """Whether an engine's compiled kernels are on disk, so that a run need not wait; it loads none of them."""
    name = LOOPS.get(engine, LOOPS["native"])
    return any(any(place.glob(f"{name}-*")) for place in _readable())


def count() -> int:
    """Count what is kept in the folder."""
    kept = folder()
    return 0 if kept is None else len(os.listdir(kept))


def notice() -> str:
    """Say in a clause where machine code is kept if that is not a lasting place; empty if it is."""
    kept = folder()
    if kept is None:
        return "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"
    temporary = _own_temporary()
    if temporary is not None and kept.is_relative_to(temporary):
        return f"they are kept in {temporary}, the only folder that can be written; NUMBA_CACHE_DIR names another"
    return ""


class KernelCache(NullCache):
    """The machine code of one kernel, a file for each signature."""

    def __init__(self, function: Callable[..., Any], place: str) -> None:
        self._function = function
        self._place = place

    @property
    def cache_path(self) -> str:
        """Folder that keeps what is compiled; "" where there is none."""
        return str(folder() or "")

    def _file(self, sig: Any) -> str:
        kinds = sigutils.normalize_signature(sig)
        found = hashlib.sha256(f"{self._function.__code__.co_firstlineno} {kinds}".encode())
        return f"{self._place}-{found.hexdigest()[:16]}.bin"

    def number(self, sig: Any) -> int:
        """Return the number of the kernel with one signature, below 2⁵⁶."""
        return int.from_bytes(hashlib.sha256(self._file(sig).encode()).digest()[:7])

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kernel for one signature, ready to be called; None where it must be compiled.

        Machine code needs numba's runtime alone. Its registries of what can be compiled, which load scipy, are for the
        compiler, which looks through them itself.
        """
        rtsys.initialize(target_context)
        for place in _readable():
            # a crash of the machine may keep the name of a file alone
            with suppress(OSError, EOFError, pickle.UnpicklingError):
                return CompileResult._rebuild(target_context, *pickle.loads((place / self._file(sig)).read_bytes()))
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where there is room: a process that is killed leaves no part of it."""
        kept = folder()
        if kept is None or data.library.has_dynamic_globals:  # addresses that are valid in this process only
            return
        code = serialize.dumps(data._reduce())
        part = kept / f".{self._file(sig)}-{os.getpid()}"
        try:
            part.write_bytes(code)
            part.replace(kept / self._file(sig))
        except OSError:
            part.unlink(missing_ok=True)


def cache_of(function: Callable[..., Any]) -> Any:
    """Return the cache of a kernel; of functions elsewhere nothing is kept.

    Numba's own places would keep it beyond changes of the kernels that they call.
    """
    source = Path(inspect.getfile(function))
    if source.parent.parent != PACKAGE or source.parent.name not in ROOMS:
        return NullCache()
    return KernelCache(function, f"{source.parent.name}.{source.stem}.{function.__qualname__}")
