"""Where machine code is kept between processes, and when it is out of date.

Numba compares cached machine code with the file of the function itself, not with those of the functions it calls: a
changed motor would stay compiled into the old platform. Here the name of the cache's folder holds a digest of the
sources of all kernels, wherever it lies, so that any change compiles all of them anew.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching

PACKAGE = Path(__file__).parents[1]

#: Folders of the package whose functions are compiled.
ROOMS = ("kernels", "model", "hybrid", "integrate", "observe", "flow")


@cache
def digest() -> str:
    """Digest of every kernel's source."""
    found = hashlib.sha256()
    for source in sorted(file for room in ROOMS for file in (PACKAGE / room).glob("*.py")):
        found.update(source.relative_to(PACKAGE).as_posix().encode() + source.read_bytes())
    return found.hexdigest()


def _folders(room: Path) -> Iterator[Path]:
    """Folders that may keep the machine code of one room, best first."""
    name = f"vibroplat-{hashlib.sha256(str(room).encode()).hexdigest()[:16]}"
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        yield Path(chosen) / name
    yield room / "__pycache__"
    for variable, below in (("XDG_CACHE_HOME", ()), ("HOME", (".cache",))):
        if os.environ.get(variable):
            yield Path(os.environ[variable], *below, "numba", name)
    yield Path(tempfile.gettempdir()) / f"numba-{os.getuid() if hasattr(os, 'getuid') else 'user'}" / name


@cache
def _writable(room: Path) -> Path | None:
    """Make the folder of a room's machine code, without that of other sources; None where nothing can be written."""
    for folder in _folders(room):
        current = folder / f"kernels-{digest()[:16]}"
        try:
            current.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=current).close()
        except OSError:
            continue
        for other in folder.glob("kernels-*"):
            if other != current:
                shutil.rmtree(other, ignore_errors=True)
        return current
    return None


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
        folder = _writable(room)
        return None if folder is None else cls(function, folder)


caching.CacheImpl._locator_classes.insert(0, KernelLocator)
