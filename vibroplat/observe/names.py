"""Names of states and of their derivatives, as in the columns of the trajectory table."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import FULL_SIZE


def state_places(scene: Scene) -> dict[str, int]:
    """Places in the full state of what a scene has: its coordinates, then their rates, by their names."""
    return {names[i]: half + i for half, names in ((0, COORDINATES), (7, RATES)) for i in scene.coordinates}


def named_state(state: FloatArray, scene: Scene) -> pd.Series[float]:
    """Name the numbers of a full state, shape (14,)."""
    places = state_places(scene)
    return pd.Series(state[list(places.values())], index=list(places))


def named_derivative(derivative: FloatArray, scene: Scene, keys: Sequence[str]) -> pd.DataFrame:
    """Name rows and columns of a full state's derivative by another and by keys, shape (14, 14 + keys)."""
    places = state_places(scene)
    rows = list(places.values())
    columns = [*rows, *range(FULL_SIZE, FULL_SIZE + len(keys))]
    return pd.DataFrame(derivative[rows][:, columns], index=list(places), columns=[*places, *keys])
