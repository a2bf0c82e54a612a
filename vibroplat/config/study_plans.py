"""The plans of studies, sections ``find``, ``basins`` and ``design`` of a configuration."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from vibroplat.columns import is_angle
from vibroplat.config.circular import beyond, bound_scale, require_turn
from vibroplat.config.coordinates import ALONG, COORDINATES, RATES
from vibroplat.config.fit_plan import FitPlan
from vibroplat.config.plans import OrbitsPlan, ParameterRange, SweepPlan, may_vary
from vibroplat.config.schema import MAX_SIZE, MINUS, Fraction, Positive, Real, Section, did_you_mean, number_instead
from vibroplat.config.sections import PHASES

#: Prefix of the keys of initial conditions, and all such keys.
INITIAL_PREFIX = "run.initial."
STATE_KEYS = tuple(f"state.{name}" for name in (*COORDINATES, *RATES, *ALONG))
INITIAL_KEYS = tuple(INITIAL_PREFIX + name for name in (*PHASES, *STATE_KEYS))
#: Pairs of them that exclude each other.
EXCLUSIVE = (
    *((name, f"state.{phase}_rad") for name in PHASES[:2] for phase in ("phi1", "phi2")),
    *(("speed_ratio", f"state.{phase}_rate_rad_per_s") for phase in ("phi1", "phi2")),
)
#: Default number of random initial conditions, and maximum number at all values of a key.
DEFAULT_RANDOM, MAX_INITIAL_CONDITIONS = 1000, 10_000_000
#: Violation of a bound, relative to its scale, that counts as 0.
VIOLATION_TOLERANCE = 1e-6


def _full_names(given: Any) -> Any:
    """Return ranges by the full names of their keys; users may leave out ``run.initial.``."""
    if not isinstance(given, Mapping):
        return given
    places = ("", "run.", INITIAL_PREFIX)
    named = [(next((f"{p}{key}" for p in places if f"{p}{key}" in INITIAL_KEYS), key), of) for key, of in given.items()]
    if len(dict(named)) < len(named):
        raise ValueError("initial_conditions has a key twice, with and without run.initial; allowed: each once")
    return dict(named)


class BasinsPlan(Section, title="Basins"):
    """Initial conditions in a box, and the maximum number of turns until they are assigned."""

    initial_conditions: Annotated[
        dict[str, Annotated[list[Real], Field(min_length=2, max_length=3)]],
        BeforeValidator(_full_names),
        Field(min_length=1),
    ] = Field(
        description="keys of run.initial (phases, speed_ratio, state.NAME) and their ranges: [low, high, count] "
        "for a grid, [low, high] for random values; all other keys are as in run.initial"
    )
    random: Annotated[int, Field(ge=1, le=MAX_INITIAL_CONDITIONS)] | None = Field(
        None,
        description="number of random initial conditions for each point of the grid; default: 1 with, 1000 without "
        "grid",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        0, description="seed of initial conditions and perturbations"
    )
    over: ParameterRange | None = Field(None, description="values of another key, with the same initial conditions")
    max_turns: Annotated[int, Field(ge=100, le=10_000_000)] = Field(
        6000,
        description="maximum number of turns; a motion that has not converged to a periodic orbit by then "
        "counts as aperiodic",
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for key, (low, high, *count) in self.initial_conditions.items():
            if key not in INITIAL_KEYS:
                hint = f"{did_you_mean(key, INITIAL_KEYS)}allowed: {', '.join(INITIAL_KEYS[:5])}, … of run.initial"
                raise ValueError(f"initial_conditions.{key!a} is no key of an initial condition; {hint}")
            if not low < high:
                raise ValueError(
                    f"initial_conditions.{key} = [{low:g}, {high:g}] is empty; allowed: a low end below the high one"
                )
            if count and not (count[0].is_integer() and 2 <= count[0] <= MAX_INITIAL_CONDITIONS):
                raise ValueError(
                    f"initial_conditions.{key} = […, {count[0]:g}]; allowed: a whole number from 2 as count"
                )
        for one, other in EXCLUSIVE:
            if {INITIAL_PREFIX + one, INITIAL_PREFIX + other} <= self.initial_conditions.keys():
                raise ValueError(f"initial_conditions has {one} and {other}; allowed: one of the two")
        if self.random is not None and all(len(ends) == 3 for ends in self.initial_conditions.values()):
            raise ValueError(
                f"random = {self.random} but every range of initial_conditions has a count; allowed: [low, high]"
            )
        if self.over is not None and not may_vary(self.over.key):
            raise ValueError(f"over.key = {self.over.key!a} cannot be varied; allowed: keys of machine, material, …")
        if self.over is not None and len(self.over.direction) > 1:
            raise ValueError("over.direction = [up, down]; allowed: one of the two")
        number = self.number * (1 if self.over is None else self.over.number)
        if number > MAX_INITIAL_CONDITIONS:
            raise ValueError(f"initial_conditions are {number}; allowed: at most {MAX_INITIAL_CONDITIONS}")
        return self

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of the grid's values; () without a grid."""
        return tuple(int(ends[2]) for ends in self.initial_conditions.values() if len(ends) == 3)

    @property
    def number(self) -> int:
        """Number of initial conditions at each value of ``over``."""
        return math.prod(self.shape) * (self.random or (1 if self.shape else DEFAULT_RANDOM))


