"""The branches of a sweep, the scenes of their points, and tables over swept keys."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import COUNT, FLAG, NUMBER, TEXT, Column, Columns, indexed_name, unit_of
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import given, quantity
from vibroplat.config.keys import key_of, keys, number_of
from vibroplat.config.plans import FREQUENCY, ParameterRange, SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, errors_about
from vibroplat.frames import add_descriptions
from vibroplat.hybrid.state import static_rest
from vibroplat.model.sensitivity import with_value
from vibroplat.model.systems import FULL_SIZE
from vibroplat.results import labels

#: Columns of supply and excitation frequency.
SUPPLY, EXCITATION = labels.SUPPLY, labels.EXCITATION

#: Columns of a branch, after the keys of the grid.
BRANCH: Columns = {
    "direction": Column(
        "direction of the branch", "up or down: each point starts from the final state of the previous point", kind=TEXT
    ),
    "branch": Column("number of the branch", kind=COUNT),
}
#: Types of columns in a DataFrame.
TYPES = {NUMBER: "float64", TEXT: "str", COUNT: "Int64", FLAG: "bool"}


@dataclass(frozen=True)
class SweepBranch:
    """One continued sweep.

    Attributes
    ----------
    number
        Its position in the sweep.
    direction
        ``up`` or ``down``.
    grid
        Dotted keys of the grid and their values on this branch.
    scene
        The scene at the first value.
    key_values
        Values of the swept key in the order of the branch.
    name
        Name under which its points are stored; its number where it has none.
    """

    number: int
    direction: str
    grid: dict[str, Any]
    scene: Scene
    key_values: tuple[float, ...]
    name: str = ""

    @property
    def chain(self) -> int | str:
        """The name of the chain of its stored points."""
        return self.name or self.number

    @property
    def plan(self) -> SweepPlan:
        """How its points settle and are measured."""
        plan: SweepPlan = self.scene.plan_of("sweep")
        return plan

    @cached_property
    def swept(self) -> str:
        """The key that varies along it."""
        return self.plan.swept.key

    def perturbation_key(self, value: float) -> tuple[int, ...]:
        """Return the numbers that, with the seed, determine the perturbation at a value of the swept key.

        They do not depend on the branch's place in its sweep, so that two sweeps give the same curve. Supply
        frequencies count by their µHz, other keys, which may be small, by all their bits.
        """
        number = round(1e6 * value) if self.swept == FREQUENCY else int(np.float64(value).view(np.uint64))
        return int(self.direction == "down"), number

    def at(self, point: int) -> Scene:
        """Return the scene of a point."""
        return scene_at(self.scene, self.swept, self.key_values[point])

    def begin(self, state: list[float] | None, point: int) -> list[float] | None:
        """Return the state with which a point begins from that with which the one before began or ended.

        The key may change the layers between the two.
        """
        same = state is None or point == 0 or not self.swept.startswith("material.")  # keys that make layers
        return state if same or state is None else convert_state(state, self.at(point - 1), self.at(point))


def scene_at(first: Scene, key: str, value: float) -> Scene:
    """Return the scene of a point of a branch; the supply frequencies of a plan need no second check."""
    return with_value(first, key.split("."), value) if key == FREQUENCY else first.replace({key: value})


def branches(scene: Scene) -> list[SweepBranch]:
    """List the branches of a scene's sweep: each combination of the grid (the first key is slowest), in each direction.

    Raises
    ------
    ConfigError
        The scene has no section ``sweep``, or a drive program, or begins where a run ended; or the key has no numbers,
        or a value of it or of the grid is not allowed.
    """
    plan: SweepPlan = scene.plan_of("sweep")
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given, but a sweep sets the supply itself; allowed: supply_frequency_hz")
    if scene.run.initial.from_ is not None:
        raise ConfigError(
            "run.initial.from is given, but a sweep cannot start from a run; allowed: run.initial.state, or phases"
        )
    upward = _values(scene, plan.swept)
    along = {"up": upward, "down": upward[::-1]}  # all branches share them
    planned: list[SweepBranch] = []
    for combination in itertools.product(*plan.grid.values()):
        values = dict(zip(plan.grid, combination, strict=True))
        placed = _replace_keys(scene, "grid", values)
        for value in upward if plan.over is not None else ():
            _replace_keys(placed, "over", {plan.swept.key: value})
        for direction in plan.swept.direction:
            first = placed.replace({plan.swept.key: along[direction][0]})
            planned.append(SweepBranch(len(planned), direction, values, first, along[direction]))
    return planned


def convert_state(state: Sequence[float], before: Scene, scene: Scene) -> list[float]:
    """Return a full state of another scene as one of this scene.

    Layers that only this scene has lie on the platform with their static sag; what it does not have is 0.
    """
    converted, rest = list(state), static_rest(scene).tolist()
    for i in {*before.coordinates} ^ {*scene.coordinates}:
        converted[i], converted[i + FULL_SIZE // 2] = rest[i], 0.0
    return converted


def _values(scene: Scene, over: ParameterRange) -> tuple[float, ...]:
    """Return the values of a key upward, as whole numbers where it has these.

    Raises
    ------
    ConfigError
        It is a key without numbers, or would put aside how the scene gives its motors; or values are too close.
    """
    key, section, numbers = over.key, over.key.partition(".")[0], number_of(over.key)
    values = tuple(over.upward)
    if numbers is None:
        if key not in keys():
            _replace_keys(scene, "over", {key: values[0]})
        raise ConfigError(f"sweep.over.key = {key} has no numbers; allowed: a key of numbers, as material.mass_ratio")
    given = next(name for name in ("exciters", "motors", "motor") if getattr(scene, name) is not None)
    if section in ("motor", "motors") and section != given != "motor":
        raise ConfigError(f"sweep.over.key = {key} but the scene has {given}; allowed: {given}.0.… or {given}.1.…")
    if len(set(values)) < len(values):
        raise ConfigError(f"sweep.over: {len(values)} values of {key} from {values[0]} to {values[-1]}; allowed: fewer")
    return tuple(int(v) if v.is_integer() else v for v in values) if numbers is int else values


def _replace_keys(scene: Scene, section: str, changes: Mapping[str, Any]) -> Scene:
    """Change keys of a scene; an error names the section of the sweep that asks for it."""
    with errors_about(f"sweep.{section}"):
        return scene.replace(changes)


def column_of(key: str) -> str:
    """Return the column of a key that varies along branches: its name, and that of the supply without its section."""
    return SUPPLY if key == FREQUENCY else key


def axis_name(key: str) -> str:
    """Return what a swept key is called in prints."""
    return "f_e" if key == SUPPLY else indexed_name(key)


def place_words(key: str, *values: float) -> str:
    """Say where points are, by the column of the swept key and its values there."""
    ends = " … ".join(dict.fromkeys(map(given, values))).replace("-", "−")
    name = "a supply of" if key == SUPPLY else indexed_name(key)
    return " ".join(part for part in (name, ends, unit_of(key)) if part)


def box_words(conditions: Mapping[str, Sequence[float]]) -> str:
    """Say between which values keys lie, each given by both and perhaps a number of values."""
    return ", ".join(place_words(key, *(float(f"{end:.4g}") for end in ends[:2])) for key, ends in conditions.items())


def measures_text(row: Mapping[str, Any], largest: float) -> str:
    """Write frequency, RMS of both coordinates and power of a motion; ``largest`` is the largest RMS beside it."""
    heights = [quantity(row.get(name), "m", largest=largest) for name in ("rms_y_m", "rms_x_m")]
    pace, power = quantity(row.get("excitation_frequency_hz"), "Hz"), quantity(row.get("motor_power_w"), "W")
    speed = row.get("conveying_speed_m_per_s")
    shaken = TURN * (row.get("excitation_frequency_hz") or 0.0) * largest
    moves = "" if speed is None else f", along the deck {quantity(speed, 'm/s', largest=shaken)}"
    return f"{pace}, RMS y {heights[0]}, x {heights[1]}, power {power}{moves}"


def study_table(
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[str],
    meant: Columns,
    grid: Mapping[str, Any] | None = None,
) -> pd.DataFrame:
    """Make a table whose column types do not depend on its rows.

    Columns without a description in ``meant`` are keys of the configuration. Columns of ``grid`` have the type of the
    grid's values.
    """
    about = {name: meant.get(name) or Column(key_of(name).meaning) for name in columns}
    types: dict[Any, Any] = {name: TYPES[column.kind] for name, column in about.items()}
    types |= {key: pd.Series(values).dtype for key, values in (grid or {}).items()}
    values = {name: _typed([row.get(name, math.nan) for row in rows], types[name]) for name in columns}
    return add_descriptions(pd.DataFrame(values, columns=list(columns)), about)


def _typed(values: list[Any], kind: Any) -> Any:
    """Return an array of one type of pandas; what numpy has by itself takes a tenth of the time."""
    return np.array(values, kind) if kind in (TYPES[NUMBER], TYPES[FLAG]) else pd.array(values, dtype=kind)
