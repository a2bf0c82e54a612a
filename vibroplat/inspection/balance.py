"""Balance of torques of exciters that turn together: their speed, their phase difference, and what holds them.

In steady motion of both exciters at a speed ω with a lag δ = θ₁ − θ₂, each motor's torque, resistance and mean platform
torque add up to 0. For two exciters this is Blekhman's integral criterion with the motors' characteristics added: the
difference of the balances vanishes and falls with δ (stable), and their sum vanishes and falls with ω. If the motors
are equal, the first means that the averaged Lagrangian is least over δ. Sources: Blekhman 1988, *Synchronization in
Science and Technology*, ch. 3 and 4; Panovko and Gubanova 1965 for the branches near a resonance (Sommerfeld effect).
Range: unbalances that turn evenly; not near the speeds at which the phase itself oscillates in resonance.

A start in averaged equations: which resonances the motors pass, with how much torque, and where the exciters end.

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
from typing import NamedTuple

import numpy as np

from vibroplat.config.drive import Drive, Entry
from vibroplat.config.scene import Scene
from vibroplat.config.schema import PERTURBATION
from vibroplat.config.sections import Initial, Run
from vibroplat.inspection.linear import (
    ComplexArray,
    FloatArray,
    couplings,
    natural_speeds,
    own_torques,
    platform_torques,
)

#: Number of lags and of evenly spaced speeds that are looked at, and of further speeds around each resonance.
LAGS, SPEEDS, NEAR = 360, 500, 81
#: All lags once and the first again, at none of which a symmetric machine has a balance.
LAG = 2.0 * math.pi * (np.arange(LAGS + 1) + 0.4) / LAGS - math.pi
#: Factors of the motors' torques that are tried at first, and their number between a captured and a passing one.
FACTORS, FINER = np.geomspace(0.02, 20.0, 40), 24
#: Steps over the time scale of the fastest passage; decay times of the slowest axis after the supply's last change;
#: most steps; a change of speed that gives a slope, over the synchronous speed.
STEP, DECAYS, MAX_STEPS, SLIGHT = 0.04, 10.0, 20_000, 1e-4


class Balance(NamedTuple):
    """A speed and a lag at which both exciters keep turning.

    Attributes
    ----------
    speed
        ω (rad/s).
    lag
        δ = θ₁ − θ₂ (rad).
    phase
        Phase difference, φ₁ + φ₂ or φ₁ − φ₂ (rad, −π … π).
    """

    speed: float
    lag: float
    phase: float


class Supply(NamedTuple):
    """The supply at a time: its frequency and that of critical slip speeds (Hz), and which motors are on."""

    frequency: float
    slip_frequency: float
    driven: tuple[bool, bool]


def supply_at(scene: Scene, time: float) -> Supply:
    """Return the supply at a time (s)."""
    now = scene.drive.at(time)
    slip, rate = now.slip_frequency
    return Supply(now.frequency_at(time), slip + rate * (time - now.start) if rate else slip, now.driven)


def final_supply(scene: Scene) -> Supply:
    """Return the supply at the end, or the last one that drives a motor; the largest frequency if none ever does."""
    now = while_driven(scene).drive.intervals[-1]
    frequency = now.frequency
    if any(now.driven) and frequency > 0.0:
        return Supply(frequency, frequency, now.driven)
    return Supply(scene.drive.largest_frequency, scene.drive.largest_frequency, (False, False))


def while_driven(scene: Scene) -> Scene:
    """Return the scene with the supply that drives a motor last kept on for ever."""
    for now in reversed(scene.drive.intervals):
        time = now.start if math.isinf(now.end) else now.end
        frequency = now.frequency_at(time)
        if any(now.driven) and frequency > 0.0:
            if math.isinf(now.end):
                break
            before = [entry for entry in scene.drive.program or () if entry.t_s < now.end]
            last = Entry(t_s=now.end, supply_frequency_hz=frequency)
            return scene.model_copy(update={"drive": Drive(program=[*before, last])})
    return scene


def net_torques(scene: Scene, supply: Supply, speeds: FloatArray, factors: FloatArray | float = 1.0) -> FloatArray:
    """Return motor torques times factors less the resistances k_R k ω² at speeds of shape (…, 2) (rad/s; N·m)."""
    drag = [e.friction_radius_m * k for e, k in zip(scene.exciter_pair, scene.unbalances, strict=True)]
    return np.asarray(factors * motor_torques(scene, supply, speeds) - drag * speeds**2)


def motor_torques(scene: Scene, supply: Supply, speeds: FloatArray) -> FloatArray:
    """Return the torques of both motors at speeds of shape (…, 2) (rad/s; N·m)."""
    slips = np.array(scene.synchronous_speeds_at(supply.frequency)) - speeds
    torques = [e.torque(slips[..., i], supply.slip_frequency) for i, e in enumerate(scene.exciter_pair)]
    return np.stack(torques, axis=-1) * supply.driven


def speed_grid(scene: Scene) -> FloatArray:
    """Return speeds up to the synchronous one, closer to each other around resonances."""
    inertia, damping, _ = scene.oscillators
    spread = np.tan(np.linspace(-1.5, 1.5, NEAR))[:, np.newaxis]
    near = natural_speeds(scene) + 0.5 * damping / inertia * spread
    evenly = np.linspace(0.0, scene.speed_scale, SPEEDS + 1)[1:]
    return np.unique([*evenly, *near[(near > 0.0) & (near < scene.speed_scale)]])


def balances(
    scene: Scene,
    supply: Supply,
    speeds: FloatArray,
    carried: ComplexArray | float = 0.0,
    *,
    highest: bool = True,
) -> list[Balance]:
    """Return the stable balances at the highest speeds, or the lowest ones, where the sum of the torques vanishes.

    ``carried`` is the dynamic mass of the material at the lags, shape (LAGS + 1,).
    """
    own = net_torques(scene, supply, np.stack([speeds, speeds], axis=-1))
    net = own[:, np.newaxis] + platform_torques(scene, speeds[:, np.newaxis], LAG, carried)
    total, difference = net.sum(axis=-1), net[..., 0] - net[..., 1]
    falls = (total[:-1] > 0.0) & (total[1:] <= 0.0)
    place = falls.shape[0] - 1 - falls[::-1].argmax(axis=0) if highest else falls.argmax(axis=0)
    ends = np.stack([place, place + 1])
    (low, high), (first, last) = (np.take_along_axis(of, ends, axis=0) for of in (total, difference))
    part = np.where(falls.any(axis=0), low / np.where(low > high, low - high, 1.0), np.nan)
    speed = speeds[place] + part * (speeds[place + 1] - speeds[place])
    apart = first + part * (last - first)
    same_branch = np.abs(np.diff(place)) <= NEAR // 8
    at = np.flatnonzero((apart[:-1] > 0.0) & (apart[1:] <= 0.0) & same_branch)
    share = apart[at] / (apart[at] - apart[at + 1])
    found = [of[at] + share * (of[at + 1] - of[at]) for of in (speed, LAG)]
    sense = scene.exciter_pair[0].direction
    return [Balance(w, lag, math.remainder(sense * lag, 2.0 * math.pi)) for w, lag in np.transpose(found).tolist()]


def all_balances(scene: Scene, supply: Supply) -> list[Balance]:
    """Return the stable balances of the empty machine at the highest speeds, then those at the lowest ones."""
    grid = speed_grid(scene)
    return [one for highest in (True, False) for one in balances(scene, supply, grid, highest=highest)]


def speed_alone(scene: Scene, supply: Supply, exciter: int, near: float, carried: complex = 0.0) -> float:
    """Return the stable speed of an exciter that turns at no other's speed, the nearest to one; 0 without a torque."""
    speeds = speed_grid(scene)
    own = net_torques(scene, supply, np.stack([speeds, speeds], axis=-1))
    net = (own + own_torques(scene, speeds, np.full(speeds.size, carried)))[:, exciter]
    at = np.flatnonzero((net[:-1] > 0.0) & (net[1:] <= 0.0))
    found = speeds[at] + net[at] / (net[at] - net[at + 1]) * (speeds[at + 1] - speeds[at])
    return min(found.tolist(), key=lambda speed: abs(speed - near), default=0.0)


def holding_torque(scene: Scene, speed: float) -> float:
    """Return the largest part of the difference of both torques that the platform carries, by the lag alone (N·m)."""
    torques = platform_torques(scene, np.array([speed]), LAG)
    return 0.5 * float(np.ptp(torques[:, 0] - torques[:, 1]))


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
