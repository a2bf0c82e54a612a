"""A ball on a table that is shaken by one motor: all is damped, so that its periodic orbits are isolated."""

import math

import numpy as np

from vibroplat.config.scene import Scene

GRAVITY = 9.81
OMEGA = 2.0 * math.pi * 25.0
MASS, DAMPING = 1e6, 0.2
STIFFNESS = MASS * (0.1 * OMEGA) ** 2


def amplitude(unbalance):
    """Amplitude of the table (m): a linear oscillator under a turning unbalance (kg·m)."""
    damper = 2.0 * DAMPING * math.sqrt(STIFFNESS * MASS)
    return unbalance * OMEGA**2 / math.hypot(STIFFNESS - MASS * OMEGA**2, damper * OMEGA)


def stable_range(restitution):
    """Range of Γ in which the orbit with one impact a period is stable (Luck and Mehta 1993)."""
    low = math.pi * (1.0 - restitution) / (1.0 + restitution)
    return low, math.hypot(low, 2.0 * (1.0 + restitution**2) / (1.0 + restitution) ** 2)


def jacobian(gamma_sine, restitution):
    """Of the map (impact phase, speed after it) ↦ the next ones, at the period-1 orbit, Γ sin φ given.

    In units of g/ω² and 1/ω: Γ sin θ' = Γ sin θ + w(θ' − θ) − (θ' − θ)²/2, w' = (1 + R)Γ cos θ' − R(w − θ' + θ),
    and w = π, θ' − θ = 2π, Γ cos θ = π(1 − R)/(1 + R) on the orbit.
    """
    gamma_cosine = math.pi * (1.0 - restitution) / (1.0 + restitution)
    shift = np.array([1.0, 2.0 * math.pi / (math.pi + gamma_cosine)])
    by_phase = -(1.0 + restitution) * gamma_sine + restitution
    return np.array([shift, by_phase * shift - restitution])


def shaken(gamma, restitution=0.0, gravity=GRAVITY):
    """Return a table with Γ = Aω²/g at this gravity, and one layer of 1e-12 of its mass.

    It begins just after the impact of the layer's orbit with one impact a period. Exciter 1 has a rotor that nothing
    slows down, exciter 2 hangs, much lighter and slowed down by a motor that nearly stands still.
    """
    unbalance = gamma * gravity / OMEGA**2 / amplitude(1.0)
    mass = 1e3
    rotor = {"rotor_inertia_kg_m2": 1e12, "critical_slip": 0.1, "pole_pairs": 1, "friction_radius_m": 0.0}
    slope = 0.1 * OMEGA * rotor["rotor_inertia_kg_m2"] * OMEGA / 4.0 / math.pi
    radius, natural, poles, slip = 1e-9, 0.2 * OMEGA, 100, 50.0
    inertia = mass * radius * GRAVITY / natural**2
    still = {
        "unbalance_radius_m": radius,
        "rotor_inertia_kg_m2": inertia,
        "critical_slip": slip,
        "pole_pairs": poles,
        "critical_torque_n_m": inertia * natural * slip * OMEGA / poles,
    }
    damper = 2.0 * DAMPING * math.sqrt(STIFFNESS * MASS)
    lag = math.atan2(damper * OMEGA, STIFFNESS - MASS * OMEGA**2)  # of y behind the force, along sin φ₁
    cosine = math.pi * (1.0 - restitution) / ((1.0 + restitution) * gamma) if restitution else 1.0
    phase = math.acos(min(cosine, 1.0)) if restitution else 0.0
    size = gamma * gravity / OMEGA**2
    state = {
        "y_m": -MASS * gravity / STIFFNESS + size * math.sin(phase),
        "y_rate_m_per_s": size * OMEGA * math.cos(phase),
        "phi1_rad": phase + lag,
        "phi2_rad": -0.5 * math.pi,
        "phi1_rate_rad_per_s": OMEGA,
        "phi2_rate_rad_per_s": 0.0,
        "gap_rate_m_per_s": (math.pi - gamma * cosine) * gravity / OMEGA if restitution else 0.0,
    }
    tree = {
        "name": "table",
        "machine": {
            "platform_mass_kg": MASS - 2.0 * mass,
            "platform_inertia_kg_m2": 1e12,
            "unbalance_mass_kg": mass,
            "stiffness_y_n_per_m": STIFFNESS,
            "stiffness_x_n_per_m": STIFFNESS,
            "stiffness_phi_n_m_per_rad": 1e12 * (0.13 * OMEGA) ** 2,
            "damping_x_n_s_per_m": damper,
            "damping_y_n_s_per_m": damper,
            "damping_phi_n_m_s_per_rad": 0.2 * 1e12 * OMEGA,
            "gravity_m_per_s2": gravity,
        },
        "exciters": [rotor | {"unbalance_radius_m": unbalance / mass, "critical_torque_n_m": slope}, still],
        "material": {"mass_ratio": 1e-12, "layers": 1},
        "contact": {"restitution": restitution},
        "drive": {"supply_frequency_hz": 25.0},
        "run": {"initial": {"state": state}, "duration_s": 1.0},
        "solver": {"engine": "taylor", "tolerance": 1e-10},
    }
    return Scene.from_tree(tree)
