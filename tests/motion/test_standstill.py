"""Exciters at rest: starts, coast-downs and swings, where the second derivative of the resistance ω|ω| jumps.

SUNDIALS integrates across it, with no event, and loses nothing: over 1e-4 … 1e-12 its errors go with the power 0.83 of
the tolerance, with a smooth resistance 0.89, and are no smaller where it restarts at standstills. Engine ``taylor``
ends a step there. Errors of the motions below, in the scales of the scene, are at most twice the tolerance with and
without standstills; those of ``native`` are up to 90 to 1100 times the tolerance.
"""

import math
from functools import cache

import numpy as np
import pytest
from common.places import ROOT
from scipy.integrate import solve_ivp

from vibroplat import load_config, simulate
from vibroplat.config.coordinates import COORDINATES, RATES, Mode
from vibroplat.hybrid.state import initial_state, state_scales
from vibroplat.model.accelerations import explicit
from vibroplat.model.parameters import parameters, supply
from vibroplat.model.systems import SYSTEMS

(BARE,) = (system for system in SYSTEMS if system.mode is Mode.BARE)
NAMES = [*COORDINATES[:5], *RATES[:5]]

OFF = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]}
FROM_ZERO = {"drive.program": [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 0.6, "supply_frequency_hz": 30.0}]}
#: Resistance that matters within a second (m).
BRAKED = {"motor.friction_radius_m": 0.05}


def turned(first, second, first_rate=0.0, second_rate=0.0):
    state = {
        "phi1_rad": first,
        "phi2_rad": second,
        "phi1_rate_rad_per_s": first_rate,
        "phi2_rate_rad_per_s": second_rate,
    }
    return {"run.initial.state": state}


#: Motions of 0.9 s, and how often an exciter stands still in them after the beginning.
MOTIONS = {
    "swing": ({**OFF, **BRAKED, **turned(-3.0, -0.5, -3.0, 4.0)}, 4),
    "coast-down to standstill": ({**OFF, **BRAKED, **turned(0.3, 2.0, 14.0, -15.0)}, 2),
    "start by swinging back": ({"drive.supply_frequency_hz": 30.0, **BRAKED, **turned(-2.5, -1.0, -20.0, 15.0)}, 2),
    "start at 0 Hz, constant V/f": ({**FROM_ZERO, **BRAKED, "motor.rated_frequency_hz": 50.0, **turned(-2.5, -1.0)}, 0),
    "smooth": ({"drive.supply_frequency_hz": 30.0, **BRAKED, **turned(-2.5, -1.0, 90.0, -90.0)}, 0),
}

#: The reference takes seconds of each.
EACH = pytest.mark.parametrize(
    "motion", [motion if motion == "swing" else pytest.param(motion, marks=pytest.mark.long) for motion in MOTIONS]
)

TOLERANCES = [10.0**-n for n in range(4, 13, 2)]
NATIVE, TAYLOR = {"solver.engine": "native"}, {"solver.engine": "taylor"}


def scene_of(motion, **changes):
    machine = {"machine.damping_y_n_s_per_m": 400.0, "run.perturbation": 0.0, "run.duration_s": 0.9}
    return load_config(ROOT / "configs/machines/printed.yaml", {**machine, **MOTIONS[motion][0], **changes})


