"""The sections of a configuration that hold numbers of the machine, the material and a run.

Field names are the keys of a YAML configuration and end with their unit. A key, its type, its default and its range
are defined here, with those of the supply in :mod:`vibroplat.config.drive` and of studies in
:mod:`vibroplat.config.plans`, and nowhere else.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from vibroplat.config.coordinates import TURN
from vibroplat.config.kloss import kloss
from vibroplat.config.schema import (
    PERTURBATION,
    Angle,
    Fraction,
    NonNegative,
    Positive,
    Real,
    Section,
    described,
)

Rotation = Literal["counter-clockwise", "clockwise"]

#: A number, or an array of some.
T = TypeVar("T", float, NDArray[np.float64])

#: Keys of the machine that the section ``exciters`` gives for each exciter instead.
OF_EXCITERS = ("unbalance_radius_m", "rotor_inertia_kg_m2")

#: Keys of the machine that the section ``springs`` gives for each spring instead.
OF_SPRINGS = (
    *("stiffness_x_n_per_m", "stiffness_y_n_per_m", "stiffness_phi_n_m_per_rad"),
    *("damping_x_n_s_per_m", "damping_y_n_s_per_m", "damping_phi_n_m_s_per_rad"),
)

#: Keys of a motor that are read from its nameplate; the frequency may also be given without the others.
NAMEPLATE = ("rated_power_w", "rated_speed_rpm", "breakdown_ratio", "rated_frequency_hz")

#: Rotations of exciters 1 and 2 where they are not given.
ROTATIONS: tuple[Rotation, Rotation] = ("counter-clockwise", "clockwise")


class Motor(Section):
    """An induction motor (Kloss formula) and its resistance to rotation."""

    critical_torque_n_m: NonNegative = described(
        1.2, "M_c", "critical (maximum) torque; 0: supply switched off", "10 … 500"
    )
    critical_slip: Positive = described(0.15, "s_c", "slip at the critical torque", "0.1 … 0.3")
    rated_power_w: Positive | None = described(
        None,
        "P_r",
        "rated mechanical power on the nameplate; given together with rated_speed_rpm, breakdown_ratio and "
        "rated_frequency_hz, instead of critical_torque_n_m and critical_slip",
        "100 … 10 000",
    )
    rated_speed_rpm: Positive | None = described(None, "n_r", "speed at the rated power and frequency", "700 … 2900")
    breakdown_ratio: Annotated[float, Field(gt=1.0, le=100.0)] | None = described(
        None, "M_c / M_r", "critical (breakdown) torque divided by the rated torque", "2 … 3"
    )
    pole_pairs: Annotated[int, Field(ge=1, le=1000)] = described(
        2, "P", "number of pole pairs; the synchronous speed is 2 pi f_e / P", "1 … 4"
    )
    friction_radius_m: NonNegative = described(
        5.0e-5, "k_R", "resistance to rotation: coefficient of bearing friction times shaft radius", "5e-5 … 3e-4"
    )
    rated_frequency_hz: Positive | None = described(
        None,
        "",
        "supply frequency at which critical_slip is measured; the critical slip speed (rad/s) is then the same at "
        "all frequencies, as with an inverter of constant V/f; if not given, the critical slip is the same",
        "50 or 60",
    )

    # rated_power_w stands for the whole nameplate, which one key of the other kind does not replace
    alternatives: ClassVar[tuple[tuple[str, str], ...]] = (
        ("rated_power_w", "critical_torque_n_m"),
        ("rated_power_w", "critical_slip"),
    )

    @model_validator(mode="after")
    def _whole_nameplate(self) -> Self:
        if self.rated_power_w is self.rated_speed_rpm is self.breakdown_ratio is None:
            return self
        given = {name: getattr(self, name) for name in NAMEPLATE}
        missing = [name for name, value in given.items() if value is None]
        plate = [name for name in given if name not in (*missing, "rated_frequency_hz")]
        if missing:
            if missing == ["rated_power_w"] and {"critical_torque_n_m", "critical_slip"} & self._given():
                raise ValueError(
                    "critical_torque_n_m or critical_slip is given over a nameplate, which has both; allowed: another "
                    f"rated_power_w or breakdown_ratio, or both of them with {' and '.join(plate)} = null"
                )
            raise ValueError(
                f"{plate[0]} is given without {' and '.join(missing)}; "
                f"allowed: {', '.join(NAMEPLATE[:-1])} together with {NAMEPLATE[-1]}, or none of them"
            )
        if not self.rated_slip > 0.0:
            synchronous = 60.0 * given["rated_frequency_hz"] / self.pole_pairs
            raise ValueError(
                f"rated_speed_rpm = {self.rated_speed_rpm:g}; allowed: less than the synchronous speed, {synchronous:g}"
            )
        return self

    @property
    def rated_slip(self) -> float:
        """Slip s_r = 1 - P n_r/f_r on the nameplate, with n_r in turns per second; 0 without a nameplate."""
        return 1.0 - (self.rated_speed_rpm or 0.0) / 60.0 * self.pole_pairs / (self.rated_frequency_hz or math.inf)

    def critical_values(self) -> tuple[float, float]:
        """Critical torque M_c (N·m) and slip s_c, as given or of the motor with this nameplate.

        M_c is the breakdown ratio λ times the rated torque; s_c = s_r (λ + √(λ² - 1)) follows from Kloss's formula,
        which gives the rated torque at the rated slip s_r < s_c.
        """
        power, speed, ratio = self.rated_power_w, self.rated_speed_rpm, self.breakdown_ratio
        if power is None or speed is None or ratio is None:
            return self.critical_torque_n_m, self.critical_slip
        rated_torque = power / (TURN * speed / 60.0)
        return ratio * rated_torque, self.rated_slip * (ratio + math.sqrt(ratio * ratio - 1.0))

    def critical_slip_speed(self, frequency: float) -> float:
        """Difference between synchronous speed and speed at the critical torque (rad/s), at a supply frequency (Hz)."""
        return self.critical_slip * (TURN * (self.rated_frequency_hz or frequency) / self.pole_pairs)

    def torque(self, slip_speed: T, frequency: float) -> T:
        """Torque by Kloss's formula (N·m) at slip speeds ω_0 - ω (rad/s) and a supply frequency above 0 (Hz)."""
        critical = self.critical_slip_speed(frequency)
        torque: T = kloss(slip_speed, critical, self.critical_torque_n_m)
        return torque


