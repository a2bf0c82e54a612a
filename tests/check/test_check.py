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
from vibroplat.config.engine_choice import other_engine
from vibroplat.config.engines import ENGINES
from vibroplat.config.reader import configurations
from vibroplat.hybrid.state import force_spread, state_scales
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
    others = {name: other_engine(name) for name in ENGINES}
    assert others == {"native": "taylor", "sundae": "taylor", "taylor": "native"}
    scene = run_scene(**{"solver.engine": "auto"})
    assert [with_other_engine(scene, run=run).solver.engine for run in (True, False)] == ["taylor", "native"]


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
    assert found.disagreement.endswith("outcome ok (native) and too-many-events (native); allowed: the same")


def test_a_run_that_ends_at_once_is_checked():
    ending = random_scene(164).replace(NATIVE)  # it begins beyond the model
    found = check_run(ending, other=honest)
    assert (found.agrees, found.compared_until_s, found.largest) == (True, 0.0, ())
    found = check_run(run_scene(0.1), other=lambda scene: honest(ending))
    assert found.disagreement == "at 0 s: outcome ok (native) and outside-model-validity (native); allowed: the same"


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


def flight(begin, end, speed=0.1):
    return (begin, "liftoff", 0.0), (end, "impact", -speed)


def struck_again(first, count):
    """Two flights, after the first of which so many impacts accumulate."""
    times = 0.020 + np.cumsum(first * 0.4 ** np.arange(count))
    return *FLIGHTS[:2], *((t, "impact", -0.05) for t in times.tolist()), *FLIGHTS[2:]


FLIGHTS = (*flight(0.010, 0.020), *flight(0.050, 0.060))
#: About the speed that an error may make, for an impact that only one run takes for slight, and another soon after it.
LIMIT = state_scales(run_scene())[GAP_RATE] * np.sqrt(2e-6)
FAST, SLOW = ((*flight(0.010, 0.011, s * LIMIT), *flight(0.0111, 0.0125)) for s in (1.001, 0.999))
#: Events of two runs and until when they are compared; how many both have, and when they begin to differ.
EVENTS = {
    "in order": (FLIGHTS, [(t + 1e-5, kind, v) for t, kind, v in FLIGHTS], 0.1, 4, np.inf),
    "a flight of one run": ((*FLIGHTS[:2], *flight(0.030, 0.035), *FLIGHTS[2:]), FLIGHTS, 0.1, 2, 0.030),
    "a slight flight": ((*FLIGHTS[:2], *flight(0.030, 0.030 + 1e-6, 1e-9), *FLIGHTS[2:]), FLIGHTS, 0.1, 4, np.inf),
    "a slight flight before a clear one": ((*flight(0.0098, 0.0098 + 1e-6, 1e-9), *FLIGHTS), FLIGHTS, 0.1, 4, np.inf),
    "as slight in both": (FAST, FAST, 0.1, 4, np.inf),
    "slight in one": (FAST, SLOW, 0.1, 4, np.inf),
    "an accumulation closed sooner": (struck_again(1e-6, 2), struck_again(1e-6, 5), 0.1, 6, np.inf),
    "too slow for one": (struck_again(1e-3, 2), struck_again(1e-3, 5), 0.1, 4, 0.02156),
    "an event that may come after the end": (FLIGHTS, FLIGHTS[:3], 0.0601, 3, np.inf),
    "an event long before the end": (FLIGHTS, FLIGHTS[:3], 0.09, 3, 0.060),
}


@pytest.mark.parametrize("name", EVENTS)
def test_events_are_paired_unless_an_error_may_add_or_remove_them(name):
    *events, until, count, differ = EVENTS[name]
    bound = ErrorBound(np.array([until]), np.array([1e-6]))
    for one, two in (events, reversed(events)):
        found = match_events(table(*one), table(*two), bound, run_scene(), until)
        assert (len(found.rows), found.differ_s) == (count, pytest.approx(differ))
        assert all(abs(one[i][0] - two[j][0]) < 1e-4 and one[i][1] == two[j][1] for i, j in found.rows)
        assert np.isinf(differ) or f" at {differ:.4g}" in "".join(found.why)


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
