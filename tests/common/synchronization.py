"""Averaged torques between exciters and platform (Blekhman's vibrational torques), for any stiffness and damping.

Exciter i turns as φᵢ = σᵢ(ωt + αᵢ). It pulls the platform along (x, y, φ) with the phasor k ω² uᵢ exp(jαᵢ),
u = (1, −jσ, −jσX − Y), and the platform moves by the compliances G = 1/(c − Mω² + jbω) times these pulls. The mean
torque on exciter i in its own direction is then ½ kᵢ ω⁴ Σⱼ kⱼ Im[Hᵢⱼ exp(j(αⱼ − αᵢ))] with H = conj(u)·G u. Without
damping these are the criteria of Blekhman for counter-rotating and for co-rotating exciters.
"""

import math

import numpy as np
from scipy.optimize import brentq

TURN = 2.0 * math.pi


def compliances(scene, speed):
    """Displacements of the platform along (x, y, φ) by forces of 1 N and a moment of 1 N·m, complex."""
    machine, mass = scene.machine, scene.body.mass
    x = machine.stiffness_x_n_per_m - mass * speed**2 + 1j * machine.damping_x_n_s_per_m * speed
    y = machine.stiffness_y_n_per_m - mass * speed**2 + 1j * machine.damping_y_n_s_per_m * speed
    phi = machine.stiffness_phi_n_m_per_rad - scene.body.inertia * speed**2
    return 1.0 / np.array([x, y, phi + 1j * machine.damping_phi_n_m_s_per_rad * speed])


def influence(scene, speed):
    """Return H, shape (2, 2): how the motion that exciter j causes acts on exciter i (m/N)."""
    directions = [exciter.direction for exciter in scene.exciter_pair]
    pulls = [np.array([1.0, -1j * s, -1j * s * x - y]) for s, (x, y) in zip(directions, scene.body.axes, strict=True)]
    g = compliances(scene, speed)
    return np.array([[np.sum(a.conj() * g * b) for b in pulls] for a in pulls])


def vibrational_torques(scene, speed, phase):
    """Mean torques of the vibration on both exciters, each in its own direction (N·m), at a phase difference (rad)."""
    h, k = influence(scene, speed), scene.unbalances
    ahead = (phase, 0.0)  # α₁ − α₂ is the phase difference, counter-rotating or not
    return [
        0.5 * speed**4 * k[i] * sum(k[j] * (h[i, j] * np.exp(1j * (ahead[j] - ahead[i]))).imag for j in (0, 1))
        for i in (0, 1)
    ]


def net_torques(scene, speed, phase, supply=None):
    """Mean torques of motor, vibration and resistance on both exciters, each in its own direction (N·m)."""
    supply = scene.drive.largest_frequency if supply is None else supply
    found = []
    for i, exciter in enumerate(scene.exciter_pair):
        synchronous = TURN * supply / exciter.pole_pairs
        slip, critical = synchronous - speed, exciter.critical_slip * synchronous
        motor = 2.0 * exciter.critical_torque_n_m * critical * slip / (critical**2 + slip**2)
        resistance = exciter.friction_radius_m * scene.unbalances[i] * speed**2
        found.append(motor + vibrational_torques(scene, speed, phase)[i] - resistance)
    return found


def steady_frequencies(scene, phase):
    """Excitation frequencies (Hz) at which exciter 1 may turn steadily at a phase difference, in ascending order."""
    grid = np.linspace(0.1, 1.0, 600) * scene.speed_scale
    torques = [net_torques(scene, speed, phase)[0] for speed in grid]
    signs = np.flatnonzero(np.diff(np.sign(torques)))
    return [brentq(lambda w: net_torques(scene, w, phase)[0], grid[i], grid[i + 1]) / TURN for i in signs]


def stable_phases(scene, speed):
    """Phase differences in (−π, π] at which both net torques are equal and a lead of exciter 1 slows it down."""

    def lead(phase):
        first, second = net_torques(scene, speed, phase)
        return first - second

    grid = np.linspace(-3.1, TURN - 3.1, 121)
    values = [lead(phase) for phase in grid]
    falls = [i for i in range(grid.size - 1) if values[i] > 0.0 >= values[i + 1]]
    return [math.remainder(brentq(lead, grid[i], grid[i + 1], xtol=1e-12), TURN) for i in falls]
