"""Scenes, random states and small numerics that the tests of the physics share."""

import numpy as np
import pytest

from vibroplat.config.drive import Drive, Entry
from vibroplat.config.scene import Scene
from vibroplat.config.sections import Contact, Exciter, Machine, Material, Motor
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import FULL_SIZE, SYSTEMS

#: A machine on which no mass, lever or angle is small or round.
LOPSIDED = {
    "platform_mass_kg": 9.3,
    "unbalance_mass_kg": 0.8,
    "exciter_distance_m": 0.31,
    "exciter_angle_deg": -52.0,
    "damping_y_n_s_per_m": 430.0,
    "gravity_m_per_s2": 7.3,
}

UNEQUAL_MOTORS = [Motor(), Motor(critical_torque_n_m=0.9, critical_slip=0.21, pole_pairs=3, friction_radius_m=8.0e-5)]


#: What two exciters have of their own: unbalance masses, axes from the platform's own centre of mass.
OWN = [
    {"unbalance_mass_kg": 0.8, "position_m": [0.21, -0.08]},
    {"unbalance_mass_kg": 0.3, "position_m": [-0.13, 0.17], "mounted_on": "deck"},
]


def exciters(first, second, own=({}, {}), **changes):
    """Return exciters that share nothing but, as long as they have no own ones, unbalance mass and axes' distance."""
    motor = UNEQUAL_MOTORS[1].model_dump(exclude_none=True)
    return [
        Exciter(unbalance_radius_m=0.07, rotor_inertia_kg_m2=1.7e-3, rotation=first, **changes, **own[0]),
        Exciter(unbalance_radius_m=0.12, rotor_inertia_kg_m2=0.9e-3, rotation=second, **motor, **own[1]),
    ]


#: When residuals, Jacobians and accelerations are evaluated (s); within the rise of :data:`RISING`.
TIME = 1.7

#: A supply that rises, and had risen slower before.
RISING = Drive(program=[Entry(t_s=t, supply_frequency_hz=f) for t, f in ((0.0, 10.0), (1.0, 30.0), (3.0, 68.0))])

#: What scenes have besides their material. The rig of the paper, a lopsided machine, one whose unequal exciters turn
#: the same way, one on which both turn against the usual, under a rising supply, while the critical slip speed of its
#: first motor does not rise; and one whose exciters share nothing, not even the distance of their axes. A motor of each
#: of the last two is bolted to the deck.
SETUPS = {
    "paper": {"motors": UNEQUAL_MOTORS},
    "lopsided": {"machine": Machine(**LOPSIDED, rotor_inertia_kg_m2=2.0e-3), "motors": UNEQUAL_MOTORS},
    "co-rotating": {"machine": Machine(**LOPSIDED), "exciters": exciters("clockwise", "clockwise")},
    "rising": {
        "machine": Machine(**LOPSIDED),
        "exciters": exciters("clockwise", "counter-clockwise", rated_frequency_hz=55.0, mounted_on="deck"),
        "drive": RISING,
    },
    "uneven": {"machine": Machine(**LOPSIDED), "exciters": exciters("clockwise", "clockwise", OWN)},
}

MATERIALS = {
    0: Material(),
    1: Material(mass_ratio=0.13, layers=1),
    2: Material(mass_ratio=0.2, lower_share=0.7, natural_frequency_hz=18.5, damping_ratio=0.05),
}

RECORDS = tuple(SETUPS)


def name_of(system):
    return f"{system.mode.label}-{system.layers}"


#: Systems without transport.
PLAIN = [system for system in SYSTEMS if not system.slides]
EACH_SYSTEM = pytest.mark.parametrize("system", PLAIN, ids=name_of)
#: Each system with two of the machines, and each machine with two of the systems.
PAIRS = [(system, RECORDS[(system.index + k) % 5]) for system in PLAIN for k in (0, 2)]
EACH_PAIR = pytest.mark.parametrize(("system", "machine"), PAIRS, ids=[f"{name_of(s)}-{m}" for s, m in PAIRS])

#: Realistic sizes of the full state: m and rad, then m/s and rad/s; the angles go round several times.
SIZES = np.array([1e-3, 2e-3, 1e-2, 20.0, 20.0, 1e-3, 1e-3, 0.2, 0.4, 1.0, 150.0, 150.0, 0.4, 0.3])


def scene_of(layers, machine="paper", **contact):
    constant = {"drive": Drive(supply_frequency_hz=51.5)}
    return Scene(**constant | SETUPS[machine], material=MATERIALS[layers], contact=Contact(**contact))


def record_of(layers, machine):
    return parameters(scene_of(layers, machine), TIME)


def random_states(seed, count):
    """Return full states of realistic size, shape (count, 14), with gaps that are not negative."""
    states = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, FULL_SIZE)) * SIZES
    states[:, 5] = np.abs(states[:, 5])
    return states


def settled(system, differential, p, time=TIME):
    """Return (y, y′, y″, whether there are any) of a state; `differential` holds the differential unknowns."""
    y, yp, ypp = np.zeros(system.size), np.empty(system.size), np.empty(system.size)
    y[: system.differential] = differential[: system.differential]
    exists = accelerations(system.index, time, y, yp, p) and second_derivatives(system.index, time, y, yp, ypp, p)
    return y, yp, ypp, exists


def torque_by_quotient(motor, frequency, direction, speed):
    """Return Kloss's torque 2M_c/(s/s_c + s_c/s) at a supply frequency (Hz)."""
    synchronous = 2.0 * np.pi * frequency / motor.pole_pairs
    slip = (synchronous - direction * speed) / synchronous
    # the critical slip speed s_c ω₀ of the rated frequency is that at all others, if there is one
    ratio = slip / (motor.critical_slip * (motor.rated_frequency_hz or frequency) / frequency)
    return direction * 2.0 * motor.critical_torque_n_m / (ratio + 1.0 / ratio)


def central_difference(function, step):
    """Differentiate at 0; the error is of sixth order in the step."""
    weights = ((1, 45.0 / 60.0), (2, -9.0 / 60.0), (3, 1.0 / 60.0))
    return sum(weight * (function(n * step) - function(-n * step)) for n, weight in weights) / step


def mass_matrix(state, scene):
    """Return the 5×5 mass matrix of model.md, in the order (x, y, φ, φ₁, φ₂)."""
    matrix = np.diag([scene.body.mass, scene.body.mass, scene.body.inertia, *scene.exciter_inertias])
    for i, (k, (x0, y0)) in enumerate(zip(scene.unbalances, scene.body.axes, strict=True)):
        sine, cosine = np.sin(state[3 + i]), np.cos(state[3 + i])
        axis_x, axis_y = x0 - state[2] * y0, y0 + state[2] * x0
        coupling = k * np.array([-sine, cosine, axis_x * cosine + axis_y * sine])
        matrix[3 + i, :3] = matrix[:3, 3 + i] = coupling
    return matrix