class Exciter(Motor):
    """An unbalance and its motor."""

    unbalance_mass_kg: Positive | None = described(
        None, "m_i", "unbalance mass; default: machine.unbalance_mass_kg", "5 … 100"
    )
    unbalance_radius_m: Positive = described(0.09, "r_i", "radius of the unbalance", "0.03 … 0.15")
    static_moment_kg_m: Positive | None = described(
        None, "k_i", "static moment of the unbalance (mass times radius), instead of unbalance_radius_m", "0.1 … 10"
    )
    position_m: Annotated[list[Real], Field(min_length=2, max_length=2)] | None = described(
        None,
        "p_i",
        "axis [x, y], measured from the platform's own centre of mass; default: from machine.exciter_distance_m "
        "and machine.exciter_angle_deg",
        "0.1 … 1.5 each",
    )
    rotor_inertia_kg_m2: Positive = described(0.8e-3, "J_d,i", "moment of inertia of the rotor", "0.005 … 0.5")
    mounted_on: Literal["ground", "deck"] = described(
        "ground",
        "delta_i",
        "where the motor stands: ground, as in the paper, whose platform feels no reaction; or deck: the motor is "
        "bolted to the platform, which takes the reaction of its torque and of the resistance. Torque, slip and power "
        "are those of the exciter's own speed",
    )
    rotation: Rotation | None = described(
        None, "sigma_i", "sense in which the motor drives; default: exciter 1 counter-clockwise, exciter 2 clockwise"
    )

    alternatives: ClassVar[tuple[tuple[str, str], ...]] = (
        *Motor.alternatives,
        ("unbalance_radius_m", "static_moment_kg_m"),
    )

    @property
    def direction(self) -> float:
        """Direction σ in which the motor drives: +1 counter-clockwise, −1 clockwise."""
        return -1.0 if self.rotation == "clockwise" else 1.0

    def resolved(self, common_mass: float) -> Exciter:
        """Return it with radius, critical torque and slip, however they are given; the machine's mass is in kg."""
        mass, moment = self.unbalance_mass_kg or common_mass, self.static_moment_kg_m
        if self.rated_power_w is moment is None:
            return self
        torque, slip = self.critical_values()
        radius = self.unbalance_radius_m if moment is None else moment / mass
        changes = {"unbalance_radius_m": radius, "critical_torque_n_m": torque, "critical_slip": slip}
        return self.model_copy(update=changes)


