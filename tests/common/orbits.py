"""Branches and boundaries of a scene, in this process."""

from vibroplat.continuation.study import OrbitsStudy
from vibroplat.study.pool import pool
from vibroplat.study.store import Store


def traced(scene, workers=None):
    with Store(None, {}) as store, pool(1) as here:
        return OrbitsStudy(scene).trace(store, workers or here)


def bounded(scene):
    """Follow the branches of a scene, and the boundaries from their special points."""
    study = OrbitsStudy(scene)
    with Store(None, {}) as store, pool(1) as workers:
        found = study.trace(store, workers)
        return found, study.follow_boundaries(found, store, workers)
