"""The equations of motion derived anew: point masses, Lagrange, then the paper's first-order axes."""

import numpy as np
import pytest

from vibroplat.config.coordinates import Mode
from vibroplat.config.sections import Material
from vibroplat.model.impact import impulse_response
from vibroplat.model.parameters import PARAMETERS, parameters

from .helpers import (
    EACH_MACHINE,
    EACH_RECORD,
    EACH_SYSTEM,
    TIME,
    UNEVEN,
    random_states,
    record_of,
    scene_of,
    settled,
)

STATES = 24


def lagrange():
    from .lagrange import lagrange

    return lagrange()


def contact_direction():
    from .lagrange import contact_direction

    return contact_direction()


def keys_of_exciters(scene):
    """Return radii, rotor inertias and directions of both exciters, and their motors, as the scene is given them."""
    if scene.exciters is None:
        both = (scene.machine.unbalance_radius_m, scene.machine.rotor_inertia_kg_m2)
        return *((value, value) for value in both), (1.0, -1.0), scene.motors
    first, second = scene.exciters
    signs = {"counter-clockwise": 1.0, "clockwise": -1.0}
    return (
        (first.unbalance_radius_m, second.unbalance_radius_m),
        (first.rotor_inertia_kg_m2, second.rotor_inertia_kg_m2),
        (signs[first.rotation], signs[second.rotation]),
        scene.exciters,
    )


def constants(scene, *, uneven=False):
    """Return the values of CONSTANTS, from what the scene is given; its exciters may be the uneven ones."""
    m, material = scene.machine, scene.material
    if uneven:
        (x_1, y_1), (x_2, y_2) = UNEVEN["axis"]
        exciters = (*UNEVEN["mass"], *UNEVEN["radius"], *UNEVEN["rotor"], x_1, y_1, x_2, y_2)
    else:
        gamma = np.radians(m.exciter_angle_deg)
        x, y = m.exciter_distance_m * np.array([np.cos(gamma), np.sin(gamma)])
        radii, rotors, *_ = keys_of_exciters(scene)
        exciters = (m.unbalance_mass_kg, m.unbalance_mass_kg, *radii, *rotors, x, y, -x, y)
    share = material.lower_share if material.layers == 2 else 1.0
    masses = material.mass_ratio * (m.platform_mass_kg + 2.0 * m.unbalance_mass_kg)
    lower, upper = share * masses, (1.0 - share) * masses
    spring = upper * (2.0 * np.pi * (material.natural_frequency_hz or 0.0)) ** 2
    damper = 2.0 * (material.damping_ratio or 0.0) * np.sqrt(spring * upper)
    return (
        *(m.platform_mass_kg, m.platform_inertia_kg_m2),
        *(m.stiffness_x_n_per_m, m.stiffness_y_n_per_m, m.stiffness_phi_n_m_per_rad),
        *(m.damping_x_n_s_per_m, m.damping_y_n_s_per_m, m.damping_phi_n_m_s_per_rad),
        *(m.gravity_m_per_s2, lower, upper, spring, damper),
        *exciters,
    )


def supply_frequency(scene):
    """Return the supply frequency at TIME, from the keys of the drive."""
    if scene.drive.program is None:
        return scene.drive.supply_frequency_hz
    return np.interp(
        TIME, *zip(*((entry.t_s, entry.supply_frequency_hz) for entry in scene.drive.program), strict=True)
    )


def net_torque(motor, frequency, direction, speed, unbalance):
    """Return Kloss's torque 2M_c/(s/s_c + s_c/s) less the resistance k_R m_r r φ̇²."""
    synchronous = 2.0 * np.pi * frequency / motor.pole_pairs
    slip = (synchronous - direction * speed) / synchronous
    # the critical slip speed s_c ω₀ of the rated frequency is that at all others, if there is one
    ratio = slip / (motor.critical_slip * (motor.rated_frequency_hz or frequency) / frequency)
    driving = direction * 2.0 * motor.critical_torque_n_m / (ratio + 1.0 / ratio)
    return driving - np.sign(speed) * motor.friction_radius_m * unbalance * speed**2


