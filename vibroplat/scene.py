"""The scene: everything that is simulated, in SI units, immutable and validated when it is built.

Field names are the keys of a YAML configuration and end with their unit. The models below are the only
place that defines a key, its type, its default and its range. Derived quantities (masses, inertias,
scales) are properties; their docstrings give the symbols of the equations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import IntEnum
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, Field, ValidationError, model_validator

from vibroplat.drive import Drive
from vibroplat.errors import ConfigError
from vibroplat.exciters import ROTATIONS, Exciter, Motor
from vibroplat.fields import PERTURBATION, Angle, NonNegative, Positive, Real, Section, Share, not_bool
from vibroplat.messages import explain
from vibroplat.orbits_plan import OrbitsPlan
from vibroplat.overrides import OF_EXCITERS, merge, nest
from vibroplat.sweep_plan import SweepPlan

#: Most rows of a trajectory table, some 15 GB; whether so many fit is found out before a run begins.
MAX_ROWS = 100_000_000

#: Most turns at the synchronous speed that a run may take: half a day of computing.
MAX_TURNS = 1e9
#: The same with engine ``sundae``, which is ten to twenty times slower.
MAX_TURNS_SUNDAE = 5e7

#: Least tolerances: what the engines can reach.
LEAST_TOLERANCE, LEAST_TOLERANCE_SUNDIALS = 1e-14, 1e-12


class Mode(IntEnum):
    """Modes of smooth motion; compiled code uses the numbers."""

    ATTACHED = 0
    FLIGHT = 1
    BARE = 2

    @property
    def label(self) -> str:
        """The mode's name in tables."""
        return self.name.lower()


class Machine(Section):
    """Platform, springs and exciters; the defaults are the paper's test rig (section 3)."""

    platform_mass_kg: Positive = Field(12.42, description="m_0")
    platform_inertia_kg_m2: Positive = Field(0.11, description="J_0")
    unbalance_mass_kg: Positive = Field(0.045, description="m_r, each exciter")
    unbalance_radius_m: Positive = Field(0.09, description="r, both exciters; or in exciters, for each")
    rotor_inertia_kg_m2: Positive = Field(0.8e-3, description="J_d, both exciters; or in exciters, for each")
    exciter_distance_m: NonNegative = Field(0.128, description="rho, exciter axis to the centre of mass")
    exciter_angle_deg: Real = Field(22.5, description="gamma_1, direction of exciter 1's axis")
    stiffness_x_n_per_m: NonNegative = Field(580e3, description="c_x")
    stiffness_y_n_per_m: Positive = Field(470e3, description="c_y")
    stiffness_phi_n_m_per_rad: NonNegative = Field(1.8e3, description="c_phi")
    damping_x_n_s_per_m: NonNegative = Field(300.0, description="b_x")
    damping_y_n_s_per_m: NonNegative = Field(40.0, description="b_y")
    damping_phi_n_m_s_per_rad: NonNegative = Field(0.77, description="b_phi")
    gravity_m_per_s2: NonNegative = Field(9.81, description="g")

    @property
    def total_mass(self) -> float:
        """M = m_0 + 2 m_r (kg)."""
        return self.platform_mass_kg + 2.0 * self.unbalance_mass_kg

    @property
    def inertia(self) -> float:
        """Moment J about the common centre of mass (kg·m²); cos²γ₁ by the parallel-axis theorem."""
        gamma = math.radians(self.exciter_angle_deg)
        lever = self.platform_mass_kg + 2.0 * self.unbalance_mass_kg * math.cos(gamma) ** 2
        exciters = 2.0 * self.unbalance_mass_kg * self.exciter_distance_m**2
        return self.platform_inertia_kg_m2 + exciters * lever / self.total_mass

    @property
    def safe_rotation(self) -> float:
        """Rotation φ up to which the mass matrix is positive definite wherever the exciters are (rad).

        To first order in φ a rotation moves the axes out by √(1 + φ²) but leaves J unchanged. The error of J,
        φ²(J − J_0), is at most J_0 up to this rotation.
        """
        exciters = self.inertia - self.platform_inertia_kg_m2
        return math.sqrt(self.platform_inertia_kg_m2 / exciters) if exciters > 0.0 else math.inf

    @property
    def exciter_axis(self) -> tuple[float, float]:
        """Axis (X_0, Y_0) of exciter 1 from the common centre of mass (m); exciter 2 is at (−X_0, Y_0)."""
        gamma = math.radians(self.exciter_angle_deg)
        share = self.platform_mass_kg / self.total_mass
        return (
            self.exciter_distance_m * math.cos(gamma),
            share * self.exciter_distance_m * math.sin(gamma),
        )


