"""Lyapunov exponents of a motion, from the derivative of its Poincaré map.

The derivative is carried along the motion (:mod:`vibroplat.observe.variation`), through impacts, chatters and liftoffs.
Where exciter 1 completes its turns it is projected along the motion onto the section, which takes out the neutral
direction, and its columns are made orthogonal again: their growth gives the exponents (Benettin et al. 1980; Müller
1995).

Where contact begins, gap and gap rate are 0 whatever they were: the rank of the derivative falls by two. An inelastic
impact after which the material flies on fixes the gap rate alone. Every time this happens, the derivative loses rank
for good: as many exponents are −∞. They follow from the events themselves, because round-off in a number that should be
0 could be mistaken for growth.
"""

from __future__ import annotations

import math
from contextlib import closing
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.config.arguments import validated
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import with_second_engine
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.errors import ConfigError, MotionError
from vibroplat.hybrid.modes import ATTACHED, IMPACT
from vibroplat.hybrid.state import Automaton, state_scales
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import FloatArray, parameters
from vibroplat.model.systems import FULL_SIZE
from vibroplat.motion.initial_condition import initial_condition
from vibroplat.motion.motion import Simulator
from vibroplat.motion.variation import full_state
from vibroplat.observe.tables import state_places
from vibroplat.observe.variation import Variation

#: How many measurements of growth are added while an error is too large.
MORE_MEASUREMENTS = 16
#: Numbers of blocks of growths. The error is the largest that any of them gives: few blocks are long against the
#: memory of the motion, many blocks give the scatter accurately. Over 147 stretches of chaotic motion, exponents
#: scatter by 0.97 times this error; with 8 blocks of 32 growths alone it was 1.3 … 1.9 times, once 7 times.
BLOCKS = (4, 8, 16)
#: On a torus, blocks that are weighted smoothly agree far better than plain ones (Das et al. 2017, Nonlinearity 30,
#: 4111): below this ratio of both errors, of blocks of at least so many growths, the motion is regular. It is 0.01 on a
#: torus with blocks of 60, and 0.3 … 2 in chaos.
REGULAR_ERROR_RATIO, MIN_SMOOTH_GROWTHS = 0.1, 24
#: Largest difference of the exponents of both halves of the growth, in their joint standard errors.
MAX_HALF_DIFFERENCE = 3.0
#: Errors that are small enough: relative to the exponent, so that its sign is clear, and as growth per turn, which
#: would need two thousand turns to double a distance.
MAX_RELATIVE_ERROR, MAX_ERROR_PER_TURN = 1.0 / 6.0, 3e-4
#: Minimum growth between two measurements, over the largest one or 1: round-off hides a smaller one.
MIN_GROWTH_RATIO = 1e-13
#: Initial part of a direction along its neighbour that may be left in the first measurement that counts. It decays by
#: the difference of both exponents.
MAX_MIXED_PART = 0.01
#: Measurements of which at most one is left out for this. Exponents that would need more are nearly equal, or those of
#: a complex pair of multipliers, whose directions exchange their growth for good.
MIXED_MEASUREMENTS = 3
#: Directions that are followed for the largest exponent: more than one, as two may be nearly as large.
N_FOLLOWED = 3
#: Directions that a motion forgets where contact begins, and in an inelastic impact after which it does not.
CONTACT_DIRECTIONS, INELASTIC_DIRECTIONS = 2, 1

_ANGLE = 3  # of exciter 1, the same for all points of the section


class Exponent(NamedTuple):
    """A Lyapunov exponent.

    Attributes
    ----------
    value, error
        Exponent and its standard error (1/s), from the scatter of blocks; nan if the motion ended early.
    turn
        Mean duration of a turn of exciter 1 (s).
    steady
        Whether both halves of the measured growth give the same exponent.
    """

    value: float
    error: float
    turn: float
    steady: bool = True

    @property
    def sign(self) -> int:
        """1 or −1 if it differs from 0 by more than three errors and by MAX_ERROR_PER_TURN, otherwise 0."""
        clear = abs(self.value) > max(3.0 * self.error, MAX_ERROR_PER_TURN / self.turn)
        return int(math.copysign(1.0, self.value)) if clear else 0

    @property
    def enough(self) -> float:
        """Error that makes the sign clear, or the exponent as good as 0."""
        return max(MAX_RELATIVE_ERROR * abs(self.value), MAX_ERROR_PER_TURN / self.turn)


