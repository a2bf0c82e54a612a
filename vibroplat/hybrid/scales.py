"""The scales of a scene, from which absolute tolerances follow.

Only the machine and its drive enter, never the state, so that two runs of one machine are integrated
alike wherever they start, and a change of units changes nothing.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import compiled
from vibroplat.model.parameters import FloatArray
from vibroplat.model.systems import System

#: Local tolerance of F_c in units of its scale, over the tolerance of the run. Ten costs no accuracy of
#: F_c, whose error is that of the state it follows from; less takes more steps where it is in the error test.
FORCE_SHARE = 10.0

#: Local tolerance of rates in units of their scales, over the tolerance of the run. At equal errors of
#: coordinates, F_c and event times 2 takes a tenth fewer steps than 1; 4 gains nothing more.
RATE_SHARE = 2.0

#: Local tolerances in flight, over those of the other modes. A landing turns an error of the gap into one of
#: time by its speed, which may be small: at equal errors of event times this takes a tenth fewer steps than 1.
FLIGHT_SHARE = 0.1

#: Relative error that round-off leaves of what is integrated: the least relative tolerance.
ROUND_OFF = 100.0 * float(np.finfo(float).eps)

#: Round-off of F_c in units of its scale, and the largest error of F_c that a run may have.
FORCE_NOISE, FORCE_ERROR = 1e-12, 0.05

#: Most halvings of a tolerance in low flights; those lower than 4⁻³⁰ of the scale are not followed.
MOST_HALVINGS = 30


def state_scales(scene: Scene) -> FloatArray:
    """Scales of the full state, shape (14,).

    With ω₀ the larger synchronous speed, and the largest of a program: lengths (k₁+k₂)/M (what both unbalances move
    the platform by far above resonance), and g/ω₀² where larger for gap and upper layer; rotation (k₁+k₂)ρ/J;
    exciters 1 rad; rates ω₀ times these.
    """
    machine, speed, length = scene.machine, scene.speed_scale, scene.length_scale
    flight = max(length, machine.gravity_m_per_s2 / speed**2)
    arm = max(machine.exciter_distance_m, *(exciter.unbalance_radius_m for exciter in scene.exciter_pair))
    rotation = sum(scene.unbalances) * arm / machine.inertia
    coordinates = np.array([length, length, rotation, 1.0, 1.0, flight, flight])
    return np.concatenate([coordinates, speed * coordinates])


def absolute_tolerances(scene: Scene, system: System) -> FloatArray:
    """Absolute tolerances of a system's unknowns, shape (size,)."""
    atol = np.empty(system.size)
    atol[: system.differential] = state_scales(scene)[system.places]
    atol[system.differential // 2 : system.differential] *= RATE_SHARE
    atol[system.differential :] = FORCE_SHARE * scene.force_scale
    if system.mode is Mode.FLIGHT:
        atol *= FLIGHT_SHARE
    return scene.solver.tolerance * atol


def force_spread(scene: Scene) -> float:
    """Change of F_c (N) when the state changes by its scales: the effect of state errors on the force.

    With layers or motors that are stiff compared with the excitation it is much larger than the forces themselves.
    """
    machine, scales = scene.machine, state_scales(scene)
    lower, upper = scene.layer_masses
    stiffness, damping = scene.layer_spring
    rates = RATE_SHARE * scales[7:]
    layers = upper * (stiffness * scales[6] + damping * rates[6])
    springs = machine.stiffness_y_n_per_m * scales[1] + scene.damping_y * rates[1]
    motors = max(scene.unbalances) * scene.fastest_decay * rates[3]
    return float(scene.force_scale + layers + lower / machine.total_mass * (springs + motors))


def force_noise(scene: Scene) -> float:
    """Contact forces up to this (N) are noise: what errors of the state within the tolerance, or round-off, leave.

    At a liftoff F_c has either sign within it. In 400 random scenes F_c was never below zero by more than 5e-5 of it.
    """
    admitted = min(scene.solver.tolerance * force_spread(scene), FORCE_ERROR * scene.force_scale)
    return max(admitted, FORCE_NOISE * scene.force_scale)


@compiled
def halvings(tolerance: float, height: float, scale: float, sure: bool) -> int:
    """How often the gap rate's tolerance is halved in a flight much lower than the scale of lengths.

    An absolute error of the gap moves a landing at speed v by its ratio to v, so the many low flights
    of accumulating impacts need a gap as accurate against their own height: its tolerance is divided by
    4ⁿ, that of its rate by 2ⁿ. Gap and rate are integrated from 0 and keep their digits however low a
    flight is; one that may rise higher than expected must not be asked for more than round-off leaves of it.

    Parameters
    ----------
    tolerance
        That of the run.
    height, scale
        Expected height of the flight and scale of the gap (m).
    sure
        Whether the flight is known to be that low.
    """
    share = max(height / scale, 4.0**-MOST_HALVINGS if sure else ROUND_OFF / tolerance)
    return min(int(-0.5 * math.log2(share)), MOST_HALVINGS) if share < 1.0 else 0
