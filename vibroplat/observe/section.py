"""The Poincaré section of a motion: its points at whole turns of exciter 1, and the number of turns in a period."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.kernels.compiled import FloatArray, compiled, inlined
from vibroplat.model.systems import ALONG
from vibroplat.observe.measures import Accumulators

#: Part of a turn that a state on the section may lie before it, by round-off.
ON_SECTION = 1e-9
#: Longest period, in turns of exciter 1, that is searched for while a motion settles.
MAX_PERIOD = 16
#: Largest distance of points of the section that repeat, in scaled units. Of 440 points of Figs. 3 and
#: 6, followed without orbits, those that repeat do so within 0.0041; of the others none comes nearer than 0.42.
REPEAT_DISTANCE = 1e-2
#: Largest distance of the last points of a run that repeats, and the distance up to which they count as equal. A period
#: is told beside a shorter one if its distance is smaller by DISTANCE_RATIO: the rest of a slow oscillation may repeat
#: after some turns, but its distances differ by less.
LATEST_DISTANCE, EQUAL_DISTANCE, DISTANCE_RATIO = 1e-3, 1e-5, 30.0
#: Fewest points that may show that a run repeats, and fewest turns that show that a motion has no period to MAX_PERIOD.
MIN_POINTS, MIN_TURNS = 4, 2 * MAX_PERIOD - 1


@compiled
def section_angle(angle: float, turns: int) -> float:
    """Angle of exciter 1 (rad) at the point of the Poincaré section that is so many turns ahead of the last one."""
    return TURN * (math.floor(angle / TURN + ON_SECTION) + turns)


def section_rows(ms: Accumulators) -> npt.NDArray[np.void]:
    """Points of the Poincaré section that are kept, in the order of time.

    They are records of :data:`vibroplat.observe.measures.SECTION`.
    """
    turns, room = int(ms.marks["turns"]), ms.section.size
    if turns <= room:
        return ms.section[:turns]
    return ms.section[np.arange(max(turns - room, 0), turns) % room]


def whole_periods(ms: Accumulators, turns: int) -> Accumulators:
    """Cut the sums over whole turns to whole periods of ``turns`` turns; without a whole period they stay unchanged."""
    done = int(ms.marks["turns"]) - 1
    left = done % turns
    if not 0 < left < done:
        return ms
    point, marks = ms.section[(done - left) % ms.section.size], ms.marks.copy()
    marks["turns"] -= left
    marks["last"] = point["t"], *point["state"][3:5], *point["counts"]
    return ms._replace(whole=point["sums"].copy(), marks=marks)


def section_points(measures: Accumulators, scene: Scene) -> FloatArray:
    """Points of the Poincaré section in scaled units, in chronological order.

    Returns
    -------
    array, shape (turns, 14), with transport (turns, 16)
        Coordinates and rates over their scales. The exciters' angles are replaced by the cosine and sine of the
        phase difference, so that whole turns do not matter.
    """
    return scaled_points(section_states(measures, scene), scene)


def section_states(measures: Accumulators, scene: Scene) -> FloatArray:
    """Return full states on the section, shape (turns, 14), with transport (turns, 16)."""
    rows = section_rows(measures)
    states: FloatArray = rows["state"]
    return states if scene.transport is None else np.concatenate([states, rows["along"]], axis=1)


def scaled_points(states: FloatArray, scene: Scene) -> FloatArray:
    """Return full states on the section, shape (turns, 14), as :func:`section_points` has them."""
    points = states / state_scales(scene)
    phase = states[:, 3:5] @ scene.phase_weights
    points[:, 3], points[:, 4] = np.cos(phase), np.sin(phase)
    if scene.transport is not None:  # nothing depends on where the material is along the deck
        points[:, ALONG] = 0.0
    return points


@compiled
def ellipsoid_of(
    state: FloatArray, system: int, centres: FloatArray, forms: FloatArray, systems: npt.NDArray[np.int64]
) -> int:
    """Find the first ellipsoid that holds a full state on the section, −1 if none does.

    Each is where a form, shape (14, 14), of the distance from its centre, shape (14,), is below 1 in a system's states;
    whole turns of the exciters do not matter.
    """
    for k in range(systems.size):
        if systems[k] == system and form_of(state, centres[k], forms[k]) < 1.0:
            return k
    return -1


@compiled
def form_of(state: FloatArray, centre: FloatArray, form: FloatArray) -> float:
    """Evaluate the form of an ellipsoid at a full state: the square of its distance, over the radius."""
    size = 0.0
    for i in range(centre.size):
        row = 0.0
        for j in range(centre.size):
            row += form[i, j] * offset_of(state, centre, j)
        size += offset_of(state, centre, i) * row
    return size


@inlined
def offset_of(state: FloatArray, centre: FloatArray, place: int) -> float:
    """Difference of two full states at a place, without whole turns of an exciter."""
    away = state[place] - centre[place]
    if 3 <= place < 5:
        away -= TURN * np.round(away / TURN)
    return away


@inlined
def largest_difference(one: FloatArray, other: FloatArray) -> float:
    """Largest difference of two points in any coordinate; inf if one is not a number."""
    largest = 0.0
    for place in range(one.size):
        away = abs(one[place] - other[place])
        if not away < math.inf:
            return math.inf
        largest = max(largest, away)
    return largest


@compiled
def spread(points: FloatArray, turns: int, enough: float) -> float:
    """Largest distance, in any coordinate, between points that are a multiple of some turns apart, the last one fixed.

    Beyond ``enough`` it need not be the largest. It is inf if there are fewer than twice as many points.
    """
    last, largest = points.shape[0] - 1, 0.0
    if points.shape[0] < 2 * turns:
        return math.inf
    for back in range(turns, points.shape[0]):
        largest = max(largest, largest_difference(points[last - back], points[last - back % turns]))
        if largest > enough:
            break
    return largest


@compiled
def distances(points: FloatArray, turns: int) -> FloatArray:
    """Distance of each point from the one some turns later, shape (turns + 1, points); inf where there is none."""
    apart = np.full((turns + 1, points.shape[0]), np.inf)
    for later in range(1, turns + 1):
        for place in range(points.shape[0] - later):
            apart[later, place] = largest_difference(points[place], points[place + later])
    return apart


@compiled
def spreads(points: FloatArray) -> FloatArray:
    """Return the spread for each number of turns up to MAX_PERIOD, shape (MAX_PERIOD,); see :func:`spread`."""
    found = np.empty(MAX_PERIOD)
    for n in range(MAX_PERIOD):
        found[n] = spread(points, n + 1, math.inf)
    return found


def period(points: FloatArray, tolerance: float, first: int = 1, last: int = MAX_PERIOD) -> int:
    """Smallest number of turns after which the section repeats within a tolerance, or 0."""
    return next((turns for turns in range(first, last + 1) if spread(points, turns, tolerance) <= tolerance), 0)


def few_turns(turns: int) -> str:
    """Say that a motion without a period was measured in too few turns to be aperiodic; "" if they are enough."""
    many = f"{turns} turn{'s' * (turns != 1)} measured"
    return "" if turns >= MIN_TURNS else f"{many}, at least {MIN_TURNS} are needed"


def latest_distances(points: FloatArray, longest: int = MAX_PERIOD) -> FloatArray:
    """Largest distance of the last points from those 1, 2, … turns earlier, shape (longest,); shorter with few points.

    There are as many last points as the longest number of turns, and at most half of all.
    """
    longest = min(longest, len(points) // 2)
    turns = np.arange(1, longest + 1)[:, np.newaxis]
    last = np.arange(len(points) - longest, len(points))
    return np.abs(points[last] - points[last - turns]).max(axis=(1, 2)) if turns.size else np.empty(0)


def is_equal(apart: FloatArray, best: float) -> npt.NDArray[np.bool_]:
    """Whether distances of points are those of a motion that repeats, as are the ``best`` ones."""
    return apart <= max(DISTANCE_RATIO * best, EQUAL_DISTANCE)


class Repetition(NamedTuple):
    """After how many turns a motion repeats.

    Attributes
    ----------
    turns
        Smallest number of turns after which it repeats within a tolerance.
    finer
        Multiple of it after which it repeats far more closely, as near a period doubling; 0 if there is none.
    distance
        Distance of its last points after the ``finer`` number of turns (scaled units); 0 without it.
    """

    turns: int
    finer: int = 0
    distance: float = 0.0

    @property
    def note(self) -> str:
        """What is said of a motion that repeats far more closely after another number of turns."""
        if not self.finer:
            return ""
        return f"period {self.turns}, or {self.finer} within {self.distance:.0e} of scaled units"


def least_period(points: FloatArray, turns: int, tolerance: float) -> Repetition:
    """Return how a section that repeats after some turns within a tolerance repeats at the accuracy of its last points.

    A motion that still converges may miss the tolerance after its period, and be within it after a multiple: as it is
    far from its last points at first in both cases, chance decides. The last points repeat as well after the period.
    """
    apart = latest_distances(points, max(turns, MAX_PERIOD))
    alike = is_equal(apart, apart[turns - 1]) & (apart <= tolerance)
    least = next(n for n in range(1, turns + 1) if turns % n == 0 and (alike[n - 1] or n == turns))
    finer = int(np.argmax(is_equal(apart, apart.min()))) + 1
    if finer > least and finer % least == 0:
        return Repetition(least, finer, float(apart[finer - 1]))
    return Repetition(least)


def latest_repetition(points: FloatArray) -> Repetition:
    """Return how the last points of a section repeat; 0 turns where they do not within LATEST_DISTANCE."""
    apart = latest_distances(points)
    if len(points) < MIN_POINTS or apart.min() > LATEST_DISTANCE:
        return Repetition(0)
    return least_period(points, int(np.argmax(apart <= REPEAT_DISTANCE)) + 1, REPEAT_DISTANCE)
