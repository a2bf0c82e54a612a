"""The equations of motion derived anew: point masses, Lagrange, then the paper's first-order axes."""

from functools import cache

import numpy as np
import pytest
import sympy as sp

from vibroplat.model.parameters import PARAMETERS, parameters
from vibroplat.scene import Material, Mode

from .helpers import EACH_MACHINE, EACH_SYSTEM, random_states, scene_of, settled

STATES = 24

#: In the order of the full state; gap and upper are y_w1 and y_w2.
COORDINATES = sp.symbols("x y phi phi1 phi2 gap upper", real=True)
RATES = sp.symbols("vx vy vphi w1 w2 vgap vupper", real=True)
CONSTANTS = sp.symbols("m_0 J_0 m_r r J_d rho gamma c_x c_y c_phi b_x b_y b_phi g m_w1 m_w2 c_w b_w")
TORQUES = sp.symbols("torque1 torque2")


def point_masses():
    """Return (mass, position) of platform, unbalances and layers; O is the centre of mass of the first three."""
    x, y, phi, phi1, phi2, gap, upper = COORDINATES
    m_0, _, m_r, r, _, rho, gamma, *_ = CONSTANTS
    m_w1, m_w2 = CONSTANTS[14:16]
    # where the masses sit in the platform, from its own centre, the unbalances lumped at their axes
    masses = (m_0, m_r, m_r)
    places = [
        sp.Matrix([0, 0]),
        sp.Matrix([rho * sp.cos(gamma), rho * sp.sin(gamma)]),
        sp.Matrix([-rho * sp.cos(gamma), rho * sp.sin(gamma)]),
    ]
    centre = sum((m * place for m, place in zip(masses, places, strict=True)), sp.zeros(2, 1)) / sum(masses)
    turn = sp.Matrix([[sp.cos(phi), -sp.sin(phi)], [sp.sin(phi), sp.cos(phi)]])
    offsets = (0 * centre, *(r * sp.Matrix([sp.cos(angle), sp.sin(angle)]) for angle in (phi1, phi2)))
    machine = [
        (m, sp.Matrix([x, y]) + turn * (place - centre) + offset)
        for m, place, offset in zip(masses, places, offsets, strict=True)
    ]
    return [*machine, (m_w1, sp.Matrix([0, y + gap])), (m_w2, sp.Matrix([0, y + gap + upper]))]


def energies():
    """Return kinetic energy, potential energy and Rayleigh's dissipation function."""
    x, y, phi, *_, upper = COORDINATES
    vx, vy, vphi, w1, w2, _, vupper = RATES
    _, J_0, _, _, J_d, _, _, c_x, c_y, c_phi, b_x, b_y, b_phi, g, _, _, c_w, b_w = CONSTANTS
    kinetic = (J_0 * vphi**2 + J_d * (w1**2 + w2**2)) / 2
    potential = (c_x * x**2 + c_y * y**2 + c_phi * phi**2 + c_w * upper**2) / 2
    dissipation = (b_x * vx**2 + b_y * vy**2 + b_phi * vphi**2 + b_w * vupper**2) / 2
    for mass, position in point_masses():
        velocity = position.jacobian(COORDINATES) * sp.Matrix(RATES)
        kinetic += mass * velocity.dot(velocity) / 2
        potential += mass * g * position[1]
    return kinetic, potential, dissipation


def to_first_order(expression):
    """Put the axis turned to first order, (X₀ − φY₀, Y₀ + φX₀), into an equation of motion."""
    phi = COORDINATES[2]
    expanded = sp.expand(sp.expand(expression).subs(sp.cos(phi) ** 2, 1 - sp.sin(phi) ** 2))
    # squares must have cancelled to 1 (J is constant); what is left is an axis, linear in cos φ, sin φ
    assert sp.Poly(expanded, sp.sin(phi), sp.cos(phi)).total_degree() <= 1
    return expanded.subs({sp.sin(phi): phi, sp.cos(phi): 1})


@cache
def lagrange():
    """Return a function of (coordinates, rates, constants, torques) that gives mass matrix and forces.

    The rotation is exact all through the derivation and the axis is truncated only in the equations of
    motion, as the paper does: truncated in the energy already, J would grow with φ² and products of
    φ̇ with the linear axis would leave terms that the paper's equations do not have.
    """
    kinetic, potential, dissipation = energies()
    q, v = sp.Matrix(COORDINATES), sp.Matrix(RATES)
    momenta = sp.Matrix([kinetic]).jacobian(v).T
    mass = momenta.jacobian(v)
    forces = sp.Matrix([kinetic - potential]).jacobian(q).T - momenta.jacobian(q) * v
    forces -= sp.Matrix([dissipation]).jacobian(v).T
    forces += sp.Matrix([0, 0, 0, *TORQUES, 0, 0])
    arguments = (COORDINATES, RATES, CONSTANTS, TORQUES)
    result = (mass.applyfunc(to_first_order), forces.applyfunc(to_first_order))
    return sp.lambdify(arguments, result, modules="numpy", cse=True)


def contact_direction():
    """Return the generalized force of F_c = 1: +1 on the lower layer's y + y_w1, −1 on the platform's y."""
    y, gap = COORDINATES[1], COORDINATES[5]
    work = sp.Matrix([(y + gap) - y])
    return np.array(work.jacobian(COORDINATES), dtype=float).ravel()


