"""The plan of branches of periodic orbits, section ``orbits`` of a configuration."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from vibroplat.config.fields import Positive, Real, Section, not_bool
from vibroplat.config.messages import short

#: Most combinations of the grid's values.
MAX_COMBINATIONS = 1000

#: Lengths of steps that are not given, over the range of the key: the first, the largest, the least.
FIRST, LARGEST, LEAST = 1.0 / 300.0, 1.0 / 40.0, 1e-8

#: What a branch over the range of its key is long in units of the unknowns.
UNITS = 8.0

Switch = Literal["branch-point", "period-doubling"]
Boundary = Literal["fold", "period-doubling", "neimark-sacker", "branch-point", "liftoff", "end-of-sticking", "grazing"]


class StepPlan(Section, title="Step"):
    """Steps along a branch, as changes of the key."""

    first: Positive | None = Field(None, description="first step; not given: a 300th of the range")
    largest: Positive | None = Field(None, description="largest change of the key in a step; not given: a 40th")
    least: Positive | None = Field(None, description="step below which a branch ends; not given: 1e-8 of the range")

    def lengths(self, span: float) -> tuple[float, float, float]:
        """First, largest and least step for a range of the key."""
        largest = LARGEST * span if self.largest is None else self.largest
        first = min(FIRST * span, largest) if self.first is None else self.first
        return first, largest, min(LEAST * span, first) if self.least is None else self.least

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.first is not None and self.largest is not None and self.first > self.largest:
            raise ValueError(f"first = {self.first} is above largest = {self.largest}; allowed: at most largest")
        if self.least is not None and any(s is not None and self.least > s for s in (self.first, self.largest)):
            raise ValueError(f"least = {self.least} is above first or largest; allowed: at most these")
        return self


class BoundariesPlan(Section, title="Boundaries"):
    """Curves of special points over the key and a second one."""

    key: str = Field(description="dotted second key")
    start: Real = Field(description="one end of its range, which holds the scene's own value")
    stop: Real = Field(description="the other end")
    kinds: Annotated[list[Boundary], Field(min_length=1)] | None = Field(
        None, description="kinds of special points that are followed; not given: all that the branches have"
    )
    step: StepPlan = Field(StepPlan(), description="steps along the curves, as changes of the second key")
    max_points: Annotated[int, BeforeValidator(not_bool), Field(ge=2, le=10_000)] = Field(
        100, description="most points of a curve to either side"
    )
    check: Annotated[int, BeforeValidator(not_bool), Field(ge=0, le=1000)] = Field(
        5, description="points of each curve on both sides of which motion settles, to check the curve"
    )

    @model_validator(mode="after")
    def _range(self) -> Self:
        if self.start == self.stop:
            raise ValueError(f"stop = {self.stop} is start; allowed: another value")
        return self

    @property
    def unit(self) -> float:
        """Unit of the second key among the unknowns of an orbit."""
        return abs(self.stop - self.start) / UNITS


class OrbitsPlan(Section, title="Orbits", populate_by_name=True):
    """Branches of periodic orbits over a key of the scene."""

    key: str = Field(description="dotted key that varies along a branch, e.g. drive.supply_frequency_hz")
    start: Real = Field(description="value of the key where the first branch begins")
    stop: Real = Field(description="value where branches end, as they do at start")
    step: StepPlan = StepPlan()
    period: Annotated[int, BeforeValidator(not_bool), Field(ge=1, le=64)] = Field(
        1, description="turns of exciter 1 after which the first orbit repeats"
    )
    from_: Annotated[str, Field(min_length=1)] = Field(
        "settled",
        alias="from",
        description="where the search for the first orbit begins: settled (after a transient), "
        "state (run.initial.state), or the directory of a run",
    )
    max_points: Annotated[int, BeforeValidator(not_bool), Field(ge=2, le=100_000)] = Field(
        1000, description="most points of a branch"
    )
    max_branches: Annotated[int, BeforeValidator(not_bool), Field(ge=1, le=1000)] = Field(
        20, description="most branches for each combination of the grid's values"
    )
    tolerance: Annotated[float, Field(ge=1e-11, le=1e-4, allow_inf_nan=False)] = Field(
        1e-8, description="residual of an orbit, in the scales of the scene; the solver's tolerance is a tenth or less"
    )
    switch: list[Switch] = Field(["branch-point"], description="special points at which new branches are followed")
    grid: dict[str, Annotated[list[float | int | bool | str], Field(min_length=1)]] = Field(
        {}, description="dotted keys and their values; branches for each combination"
    )
    boundaries: BoundariesPlan | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.start == self.stop:
            raise ValueError(f"stop = {self.stop} is start; allowed: another value")
        if math.prod(map(len, self.grid.values())) > MAX_COMBINATIONS:
            raise ValueError(f"grid gives more than {MAX_COMBINATIONS} combinations")
        for key in self.grid:
            if key == self.key or key.split(".")[0] in ("sweep", "orbits", "name", "output"):
                raise ValueError(f"grid.{key} cannot be varied by the grid; allowed: keys of machine, material, …")
            if len(set(self.grid[key])) < len(self.grid[key]):  # 0 and 0.0 are equal
                raise ValueError(f"grid.{key} = {short(self.grid[key])}; allowed: each value once")
        if self.boundaries is not None and self.boundaries.key == self.key:
            raise ValueError(f"boundaries.key = {self.key} is key; allowed: another key")
        return self

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest value of the key."""
        return min(self.start, self.stop), max(self.start, self.stop)

    def covers(self, value: float) -> bool:
        """Whether a value of the key is in its range."""
        low, high = self.range
        return low <= value <= high

    @property
    def unit(self) -> float:
        """Unit of the key among the unknowns of an orbit."""
        return abs(self.stop - self.start) / UNITS
