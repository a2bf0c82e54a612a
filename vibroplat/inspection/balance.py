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

from vibroplat.config.scene import Scene
from vibroplat.inspection.linear import (
    ComplexArray,
    FloatArray,
    natural_frequencies,
    oscillators,
    platform_torques,
)

#: Number of lags and of evenly spaced speeds that are looked at, and of further speeds around each resonance.
LAGS, SPEEDS, NEAR = 360, 500, 81
#: All lags once and the first again, at none of which a symmetric machine has a balance.
LAG = 2.0 * math.pi * (np.arange(LAGS + 1) + 0.4) / LAGS - math.pi


class Balance(NamedTuple):
    """A speed and a lag at which both exciters keep turning.

    Attributes
    ----------
    speed
        ω (rad/s).
    lag
        δ = θ₁ − θ₂ (rad).
    torques
        Mean torques of both motors (N·m).
    """

    speed: float
    lag: float
    torques: tuple[float, float]


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
    for now in reversed(scene.drive.intervals):
        time = now.start if math.isinf(now.end) else now.end
        frequency = now.frequency_at(time)
        if any(now.driven) and frequency > 0.0:
            return Supply(frequency, frequency, now.driven)
    return Supply(scene.drive.largest_frequency, scene.drive.largest_frequency, (False, False))


def net_torques(scene: Scene, supply: Supply, speeds: FloatArray, factors: FloatArray | float = 1.0) -> FloatArray:
    """Return motor torques times factors less the resistances k_R k ω² at speeds of shape (…, 2) (rad/s; N·m)."""
    speeds = np.asarray(speeds)
    drag = [e.friction_radius_m * k for e, k in zip(scene.exciter_pair, scene.unbalances, strict=True)]
    return np.asarray(factors * motor_torques(scene, supply, speeds) - drag * speeds**2)


def motor_torques(scene: Scene, supply: Supply, speeds: FloatArray) -> FloatArray:
    """Return the torques of both motors at speeds of shape (…, 2) (rad/s; N·m)."""
    slips = np.array(scene.synchronous_speeds_at(supply.frequency)) - speeds
    torques = [e.torque(slips[..., i], supply.slip_frequency) for i, e in enumerate(scene.exciter_pair)]
    return np.stack(torques, axis=-1) * supply.driven


def speed_grid(scene: Scene, largest: float) -> FloatArray:
    """Return speeds up to the largest, closer to each other around resonances."""
    found = [np.linspace(0.0, largest, SPEEDS + 1)[1:]]
    spread = np.tan(np.linspace(-1.5, 1.5, NEAR))
    for (inertia, damping, _), natural in zip(oscillators(scene), natural_frequencies(scene).values(), strict=True):
        near = 2.0 * math.pi * natural + 0.5 * damping / inertia * spread
        found.append(near[(near > 0.0) & (near < largest)])
    return np.unique(np.concatenate(found))


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
    column = np.arange(LAG.size)
    low, high = total[place, column], total[place + 1, column]
    part = np.where(falls.any(axis=0), low / np.where(low > high, low - high, 1.0), np.nan)
    speed = speeds[place] + part * (speeds[place + 1] - speeds[place])
    apart = difference[place, column] + part * (difference[place + 1, column] - difference[place, column])
    found = []
    for i in np.flatnonzero((apart[:-1] > 0.0) & (apart[1:] <= 0.0)):
        if abs(place[i + 1] - place[i]) > NEAR // 8:  # another branch of speeds, not a balance
            continue
        share = apart[i] / (apart[i] - apart[i + 1])
        there = float(speed[i] + share * (speed[i + 1] - speed[i]))
        torques = motor_torques(scene, supply, np.array([there, there]))
        found.append(
            Balance(there, float(LAG[i] + share * (LAG[i + 1] - LAG[i])), (float(torques[0]), float(torques[1])))
        )
    return found


def holding_torque(scene: Scene, speed: float) -> float:
    """Return the largest part of the difference of both torques that the platform carries, by the lag alone (N·m)."""
    torques = platform_torques(scene, np.full(LAG.shape, speed), LAG)
    return 0.5 * float(np.ptp(torques[:, 0] - torques[:, 1]))


def phase_of(scene: Scene, lag: float) -> float:
    """Return the phase difference, φ₁ + φ₂ or φ₁ − φ₂ (rad, −π … π), at a lag."""
    return math.remainder(scene.exciter_pair[0].direction * lag, 2.0 * math.pi)
