"""Platform and unbalances as one rigid body: its mass, where its centre is, and its moment of inertia."""

from __future__ import annotations

import math
from typing import NamedTuple

from vibroplat.config.sections import Exciter, Machine

#: A pair of numbers for both exciters, or of coordinates x and y.
Pair = tuple[float, float]


class RigidBody(NamedTuple):
    """The platform with both unbalances as points at their axes.

    Attributes
    ----------
    mass
        M = m_0 + m_1 + m_2 (kg).
    masses
        Unbalance masses m_1, m_2 (kg).
    centre
        Common centre of mass c = (m_1 p_1 + m_2 p_2)/M, from the platform's own (m).
    axes
        Axes P_i = p_i - c of the exciters from there (m).
    distance
        The larger distance |p_i| of the axes from the platform's own centre of mass (m).
    inertia
        J = J_0 + m_0 |c|² + m_1 |P_1|² + m_2 |P_2|² about the common centre of mass (kg·m²).
    safe_rotation
        Rotation φ up to which the mass matrix is positive definite at all angles of the exciters (rad). To first order
        in φ a rotation moves the axes out by √(1 + φ²) but leaves J unchanged; up to here this error of J, φ²(J - J_0),
        is at most J_0.
    """

    mass: float
    masses: Pair
    centre: Pair
    axes: tuple[Pair, Pair]
    distance: float
    inertia: float
    safe_rotation: float


def rigid_body(machine: Machine, exciters: tuple[Exciter, Exciter]) -> RigidBody:
    """Put platform and unbalances together; what an exciter does not give is the machine's."""
    angle = math.radians(machine.exciter_angle_deg)
    x, y = machine.exciter_distance_m * math.cos(angle), machine.exciter_distance_m * math.sin(angle)
    m_1, m_2 = (exciter.unbalance_mass_kg or machine.unbalance_mass_kg for exciter in exciters)
    x_1, y_1 = exciters[0].position_m or (x, y)
    x_2, y_2 = exciters[1].position_m or (-x, y)
    mass = machine.platform_mass_kg + m_1 + m_2
    x_c, y_c = (m_1 * x_1 + m_2 * x_2) / mass, (m_1 * y_1 + m_2 * y_2) / mass
    (p_1, q_1), (p_2, q_2) = (x_1 - x_c, y_1 - y_c), (x_2 - x_c, y_2 - y_c)
    points = m_1 * (p_1 * p_1 + q_1 * q_1) + m_2 * (p_2 * p_2 + q_2 * q_2)
    shifted, own = machine.platform_mass_kg * (x_c * x_c + y_c * y_c) + points, machine.platform_inertia_kg_m2
    return RigidBody(
        mass=mass,
        masses=(m_1, m_2),
        centre=(x_c, y_c),
        axes=((p_1, q_1), (p_2, q_2)),
        distance=max(math.hypot(x_1, y_1), math.hypot(x_2, y_2)),
        inertia=own + shifted,
        safe_rotation=math.sqrt(own / shifted) if shifted > 0.0 else math.inf,
    )
