"""The exciters of a scene: an unbalance on the shaft of an induction motor, each with numbers of its own."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from vibroplat.config.fields import NonNegative, Positive, Section, described

Rotation = Literal["counter-clockwise", "clockwise"]

#: Rotations of exciters 1 and 2 where they are not given.
ROTATIONS: tuple[Rotation, Rotation] = ("counter-clockwise", "clockwise")


class Motor(Section):
    """An induction motor (Kloss formula) and its resistance to rotation."""

    critical_torque_n_m: NonNegative = described(1.2, "M_c", "critical torque, the largest; 0: supply switched off")
    critical_slip: Positive = described(0.15, "s_c", "slip at the critical torque")
    pole_pairs: Annotated[int, Field(ge=1, le=1000)] = described(
        2, "P", "pole pairs; the synchronous speed is 2 pi f_e / P"
    )
    friction_radius_m: NonNegative = described(5.0e-5, "k_R", "resistance: bearing friction times shaft radius")
    rated_frequency_hz: Positive | None = described(
        None,
        "",
        "supply frequency at which critical_slip is measured; the critical slip speed stays the same at "
        "all others, as with an inverter of constant V/f; not given: the critical slip stays the same",
    )

    def critical_slip_speed(self, frequency: float) -> float:
        """Difference between synchronous speed and speed at the critical torque (rad/s), at a supply frequency (Hz)."""
        return self.critical_slip * (2.0 * math.pi * (self.rated_frequency_hz or frequency) / self.pole_pairs)


class Exciter(Motor):
    """An unbalance and its motor. The unbalance mass is the machine's, common to both."""

    unbalance_radius_m: Positive = described(0.09, "r_i", "radius of the unbalance")
    rotor_inertia_kg_m2: Positive = described(0.8e-3, "J_d,i", "moment of inertia of the rotor")
    rotation: Rotation | None = described(
        None, "sigma_i", "in which its motor drives it; not given: exciter 1 counter-clockwise, exciter 2 clockwise"
    )

    @property
    def direction(self) -> float:
        """Direction σ in which the motor drives: +1 counter-clockwise, −1 clockwise."""
        return -1.0 if self.rotation == "clockwise" else 1.0
