"""Two engines check each other: what must be found, and what must not be held against them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from common.places import QUICKSTART
from common.random_scenes import random_scene
from common.references import REFERENCES

import vibroplat
from vibroplat import check_run, load_config
from vibroplat.check import with_other_engine, with_other_tolerance
from vibroplat.check.events import ErrorBound, compared_events, match_events
from vibroplat.check.runs import EVENT_TIME, SampledRun, _Comparison, perturbed_scenes
from vibroplat.config.reader import configurations
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.integrate import other_engine
from vibroplat.model.systems import GAP_RATE

FRICTION = "motor.friction_radius_m"
NATIVE = {"solver.engine": "native"}


def honest(scene):
    """Another engine that is right: the same one, with errors of its own."""
    return scene.replace({"solver.tolerance": 0.4 * scene.solver.tolerance})


def wrong(scene):
    """Another engine whose friction is off by 1e-4."""
    return scene.replace({FRICTION: 1.0001 * scene.motor.friction_radius_m})


def run_scene(seconds=0.2, **changed):
    return load_config(QUICKSTART, {"run.duration_s": seconds, **NATIVE, **changed})


# -- which engine checks --------------------------------------------------------------------------------


def test_engines_that_share_least_check_each_other():
    others = {name: other_engine(name) for name in ("auto", "native", "sundae", "taylor")}
    assert others == {"auto": "taylor", "native": "taylor", "sundae": "taylor", "taylor": "auto"}


def test_repetitions_change_nothing_but_tolerance_and_start():
    scene = run_scene()
    for changed in perturbed_scenes(scene):
        same = {"solver.tolerance": scene.solver.tolerance, "run.perturbation": scene.start_perturbation}
        assert changed != scene
        assert changed.replace(same) == scene.replace(same)
    starts = {changed.start_perturbation for changed in perturbed_scenes(scene)}
    assert starts == {0.01, 0.01 + 1e-6, 0.01 + 2e-6}


def test_the_finest_tolerance_is_made_coarser():
    assert with_other_tolerance(run_scene()).solver.tolerance == pytest.approx(1e-7)
    finest = 1e-12
    assert with_other_tolerance(run_scene(**{"solver.tolerance": finest})).solver.tolerance in (0.1 * finest, 1e-11)


# -- runs -----------------------------------------------------------------------------------------------


def test_two_engines_agree_on_a_run():
    found = check_run(run_scene())
    assert (found.agrees, found.disagreement) == (True, "")
    assert {found.engine, found.other} == {
        "native",
        vibroplat.simulate(with_other_engine(run_scene())).summary["engine"],
    }
    assert (found.compared_until_s, found.agree_until_s) == (0.2, 0.2)
    largest = {d.quantity: d for d in found.largest}
    assert set(largest) == {*SampledRun(run_scene()).names, EVENT_TIME}
    assert 0.0 < largest["y_m"].difference <= largest["y_m"].allowed < 1e-2
    assert found.events > 5
    assert len(found.lines()) <= 5


def test_a_wrong_term_is_found_in_a_run():
    scene = run_scene(0.1, **{"solver.tolerance": 1e-10, "output.sample_rate_hz": 100.0})
    found = check_run(scene, other=wrong)
    assert not found.agrees
    assert found.disagreement.startswith("at 0.0")
    for part in (": phi", " rad = ", "(native)", "; allowed difference "):
        assert part.strip() in found.disagreement
    angle = next(d for d in found.largest if d.quantity == "phi1_rad")
    assert angle.difference > angle.allowed
    assert found.to_tree()["agrees"] is False


def test_a_wrong_term_below_the_tolerance_is_none():
    """What friction changes is less than errors of this tolerance do."""
    assert check_run(run_scene(0.1, **{"solver.tolerance": 1e-4}), other=wrong).agrees


def test_an_engine_that_gives_up_is_found():
    scene = run_scene(0.2, **{"contact.restitution": 0.3})
    found = check_run(scene, other=lambda s: s.replace({"solver.max_events_per_period": 3}))
    assert found.disagreement.endswith("outcome ok (native) and event-storm (native); allowed: the same")


def test_a_run_that_ends_at_once_is_checked():
    ending = random_scene(164).replace(NATIVE)  # it begins beyond the model
    found = check_run(ending, other=honest)
    assert (found.agrees, found.compared_until_s, found.largest) == (True, 0.0, ())
    found = check_run(run_scene(0.1), other=lambda scene: honest(ending))
    assert found.disagreement == "at 0 s: outcome ok (native) and beyond-model (native); allowed: the same"


def test_a_run_that_amplifies_errors_is_compared_while_that_makes_sense():
    path = configurations() / "paper" / "f30.7-mu0.2-R0.3.yaml"
    scene = load_config(path, {"run.duration_s": 1.0, **NATIVE})
    found = check_run(scene, other=honest)
    assert found.agrees
    assert 0.2 < found.agree_until_s < found.compared_until_s < 0.9
    assert found.amplification > 1e4
    assert not check_run(scene, other=lambda s: s.replace({"machine.damping_y_n_s_per_m": 40.4})).agrees


def test_samples_are_thinned_and_progress_is_told(monkeypatch):
    monkeypatch.setattr("vibroplat.check.runs.MAX_SAMPLES", 50)
    told = []
    found = check_run(run_scene(0.1), other=honest, progress=lambda reached, events: told.append(reached))
    assert found.agrees
    assert len(SampledRun(run_scene(0.1)).samples) == 51
    assert told == sorted(told)
    assert told[-1] == pytest.approx(0.6)


def table(*rows):
    return pd.DataFrame(rows, columns=["t_s", "kind", "gap_rate_before_m_per_s"])


FLIGHTS = ((0.010, "liftoff", 0.0), (0.020, "impact", -0.1), (0.050, "liftoff", 0.0), (0.060, "impact", -0.1))


def pairs(one, two, error=1e-6, until=0.1):
    return match_events(table(*one), table(*two), ErrorBound(np.array([until]), np.array([error])), run_scene(), until)


def test_events_are_paired_in_order():
    later = tuple((t + 1e-5, kind, v) for t, kind, v in FLIGHTS)
    found = pairs(FLIGHTS, later)
    assert found.rows.tolist() == [[k, k] for k in range(4)]
    assert found.differ_s == np.inf


def friction_events(*events):
    kinds, times = zip(*events, strict=True)
    return compared_events(pd.DataFrame({"t_s": times, "kind": kinds, "gap_rate_before_m_per_s": 0.0}))


@pytest.mark.parametrize(("error", "differs"), [(1e-6, True), (1e-3, False)])
def test_a_slip_that_only_one_run_has_is_found_unless_it_is_short(error, differs):
    """A tenth of 1/w is short where an error of 1e-3 may move the force of friction out of its cone and back."""
    scene = run_scene()
    turn = 1.0 / scene.speed_scale
    one = friction_events(("slip", turn), ("slip", 9.0 * turn), ("stick", 9.1 * turn))
    bound = ErrorBound(np.zeros(1), np.array([error * scene.force_scale / force_spread(scene)]))
    for pair in ((one, one[:1]), (one[:1], one)):
        assert np.isfinite(match_events(*pair, bound, scene, 20.0 * turn).differ_s) == differs


def test_a_reversal_is_a_slip_after_a_stick_of_no_duration():
    scene = run_scene()
    turn = 1.0 / scene.speed_scale
    one = friction_events(("slip", turn), ("reversal", 9.0 * turn), ("chatter", 9.5 * turn))
    two = friction_events(("slip", turn), ("stick", 9.0 * turn), ("slip", 9.001 * turn))
    found = match_events(one, two, ErrorBound(np.zeros(1), np.array([1e-6])), scene, 20.0 * turn)
    assert (found.differ_s, len(found.rows)) == (np.inf, 2)


def test_a_wrong_friction_is_found():
    scene = load_config(REFERENCES / "feeder-inclined-line.yaml", NATIVE | {"run.duration_s": 0.2})
    found = check_run(scene)
    assert (found.agrees, found.events) == (True, 14)
    slippery = check_run(scene, other=lambda scene: scene.replace({"transport.friction": 0.4001}))
    assert "allowed difference" in slippery.disagreement


@pytest.mark.parametrize("swapped", [False, True])
def test_a_flight_that_only_one_run_has_is_found_unless_it_is_slight(swapped):
    high = (*FLIGHTS[:2], (0.030, "liftoff", 0.0), (0.035, "impact", -0.05), *FLIGHTS[2:])
    low = (*FLIGHTS[:2], (0.030, "liftoff", 0.0), (0.030 + 1e-6, "impact", -1e-9), *FLIGHTS[2:])
    found = pairs(high, FLIGHTS) if not swapped else pairs(FLIGHTS, high)
    assert (len(found.rows), found.differ_s) == (2, 0.030)
    assert "liftoff at 0.03 s" in found.why[int(swapped)]
    found = pairs(low, FLIGHTS) if not swapped else pairs(FLIGHTS, low)
    assert (len(found.rows), found.differ_s) == (4, np.inf)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_slight_flight_takes_no_partner_from_a_clear_one(swapped):
    before = ((0.0098, "liftoff", 0.0), (0.0098 + 1e-6, "impact", -1e-9))
    both = [FLIGHTS, (*before, *FLIGHTS)]
    found = pairs(*both[:: -1 if swapped else 1])
    assert sorted(found.rows.ravel().tolist()) == [0, 1, 2, 2, 3, 3, 4, 5]
    assert found.differ_s == np.inf


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("slower", [1.0, 0.999])
def test_events_that_only_one_run_takes_for_slight_are_paired(slower, swapped):
    """An impact about as fast as an error may make one, and another soon after it."""
    speed = state_scales(run_scene())[GAP_RATE] * np.sqrt(2e-6)
    flights = [
        ((0.010, "liftoff", 0.0), (0.011, "impact", -s * speed), (0.0111, "liftoff", 0.0), (0.0125, "impact", -0.1))
        for s in (1.001, slower)
    ]
    found = pairs(*flights[:: -1 if swapped else 1])
    assert (found.rows.tolist(), found.differ_s) == ([[k, k] for k in range(4)], np.inf)


@pytest.mark.parametrize("end", [0.1, 0.03])
def test_a_repetition_that_ends_early_excuses_no_other_sequence(end):
    def course(engine, events, end=0.1):
        times = np.linspace(0.0, end, 11)
        samples = pd.DataFrame({"y_m": 0.0, "mode": "attached"}, index=times)
        told = {"samples": samples, "events": table(*events), "names": ["y_m"], "scales": {"y_m": 1.0}}
        return SimpleNamespace(scene=run_scene(), engine=engine, outcome="ok", end=end, **told)

    first, other, again = course("a", FLIGHTS), course("b", FLIGHTS[:2]), course("b", FLIGHTS[:2], end)
    found = _Comparison(first, other, again, [first]).result()
    assert found.disagreement.startswith("at 0.05 s: sequence of events")


def test_an_accumulation_may_be_closed_sooner_in_one_run():
    def accumulation(count, first):
        falls = first * 0.4 ** np.arange(count)
        return (*FLIGHTS[:2], *((0.020 + t, "impact", -0.05) for t in np.cumsum(falls).tolist()), *FLIGHTS[2:])

    found = pairs(accumulation(2, 1e-6), accumulation(5, 1e-6))
    assert (len(found.rows), found.differ_s) == (6, np.inf)
    assert pairs(accumulation(2, 1e-3), accumulation(5, 1e-3)).differ_s < 0.03


def test_an_event_at_the_end_may_come_after_it():
    assert pairs(FLIGHTS, FLIGHTS[:3], until=0.0601).differ_s == np.inf
    assert pairs(FLIGHTS, FLIGHTS[:3], until=0.09).differ_s == 0.060
