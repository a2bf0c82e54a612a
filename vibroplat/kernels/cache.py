"""Where machine code is kept between processes, and when it is out of date.

Numba compares cached machine code with the file of the function itself, not with those of the functions it calls: a
changed motor would stay compiled into the old platform. Here the name of the cache's folder holds a digest of all that
determines machine code, wherever the sources lie: any change compiles all kernels anew, and all checkouts of a version
share what one of them has compiled. Comments, docstrings and empty lines do not count. To leave them out, all sources
must be parsed, which takes 0.2 s. The folder therefore keeps an empty file, named by a digest of the sources as they
are, for each state of them that led there: a process that finds it need not parse.

Each kernel has a file for each of its signatures, which is written whole: without numba's index, which processes that
compile at the same time take from each other.

A wheel can bring machine code (``.ci/wheel.py``), which is read first. It is in a folder of the same name, so it is
taken only where the sources, the compiler, its settings, Python and the processor are those that it was made for.

What is compiled is kept in the first folder that can be written: ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME``, ``~/.cache``,
the package's own, or a temporary one. Where there is none, each process compiles for itself.

Whoever can write machine code can run anything as this user: folders that others can write to, or replace, are not
used, whichever of these they are. Nor are files that somebody else has or can write, in whatever way they got there.
Each file is examined as it is open, so that nobody can exchange it in between, and begins with a digest of itself:
damaged machine code would give other numbers, or end the process. What is not used is compiled anew.
"""

from __future__ import annotations

import ast
import errno
import hashlib
import inspect
import logging
import multiprocessing
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

from vibroplat.kernels.engines import loop_of
from vibroplat.kernels.target import processor

_LOG = logging.getLogger("vibroplat")
PACKAGE = Path(__file__).parents[1]
#: Folder of the machine code that came with the package.
SHIPPED = "kernels/machine_code"

#: Folders of the package whose functions are compiled.
ROOMS = ("kernels", "model", "hybrid", "integrate", "observe")
#: Files besides, with constants that are compiled into kernels: the numbers of the modes and of the coordinates;
#: and with what is written into them.
SHARED = ("config/coordinates.py", "config/kloss.py")
#: Settings of numba that change machine code. With Intel's SVML it calls a library that other machines may lack.
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "USING_SVML")

#: Bytes of the digest at the beginning of each file.
DIGEST_SIZE = 32
#: How files are opened: a link is not followed, and a pipe not waited for.
_PLAIN = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)

#: Folders of other digests are removed once they have not been used for a day (s), except the last ones: a process that
#: has started before a change may still use them, and going back to a version need not compile it again.
UNUSED, SPARE = 86_400.0, 3


def _digest(reading: Callable[[bytes], bytes]) -> str:
    """Digest of all that determines machine code: the compiler, its settings, the processor, each source as read."""
    settings = {name: getattr(config, name, None) for name in SETTINGS}
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
    digest = hashlib.sha256(f"{versions} {settings} {llvm.get_process_triple()} {processor()}".encode())
    sources = [file for room in ROOMS for file in (PACKAGE / room).glob("*.py")]
    for source in sorted((*sources, *(PACKAGE / name for name in SHARED))):
        digest.update(source.relative_to(PACKAGE).as_posix().encode() + reading(source.read_bytes()))
    return digest.hexdigest()


def _code(source: bytes) -> bytes:
    """Return what Python reads in a source except docstrings: comments, layout and line numbers are not in it."""
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError):  # nobody can import it
        return source
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node, clean=False):
            del node.body[0]
    return ast.dump(tree).encode()


@cache
def _state() -> str:
    """Name of the file that tells which folder belongs to the sources as they are, with comments and docstrings."""
    return f"sources-{_digest(bytes)[:16]}"


def _is_current() -> bool:
    """Whether the sources are still those of the beginning of this process, which it has compiled."""
    return _state.__wrapped__() == _state()


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