def expected(system, state, scene, *, uneven):
    """Return accelerations of the system's coordinates and F_c by Lagrange's equations."""
    moving = [int(c) for c in system.places[: system.differential // 2]]
    given = constants(scene, uneven=uneven)
    unbalances = np.multiply(given[13:15], given[15:17])
    _, _, directions, motors = keys_of_exciters(scene)
    exciters = zip(motors, UNEVEN["direction"] if uneven else directions, state[10:12], unbalances, strict=True)
    torques = [net_torque(motor, supply_frequency(scene), *exciter) for motor, *exciter in exciters]
    mass, forces = lagrange()(state[:7], state[7:], given, torques)
    rows, columns = moving, mass[:, moving]
    if system.mode is Mode.ATTACHED:
        # ÿ_w1 = 0 takes the place of an unknown acceleration, F_c that of the unknown
        rows = [*moving, 5]
        columns = np.column_stack([columns, -contact_direction()])
    return np.linalg.solve(columns[rows], forces[rows, 0])


def scene_behind(layers, machine):
    """Return the scene from which the record of a machine is made."""
    return scene_of(layers, "lopsided" if machine == "uneven" else machine)


@EACH_RECORD
@EACH_SYSTEM
def test_accelerations_and_contact_force_are_those_of_lagrange(system, machine):
    scene, p = scene_behind(system.layers, machine), record_of(system.layers, machine)
    n = system.differential // 2
    wanted, got = [], []
    for full in random_states(seed=1, count=STATES):
        state = system.full(system.unknowns(full))
        y, yp, _, _ = settled(system, state[system.places], p)
        got.append(np.append(yp[n : 2 * n], y[2 * n :]))
        wanted.append(expected(system, state, scene, uneven=machine == "uneven"))
    # each acceleration, and F_c, relative to the largest of its kind over the states; two linear solves
    # of condition ~1e4 and sums that cancel leave some 1e-14
    scale = np.max(np.abs(wanted), axis=0)
    assert np.all(scale > 0.0)
    assert np.max(np.abs(np.array(got) - wanted) / scale) < 1e-12


@EACH_RECORD
def test_response_to_an_impulse_is_that_of_the_derived_mass_matrix(machine):
    given, p = constants(scene_behind(2, machine), uneven=machine == "uneven"), record_of(2, machine)
    response = np.empty(7)
    for state in random_states(seed=6, count=STATES):
        mass, _ = lagrange()(state[:7], state[7:], given, (0.0, 0.0))
        wanted = np.linalg.solve(mass, contact_direction())
        reduced = impulse_response(state, response, p)
        np.testing.assert_allclose(response, wanted, rtol=1e-12, atol=1e-13 * np.abs(wanted).max())
        assert reduced == pytest.approx(1.0 / wanted[5], rel=1e-13)


@EACH_MACHINE
def test_common_masses_and_inertia_come_out_of_the_derivation(machine):
    scene = scene_of(0, machine)
    mass, _ = lagrange()(np.zeros(7), np.zeros(7), constants(scene), (0.0, 0.0))
    m = scene.machine
    listed = [m.total_mass, m.total_mass, m.inertia, *scene.exciter_inertias]
    assert np.diag(mass)[:5] == pytest.approx(listed, rel=1e-14)
    # with φ₁ = φ₂ = 0 each unbalance lies beside its axis, and couples with y by its static moment
    assert mass[1, 3:5] == pytest.approx(scene.unbalances, rel=1e-14)


def assert_equal(found, expected):
    """Compare two records field by field."""
    for name in PARAMETERS.names:
        assert found[name] == pytest.approx(expected[name], rel=1e-14), name


def test_layer_spring_by_stiffness_or_by_frequency():
    by_frequency = scene_of(2)
    m_w2, c_w, b_w = constants(by_frequency)[10:13]
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