class Machine(Section):
    """Platform, springs and exciters; the defaults are the paper's test rig (section 3)."""

    platform_mass_kg: Positive = described(12.42, "m_0", "mass of the platform, without the unbalances", "200 … 5000")
    platform_inertia_kg_m2: Positive = described(
        0.11, "J_0", "moment of inertia of the platform about its centre of mass", "20 … 15 000"
    )
    unbalance_mass_kg: Positive = described(
        0.045, "m_r", "unbalance mass of each exciter; section exciters may set them separately", "5 … 100"
    )
    unbalance_radius_m: Positive = described(
        0.09, "r", "radius of each unbalance; section exciters may set them separately", "0.03 … 0.15"
    )
    rotor_inertia_kg_m2: Positive = described(
        0.8e-3, "J_d", "moment of inertia of each rotor; section exciters may set them separately", "0.005 … 0.5"
    )
    exciter_distance_m: NonNegative = described(
        0.128, "rho", "distance of each exciter axis from the platform's centre of mass", "0.1 … 1.5"
    )
    exciter_angle_deg: Real = described(
        22.5, "gamma_1", "direction of the axis of exciter 1 from the x axis; exciter 2 is its mirror image", "-90 … 90"
    )
    stiffness_x_n_per_m: NonNegative = described(
        580e3, "c_x", "stiffness of the springs along x", "natural frequency 1 … 4 Hz"
    )
    stiffness_y_n_per_m: Positive = described(
        470e3, "c_y", "stiffness of the springs along y", "natural frequency 2 … 4 Hz"
    )
    stiffness_phi_n_m_per_rad: NonNegative = described(
        1.8e3, "c_phi", "stiffness of the springs against rotation", "natural frequency 2 … 6 Hz"
    )
    damping_x_n_s_per_m: NonNegative = described(
        300.0, "b_x", "damping of the springs along x", "damping ratio 0.02 … 0.1"
    )
    damping_y_n_s_per_m: NonNegative = described(
        40.0, "b_y", "damping of the springs along y", "damping ratio 0.02 … 0.1"
    )
    damping_phi_n_m_s_per_rad: NonNegative = described(
        0.77, "b_phi", "damping of the springs against rotation", "damping ratio 0.02 … 0.1"
    )
    gravity_m_per_s2: NonNegative = described(9.81, "g", "acceleration of gravity")


def _not_bool(value: Any) -> Any:
    """Refuse true and false, which Python treats as 1 and 0."""
    if isinstance(value, bool):
        raise PydanticCustomError("literal_error", "no number", {"expected": "1 or 2"})
    return value


