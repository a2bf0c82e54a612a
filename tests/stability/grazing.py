"""Grazing: impacts whose speed goes to zero as a parameter approaches the value where the layer only touches."""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
from common.known import GRAVITY, OMEGA, ball_on_table
from scipy.optimize import brentq

from stability.checks import row, sound, with_engine
from vibroplat.motion.run import simulate

TOLERANCE = 1e-11
#: Minimal gap, over the platform's amplitude, that integration does not distinguish from 0.
RESOLVED = 2e-9
#: Largest error of the impact speed, over the error due to that resolution of the gap; and change of the gap's rate
#: soon after, over that of the impact: the later motion is continuous in the impact speed.
SPEED, JUMP = 2.0, 2.0

#: A ω²/g of the table, phase in which the ball grazes it, and time from the start until then (s).
GAMMA, GRAZED, START = 2.0, 0.5 * math.pi + 0.3, 0.01


class Touch(NamedTuple):
    """The motion near the minimal gap of a flight."""

    amplitude: float  # of the platform (m)
    depth: float  # minimal gap without an impact (m)
    speed: float  # gap rate when the gap is first 0 (m/s); 0 if the gap stays open
    fastest: float  # the same for a gap smaller by the resolution of the integration (m/s)
    until: float  # end of the neighbourhood (s)
    rate: float  # the gap's rate at that time without an impact (m/s)


def grazing(count, engine):
    """Approach a grazing motion from both sides, from 1e-6 to 1e-10, with and without rebound.

    A ball meets a table whose frequency is close to the grazing frequency, which follows from a parabola and a sine.
    """
    offsets = np.logspace(-10.0, -6.0, max(count // 4, 2))
    rows = []
    for restitution, offset in product((0.0, 0.5), (*-offsets[::-1], *offsets)):
        scene, touch = over_table(restitution, offset)
        name = f"ball, R {restitution:g}, offset {offset:.3g}"
        rows.append(judged(name, with_engine(scene, engine), touch))
    return rows


def judged(name, scene, touch):
    """Compare a run with the expected contact: one impact of the right speed, or none."""
    run = simulate(scene)
    events = run.events[run.events["t_s"] < touch.until]
    resolved = RESOLVED * touch.amplitude
    unclear = abs(touch.depth) <= resolved
    wrong = 0 if unclear and len(events) <= 1 else abs(len(events) - int(touch.depth < 0.0))
    limits = {"wrong_events": (wrong, 0.0), **sound(scene, run.summary)}
    if len(events) == 1 and not unclear:
        # v² is linear in the depth, so an error of the depth is one of v²
        error = abs(float(events["gap_rate_before_m_per_s"].iloc[0]) ** 2 - touch.speed**2)
        limits["speed_error"] = (error / touch.speed**2, SPEED * resolved / abs(touch.depth))
    change = abs(float(run([touch.until])["gap_rate_m_per_s"].iloc[0]) - touch.rate)
    limits["change_m_per_s"] = (change, JUMP * (1.0 + scene.contact.restitution) * touch.fastest)
    return row(name, run.outcome, limits)


def over_table(restitution, offset):
    """Let a ball pass a table whose frequency differs from the grazing frequency by a relative offset."""
    amplitude = GAMMA * GRAVITY / OMEGA**2
    phase = GRAZED - OMEGA * START
    rate = amplitude * OMEGA * math.cos(GRAZED) + GRAVITY * START  # of the ball, at the start
    height = amplitude * math.sin(GRAZED) - rate * START + 0.5 * GRAVITY * START**2
    omega = OMEGA * (1.0 + offset)

    def gap(t):
        # a difference of sines would lose offsets of 1e-12
        moved = 2.0 * math.cos((0.5 * (OMEGA + omega)) * t + phase) * math.sin(0.5 * OMEGA * offset * t)
        return height + rate * t - 0.5 * GRAVITY * t * t - amplitude * (math.sin(OMEGA * t + phase) + moved)

    def gap_rate(t):
        return rate - GRAVITY * t - amplitude * omega * math.cos(omega * t + phase)

    gamma = amplitude * omega**2 / GRAVITY
    table = ball_on_table(gamma, restitution, tolerance=TOLERANCE, phase=phase, omega=omega, periods=0.75)
    start = {"run.initial.state.gap_m": gap(0.0), "run.initial.state.gap_rate_m_per_s": gap_rate(0.0)}
    reach = 0.4 * START
    bottom = brentq(gap_rate, START - reach, START + reach, xtol=1e-16)
    depth = gap(bottom)
    speed = gap_rate(brentq(gap, START - reach, bottom, xtol=1e-16)) if depth < 0.0 else 0.0
    level = max(depth, 0.0) + RESOLVED * amplitude
    fastest = abs(gap_rate(brentq(lambda t: gap(t) - level, START - reach, bottom, xtol=1e-16)))
    return table.replace(start), Touch(
        amplitude, depth, speed, max(fastest, abs(speed)), START + reach, gap_rate(START + reach)
    )
