"""One thread for the linear algebra of libraries, which rounds sums otherwise in several."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_LOCK = threading.Lock()
#: What is inside of :func:`one_thread`: how many blocks, and the limits that end with the last of them.
_inside = 0
_limits: list[Any] = []


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the linear algebra of all libraries that are loaded use one thread in the block.

    A library that is loaded in the block needs another block inside. Blocks of several threads, as dask's workers have,
    overlap; the last one that ends gives back the threads.
    """
    from threadpoolctl import threadpool_limits  # noqa: PLC0415  (looks for all libraries of the process)

    global _inside  # noqa: PLW0603
    with _LOCK:
        _limits.append(threadpool_limits(limits=1))
        _inside += 1
    try:
        yield
    finally:
        with _LOCK:
            _inside -= 1
            while _limits and not _inside:
                _limits.pop().restore_original_limits()
