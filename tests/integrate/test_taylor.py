"""Engine taylor: where steps end, how sure a guard is, rest of exciters, ends without a motion."""

import numpy as np
import pytest
from common.random_scenes import random_scene

from vibroplat import Scene, simulate
from vibroplat.hybrid.state import RUNNING
from vibroplat.integrate import lockstep
from vibroplat.integrate.step_end import ERROR_COEFFICIENTS, guard_fall, statuses
from vibroplat.integrate.taylor import TaylorEngine, degree_of
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lanes import as_lanes
from vibroplat.kernels.lines import in_lines
from vibroplat.kernels.polynomial import MAX_DEGREE
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator

TAYLOR = {"solver.engine": "taylor"}
DEGREE, GUARD = 17, 5


def fall(coefficients, zeros=0):
    """Fraction at which a guard falls, and whether that is sure; as in a step in flight."""
    c = in_lines((DEGREE + 1, 16))
    c[: len(coefficients), GUARD] = coefficients
    status = statuses(1)[0]
    status["sizes"][GUARD] = np.abs(c[1:, GUARD]).sum()
    return guard_fall(c, DEGREE, GUARD, zeros, False, status, status["sizes"][GUARD])


def with_rest(coefficients, size):
    """The same with so much in the last coefficients, which bound the remainder, and nothing of it in the sum."""
    c = np.zeros(DEGREE + 1)
    c[: len(coefficients)] = coefficients
    c[-ERROR_COEFFICIENTS:] = 0.25 * size * np.array([1.0, -1.0, 1.0, -1.0])
    return c


def test_clear_falls_are_sure():
    assert fall([1.0, -2.0]) == (pytest.approx(0.5), True)
    assert fall([1.0, 2.0]) == (-1.0, True)
    found, sure = fall(with_rest([1.0, -2.0], 1e-6))
    assert sure
    assert found == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize(("depth", "sure"), [(1e-3, True), (1e-7, False), (-1e-7, False), (-1e-3, True)])
def test_near_a_touch_the_answer_is_sure_beyond_the_remainder(depth, sure):
    """(s − 0.9)² − depth: a remainder of up to 1e-5 decides where the depth is smaller."""
    touching = with_rest([0.81 - depth, -1.8, 1.0], 1e-5)
    found, decided = fall(touching)
    assert decided == sure
    if sure:
        assert (found >= 0.0) == (depth > 0.0)


def test_degree_follows_the_tolerance():
    degrees = [degree_of(10.0**-n) for n in range(2, 15)]
    assert degrees == sorted(degrees)
    assert degree_of(1e-6) == DEGREE
    assert max(degrees) <= MAX_DEGREE


@compiled
def begin(g):
    return lockstep.attend(g, 0, 0)


@compiled
def take(g):
    s, r, p = as_lanes(g.lanes), as_lanes(g.room), as_lanes(g.rows)
    lockstep.expand(s, g.degree, r, p, g.moving)
    lockstep.propose(g, s, r)
    lockstep.expand(s, g.degree, r, p, g.moving)


@compiled
def confirm(g):
    lockstep.confirm(g, as_lanes(g.lanes), as_lanes(g.room))


@pytest.mark.parametrize(("defect", "kept"), [(0.5, True), (2.0, False)])
def test_a_step_is_kept_where_its_series_ends_with_the_accelerations_of_the_equations(defect, kept):
    scene = Scene().replace(TAYLOR)
    p = parameters(scene)
    engine = TaylorEngine(scene, p)
    motion = Simulator(scene, p, engine)
    motion.to_time(0.01)
    motion.automaton.run["end"], motion.automaton.run["outcome"] = 1.0, RUNNING
    g = engine._groups[0]
    s = g.lanes
    assert begin(g)
    take(g)
    assert s["pending"] == 1.0
    before = s["y0"].copy()
    s["a"][3] = 2.0 * g.room["q"][2, 3] + defect * lockstep.MAX_DEFECT * DEGREE / (s["length"] * s["weights"][3])
    confirm(g)
    assert s["pending"] == kept
    assert s["rejected"] == (not kept)
    assert kept or (s["y"] == before).all()


@pytest.mark.parametrize(("number", "largest"), [(325, 1e-6), (375, 1e-2)])
def test_a_step_that_is_taken_back_is_taken_anew_from_its_beginning(number, largest):
    """These scenes reject steps; going on with the series of the end that was left was off by 6e-3 and 0.5."""
    scene = random_scene(number, as_bought=True, turns=3).replace(TAYLOR)
    run, exact = (simulate(one, keep="summary") for one in (scene, scene.replace({"solver.tolerance": 1e-11})))
    assert run.summary["error_test_failures"] > 0
    assert np.abs(run._end - exact._end).max() < largest * np.abs(exact._end).max()


def test_few_steps_a_turn(quickstart):
    scene = quickstart.replace({**TAYLOR, "material.mass_ratio": 0.0, "run.duration_s": 4.0})
    summary = simulate(scene, keep="summary").summary
    turns = 4.0 * scene.speed_scale / (2.0 * np.pi)
    assert summary["engine"] == "taylor"
    assert 2.0 < summary["steps"] / turns < 10.0
    assert summary["error_test_failures"] <= 0.02 * summary["steps"]
    assert summary["residual_calls"] is None


def test_stiff_scene_has_a_note_and_others_have_none(quickstart):
    notes = {}
    calm = quickstart.replace({**TAYLOR, "drive.supply_frequency_hz": 40.0, "run.duration_s": 1.0})
    stiff = calm.replace({"material.natural_frequency_hz": 5000.0})
    for name, scene in (("calm", calm), ("stiff", stiff), ("native", stiff.replace({"solver.engine": "native"}))):
        told = simulate(scene, keep="summary").notes
        notes[name] = [note for note in told if "engine taylor takes" in note]
    assert (len(notes["calm"]), len(notes["stiff"]), len(notes["native"])) == (0, 1, 0)
    assert "solver.engine = native is likely to be faster" in notes["stiff"][0]
