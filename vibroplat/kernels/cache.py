"""Where machine code is kept between processes, and when it is out of date.

Numba compares cached machine code with the file of the function itself, not with those of the functions it calls: a
changed motor would stay compiled into the old platform. Here the name of the cache's folder holds a digest of all that
determines machine code, wherever the sources lie: any change compiles all kernels anew, and all checkouts of a version
share what one of them has compiled.

Each kernel has a file for each of its signatures, which is written whole. Numba's index of a kernel's signatures is not
used: processes that compile two signatures at the same time would give both the same file, and to read it takes a
quarter of the time of a run. If two processes compile the same kernel, they write the same file.

A wheel can bring machine code (``.ci/wheel.py``), which is read first. It is in a folder of the same name, so it is
taken only where the sources, the compiler, its settings, Python and the processor are those that it was made for.

What is compiled is kept in the first folder that can be written: ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME``, ``~/.cache``,
the package's own, or a temporary one. Where there is none, each process compiles for itself.

Whoever can write machine code can run anything as this user: folders that others can write to, or replace, are not
used, nor are files that others own or can write. Each file begins with a digest of the rest: damaged machine code would
give other numbers, or end the process. What is not used is compiled anew.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import multiprocessing
import os
import pickle
import re
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

_LOG = logging.getLogger("vibroplat")
PACKAGE = Path(__file__).parents[1]
#: Folder of the machine code that came with the package.
SHIPPED = "kernels/machine_code"

#: A line above a function that is compiled.
_COMPILES = re.compile(rb"^@(compiled|inlined|fused|fused_inline|wide|callback)\b", re.MULTILINE)
#: Files besides, with constants that are compiled into kernels: the numbers of the modes and of the coordinates;
#: and with what is written into them.
SHARED = ("config/coordinates.py", "config/kloss.py")
#: Settings of numba that change machine code. With Intel's SVML it calls a library that other machines may lack.
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "USING_SVML")

#: Bytes of the digest at the beginning of each file.
DIGEST_SIZE = 32

#: Folders of other digests are removed once they have not been used for a day (s), except the last ones: a process that
#: has started before a change may still use them, and going back to a version need not compile it again.
UNUSED, SPARE = 86_400.0, 3


def _compiles(source: bytes) -> bool:
    """Whether a file has functions that are compiled; most name no decorator, which is found out fast."""
    return b"kernels.compiled" in source and _COMPILES.search(source) is not None


@cache
def rooms() -> tuple[str, ...]:
    """Folders of the package in which functions are compiled, as the sources say."""
    folders = sorted(folder for folder in PACKAGE.iterdir() if folder.is_dir())
    return tuple(folder.name for folder in folders if any(_compiles(file.read_bytes()) for file in folder.glob("*.py")))


@cache
def _name() -> str:
    """Name of the folder for the sources, the compiler, its settings and the processor as this process finds them."""
    settings = {name: getattr(config, name, None) for name in SETTINGS}
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
    digest = hashlib.sha256(f"{versions} {settings} {llvm.get_process_triple()} {processor()}".encode())
    sources = [file for room in rooms() for file in (PACKAGE / room).glob("*.py")]
    for source in sorted((*sources, *(PACKAGE / name for name in SHARED))):
        digest.update(source.relative_to(PACKAGE).as_posix().encode() + source.read_bytes())
    return f"kernels-{digest.hexdigest()[:16]}"


def _folders() -> Iterator[Path]:
    """Folders that may keep machine code, best first."""
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        yield Path(chosen) / "vibroplat"
    for variable, below in (("XDG_CACHE_HOME", ()), ("HOME", (".cache",))):
        if os.environ.get(variable):
            yield Path(os.environ[variable], *below, "vibroplat")
    yield PACKAGE / "__pycache__"
    with suppress(OSError):  # there is none
        yield _temporary() / "vibroplat"


def _temporary() -> Path:
    """Name the folder for this user's temporary files."""
    return Path(tempfile.gettempdir()) / f"numba-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


def _is_private(status: os.stat_result) -> bool:
    """Whether a file or folder is this user's or the system's, and not all others can write to it."""
    return not hasattr(os, "getuid") or (status.st_uid in (0, os.getuid()) and not status.st_mode & stat.S_IWOTH)


def _is_safe(folder: Path) -> bool:
    """Whether nobody else can write to a resolved folder, or put another in its place.

    With ``sudo`` it may be another user's, who could then write what root runs. Members of a group that can write to it
    cannot make files of this user, and no others are read. If it is not safe, this process says so unless it is a
    worker.
    """
    for path in (folder, *folder.parents):
        try:
            status = path.stat()
        except (FileNotFoundError, NotADirectoryError):
            continue
        # in a sticky folder, such as /tmp, nobody can replace what belongs to another
        sticky = path != folder and status.st_mode & stat.S_ISVTX
        if not (_is_private(status) or (sticky and status.st_uid in (0, os.getuid()))):
            if multiprocessing.current_process().name == "MainProcess":
                _LOG.warning("machine code in %s is not used: others can write to %s", folder.parent, path)
            return False
    return True


