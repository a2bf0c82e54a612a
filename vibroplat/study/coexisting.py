"""Two aperiodic motions: whether they are different attractors, or stretches of the same motion.

Each motion is measured in blocks. The bounds of its measures over the blocks of a window are its class. Chaos may stay
in one class for minutes before it changes into another. Windows of one motion scatter by up to 45 % of a measure, far
more than the errors from their blocks. So both motions are followed. If either is seen to change into the class of the
other, they count as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import SUMMED, Accumulators, block_difference, measured_extremes
from vibroplat.observe.section import section_points, section_rows
from vibroplat.observe.summary import MeasuredInterval, statistics
from vibroplat.study.lyapunov import largest_exponent
from vibroplat.study.settling import KnownOrbit, NearReturn, OrbitDetector

#: Number of blocks of a window; an aperiodic motion is measured in one.
BLOCKS = 24
#: Windows over which two motions are followed. In 120 windows of chaos at 59.5 Hz, one motion stays in one of its two
#: classes for up to 15 of them, and in the other for up to 8.
WINDOWS = 12
#: Measures that tell classes apart, and the least width of a class relative to them.
CLASS_MEASURES, MIN_CLASS_WIDTH = ("rms_x_m", "rms_y_m", "rms_phi_rad"), 0.02


class Comparison(NamedTuple):
    """What comes of two motions that were followed.

    Attributes
    ----------
    orbit
        A stable orbit to which one of them converges.
    apart_s
        Time over which neither changed into the class of the other (s); 0 if one did, if one converges to an orbit or
        ended, or if the second one is not chaotic.
    """

    orbit: KnownOrbit | None = None
    apart_s: float = 0.0


class AttractorClass(NamedTuple):
    """The class of an aperiodic motion: the smallest and largest values of CLASS_MEASURES that belong to it."""

    smallest: Sequence[float]
    largest: Sequence[float]

    @classmethod
    def of(cls, values: FloatArray, negligible: FloatArray) -> AttractorClass:
        """Make the class of a window from the values of its blocks, shape (blocks, 3), which it exceeds by their width.

        Differences that are ``negligible``, shape (3,), say nothing: a motion that comes back to its symmetry, or
        leaves it, is not another one as long as it is nearer than that.
        """
        least, most = values.min(axis=0), values.max(axis=0)
        wider = np.maximum(np.maximum(most - least, MIN_CLASS_WIDTH * most), negligible)
        return cls((least - wider).tolist(), (most + wider).tolist())

    def holds(self, values: FloatArray) -> bool:
        """Whether any of some blocks, shape (n, 3), belongs to the class."""
        return bool(((values >= self.smallest) & (values <= self.largest)).all(axis=1).any())

    def met(self, ends: Sequence[Accumulators]) -> bool:
        """Whether it holds the last block of a motion, from the sums at the ends of all blocks so far."""
        return len(ends) > 0 and self.holds(block_values(ends[-2:])[-1:])


def negligible_differences(scene: Scene, plan: SweepPlan) -> FloatArray:
    """Return differences of CLASS_MEASURES that may be left of settling, shape (3,)."""
    found: FloatArray = plan.settle_tolerance * state_scales(scene)[: len(CLASS_MEASURES)]
    return found


def block_values(blocks: Sequence[Accumulators]) -> FloatArray:
    """CLASS_MEASURES of each block, shape (blocks, 3), from the sums at their ends."""
    parts = [*blocks[:1], *(block_difference(a, b) for a, b in pairwise(blocks))]
    found = [statistics(part, measured_extremes(part)) for part in parts]
    return np.array([[values[name] for name in CLASS_MEASURES] for values in found], dtype=float)


class SearchBeginning(NamedTuple):
    """Where the search for attractors that coexist with an aperiodic motion begins, in plain values.

    Attributes
    ----------
    returns
        Near returns of its section.
    class_of
        Its class.
    end
        Full state at its end, shape (14,).
    """

    returns: Sequence[NearReturn]
    class_of: AttractorClass
    end: Sequence[float]


def begin_search(
    scene: Scene, plan: SweepPlan, part: MeasuredInterval, end: FloatArray, detector: OrbitDetector
) -> SearchBeginning:
    """Gather what a search needs from the blocks of a motion and the full state at its end."""
    returns = detector.near_returns(section_points(part.measures, scene), section_rows(part.measures)["state"])
    known = AttractorClass.of(block_values(part.blocks), negligible_differences(scene, plan))
    return SearchBeginning(returns, known, end.tolist())


def compare(
    scene: Scene, plan: SweepPlan, states: Sequence[FloatArray], known: AttractorClass, detector: OrbitDetector
) -> Comparison:
    """Follow a motion of known class, and another, from full states at their ends."""
    p, length = parameters(scene), BLOCKS * plan.measure_s
    with closing(make_engine(scene, p)) as one, closing(make_engine(scene, p)) as two:
        motions = [
            Simulator(scene, p, engine, state) for engine, state in zip((two, one), reversed(states), strict=True)
        ]
        classes = [known]
        for _ in range(WINDOWS):
            for place, motion in enumerate(motions):
                part = motion.advance(length, blocks=BLOCKS, scope=SUMMED, until=classes[place].met)
                if motion.outcome != "ok" or classes[place].met(part.blocks):
                    return Comparison()
                orbit = detector.detect(motion, section_points(part.measures, scene), 0)
                if orbit is not None:
                    return Comparison(orbit)
                if len(classes) == 1:
                    classes.append(AttractorClass.of(block_values(part.blocks), negligible_differences(scene, plan)))
        chaotic = largest_exponent(scene, motions[0].state).sign > 0
        return Comparison(None, WINDOWS * length if chaotic else 0.0)
