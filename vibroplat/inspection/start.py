"""A start in averaged equations: which resonances the motors pass, with how much torque, and where the exciters end.

Speeds ω_i, lag δ and complex amplitudes q = Re[Q exp(iθ₁)] of x, y, φ, or of the modes that springs beside the centre
of mass make of them, change slowly over a turn. With u_i of the modes as in :mod:`vibroplat.inspection.linear`, inertia
M, damping b and stiffness c of a mode and J_i of an exciter,

    (2iω₁M + b) Q̇ = Σ u_i exp(−iδ_i) (ω_i² − iω̇_i) − (c − Mω₁² + iω₁b + iω̇₁M) Q,     δ₁ = 0, δ₂ = δ,
    J_i ω̇_i = L_i − L_R,i + ½ Im[conj(u_i exp(−iδ_i)) · (ω₁² Q − 2iω₁Q̇ − iω̇₁Q)],       δ̇ = ω₁ − ω₂.

They contain Sommerfeld's limit, K²ω_n³/2b at a natural frequency ω_n, which holds for infinitely slow starts of motors
whose torque is constant; the passage in finite time, which takes less (Lewis 1932); motors with little slip left at
ω_n, which need more; and phases that change behind a resonance. Sources: Blekhman 1988, ch. 4; Panovko and Gubanova
1965. Range: k_i² ≪ M J_i, no material (it damps and lowers the resonance along y), no gravity on the unbalances.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.config.schema import PERTURBATION
from vibroplat.config.sections import Initial, Run
from vibroplat.config.suspension import natural_modes
from vibroplat.inspection.balance import final_supply, motor_torques, net_torques, supply_at
from vibroplat.inspection.linear import FloatArray, couplings, natural_speeds

#: Factors of the motors' torques that are tried at first, rounds, and their number between a captured and a passing one
#: in each further round.
FACTORS, ROUNDS, FINER = np.geomspace(0.05, 20.0, 13), 3, 5
#: What the lag of a start from rest may have become before a resonance (rad): unbalances swing, and the first turns
#: take as long as chance has it.
LAGS = TURN * np.arange(12) / 12
#: Steps over the time scale of the fastest passage; decay times of the slowest axis, and times to run up, after the
#: supply's last change; most steps until all has settled, and until starts have passed; a change of speed that gives a
#: slope, over the synchronous speed.
STEP, DECAYS, RUN_UPS, SETTLING_STEPS, PASSING_STEPS, SLIGHT = 0.04, 10.0, 20.0, 20_000, 2_000, 1e-4
#: Angle by which free vibration of the platform turns against the exciters in a step (rad), at most: it drives their
#: phase, and with coarser steps it grows where less damping takes it away. By the damping ratio, and its ends.
TURNED, TURNED_ENDS = 40.0, (0.3, 1.0)
#: Steps between two looks at which exciters have passed or no longer change speed, and that change until the end over
#: the synchronous speed.
LOOK, SETTLED = 50, 0.01


#: Starts side by side: ω_i and their rates, δ, Q and its rate, and factors of the motors' torques.
_Lanes: TypeAlias = tuple[NDArray[Any], ...]
#: Speeds of both exciters to which starts lead (rad/s), shape (n, 2), and which of them a resonance captures.
Starts: TypeAlias = tuple[FloatArray, NDArray[np.bool_]]


def averaged_start(
    scene: Scene, factors: FloatArray, turned: FloatArray | float = 0.0, until: float = math.inf
) -> FloatArray:
    """Return the speeds to which a scene's start leads with its motors' torques times factors (rad/s), shape (n, 2).

    The initial lag is changed by ``turned`` (rad), of the shape of the factors. Starts end early where both exciters
    that are driven are faster than ``until``, or do not change speed any more.
    """
    initial, count, on = scene.run.initial, factors.size, list(final_supply(scene).driven)
    speeds = np.tile(initial.speed_ratio * np.array(scene.synchronous_speeds), (count, 1))
    first, second = scene.exciter_pair
    angles = initial.angles(scene.phase_weights[1], scene.hanging_angle)
    apart = first.direction * angles[0] - second.direction * angles[1]
    lag = apart + PERTURBATION + np.broadcast_to(turned, factors.shape)
    lanes: _Lanes = (speeds, np.zeros_like(speeds), lag, *np.zeros((2, count, 3), complex), factors)
    ends, left = speeds.copy(), np.arange(count)
    step, steps = _steps(scene, PASSING_STEPS if math.isfinite(until) else SETTLING_STEPS)
    slow, last = SETTLED * scene.speed_scale / (steps * step), scene.drive.last_change(math.inf)
    for number in range(steps):
        lanes = _advance(scene, lanes, number * step, step)
        if number % LOOK == LOOK - 1 and number * step > last:
            speeds, rates, *_ = lanes
            changes = np.maximum(np.abs(rates), np.abs(speeds - ends[left]) / (LOOK * step)).max(axis=1)
            goes_on = (speeds[:, on].min(axis=1) <= until) & (changes > slow)
            ends[left] = speeds
            left, lanes = left[goes_on], tuple(part[goes_on] for part in lanes)
            if not left.size:
                break
    ends[left] = lanes[0]
    return ends


def _advance(scene: Scene, now: _Lanes, time: float, step: float) -> _Lanes:
    """Return starts a step later."""
    shapes, _, inertia, damping, stiffness = natural_modes(scene)
    u = couplings(scene) @ shapes
    rotors, top = np.array(scene.exciter_inertias), scene.speed_scale
    speeds, rates, lag, amplitudes, change, factors = now
    pair = np.stack([speeds, speeds + SLIGHT * top])
    torque, ahead = net_torques(scene, supply_at(scene, time), pair, factors[:, np.newaxis])
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
    return speeds, rates, lag, amplitudes + step * change, change, factors


def _steps(scene: Scene, most: int) -> tuple[float, int]:
    """Return the length (s) and the number of the steps of a start, at most so many after the supply's last change."""
    shapes, _, inertia, damping, stiffness = natural_modes(scene)
    u, rotors, top = couplings(scene) @ shapes, sum(scene.exciter_inertias), scene.speed_scale
    scale = natural_speeds(scene) * (np.abs(u).sum(axis=0) ** 2 / (4.0 * inertia * rotors)) ** (1.0 / 3.0)
    ratio = 0.5 * float((damping / np.sqrt(np.maximum(inertia * stiffness, 1e-300)))[stiffness > 0.0].min(initial=1.0))
    step = min(STEP / max(float(scale.max()), 1e-3 * top), float(np.clip(TURNED * ratio, *TURNED_ENDS)) / top)
    decay = float((0.5 * damping / inertia)[damping > 0.0].min(initial=math.inf))
    torque = float(motor_torques(scene, final_supply(scene), np.array([0.5 * top, 0.5 * top])).sum())
    times = DECAYS / min(decay, 1.0 / step) + RUN_UPS * rotors * top / max(torque, 1e-9 * rotors * top)
    before = math.ceil(max(scene.drive.last_change(math.inf), 0.0) / step)
    return step, min(before + min(math.ceil(times / step), most), SETTLING_STEPS)


