"""The plan of a calibration: the parameters, their ranges and the length of the search."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from vibroplat.config.overrides import flat
from vibroplat.config.reader import load_tree
from vibroplat.config.schema import Real, Section, explain
from vibroplat.errors import ConfigError
from vibroplat.paper.trial import IMPACT, paper_scene

#: Smallest population that differential evolution allows.
LEAST_POPULATION = 5
#: Share of a linear range below which a value counts as 0: rounding leaves so much of a low end of 0.
ZERO = 1e-9


class Range(Section):
    """The range in which a parameter is searched."""

    low: Real
    high: Real
    scale: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"high = {self.high} is not above low = {self.low}")
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f"low = {self.low}; allowed: more than 0 with scale = log")
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Both ends on the scale of the search."""
        return self.place(self.low), self.place(self.high)

    def place(self, value: float) -> float:
        """Return a value on the scale of the search."""
        return math.log10(value) if self.scale == "log" else value

    def value(self, x: float) -> float:
        """Return the value at a place on the scale of the search, to five digits."""
        if self.scale == "log":
            x = 10.0**x
        elif abs(x) < ZERO * (self.high - self.low):
            x = 0.0
        return float(f"{x:.5g}")


class Confirm(Section):
    """Section ``calibration.confirm``: how many of the best sets are judged again, and with how many other seeds."""

    sets: Annotated[int, Field(ge=0, le=10_000)] = 0
    seeds: Annotated[int, Field(ge=1, le=1_000)] = 3


class CalibrationPlan(Section):
    """Section ``calibration``: the parameters and the length of the search.

    Each start is a separate search, with the seeds ``seed``, ``seed + 1``, …; ``begin`` lists sets of parameters that
    are in the first population of each start.
    """

    parameters: Annotated[dict[str, Range], Field(min_length=1)]
    starts: Annotated[int, Field(ge=1, le=1_000)] = 1
    population_per_parameter: Annotated[int, Field(ge=2, le=1_000)] = 8
    generations: Annotated[int, Field(ge=0, le=10_000)] = 6
    seed: Annotated[int, Field(ge=0)] = 0
    begin: Annotated[list[dict[str, Real]], Field(default_factory=list)]
    confirm: Confirm = Confirm()

    @model_validator(mode="after")
    def _begin_fits(self) -> Self:
        for number, chosen in enumerate(self.begin):
            for key, value in chosen.items():
                r = self.parameters.get(key)
                if r is None:
                    raise ValueError(f"begin.{number}: unknown key {key}; allowed: {', '.join(self.parameters)}")
                if not r.low <= value <= r.high:
                    raise ValueError(
                        f"begin.{number}.{key} = {value}; allowed: {r.low} … {r.high}, where it is searched"
                    )
            missing = [key for key in self.parameters if key not in chosen]
            if missing:
                raise ValueError(f"begin.{number}: no {missing[0]}; allowed: a value of each parameter")
        if len(self.begin) > self.population:
            raise ValueError(f"begin holds {len(self.begin)} sets; allowed: {self.population}, the population")
        return self

    @property
    def population(self) -> int:
        """Number of candidates in a generation."""
        return max(LEAST_POPULATION, self.population_per_parameter * len(self.parameters))

    @property
    def evaluations(self) -> int:
        """Number of evaluations in all starts."""
        return self.starts * self.population * (self.generations + 1)

    @property
    def confirmations(self) -> int:
        """Largest number of evaluations in the confirmation."""
        return min(self.confirm.sets, self.evaluations) * self.confirm.seeds

    @property
    def side_by_side(self) -> int:
        """Largest number of evaluations that do not depend on one another."""
        return max(self.population, self.confirmations)


def load_plan(
    path: Path, overrides: Mapping[str, Any], changes: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], CalibrationPlan]:
    """Read the machine's fixed numbers (dotted keys and values) and the plan from a YAML file.

    ``overrides`` are keys of the plan, ``changes`` dotted keys of the machine.

    Raises
    ------
    ConfigError
        A key or value is not allowed.
    """
    tree = load_tree(path)
    section = tree.pop("calibration", None)
    if section is None:
        raise ConfigError(f"{path}: no section calibration; allowed: calibration: {{parameters: …}}")
    if not isinstance(section, dict):
        raise ConfigError(f"{path}: calibration = {section!r}; allowed: a section of keys and values")
    fixed = {**flat(tree), **(changes or {})}
    try:
        plan = CalibrationPlan.model_validate({**section, **overrides})
    except ValidationError as error:
        raise ConfigError(f"{path}: calibration: {explain(error, CalibrationPlan)}") from None
    for end in ("low", "high"):  # keys and values that no scene takes are refused before the search
        paper_scene(IMPACT[0], fixed | {key: getattr(r, end) for key, r in plan.parameters.items()})
    return fixed, plan
