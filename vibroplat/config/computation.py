"""The sections of a configuration that say how a scene is computed, and what of it is written."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from vibroplat.config.coordinates import MAX_NAMED_POINTS
from vibroplat.config.engines import ENGINES, uses_sundials
from vibroplat.config.schema import POINT_NAME, Positive, Real, Section, described

#: Minimum tolerances that the engines can reach.
MIN_TOLERANCE, MIN_TOLERANCE_SUNDIALS = 1e-14, 1e-12


class Solver(Section):
    """Accuracy and integrator."""

    tolerance: Annotated[float, Field(ge=MIN_TOLERANCE, le=1e-2, allow_inf_nan=False)] = Field(
        1.0e-6,
        description=f"local error (scaled units); at least {MIN_TOLERANCE_SUNDIALS:g}, or {MIN_TOLERANCE:g} "
        "with engine taylor",
    )
    engine: Literal["auto", *ENGINES] = Field(  # type: ignore[valid-type]
        "auto",
        description="auto: native for runs; taylor for studies of many motions, orbits and derivatives, unless "
        "the scene is stiff; the other one where it fails. native: SUNDIALS IDA called from compiled code, or sundae "
        "if the library has an unexpected version; sundae: SUNDIALS IDA through scikit-sundae's Python callbacks; "
        "taylor: Taylor series of high order, several times faster unless something decays fast",
    )
    max_events_per_period: Annotated[int, Field(ge=1, le=10_000_000)] = Field(
        5_000, description="maximum number of events within one turn at the synchronous speed; a run with more ends"
    )

    @model_validator(mode="after")
    def _require_reachable_tolerance(self) -> Self:
        if uses_sundials(self.engine) and self.tolerance < MIN_TOLERANCE_SUNDIALS:
            raise ValueError(
                f"tolerance = {self.tolerance:g} with engine {self.engine}; "
                f"allowed: at least {MIN_TOLERANCE_SUNDIALS:g}, or {MIN_TOLERANCE:g} with engine taylor"
            )
        return self


class Output(Section):
    """Output tables."""

    sample_rate_hz: Positive = described(2000.0, "", "number of rows of the trajectory table per second")
    accelerations: bool = Field(
        False,
        description="whether the trajectory table has the forces into the foundation, and the accelerations of the "
        "machine's centre of mass and of the named points along x and y, by the equations of motion; impulses of "
        "impacts do not count",
    )
    points: Annotated[
        dict[
            Annotated[str, Field(pattern=POINT_NAME)],
            Annotated[list[Real], Field(min_length=2, max_length=2)],
        ],
        Field(max_length=MAX_NAMED_POINTS),
    ] = described(
        {},
        "",
        "named points of the platform at which to report stroke and acceleration: {NAME: [x, y]} in metres, from the "
        f"platform's own centre of mass; at most {MAX_NAMED_POINTS}",
    )
    springs: dict[str, Annotated[int, Field(ge=1)]] = described(
        {},
        "",
        "number of springs at named points: {NAME: NUMBER}; reports the force along y in each of them. All are alike: "
        "their stiffness is machine.stiffness_y_n_per_m divided by the sum of the numbers",
    )

    @model_validator(mode="after")
    def _require_points(self) -> Self:
        for name in self.springs.keys() - self.points.keys():
            known = ", ".join(self.points) or "none until points has some"
            raise ValueError(f"springs.{name}: there is no such point; allowed: names in points ({known})")
        return self
