"""The constants of the equations, as a record with named fields.

Compiled kernels read ``p.mass`` or ``p.unbalance[1]`` from it at the cost of a place in an array. They are written for
any type of number in its fields: with complex ones they give derivatives (:mod:`vibroplat.model.sensitivity`).
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from vibroplat.config.coordinates import MAX_NAMED_POINTS
from vibroplat.config.drive import SupplyInterval
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray

__all__ = ["FloatArray", "Parameters", "parameters"]

#: A record of :data:`PARAMETERS`.
Parameters = np.record

#: Fields of shape (2,) are those of exciters 1 and 2. SI units.
PARAMETERS = np.dtype(
    [
        ("mass", float),  # M, platform with both unbalances (kg)
        ("inertia", float),  # J, about the common centre of mass (kg·m²)
        ("stiffness_x", float),  # c_x (N/m)
        ("stiffness_y", float),
        ("stiffness_phi", float),  # c_φ (N·m/rad)
        ("stiffness_x_phi", float),  # c_xφ, which couples x and φ: of springs above or below the centre of mass (N)
        ("stiffness_y_phi", float),
        ("damping_x", float),  # b_x (N·s/m)
        ("damping_y", float),  # b_y, plus β m_w in the non-impact model
        ("suspension_damping_y", float),  # b_y, what of it is between platform and foundation
        ("damping_phi", float),  # b_φ (N·m·s/rad)
        ("damping_x_phi", float),  # b_xφ (N·s)
        ("damping_y_phi", float),
        ("gravity", float),  # g, normal to the deck (m/s²)
        ("unbalance", float, (2,)),  # k_i = m_r r (kg·m)
        ("exciter_inertia", float, (2,)),  # J_e,i, about the exciter's axis (kg·m²)
        ("direction", float, (2,)),  # σ_i: the motor drives counter-clockwise (+1) or clockwise (−1)
        ("axis_x", float, (2,)),  # exciter's axis in the platform, from the common centre of mass (m)
        ("axis_y", float, (2,)),
        ("torque", float, (2,)),  # M_c (N·m); 0 for an exciter that is off
        ("since", float),  # when speed and slip_speed hold (s)
        ("speed", float, (2,)),  # ω_0, synchronous speed (rad/s)
        ("speed_ramp", float, (2,)),  # its rate (rad/s²)
        ("slip_speed", float, (2,)),  # s_c ω_0, critical slip speed (rad/s)
        ("slip_ramp", float, (2,)),  # its rate (rad/s²)
        ("friction", float, (2,)),  # k_R k_i (N·m·s²)
        ("deck", float, (2,)),  # δ_i: the motor is bolted to the platform, which takes its reaction (1), or not (0)
        ("lower_mass", float),  # m_w1 (kg)
        ("upper_mass", float),  # m_w2 (kg)
        ("layer_stiffness", float),  # c_w / m_w2 (1/s²)
        ("layer_damping", float),  # b_w / m_w2 (1/s)
        ("restitution", float),  # R
        ("sticking_speed", float),  # slower impacts have no restitution (m/s)
        ("point_x", float, (MAX_NAMED_POINTS,)),  # measured points of the platform, from the common centre of mass (m)
        ("point_y", float, (MAX_NAMED_POINTS,)),
        ("safe_rotation", float),  # |φ| up to which the mass matrix is positive definite (rad)
        ("impact_law", np.int64),  # index into IMPACT_LAWS
        ("slope", float),  # g_x, gravity along an inclined deck (m/s²)
        ("deck_height", float),  # h (m)
        ("kinetic_friction", float),  # μ_k and μ_s between material and deck
        ("static_friction", float),
        ("material_mass", float),  # m_w, where it moves along the deck (kg), and one over it (1/kg)
        ("material_share", float),
    ],
    align=True,
)

#: The same type, of records whose fields are attributes; and fields with zeros.
_RECORD, _ZEROS = np.dtype((np.record, PARAMETERS)), dict.fromkeys(PARAMETERS.names or (), 0.0)

IMPACT_LAWS = ("conservative", "central", "printed")
CONSERVATIVE, CENTRAL, PRINTED = range(3)


def blank_record() -> Parameters:
    """Make a record of zeros: the element of an array of one, its ``base``, which has an address."""
    record: Parameters = np.zeros(1, _RECORD)[0]
    return record


def record_words(p: Parameters) -> FloatArray:
    """View a record, whole, as numbers of 8 bytes: to copy it, which is slow field by field."""
    view: FloatArray = np.asarray(p).reshape(1).view(np.float64)
    return view


def plain(p: Parameters) -> SimpleNamespace:
    """Return the fields of a record as numbers of Python, which it reads far faster."""
    return SimpleNamespace(**dict(zip(PARAMETERS.names or (), p.tolist(), strict=True)))


def record_address(p: Parameters) -> int:
    """Address of a record that :func:`blank_record` has made."""
    assert isinstance(p.base, np.ndarray)
    return int(p.base.ctypes.data)


def parameters(scene: Scene, time: float = 0.0) -> Parameters:
    """Fill the record of a scene, with the supply as it is at a time (s)."""
    body, exciters, transport = scene.body, scene.exciter_pair, scene.transport
    stiffness, damping = scene.suspension
    unbalances, gravity = scene.unbalances, scene.gravity
    values: dict[str, Any] = _ZEROS | {
        "mass": scene.platform_mass,
        "inertia": body.inertia,
        "stiffness_x": stiffness[0][0],
        "stiffness_y": stiffness[1][1],
        "stiffness_phi": stiffness[2][2],
        "stiffness_x_phi": stiffness[0][2],
        "stiffness_y_phi": stiffness[1][2],
        "damping_x": damping[0][0],
        "damping_y": scene.damping_y,
        "suspension_damping_y": damping[1][1],
        "damping_phi": damping[2][2],
        "damping_x_phi": damping[0][2],
        "damping_y_phi": damping[1][2],
        "slope": gravity[0],
        "gravity": gravity[1],
        "unbalance": unbalances,
        "exciter_inertia": scene.exciter_inertias,
        "direction": [exciter.direction for exciter in exciters],
        "friction": [exciter.friction_radius_m * k for exciter, k in zip(exciters, unbalances, strict=True)],
        "deck": [exciter.mounted_on == "deck" for exciter in exciters],
        "restitution": scene.contact.restitution,
        "sticking_speed": scene.contact.restitution_threshold_m_per_s,
        "safe_rotation": body.safe_rotation,
        "impact_law": IMPACT_LAWS.index(scene.contact.impact_law),
        **_supplied(scene, scene.drive.at(time)),
    }
    values["axis_x"], values["axis_y"] = zip(*body.axes, strict=True)
    values["lower_mass"], values["upper_mass"] = scene.layer_masses
    values["layer_stiffness"], values["layer_damping"] = scene.layer_spring
    if transport is not None:
        values["deck_height"] = transport.deck_height_m
        values["kinetic_friction"], values["static_friction"] = transport.friction, transport.largest_friction
        values["material_mass"], values["material_share"] = scene.material_mass, 1.0 / scene.material_mass
    # all at once, in the order of the fields: field by field takes far longer; an unknown name is one value too many
    p: Parameters = np.array([tuple(values.values())], _RECORD)[0]
    for i, (x, y) in enumerate(scene.measured_points.values()):
        p["point_x"][i], p["point_y"][i] = x, y
    return p


def supply(p: Parameters, scene: Scene, interval: SupplyInterval) -> None:
    """Change what the supply says in a record: torque, synchronous and critical slip speed of both motors.

    The interval of the scene's drive is that which is to hold. The record is changed in place, so that all who hold it
    follow.
    """
    for name, value in _supplied(scene, interval).items():
        p[name] = value


def _supplied(scene: Scene, interval: SupplyInterval) -> dict[str, Any]:
    """Return the fields that follow from an interval of the supply."""
    exciters, (frequency, ramp) = scene.exciter_pair, interval.slip_frequency
    return {
        "since": interval.start if math.isfinite(interval.start) else 0.0,
        "speed": scene.synchronous_speeds_at(interval.frequency),
        "speed_ramp": scene.synchronous_speeds_at(interval.ramp),
        "torque": [e.critical_torque_n_m if on else 0.0 for e, on in zip(exciters, interval.driven, strict=True)],
        "slip_speed": [e.critical_slip_speed(frequency) for e in exciters],
        "slip_ramp": [e.critical_slip_speed(ramp) if e.rated_frequency_hz is None else 0.0 for e in exciters],
    }
