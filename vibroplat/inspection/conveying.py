"""How fast material moves along the deck, by formulas of practice, and up to which friction its contact is unique.

The platform moves along a line, or an ellipse, whose longer axis is inclined by β to the deck, with the amplitude
a cos β along it. On a deck that declines by α the formulas give

    v = k_v a ω cos β (1 + tan β tan α) = k_v ω (a cos β + a sin β tan α),

with k_v from 0.75 to 0.95 (makers of linear screens, after whom δ = β), and from 0.49 to 0.56 (70 to 80 % of
v [m/min] = 3.81 N S of feeders with β = 30°, S the amplitude in m and N vibrations a minute: 0.70 a ω cos β). Range:
straight paths. Compared with a simulated feeder (30°, one layer, mass ratio 0.2, friction 0.4) the first one holds at
throw indices from 2.2 to 2.8 and the second one from 0.9 to 1.8. Neither knows friction, mass ratio, layers or impacts:
of 11 other machines 5 were in these ranges, the others up to :data:`ERROR` away.
Sources: TSX, *Vibrating screen calculation formula*; Daesung, *Vibratory conveyors*. Ellipse: Re(a exp(iωt)) of two
complex amplitudes.

Stick, slip and flight exclude each other, without Painlevé's paradox, as long as μ_s |D_nt| < D_nn at all angles
(:mod:`vibroplat.model.sliding`). To first order in k_i²/(J_e,i M), |D_nt| ≤ Σ k_i²/(J_e,i M²) (½ + |h| |P_i| M/J) and
D_nn ≥ 1/m_w1 + 1/M. Source: Painlevé 1895, *Sur les lois du frottement de glissement*.
"""

from __future__ import annotations

import math

import numpy as np

from vibroplat.config.digits import NEGLIGIBLE
from vibroplat.config.scene import Scene
from vibroplat.frames import pd
from vibroplat.inspection.linear import ComplexArray, amplitudes

#: Throw indices, normal to the deck, between which a range of k_v holds, and that range.
BANDS = (((0.9, 1.8), (0.49, 0.56)), ((2.2, 2.8), (0.75, 0.95)))
#: Relative distance from these ranges at which conveying speeds of simulated machines were found.
ERROR = 0.4
#: Ratio of the axes of an ellipse up to which it counts as a line.
STRAIGHT = 0.25


def range_of_speed(throw: float) -> tuple[float, float]:
    """Return the range of k_v at a throw index; NaN where no formula holds."""
    return next((factors for (low, high), factors in BANDS if low <= throw <= high), (math.nan, math.nan))


def path(along: complex, normal: complex) -> tuple[float, float]:
    """Return the angle of an ellipse's longer axis to the deck (rad, −π/2 … π/2) and the ratio of both axes.

    What is nothing along the deck is none.
    """
    if abs(along) <= NEGLIGIBLE * abs(normal):
        return 0.5 * math.pi, 0.0
    squares, crossed = (abs(along) ** 2, abs(normal) ** 2), along * normal.conjugate()
    total = sum(squares)
    root = math.hypot(squares[0] - squares[1], 2.0 * crossed.real)
    angle = 0.5 * math.atan2(2.0 * crossed.real, squares[0] - squares[1])
    return angle, math.sqrt(max(total - root, 0.0) / (total + root))


def expected_conveying(scene: Scene, speed: float, along: complex, normal: complex, throw: float) -> dict[str, float]:
    """Find throw angle and conveying speeds from the speed of the exciters (rad/s), complex amplitudes and throw index.

    ``along`` is that of x − hφ, of the deck's surface, ``normal`` that of y (m).
    """
    assert scene.transport is not None
    angle, ratio = path(along, normal)
    moved = math.copysign(abs(along), angle) + abs(normal) * math.tan(scene.transport.angle)
    straight = ratio <= STRAIGHT
    low, high = sorted(factor * speed * moved if straight else math.nan for factor in range_of_speed(throw))
    return {
        "throw_angle_rad": angle,
        "path_ratio": ratio,
        "conveying_speed_low_m_per_s": low,
        "conveying_speed_high_m_per_s": high,
    }


def conveying_of(scene: Scene, speed: float, amplitudes: ComplexArray, stroke: float, throw: float) -> dict[str, float]:
    """Find the same from amplitudes of x, y, φ of the empty machine at a speed, and the stroke along y (m)."""
    assert scene.transport is not None
    x, y, phi = amplitudes
    along, normal = x - scene.transport.deck_height_m * phi, y / (abs(y) or 1.0) * 0.5 * stroke
    return expected_conveying(scene, speed, along, normal, throw)


def range_of_row(scene: Scene, row: pd.Series) -> tuple[float, float]:
    """Return the range of the conveying speed of a row of a sweep by the formulas; NaN where none holds.

    The exciters turn as in the row, and stroke and throw index are its own.
    """
    names = ["excitation_frequency_hz", "phase_difference_rad", "stroke_y_m", "gamma"]
    frequency, phase, stroke, throw = row[names].to_numpy(dtype=float, na_value=np.nan).tolist()
    if not math.isfinite(frequency + phase + stroke + throw):
        return math.nan, math.nan
    speed, lag = 2.0 * math.pi * frequency, scene.exciter_pair[0].direction * phase
    found = conveying_of(scene, speed, amplitudes(scene, speed, np.array([lag]))[0], stroke, throw)
    return found["conveying_speed_low_m_per_s"], found["conveying_speed_high_m_per_s"]


def unique_friction(scene: Scene) -> float:
    """Return the coefficient of static friction up to which there is no paradox of Painlevé."""
    assert scene.transport is not None
    body, height = scene.body, abs(scene.transport.deck_height_m)
    levers = (0.5 + height * math.hypot(*axis) * body.mass / body.inertia for axis in body.axes)
    crossed = (
        moment**2 / inertia * lever
        for moment, inertia, lever in zip(scene.unbalances, scene.exciter_inertias, levers, strict=True)
    )
    return (body.mass**2 / scene.layer_masses[0] + body.mass) / (sum(crossed) or math.nan)