class Material(Section):
    """The material on the platform; a mass ratio of 0 means a bare platform."""

    mass_ratio: NonNegative = described(
        0.0, "mu_w", "mass of the material divided by the mass of the machine, m_w / M; 0: bare platform", "0.1 … 0.5"
    )
    mass_kg: NonNegative | None = described(
        None, "m_w", "mass of the material, instead of mass_ratio", "0.1 … 0.5 of the machine"
    )
    layers: Annotated[Literal[1, 2], BeforeValidator(_not_bool)] = Field(
        2, description="number of layers of the material; 1 for a thin layer"
    )
    lower_share: Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)] = described(
        0.75, "m_w1 / m_w", "mass of the lower layer as a fraction of the material; used with two layers"
    )
    natural_frequency_hz: Positive | None = described(
        None, "sqrt(c_w/m_w2) / 2 pi", "natural frequency of the upper layer on the lower one", "20 … 60"
    )
    stiffness_n_per_m: Positive | None = described(
        None, "c_w", "stiffness of the spring between the layers, instead of natural_frequency_hz"
    )
    damping_ratio: NonNegative | None = described(
        None, "b_w / (2 sqrt(c_w m_w2))", "damping ratio of the upper layer on the lower one; default: 0", "0.2 … 1"
    )
    damping_n_s_per_m: NonNegative | None = described(
        None, "b_w", "coefficient of the damper between the layers, instead of damping_ratio"
    )

    alternatives = (
        ("mass_kg", "mass_ratio"),
        ("natural_frequency_hz", "stiffness_n_per_m"),
        ("damping_ratio", "damping_n_s_per_m"),
    )

    @property
    def is_there(self) -> bool:
        """Whether there is any material."""
        return (self.mass_ratio if self.mass_kg is None else self.mass_kg) > 0.0

    @model_validator(mode="after")
    def _two_layers(self) -> Self:
        if self.is_there and self.layers == 2:
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
        "impact",
        description="impact: the material may lift off and strike the platform; non-impact: it acts as a viscous "
        "damper",
    )
    restitution: Fraction = described(0.0, "R", "coefficient of restitution of impacts", "0 … 0.3")
    restitution_threshold_m_per_s: NonNegative = described(
        0.0, "", "approach speed below which impacts are inelastic; 0: none", "0 … 0.1"
    )
    impact_law: Literal["conservative", "central", "printed"] = Field(
        "conservative",
        description="conservative: conserves momentum, and energy if R = 1; central: ignores the rotation of the "
        "platform, as the paper does; printed: the paper's formula",
    )
    viscous_per_mass_per_s: NonNegative = described(
        0.0, "beta", "non-impact: damping along y due to the material, divided by the mass of the material"
    )
    added_mass_share: Fraction = described(0.0, "", "non-impact: fraction of the material that moves with the platform")


class Transport(Section):
    """Motion of the material along the deck, with friction and an inclination."""

    friction: NonNegative = described(
        ..., "mu_k", "coefficient of friction between material and deck; 0: a smooth deck", "0.3 … 0.6"
    )
    static_friction: NonNegative | None = described(
        None, "mu_s", "coefficient of static friction, at least friction; default: friction", "0.3 … 0.8"
    )
    deck_angle_deg: Annotated[float, Field(gt=-90.0, lt=90.0, allow_inf_nan=False)] = described(
        0.0, "alpha", "decline of the deck towards +x; x and y are then along and normal to the deck", "0 … 20"
    )
    deck_height_m: Real = described(
        0.0, "h", "height of the deck's surface over the centre of mass of the machine", "-0.5 … 0.5"
    )
    deck_length_m: Positive | None = described(
        None, "", "length of the deck, for throughput and residence time", "1 … 8"
    )
    deck_width_m: Positive | None = described(None, "", "width of the deck, for throughput and wear", "0.5 … 3")

    @model_validator(mode="after")
    def _static_is_largest(self) -> Self:
        if self.static_friction is not None and self.static_friction < self.friction:
            raise ValueError(
                f"static_friction = {self.static_friction:g}; allowed: at least friction = {self.friction:g}"
            )
        return self

    @property
    def largest_friction(self) -> float:
        """Coefficient of static friction."""
        return self.friction if self.static_friction is None else self.static_friction

    @property
    def runs_away(self) -> bool:
        """Whether material that slips becomes faster and faster."""
        return math.tan(abs(self.angle)) > self.friction

    @property
    def angle(self) -> float:
        """Decline of the deck (rad)."""
        return math.radians(self.deck_angle_deg)


#: Columns of a trajectory that are no part of the state, and how others begin.
DERIVED = {
    *("t_s", "mode", "contact_force_n", "friction_force_n", "supply_frequency_hz"),
    *("motor_power_1_w", "motor_power_2_w"),
}
DERIVED_BEGIN = ("acceleration_", "foundation_")


