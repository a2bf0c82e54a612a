"""Distinguish aperiodic motions by windows of them.

Windows of one motion may differ more than those of two: where it comes in bursts, its RMS displacements scatter by half
of themselves. So each window has a class, and an arrow goes from the class of each window to that of the next one. A
set of classes that lead to each other, and to no other ones, is an attractor; others are left sooner or later.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import ALONG_RATE
from vibroplat.study.classification import same_phase

#: Measures that distinguish motions that do not repeat, with the places of their scales; the last one with transport.
MEASURES = {"rms_x_m": 0, "rms_y_m": 1, "rms_phi_rad": 2, "conveying_speed_m_per_s": ALONG_RATE}
#: Motions that repeat are the same if their measures are this near, over themselves.
PERIODIC_TOLERANCE = 1e-3
#: Windows are of one class if their measures are this near, over themselves.
MAX_DIFFERENCE = 0.2

#: Measures of a window, by column of a sweep.
Window = Mapping[str, Any]


def is_alike(one: Window, other: Window, scales: FloatArray, tolerance: float = MAX_DIFFERENCE) -> bool:
    """Whether two motions are synchronized alike, with nearly the same RMS displacements and fraction of flight."""
    known = {name: index for name, index in MEASURES.items() if index < len(scales)}
    sizes = np.array([[row[name] or 0.0 for name in known] for row in (one, other)]) / scales[[*known.values()]]
    near = np.linalg.norm(sizes[1] - sizes[0]) <= tolerance * np.linalg.norm(sizes, axis=1).max()
    flying = abs((one["flight_fraction"] or 0.0) - (other["flight_fraction"] or 0.0)) <= tolerance
    return bool(near) and flying and same_phase(one, other)


def same_motion(one: Window, other: Window, scales: FloatArray) -> bool:
    """Whether two measured motions are of one attractor."""
    if any(one.get(name) != other.get(name) for name in ("motion", "period", "outcome")):
        return False
    if other.get("motion") is None:
        return True
    return is_alike(one, other, scales, PERIODIC_TOLERANCE if other["period"] else MAX_DIFFERENCE)


def classify_windows(motions: Sequence[Sequence[Window]], scales: FloatArray) -> list[list[int]]:
    """Return the classes of the windows of some motions; a class is named after its first window."""
    first: list[Window] = []
    all_classes = []
    for windows in motions:
        classes = []
        for window in windows:
            number = next((k for k, one in enumerate(first) if is_alike(one, window, scales)), len(first))
            if number == len(first):
                first.append(window)
            classes.append(number)
        all_classes.append(classes)
    return all_classes


def components(paths: Sequence[Sequence[int]]) -> tuple[list[int], dict[int, set[int]]]:
    """Return the strong component in which each path ends, and the closed ones to which each component leads.

    A motion that has just entered classes in which none was seen to stay is on its way: it ends in the last component
    before them. One that was in no other has the number −1.

    Parameters
    ----------
    paths
        Classes of successive windows of each motion.

    Returns
    -------
    ends, closed
        Components have numbers. A closed one leads to itself alone; one that leads to others is left.
    """
    from scipy.sparse import csr_array  # noqa: PLC0415  (a tenth of a second)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    size = 1 + max((number for path in paths for number in path), default=-1)
    arrows = np.zeros((size, size), dtype=bool)
    for path in paths:
        arrows[path[:-1], path[1:]] = True
    count, labels = connected_components(csr_array(arrows), directed=True, connection="strong")
    reached = np.zeros((count, count), dtype=bool)
    for one, other in np.argwhere(arrows):
        reached[labels[one], labels[other]] = True
    stays = reached.diagonal().copy()
    reached &= stays & stays[:, np.newaxis]
    for middle in range(count):
        reached |= np.outer(reached[:, middle], reached[middle])
    closed = [k for k in range(count) if stays[k] and reached[k].sum() == 1]
    ends = [next((int(labels[k]) for k in reversed(path) if stays[labels[k]]), -1) for path in paths]
    return ends, {-1: set()} | {k: {c for c in closed if reached[k, c]} for k in range(count)}