def least_factor(scene: Scene) -> tuple[float, float]:
    """Return the factor of the motors' torques above which both exciters pass all resonances below, and where else.

    They pass if they do with every lag of :data:`LAGS`, as it depends on chance which motion the platform makes before
    a resonance. The second is the speed at which they stay with a little less (rad/s). Factor 0: with any of
    :data:`FACTORS` they pass, or there is no resonance to pass; infinite: with none.
    """
    highest, last, on = _to_pass(scene)
    factors, captured = FACTORS, (0.0, 0.0)
    for _ in range(ROUNDS if highest else 0):
        each, lags = np.repeat(factors, LAGS.size), np.tile(LAGS, factors.size)
        ends = averaged_start(_from_rest(scene), each, lags, 0.5 * (highest + last))[:, on].min(axis=1)
        ends = ends.reshape(-1, LAGS.size)
        low = np.flatnonzero((ends <= highest).any(axis=1))
        if not low.size:
            break
        stays = float(ends[low[-1]].min())
        if low[-1] + 1 == factors.size:
            return math.inf, stays
        captures, passing = factors[low[-1] : low[-1] + 2].tolist()
        factors, captured = np.geomspace(captures, passing, FINER), (math.sqrt(captures * passing), stays)
    return captured


def starts_from_rest(scene: Scene) -> Starts:
    """Return to what starts from rest lead with each of :data:`LAGS`."""
    highest, _, on = _to_pass(scene)
    ends = averaged_start(_from_rest(scene), np.ones(LAGS.size), LAGS)
    return ends, np.any(ends[:, on] <= highest, axis=1)


def _from_rest(scene: Scene) -> Scene:
    """Return the scene with exciters at rest."""
    return scene.model_copy(update={"run": Run(initial=Initial(speed_ratio=0.0))})


def _to_pass(scene: Scene) -> tuple[float, float, list[int]]:
    """Return the highest resonance below the synchronous speed (rad/s; 0: none), that speed, and which motors drive."""
    supply = final_supply(scene)
    on = [i for i in (0, 1) if supply.driven[i] and scene.exciter_pair[i].critical_torque_n_m]
    last = min((scene.synchronous_speeds_at(supply.frequency)[i] for i in on), default=0.0)
    return max((w for w in natural_speeds(scene).tolist() if w < last), default=0.0), last, on
