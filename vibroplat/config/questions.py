"""The plans of questions about a scene: what is asked by many motions, and within which bounds."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from vibroplat.config.plans import Over, SweepPlan, may_vary
from vibroplat.config.schema import Positive, Real, Section

#: Width at which a threshold is found, over the range of its key, where none is given.
NARROW = 1e-5
#: A column, how it is compared, and a number.
COMPARISON = re.compile(r"\s*([A-Za-z]\w*)\s*(>=|<=|>|<)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


class FindPlan(Section, title="Find", populate_by_name=True):
    """A key, and what changes at a value of it."""

    key: str = Field(description="dotted key whose value is looked for; with N for a place: of all in the list")
    start: Real = Field(description="smallest value of the key")
    stop: Real = Field(description="largest value")
    scan: Annotated[int, Field(ge=2, le=10_000)] = Field(
        41, description="number of values at which the motion is looked at first, to see where it changes"
    )
    scale: Literal["linear", "log"] = Field("linear", description="scan values with equal distances, or equal ratios")
    outcome: Literal["attractor", "regime"] = Field(
        "attractor",
        description="what is to change. attractor: the motion that is reached; regime: its synchronization alone",
    )
    expression: str | None = Field(
        None, description='instead, a column of a sweep compared with a number, as "rms_y_m > 1e-3"'
    )
    from_: Literal["initial", "neighbour"] = Field(
        "initial",
        alias="from",
        description="initial: the motion begins anew at each value, with run.initial and the drive's program; "
        "neighbour: it is carried on from the scene's own value to larger and smaller ones, until it changes",
    )
    tolerance: Positive | None = Field(
        None,
        description="distance of the values below and above that are left in the end, in the unit of the key; "
        f"not given: {NARROW:g} of the range",
    )
    max_settle_s: Positive = Field(150.0, description="as of a sweep; both ends are also given twice as long")
    measure_s: Positive = Field(2.0, description="as of a sweep")

    alternatives = (("outcome", "expression"),)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.start < self.stop:
            raise ValueError(f"stop = {self.stop} is not above start = {self.start}; allowed: a range of values")
        if self.scale == "log" and self.start <= 0.0:
            raise ValueError(f"scale = log but start = {self.start}; allowed: a start above 0")
        if not (may_vary(self.key) or self.key.startswith("run.initial.")):
            raise ValueError(f"key = {self.key!a} cannot be varied; allowed: keys of machine, material, …, run.initial")
        if self.expression is not None and COMPARISON.fullmatch(self.expression) is None:
            raise ValueError(f"expression = {self.expression!a}; allowed: column > number, or >=, <, <=")
        return self

    @property
    def over(self) -> Over:
        """The values of the scan."""
        return Over(key=self.key, start=self.start, stop=self.stop, count=self.scan, scale=self.scale)

    @property
    def compared(self) -> tuple[str, str, float] | None:
        """Column, comparison and number of the expression."""
        found = COMPARISON.fullmatch(self.expression or "")
        return found and (found[1], found[2], float(found[3]))

    @property
    def narrow(self) -> float:
        """Distance of the values below and above a threshold in the end."""
        return NARROW * (self.stop - self.start) if self.tolerance is None else self.tolerance

    def changes(self, value: float) -> dict[str, float]:
        """Return what a value of the key changes in a scene."""
        return {self.key.replace(".N.", f".{place}."): value for place in (0, 1)}

    def measuring(self, times: int, perturbation: float) -> SweepPlan:
        """Return how a motion settles and is measured, with so many times the settling and measuring time."""
        return SweepPlan(
            over=self.over,
            max_settle_s=times * self.max_settle_s,
            measure_s=times * self.measure_s,
            perturbation=perturbation,
        )
