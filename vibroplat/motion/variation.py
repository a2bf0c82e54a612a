"""The derivative of a motion's end by its start and by keys of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.arguments import Keys, validated
from vibroplat.config.engine_choice import with_second_engine
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.config.schema import Positive, short
from vibroplat.errors import ConfigError, MotionError
from vibroplat.frames import pd
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.sensitivity import parameter_direction
from vibroplat.model.systems import FULL_SIZE
from vibroplat.motion.initial_condition import Start, initial_condition
from vibroplat.motion.motion import Simulator
from vibroplat.observe.tables import named_derivative, state_places
from vibroplat.observe.variation import Variation

#: Sections whose keys leave the supply alone, which a program changes from time to time.
_BESIDE_THE_SUPPLY = ("machine", "springs", "material", "contact")


class Varied(NamedTuple):
    """Where a motion ends, and how that depends on its start and on keys.

    Attributes
    ----------
    state
        State at the end by the names of the trajectory table, the exciter angles with all their turns.
    derivative
        Its derivative: a row for each of its numbers, a column for each number of the start and for each key.
    """

    state: pd.Series[float]
    derivative: pd.DataFrame


@validated(scene=SceneArgument, seconds=Positive | None, keys=Keys)
def variation(
    scene: Scene,
    state: pd.Series[float] | npt.ArrayLike | None = None,
    seconds: float | None = None,
    keys: str | Sequence[str] = (),
) -> Varied:
    """Integrate a motion with the derivatives of its state by the initial state and by keys of the scene.

    The variational equations are solved with saltation matrices at liftoffs, impacts and chatters. Derivatives are at a
    fixed time; derivatives by keys are at a fixed initial state. An initial state in contact cannot vary in gap and gap
    rate: these columns are 0.

    Parameters
    ----------
    scene
        Scene; with a supply program the motion starts at 0 s.
    state
        Initial state: named as :attr:`Varied.state`, or a full state, shape (14,). Default: that of a run.
    seconds
        Duration (s). Default: ``run.duration_s``.
    keys
        Dotted keys with continuous values, as ``drive.supply_frequency_hz``.

    Raises
    ------
    vibroplat.errors.ConfigError
        A key cannot be varied, the state does not fit the scene, or the duration is not positive.
    vibroplat.errors.MotionError
        The motion ended early.
    """
    keys = key_tuple(keys)
    return with_second_engine(scene, lambda tried: _vary(tried, state, seconds, keys), errors=(MotionError,))


def _vary(
    scene: Scene, state: pd.Series[float] | npt.ArrayLike | None, seconds: float | None, keys: Sequence[str]
) -> Varied:
    """Integrate a motion with its derivatives, by one engine (:func:`variation`)."""
    observer = Variation(parameter_directions(scene, keys))
    start = initial_condition(scene) if state is None else Start(full_state(state, scene))
    p = parameters(scene, start.time)
    with closing(make_engine(scene, p)) as engine:
        motion = Simulator(scene, p, engine, start.state, start.time, start.mode)
        motion.to_time(motion.now + (scene.run.duration_s if seconds is None else seconds), [observer])
        if motion.outcome != "ok":
            raise MotionError(f"the motion ended early ({motion.outcome}): {motion.detail}")
        derivative = named_derivative(observer.derivative(motion.automaton), scene, keys)
        places = state_places(scene)
        end = pd.Series(motion.state[list(places.values())], index=list(places))
        return Varied(end, derivative)


def key_tuple(keys: str | Sequence[str]) -> tuple[str, ...]:
    """Return keys as a tuple, also a single one."""
    return (keys,) if isinstance(keys, str) else tuple(keys)


def parameter_directions(scene: Scene, keys: Sequence[str]) -> list[Parameters]:
    """Differentiate the parameters of a scene by keys that may be varied together.

    Raises
    ------
    vibroplat.errors.ConfigError
        One of them cannot be varied.
    """
    scene.require_orbits("the derivative of a motion")
    for key in keys:
        if scene.drive.program is not None and key.partition(".")[0] not in _BESIDE_THE_SUPPLY:
            raise ConfigError(
                f"{key} cannot be varied under a drive.program; allowed: a key in {', '.join(_BESIDE_THE_SUPPLY)}"
            )
    return [parameter_direction(scene, key) for key in keys]


def full_state(state: pd.Series[float] | npt.ArrayLike, scene: Scene) -> FloatArray:
    """Return a state of the scene as a full state; raises ConfigError."""
    full, places = np.zeros(FULL_SIZE), state_places(scene)
    if not isinstance(state, pd.Series):
        try:
            full = np.array(state, dtype=float)
        except (TypeError, ValueError):
            raise ConfigError(f"state = {short(state)}; allowed: {FULL_SIZE} numbers") from None
        if full.shape != (FULL_SIZE,):
            raise ConfigError(f"state has the shape {full.shape}; allowed: ({FULL_SIZE},), a full state")
    elif set(state.index) != set(places):
        names = ", ".join(map(str, state.index))
        raise ConfigError(f"state has the names {names}; allowed for this scene: {', '.join(places)}")
    else:
        full[list(places.values())] = state[list(places)]
    if not np.isfinite(full).all():
        raise ConfigError(f"state = {short(full.tolist())}; allowed: finite numbers")
    return full
