"""When Newton's method is given up."""

from contextlib import closing

import numpy as np
import pytest

from vibroplat import load_config
from vibroplat.config.coordinates import TURN
from vibroplat.continuation.newton import NoConvergenceError, Problem, correct, fixed_border
from vibroplat.continuation.shooting import Shooter

from .helpers import MACHINE


def test_newtons_method_is_given_up_by_the_course_of_its_steps():
    """A limit below the second step; one above it changes nothing."""
    scene = load_config(MACHINE, {"solver.engine": "taylor", "drive.supply_frequency_hz": 50.0})
    with closing(Shooter(scene)) as shooter:
        shooter.motion.to_section(20, 40.0 * TURN / scene.speed_scale)
        state = shooter.motion.state
        state[3:5] -= TURN * np.round(state[3:5] / TURN)
        problem = Problem(shooter, (1, -1))
        chart = problem.chart(state)
        guess = chart, chart.pack(state, TURN / scene.speed_scale), fixed_border(chart)
        found = correct(problem, *guess)
        kept = correct(problem, *guess, limits=(1.0, 1.0))
        with pytest.raises(NoConvergenceError, match="the iteration does not converge"):
            correct(problem, *guess, limits=(1e-9, 1.0))
    assert len(found.residuals) > 2
    assert kept.residuals == found.residuals
