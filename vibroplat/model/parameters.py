"""The parameter vector that compiled code reads, and how a scene fills it.

Compiled kernels take plain float arrays, so that the same kernels serve callbacks from Python and
from C. The integers below are the places in that array.
"""

from __future__ import annotations

import numpy as np

from vibroplat.kernels.compiled import FloatArray
from vibroplat.scene import Scene

__all__ = ["FloatArray", "parameters"]

MASS = 0  # M
INERTIA = 1  # J
UNBALANCE = 2  # k = m_r r
EXCITER_INERTIA = 3  # J_e
AXIS_X = 4  # X_0
AXIS_Y = 5  # Y_0
STIFFNESS_X = 6
STIFFNESS_Y = 7
STIFFNESS_PHI = 8
DAMPING_X = 9
DAMPING_Y = 10
DAMPING_PHI = 11
GRAVITY = 12
TORQUE_1 = 13  # M_c, s_c, omega_0, k_R k of exciter 1 …
SLIP_1 = 14
SPEED_1 = 15
FRICTION_1 = 16
TORQUE_2 = 17  # … and of exciter 2
SLIP_2 = 18
SPEED_2 = 19
FRICTION_2 = 20
LOWER_MASS = 21  # m_w1
UPPER_MASS = 22  # m_w2
LAYER_STIFFNESS = 23  # c_w / m_w2
LAYER_DAMPING = 24  # b_w / m_w2
RESTITUTION = 25
STICKING_SPEED = 26  # slower impacts have no restitution
IMPACT_LAW = 27  # index into IMPACT_LAWS
TOLERANCE = 28
FORCE_NOISE = 29  # contact forces below this are round-off of larger ones
SAFE_ROTATION = 30  # up to here the mass matrix is positive definite
SIZE = 31

IMPACT_LAWS = ("conservative", "central", "printed")
CONSERVATIVE, CENTRAL, PRINTED = 0, 1, 2


def parameters(scene: Scene) -> FloatArray:
    """Fill the parameter vector of a scene, shape (SIZE,), SI units."""
    machine = scene.machine
    p = np.zeros(SIZE)
    p[MASS] = scene.platform_mass
    p[INERTIA] = machine.inertia
    p[UNBALANCE] = machine.unbalance
    p[EXCITER_INERTIA] = machine.exciter_inertia
    p[AXIS_X], p[AXIS_Y] = machine.exciter_axis
    p[STIFFNESS_X] = machine.stiffness_x_n_per_m
    p[STIFFNESS_Y] = machine.stiffness_y_n_per_m
    p[STIFFNESS_PHI] = machine.stiffness_phi_n_m_per_rad
    p[DAMPING_X] = machine.damping_x_n_s_per_m
    p[DAMPING_Y] = scene.damping_y
    p[DAMPING_PHI] = machine.damping_phi_n_m_s_per_rad
    p[GRAVITY] = machine.gravity_m_per_s2
    for first, motor, speed in zip((TORQUE_1, TORQUE_2), scene.motor_pair, scene.synchronous_speeds, strict=True):
        p[first] = motor.critical_torque_n_m
        p[first + 1] = motor.critical_slip
        p[first + 2] = speed
        p[first + 3] = motor.friction_radius_m * machine.unbalance
    p[LOWER_MASS], p[UPPER_MASS] = scene.layer_masses
    p[LAYER_STIFFNESS], p[LAYER_DAMPING] = scene.layer_spring
    p[RESTITUTION] = scene.contact.restitution
    p[STICKING_SPEED] = scene.contact.sticking_speed_m_per_s
    p[IMPACT_LAW] = IMPACT_LAWS.index(scene.contact.impact_law)
    p[TOLERANCE] = scene.solver.tolerance
    p[FORCE_NOISE] = 1e-12 * scene.force_scale
    p[SAFE_ROTATION] = machine.safe_rotation
    return p
