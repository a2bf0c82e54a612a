"""The plans of sections ``sweep`` and ``orbits`` of a configuration."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from vibroplat.config.kinds import KINDS
from vibroplat.config.schema import MAX_SIZE, PERTURBATION, Fraction, Positive, Real, Section, described, short

#: Key of the supply frequency.
FREQUENCY = "drive.supply_frequency_hz"
#: Most points of a branch of a sweep, and of all its branches: a week of computing, or a slip of the keyboard.
MAX_POINTS, MAX_SWEEP_POINTS = 100_000, 1_000_000
#: Most combinations of the grid's values, of a sweep and of orbits.
MAX_BRANCHES, MAX_FAMILIES = 10_000, 1000

#: Default first and maximum step, and the minimum step, along branches of orbits, relative to the range of the key.
FIRST_STEP, MAX_STEP, MIN_STEP = 1.0 / 300.0, 1.0 / 40.0, 1e-8

#: Length of a branch over the whole range of its key, in the units of the unknowns.
BRANCH_LENGTH = 8.0

Direction = Literal["up", "down"]
#: Period of an orbit, in turns of exciter 1, and the largest residual of one.
Period = Annotated[int, Field(ge=1, le=64)]
OrbitTolerance = Annotated[float, Field(ge=1e-11, le=1e-4, allow_inf_nan=False)]
Boundary = Literal["fold", "period-doubling", "neimark-sacker", "branch-point", "liftoff", "end-of-sticking", "grazing"]


def _distinct(grid: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Refuse keys that are none of a scene, and values that are too large or given twice."""
    for key, values in grid.items():
        if not key.isascii():
            raise ValueError(f"{key!a} is not a key of a scene; allowed: keys of machine, material, …")
        if any(isinstance(value, int | float) and not abs(value) <= MAX_SIZE for value in values):
            raise ValueError(f"{key} = {short(values)}; allowed: numbers up to {MAX_SIZE:g}")
        if len(set(values)) < len(values):  # 0 and 0.0 are equal
            raise ValueError(f"{key} = {short(values)}; allowed: each value once")
    return grid


#: Dotted keys and their values.
Grid = Annotated[dict[str, Annotated[list[float | int | bool | str], Field(min_length=1)]], AfterValidator(_distinct)]


def _as_list(value: Any) -> Any:
    return ["up", "down"] if value == "both" else [value] if isinstance(value, str) else value


def _in_range(start: float, stop: float, step: float | None, direction: list[Direction]) -> None:
    """Refuse a range without values or with too many, and directions that are given twice (ValueError)."""
    if stop < start:
        raise ValueError(f"stop = {stop} is below start = {start}; allowed: at least start; see direction")
    if step is not None and (stop - start) / step >= MAX_POINTS:
        raise ValueError(f"step = {step} gives too many points; allowed: at most {MAX_POINTS} per branch")
    if len(set(direction)) < len(direction):
        raise ValueError(f"direction = {direction}; allowed: up and down, each once")


#: Directions along a branch.
Directions = Annotated[list[Direction], BeforeValidator(_as_list), Field(min_length=1, max_length=2)]


