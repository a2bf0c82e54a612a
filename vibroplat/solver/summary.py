"""The summary of a run: outcome, statistics of its measured part, energy audit, work done."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroplat.physics.energy import POWERS, elastic_energy, kinetic_energy
from vibroplat.physics.parameters import FloatArray
from vibroplat.physics.systems import System
from vibroplat.scene import Mode, Scene
from vibroplat.solver import measures as m
from vibroplat.solver.engine import Engine, Stretch

if TYPE_CHECKING:
    from vibroplat.solver.trajectory import Event, Trajectory

#: The measured part is what follows this share of the duration, cut to whole turns of exciter 1.
SETTLE_SHARE = 0.5


class Recorder:
    """Sums over a run, fed while it goes."""

    def __init__(self, scene: Scene, p: FloatArray) -> None:
        self.p = p
        self.work = np.zeros(m.N_POWERS)
        self.plain, self.open_turn, self.whole = np.zeros(m.SUMS), np.zeros(m.SUMS), np.zeros(m.SUMS)
        self.marks = np.zeros(m.MARKS)
        self.marks[m.WINDOW] = SETTLE_SHARE * scene.run.duration_s
        self.marks[m.FORCE_MIN], self.marks[m.FORCE_MAX] = math.inf, -math.inf
        self.counts = {"liftoff": 0, "impact": 0, "latch": 0}
        self.impact_loss = 0.0
        self.impulse_sum = 0.0
        self.impulse_max = 0.0
        self.largest_kinetic = 0.0
        self.kinetic = [0.0, 0.0]
        self.elastic = [0.0, 0.0]

    def begin(self, state: FloatArray) -> None:
        """Note the energies at the start."""
        self.kinetic[0], self.elastic[0] = kinetic_energy(state, self.p), elastic_energy(state, self.p)
        self.largest_kinetic = self.kinetic[0]

    def add(self, system: System, stretch: Stretch, start: float, turns: FloatArray) -> None:
        """Add the steps of one stretch."""
        flying = system.mode is Mode.FLIGHT
        m.accumulate(
            stretch.t,
            stretch.y,
            stretch.yp,
            system.places,
            start,
            turns,
            self.p,
            float(flying),
            self.work,
            self.plain,
            self.open_turn,
            self.whole,
            self.marks,
        )

    def event(self, event: Event) -> None:
        """Add an event."""
        self.counts[event.kind] += 1
        self.impact_loss += event.energy_loss_j
        self.impulse_sum += event.impulse_n_s
        self.impulse_max = max(self.impulse_max, event.impulse_n_s)

    def finish(self, state: FloatArray) -> None:
        """Note the energies at the end."""
        self.kinetic[1], self.elastic[1] = kinetic_energy(state, self.p), elastic_energy(state, self.p)
        self.largest_kinetic = max(self.largest_kinetic, self.kinetic[1])

    @property
    def audit(self) -> dict[str, float]:
        """Energies of the run (J) and what is left of their balance.

        Motor work + gravity's work + truncation = Δ(kinetic + elastic) + dissipation + impact losses;
        the residual is relative to the larger of the energy that motors and dampers exchanged and the
        kinetic energy.
        """
        terms = {f"{name}_work_j": float(w) for name, w in zip(POWERS, self.work, strict=True)}
        kinetic = self.kinetic[1] - self.kinetic[0]
        elastic = self.elastic[1] - self.elastic[0]
        left = float(self.work[:3].sum() - self.work[3:].sum()) - self.impact_loss - kinetic - elastic
        scale = max(float(self.marks[m.EXCHANGED]) + self.impact_loss, self.largest_kinetic)
        return terms | {
            "impact_loss_j": self.impact_loss,
            "kinetic_change_j": kinetic,
            "elastic_change_j": elastic,
            "energy_residual_j": left,
            "energy_residual": abs(left) / scale if scale > 0.0 else 0.0,
        }

    @property
    def statistics(self) -> dict[str, float | None]:
        """RMS about the mean, frequencies and phase of the measured part; None where it is too short."""
        marks = self.marks
        turned = self.whole[m.TIME] > 0.0
        sums = self.whole if turned else self.plain
        names = ("rms_x_m", "rms_y_m", "rms_phi_rad")
        if sums[m.TIME] <= 0.0:
            empty = (*names, "excitation_frequency_hz", "frequency_split_hz", "phase_difference_rad")
            return dict.fromkeys((*empty, "phase_coherence", "flight_fraction", "measured_s"))
        mean = sums / sums[m.TIME]
        result: dict[str, float | None] = {
            name: math.sqrt(max(mean[square] - mean[first] ** 2, 0.0))
            for name, first, square in zip(names, (m.X, m.Y, m.PHI), (m.XX, m.YY, m.PHI_PHI), strict=True)
        }
        result["excitation_frequency_hz"] = result["frequency_split_hz"] = None
        if turned:
            seconds = 2.0 * math.pi * (marks[m.LAST_TIME] - marks[m.FIRST_TIME])
            first = abs(marks[m.LAST_1] - marks[m.FIRST_1]) / seconds
            second = abs(marks[m.LAST_2] - marks[m.FIRST_2]) / seconds
            result["excitation_frequency_hz"] = 0.5 * (first + second)
            result["frequency_split_hz"] = first - second
        result["phase_difference_rad"] = _half_open(math.atan2(mean[m.SIN], mean[m.COS]))
        result["phase_coherence"] = math.hypot(mean[m.SIN], mean[m.COS])
        result["flight_fraction"] = mean[m.FLIGHT]
        result["measured_s"] = float(sums[m.TIME])
        return {k: None if v is None else float(v) for k, v in result.items()}


def _half_open(angle: float) -> float:
    """Put an angle into (−π, π], with what round-off leaves of −π at π."""
    return angle + 2.0 * math.pi if angle <= -math.pi + 1e-12 else angle


def summarize(
    run: Trajectory,
    recorder: Recorder,
    engine: Engine,
    outcome: str,
    detail: str,
    reached: float,
    wall: float,
) -> dict[str, Any]:
    """Gather the summary of a run.

    Statistics are of the measured part: the last half of the run, cut to whole turns of exciter 1
    when there is one. Extremes, impulses and energies are of the whole run. What a failed run has left
    without a finite value is None.
    """
    force_min, force_max = (float(recorder.marks[i]) for i in (m.FORCE_MIN, m.FORCE_MAX))
    work = engine.counters
    summary = {
        "name": run.scene.name,
        "outcome": outcome,
        "detail": detail,
        "simulated_s": reached,
        **recorder.statistics,
        "contact_force_min_n": force_min,
        "contact_force_max_n": force_max,
        "gap_max_m": float(recorder.marks[m.GAP_MAX]),
        "impulse_max_n_s": recorder.impulse_max,
        "impulse_sum_n_s": recorder.impulse_sum,
        "liftoffs": recorder.counts["liftoff"],
        "impacts": recorder.counts["impact"],
        "latches": recorder.counts["latch"],
        "events": sum(recorder.counts.values()),
        **recorder.audit,
        "engine": engine.name,
        "tolerance": run.scene.solver.tolerance,
        "steps": work.steps,
        "residual_calls": work.residual_calls,
        "jacobian_calls": work.jacobian_calls,
        "restarts": work.restarts,
        "wall_s": wall,
    }
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in summary.items()}