class GrowthSettings(NamedTuple):
    """How long growth is followed.

    Attributes
    ----------
    turns
        Turns of exciter 1 between two measurements.
    skipped
        Least number of first measurements that are not counted: see :func:`count_mixed`.
    least, most
        Smallest and largest number of the others; at least the largest of BLOCKS.
    """

    turns: int = 8
    skipped: int = 3
    least: int = 20
    most: int = 240


#: For the largest exponent alone.
LARGEST_EXPONENT = GrowthSettings()
#: For all exponents: measured each turn, so that those of quick decay are not lost in round-off.
ALL_EXPONENTS = GrowthSettings(1, 24, 288, 1920)


@validated(scene=SceneArgument)
def lyapunov(scene: Scene, state: npt.ArrayLike | None = None) -> pd.DataFrame:
    """Compute all Lyapunov exponents of a motion.

    The derivative of the return map carries orthogonal directions along, and their mean growth is measured. The
    computation ends when each error is below a sixth of its exponent or negligible, after 312 to 1944 turns.

    Parameters
    ----------
    scene
        Scene with a constant supply.
    state
        Full state on the attractor, shape (14,). Default: the final state of a run of the scene.

    Returns
    -------
    pandas.DataFrame
        One row per exponent, the largest first: ``exponent_per_s``, its standard error ``error_per_s``, and
        ``growth_per_turn``, the factor by which a distance grows in a mean turn of exciter 1. The exponent along the
        motion is 0. Exponents are −inf for gap and gap rate if the material is ever in contact for a while, and for
        directions that decay to less than 1e-13 in most turns.

    Raises
    ------
    vibroplat.errors.ConfigError
        The scene has a supply program, or the state does not fit it.
    vibroplat.errors.MotionError
        The motion ended early, or exciter 1 does not turn.
    """
    scene.require_orbits("a Lyapunov exponent")
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given; allowed for Lyapunov exponents: drive.supply_frequency_hz alone")
    spectrum = with_second_engine(scene, lambda tried: _spectrum(tried, state), errors=(MotionError,))
    spectrum.append(Exponent(0.0, 0.0, spectrum[0].turn))
    table = pd.DataFrame(
        {
            "exponent_per_s": [exponent.value for exponent in spectrum],
            "error_per_s": [exponent.error for exponent in spectrum],
            "growth_per_turn": [math.exp(exponent.value * exponent.turn) for exponent in spectrum],
        },
    ).sort_values("exponent_per_s", ascending=False, kind="stable")
    return table.set_index(pd.RangeIndex(1, len(spectrum) + 1, name="number"))


def _spectrum(scene: Scene, state: npt.ArrayLike | None) -> list[Exponent]:
    """Compute all exponents but that along the motion, which is 0 (:func:`lyapunov`)."""
    start = initial_condition(scene)
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion = (
            Simulator(scene, p, engine, *start[:3])
            if state is None
            else Simulator(scene, p, engine, full_state(state, scene))
        )
        if state is None:
            motion.to_time(motion.now + scene.run.duration_s)
        spectrum = exponents(motion, whole_section(scene), ALL_EXPONENTS)
        if math.isnan(spectrum[0].value):
            why = f"the motion ended early ({motion.outcome}): {motion.detail}" if motion.outcome != "ok" else ""
            raise MotionError(why or f"no Lyapunov exponents: exciter 1 stopped turning before {motion.now:.6g} s")
    return spectrum


def largest_exponent(
    scene: Scene, state: FloatArray, directions: FloatArray | None = None, effort: GrowthSettings = LARGEST_EXPONENT
) -> Exponent:
    """Estimate the largest Lyapunov exponent of the Poincaré map, and its error from its own scatter.

    Parameters
    ----------
    scene
        The scene.
    state
        Full state on the attractor, shape (14,).
    directions
        Directions whose growth is followed, in scaled units, shape (14, m). Default: N_FOLLOWED of the section.
    effort
        How long it is followed.
    """
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion = Simulator(scene, p, engine, state)
        estimates = exponents(
            motion, whole_section(scene)[:, :N_FOLLOWED] if directions is None else directions, effort, largest=True
        )
    return max(estimates, key=lambda exponent: exponent.value)