def _other_writer(folder: Path) -> str:
    """Say in a clause who else can write to a resolved folder, or put another in its place; empty if nobody can.

    With ``sudo`` it may be another user's, who could then write what root runs, and not what root leaves there.
    """
    if not hasattr(os, "getuid"):
        return ""
    for path in (folder, *folder.parents):
        try:
            status = path.stat()
        except (FileNotFoundError, NotADirectoryError):
            continue
        if status.st_uid not in (0, os.getuid()):
            return f"{path} belongs to another user"
        # in a sticky folder, such as /tmp, nobody can replace what belongs to another
        if _is_shared(status, path) and (path == folder or not status.st_mode & stat.S_ISVTX):
            return f"others can write to {path}"
    return ""


def _is_shared(status: os.stat_result, place: Path | int) -> bool:
    """Whether others can write to a folder or an open file.

    The bit of the group stands for its members and for all who are named in a list of access (ACL).
    """
    if not status.st_mode & stat.S_IWGRP:
        return bool(status.st_mode & stat.S_IWOTH)
    try:
        listed = any("acl" in name for name in os.listxattr(place))
    except AttributeError:  # not on Linux
        listed = True
    except OSError:  # of a kind of disk that has no lists
        listed = False
    return listed or bool(status.st_mode & stat.S_IWOTH) or not _is_users_own(status.st_gid)


def _is_users_own(group: int) -> bool:
    """Whether a group has this user alone, as many systems give one of his name to each."""
    try:
        import grp  # noqa: PLC0415  (not on Windows)
        import pwd  # noqa: PLC0415

        name = pwd.getpwuid(os.getuid()).pw_name
        entry = grp.getgrgid(group)
        users = {user.pw_name for user in pwd.getpwall() if user.pw_gid == group}  # its list does not name them
    except (ImportError, KeyError):
        return False
    return entry.gr_name == name and {*entry.gr_mem} | users <= {name}


class _UnfitError(OSError):
    """A file that is not used; the message says which files are not."""


def _read(path: Path) -> bytes:
    """Read a file that nobody else can have written.

    Raises
    ------
    OSError
        There is none, or it is another's, a link, or no file.
    """
    with open(path, "rb", buffering=0, opener=lambda name, flags: os.open(name, flags | _PLAIN)) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise _UnfitError("what is no file is")
        if hasattr(os, "getuid"):
            if status.st_uid not in (0, os.getuid()):
                raise _UnfitError("files of another user are")
            if _is_shared(status, file.fileno()):
                raise _UnfitError("files that others can write to are")
        return file.readall()


def _digest_of(path: Path, code: bytes | memoryview) -> bytes:
    """Digest of machine code and its place: elsewhere, or under another name, it would be that of another kernel."""
    digest = hashlib.blake2b(f"{path.parent.name}/{path.name}/".encode(), digest_size=DIGEST_SIZE)
    digest.update(code)
    return digest.digest()


def _machine_code(path: Path) -> Any:
    """Load the parts of a kernel from its file, which is as it was written (OSError)."""
    content = memoryview(_read(path))
    code = content[DIGEST_SIZE:]
    if content[:DIGEST_SIZE] != _digest_of(path, code):
        raise _UnfitError("damaged files are")
    return pickle.loads(code)


@cache
def _tell_unfit(folder: Path, why: str) -> None:
    """Say once that machine code is not used."""
    _LOG.warning("machine code in %s: %s compiled anew", folder, why)


@cache
def _name() -> str:
    """Name of the folder with the machine code of the sources: known from a process that has parsed them, or parsed."""
    for place in (PACKAGE / SHIPPED, *_folders()):
        with suppress(OSError):
            for state in place.glob(f"kernels-*/{_state()}"):
                if not _other_writer(state.parent.resolve()):
                    _read(state)
                    return state.parent.name
    return f"kernels-{_digest(_code)[:16]}"


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
            _mark(current / _state())
            os.utime(current)  # it is in use
        except OSError:
            continue
        with suppress(OSError):
            _remove_unused(place, current)
        return current
    return None


