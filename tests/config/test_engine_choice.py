"""Which engine ``auto`` is, and that the other one is tried where it fails."""

import pytest
from common.places import QUICKSTART

from vibroplat import load_config
from vibroplat.config.engine_choice import FAILED, chosen_engine, engines_to_try, with_second_engine
from vibroplat.errors import MotionError


@pytest.fixture
def scene():
    return load_config(QUICKSTART)


def test_runs_are_integrated_by_ida_and_studies_by_series_unless_the_scene_is_stiff(scene):
    stiff = scene.replace({"machine.damping_y_n_s_per_m": 1e7})
    named = scene.replace({"solver.engine": "sundae"})
    asked = [chosen_engine(one, run=run) for one in (scene, stiff, named) for run in (True, False)]
    assert asked == ["native", "taylor", "native", "native", "sundae", "sundae"]
    assert engines_to_try(scene, run=True) == ["native", "taylor"]
    assert [engines_to_try(one) for one in (scene, stiff, named)] == [
        ["taylor", "native"],
        ["native", "taylor"],
        ["sundae"],
    ]


@pytest.mark.parametrize(("engine", "tried"), [("auto", ["auto", "native"]), ("taylor", ["taylor"])])
def test_the_other_engine_is_tried_where_one_fails(scene, engine, tried):
    """What both cannot do ends as with the first one."""
    asked, scene = [], scene.replace({"solver.engine": engine})

    def compute(given, outcomes):
        asked.append(given.solver.engine)
        outcome = outcomes[len(asked) - 1]
        if outcome == "raises":
            raise MotionError(" and again" * len(asked))
        return outcome

    for outcomes, auto in (
        (["solver-failure", "ok"], "ok"),
        (["raises", "ok"], "ok"),
        (["inaccurate", "solver-failure"], "inaccurate"),
        (["ok", "solver-failure"], "ok"),
    ):
        asked.clear()
        expected = auto if engine == "auto" else outcomes[0]
        if expected == "raises":
            continue
        found = with_second_engine(
            scene, lambda given, each=outcomes: compute(given, each), lambda outcome: outcome in FAILED, (MotionError,)
        )
        assert found == expected
        assert asked == (tried if outcomes[0] != "ok" else tried[:1])
    asked.clear()
    named = "engine taylor:  and again; engine native:  and again and again" if engine == "auto" else " and again"
    with pytest.raises(MotionError, match=f"^{named}$"):
        with_second_engine(scene, lambda given: compute(given, ["raises"] * 2), errors=(MotionError,))
    assert asked == tried
    rows = iter([{"detail": "stuck, state [1, 2]"}, {"detail": "late"}])
    row = with_second_engine(scene, lambda _: next(rows), lambda _: True, reason=lambda row: (row, "detail"))
    both = "engine taylor: stuck; engine native: late" if engine == "auto" else "stuck, state [1, 2]"
    assert row == {"detail": both}
