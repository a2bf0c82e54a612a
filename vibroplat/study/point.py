"""One point of a sweep: settle, measure, classify."""

from __future__ import annotations

import math
import time
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroplat.physics.parameters import FloatArray, parameters
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.solver import hybrid as hy
from vibroplat.solver.engines import make_engine
from vibroplat.solver.initial import initial_state
from vibroplat.solver.motion import Motion
from vibroplat.solver.scales import state_scales
from vibroplat.solver.summary import measured
from vibroplat.solver.tape import Tape
from vibroplat.study.lyapunov import largest_exponent
from vibroplat.study.section import period, section_points
from vibroplat.study.settling import Settling, settle

#: Distance of the phase difference from 0 or π (rad) up to which exciters turn in phase or antiphase.
SYNCHRONOUS = math.pi / 3.0
#: Wander of the phase difference over the measured part (rad) from which on exciters are not synchronous.
WANDER = math.pi / 2.0
#: Phase coherence below which they are not synchronous either.
COHERENCE = 0.8
#: Points of the Poincaré section and impacts that a bifurcation diagram shows of each point, the last ones.
SHOWN = 64

#: What is measured at a point, in the order of the table.
MEASURED = (
    "excitation_frequency_hz",
    "frequency_split_hz",
    "rms_x_m",
    "rms_y_m",
    "rms_phi_rad",
    "amplitude_y_m",
    "phase_difference_rad",
    "phase_coherence",
    "flight_fraction",
    "impacts_per_period",
    "gap_max_m",
    "contact_force_max_n",
    "impulse_max_n_s",
    "motor_power_w",
    "energy_residual",
)


@dataclass(frozen=True)
class Point:
    """A finished point.

    Attributes
    ----------
    row
        Measures and work done, by column of the sweep table.
    state
        Full state at its end, with which the branch goes on, shape (14,); None if it ended early.
    section_y, impact_speeds
        y at whole turns of exciter 1 (m) and speeds of the impacts (m/s), for a bifurcation diagram.
    """

    row: dict[str, Any]
    state: list[float] | None
    section_y: list[float] = field(default_factory=list)
    impact_speeds: list[float] = field(default_factory=list)


def measure_point(scene: Scene, plan: Sweep, state: list[float] | None, key: tuple[int, ...]) -> Point:
    """Settle and measure one point of a sweep.

    Parameters
    ----------
    scene
        What moves, at the point's frequency and values.
    plan
        How to settle and measure.
    state
        Full state at the end of the point before; that of ``run.initial`` without it.
    key
        Numbers of branch and point, from which with the plan's seed the perturbation follows.
    """
    began = time.perf_counter()
    p = parameters(scene)
    speeds: list[float] = []

    def read_impacts(_: Tape, h: hy.Hybrid) -> None:
        rows = h.events[: h.flags[hy.EVENTS]]
        speeds.extend((-rows[rows[:, hy.KIND] == hy.IMPACT, hy.RATE_BEFORE]).tolist())

    with closing(make_engine(scene, p)) as engine:
        start = initial_state(scene) if state is None else np.array(state)
        motion = Motion(scene, p, engine, perturbed(start, scene, plan, key))
        settling = settle(motion, plan)
        is_diagram = plan.kind == "bifurcation"
        seconds = measuring_time(motion.state, plan.measure_s, settling)
        part = motion.go_on(seconds, read=read_impacts if is_diagram else None)
        work = engine.work
    row: dict[str, Any] = {
        "settled": settling.how,
        "settle_s": settling.seconds,
        "outcome": motion.outcome,
        "detail": motion.detail,
        "steps": work["steps"],
        "residual_calls": work["residual_calls"],
        "events": motion.events,
        "simulated_s": motion.now,
    }
    final: list[float] | None = None
    heights: list[float] = []
    if motion.outcome == "ok":
        final = folded(motion.state).tolist()
        points = section_points(part.measures, scene)
        row |= classified(measured(part), points, scene, plan, settling.slip)
        if row["period"] == 0 and plan.lyapunov:
            exponent = largest_exponent(scene, np.array(final))
            row["lyapunov_per_s"] = exponent if math.isfinite(exponent) else None
        if is_diagram:
            heights = (points[-SHOWN:, 1] * state_scales(scene)[1]).tolist()
    row["wall_s"] = time.perf_counter() - began
    return Point(row, final, heights, speeds[-SHOWN:] if final else [])


def classified(
    found: dict[str, Any], points: FloatArray, scene: Scene, plan: Sweep, slip: float = 0.0
) -> dict[str, Any]:
    """Return what a row tells of a measured part: its measures, synchronization and period.

    The period is None where there are no two turns to compare. ``slip`` is the change of the phase difference while
    the motion settled (rad), where that has found no trend in it.
    """
    row = {name: found[name] for name in MEASURED}
    if scene.has_contact and row["gap_max_m"] is None:
        row["gap_max_m"] = 0.0  # it never flew
    row["sync"] = "none" if abs(slip) > WANDER else synchronization(found)
    row["period"] = 0 if row["sync"] == "none" else period(points, plan.period_tolerance)
    if len(points) < 2:
        row["period"] = None
    return row


def folded(state: FloatArray) -> FloatArray:
    """Return a state with its exciter angles in [0, 2π)."""
    found = state.copy()
    found[3:5] %= 2.0 * math.pi
    return found


def perturbed(state: FloatArray, scene: Scene, plan: Sweep, key: tuple[int, ...]) -> FloatArray:
    """Return a state with the rates of platform and exciters changed by normal random numbers.

    A symmetric motion that has lost stability would otherwise be kept by its symmetry for ever.
    """
    if plan.perturbation == 0.0:
        return state
    random = np.random.default_rng((plan.seed, *key))
    changed = state.copy()
    changed[7:12] += plan.perturbation * state_scales(scene)[7:12] * random.standard_normal(5)
    return changed


def measuring_time(state: FloatArray, least: float, settling: Settling) -> float:
    """Return how long to measure (s): where the motion repeats, so that the whole turns in it are whole periods."""
    if settling.turn == 0.0:
        return least
    periods = max(math.ceil(least / (settling.period * settling.turn)), 2)  # fewer would not show that it repeats
    begun = math.copysign(1.0, state[10]) * state[3] / (2.0 * math.pi) % 1.0  # of the turn in which it begins
    return float((1.0 - begun + periods * settling.period + 0.25) * settling.turn)


def synchronization(found: dict[str, Any]) -> str:
    """Name how the exciters turn: ``antiphase``, ``in-phase``, ``intermediate``, or ``none``.

    None, where the phase difference wanders by more than WANDER over the measured part or is incoherent.
    """
    split, seconds, phase = found["frequency_split_hz"], found["measured_s"], found["phase_difference_rad"]
    if split is None or abs(split) * 2.0 * math.pi * seconds > WANDER or found["phase_coherence"] < COHERENCE:
        return "none"
    if abs(phase) <= SYNCHRONOUS:
        return "in-phase"
    return "antiphase" if math.pi - abs(phase) <= SYNCHRONOUS else "intermediate"