def _mark(file: Path) -> None:
    """Make an empty file, in place of one that is not to be believed."""
    try:
        _read(file)
    except OSError:
        file.unlink(missing_ok=True)
        file.touch(mode=0o600, exist_ok=False)


def _is_safe(folder: Path) -> bool:
    """Whether nobody else can write to a folder; if somebody can, this process says so unless it is a worker."""
    other_writer = _other_writer(folder)
    if other_writer and multiprocessing.current_process().name == "MainProcess":
        _LOG.warning("machine code in %s is not used: %s", folder.parent, other_writer)
    return not other_writer


@cache
def _readable() -> list[Path]:
    """Folders with machine code that fits, best first."""
    shipped, kept = (PACKAGE / SHIPPED / _name()).resolve(), folder()
    return [*([shipped] if shipped.is_dir() and _is_safe(shipped) else []), *([kept] if kept is not None else [])]


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
    return any(any(place.glob(f"{loop_of(engine)}-*")) for place in _readable())


def count() -> int:
    """Count the kernels that are kept in the folder."""
    kept = folder()
    return 0 if kept is None else sum(name.endswith(".bin") for name in os.listdir(kept))


def notice() -> str:
    """Say in a clause where machine code is kept if that is not a lasting place; empty if it is."""
    kept = folder()
    if kept is None:
        return "no folder can be written to keep them, so each process compiles them; NUMBA_CACHE_DIR names one"
    temporary = kept.parents[1]
    if temporary.name.startswith("numba-") and temporary == _temporary().resolve():
        return f"they are kept in {temporary}, the only folder that can be written; NUMBA_CACHE_DIR names another"
    return ""


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

    def number(self, sig: Any) -> int:
        """Return the number of the kernel with one signature, below 2⁵⁶."""
        return int.from_bytes(hashlib.sha256(self._file(sig).encode()).digest()[:7])

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the kernel for one signature, ready to be called; None where it must be compiled.

        Machine code needs numba's runtime alone. Its registries of what can be compiled, which load scipy, are for the
        compiler, which looks through them itself.
        """
        rtsys.initialize(target_context)
        unfit = None
        for place in _readable():
            try:
                parts = _machine_code(place / self._file(sig))
            except FileNotFoundError:
                continue
            except OSError as error:
                if error.errno in (errno.EMFILE, errno.ENFILE):
                    raise
                why = str(error) if isinstance(error, _UnfitError) else "links and unreadable files are"
                unfit = unfit or (place, why)
                continue
            return CompileResult._rebuild(target_context, *parts)
        if unfit is not None:
            _tell_unfit(*unfit)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled, where there is room: a process that is killed leaves no part of it."""
        kept = folder()
        if kept is None or data.library.has_dynamic_globals:  # addresses that are valid in this process only
            return
        if not _is_current():  # it would be kept as that of sources which it is not of
            return
        code = serialize.dumps(data._reduce())
        path = kept / self._file(sig)
        part = kept / f".{path.name}-{os.getpid()}"
        try:
            part.unlink(missing_ok=True)  # what somebody else may have put there
            part.touch(mode=0o600, exist_ok=False)  # whatever files are made with otherwise
            part.write_bytes(_digest_of(path, code) + code)
            part.replace(path)
        except OSError:
            part.unlink(missing_ok=True)


def cache_of(function: Callable[..., Any]) -> Any:
    """Return the cache of a kernel; of functions elsewhere, and of those without a name of their own, nothing is kept.

    Numba's own places would keep it beyond changes of the kernels that they call.
    """
    source = Path(inspect.getfile(function))
    elsewhere = source.parent.parent != PACKAGE or source.parent.name not in ROOMS
    if elsewhere or "<" in function.__qualname__:  # lambdas, and functions of functions
        return NullCache()
    return KernelCache(f"{source.parent.name}.{source.stem}.{function.__qualname__}")


_state()  # of the sources as they are now, while they are loaded