class Material(Section):
    """The material on the platform; a mass ratio of 0 means a bare platform."""

    mass_ratio: NonNegative = Field(0.0, description="mu_w = m_w / M")
    layers: Annotated[Literal[1, 2], BeforeValidator(not_bool)] = Field(2, description="2, or 1 for a thin layer")
    lower_share: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)] = Field(
        0.75, description="m_w1 / m_w; used with two layers"
    )
    natural_frequency_hz: Positive | None = Field(None, description="sqrt(c_w/m_w2)/2pi")
    stiffness_n_per_m: Positive | None = Field(None, description="c_w")
    damping_ratio: NonNegative | None = Field(None, description="b_w / (2 sqrt(c_w m_w2))")
    damping_n_s_per_m: NonNegative | None = Field(None, description="b_w")

    @model_validator(mode="after")
    def _one_of_each_pair(self) -> Self:
        if self.natural_frequency_hz is not None and self.stiffness_n_per_m is not None:
            raise ValueError("natural_frequency_hz and stiffness_n_per_m are both given; allowed: one of the two")
        if self.damping_ratio is not None and self.damping_n_s_per_m is not None:
            raise ValueError("damping_ratio and damping_n_s_per_m are both given; allowed: one of the two")
        if self.mass_ratio > 0.0 and self.layers == 2:
            if self.lower_share == 1.0:
                raise ValueError(
                    "lower_share = 1 leaves no upper layer; allowed with layers = 2: more than 0, less than 1"
                )
            if self.natural_frequency_hz is None and self.stiffness_n_per_m is None:
                raise ValueError(
                    "two layers need a spring between them; give natural_frequency_hz or stiffness_n_per_m"
                )
        return self


class Contact(Section):
    """Contact between material and platform."""

    model: Literal["impact", "non-impact"] = Field(
        "impact", description="non-impact: material as added viscous friction"
    )
    restitution: Share = Field(0.0, description="R")
    sticking_speed_m_per_s: NonNegative = Field(0.0, description="impacts slower than this are inelastic; 0 = none")
    impact_law: Literal["conservative", "central", "printed"] = "conservative"
    viscous_per_mass_per_s: NonNegative = Field(0.0, description="beta: b_y + beta m_w, non-impact")
    added_mass_share: Share = Field(0.0, description="share of m_w that moves with the platform, non-impact")


class State(Section):
    """A full state. Omitted coordinates are at static rest; omitted rates are 0.

    ``t_s``, ``mode``, the contact force and what is told of the supply are accepted but not used, so that the last row
    of a trajectory can be given unchanged. Time starts at 0; mode and force follow from the state.
    """

    x_m: Real | None = None
    y_m: Real | None = None
    phi_rad: Real | None = None
    phi1_rad: Angle | None = None
    phi2_rad: Angle | None = None
    gap_m: NonNegative | None = None
    upper_m: Real | None = None
    x_rate_m_per_s: Real = 0.0
    y_rate_m_per_s: Real = 0.0
    phi_rate_rad_per_s: Real = 0.0
    phi1_rate_rad_per_s: Real = 0.0
    phi2_rate_rad_per_s: Real = 0.0
    gap_rate_m_per_s: Real = 0.0
    upper_rate_m_per_s: Real = 0.0
    t_s: Real | None = None
    mode: str | None = None
    contact_force_n: Real | None = None
    supply_frequency_hz: Real | None = None
    motor_power_1_w: Real | None = None
    motor_power_2_w: Real | None = None


