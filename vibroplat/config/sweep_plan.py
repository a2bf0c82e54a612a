"""The plan of a sweep, section ``sweep`` of a configuration: its branches and how each point is measured."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from vibroplat.config.fields import LARGEST, LEAST, PERTURBATION, Positive, Section, Share, described
from vibroplat.config.messages import short

Direction = Literal["up", "down"]

#: Most points of a branch.
MAX_FREQUENCIES = 100_000
#: Most combinations of the grid's values.
MAX_COMBINATIONS = 10_000


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _settling(value: Any) -> Any:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if value != "auto" and not (is_number and LEAST <= value <= LARGEST):
        raise PydanticCustomError("literal_error", "no time", {"expected": "auto, or a number above 0"})
    return value


class Frequencies(Section):
    """The supply frequencies of a branch, and its directions."""

    start: Positive = described(..., "f_e", "smallest supply frequency")
    stop: Positive = Field(description="largest supply frequency; included if whole steps reach it")
    step: Positive = described(0.5, "", "distance of supply frequencies")
    direction: Annotated[list[Direction], BeforeValidator(_as_list), Field(min_length=1, max_length=2)] = Field(
        ["up"], description="up, down or both, a branch for each"
    )

    @model_validator(mode="after")
    def _finite(self) -> Self:
        if self.stop < self.start:
            raise ValueError(
                f"stop = {self.stop} is below start = {self.start}; allowed: at least start; see direction"
            )
        if (self.stop - self.start) / self.step >= MAX_FREQUENCIES:
            raise ValueError(f"step = {self.step} gives too many points; allowed: at most {MAX_FREQUENCIES} per branch")
        if len(set(self.direction)) < len(self.direction):
            raise ValueError(f"direction = {self.direction}; allowed: up and down, each once")
        return self

    @property
    def upward(self) -> list[float]:
        """The frequencies (Hz) in ascending order, rounded as a user would write them."""
        count = int((self.stop - self.start) / self.step * (1.0 + 1e-12) + 1e-9) + 1
        return [float(f"{self.start + i * self.step:.12g}") for i in range(count)]


class SweepPlan(Section, title="Sweep"):
    """Branches side by side: every combination of the grid's values, in each direction."""

    supply_frequency_hz: Frequencies = Field(description="supply frequencies of each branch")
    grid: dict[str, Annotated[list[float | int | bool | str], Field(min_length=1)]] = Field(
        {}, description="dotted keys and their values; a branch for each combination"
    )
    kind: Literal["response", "bifurcation", "map"] = Field(
        "response",
        description="response: curves over frequency; bifurcation: also points of the Poincaré section and impact "
        "speeds; map: regimes over frequency and one key of the grid",
    )
    settle_s: Annotated[Literal["auto"] | float, BeforeValidator(_settling)] = Field(
        "auto", description="time before a point is measured; auto: until the Poincaré section has settled"
    )
    max_settle_s: Positive = described(
        150.0, "", "longest settling time with auto; motion that does not repeat settles this long"
    )
    settle_tolerance: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)] = Field(
        1e-3, description="distance from the steady motion at which auto stops, in the scales of the scene"
    )
    measure_s: Positive = described(
        2.0, "", "measured time of each point; motion that does not repeat is measured eight times as long"
    )
    period_tolerance: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)] = Field(
        1e-2, description="largest distance of points of the Poincaré section that repeat, in the scales of the scene"
    )
    perturbation: Share = described(
        PERTURBATION,
        "",
        "random change of the rates of platform and exciters at each point, in the scales of the scene",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the perturbations")
    lyapunov: bool = described(
        True, "", "use the largest Lyapunov exponent to tell chaotic from quasi-periodic motion; false: non-periodic"
    )

    confirm: Literal["orbits"] | None = Field(
        None,
        description="orbits: periodic points are polished by Newton's method, with Floquet multipliers and the "
        "distance to where they settled; others get their largest Lyapunov exponents",
    )

    @model_validator(mode="after")
    def _scene_keys(self) -> Self:
        found = math.prod(map(len, self.grid.values()))
        if found > MAX_COMBINATIONS:
            raise ValueError(f"grid gives {found} combinations; allowed: at most {MAX_COMBINATIONS}")
        for key, values in self.grid.items():
            if not key.isascii():
                raise ValueError(f"grid.{key!a} is not a key of a scene; allowed: keys of machine, material, …")
            if key.split(".")[0] in ("sweep", "name", "output", "run") or key.startswith("drive."):
                raise ValueError(f"grid.{key} cannot be swept by the grid; allowed: keys of machine, material, …")
            if any(isinstance(value, int | float) and not abs(value) <= LARGEST for value in values):
                raise ValueError(f"grid.{key} = {short(values)}; allowed: numbers up to {LARGEST:g}")
            if len(set(values)) < len(values):  # 0 and 0.0 are equal
                raise ValueError(f"grid.{key} = {short(values)}; allowed: each value once")
        several = [values for values in self.grid.values() if len(values) > 1]
        if self.kind == "map" and (len(several) != 1 or any(isinstance(v, str | bool) for v in several[0])):
            raise ValueError("kind = map needs exactly one grid key with several numbers")
        return self
