"""Steady vibration of the platform by unbalances that turn at one speed, and the torques with which it answers.

The springs act on the common centre of mass, so x, y and φ do not couple (:mod:`vibroplat.model.platform`): each is one
oscillator. Of the mass matrix only the columns of the exciters couple them; these are the forces and torques here.

Angles θ_i of the exciters count in the direction in which their motors drive, φ_i = σ_i θ_i. With θ_i = ωt + α_i their
forces are Re[ω² u_i exp(iα_i) exp(iωt)], u_i = k_i (1, −iσ_i, −iσ_i X_i − Y_i). The platform's torque on exciter i, in
its own direction, is ½ω² Im(conj(u_i) exp(−iα_i) · q) with the complex amplitudes q of x, y, φ. Source: Blekhman 1988,
*Synchronization in Science and Technology*, ch. 3: the vibrational torques of the integral criterion.
Range: rotations of the platform ≪ 1 rad, speeds that hardly change during a turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vibroplat.config.scene import Scene

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Axes of the platform.
AXES = ("x", "y", "phi")


def oscillators(scene: Scene) -> FloatArray:
    """Return inertia, damping and stiffness of x, y, φ, shape (3, 3), without material that may lift off."""
    machine = scene.machine
    return np.array(
        [
            (scene.platform_mass, machine.damping_x_n_s_per_m, machine.stiffness_x_n_per_m),
            (scene.platform_mass, scene.damping_y, machine.stiffness_y_n_per_m),
            (scene.body.inertia, machine.damping_phi_n_m_s_per_rad, machine.stiffness_phi_n_m_per_rad),
        ]
    )


def couplings(scene: Scene) -> ComplexArray:
    """Return u_i of both exciters, shape (2, 3)."""
    rows = []
    for k, exciter, (x, y) in zip(scene.unbalances, scene.exciter_pair, scene.body.axes, strict=True):
        sine = -1j * exciter.direction
        rows.append(k * np.array([1.0, sine, x * sine - y]))
    return np.array(rows)


def receptances(scene: Scene, speeds: FloatArray, carried: ComplexArray | float = 0.0) -> ComplexArray:
    """Return displacements of x, y, φ per force 1/(c − Mω² + iωb) at speeds (rad/s), shape (…, 3).

    ``carried`` is the dynamic mass of material that moves along y with the platform (kg), of the shape of ``speeds``.
    """
    inertia, damping, stiffness = oscillators(scene).T
    w = np.asarray(speeds)[..., np.newaxis]
    masses = inertia + np.stack(np.broadcast_arrays(0.0, carried, 0.0), axis=-1)
    return np.asarray(1.0 / (stiffness - masses * w * w + 1j * w * damping + 1e-300))


def amplitudes(scene: Scene, speed: float, lag: FloatArray, carried: ComplexArray | float = 0.0) -> ComplexArray:
    """Return the complex amplitudes of x, y, φ (m, m, rad) at a speed and lags δ = θ₁ − θ₂, shape (…, 3)."""
    u = couplings(scene)
    forces = speed * speed * (u[0] + u[1] * np.exp(-1j * np.asarray(lag))[..., np.newaxis])
    return np.asarray(forces * receptances(scene, np.full(np.shape(lag), speed), carried))


def ripple_factors(scene: Scene, speed: float, amplitude: float) -> tuple[float, float]:
    """Return factors of the largest accelerations up and down at a speed (rad/s), because the exciters turn unevenly.

    Above resonance the unbalances are up where the platform is down. Gravity slows them there by kg/(J_e ω²) and the
    platform's amplitude A along y (m) by kA/(4J_e), both relative to ω; forces change by twice as much. Of first order
    in both, for forces that add along y; (1, 1) below resonance, where they move with the platform and hardly matter.
    """
    if speed <= 2.0 * math.pi * natural_frequencies(scene)["y"]:
        return 1.0, 1.0
    ratio = sum(scene.unbalances) / sum(scene.exciter_inertias)
    gravity, own = ratio * scene.machine.gravity_m_per_s2 / speed**2, 0.25 * ratio * amplitude
    return 1.0 - 2.0 * min(gravity + own, 0.25), 1.0 + 2.0 * min(gravity - own, 0.25)


def platform_torques(
    scene: Scene, speeds: FloatArray, lag: FloatArray, carried: ComplexArray | float = 0.0
) -> FloatArray:
    """Return the mean torques of the platform on both exciters in their own directions (N·m), shape (…, 2).

    ``speeds`` and ``lag`` broadcast: shapes (n, 1) and (m,) give (n, m, 2).
    """
    u, g = couplings(scene), receptances(scene, speeds, carried)
    own, mutual = (np.conj(u) * u) @ g[..., np.newaxis], np.sum(np.conj(u[0]) * u[1] * g, axis=-1)
    back = np.sum(np.conj(u[1]) * u[0] * g, axis=-1)
    turn, half = np.exp(-1j * lag), 0.5 * np.asarray(speeds) ** 4
    first, second = own[..., 0, 0] + mutual * turn, own[..., 1, 0] + back / turn
    return np.stack([half * first.imag, half * second.imag], axis=-1)


def natural_frequencies(scene: Scene) -> dict[str, float]:
    """Return natural frequencies √(c/M)/2π of x, y, φ (Hz), of the machine without material; 0 without a spring."""
    inertia, _, stiffness = oscillators(scene).T
    return dict(zip(AXES, (np.sqrt(stiffness / inertia) / (2.0 * math.pi)).tolist(), strict=True))


def damping_ratios(scene: Scene) -> dict[str, float]:
    """Return b/(2√(cM)) of x, y, φ; infinite without a spring."""
    inertia, damping, stiffness = oscillators(scene).T
    with np.errstate(divide="ignore", invalid="ignore"):
        return dict(zip(AXES, (0.5 * damping / np.sqrt(stiffness * inertia)).tolist(), strict=True))


def loaded_frequencies(scene: Scene) -> tuple[float, ...]:
    """Return the natural frequencies along y with the material in contact (Hz), in ascending order; () without any.

    Platform and lower layer, and the upper layer on its spring, are two coupled oscillators: with y and the upper
    layer's relative displacement, det(K − ω²M) = 0 with M = [[M + m_w, m_w2], [m_w2, m_w2]], K = diag(c_y, c_w).
    """
    lower, upper = scene.layer_masses
    total, stiffness = scene.platform_mass + lower + upper, scene.machine.stiffness_y_n_per_m
    if not lower:
        return ()
    if not upper:
        return (math.sqrt(stiffness / total) / (2.0 * math.pi),)
    square = scene.layer_spring[0]
    masses = np.array([[1.0, upper / total], [1.0, 1.0]])
    values = np.linalg.eigvals(np.linalg.solve(masses, np.diag([stiffness / total, square])))
    return tuple((np.sqrt(np.sort(values.real)) / (2.0 * math.pi)).tolist())