def whole_section(scene: Scene) -> FloatArray:
    """Return orthogonal directions that span the section, shape (14, m); none keeps to a symmetry.

    A direction that keeps to the symmetry of a motion cannot grow out of it before round-off has: the calibrated
    machine at 55 Hz, with mass ratio 0.2, took 150 turns.
    """
    indices = [index for index in state_places(scene).values() if index != _ANGLE]
    basis, random = np.zeros((FULL_SIZE, len(indices))), np.random.default_rng(0)
    start = np.column_stack([np.ones(len(indices)), random.standard_normal((len(indices), len(indices) - 1))])
    basis[indices] = np.linalg.qr(start)[0]
    return basis


def count_mixed(growth: FloatArray) -> int:
    """Return in how many first measurements directions still had a part of their neighbours.

    Parameters
    ----------
    growth
        Logarithms of the growth of the directions, shape (measurements, directions).
    """
    later = growth[len(growth) // 2 :]
    gaps = np.diff(np.sort(np.where(np.isneginf(later), math.log(MIN_GROWTH_RATIO), later).mean(axis=0)))
    limit = min(len(growth) // MIXED_MEASUREMENTS, len(growth) - BLOCKS[-1])
    waits = -math.log(MAX_MIXED_PART) / gaps[gaps > 0.0]
    return math.ceil(float(waits[waits <= limit].max(initial=0.0)))


def exponents(
    motion: Simulator, directions: FloatArray, effort: GrowthSettings, *, largest: bool = False
) -> list[Exponent]:
    """Follow the growth of directions from the next point of the section on; one exponent for each of them.

    Growth is added until all errors are small enough, or that of the largest exponent alone, or until the largest
    number is reached. Without a motion, all exponents are nan.
    """
    nothing = [Exponent(math.nan, math.nan, math.nan)] * directions.shape[1]
    if not motion.to_section(1, _max_time(motion, 1)):
        return nothing
    variation, scales = Variation(rough=largest), state_scales(motion.scene)[:, np.newaxis]
    basis, _ = np.linalg.qr(_on_section(directions))
    growth, seconds, forgotten = list[FloatArray](), list[float](), list[int]()
    spare = len(state_places(motion.scene)) - 1 - directions.shape[1]  # directions of the section that are not followed
    while True:
        for _ in range(effort.least + effort.skipped if not growth else MORE_MEASUREMENTS):
            grown = _grow(motion, variation, basis, scales, effort.turns)
            if grown is None:
                return nothing
            passed, basis, logarithms, count = grown
            growth.append(logarithms)
            seconds.append(passed)
            forgotten.append(count)
            if np.isneginf(logarithms).all():  # whatever begins nearby has merged with the motion
                return [Exponent(-math.inf, 0.0, passed / effort.turns)] * directions.shape[1]
        followed = np.array(growth)
        skipped = max(effort.skipped, count_mixed(followed[:, :2] if largest else followed))
        counted = np.array(seconds[skipped:])
        estimates = [_estimate(g, counted, effort.turns) for g in followed[skipped:].T]
        for index in range(1, 1 + max(forgotten[effort.skipped :]) - spare):  # the last directions grow least
            estimates[-index] = Exponent(-math.inf, 0.0, estimates[-index].turn)
        asked = [max(estimates, key=lambda exponent: exponent.value)] if largest else estimates
        if all(e.error <= e.enough for e in asked) or len(growth) >= effort.skipped + effort.most:
            return estimates


def _max_time(motion: Simulator, turns: int) -> float:
    """Time by which exciter 1 completes so many turns, if it turns at all (s)."""
    return (2 * turns + 2) * TURN / motion.scene.speed_scale


def _on_section(directions: FloatArray) -> FloatArray:
    """Return directions without their part in the angle of exciter 1."""
    projected = directions.copy()
    projected[_ANGLE] = 0.0
    return projected


def _grow(
    motion: Simulator, variation: Variation, basis: FloatArray, scales: FloatArray, turns: int
) -> tuple[float, FloatArray, FloatArray, int] | None:
    """Carry orthogonal directions on the section, in scales, along with the motion for some turns of exciter 1.

    Returns
    -------
    tuple
        The time passed (s), the directions made orthogonal again, the logarithms of their growth, −inf where it is
        lost, and how many directions were forgotten; None if the motion does not get there.
    """
    forgetting, begin = _LostRank(), motion.now
    variation.begin(basis * scales)
    if not motion.to_section(turns, _max_time(motion, turns), (variation, forgetting)):
        return None
    moved = variation.derivative(motion.automaton)[:, : basis.shape[1]] / scales
    along = variation.rates / scales[:, 0]
    basis, r = np.linalg.qr(_on_section(moved - np.outer(along, moved[_ANGLE]) / along[_ANGLE]))
    size = np.abs(np.diag(r))
    size[size <= MIN_GROWTH_RATIO * max(1.0, size.max())] = 0.0
    with np.errstate(divide="ignore"):
        return motion.now - begin, basis, np.log(size), forgetting.count


class _LostRank:
    """Observes a motion: counts the directions that it forgets."""

    def __init__(self) -> None:
        self.count = 0

    def read(self, h: Automaton) -> None:
        """Look at the events and where they lead."""
        events = h.events[: h.run["events"]]
        if h.run["mode"] == ATTACHED or (events["mode_after"] == ATTACHED).any():
            self.count = CONTACT_DIRECTIONS
        inelastic = (events["kind"] == IMPACT) & (events["rate_before"] < 0.0) & (events["rate_after"] == 0.0)
        self.count = max(self.count, INELASTIC_DIRECTIONS * int(inelastic.any()))


def _estimate(growth: FloatArray, seconds: FloatArray, turns: int) -> Exponent:
    """Return the mean growth per second and its standard error from the means of blocks."""
    turn = float(seconds.sum() / (turns * len(seconds)))
    lost = np.isneginf(growth)
    if 2 * lost.sum() > len(growth):
        return Exponent(-math.inf, 0.0, turn)
    growth = np.where(lost, math.log(MIN_GROWTH_RATIO), growth)
    errors = [_scatter(growth, seconds, count) for count in BLOCKS]
    if len(growth) >= MIN_SMOOTH_GROWTHS * BLOCKS[0]:
        lengths = np.diff([*_places(len(growth), BLOCKS[0]), len(growth)])
        weights = np.concatenate([_bump(count) for count in lengths])
        smooth = _scatter(weights * growth, weights * seconds, BLOCKS[0])
        if smooth < REGULAR_ERROR_RATIO * errors[0]:
            weights = _bump(len(growth))
            return Exponent(float(weights @ growth / (weights @ seconds)), smooth, turn)
    return Exponent(float(growth.sum() / seconds.sum()), max(errors), turn, _is_steady(growth, seconds))


def _is_steady(growth: FloatArray, seconds: FloatArray) -> bool:
    """Whether both halves of the growth have the same mean per second, within the scatter of their blocks."""
    half = len(growth) // 2
    means, errors = list[float](), list[float]()
    for part in (slice(half), slice(half, None)):
        means.append(float(growth[part].sum() / seconds[part].sum()))
        errors.append(max(_scatter(growth[part], seconds[part], count) for count in BLOCKS[:2]))
    return abs(means[1] - means[0]) <= MAX_HALF_DIFFERENCE * math.hypot(*errors)


def _scatter(growth: FloatArray, seconds: FloatArray, count: int) -> float:
    """Return the standard error of the mean growth per second from the means of so many blocks."""
    places = _places(len(growth), count)
    means = np.add.reduceat(growth, places) / np.add.reduceat(seconds, places)
    return float(means.std(ddof=1)) / math.sqrt(count)


def _places(total: int, count: int) -> list[int]:
    """Return where so many blocks of a number of values begin."""
    return [total * block // count for block in range(count)]


def _bump(count: int) -> FloatArray:
    """Return weights for so many values, which begin and end with all derivatives 0."""
    position = (np.arange(count) + 0.5) / count
    return np.asarray(np.exp(-1.0 / (position * (1.0 - position))))
