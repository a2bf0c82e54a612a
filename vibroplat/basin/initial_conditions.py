"""The starts of a question about basins: places of a grid, and random numbers in the ranges without one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import INITIAL_PREFIX, PHASES, BasinsPlan
from vibroplat.errors import ConfigError
from vibroplat.hybrid.state import initial_state, perturb_state
from vibroplat.kernels.compiled import FloatArray

_STATE = {f"{INITIAL_PREFIX}state.{name}": place for place, name in enumerate((*COORDINATES, *RATES))}


def key_values(plan: BasinsPlan, numbers: Iterable[int]) -> FloatArray:
    """Return the values of the keys of some starts, shape (starts, keys).

    Starts next to each other in number are far apart on the grid, so that few of them tell of all basins. Those at
    random are the same whatever their number is.
    """
    rows = np.fromiter(numbers, dtype=np.int64)
    found = np.empty((rows.size, len(plan.initial_conditions)))
    places = np.unravel_index(rows * _stride(plan) % math.prod(plan.shape), plan.shape) if plan.shape else ()
    random = [key for key, ends in plan.initial_conditions.items() if len(ends) == 2]
    drawn = np.array([_draw(plan.seed, len(random), int(row)) for row in rows]).reshape(rows.size, len(random))
    grids, draws = iter(places), iter(drawn.T)
    for column, (low, high, *count) in enumerate(plan.initial_conditions.values()):
        shares = next(grids) / (count[0] - 1.0) if count else next(draws)
        found[:, column] = low + shares * (high - low)
    return found


def _stride(plan: BasinsPlan) -> int:
    """Return how far apart neighbours in number are on the grid: about 0.618 of it, without a common divisor."""
    cells = math.prod(plan.shape)
    stride = max(round(0.618034 * cells), 1)
    while math.gcd(stride, cells) > 1:
        stride += 1
    return stride


def _draw(seed: int, count: int, number: int) -> FloatArray:
    """Draw the random numbers of a start."""
    return np.random.Generator(np.random.PCG64(seed).advance(number * count)).random(count)


def initial_states(scene: Scene, plan: BasinsPlan, numbers: Sequence[int]) -> FloatArray:
    """Return the full states of some starts, shape (starts, 14)."""
    keys, initial, share = list(plan.initial_conditions), scene.run.initial, scene.start_perturbation
    found = []
    for number, values in zip(numbers, key_values(plan, numbers).tolist(), strict=True):
        given = dict(zip(keys, values, strict=True))
        phases = {name: given[INITIAL_PREFIX + name] for name in PHASES if INITIAL_PREFIX + name in given}
        state = initial_state(scene, initial.model_copy(update=phases))
        state = perturb_state(state, scene, share, (plan.seed, number))
        for key, place in _STATE.items():
            state[place] = given.get(key, state[place])
        found.append(state)
    return np.array(found)


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
        try:
            begins = begins.replace(phases)
            scene.replace({key: value for key, value in values.items() if key in _STATE})
        except ConfigError as error:
            raise ConfigError(f"basins.initial_conditions: {error}") from None
    return begins
