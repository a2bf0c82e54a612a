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

from vibroplat import load_config, simulate
from vibroplat.config.coordinates import COORDINATES, RATES, Mode
from vibroplat.hybrid.state import state_scales
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

EACH = pytest.mark.parametrize("motion", MOTIONS)

TOLERANCES = 10.0 ** -np.arange(4.0, 13.0, 2.0)
NATIVE, TAYLOR = {"solver.engine": "native"}, {"solver.engine": "taylor"}


def scene_of(motion, **changes):
    machine = {"machine.damping_y_n_s_per_m": 400.0, "run.perturbation": 0.0, "run.duration_s": 0.9}
    return load_config(ROOT / "configs/machines/printed.yaml", {**machine, **MOTIONS[motion][0], **changes})


@cache
def exact(motion):
    """The motion by a series at 1e-14, to which both engines converge."""
    return simulate(scene_of(motion, **TAYLOR, **{"solver.tolerance": 1e-14}))


def errors(motion, engine):
    """Largest errors in the scales of the scene, by tolerance."""
    times, known, found = np.linspace(0.0, 0.9, 13), exact(motion), []
    scales = state_scales(known.scene)[BARE.places]
    for tolerance in TOLERANCES:
        run = simulate(scene_of(motion, **engine, **{"solver.tolerance": float(tolerance)}))
        assert run.outcome == "ok"
        found.append((np.abs(run(times)[NAMES] - known(times)[NAMES]) / scales).to_numpy().max())
    return np.array(found)


@EACH
def test_errors_fall_with_the_tolerance(motion):
    """The bound is the same for all, also for the smooth motion, of which IDA has errors of a third of it."""
    found = errors(motion, NATIVE)
    assert (found <= 30.0 * TOLERANCES**0.8).all()
    assert np.polyfit(np.log(TOLERANCES), np.log(found), 1)[0] > 0.7


@EACH
def test_a_series_keeps_its_order_over_standstills(motion):
    """Its steps end there as often as an exciter stands still, with a speed of exactly 0, and no event is told."""
    found = errors(motion, TAYLOR)
    assert (found <= 5.0 * TOLERANCES + 5e-13).all()
    assert np.polyfit(np.log(TOLERANCES), np.log(found), 1)[0] > 0.9
    speeds = np.concatenate([segment.ends[:, 8:10] for segment in exact(motion).segments])
    assert (speeds == 0.0).sum() == MOTIONS[motion][1]
    assert exact(motion).summary["events"] == 0


def test_exciter_at_rest_in_balance_stays():
    scene = scene_of("swing", **turned(-0.5 * math.pi, -0.5 * math.pi), **{"run.duration_s": 2.0})
    scene = scene.replace({"run.initial": {"phi1_rad": -0.5 * math.pi, "speed_ratio": 0.0}})
    table = simulate(scene).trajectory
    assert (table["phi1_rate_rad_per_s"].abs() < 1e-12).all()
    assert np.ptp(table["phi1_rad"]) < 1e-12
