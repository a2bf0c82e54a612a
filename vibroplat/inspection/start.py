"""A start in averaged equations: which resonances the motors pass, with how much torque, and where the exciters end.

Speeds ω_i, lag δ and complex amplitudes q = Re[Q exp(iθ₁)] of x, y, φ change slowly over a turn. With u_i as in
:mod:`vibroplat.inspection.linear`, inertia M, damping b and stiffness c of an axis and J_i of an exciter,

    (2iω₁M + b) Q̇ = Σ u_i exp(−iδ_i) (ω_i² − iω̇_i) − (c − Mω₁² + iω₁b + iω̇₁M) Q,     δ₁ = 0, δ₂ = δ,
    J_i ω̇_i = L_i − L_R,i + ½ Im[conj(u_i exp(−iδ_i)) · (ω₁² Q − 2iω₁Q̇ − iω̇₁Q)],       δ̇ = ω₁ − ω₂.

They contain Sommerfeld's limit, K²ω_n³/2b at a natural frequency ω_n, which holds for infinitely slow starts of motors
whose torque is constant; the passage in finite time, which takes less (Lewis 1932); motors with little slip left at
ω_n, which need more; and phases that change behind a resonance. Sources: Blekhman 1988, ch. 4; Panovko and Gubanova
1965. Range: k_i² ≪ M J_i, no material (it damps and lowers the resonance along y), no gravity on the unbalances.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.config.schema import PERTURBATION
from vibroplat.config.sections import Initial, Run
from vibroplat.inspection.balance import final_supply, net_torques, supply_at
from vibroplat.inspection.linear import FloatArray, couplings, natural_speeds

#: Factors of the motors' torques that are tried at first, and their number between a captured and a passing one.
FACTORS, FINER = np.geomspace(0.02, 20.0, 40), 24
#: Steps over the time scale of the fastest passage; decay times of the slowest axis after the supply's last change;
#: most steps; a change of speed that gives a slope, over the synchronous speed.
STEP, DECAYS, MAX_STEPS, SLIGHT = 0.04, 10.0, 20_000, 1e-4


def averaged_start(scene: Scene, factors: FloatArray) -> FloatArray:
    """Return the speeds to which a scene's start leads with its motors' torques times factors (rad/s), shape (n, 2)."""
    u, (inertia, damping, stiffness) = couplings(scene), scene.oscillators
    rotors, top, initial = np.array(scene.exciter_inertias), scene.speed_scale, scene.run.initial
    speeds = np.tile(initial.speed_ratio * np.array(scene.synchronous_speeds), (factors.size, 1))
    angles = np.multiply([e.direction for e in scene.exciter_pair], initial.angles(scene.phase_weights[1]))
    lag = np.full(factors.size, angles[0] - angles[1] + PERTURBATION)
    amplitudes, change = np.zeros((2, factors.size, 3), complex)
    rates = np.zeros_like(speeds)
    step, count = _steps(scene)
    for time in np.arange(count) * step:
        supply = supply_at(scene, time)
        torque, ahead = net_torques(scene, supply, np.stack([speeds, speeds + SLIGHT * top]), factors[:, np.newaxis])
        w, w_rate = speeds[:, :1], rates[:, :1]
        felt = w * w * amplitudes - 2j * w * change - 1j * w_rate * amplitudes
        phases = np.stack([np.ones_like(lag), np.exp(-1j * lag)], axis=-1)
        platform = 0.5 * np.imag(np.conj(phases) * (felt @ np.conj(u).T))
        slope = (ahead - torque) / (SLIGHT * top)
        rates = (torque + platform) / rotors / np.maximum(1.0 - step * slope / rotors, 1.0)
        speeds = np.clip(speeds + step * rates, 0.0, top)
        lag = lag + step * (speeds[:, 0] - speeds[:, 1])
        w, w_rate = speeds[:, :1], rates[:, :1]
        mobility = 1.0 / (2j * w * inertia + damping + 1e-9 * top * inertia)
        exponent = -mobility * (stiffness - inertia * w * w + 1j * w * damping + 1j * w_rate * inertia)
        force = mobility * ((phases * (speeds**2 - 1j * rates)) @ u)
        exponent = np.minimum(exponent.real, 1.0 / step) + 1j * (exponent.imag + 1e-9 * top)
        grown = np.exp(exponent * step)
        change = (grown - 1.0) * (amplitudes + force / exponent) / step
        amplitudes = amplitudes + step * change
    return speeds


def _steps(scene: Scene) -> tuple[float, int]:
    """Return the length (s) and the number of the steps of a start."""
    u, rotors = couplings(scene), sum(scene.exciter_inertias)
    inertia, damping, _ = scene.oscillators
    scale = natural_speeds(scene) * (np.abs(u).sum(axis=0) ** 2 / (4.0 * inertia * rotors)) ** (1.0 / 3.0)
    step = STEP / max(float(scale.max()), 1e-3 * scene.speed_scale)
    slowest = float((0.5 * damping / inertia)[damping > 0.0].min(initial=math.inf))
    end = max(scene.drive.last_change(math.inf), 0.0) + DECAYS / min(slowest, 1.0 / step)
    return step, min(math.ceil(end / step), MAX_STEPS)


def least_factor(scene: Scene) -> tuple[float, float]:
    """Return the factor of the motors' torques above which both exciters pass all resonances below, and where else.

    The second is the speed at which they stay with a little less (rad/s). Factor 0: with any of :data:`FACTORS` they
    pass, or there is no resonance to pass; infinite: with none.
    """
    supply = final_supply(scene)
    on = [i for i in (0, 1) if supply.driven[i] and scene.exciter_pair[i].critical_torque_n_m]
    last = min((scene.synchronous_speeds_at(supply.frequency)[i] for i in on), default=0.0)
    highest = max((w for w in natural_speeds(scene) if w < last), default=0.0)
    if scene.run.initial.speed_ratio:
        scene = scene.model_copy(update={"run": Run(initial=Initial(speed_ratio=0.0))})
    factors, captured = FACTORS, (0.0, 0.0)
    for _ in range(2 if highest else 0):
        least = averaged_start(scene, factors)[:, on].min(axis=1)
        low = np.flatnonzero(least <= highest)
        if not low.size:
            break
        if low[-1] + 1 == factors.size:
            return math.inf, float(least[-1])
        captured = float(factors[low[-1]]), float(least[low[-1]])
        factors = np.geomspace(captured[0], float(factors[low[-1] + 1]), FINER)
    return captured
