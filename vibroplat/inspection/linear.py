"""Steady vibration of the platform by unbalances that turn at one speed, and the torques with which it answers.

Springs at the common centre of mass leave x, y and φ apart, each an oscillator; springs beside it couple x and y with
φ. Of the mass matrix only the columns of the exciters couple them; these are the forces and torques here.

Angles θ_i of the exciters count in the direction in which their motors drive, φ_i = σ_i θ_i. With θ_i = ωt + α_i their
forces are Re[ω² u_i exp(iα_i) exp(iωt)], u_i = k_i (1, −iσ_i, −iσ_i X_i − Y_i). The platform's torque on exciter i, in
its own direction, is ½ω² Im(conj(u_i) exp(−iα_i) · q) with the complex amplitudes q of x, y, φ. Source: Blekhman 1988,
*Synchronization in Science and Technology*, ch. 3: the vibrational torques of the integral criterion.
Range: rotations of the platform ≪ 1 rad, speeds that hardly change during a turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def couplings(scene: Scene) -> ComplexArray:
    """Return u_i of both exciters, shape (2, 3)."""
    (x, y), moments = np.array(scene.body.axes).T, np.array(scene.unbalances)
    sine = np.array([-1j * exciter.direction for exciter in scene.exciter_pair])
    return np.asarray((moments * [np.ones(2), sine, x * sine - y]).T)


def receptances(scene: Scene, speeds: FloatArray, carried: ComplexArray | float = 0.0) -> ComplexArray:
    """Return displacements of x, y, φ per force along each, (K − Mω² + iωB)⁻¹, at speeds (rad/s), shape (…, 3, 3).

    ``carried`` is the dynamic mass of material that moves along y with the platform (kg), of the shape of ``speeds``.
    Only φ couples with the others, which the inverse makes use of: without that it is 1/(c − Mω² + iωb) of each.
    """
    inertia, damping, stiffness = scene.oscillators
    w = np.asarray(speeds)
    masses = inertia[0], inertia[1] + np.asarray(carried), inertia[2]
    x, y, phi = (stiffness[i] - masses[i] * w * w + 1j * w * damping[i] + 1e-300 for i in range(3))
    to_x, to_y = (scene.suspension.stiffness[i][2] + 1j * w * scene.suspension.damping[i][2] for i in range(2))
    turns = 1.0 / (phi - to_x * (to_x / x) - to_y * (to_y / y))
    by_x, by_y = to_x / x, to_y / y  # by which x and y follow a rotation, with the other sign
    rows = (
        *(1.0 / x + by_x * by_x * turns, by_x * by_y * turns, -by_x * turns),
        *(by_x * by_y * turns, 1.0 / y + by_y * by_y * turns, -by_y * turns),
        *(-by_x * turns, -by_y * turns, turns),
    )
    flat = np.stack(np.broadcast_arrays(*rows), axis=-1)
    return np.asarray(flat.reshape(*flat.shape[:-1], 3, 3))


def amplitudes(scene: Scene, speed: float, lags: FloatArray) -> ComplexArray:
    """Return the complex amplitudes of x, y, φ (m, m, rad) at a speed and lags δ = θ₁ − θ₂, shape (n, 3)."""
    u = couplings(scene)
    forces = speed * speed * (u[0] + u[1] * np.exp(-1j * lags)[:, np.newaxis])
    return np.asarray(np.einsum("...ij,...j->...i", receptances(scene, np.array([speed])), forces))


def amplitudes_alone(scene: Scene, exciter: int, speed: float) -> ComplexArray:
    """Return the complex amplitudes of x, y, φ (m, m, rad) if only one exciter turns at a speed, shape (3,)."""
    return np.asarray(receptances(scene, np.array(speed)) @ (speed * speed * couplings(scene)[exciter]))


def ripple_factors(scene: Scene, speed: float, amplitude: float) -> tuple[float, float]:
    """Return factors of the largest accelerations up and down at a speed (rad/s), because the exciters turn unevenly.

    Above resonance the unbalances are up where the platform is down. Gravity slows them there by kg/(J_e ω²) and the
    platform's amplitude A along y (m) by kA/(4J_e), both relative to ω; forces change by twice as much. Of first order
    in both, for forces that add along y; (1, 1) below resonance, where they move with the platform and hardly matter.
    """
    if speed <= natural_speeds(scene)[1]:
        return 1.0, 1.0
    ratio = sum(scene.unbalances) / sum(scene.exciter_inertias)
    gravity, own = ratio * scene.gravity[1] / speed**2, 0.25 * ratio * amplitude
    return 1.0 - 2.0 * min(gravity + own, 0.25), 1.0 + 2.0 * min(gravity - own, 0.25)


def platform_torques(
    scene: Scene, speeds: FloatArray, lag: FloatArray, carried: ComplexArray | float = 0.0
) -> FloatArray:
    """Return the mean torques of the platform on both exciters in their own directions (N·m), shape (…, 2).

    ``speeds`` and ``lag`` broadcast: shapes (n, 1) and (m,) give (n, m, 2).
    """
    u, g, own = couplings(scene), receptances(scene, speeds, carried), own_torques(scene, speeds, carried)
    turn = np.exp(-1j * lag)
    first, second = (g @ u[1]) @ np.conj(u[0]) * turn, (g @ u[0]) @ np.conj(u[1]) / turn
    return np.asarray(own + 0.5 * speeds[..., np.newaxis] ** 4 * np.stack([first.imag, second.imag], axis=-1))


def own_torques(scene: Scene, speeds: FloatArray, carried: ComplexArray | float = 0.0) -> FloatArray:
    """Return the mean torques by the vibration that each exciter makes itself (N·m), shape (…, 2)."""
    g, u = receptances(scene, speeds, carried), couplings(scene)
    answers = np.stack([(g @ one) @ np.conj(one) for one in u], axis=-1)
    return np.asarray(0.5 * speeds[..., np.newaxis] ** 4 * answers.imag)


def natural_speeds(scene: Scene) -> FloatArray:
    """Return natural angular frequencies of the modes near x, y, φ (rad/s), of the machine without material."""
    return natural_modes(scene).speeds


def loaded_frequencies(scene: Scene) -> tuple[float, ...]:
    """Return the natural frequencies along y with the material in contact (Hz), in ascending order; () without any.

    Platform and lower layer, and the upper layer on its spring, are two coupled oscillators: with y and the upper
    layer's relative displacement, det(K − ω²M) = 0 with M = [[M + m_w, m_w2], [m_w2, m_w2]], K = diag(c_y, c_w). With x
    and φ, where these couple with y, the modes count in which most of the kinetic energy is that of both.
    """
    lower, upper = scene.layer_masses
    total, n, y = scene.platform_mass + lower + upper, scene.layers, slice(2, 2 + scene.layers)
    order = [0, 2, 1]  # x, φ, y, then the upper layer
    stiffness, masses = np.zeros((2, 4, 4))
    stiffness[:3, :3], stiffness[3, 3] = (
        np.array(scene.suspension.stiffness)[order][:, order],
        upper * scene.layer_spring[0],
    )
    masses[:2, :2] = np.diag(scene.oscillators[0][[0, 2]])
    masses[2:, 2:] = [[total, upper], [upper, upper]]
    squares, shapes = np.linalg.eig(np.linalg.solve(masses[: 2 + n, : 2 + n], stiffness[: 2 + n, : 2 + n]))
    momenta = masses[: 2 + n, : 2 + n] @ shapes.real
    fractions = (shapes.real * momenta)[y].sum(axis=0) / (shapes.real * momenta).sum(axis=0)
    along = np.argsort(-fractions)[:n]
    return tuple((np.sqrt(np.sort(squares.real[along])) / TURN).tolist())
