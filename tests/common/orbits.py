"""Branches and boundaries of a scene, in this process."""

from __future__ import annotations

from vibroplat.continuation.curves import boundaries
from vibroplat.continuation.tracing import trace
from vibroplat.study.pool import pool
from vibroplat.study.store import Store


def traced(scene):
    """Follow the branches of a scene."""
    with Store(None, {}) as store, pool(1) as workers:
        return trace(scene, store, workers)


def bounded(scene):
    """Follow the branches of a scene, and the boundaries from their special points."""
    with Store(None, {}) as store, pool(1) as workers:
        found = trace(scene, store, workers)
        return found, boundaries(scene, found, store, workers)
