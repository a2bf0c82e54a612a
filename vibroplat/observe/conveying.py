"""Measures of material that moves along the deck: conveying speed, fractions of modes, friction, throughput."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibroplat.columns import Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.hybrid.modes import MODES, SLIP_MINUS, SLIP_PLUS, STICK
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.model.energy import ALONG_FORCE, ALONG_SIZE, FRICTION
from vibroplat.model.parameters import Parameters
from vibroplat.model.springs import CURVED_FORCE, between_layers, slopes
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, LAYERS, SENSE
from vibroplat.observe.measures import Accumulators
from vibroplat.observe.section import section_rows

#: Ratio of shear to pressure between the layers above which a bed shears inside: the tangent of its angle of internal
#: friction, 35°.
INTERNAL_FRICTION = 0.7

#: Columns that follow from the conveying speed.
OF_SPEED = (
    *("conveying_speed_m_per_s", "conveying_speed_error_m_per_s"),
    *("throughput_kg_per_s", "residence_time_s"),
)
#: Modes whose times are summed up, in this order.
_TIMED = np.array([STICK, SLIP_PLUS, SLIP_MINUS])

#: Columns of a scene with transport, for the measuring interval.
CONVEYING: Columns = {
    "conveying_speed_m_per_s": Column(
        "mean velocity of the material along the deck", "over ground, towards +x; over whole turns of exciter 1"
    ),
    "conveying_speed_error_m_per_s": Column(
        "standard error of conveying_speed_m_per_s", "from the scatter of its means over whole turns"
    ),
    "stick_fraction": Column("fraction of the time in which the material sticks to the deck"),
    "slip_plus_fraction": Column("fraction of the time in which it slips towards +x"),
    "slip_minus_fraction": Column("fraction of the time in which it slips towards -x"),
    "friction_power_w": Column("mean power of friction between material and deck", "with that of impacts"),
    "throughput_kg_per_s": Column("mass conveyed in a second", "if the deck's length is given"),
    "residence_time_s": Column("time that the material takes along the deck", "if its length is given and it travels"),
    "wear_power_w_per_m2": Column("power of friction over the deck's area", "if its length and width are given"),
    "sheared_fraction": Column(
        "fraction of the contact time in which a bed would shear inside",
        f"shear over {INTERNAL_FRICTION} of the pressure between the layers, which are rigid in shear here; empty with "
        "one layer",
    ),
    "friction_work_j": Column("energy dissipated by friction in the whole run", "with that of impacts"),
    "momentum_along_residual_n_s": Column("residual of the balance of momentum along the deck in the whole run"),
    "momentum_along_residual": Column(
        "relative residual of the momentum along the deck",
        "relative to the maximum of the integral of forces and the momenta at both ends",
    ),
}


@compiled
def find_sliding(
    samples: FloatArray,
    weights: FloatArray,
    nodes: int,
    means: FloatArray,
    system: int,
    sliding: FloatArray,
    power: FloatArray,
    p: Parameters,
) -> None:
    """Fill means over a part of a step: of the last :data:`vibroplat.observe.measures.SUMS`, powers and forces.

    ``samples`` are the unknowns at the nodes, in rows 1 … nodes, and ``means`` theirs, as in
    :func:`vibroplat.model.energy.powers`.
    """
    n, (stiffness, damping), total = DIFFERENTIAL[system] // 2, slopes(p), p.mass + p.material_mass
    loss = sheared = 0.0
    for i in range(1, nodes + 1 if ALGEBRAIC[system] else 1):
        force, friction, weight = samples[i, 2 * n], samples[i, 2 * n + 1], weights[i - 1]
        if SENSE[system] != 0.0:
            loss += weight * p.kinetic_friction * force * abs(samples[i, 2 * n - 1])
        if LAYERS[system] == 2:
            pressed = between_layers(samples[i], system, p)
            sheared += weight * (abs(friction) > -INTERNAL_FRICTION * p.material_mass * pressed)
    power[FRICTION] = loss
    resisting = stiffness[0] * means[0, 0] + damping[0] * means[0, n] + means[4, CURVED_FORCE]
    power[ALONG_FORCE] = total * p.slope - resisting
    power[ALONG_SIZE] = total * abs(p.slope) + damping[0] * means[2, n] + stiffness[0] * means[2, 0]
    for k in range(3):
        sliding[k] = 1.0 if MODES[system] == _TIMED[k] else 0.0
    sliding[3], sliding[4] = loss, sheared


def turn_speeds(ms: Accumulators, scene: Scene) -> FloatArray:
    """Mean velocities of the material over ground in whole turns of exciter 1 (m/s), the last ones that are kept."""
    assert scene.transport is not None
    rows = section_rows(ms)
    state = rows["state"]
    places = rows["along"][:, 0] + state[:, 0] - scene.transport.deck_height_m * state[:, 2]
    speeds: FloatArray = np.diff(places) / np.diff(rows["t"])
    return speeds


def conveying(ms: Accumulators, mean: dict[str, float], scene: Scene) -> dict[str, Any]:
    """Return :data:`CONVEYING` of a measured interval and its means, but for the error of speed and the audit."""
    transport, found = scene.transport, dict.fromkeys(CONVEYING)
    if transport is None or not mean:
        return found
    speeds, mass = turn_speeds(ms, scene), scene.material_mass
    speed = float(speeds.mean()) if len(speeds) else None
    length, width = transport.deck_length_m, transport.deck_width_m
    measured: dict[str, Any] = {
        "conveying_speed_m_per_s": speed,
        "stick_fraction": mean["stick"],
        "slip_plus_fraction": mean["slip_plus"],
        "slip_minus_fraction": mean["slip_minus"],
        "friction_power_w": mean["friction_loss"],
    }
    if length is not None and speed is not None:
        measured["throughput_kg_per_s"] = mass * speed / length
        measured["residence_time_s"] = length / abs(speed) if speed else None
    if length is not None and width is not None:
        measured["wear_power_w_per_m2"] = mean["friction_loss"] / (length * width)
    touching = mean["stick"] + mean["slip_plus"] + mean["slip_minus"]
    if scene.layers == 2 and touching > 0.0:
        measured["sheared_fraction"] = mean["sheared"] / touching
    return {**found, **measured}
