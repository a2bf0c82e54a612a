"""Shots in compiled code: the motion of a simulator and what its observers see, whatever the engine."""

from contextlib import closing

import numpy as np
import pytest
from common.explicit import explicit

from continuation.helpers import MACHINE, MASS
from vibroplat import load_config
from vibroplat.continuation.first_orbit import first_orbit
from vibroplat.continuation.newton import NoConvergenceError, Problem, correct, fixed_border
from vibroplat.continuation.shooting import Shooter
from vibroplat.hybrid.state import initial_state
from vibroplat.motion.recorder import Recorder
from vibroplat.observe.statistics import Statistics
from vibroplat.observe.variation import Variation
from vibroplat.shooting import shots

KEY = "drive.supply_frequency_hz"


def flying(engine="taylor"):
    """A scene whose material lifts off and lands again and again."""
    return load_config(MACHINE, {"solver.engine": engine, "solver.tolerance": 1e-8, MASS: 0.2, KEY: 50.0})


@pytest.mark.parametrize("engine", ["taylor", "native", "sundae"])
def test_a_shot_is_the_motion_of_a_simulator(engine):
    scene, seconds = flying(engine), 0.3
    start = initial_state(scene)
    with closing(Shooter(scene)) as shooter:
        shot = shooter.shot(start, seconds, full=True)
        recorder, variation, statistics = Recorder(scene, "events"), Variation(), Statistics(0.0, points=0)
        motion = shooter.motion
        motion.reset(start)
        motion.to_time(seconds, (recorder, variation, statistics))
        np.testing.assert_array_equal(shot.state, motion.state)
        np.testing.assert_array_equal(shot.derivative, variation.derivative(motion.automaton))
        unknowns, system = motion.state[motion.system.places], motion.system
        rates = explicit(system.index, motion.now, unknowns, motion.automaton.p)
        assert shot.rates == pytest.approx(system.full(rates), rel=1e-9)
    assert len(shot.events) > 4
    np.testing.assert_array_equal(shot.events, recorder.events)
    np.testing.assert_array_equal(shot.part.measures.work, statistics.measures.work)
    assert [begin for _, begin, _ in shot.pieces[1:]] == [end for *_, end in shot.pieces[:-1]]
    assert (shot.pieces[0][1], shot.pieces[-1][2]) == (0.0, seconds)


def test_there_is_room_for_all_events_of_a_shot(monkeypatch):
    scene = flying()
    with closing(Shooter(scene)) as shooter:
        whole = shooter.shot(initial_state(scene), 0.3, full=True)
    monkeypatch.setattr(shots, "MAX_EVENTS", 1)
    with closing(Shooter(scene)) as shooter:
        found = shooter.shot(initial_state(scene), 0.3, full=True)
    np.testing.assert_array_equal(found.events, whole.events)
    assert found.pieces == whole.pieces
    assert len(whole.pieces) > len(whole.events) > 2


