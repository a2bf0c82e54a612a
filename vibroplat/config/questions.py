"""The plans of questions that many motions answer, as section ``design`` of a configuration."""

from __future__ import annotations

import math
import re
from typing import Annotated, Self

from pydantic import Field, model_validator

from vibroplat.config.schema import LARGEST, Real, Section, Share

#: A bound of a measure.
_BOUND = re.compile(r"\s*(>=|<=)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


class DesignPlan(Section, title="Design"):
    """What the orbit of a scene depends on, what tolerances do to it, and which values of keys are best."""

    keys: dict[str, Annotated[list[Real], Field(min_length=2, max_length=2)]] = Field(
        {}, description="dotted keys and their ranges, [low, high]; none: all with a number that the motion depends on"
    )
    measures: list[str] = Field([], description="columns of a sweep, or margin, besides the usual ones")
    minimize: str | None = Field(None, description="the measure that the best values of keys make least")
    subject: dict[str, str] = Field({}, description='bounds of measures, as {rms_y_m: ">= 1e-3", margin: ">= 0.005"}')
    pareto: dict[str, Annotated[list[Real], Field(min_length=2, max_length=100)]] = Field(
        {}, description="a measure of subject and values of its bound, one after the other: a Pareto front"
    )
    spread: dict[str, Annotated[Share, Field(gt=0.0, lt=1.0)]] = Field(
        {},
        description="keys and their tolerances to either side, over their values: {machine.platform_mass_kg: 0.05}",
    )
    samples: Annotated[int, Field(ge=0, le=100_000)] = Field(
        200, description="scenes within the spread that are measured, spread evenly; 0: none"
    )
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        5, description="starts of the search, first the scene's values"
    )
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="seed of samples and starts")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for key, (low, high) in self.keys.items():
            if not low < high:
                raise ValueError(f"keys.{key} = [{low}, {high}] is empty; allowed: [low, high] with low below high")
        for measure, text in self.subject.items():
            if _BOUND.fullmatch(text) is None or not abs(self.bound(measure)[1]) <= LARGEST:
                raise ValueError(f'subject.{measure} = {text!r} is no bound; allowed: ">= NUMBER" or "<= NUMBER"')
        if self.minimize is None:
            for name in ("subject", "pareto"):
                if getattr(self, name):
                    raise ValueError(f"{name} is given without minimize; allowed: with a measure to minimize")
        elif not self.keys:
            raise ValueError("minimize is given without keys; allowed: with keys and their ranges")
        if len(self.pareto) > 1 or not self.pareto.keys() <= self.subject.keys():
            raise ValueError(f"pareto = {', '.join(self.pareto)}; allowed: one measure of subject")
        return self

    def bound(self, measure: str) -> tuple[float, float]:
        """Return the bound of a measure: 1.0 if it is the least value, −1.0 if the largest, and the value."""
        found = _BOUND.fullmatch(self.subject[measure])
        return (1.0 if found and found[1] == ">=" else -1.0), float(found[2]) if found else math.nan

    @property
    def named(self) -> list[str]:
        """The measures that the plan names, each once."""
        given = [*self.measures, *([] if self.minimize is None else [self.minimize]), *self.subject]
        return list(dict.fromkeys(given))