class Reference:
    """The motion of a bare scene by DOP853 at 1e-13, in pieces between standstills and corners.

    In a piece the resistance is that of one direction, s ω², which is smooth beyond the standstill that ends the piece.
    """

    def __init__(self, scene):
        self.scene, self.p = scene, parameters(scene)
        self.friction, self.sign = self.p.friction.copy(), np.ones(2)
        self.stops = []

    def flow(self, t, y):
        for i in range(2):
            self.p.friction[i] = math.copysign(self.friction[i], self.sign[i] * y[8 + i] + 0.0)
        return explicit(BARE.index, t, y, self.p)

    def piece(self, t, y, end, events=None):
        atol = 1e-15 * state_scales(self.scene)[BARE.places]
        found = solve_ivp(self.flow, (t, end), y, method="DOP853", rtol=1e-13, atol=atol, events=events)
        assert found.success
        return float(found.t[-1]), found.y[:, -1], found.status == 1

    def stop(self, i):
        def speed(_t, y):
            return y[8 + i]

        speed.terminal, speed.direction = True, -self.sign[i]
        return speed

    def directions(self, t, y):
        rates = self.flow(t, y)
        self.sign = np.array([math.copysign(1.0, y[i] if abs(y[i]) > 1e-9 else rates[i]) for i in (8, 9)])

    def at(self, times):
        """Unknowns at ascending times, the first of which is 0, shape (len(times), 10)."""
        t, y = 0.0, initial_state(self.scene)[BARE.places]
        rows = [y]
        corners = [interval.start for interval in self.scene.drive.intervals if interval.start > 0.0]
        for end in sorted({*times[1:], *(c for c in corners if c < times[-1])}):
            supply(self.p, self.scene, self.scene.drive.at(0.5 * (t + end)))
            while t < end:
                self.directions(t, y)
                if min(abs(y[8:10])) < 1e-9 and t + 1e-6 < end:  # away from a standstill, where speeds do not matter
                    t, y, _ = self.piece(t, y, t + 1e-6)
                    self.directions(t, y)
                stopped, reached, at_stop = self.piece(t, y, end, [self.stop(0), self.stop(1)])
                if at_stop:  # to the end of a step, not by interpolation
                    self.stops.append(stopped)
                    stopped, reached, _ = self.piece(t, y, stopped)
                t, y = stopped, reached
            if end in times:
                rows.append(y)
        return np.array(rows)


@cache
def reference(motion):
    times = np.linspace(0.0, 0.9, 13)
    known = Reference(scene_of(motion))
    return times, known.at(times.tolist()), known.stops


def errors(motion, engine, tolerances):
    times, known, _ = reference(motion)
    found = []
    for tolerance in tolerances:
        run = simulate(scene_of(motion, **engine, **{"solver.tolerance": float(tolerance)}))
        assert run.outcome == "ok"
        scales = state_scales(run.scene)[BARE.places]
        found.append((np.abs(run(times)[NAMES].to_numpy() - known) / scales).max())
    return np.array(found)


@EACH
def test_errors_fall_with_the_tolerance(motion):
    """The bound is the same for all, also for the smooth motion, of which IDA has errors of a third of it."""
    tolerances = np.array(TOLERANCES)
    found = errors(motion, NATIVE, TOLERANCES)
    assert (found <= 30.0 * tolerances**0.8).all()
    assert np.polyfit(np.log(tolerances), np.log(found), 1)[0] > 0.7


@EACH
def test_a_series_keeps_its_order_over_standstills(motion):
    """Its errors are of the order of the tolerance, down to round-off, of the reference as well."""
    tolerances = np.array([*TOLERANCES, 1e-13, 1e-14])
    assert len(reference(motion)[2]) == MOTIONS[motion][1]
    found = errors(motion, TAYLOR, tolerances)
    assert (found <= 5.0 * tolerances + 5e-13).all()
    assert np.polyfit(np.log(tolerances[:-2]), np.log(found[:-2]), 1)[0] > 0.9


def test_a_series_ends_where_an_exciter_stands_still():
    """Steps end there as often as it does, with a speed of exactly 0, and no event is told."""
    motion = "swing"
    run = simulate(scene_of(motion, **TAYLOR))
    speeds = np.concatenate([segment.ends[:, 8:10] for segment in run.segments])
    assert (speeds == 0.0).sum() == MOTIONS[motion][1]
    assert run.summary["events"] == 0


def test_exciter_at_rest_in_balance_stays():
    scene = scene_of("swing", **turned(-0.5 * math.pi, -0.5 * math.pi), **{"run.duration_s": 2.0})
    scene = scene.replace({"run.initial": {"phi1_rad": -0.5 * math.pi, "speed_ratio": 0.0}})
    table = simulate(scene).trajectory
    assert (table["phi1_rate_rad_per_s"].abs() < 1e-12).all()
    assert np.ptp(table["phi1_rad"]) < 1e-12