#: Default of the final width of a threshold, relative to the range of its key.
DEFAULT_TOLERANCE = 1e-5
#: A column, how it is compared, and a number.
COMPARISON = re.compile(r"\s*([A-Za-z]\w*)\s*(>=|<=|>|<)\s*([-+−]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def comparison(text: str) -> tuple[str, str, float] | None:
    """Return the column, how it is compared, and the number of a text; None if it is no comparison."""
    match = COMPARISON.fullmatch(text)
    return match and (match[1], match[2], float(match[3].replace(MINUS, "-")))


def _hint(text: str) -> str:
    """Say which number a text that is no comparison may mean; "" if it has none."""
    column, _, number = re.sub("[<>]=?", "\n", text, count=1).partition("\n")
    instead = number_instead(number, [column.strip()])
    return "" if instead == "a number" else f"; {instead}"


class FindPlan(Section, title="Find", populate_by_name=True):
    """A key, and the outcome whose change is searched for."""

    key: str = Field(description="dotted key whose threshold is wanted; N stands for all places of a list")
    start: Real = Field(description="smallest value of the key")
    stop: Real = Field(description="largest value of the key")
    scan: Annotated[int, Field(ge=2, le=10_000)] = Field(
        41, description="number of values in a first scan, which shows between which values the motion changes"
    )
    scale: Literal["linear", "log"] = Field("linear", description="scan values with equal differences or ratios")
    compare: Literal["attractor", "regime"] = Field(
        "attractor",
        description="outcome whose change counts. attractor: the attractor reached; regime: its synchronization only",
    )
    expression: str | None = Field(
        None,
        description='wanted outcome, instead of compare: a column of a sweep and a bound, as "rms_y_m > 1e-3"; if '
        "outcomes are mixed, more values are evaluated on the side where it holds; an angle is above a bound up to "
        "half a turn from it on",
    )
    from_: Literal["initial", "previous"] = Field(
        "initial",
        alias="from",
        description="initial: each value starts from run.initial and follows the supply program; previous: the "
        "motion is continued from the scene's own value in both directions until it changes",
    )
    tolerance: Positive | None = Field(
        None,
        description="final width of the interval that contains the threshold, in the unit of the key; default: "
        f"{DEFAULT_TOLERANCE:g} of the range",
    )
    max_settle_s: Positive = Field(150.0, description="maximum settling time; both ends are repeated with twice of it")
    measure_s: Positive = Field(2.0, description="measuring interval, as in a sweep")

    alternatives = (("compare", "expression"),)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not self.start < self.stop:
            raise ValueError(f"stop = {self.stop} is not above start = {self.start}; allowed: a range of values")
        if self.scale == "log" and self.start <= 0.0:
            raise ValueError(f"scale = log but start = {self.start}; allowed: a start above 0")
        if not (may_vary(self.key) or self.key.startswith("run.initial.")):
            raise ValueError(f"key = {self.key!a} cannot be varied; allowed: keys of machine, material, …, run.initial")
        if self.expression is not None and self.compared is None:
            raise ValueError(
                f"expression = {self.expression!r}; allowed: column > number, or >=, <, <={_hint(self.expression)}"
            )
        if self.compared is not None:
            require_turn(f"expression = {self.expression!a}", self.compared[0], self.compared[2])
        return self

    @property
    def over(self) -> ParameterRange:
        """The values of the scan."""
        return ParameterRange(key=self.key, start=self.start, stop=self.stop, count=self.scan, scale=self.scale)

    @property
    def compared(self) -> tuple[str, str, float] | None:
        """Column, comparison and number of the expression."""
        return comparison(self.expression or "")

    @property
    def of_motion(self) -> bool:
        """Whether the attractor is compared, and not its synchronization or a measure alone."""
        return self.expression is None and self.compare == "attractor"

    @property
    def narrow(self) -> float:
        """Final distance of the values below and above a threshold."""
        return DEFAULT_TOLERANCE * (self.stop - self.start) if self.tolerance is None else self.tolerance

    def measuring(self, times: int, perturbation: float) -> SweepPlan:
        """Return how a motion settles and is measured, with ``times`` the settling and measuring time."""
        return SweepPlan.of_motion(
            max_settle_s=times * self.max_settle_s,
            measure_s=times * self.measure_s,
            perturbation=perturbation,
        )


class DesignPlan(Section, title="Design"):
    """What the orbit of a scene depends on, what tolerances do to it, and which values of keys are best."""

    keys: dict[str, Annotated[list[Real], Field(min_length=2, max_length=2)]] = Field(
        {}, description="dotted keys and their ranges, [low, high]; if empty: all numbers that the motion depends on"
    )
    measures: list[str] = Field([], description="further columns of a sweep to report, or stability_margin")
    minimize: str | None = Field(None, description="measure to minimize over the keys")
    constraints: dict[str, str] = Field(
        {},
        description='required bounds of measures, as {rms_y_m: ">= 1e-3", stability_margin: ">= 0.005"}; without '
        "minimize, the answer is the fraction of samples that satisfy each; an angle is above a bound up to half a "
        "turn from it on, and below it otherwise",
    )
    pareto: dict[str, Annotated[list[Real], Field(min_length=2, max_length=100)]] = Field(
        {}, description="several values for the bound of one measure of constraints, for a Pareto front"
    )
    parameter_tolerances: dict[str, Annotated[Fraction, Field(gt=0.0, lt=1.0)]] = Field(
        {},
        description="relative tolerances ± of keys, as {machine.platform_mass_kg: 0.05}, or of all numbers of a "
        "section, as {machine: 0.05}, without those that are 0; a key overrides its section; the optimum satisfies "
        "the bounds at both ends of each tolerance, with all other keys at their nominal values",
    )
    samples: Annotated[int, Field(ge=0, le=100_000)] = Field(
        200, description="number of scenes to measure, distributed evenly within the tolerances; 0: none"
    )
    starts: Annotated[int, Field(ge=1, le=1000)] = Field(
        5, description="number of starting points of the search; the first has the scene's values"
    )
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(0, description="seed of samples and starting points")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for key, (low, high) in self.keys.items():
            if not low < high:
                raise ValueError(f"keys.{key} = [{low}, {high}] is empty; allowed: [low, high] with low below high")
        for measure, text in self.constraints.items():
            if not (self.bound(measure)[0] and abs(self.bound(measure)[1]) <= MAX_SIZE):
                hint = _hint(f"{measure} {text}")
                raise ValueError(
                    f'constraints.{measure} = {text!r} is no bound; allowed: ">= NUMBER" or "<= NUMBER"{hint}'
                )
            for limit in (self.bound(measure)[1], *self.pareto.get(measure, ())):
                require_turn(f"constraints.{measure}", measure, limit)
        if self.minimize is not None and is_angle(self.minimize):
            raise ValueError(
                f"minimize = {self.minimize}, which is an angle, and a circle has no least value; allowed: another "
                "measure, with this one in constraints"
            )
        sampled = bool(self.parameter_tolerances and self.samples)
        if self.minimize is None:
            if self.pareto:
                raise ValueError("pareto is given without minimize; allowed: with a measure to minimize")
            if self.constraints and not sampled:
                raise ValueError(
                    "constraints are given without minimize; allowed: with a measure to minimize, or with "
                    "parameter_tolerances and samples"
                )
        elif not self.keys:
            raise ValueError("minimize is given without keys; allowed: with keys and their ranges")
        if len(self.pareto) > 1 or not self.pareto.keys() <= self.constraints.keys():
            raise ValueError(f"pareto = {', '.join(self.pareto)}; allowed: one measure of constraints")
        return self

    def bound(self, measure: str) -> tuple[float, float]:
        """Return 1 if a bound is the minimum of its measure, −1 if the maximum, 0 if it is no bound; and its value."""
        _, how, limit = comparison(f"{measure} {self.constraints[measure]}") or ("", "", 0.0)
        return {">=": 1.0, "<=": -1.0}.get(how, 0.0), limit

    def keeps(self, measure: str, values: Any) -> Any:
        """Return whether values of a measure satisfy its bound."""
        sign, limit = self.bound(measure)
        return sign * beyond(measure, values, limit) >= -VIOLATION_TOLERANCE * bound_scale(measure, limit)

    @property
    def named(self) -> list[str]:
        """The measures that the plan names, each once."""
        given = [*self.measures, *([] if self.minimize is None else [self.minimize]), *self.constraints]
        return list(dict.fromkeys(given))


#: The sections of a scene that ask for studies.
PLANS: dict[str, type[Section]] = {
    "sweep": SweepPlan,
    "orbits": OrbitsPlan,
    "find": FindPlan,
    "basins": BasinsPlan,
    "design": DesignPlan,
    "fit": FitPlan,
}
