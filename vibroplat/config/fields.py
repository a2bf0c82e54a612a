"""Types of configuration values, and the base class of all sections."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

#: No physical quantity in SI units lies outside these limits; products of numbers inside them stay finite.
LEAST, LARGEST = 1e-30, 1e30

#: Random change of the rates at the start of a run or of a sweep's point, in the scales of the scene.
PERTURBATION = 0.01

#: Largest angle of an exciter (rad): more than the longest run turns by. Numbers there are 2e-6 apart; at 1e16 a turn
#: falls between two of them.
LARGEST_ANGLE = 1e10


def _not_minute(value: float) -> float:
    if value < LEAST:
        raise PydanticCustomError("greater_than_equal", "too small", {"ge": LEAST})
    return value


def not_bool(value: Any) -> Any:
    """Refuse true and false, which Python treats as 1 and 0."""
    if isinstance(value, bool):
        raise PydanticCustomError("literal_error", "no number", {"expected": "1 or 2"})
    return value


Positive = Annotated[float, Field(gt=0.0, le=LARGEST, allow_inf_nan=False), AfterValidator(_not_minute)]
NonNegative = Annotated[float, Field(ge=0.0, le=LARGEST, allow_inf_nan=False)]
Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-LARGEST_ANGLE, le=LARGEST_ANGLE, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


def described(default: Any, symbol: str, meaning: str) -> Any:
    """Make a field of a section: default (``...`` if it must be given), symbol in the equations, meaning."""
    return Field(default, description=meaning, json_schema_extra={"symbol": symbol} if symbol else None)


class Section(BaseModel):
    """A section of a configuration: immutable, with strict types and no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)
