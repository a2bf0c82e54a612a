"""Balance of torques of exciters that turn together: their speed, their phase difference, and what holds them.

In steady motion of both exciters at a speed ω with a lag δ = θ₁ − θ₂, each motor's torque, resistance and mean platform
torque add up to 0. For two exciters this is Blekhman's integral criterion with the motors' characteristics added: the
difference of the balances vanishes and falls with δ (stable), and their sum vanishes and falls with ω. If the motors
are equal, the first means that the averaged Lagrangian is least over δ. Sources: Blekhman 1988, *Synchronization in
Science and Technology*, ch. 3 and 4; Panovko and Gubanova 1965 for the branches near a resonance (Sommerfeld effect).
Range: unbalances that turn evenly; not near the speeds at which the phase itself oscillates in resonance.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes
from vibroplat.inspection.linear import (
    ComplexArray,
    FloatArray,
    couplings,
    own_torques,
    platform_torques,
)

#: Number of lags and of evenly spaced speeds that are looked at, and of further speeds around each resonance.
LAGS, SPEEDS, NEAR = 360, 500, 81
#: All lags once and the first again, at none of which a symmetric machine has a balance.
LAG = TURN * (np.arange(LAGS + 1) + 0.4) / LAGS - math.pi


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
            return scene.model_copy(update={"drive": scene.drive.until(now.end)})
    return scene


def while_run(scene: Scene) -> Scene:
    """Return the scene with the supply at the end of its run kept on, if its program is longer.

    It is as it is if the run continues another one: when that ends is not known.
    """
    end, program = scene.run.duration_s, scene.drive.program or ()
    if scene.run.initial.from_ is not None or not any(entry.t_s > end for entry in program):
        return scene
    return scene.model_copy(update={"drive": scene.drive.until(end)})


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
    modes = natural_modes(scene)
    spread = np.tan(np.linspace(-1.5, 1.5, NEAR))[:, np.newaxis]
    near = modes.speeds + 0.5 * modes.damping / modes.inertia * spread
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
    index = falls.shape[0] - 1 - falls[::-1].argmax(axis=0) if highest else falls.argmax(axis=0)
    ends = np.stack([index, index + 1])
    (low, high), (first, last) = (np.take_along_axis(of, ends, axis=0) for of in (total, difference))
    part = np.where(falls.any(axis=0), low / np.where(low > high, low - high, 1.0), np.nan)
    speed = speeds[index] + part * (speeds[index + 1] - speeds[index])
    apart = first + part * (last - first)
    same_branch = np.abs(np.diff(index)) <= NEAR // 8
    at = np.flatnonzero((apart[:-1] > 0.0) & (apart[1:] <= 0.0) & same_branch)
    weight = apart[at] / (apart[at] - apart[at + 1])
    crossings = [of[at] + weight * (of[at + 1] - of[at]) for of in (speed, LAG)]
    sense = scene.exciter_pair[0].direction
    return [Balance(w, lag, float(wrap(sense * lag))) for w, lag in np.transpose(crossings).tolist()]


def all_balances(scene: Scene, supply: Supply) -> list[Balance]:
    """Return the stable balances of the empty machine at the highest speeds, then those at the lowest ones."""
    grid = speed_grid(scene)
    return [one for highest in (True, False) for one in balances(scene, supply, grid, highest=highest)]


def phases_at(scene: Scene, supply: Supply, speed: float) -> FloatArray:
    """Return the phase differences that mean torques on the empty machine hold at a speed (rad/s), in rad."""
    net = net_torques(scene, supply, np.full(2, speed)) + platform_torques(scene, np.full(1, speed), LAG)
    apart = net[..., 0] - net[..., 1]
    lags: FloatArray = LAG[:-1][(apart[:-1] > 0.0) & (apart[1:] <= 0.0)]
    return scene.exciter_pair[0].direction * lags


def speed_alone(scene: Scene, supply: Supply, exciter: int, near: float, carried: complex = 0.0) -> float:
    """Return the stable speed of an exciter that turns at no other's speed, the nearest to one; 0 without a torque."""
    speeds = speed_grid(scene)
    own = net_torques(scene, supply, np.stack([speeds, speeds], axis=-1))
    net = (own + own_torques(scene, speeds, np.full(speeds.size, carried)))[:, exciter]
    at = np.flatnonzero((net[:-1] > 0.0) & (net[1:] <= 0.0))
    crossings = speeds[at] + net[at] / (net[at] - net[at + 1]) * (speeds[at + 1] - speeds[at])
    return min(crossings.tolist(), key=lambda speed: abs(speed - near), default=0.0)


def holding_stiffness(scene: Scene, balance: Balance) -> FloatArray:
    """Return how much the vibration of each mode holds the lag of a balance (N·m/rad), shape (3,); below 0 it drives.

    It is the difference of both torques by the platform, derived by the lag.
    """
    modes, w, turn = natural_modes(scene), balance.speed, np.exp(-1j * balance.lag)
    u = couplings(scene) @ modes.shapes
    answers = 1.0 / (modes.stiffness - modes.inertia * w * w + 1j * w * modes.damping + 1e-300)
    both = np.conj(u[0]) * u[1] * turn + np.conj(u[1]) * u[0] / turn
    return np.asarray(0.5 * balance.speed**4 * np.real(answers * both))


def holding_torque(scene: Scene, speed: float) -> float:
    """Return the largest part of the difference of both torques that the platform carries, by the lag alone (N·m)."""
    torques = platform_torques(scene, np.array([speed]), LAG)
    return 0.5 * float(np.ptp(torques[:, 0] - torques[:, 1]))
