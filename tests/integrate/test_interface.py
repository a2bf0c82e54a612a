"""The interface is whole: DOP853 behind it passes what the package's own integrators pass, and fails as they do."""

import math

import numpy as np
import pytest
from common.places import QUICKSTART, ROOT
from common.references import load_reference

from integrate.dop853 import Dop853
from integrate.stepwise import IntegrationError, Stepwise
from vibroplat import load_config, simulate
from vibroplat.bench.measure import coordinate_errors, event_errors
from vibroplat.config.reader import load_tree
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator


@pytest.fixture(scope="module")
def bouncing():
    scene = load_config(QUICKSTART, load_tree(ROOT / "tests/machines/damped.yaml"))
    return scene.replace({"contact.restitution": 0.5, "run.duration_s": 0.5})


def run(scene, integrator=Dop853):
    return simulate(scene, engine=lambda _scene, p: Stepwise(integrator(p), p))


@pytest.mark.parametrize("name", ["inelastic-mu02-fe51.5", "onelayer-R03-mu01-fe48", "restitution05-mu02-fe51.5"])
def test_reference(name):
    """At tolerance 1e-8, twice the errors measured; where the motion amplifies errors, at 1e-10."""
    amplified = name.startswith(("restitution", "onelayer"))
    known = load_reference(name)
    found = run(known.scene.replace({"solver.tolerance": 1e-10 if amplified else 1e-8}))
    errors = coordinate_errors(found, known.trajectory) | event_errors(found.events, known.events)
    bounds = {"phi1_rad": 6e-8, "phi2_rad": 6e-8, "contact_force": 2e-7, "event_time_s": 8e-9, "impact_speed": 4e-6}
    for quantity, error in errors.items():
        assert error <= bounds.get(quantity, 1.2e-9), quantity
    assert found.summary["energy_residual"] <= 4e-9
    assert found.summary["momentum_residual"] <= 1e-9


def test_measured_part_begins_within_a_step(bouncing):
    """Nothing is measured before, and nothing is left out after it."""
    scene = bouncing.replace({"material.mass_ratio": 0.0, "run.initial": {"speed_ratio": 0.0}})
    scene = scene.replace({"motor": {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0}, "run.duration_s": 0.1})
    p = parameters(scene)
    for settle in (0.0123, 0.05, 0.0801):
        motion = Simulator(scene, p, Stepwise(Dop853(p), p))
        part = motion.advance(0.1, settle=settle)
        assert float(part.measures.plain[0] + part.measures.open_turn[0]) == pytest.approx(0.1 - settle)


class Several(Dop853):
    """Hands over three steps at once, beyond the guard's fall and the segment's end."""

    def steps(self, longest):
        lengths, coefficients = zip(*(super(Several, self).steps(longest) for _ in range(3)), strict=True)
        return np.concatenate(lengths), np.concatenate(coefficients)


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
    monkeypatch.setattr("integrate.stepwise.MAX_STEPS", 50)
    found = run(bouncing.replace({"material.mass_ratio": 0.0}), integrator)
    assert found.outcome == outcome
    assert found.summary["detail"].startswith(detail)
    assert 0.0 < found.summary["simulated_s"] < 0.5
    assert len(found.trajectory) > 0
