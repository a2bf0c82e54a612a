"""Shots in compiled code: the motion of a simulator and what its observers see, whatever the engine."""

from contextlib import closing

import numpy as np
import pytest

from continuation.helpers import MACHINE, MASS
from vibroplat import load_config
from vibroplat.continuation.newton import NoConvergenceError, Problem, correct, fixed_border
from vibroplat.continuation.shooting import Shooter
from vibroplat.hybrid.state import initial_state
from vibroplat.motion.recorder import Recorder
from vibroplat.observe import shots
from vibroplat.observe.statistics import Statistics
from vibroplat.observe.variation import Variation

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
        assert shot.rates == pytest.approx(motion.rates, rel=1e-9)
    assert len(shot.events) > 4
    np.testing.assert_array_equal(shot.events, recorder.events)
    np.testing.assert_array_equal(shot.part.measures.work, statistics.measures.work)
    assert [begin for _, begin, _ in shot.pieces[1:]] == [end for *_, end in shot.pieces[:-1]]
    assert (shot.pieces[0][1], shot.pieces[-1][2]) == (0.0, seconds)


def test_there_is_room_for_all_events_of_a_shot(monkeypatch):
    scene = flying()
    with closing(Shooter(scene)) as shooter:
        whole = shooter.shot(initial_state(scene), 0.3, full=True)
    monkeypatch.setattr(shots, "ROOM", 1)
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