class Initial(Section, populate_by_name=True):
    """Initial state: static rest of platform and material with rotating exciters, a full state, or a run's end."""

    phase_difference_rad: Angle | None = Field(
        None,
        description="phi_1 + phi_2 of counter-rotating exciters, phi_1 - phi_2 of co-rotating ones; not given: pi",
    )
    phase_sum_rad: Angle | None = Field(None, description="phase_difference_rad of counter-rotating exciters")
    phi1_rad: Angle = 0.0
    speed_ratio: Real = Field(0.98, description="speed of both exciters over the synchronous speed")
    state: State | None = None
    from_: Annotated[str, Field(min_length=1)] | None = Field(
        None, alias="from", description="directory of a run; this one begins where it ended, and its times go on"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        ways = [name for name in ("state", "from_") if getattr(self, name) is not None]
        extra = sorted(self.model_fields_set - {"state", "from_"}) if ways else []
        if self.phase_sum_rad is not None and self.phase_difference_rad is not None:
            extra, ways = ["phase_sum_rad"], ["phase_difference_rad"]
        if extra or len(ways) > 1:
            first, second = [name.strip("_") for name in (*ways, *extra)][:2]
            raise ValueError(f"{first} and {second} are both given; allowed: one of the two")
        return self

    @property
    def phase_difference(self) -> float:
        """Phase difference of the exciters (rad)."""
        given = self.phase_difference_rad if self.phase_sum_rad is None else self.phase_sum_rad
        return math.pi if given is None else given


class Run(Section):
    """Duration and initial state of a run."""

    duration_s: Positive = 4.0
    initial: Initial = Initial()
    perturbation: Share | None = Field(
        None,
        description="random change of the rates of platform and exciters at the start, in the scales of the scene; "
        f"not given: {PERTURBATION:g}, and 0 where initial gives a state or a run",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the perturbation")

    @property
    def start_perturbation(self) -> float:
        """Perturbation of the start: a motion that is symmetric would stay so for ever, even where it is unstable."""
        if self.perturbation is not None:
            return self.perturbation
        return PERTURBATION if self.initial.state is None and self.initial.from_ is None else 0.0


class Solver(Section):
    """Accuracy and integrator."""

    tolerance: Annotated[float, Field(ge=LEAST_TOLERANCE, le=1e-2, allow_inf_nan=False)] = Field(
        1.0e-6,
        description="local error, relative to the scales of the scene; at least "
        f"{LEAST_TOLERANCE_SUNDIALS:g}, with engine taylor {LEAST_TOLERANCE:g}",
    )
    engine: Literal["auto", "native", "sundae", "taylor"] = Field(
        "auto",
        description="native: SUNDIALS driven from compiled code; sundae: through scikit-sundae's Python callbacks; "
        "auto: native, or sundae if the library is not as expected; taylor: Taylor series of high order, several times "
        "faster unless a layer or a motor is stiff",
    )
    max_events_per_period: Annotated[int, Field(ge=1, le=10_000_000)] = Field(
        5_000, description="a run ends if it has more events within one turn at the synchronous speed"
    )

    @model_validator(mode="after")
    def _require_reachable_tolerance(self) -> Self:
        if self.engine != "taylor" and self.tolerance < LEAST_TOLERANCE_SUNDIALS:
            raise ValueError(
                f"tolerance = {self.tolerance:g} with engine {self.engine}; "
                f"allowed: at least {LEAST_TOLERANCE_SUNDIALS:g}, or {LEAST_TOLERANCE:g} with engine taylor"
            )
        return self


class Output(Section):
    """Output tables."""

    sample_rate_hz: Positive = 2000.0


def _decay(damping: float, stiffness: float) -> float:
    """Larger decay rate of u″ + damping u′ + stiffness u = 0 (1/s)."""
    half = 0.5 * damping
    return half + math.sqrt(max(half * half - stiffness, 0.0))


def _set(section: Section) -> dict[str, Any]:
    """Keys and values of a section that are not None."""
    return {key: value for key, value in section if value is not None}


def _plain(value: Any) -> Any:
    """Turn a section, or a list of some, into the keys and values that it was given."""
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value.model_dump(exclude_unset=True, by_alias=True) if isinstance(value, BaseModel) else value


#: Keys of :class:`State` in the order of the state vector: coordinates, then their rates.
COORDINATES = ("x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "gap_m", "upper_m")
RATES = (
    "x_rate_m_per_s",
    "y_rate_m_per_s",
    "phi_rate_rad_per_s",
    "phi1_rate_rad_per_s",
    "phi2_rate_rad_per_s",
    "gap_rate_m_per_s",
    "upper_rate_m_per_s",
)


class Scene(Section):
    """The full physical setup of one run.

    Examples
    --------
    >>> scene = Scene(material=Material(mass_ratio=0.1, natural_frequency_hz=18.5, damping_ratio=0.05))
    >>> scene.modes
    (<Mode.ATTACHED: 0>, <Mode.FLIGHT: 1>)
    >>> scene.replace({"material.mass_ratio": 0.0}).modes
    (<Mode.BARE: 2>,)
    """

    name: Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]*$")] = "scene"
    machine: Machine = Machine()
    motor: Motor | None = None
    motors: Annotated[list[Motor], Field(min_length=2, max_length=2)] | None = None
    exciters: Annotated[list[Exciter], Field(min_length=2, max_length=2)] | None = None
    material: Material = Material()
    contact: Contact = Contact()
    drive: Drive = Drive()
    run: Run = Run()
    solver: Solver = Solver()
    output: Output = Output()
    sweep: SweepPlan | None = None
    orbits: OrbitsPlan | None = None

    @model_validator(mode="before")
    @classmethod
    def _default_motor(cls, given: Any) -> Any:
        if isinstance(given, dict) and all(given.get(name) is None for name in ("motor", "motors", "exciters")):
            return given | {"motor": Motor()}
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._require_one_way()
        rows = self.run.duration_s * self.output.sample_rate_hz
        if rows > MAX_ROWS:
            raise ValueError(
                f"output.sample_rate_hz = {self.output.sample_rate_hz} asks for {rows:.3g} rows in "
                f"{self.run.duration_s} s; allowed: at most {MAX_ROWS} rows"
            )
        self._require_end("run.duration_s", self.run.duration_s, self.drive.largest_frequency)
        if self.sweep is not None:
            for key in ("settle_s", "max_settle_s", "measure_s"):
                seconds = getattr(self.sweep, key)
                if seconds != "auto":
                    self._require_end(f"sweep.{key}", seconds, self.sweep.supply_frequency_hz.stop)
        state = self.run.initial.state
        if state is not None:
            given = state.model_dump(exclude_none=True)
            for index in sorted(set(range(7)) - set(self.coordinates)):
                for key in (COORDINATES[index], RATES[index]):
                    if given.get(key, 0.0) != 0.0:
                        raise ValueError(
                            f"run.initial.state.{key} = {given[key]} but this scene has no such coordinate; "
                            "allowed: leave it out"
                        )
            if not state.gap_m and state.gap_rate_m_per_s < 0.0:
                raise ValueError(
                    f"run.initial.state.gap_rate_m_per_s = {state.gap_rate_m_per_s} closes a gap that is 0; "
                    "allowed: at least 0 while gap_m is 0"
                )
        return self

    def _require_one_way(self) -> None:
        """Refuse keys that say the same twice."""
        given = [name for name in ("motor", "motors", "exciters") if getattr(self, name) is not None]
        if self.exciters is not None:
            given += [f"machine.{name}" for name in OF_EXCITERS if name in self.machine.model_fields_set]
        if len(given) > 1:
            raise ValueError(f"{given[0]} and {given[1]} are both given; allowed: one of the two")
        if self.co_rotating and self.run.initial.phase_sum_rad is not None:
            raise ValueError(
                f"run.initial.phase_sum_rad = {self.run.initial.phase_sum_rad} but these exciters turn the same way; "
                "allowed: phase_difference_rad"
            )

    def _require_end(self, key: str, seconds: float, supply: float) -> None:
        """Refuse durations that no computer would ever finish."""
        turns = seconds * supply / min(exciter.pole_pairs for exciter in self.exciter_pair)
        slow = self.solver.engine == "sundae"
        most = MAX_TURNS_SUNDAE if slow else MAX_TURNS
        if turns > most:
            raise ValueError(
                f"{key} = {seconds} takes {turns:.3g} turns at the synchronous speed; "
                f"allowed{' with engine sundae' if slow else ''}: at most {most:.0e}"
            )

    # -- structure of the scene -------------------------------------------------------------------------

    @property
    def has_contact(self) -> bool:
        """Whether material can press on the platform and lift off."""
        return self.material.mass_ratio > 0.0 and self.contact.model == "impact"

    @property
    def layers(self) -> int:
        """Number of moving layers: 0 (bare, non-impact), 1 or 2."""
        return self.material.layers if self.has_contact else 0

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of this scene."""
        return (Mode.ATTACHED, Mode.FLIGHT) if self.has_contact else (Mode.BARE,)

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Indices into :data:`COORDINATES` of the coordinates of this scene."""
        return (0, 1, 2, 3, 4, 5, 6)[: 5 + self.layers]

    # -- derived quantities -------------------------------------------------------------------------

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy the scene, with some sections changed; what follows from them is found anew."""
        copied = super().model_copy(update=update, deep=deep)
        copied.__dict__.pop("exciter_pair", None)
        return copied

    @cached_property
    def exciter_pair(self) -> tuple[Exciter, Exciter]:
        """Exciters 1 and 2, however the scene gives their numbers."""
        common = {} if self.exciters is not None else {name: getattr(self.machine, name) for name in OF_EXCITERS}
        given = self.exciters or self.motors or [self.motor or Motor()] * 2
        first, second = (
            Exciter.model_construct(**{"rotation": rotation, **_set(numbers), **common})
            for numbers, rotation in zip(given, ROTATIONS, strict=True)
        )
        return first, second

    @property
    def co_rotating(self) -> bool:
        """Whether both exciters are driven the same way."""
        first, second = self.exciter_pair
        return first.direction == second.direction

    @property
    def rotation(self) -> str:
        """How the exciters are driven beside each other: ``counter-rotating`` or ``co-rotating``."""
        return "co-rotating" if self.co_rotating else "counter-rotating"

    @property
    def phase_weights(self) -> tuple[float, float]:
        """Weights of φ₁ and φ₂ in the phase difference: φ₁ + φ₂ if counter-rotating, φ₁ − φ₂ if co-rotating."""
        return 1.0, -1.0 if self.co_rotating else 1.0

    @property
    def unbalances(self) -> tuple[float, float]:
        """The static moments k_i = m_r r_i of both exciters (kg·m)."""
        first, second = (self.machine.unbalance_mass_kg * exciter.unbalance_radius_m for exciter in self.exciter_pair)
        return first, second

    @property
    def exciter_inertias(self) -> tuple[float, float]:
        """J_e,i = J_d,i + m_r r_i² (kg·m²)."""
        first, second = (
            exciter.rotor_inertia_kg_m2 + self.machine.unbalance_mass_kg * exciter.unbalance_radius_m**2
            for exciter in self.exciter_pair
        )
        return first, second

    @property
    def synchronous_speeds(self) -> tuple[float, float]:
        """ω_0 = 2π f_e / P of both motors (rad/s), at the largest supply frequency of a program."""
        return self.synchronous_speeds_at(self.drive.largest_frequency)

    def synchronous_speeds_at(self, frequency: float) -> tuple[float, float]:
        """ω_0 of both motors (rad/s) at a supply frequency (Hz)."""
        first, second = (2.0 * math.pi * frequency / exciter.pole_pairs for exciter in self.exciter_pair)
        return first, second

    @property
    def speed_scale(self) -> float:
        """The larger of both ω_0 (rad/s)."""
        return max(self.synchronous_speeds)

    @property
    def length_scale(self) -> float:
        """(k_1 + k_2)/M, the platform's amplitude far above resonance (m)."""
        return sum(self.unbalances) / self.machine.total_mass

    @property
    def force_scale(self) -> float:
        """Weight of the material plus its inertia force at the scales of length and speed (N)."""
        inertia = self.length_scale * self.speed_scale**2
        return sum(self.layer_masses) * (self.machine.gravity_m_per_s2 + inertia)

    @property
    def fastest_decay(self) -> float:
        """Largest decay rate (1/s) of x, y, φ and the exciters' speeds, each taken alone."""
        machine = self.machine
        springs = (
            (self.platform_mass, machine.damping_x_n_s_per_m, machine.stiffness_x_n_per_m),
            (self.platform_mass, self.damping_y, machine.stiffness_y_n_per_m),
            (machine.inertia, machine.damping_phi_n_m_s_per_rad, machine.stiffness_phi_n_m_per_rad),
        )
        rates = [_decay(damping / mass, stiffness / mass) for mass, damping, stiffness in springs]
        frequency = self.drive.largest_frequency
        for exciter, inertia in zip(self.exciter_pair, self.exciter_inertias, strict=True):
            slope = 2.0 * exciter.critical_torque_n_m / exciter.critical_slip_speed(frequency)
            rates.append(slope / inertia)
        return max(rates)

    @property
    def material_mass(self) -> float:
        """m_w = μ_w M (kg)."""
        return self.material.mass_ratio * self.machine.total_mass

    @property
    def layer_masses(self) -> tuple[float, float]:
        """(m_w1, m_w2) (kg); (0, 0) without contact."""
        if self.layers == 0:
            return 0.0, 0.0
        lower = self.material_mass * (self.material.lower_share if self.layers == 2 else 1.0)
        return lower, self.material_mass - lower if self.layers == 2 else 0.0

    @property
    def layer_spring(self) -> tuple[float, float]:
        """(c_w / m_w2, b_w / m_w2) in 1/s² and 1/s; (0, 0) with fewer than two layers."""
        if self.layers < 2:
            return 0.0, 0.0
        mass = self.layer_masses[1]
        material = self.material
        if material.natural_frequency_hz is not None:
            stiffness = (2.0 * math.pi * material.natural_frequency_hz) ** 2
        else:
            assert material.stiffness_n_per_m is not None  # ensured by the validator
            stiffness = material.stiffness_n_per_m / mass
        if material.damping_ratio is not None:
            return stiffness, 2.0 * material.damping_ratio * math.sqrt(stiffness)
        return stiffness, (material.damping_n_s_per_m or 0.0) / mass

    @property
    def platform_mass(self) -> float:
        """Mass that moves with the platform (kg): M, plus a share of m_w in the non-impact model."""
        if self.contact.model == "non-impact":
            return self.machine.total_mass + self.contact.added_mass_share * self.material_mass
        return self.machine.total_mass

    @property
    def damping_y(self) -> float:
        """b_y, plus β m_w in the non-impact model (N·s/m)."""
        if self.contact.model == "non-impact":
            return self.machine.damping_y_n_s_per_m + self.contact.viscous_per_mass_per_s * self.material_mass
        return self.machine.damping_y_n_s_per_m

    def replace(self, changes: Mapping[str, Any] | None = None, /, **sections: Any) -> Scene:
        """Return a new scene with some keys changed; it is validated like a configuration.

        Parameters
        ----------
        changes
            Dotted keys and their values, e.g. ``{"drive.supply_frequency_hz": 46.0}``.
        **sections
            Nested values by section, e.g. ``drive={"supply_frequency_hz": 46.0}``. If two keys exclude
            each other (stiffness and natural frequency), the new one replaces the old one. The numbers of exciters
            are changed by their places, as ``{"exciters.1.critical_slip": 0.1}``.

        Raises
        ------
        vibroplat.errors.ConfigError
            A key is unknown or a value is not allowed.
        """
        tree = self.model_dump(exclude_unset=True, by_alias=True)
        given = {key: _plain(value) for key, value in sections.items()}
        return Scene.from_tree(merge(merge(tree, given), nest(changes or {})))

    def to_tree(self) -> dict[str, Any]:
        """Return all keys as nested plain values, including defaults; the inverse of :meth:`from_tree`."""
        tree = self.model_dump(mode="json", exclude_none=True, by_alias=True)
        initial = tree["run"]["initial"]
        for way in ("state", "from"):
            if way in initial:
                tree["run"]["initial"] = {way: initial[way]}
        if self.exciters is not None:
            for name in OF_EXCITERS:
                del tree["machine"][name]
        return tree

    @classmethod
    def from_tree(cls, tree: Mapping[str, Any]) -> Scene:
        """Build a scene from nested plain values, as a configuration file holds them.

        Raises
        ------
        vibroplat.errors.ConfigError
            One line with the key, the value and what is allowed.
        """
        try:
            return cls.model_validate(tree)
        except ValidationError as error:
            raise ConfigError(explain(error, cls)) from None
