"""The section ``fit``: measured data, and keys that are to be found from them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from vibroplat.config.plans import may_vary
from vibroplat.config.schema import Real, Section, described


class FitData(Section, title="Data"):
    """A file of measured data."""

    file: str = described(..., "", "file of measured data: CSV, .lvm or .xlsx")
    columns: dict[str, str] = Field(
        {},
        description="columns of the file by those of a run, as {t: Time, ay_inlet: Acc_y*9.81}; not given: they have "
        "the names of a run's table",
    )
    run: dict[str, Any] = Field({}, description="dotted keys and values of the run that was measured, as its load")


def _as_list(given: Any) -> Any:
    """Return a single file as a list."""
    return [{"file": given}] if isinstance(given, str) else [given] if isinstance(given, dict) else given


class FitPlan(Section, title="Fit"):
    """Measured data, and keys with their ranges."""

    data: Annotated[list[FitData], BeforeValidator(_as_list), Field(min_length=1, max_length=100)] = Field(
        description="files of measured data, all of one machine: FILE, or a list of {file, columns, run}"
    )
    keys: Annotated[
        dict[str, Annotated[list[Real], Field(min_length=2, max_length=2)]], Field(min_length=1, max_length=20)
    ] = Field(description="keys that are to be found, with the ends of their ranges, as {KEY: [low, high]}")
    shift: Literal["fit"] | Real = Field(
        "fit", description="when the first sample lies in the run (s), or fit: it is found for each file"
    )
    offset: Literal["fit", "none"] = Field("none", description="fit: a constant difference is found for each column")
    scale: Literal["fit", "none"] = Field("none", description="fit: a factor is found for each column")
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        8,
        description="largest number of searches; the first begins with the values of the scene, and others follow if "
        "it leaves a difference",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the further starting values")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for key, (low, high) in self.keys.items():
            if not (may_vary(key) or key.startswith("run.initial.")):
                raise ValueError(f"keys.{key} cannot be varied; allowed: keys of machine, material, run.initial, …")
            if not low < high:
                raise ValueError(f"keys.{key} = [{low:g}, {high:g}] is empty; allowed: a low end below the high one")
        return self