def test_what_python_raises_in_compiled_code_comes_back(monkeypatch):
    scene = flying("sundae")
    with closing(Shooter(scene)) as shooter:

        def interrupted(h):
            raise KeyboardInterrupt

        monkeypatch.setattr(shooter.engine, "advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            shooter.shot(initial_state(scene), 0.1)
        monkeypatch.undo()
        assert shooter.shot(initial_state(scene), 0.1).outcome == "ok"


def test_values_without_a_scene_end_newtons_method(monkeypatch):
    scene = flying()
    with closing(Shooter(scene, [MASS])) as shooter:
        problem, state = Problem(shooter, (1, -1), [1.0]), initial_state(scene)
        chart = problem.chart(state)
        u = chart.pack(state, 0.04, [0.2])

        def refused(values):
            raise ValueError(f"{values[0]} is too much")

        monkeypatch.setattr(shooter, "set", refused)
        with pytest.raises(NoConvergenceError, match="is too much"):
            correct(problem, chart, u, fixed_border(chart))


def test_a_borrowed_shooter_is_as_a_new_one():
    """It has followed another scene, whose motion made it take steps back, and noted more events than it had room."""
    first, second = (flying().replace({KEY: at, "solver.tolerance": 1e-9}) for at in (63.0, 50.0))
    borrowed = Shooter.borrow(first)
    borrowed.shot(initial_state(first), 0.5, full=True)
    borrowed.give_back()
    assert Shooter.borrow(second) is borrowed
    with closing(Shooter(second)) as new:
        shots = [of.shot(initial_state(second), 0.3, full=True) for of in (new, borrowed)]
        assert new.engine.work == borrowed.engine.work
    for name in ("state", "events", "derivative", "rates"):
        np.testing.assert_array_equal(*(getattr(shot, name) for shot in shots))
    np.testing.assert_array_equal(*(shot.part.measures.work for shot in shots))
    borrowed.give_back()
    with closing(Shooter.borrow(second.replace({"solver.tolerance": 1e-8}))) as other:
        assert other is not borrowed


def test_a_shooter_with_keys_is_borrowed_for_the_same_scene_alone():
    """It is as a new one then: no value of the key is known, and no turn is counted."""
    scene, course = flying(), (48.0, 52.0)
    borrowed = Shooter.borrow(scene, [KEY], course)
    borrowed.set([51.0])
    borrowed.shot(initial_state(scene), 0.3, full=True)
    borrowed.give_back()
    for other in (
        (scene, [KEY], (48.0, 53.0)),
        (scene, [MASS], course),
        (scene,),
        (scene.replace({MASS: 0.12}), [KEY], course),
    ):
        with closing(Shooter.borrow(*other)) as new:
            assert new is not borrowed
    assert Shooter.borrow(scene, [KEY], course) is borrowed
    assert np.isnan(borrowed.held[KEY])
    assert borrowed.take_turns() == 0.0
    with closing(Shooter(scene, [KEY], course)) as new:
        for shooter in (new, borrowed):
            shooter.set([50.0])
        shots = [of.shot(initial_state(scene), 0.1, full=True) for of in (new, borrowed)]
    for name in ("state", "derivative", "rates"):
        np.testing.assert_array_equal(*(getattr(shot, name) for shot in shots))
    extremes = [shot.part.measures.extremes.view(float) for shot in shots]
    np.testing.assert_array_equal(*extremes)
    borrowed.close()


def test_parameters_over_a_key_are_those_of_its_scenes():
    """By polynomials within the course, and by scenes beyond it."""
    scene = flying()
    with closing(Shooter(scene, [KEY], (48.0, 52.0))) as along, closing(Shooter(scene, [KEY])) as single:
        for value in (48.0, 50.1, 52.0, 53.0, 49.0):
            ends = []
            for shooter in (along, single):
                shooter.set([value])
                assert shooter.held == {KEY: value}
                ends.append(shooter.shot(initial_state(scene), 0.1, full=True))
            np.testing.assert_allclose(along.records.parameters, single.records.parameters, rtol=1e-13)
            np.testing.assert_allclose(ends[0].state, ends[1].state, rtol=0.0, atol=1e-10)
            np.testing.assert_allclose(ends[0].derivative, ends[1].derivative, rtol=0.0, atol=1e-6)


def test_the_derivative_of_an_orbit_is_exact_where_the_first_guess_is_one():
    """That of the first shot is rough."""
    with closing(Shooter(flying().replace({"solver.tolerance": 1e-9}))) as shooter:
        problem, found = first_orbit(shooter, None, 1, (), 1e-8)
        again = correct(problem, found.chart, found.u, fixed_border(found.chart))
        start, seconds, _ = again.chart.unpack(again.u)
        assert len(again.residuals) == 2
        np.testing.assert_array_equal(again.shot.derivative, shooter.shot(start, seconds, full=True).derivative)
