"""The starts of a question about basins: places of a grid, and random numbers in the ranges without one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from vibroplat.config.coordinates import ALONG, COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.config.sections import PHASES, exciter_angles
from vibroplat.config.study_plans import INITIAL_PREFIX, BasinsPlan
from vibroplat.errors import ConfigError, errors_about
from vibroplat.hybrid.state import initial_state, perturb_states
from vibroplat.kernels.compiled import FloatArray

_STATE = {f"{INITIAL_PREFIX}state.{name}": index for index, name in enumerate((*COORDINATES, *RATES, *ALONG))}


def key_values(plan: BasinsPlan, numbers: Iterable[int]) -> FloatArray:
    """Return the values of the keys of some starts, shape (starts, keys).

    Starts next to each other in number are far apart on the grid, so that few of them tell of all basins. Those at
    random are the same whatever their number is.
    """
    rows = np.fromiter(numbers, dtype=np.int64)
    values = np.empty((rows.size, len(plan.initial_conditions)))
    places = np.unravel_index(rows * _stride(plan) % math.prod(plan.shape), plan.shape) if plan.shape else ()
    random = [key for key, ends in plan.initial_conditions.items() if len(ends) == 2]
    first, last = (int(rows.min()), int(rows.max())) if rows.size else (0, -1)
    generator = np.random.Generator(np.random.PCG64(plan.seed).advance(first * len(random)))
    drawn = generator.random((last - first + 1, len(random)))[rows - first]
    grids, draws = iter(places), iter(drawn.T)
    for column, (low, high, *count) in enumerate(plan.initial_conditions.values()):
        fractions = next(grids) / (count[0] - 1.0) if count else next(draws)
        values[:, column] = low + fractions * (high - low)
    return values


def _stride(plan: BasinsPlan) -> int:
    """Return how far apart neighbours in number are on the grid: about 0.618 of it, without a common divisor."""
    cells = math.prod(plan.shape)
    stride = max(round(0.618034 * cells), 1)
    while math.gcd(stride, cells) > 1:
        stride += 1
    return stride


def initial_states(scene: Scene, plan: BasinsPlan, numbers: Sequence[int]) -> FloatArray:
    """Return the full states of some starts, shape (starts, 14), with transport (starts, 16)."""
    initial, values = scene.run.initial, key_values(plan, numbers)
    states = np.tile(initial_state(scene, initial), (len(values), 1))
    if initial.state is None:
        speeds = initial_state(scene, initial.model_copy(update={"speed_ratio": 1.0}))[10:12]
        named = {name: getattr(initial, name) for name in PHASES}
        for state, row in zip(states, values.tolist(), strict=True):
            given = dict(zip(plan.initial_conditions, row, strict=True))
            angle, phi1, ratio = (given.get(INITIAL_PREFIX + name, own) for name, own in named.items())
            state[3:5] = exciter_angles(angle, phi1, ratio, scene.phase_weights[1], scene.hanging_angle)
            state[10:12] = ratio * speeds
    states = perturb_states(states, scene, scene.start_perturbation, [(plan.seed, number) for number in numbers])
    for column, key in enumerate(plan.initial_conditions):
        if key in _STATE:
            states[:, _STATE[key]] = values[:, column]
    return states


def validated_base_scene(scene: Scene, plan: BasinsPlan) -> Scene:
    """Return the scene as its starts begin, once the ends of their ranges have been found possible.

    Raises
    ------
    ConfigError
        A start is outside the model: the key, its value and what is allowed.
    """
    initial = scene.run.initial
    given = [name for name, value in (("state", initial.state), ("from", initial.from_)) if value is not None]
    if "from" in given or (given and not plan.initial_conditions.keys() <= _STATE.keys()):
        allowed = "keys of state" if given == ["state"] else "phases, or state"
        raise ConfigError(f"basins.initial_conditions: run.initial.{given[0]} is given; allowed: {allowed}")
    begins = scene
    for end in (0, 1):
        values = {key: ends[end] for key, ends in plan.initial_conditions.items()}
        phases = {key: value for key, value in values.items() if key not in _STATE}
        with errors_about("basins.initial_conditions"):
            begins = begins.replace(phases)
            scene.replace({key: value for key, value in values.items() if key in _STATE})
    return begins
