"""Locks that a forked process finds free, though another thread of its parent has held them."""

from __future__ import annotations

import os
import threading


def lock() -> threading.Lock:
    """Make a lock; its holder is not among the threads of a child, which would wait for it for ever."""
    made = threading.Lock()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=made._at_fork_reinit)  # type: ignore[attr-defined]
    return made
