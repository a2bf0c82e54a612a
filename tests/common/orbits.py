"""Branches and boundaries of a scene, in this process."""

from vibroplat.continuation.tables import boundaries, planned, trace
from vibroplat.study.pool import pool
from vibroplat.study.store import Store


def traced(scene, workers=None):
    """Follow the branches of a scene."""
    with Store(None, {}) as store, pool(1) as here:
        return trace(planned(scene), store, workers or here)


def bounded(scene):
    """Follow the branches of a scene, and the boundaries from their special points."""
    study = planned(scene)
    with Store(None, {}) as store, pool(1) as workers:
        found = trace(study, store, workers)
        return found, boundaries(study, found, store, workers)
