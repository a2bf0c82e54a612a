"""Settled motions for scenes without orbits: their measures, and derivatives of these by differences.

The derivative by a key is the mean of two central differences, with a small step and with half of it. The error is the
difference between the two, combined with its median over the keys. It contains curvature, events that occur at one end
only, remaining transients, and the scatter of motion that does not repeat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroplat.columns import name_regime
from vibroplat.config.circular import differences
from vibroplat.config.coordinates import TURN
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import value_of
from vibroplat.study.point import measure_point
from vibroplat.study.store import Record

#: Relative change of keys, for motion that repeats and for other motion, whose measures scatter.
STEP, WIDE_STEP = 5e-4, 2e-2
#: Hint in the answer of a design without orbits.
NO_ORBITS = (
    "with transport there are no orbits: each scene was followed until it settled, derivatives are "
    "differences of settled motions (derivative_error in table sensitivities), stability has no margin"
)
#: Samples without a stable orbit are simulated briefly, because there are many: maximum settling time (turns), length
#: of a measured block (turns), initial distance from the orbit (scaled units).
#: Of 50 chaotic ones RMS y differs by 1 % in the median and 14 % at most from that of 60 s of settling and 48 s more.
MAX_SETTLING_TURNS, MEASURED_TURNS, START_DISTANCE = 128.0, 6.0, 1e-3
#: Times as long as that a motion in place of an orbit may settle, the distance at which it has settled (scaled units),
#: and times as long as that it is measured if it does not repeat.
MORE_SETTLING, SETTLE_TOLERANCE, MORE_MEASURED = 8.0, 1e-7, 8.0


def settling_plan(scene: Scene) -> SweepPlan:
    """Return how motion settles and is measured: as in the sweep of the scene, if it has one."""
    return scene.sweep or SweepPlan.of_motion()


def brief_plan(scene: Scene, settling: float = 1.0, measures_at: float = 1.0, **more: float) -> SweepPlan:
    """Return a plan for motion that starts near its limit; the factors multiply the times of settling and measuring."""
    turn = TURN / scene.speed_scale
    times = {"max_settle_s": settling * MAX_SETTLING_TURNS * turn, "measure_s": measures_at * MEASURED_TURNS * turn}
    how = {"settle_by": "section", "perturbation": START_DISTANCE, "lyapunov": False}
    return settling_plan(scene).model_copy(update=times | how | more)


class MotionNeighbourhood:
    """A settled motion and those at other values of some keys, as :class:`.OrbitNeighbourhood` has orbits.

    Attributes
    ----------
    scene, keys, values
        Scene of the motion, dotted keys, and their values there, shape (keys,).
    measures, state
        Measures of a sweep, and the full state at its end.
    margin
        It has settled, so it is stable; how far its multipliers are inside the unit circle is not known.
    """

    margin = math.inf

    def __init__(self, scene: Scene, keys: Sequence[str], known: Record) -> None:
        longer = 1.0 if known["period"] else MORE_MEASURED
        plan = brief_plan(scene, MORE_SETTLING, longer, settle_tolerance=SETTLE_TOLERANCE)
        point = measure_point(scene, plan, known["state"], (0,))
        if point.state is None:
            raise NoConvergenceError(f"{point.row['outcome']}: {point.row['detail']}")
        self.scene, self.keys, self.known = scene, tuple(keys), known | {"state": point.state}
        self.state, self.values = np.array(point.state), np.array([value_of(scene, key) for key in keys], float)
        self.measures: dict[str, Any] = point.row
        if any(point.row[name] != known[name] for name in ("sync", "motion")):  # a small change may double its period
            raise NoConvergenceError(f"the motion becomes {name_regime(point.row)} instead of {name_regime(known)}")

    def close(self) -> None:
        """Do nothing: no engine is held."""

    def measured(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the measures of these names at least, and the regime."""
        return self.measures

    def prepare(self) -> None:
        """Do nothing: other motions are not predicted from this one."""

    def correct(self, values: Sequence[float] | FloatArray) -> MotionNeighbourhood:
        """Find the motion at other values of the keys; raises :class:`NoConvergenceError` if its regime is another."""
        changes = dict(zip(self.keys, np.asarray(values, float).tolist(), strict=True))
        try:
            return MotionNeighbourhood(self.scene.replace(changes), self.keys, self.known)
        except ConfigError as error:
            raise NoConvergenceError(f"no scene has these values: {error}") from None

    def _step_to(self, begin: MotionNeighbourhood, change: FloatArray) -> MotionNeighbourhood:
        """Find the motion after relative changes of keys from another one; this one if its regime is another there."""
        try:
            return begin.correct(self.values * (1.0 + change))
        except NoConvergenceError:
            return self

    def gradients(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Differentiate measures by all keys; return them and their errors, shape (names, keys), or nan."""
        step, slopes = STEP if self.known["period"] else WIDE_STEP, np.empty((2, len(names), len(self.keys)))
        for k, key in enumerate(np.eye(len(self.keys))):
            above = below = self
            for n, change in enumerate((step * key, 0.5 * step * key)):
                above, below = self._step_to(above, change), self._step_to(below, -change)
                high, low = (np.array([one.measures[name] for name in names], float) for one in (above, below))
                slopes[n, :, k] = differences(names, high, low) / ((above.values - below.values)[k] or np.nan)
        own, sizes = np.abs(slopes[0] - slopes[1]), np.abs(self.values)
        typical = np.nanmedian(own * sizes, axis=1, keepdims=True) / sizes
        return np.asarray(slopes.mean(axis=0)), np.hypot(own, typical)