class ParameterRange(Section):
    """The values of a key along a branch, and its directions."""

    key: str = Field(description="dotted key of a number that varies along a branch; N stands for all places of a list")
    start: Real | None = Field(None, description="smallest value of the key")
    stop: Real | None = Field(None, description="largest value of the key; with step, included if whole steps reach it")
    step: Positive | None = Field(None, description="difference of neighbouring values")
    count: Annotated[int, Field(ge=1, le=MAX_POINTS)] | None = Field(
        None, description="number of values from start to stop, instead of step"
    )
    values: Annotated[list[Real], Field(min_length=1, max_length=MAX_POINTS)] | None = Field(
        None, description="list of values, instead of start, stop, step and count"
    )
    scale: Literal["linear", "log"] = Field("linear", description="count values with equal differences or ratios")
    direction: Directions = Field(["up"], description="up, down or both; one branch for each direction")

    alternatives = (("step", "count"), *((name, "values") for name in ("start", "stop", "step", "count")))

    @model_validator(mode="after")
    def _finite(self) -> Self:
        if self.values is None and (None in (self.start, self.stop) or self.step is self.count is None):
            raise ValueError("no range is given; allowed: start and stop with step or count, or values")
        start, stop = self.ends
        _in_range(start, stop, self.step, self.direction)
        if self.values is not None and len(set(self.values)) < len(self.values):  # 0 and 0.0 are equal
            raise ValueError(f"values = {short(self.values)}; allowed: each value once")
        if self.count is not None and (self.count == 1) != (start == stop):
            raise ValueError(
                f"count = {self.count} from {start} to {stop}; allowed: 1 if stop is start, else at least 2"
            )
        if self.scale == "log" and (start <= 0.0 or self.step is not None):
            problem = f"{start} is not above 0" if start <= 0.0 else f"step = {self.step} is no ratio"
            raise ValueError(f"scale = log but {problem}; allowed: values above 0, with count")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that are given."""
        ends = sorted(self.values or ()) or [end for end in (self.start, self.stop) if end is not None]
        return ends[0], ends[-1]

    @property
    def number(self) -> int:
        """How many values there are."""
        if self.step is None:
            return self.count or len(self.values or ())
        start, stop = self.ends
        return int((stop - start) / self.step * (1.0 + 1e-12) + 1e-9) + 1

    @property
    def upward(self) -> list[float]:
        """The values in ascending order; those between the ends are rounded as a user would write them."""
        if self.values is not None:
            return sorted(self.values)
        (start, stop), last = self.ends, max(self.number - 1, 1)
        step = (stop - start) / last if self.step is None else self.step
        places: Iterable[float] = (start + i * step for i in range(self.number))
        if self.scale == "log":
            places = (start * (stop / start) ** (i / last) for i in range(self.number))
        values = [0.0 if start < 0.0 and abs(value) < 1e-9 * step else float(f"{value:.12g}") for value in places]
        return values if self.count is None else [start, *values[1:-1], stop][: self.count]


class Frequencies(Section):
    """The supply frequencies of a branch, and its directions."""

    start: Positive = described(..., "f_e", "smallest supply frequency")
    stop: Positive = Field(description="largest supply frequency; included if whole steps reach it")
    step: Positive = described(0.5, "", "difference of neighbouring supply frequencies")
    direction: Directions = Field(["up"], description="up, down or both; one branch for each direction")

    @model_validator(mode="after")
    def _finite(self) -> Self:
        _in_range(self.start, self.stop, self.step, self.direction)
        return self

    @property
    def over(self) -> ParameterRange:
        """The range of ``drive.supply_frequency_hz`` that it stands for."""
        return ParameterRange.model_construct(key=FREQUENCY, **dict(self))


def may_vary(key: str) -> bool:
    """Whether a sweep may give a key of a scene values of its own."""
    section = key.partition(".")[0]
    return key == FREQUENCY or section not in (*KINDS, "name", "output", "run", "drive")


class SweepPlan(Section, title="Sweep"):
    """Branches side by side: every combination of the grid's values, in each direction."""

    supply_frequency_hz: Frequencies | None = Field(None, description="supply frequencies of each branch")
    over: ParameterRange | None = Field(None, description="values of another key, instead of supply_frequency_hz")
    grid: Grid = Field({}, description="dotted keys and their values; one branch for each combination")
    kind: Literal["response", "bifurcation", "map"] = Field(
        "response",
        description="response: curves over the swept key; bifurcation: also points of the Poincaré section and "
        "impact speeds; map: regimes over the swept key and one key of the grid",
    )
    settle_by: Literal["newton", "section"] = Field(
        "newton",
        description="newton: settled once the motion is shown to converge to a stable periodic orbit, which "
        "Newton's method finds and which is then measured; section: settled once the Poincaré section repeats",
    )
    max_settle_s: Positive = described(150.0, "", "maximum settling time; aperiodic motion settles this long")
    settle_tolerance: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)] = Field(
        1e-3, description="distance from the steady motion at which settling ends (scaled units)"
    )
    measure_s: Positive = described(
        2.0,
        "",
        "measuring interval of each point; aperiodic motion is measured 24 times as long, and 72 times once more if it "
        "changes meanwhile",
    )
    perturbation: Fraction = described(
        PERTURBATION, "", "random change of the rates of platform and exciters at each point (scaled units)"
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the perturbations")
    lyapunov: bool = described(
        True,
        "",
        "distinguish chaotic from quasi-periodic by the largest Lyapunov exponent; false: both are non-periodic",
    )

    alternatives = (("supply_frequency_hz", "over"),)

    @model_validator(mode="after")
    def _scene_keys(self) -> Self:
        if "swept" in self.__dict__:  # checked with another scene, of which this one is a change
            return self
        count = math.prod(map(len, self.grid.values()))
        if count > MAX_BRANCHES:
            raise ValueError(f"grid gives {count} combinations; allowed: at most {MAX_BRANCHES}")
        if self.supply_frequency_hz is None and self.over is None:
            raise ValueError("supply_frequency_hz and over are not given; allowed: one of the two")
        swept = self.swept
        each, ways = swept.number, len(swept.direction)
        if each * ways * count > MAX_SWEEP_POINTS:
            times = f"{count} × {ways} branches of {each} points"
            raise ValueError(f"{times} are {each * ways * count}; allowed: at most {MAX_SWEEP_POINTS}")
        for key in self.grid:
            if not may_vary(key) or key == FREQUENCY == swept.key:
                raise ValueError(f"grid.{key} cannot be swept by the grid; allowed: keys of machine, material, …")
            if key == swept.key:
                raise ValueError(f"grid.{key} is the key of over; allowed: another key")
        if not may_vary(swept.key):
            raise ValueError(f"over.key = {swept.key!a} cannot be swept; allowed: keys of machine, material, …")
        several = [values for values in self.grid.values() if len(values) > 1]
        if self.kind == "map" and (len(several) != 1 or any(isinstance(v, str | bool) for v in several[0])):
            raise ValueError("kind = map needs exactly one grid key with several numbers")
        return self

    @classmethod
    def of_motion(cls, **settings: Any) -> Self:
        """Return the plan by which a single motion settles and is measured."""
        return cls(supply_frequency_hz=Frequencies(start=1.0, stop=1.0), **settings)

    @cached_property
    def swept(self) -> ParameterRange:
        """The key along each branch, its values and the directions."""
        if self.over is not None:
            return self.over
        assert self.supply_frequency_hz is not None  # ensured by the validator
        return self.supply_frequency_hz.over


class StepPlan(Section, title="Step"):
    """Steps along a branch, as changes of the key."""

    first: Positive | None = Field(None, description="first step; default: 1/300 of the range")
    max: Positive | None = Field(None, description="maximum step; default: 1/40 of the range")

    def lengths(self, span: float) -> tuple[float, float, float]:
        """First, largest and smallest step for a range of the key; with still smaller ones a branch ends."""
        largest = MAX_STEP * span if self.max is None else self.max
        first = min(FIRST_STEP * span, largest) if self.first is None else self.first
        return first, largest, min(MIN_STEP * span, first)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.first is not None and self.max is not None and self.first > self.max:
            raise ValueError(f"first = {self.first} is above max = {self.max}; allowed: at most max")
        return self


class _VariedKey(Section):
    """A key that varies over a range."""

    key: str
    start: Real
    stop: Real

    @model_validator(mode="after")
    def _is_range(self) -> Self:
        if self.start == self.stop:
            raise ValueError(f"stop = {self.stop} is start; allowed: another value")
        return self

    @property
    def unit(self) -> float:
        """Unit of the key among the unknowns of an orbit."""
        return abs(self.stop - self.start) / BRANCH_LENGTH


class BoundariesPlan(_VariedKey, title="Boundaries"):
    """Curves of special points over the key and a second one."""

    key: str = Field(description="dotted key of the second parameter")
    start: Real = Field(description="one end of the range of the second key; the range contains the scene's own value")
    stop: Real = Field(description="other end of the range of the second key")
    kinds: Annotated[list[Boundary], Field(min_length=1)] | None = Field(
        None, description="kinds of special points to continue as curves; default: all kinds on the branches"
    )
    step: StepPlan = Field(StepPlan(), description="steps along the curves, as changes of the second key")
    max_points: Annotated[int, Field(ge=2, le=10_000)] = Field(100, description="maximum of points in each direction")


class OrbitsPlan(_VariedKey, title="Orbits", populate_by_name=True):
    """Branches of periodic orbits over a key of the scene."""

    key: str = Field(description="dotted key that varies along a branch, e.g. drive.supply_frequency_hz")
    start: Real = Field(description="value of the key from which the first branch starts")
    stop: Real = Field(description="other end of the range of the key; branches end at start and stop")
    step: StepPlan = StepPlan()
    period: Period = Field(1, description="period of the first orbit, in turns of exciter 1")
    from_: Annotated[str, Field(min_length=1)] = Field(
        "settled",
        alias="from",
        description="initial guess of the first orbit: settled (the motion after a transient), state "
        "(run.initial.state), or the directory of a run",
    )
    max_points: Annotated[int, Field(ge=2, le=100_000)] = Field(1000, description="maximum of points of a branch")
    max_branches: Annotated[int, Field(ge=1, le=1000)] = Field(
        20, description="maximum number of branches for each combination of the grid's values"
    )
    tolerance: OrbitTolerance = Field(
        1e-8, description="largest residual of an orbit (scaled units); the solver's tolerance is at most a tenth of it"
    )
    switch: list[Literal["branch-point", "period-doubling"]] = Field(
        ["branch-point"], description="kinds of special points at which new branches are continued"
    )
    grid: Grid = Field({}, description="dotted keys and their values; branches for each combination of them")
    boundaries: BoundariesPlan | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if math.prod(map(len, self.grid.values())) > MAX_FAMILIES:
            raise ValueError(f"grid gives more than {MAX_FAMILIES} combinations")
        for key in self.grid:
            if key == self.key or key.split(".")[0] in (*KINDS, "name", "output"):
                raise ValueError(f"grid.{key} cannot be varied by the grid; allowed: keys of machine, material, …")
        if self.boundaries is not None and self.boundaries.key == self.key:
            raise ValueError(f"boundaries.key = {self.key} is key; allowed: another key")
        return self

    @property
    def range(self) -> tuple[float, float]:
        """Minimum and maximum of the key."""
        return min(self.start, self.stop), max(self.start, self.stop)

    def covers(self, value: float) -> bool:
        """Whether a value of the key is in its range."""
        low, high = self.range
        return low <= value <= high
