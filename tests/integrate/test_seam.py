"""The seam is whole: DOP853 behind it passes what the package's own integrators pass, and fails as they do."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from common.known import accumulation_time, ball_on_table, dropped_ball
from common.places import QUICKSTART, ROOT
from common.random_scenes import random_scene

from integrate.dop853 import Dop853
from vibroplat import load_config, simulate
from vibroplat.bench.measure import coordinate_errors, event_errors
from vibroplat.config.reader import load_tree
from vibroplat.integrate.seam import IntegrationError
from vibroplat.integrate.stepwise import Stepwise
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Motion

REFERENCE = ROOT / "tests/reference"
STATISTICS = (
    *("rms_y_m", "amplitude_y_m", "excitation_frequency_hz", "flight_fraction", "phase_coherence"),
    *("motor_power_w", "motor_work_j"),
)
OF_CONTACT = ("contact_force_max_n", "gap_max_m", "impulse_sum_n_s")


@pytest.fixture(scope="module")
def bouncing():
    scene = load_config(QUICKSTART, load_tree(ROOT / "tests/machines/damped.yaml"))
    return scene.replace({"contact.restitution": 0.5, "run.duration_s": 0.5})


def engine(scene, integrator=Dop853):
    p = parameters(scene)
    return Stepwise(integrator(p), p)


def run(scene, integrator=Dop853, rows=None, **options):
    def through(scene, p):
        made = Stepwise(integrator(p), p)
        made.rows = rows or made.rows
        return made

    return simulate(scene, engine=through, **options)


def at(name, tolerance):
    return load_config(REFERENCE / f"{name}.yaml").replace({"solver.tolerance": tolerance})


# -- accuracy --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        *("inelastic-mu02-fe51.5", "onelayer-R03-mu01-fe48"),
        pytest.param("restitution05-mu02-fe51.5", marks=pytest.mark.long),
    ],
)
def test_reference(name):
    """At tolerance 1e-8, twice the errors measured; where the motion amplifies errors, at 1e-10."""
    amplified = name.startswith(("restitution", "onelayer"))
    found = run(at(name, 1e-10 if amplified else 1e-8))
    trajectory, events = (pd.read_csv(REFERENCE / f"{name}.{kind}.csv") for kind in ("trajectory", "events"))
    errors = coordinate_errors(found, trajectory) | event_errors(found.events, events)
    bounds = {"phi1_rad": 6e-8, "phi2_rad": 6e-8, "contact_force": 2e-7, "event_time_s": 8e-9, "impact_speed": 4e-6}
    for quantity, error in errors.items():
        assert error <= bounds.get(quantity, 1.2e-9), quantity
    assert found.summary["energy_residual"] <= 4e-9
    assert found.summary["momentum_residual"] <= 1e-9


@pytest.mark.parametrize(
    ("change", "tolerance"),
    [({}, 1e-5), ({"contact.restitution": 0.0}, 1e-9), ({"material.mass_ratio": 0.0}, 1e-5)],
    ids=str,
)
def test_statistics_of_long_steps(bouncing, change, tolerance):
    scene = bouncing.replace({"contact.restitution": 0.3, **change})
    own = simulate(scene.replace({"solver.tolerance": 1e-10})).summary
    found = run(scene.replace({"solver.tolerance": tolerance}), keep="summary").summary
    assert found["measured_s"] == pytest.approx(own["measured_s"], rel=100.0 * tolerance + 1e-7)
    for name in STATISTICS + OF_CONTACT * (scene.layers > 0):
        if own[name] is None:  # nothing flies in the measured part
            assert found[name] is None, name
        else:
            assert found[name] == pytest.approx(own[name], rel=100.0 * tolerance + 1e-6), name
    assert found["liftoffs"] == own["liftoffs"]


def test_measured_part_begins_within_a_step(bouncing):
    """Nothing is measured before, and nothing is left out after it."""
    scene = bouncing.replace({"material.mass_ratio": 0.0, "run.initial": {"speed_ratio": 0.0}})
    scene = scene.replace({"motor": {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0}, "run.duration_s": 0.1})
    for settle in (0.0123, 0.05, 0.0801):
        motion = Motion(scene, parameters(scene), engine(scene))
        part = motion.advance(0.1, settle=settle)
        assert float(part.measures.plain[0] + part.measures.open_turn[0]) == pytest.approx(0.1 - settle)


class Even(Dop853):
    """Everything goes on as it began, in steps of several turns."""

    degree = 1

    def start(self, system, t, y, atol):
        self.y = y

    def steps(self, longest):
        begun, rates = self.y, 0.13 * np.concatenate([self.y[self.y.size // 2 :], np.zeros(self.y.size // 2)])
        self.y = begun + rates
        return np.array([0.13]), np.array([[begun, rates]])


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_several_turns_within_a_step(bouncing, way):
    state = {"phi1_rate_rad_per_s": 150.0 * way, "phi2_rate_rad_per_s": -140.0 * way}
    scene = bouncing.replace({"material.mass_ratio": 0.0, "run": {"duration_s": 10.0, "initial": {"state": state}}})
    found, turns = run(scene, Even), 150.0 / (2.0 * math.pi)
    assert found.summary["excitation_frequency_hz"] == pytest.approx(145.0 / (2.0 * math.pi), rel=1e-12)
    assert len(found.section) == math.floor(10.0 * turns) - math.floor(5.0 * turns)
    assert found.section["phi1_rad"].diff().dropna().to_numpy() == pytest.approx(2.0 * math.pi * way)


@pytest.mark.parametrize(
    ("law", "restitution", "sticking"),
    [("conservative", 0.5, 0.0), ("central", 0.5, 0.15), ("printed", 1.0, 0.15), ("conservative", 0.0, 0.0)],
)
def test_audit(bouncing, restitution, law, sticking):
    contact = {"restitution": restitution, "impact_law": law, "sticking_speed_m_per_s": sticking}
    scene = bouncing.replace({"contact": contact, "run.duration_s": 1.0, "solver.tolerance": 1e-8})
    summary = run(scene, keep="summary").summary
    assert (summary["outcome"], summary["impacts"] > 10) == ("ok", True)
    assert summary["energy_residual"] <= 1e-7
    assert law == "printed" or summary["momentum_residual"] <= 1e-7


# -- transitions -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("excess", [1e-4, 1e-2])
def test_short_flights_are_neither_missed_nor_doubled(excess):
    """Just above lift-off the gap opens on a triple root, and steps are long against the flights."""
    summary = run(ball_on_table(1.0 + excess, tolerance=1e-10), keep="summary").summary
    assert summary["liftoffs"] == summary["impacts"] == 40
    own = simulate(ball_on_table(1.0 + excess, tolerance=1e-10), keep="summary").summary
    assert summary["flight_fraction"] == pytest.approx(own["flight_fraction"], rel=2e-8 / excess)


def test_contact_that_touches_zero_goes_on():
    summary = run(ball_on_table(1.0, tolerance=1e-9, periods=10), keep="summary").summary
    assert summary["outcome"] == "ok"
    assert summary["flight_fraction"] < 1e-4
    assert summary["gap_max_m"] < 1e-12


def test_accumulating_impacts_end_on_time():
    """Every next flight is shorter by R, down to those that are latched."""
    found = run(dropped_ball(0.2))
    assert found.events["kind"].iloc[-1] == "latch"
    landed = next(segment for segment in found.segments if segment.system.algebraic)
    assert landed.start == pytest.approx(accumulation_time(0.2), rel=1e-9)


# -- the loop around steps -------------------------------------------------------------------------------


class Several(Dop853):
    """Hands over three steps at once, beyond the guard's fall and the segment's end."""

    def steps(self, longest):
        lengths, coefficients = zip(*(super(Several, self).steps(longest) for _ in range(3)), strict=True)
        return np.concatenate(lengths), np.concatenate(coefficients)


def test_pieces_and_several_steps_at_once_do_not_show(bouncing):
    whole, several, cut = run(bouncing), run(bouncing, Several), run(bouncing, Several, rows=5)
    pd.testing.assert_frame_equal(whole.events, several.events, check_exact=True)
    pd.testing.assert_frame_equal(whole.trajectory, several.trajectory, check_exact=True)
    assert len(cut.segments) > len(whole.segments)
    pd.testing.assert_frame_equal(cut.events, whole.events, check_exact=True)
    pd.testing.assert_frame_equal(cut.trajectory, whole.trajectory, check_exact=False, rtol=1e-12, atol=1e-12)
    assert cut.summary["rms_y_m"] == pytest.approx(whole.summary["rms_y_m"], rel=1e-13)


def test_stops_are_exact(bouncing):
    """A motion that stops on the way, at a time, at the section, at an event, is the motion that does not."""
    motion = Motion(bouncing, parameters(bouncing), engine(bouncing))
    motion.to_time(0.0371)
    assert motion.now == 0.0371
    assert motion.to_section(2, 1.0)
    assert motion.state[3] == pytest.approx(2.0 * math.pi * round(motion.state[3] / (2.0 * math.pi)), abs=1e-12)
    for kind in ("liftoff", "impact"):
        assert motion.to_event(kind, 1.0)
    events = run(bouncing).events
    assert np.abs(events["t_s"] - motion.now).min() < 1e-6


class Failing(Dop853):
    def steps(self, longest):
        if self.work["steps"] == 20:
            raise IntegrationError("no step is small enough")
        return super().steps(longest)


class Undefined(Dop853):
    def steps(self, longest):
        lengths, coefficients = super().steps(longest)
        return lengths, coefficients * (math.nan if self.work["steps"] > 20 else 1.0)


class Stuck(Dop853):
    def steps(self, longest):
        lengths, coefficients = super().steps(longest)
        return (lengths, coefficients) if self.work["steps"] < 20 else (1e-12 * lengths, 1e-12 * coefficients)


@pytest.mark.parametrize(
    ("integrator", "outcome", "detail"),
    [
        (Failing, "solver-failure", "DOP853: no step is small enough; mode "),
        (Undefined, "non-finite", "DOP853: a step is not finite; mode "),
        (Stuck, "solver-failure", "DOP853: more than 50 steps within a period; mode "),
    ],
)
def test_failures_are_outcomes(bouncing, monkeypatch, integrator, outcome, detail):
    monkeypatch.setattr("vibroplat.integrate.stepwise.MAX_STEPS", 50)
    found = run(bouncing.replace({"material.mass_ratio": 0.0}), integrator)
    assert found.outcome == outcome
    assert found.summary["detail"].startswith(detail)
    assert 0.0 < found.summary["simulated_s"] < 0.5
    assert len(found.trajectory) > 0


def test_model_that_ends_is_named():
    """The platform turns to where the mass matrix is not positive definite."""
    found = run(random_scene(58), keep="summary")
    assert found.outcome == "beyond-model"
    assert "has turned by" in found.summary["detail"]