@cache
def folder() -> Path | None:
    """Make the folder that keeps machine code, and tidy up around it; None where nothing can be written."""
    for place in _folders():
        try:
            current = (place / _name()).resolve()  # somebody else's link may lead elsewhere later
            if not _is_safe(current):
                continue
            for part in (*reversed(current.parents), current):
                part.mkdir(mode=0o700, exist_ok=True)
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
    shipped, kept = (PACKAGE / SHIPPED / _name()).resolve(), folder()
    return [*([shipped] if shipped.is_dir() and _is_safe(shipped) else []), *([kept] if kept is not None else [])]


def _remove_unused(place: Path, current: Path) -> None:
    """Remove folders of other digests that have not been used for long, except the last ones."""
    others = [(path.stat().st_mtime, path) for path in place.glob("kernels-*") if path != current]
    for used, path in sorted(others, reverse=True)[SPARE:]:
        if time.time() - used > UNUSED:
            shutil.rmtree(path, ignore_errors=True)


def is_compiled(kernel: str) -> bool:
    """Whether a kernel is on disk, so that a run need not wait; it is not loaded."""
    return any(any(place.glob(f"{kernel}-*")) for place in _readable())


def notice() -> str:
    """Say in a clause where machine code is kept if that is not a lasting place; empty if it is."""
    kept = folder()
    if kept is None:
        return "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"
    temporary = kept.parents[1]
    if temporary.name.startswith("numba-") and temporary == _temporary().resolve():
        return f"they are kept in {temporary}, the only folder that can be written; NUMBA_CACHE_DIR names another"
    return ""


@cache
def _tell_damaged(folder: Path) -> None:
    """Say once that machine code is not used."""
    _LOG.warning("machine code in %s: damaged files are compiled anew", folder)


def _digest_of(code: bytes | memoryview) -> bytes:
    return hashlib.blake2b(code, digest_size=DIGEST_SIZE).digest()


def _machine_code(path: Path) -> Any:
    """Load the parts of a kernel from its file; None if there is none that is as this user wrote it."""
    try:
        with path.open("rb") as file:
            private, content = _is_private(os.fstat(file.fileno())), memoryview(file.read())
    except (FileNotFoundError, PermissionError):
        return None
    if private and content[:DIGEST_SIZE] == _digest_of(content[DIGEST_SIZE:]):
        return pickle.loads(content[DIGEST_SIZE:])
    _tell_damaged(path.parent)
    return None


class KernelCache(NullCache):
    """The machine code of one kernel, a file for each signature."""

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def cache_path(self) -> str:
        """Folder that keeps what is compiled; "" where there is none."""
        return str(folder() or "")

    def _file(self, sig: Any) -> str:
        kinds = hashlib.sha256(str(sigutils.normalize_signature(sig)).encode())
        return f"{self._name}-{kinds.hexdigest()[:16]}.bin"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kernel for one signature, ready to be called; None where it must be compiled.

        Machine code needs numba's runtime alone. Its registries of what can be compiled, which load scipy, are for the
        compiler, which looks through them itself.
        """
        rtsys.initialize(target_context)
        for place in _readable():
            parts = _machine_code(place / self._file(sig))
            if parts is not None:
                return CompileResult._rebuild(target_context, *parts)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where there is room: a process that is killed leaves no part of it."""
        kept = folder()
        if kept is None or data.library.has_dynamic_globals:  # addresses that are valid in this process only
            return
        if _name.__wrapped__() != _name():  # the sources have changed, and this is of those before
            return
        code = serialize.dumps(data._reduce())
        part = kept / f".{self._file(sig)}-{os.getpid()}"
        try:
            part.touch(mode=0o600)
            part.write_bytes(_digest_of(code) + code)
            part.replace(kept / self._file(sig))
        except OSError:
            part.unlink(missing_ok=True)


def cache_of(function: Callable[..., Any]) -> Any:
    """Return the cache of a kernel; of functions elsewhere, and of those without a name of their own, nothing is kept.

    Numba's own places would keep it beyond changes of the kernels that they call.
    """
    source = Path(inspect.getfile(function))
    elsewhere = source.parent.parent != PACKAGE or source.parent.name not in rooms()
    if elsewhere or "<" in function.__qualname__:  # lambdas, and functions of functions
        return NullCache()
    return KernelCache(f"{source.parent.name}.{source.stem}.{function.__qualname__}")


_name()  # of the sources as they are now, while they are loaded