def constants(scene):
    """Return the values of CONSTANTS, from what the scene is given."""
    m, material = scene.machine, scene.material
    share = material.lower_share if material.layers == 2 else 1.0
    masses = material.mass_ratio * (m.platform_mass_kg + 2.0 * m.unbalance_mass_kg)
    lower, upper = share * masses, (1.0 - share) * masses
    spring = upper * (2.0 * np.pi * (material.natural_frequency_hz or 0.0)) ** 2
    damper = 2.0 * (material.damping_ratio or 0.0) * np.sqrt(spring * upper)
    return (
        *(m.platform_mass_kg, m.platform_inertia_kg_m2, m.unbalance_mass_kg, m.unbalance_radius_m),
        *(m.rotor_inertia_kg_m2, m.exciter_distance_m, np.radians(m.exciter_angle_deg)),
        *(m.stiffness_x_n_per_m, m.stiffness_y_n_per_m, m.stiffness_phi_n_m_per_rad),
        *(m.damping_x_n_s_per_m, m.damping_y_n_s_per_m, m.damping_phi_n_m_s_per_rad),
        *(m.gravity_m_per_s2, lower, upper, spring, damper),
    )


def net_torque(motor, frequency, direction, speed, unbalance):
    """Return Kloss's torque 2M_c/(s/s_c + s_c/s) less the resistance k_R m_r r φ̇²."""
    synchronous = 2.0 * np.pi * frequency / motor.pole_pairs
    slip = (synchronous - direction * speed) / synchronous
    ratio = slip / motor.critical_slip
    driving = direction * 2.0 * motor.critical_torque_n_m / (ratio + 1.0 / ratio)
    return driving - np.sign(speed) * motor.friction_radius_m * unbalance * speed**2


def expected(system, state, scene):
    """Return accelerations of the system's coordinates and F_c by Lagrange's equations."""
    moving = [int(c) for c in system.places[: system.differential // 2]]
    torques = [
        net_torque(motor, scene.drive.supply_frequency_hz, direction, speed, scene.machine.unbalance)
        for motor, direction, speed in zip(scene.motor_pair, (1.0, -1.0), state[10:12], strict=True)
    ]
    mass, forces = lagrange()(state[:7], state[7:], constants(scene), torques)
    rows, columns = moving, mass[:, moving]
    if system.mode is Mode.ATTACHED:
        # ÿ_w1 = 0 takes the place of an unknown acceleration, F_c that of the unknown
        rows = [*moving, 5]
        columns = np.column_stack([columns, -contact_direction()])
    return np.linalg.solve(columns[rows], forces[rows, 0])


@EACH_MACHINE
@EACH_SYSTEM
def test_accelerations_and_contact_force_are_those_of_lagrange(system, machine):
    scene = scene_of(system.layers, machine)
    p = parameters(scene)
    n = system.differential // 2
    wanted, got = [], []
    for full in random_states(seed=1, count=STATES):
        state = system.full(system.unknowns(full))
        y, yp, _, _ = settled(system, state[system.places], p)
        got.append(np.append(yp[n : 2 * n], y[2 * n :]))
        wanted.append(expected(system, state, scene))
    # each acceleration, and F_c, relative to the largest of its kind over the states; two linear solves
    # of condition ~1e4 and sums that cancel leave some 1e-14
    scale = np.max(np.abs(wanted), axis=0)
    assert np.all(scale > 0.0)
    assert np.max(np.abs(np.array(got) - wanted) / scale) < 1e-12


@EACH_MACHINE
def test_common_masses_and_inertia_come_out_of_the_derivation(machine):
    scene = scene_of(0, machine)
    mass, _ = lagrange()(np.zeros(7), np.zeros(7), constants(scene), (0.0, 0.0))
    m = scene.machine
    derived = np.diag(mass)[:5]
    listed = [m.total_mass, m.total_mass, m.inertia, m.exciter_inertia, m.exciter_inertia]
    assert derived == pytest.approx(listed, rel=1e-14)


def assert_equal(found, expected):
    """Compare two records field by field."""
    for name in PARAMETERS.names:
        assert found[name] == pytest.approx(expected[name], rel=1e-14), name


def test_layer_spring_by_stiffness_or_by_frequency():
    by_frequency = scene_of(2)
    *_, m_w2, c_w, b_w = constants(by_frequency)
    material = by_frequency.material.model_dump(exclude={"natural_frequency_hz", "damping_ratio"})
    material |= {"stiffness_n_per_m": c_w, "damping_n_s_per_m": b_w}
    by_stiffness = by_frequency.model_copy(update={"material": Material(**material)})
    assert_equal(parameters(by_stiffness), parameters(by_frequency))
    assert m_w2 == pytest.approx(by_frequency.layer_masses[1], rel=1e-14)


def test_non_impact_model_is_a_bare_platform_with_friction_and_mass_added():
    contact = {"model": "non-impact", "viscous_per_mass_per_s": 70.0, "added_mass_share": 0.4}
    added, bare = parameters(scene_of(2, **contact)), parameters(scene_of(0))
    m_w = 0.2 * bare.mass
    bare.damping_y += 70.0 * m_w
    bare.mass += 0.4 * m_w
    assert_equal(added, bare)