class State(Section):
    """A full state. Omitted coordinates are at static rest; omitted angles of exciters and omitted rates are 0.

    The last row of a trajectory can be given unchanged: columns that follow from the state, and time, are left out.
    """

    x_m: Real | None = described(
        None, "x", "displacement of the machine's centre of mass along x, from unstressed springs"
    )
    y_m: Real | None = described(
        None, "y", "displacement of the machine's centre of mass along y, from unstressed springs"
    )
    phi_rad: Real | None = described(None, "phi", "rotation of the platform")
    phi1_rad: Angle | None = described(None, "phi_1", "angle of exciter 1, counter-clockwise")
    phi2_rad: Angle | None = described(None, "phi_2", "angle of exciter 2, counter-clockwise")
    gap_m: NonNegative | None = described(None, "y_w1", "gap between platform and lower layer; 0: in contact")
    upper_m: Real | None = described(None, "y_w2", "displacement of the upper layer from the lower one; 0: unstressed")
    x_rate_m_per_s: Real = described(0.0, "dx/dt", "velocity along x")
    y_rate_m_per_s: Real = described(0.0, "dy/dt", "velocity along y")
    phi_rate_rad_per_s: Real = described(0.0, "dphi/dt", "angular velocity of the platform")
    phi1_rate_rad_per_s: Real = described(0.0, "dphi_1/dt", "angular velocity of exciter 1")
    phi2_rate_rad_per_s: Real = described(0.0, "dphi_2/dt", "angular velocity of exciter 2")
    gap_rate_m_per_s: Real = described(0.0, "dy_w1/dt", "rate of change of the gap")
    upper_rate_m_per_s: Real = described(0.0, "dy_w2/dt", "rate of change of upper_m")
    along_m: Real = described(0.0, "s", "displacement of the material along the deck, with transport")
    along_rate_m_per_s: Real = described(0.0, "ds/dt", "velocity of the material along the deck")

    @model_validator(mode="before")
    @classmethod
    def _without_derived(cls, tree: Any) -> Any:
        if not isinstance(tree, dict):
            return tree
        names = {key for key in tree if key in DERIVED or str(key).startswith(DERIVED_BEGIN)}
        return {key: value for key, value in tree.items() if key not in names}


#: Keys of an initial condition with rotating exciters.
PHASES = ("phase_difference_rad", "phi1_rad", "speed_ratio")


class Initial(Section, populate_by_name=True):
    """Initial state: static rest of platform and material with rotating exciters, a full state, or a run's end."""

    phase_difference_rad: Angle | None = described(
        None,
        "Delta phi",
        "initial phase difference: phi_1 + phi_2 for counter-rotating exciters, phi_1 - phi_2 for co-rotating "
        "ones; default: pi",
    )
    phi1_rad: Angle | None = described(
        None,
        "phi_1",
        "initial angle of exciter 1; default: 0, or -pi/2 plus the decline of the deck (both unbalances hang straight "
        "down) if speed_ratio is 0 and no angle is given",
    )
    speed_ratio: Real = described(
        0.98, "", "initial speed of both exciters divided by the synchronous speed", "0: from rest; 0.98: running"
    )
    state: State | None = described(None, "", "a full state, such as the last row of a trajectory")
    from_: Annotated[str, Field(min_length=1)] | None = Field(
        None, alias="from", description="directory of a run; the new run continues from its end, in state and in time"
    )

    alternatives = (
        ("state", "from"),
        *((way, key) for way in ("state", "from") for key in PHASES),
    )

    def angles(self, sign: float, hanging: float) -> tuple[float, float]:
        """Angles φ₁ and φ₂ of the exciters (rad); ``sign`` is that of φ₂ in the phase difference."""
        return exciter_angles(self.phase_difference_rad, self.phi1_rad, self.speed_ratio, sign, hanging)


def exciter_angles(
    given: float | None, phi1: float | None, speed_ratio: float, sign: float, hanging: float
) -> tuple[float, float]:
    """Angles φ₁ and φ₂ of the exciters (rad) at a phase difference; ``hanging``, where nothing else is said."""
    if given is None and phi1 is None and speed_ratio == 0.0:
        return hanging, hanging
    first = phi1 or 0.0
    return first, sign * ((math.pi if given is None else given) - first)


class Run(Section):
    """Duration and initial state of a run."""

    duration_s: Positive = described(4.0, "", "simulated time", "5 … 30")
    initial: Initial = Field(Initial(), description="initial condition of the run")
    perturbation: Fraction | None = described(
        None,
        "",
        f"random change of the initial rates of platform and exciters (scaled units); default: {PERTURBATION:g}, or "
        "0 if initial gives a state or a run, or if no motor is on during the run",
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(0, description="seed of the perturbation")
