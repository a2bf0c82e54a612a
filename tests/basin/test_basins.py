"""Basins: what starts are, which motions they come to, and what is refused."""

import math
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from common.random_scenes import random_scene

from vibroplat import basins, load_config, orbit
from vibroplat.basin.attractors import AttractorSet, name_attractors
from vibroplat.basin.initial_conditions import initial_states, key_values, validated_base_scene
from vibroplat.basin.mapper import AttractorMapper
from vibroplat.basin.study import BasinsStudy, clopper_pearson
from vibroplat.columns import PHASE_COLUMN
from vibroplat.continuation.orbit import with_initial_state
from vibroplat.errors import ConfigError
from vibroplat.hybrid.state import initial_state, state_scales, static_rest
from vibroplat.motion.run import simulate
from vibroplat.study.classification import same_phase
from vibroplat.study.store import Store

PHASE, SPEED, HEIGHT = (f"run.initial.{name}" for name in ("phase_difference_rad", "speed_ratio", "state.y_m"))
GAP, RATE = (f"run.initial.state.{name}" for name in ("gap_m", "phi1_rate_rad_per_s"))


def scene_of(starts, ratio=0.0, **changes):
    """The calibrated machine where it has two stable motions without material."""
    keys = {"drive.supply_frequency_hz": 62.3, "material.mass_ratio": ratio, "solver.engine": "taylor"}
    keys |= {f"run.initial.{name}": changes.pop(name) for name in ("state", "from") if name in changes}
    return load_config(
        Path(__file__).parents[2] / "configs/machines/calibrated.yaml",
        keys | {"basins": {"initial_conditions": starts} | changes},
    )


@pytest.fixture(scope="module")
def found():
    """Starts in more than one block."""
    box = {PHASE: [-math.pi, math.pi], SPEED: [0.0, 1.1], HEIGHT: [-0.005, 0.005]}
    scene = scene_of(box, random=120)
    return scene, basins(scene)


def test_starts_are_the_whole_grid_and_the_same_in_any_blocks():
    plan = scene_of({PHASE: [-3.0, 3.0, 7], SPEED: [0.5, 1.0, 6], HEIGHT: [-1e-3, 1e-3]}, random=2).basins
    together = key_values(plan, range(plan.number))
    apart = np.concatenate([key_values(plan, range(first, first + 12)) for first in range(0, plan.number, 12)])
    np.testing.assert_array_equal(together, apart)
    assert len({(a, b) for a, b, _ in together.tolist()}) == 42
    assert np.ptp(together[:8, 0]) > 4.0
    assert len(set(together[:, 2].tolist())) == plan.number == 84


def test_basins_are_resumed_only_with_as_many_motions_side_by_side(tmp_path, monkeypatch):
    """An attractor that one of them finds is known to the others from then on."""
    scene = scene_of({PHASE: [-3.0, 3.0, 7]})
    with Store(tmp_path, BasinsStudy(scene).conditions) as store:
        store.write(0, 0, {})
    with Store(tmp_path, BasinsStudy(scene).conditions, resume=True) as store:
        assert len(store) == 1
    monkeypatch.setattr("vibroplat.basin.study.lanes", lambda: 3)
    with pytest.raises(ConfigError, match=r"cannot resume: lanes = 3; allowed: [248], as in the finished tasks"):
        Store(tmp_path, BasinsStudy(scene).conditions, resume=True)


def test_states_have_the_values_of_their_keys():
    scene = scene_of({PHASE: [1.0, 2.0, 2], HEIGHT: [-1e-3, 1e-3, 2]})
    states = initial_states(validated_base_scene(scene, scene.basins), scene.basins, range(4))
    values = key_values(scene.basins, range(4))
    np.testing.assert_allclose(states[:, 3] + states[:, 4], values[:, 0])
    np.testing.assert_array_equal(states[:, 1], values[:, 1])
    assert np.ptp(states[:, 10]) > 0.0, "rates are perturbed"


def test_motions_stay_where_they_were_assigned(found):
    scene, tables = found
    shown = tables.attractors.set_index("attractor")
    assert set(shown["sync"]) == {"antiphase", "in-phase"}
    assert shown["count"].sum() == 120
    states = initial_states(validated_base_scene(scene, scene.basins), scene.basins, range(0, 120, 12))
    for state, label in zip(states, tables.starts["attractor"][::12], strict=True):
        after = simulate(with_initial_state(scene, state).replace({"run.duration_s": 20.0}), keep="summary")
        end = orbit(scene, after.final_state)
        assert end.measures["rms_y_m"] == pytest.approx(shown.loc[label, "rms_y_m"], rel=1e-6, abs=1e-9)


def test_rows_of_attractors_are_guesses_for_orbits(found):
    scene, tables = found
    for _, row in tables.attractors.iterrows():
        again = orbit(scene, row)
        assert again.stable
        assert again.distance < 1e-6


def test_an_attractor_keeps_its_name_over_a_key_and_counts_without_starts(found):
    box = found[0].basins.initial_conditions
    over = {"key": "drive.supply_frequency_hz", "start": 62.84, "stop": 63.1, "count": 3}
    tables = basins(scene_of(box, random=30, over=over))
    shares = tables.attractors.pivot_table(index="supply_frequency_hz", columns="attractor", values="fraction")
    assert list(shares) == ["antiphase, period 1", "in-phase, period 1"]
    assert shares.sum(axis=1).tolist() == pytest.approx([1.0, 1.0, 1.0])
    assert shares["antiphase, period 1"].tolist()[1] == 0.0, "carried from the value before"
    assert math.isnan(shares["antiphase, period 1"].tolist()[2]), "beyond its fold"
    np.testing.assert_array_equal(tables.starts[SPEED][:30], tables.starts[SPEED][30:60])


def test_starts_that_come_to_no_orbit_are_one_attractor_of_their_class():
    starts, more = {PHASE: [-2.0, 2.0, 5], "run.initial.state.phi_rad": [0.0, 1e5, 2]}, {"max_turns": 200}
    scene = scene_of(starts, 0.2, **more).replace({"drive.supply_frequency_hz": 60.0})
    result = basins(scene)
    attractors = result.tables["attractors"].set_index("attractor")
    assert set(attractors.index) == {"outside-model-validity", "antiphase, chaotic", "in-phase, period 1"}
    assert attractors["count"].sum() == 10
    assert attractors.loc["antiphase, chaotic", "count"] >= 2
    assert attractors["fraction"].sum() == pytest.approx(1.0)
    chaotic, lost = attractors.loc["antiphase, chaotic"], attractors.loc["outside-model-validity"]
    assert (chaotic["period"], chaotic["outcome"]) == (0, "ok")
    assert chaotic["rms_y_m"] > 1e-3
    assert chaotic["impacts_per_period"] > 0.0
    assert math.isnan(lost["rms_y_m"])
    assert len(result.answer.failures) == 5
    assert {line.partition(" by ")[0] for line in result.answer.failures} == {
        "outside-model-validity: the platform has turned"
    }


@pytest.fixture(scope="module")
def over():
    """A key that begins without material."""
    over = {"key": "material.mass_ratio", "values": [0.0, 0.05, 0.1]}
    scene = scene_of({PHASE: [-math.pi, math.pi]}, random=6, over=over).replace({"drive.supply_frequency_hz": 45.0})
    return scene, basins(scene)


def test_an_attractor_is_carried_from_a_platform_without_material(over):
    scene, tables = over
    assert tables.attractors["attractor"].tolist() == ["antiphase, period 1"] * 3
    sags = [static_rest(scene.replace({"material.mass_ratio": ratio}))[6] for ratio in (0.05, 0.1)]
    assert tables.attractors["upper_m"].iloc[0] == 0.0
    assert tables.attractors["upper_m"].tolist()[1:] == pytest.approx(sags, rel=0.5)


def test_orbits_are_looked_for_after_chaos_too():
    """At 59 Hz no start comes to an orbit; that takes long, and says nothing of other values."""
    over = {"key": "drive.supply_frequency_hz", "values": [58.0, 59.0], "direction": ["down"]}
    scene = scene_of({PHASE: [-math.pi, math.pi], SPEED: [0.3, 1.1]}, 0.08, random=30, over=over, max_turns=600)
    tables = basins(scene)
    last = tables.attractors[tables.attractors["supply_frequency_hz"] == 58.0]
    assert last["radius"].notna().all()
    assert tables.starts["turns"].max() == 600, "what comes later is not within these turns"
    assert last["motion"].tolist() == ["periodic"] * len(last)
    notes = [note for note in tables.answer.notes if note.startswith("fractions are those within 600 turns and may ")]
    assert len(notes) == tables.attractors["motion"].isin(["chaotic", "undecided"]).any() == 1


def test_a_motion_that_ends_early_only_where_it_is_followed_longer_has_a_name():
    """The row that classifies it has neither motion nor synchronization."""
    now = AttractorSet(scene_of({PHASE: [-3.0, 3.0]}), [{"row": {"outcome": "too-many-events", "period": None}}])
    assert list(name_attractors([now])) == [["too-many-events"]]


def test_motions_at_a_limit_of_classes_are_alike():
    one, other = ({"sync": sync, PHASE_COLUMN: phase} for sync, phase in (("antiphase", -2.1), ("intermediate", -2.09)))
    assert same_phase(one, other)
    assert same_phase(one, other | {PHASE_COLUMN: -2.1 + 2.0 * math.pi})
    assert not same_phase(one, other | {PHASE_COLUMN: -1.8})
    assert not same_phase(one, {"sync": "none", PHASE_COLUMN: -2.1})


def test_bounds_hold_the_share():
    assert clopper_pearson(0, 1000) == (0.0, pytest.approx(3.0 / 1000, rel=4e-3))
    assert clopper_pearson(1000, 1000) == (pytest.approx(1.0 - 3.0 / 1000, rel=1e-4), 1.0)
    low, high = clopper_pearson(400, 1000)
    assert (low, high) == (pytest.approx(0.3695, abs=2e-4), pytest.approx(0.4311, abs=2e-4))


@pytest.mark.parametrize(
    ("starts", "more", "told"),
    [
        (
            {"run.initial.y": [0, 1]},
            {},
            "basins: initial_conditions.'run.initial.y' is no key of an initial condition; did you mean run.",
        ),
        (
            {PHASE: [0, 1, 1.5]},
            {},
            f"basins: initial_conditions.{PHASE} = […, 1.5]; allowed: a whole number from 2 as count",
        ),
        ({PHASE: [0, 1, 5]}, {"random": 5}, "basins: random = 5 but every range of initial_conditions has a count"),
        (
            {GAP: [-1e-3, 1e-3]},
            {"ratio": 0.1},
            "basins.initial_conditions: run.initial.state.gap_m = -0.001; allowed: at least 0",
        ),
        ({GAP: [0, 1e-3]}, {}, "this scene has no such coordinate"),
        (
            {SPEED: [0, 1], RATE: [0, 1]},
            {},
            "basins: initial_conditions has speed_ratio and state.phi1_rate_rad_per_s; allowed: one",
        ),
        (
            {PHASE: [0, 1]},
            {"state": {"y_m": 0.02}},
            "basins.initial_conditions: run.initial.state is given; allowed: keys of state",
        ),
        ({PHASE: [0, 1]}, {"over": {"key": "run.duration_s", "start": 1, "stop": 2, "count": 2}}, "cannot be varied"),
    ],
)
def test_bad_starts_are_told_in_one_line(starts, more, told):
    starts = {key: [float(v) for v in ends] for key, ends in starts.items()}
    with pytest.raises(ConfigError) as error:
        BasinsStudy(scene_of(starts, **more))
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_in_an_ellipsoid_a_motion_is_assigned_only_if_it_comes_nearer():
    """One that was tested in some directions may hold states of another basin, as this one holds all."""
    scene = scene_of({PHASE: [-3.0, 3.0]}, 0.08, random=1, max_turns=400)
    plan, scene = scene.basins, scene.replace({"drive.supply_frequency_hz": 59.0, "basins": None})
    everything = {"row": {"period": 1, "multiplier_max": 0.1}, "centres": [[0.0] * 14], "systems": [0]}
    everything |= {"state": [0.0] * 14, "forms": [(1e-6 * np.eye(14)).tolist()]}
    with closing(AttractorMapper(scene, plan.max_turns, [everything])) as mapper:
        mapper._ellipsoids = mapper._ellipsoids._replace(systems=np.array([mapper._motion.system.index]))
        told = mapper.map_states(initial_states(scene, plan, [0]))[0]
        assert told["attractor"] is None
        assert len(told["windows"]) == 4
        centre, system = np.array([mapper._motion.state]), np.array([mapper._motion.system.index])
        mapper._ellipsoids = mapper._ellipsoids._replace(centres=centre, systems=system)
        mapper._motion.to_time = lambda *arguments: None
        assert mapper._find_ellipsoid() == (0, 2), "it is at the centre"


def test_motion_on_an_orbit_repeats_and_motion_on_its_way_does_not():
    scene = scene_of({PHASE: [-3.0, 3.0]}, random=1)
    plan, scene = scene.basins, scene.replace({"basins": None})
    with closing(AttractorMapper(scene, 400, [])) as mapper:
        assert mapper.repeats(orbit(scene).state, 1)
        assert not mapper.repeats(initial_states(validated_base_scene(scene, plan), plan, [0])[0], 1)


def test_radius_is_of_the_crossings_that_have_an_ellipsoid(monkeypatch):
    """One crossing beside an event has none; starts are assigned at the others."""
    scene = scene_of({PHASE: [-3.0, 3.0]}, random=1)
    with closing(AttractorMapper(scene.replace({"basins": None}), 400, [])) as mapper:
        near, crossings = orbit(scene), mapper._detector.section_ellipsoids
        around = crossings(near.state, 1)[0][0]
        monkeypatch.setattr(
            mapper._detector, "section_ellipsoids", lambda *one: [(around, 0.0), (around, 0.5), (around, 0.25)]
        )
        mapper.register_near(near.state, 1)
        assert (mapper.attractors[0]["radius"], mapper.attractors[0]["ellipsoids"]) == (0.25, 2)


def test_motions_that_end_early_or_may_escape_from_chaos_are_not_repeated_by_another_engine():
    """Their ends differ from engine to engine."""
    scene = scene_of({PHASE: [-3.0, 3.0]}, 0.2, random=4, max_turns=200).replace({"solver.max_events_per_period": 1})
    result = basins(scene)
    assert set(result.attractors["outcome"]) == {"too-many-events"}
    assert BasinsStudy(scene).cross_check_cases(result, None, lambda other: other) == []
    scene = scene_of({PHASE: [-3.0, 3.0]}, random=4)
    result = basins(scene)
    assert len(BasinsStudy(scene).cross_check_cases(result, None, lambda other: other)) == 4
    result.starts["turns"] = 5000
    assert BasinsStudy(scene).cross_check_cases(result, None, lambda other: other) == []


@pytest.mark.long
@pytest.mark.parametrize(("frequency", "ratio", "restitution"), [(55.6, 0.202, 0.4)])
def test_assigned_starts_stay_on_their_orbit(frequency, ratio, restitution):
    """Ellipsoids that were tested in the scales of the state held saddles: 101 of 395 and 36 of 400 were wrong."""
    starts, longest = 80, 3000
    box = {PHASE: [-math.pi, math.pi], SPEED: [0.0, 1.1]}
    keys = {"drive.supply_frequency_hz": frequency, "contact.restitution": restitution}
    keys |= {"material.layers": 2, "contact.restitution_threshold_m_per_s": 0.0}
    scene = scene_of(box, ratio, random=starts, max_turns=longest).replace(keys)
    plan, scene, assigned = scene.basins, scene.replace({"basins": None}), 0
    with closing(AttractorMapper(validated_base_scene(scene, plan), longest, [])) as mapper:
        advance, ends = mapper._advance, []
        mapper._advance = lambda work, runs: (advance(work, runs), ends.append((work, runs)))[0]
        for state in initial_states(scene, plan, range(starts)):
            found = mapper.map_states(state[np.newaxis])[0]
            if found["attractor"] is not None:
                assigned += 1
                work, runs = ends[-1]
                if work.followed["place"][0] >= 0:  # on from where it was assigned: chaos came before
                    mapper._motion.resume(runs[0], mapper._never)
                mapper._motion.to_section(700, math.inf)
                away = np.array(mapper.attractors[found["attractor"]]["centres"]) - mapper._motion.state
                away[:, 3:5] -= 2.0 * math.pi * np.round(away[:, 3:5] / (2.0 * math.pi))
                assert np.abs(away / state_scales(scene)).max(axis=1).min() < 0.02
    assert assigned > starts // 2


def test_restarts_of_other_motions_do_not_count():
    """Times of restarts go with a motion from lane to lane: those of another one told of storms in 6 of 8 starts."""
    keys = {"drive.supply_frequency_hz": 57.5, "contact.restitution": 0.3, "solver.max_events_per_period": 300}
    scene = scene_of({PHASE: [-3.1, 3.1], SPEED: [0.5, 1.0]}, 0.2, random=8, max_turns=800).replace(keys)
    assert (basins(scene).attractors["outcome"] == "ok").all()


@pytest.mark.parametrize("number", [96, 123, 176])
def test_a_motion_that_ends_early_is_told_with_the_time_and_the_state_of_its_end(number):
    scene = random_scene(number, turns=60).replace({"solver.engine": "taylor"})
    with closing(AttractorMapper(scene, 300, [])) as mapper:
        told = mapper.map_states(np.array([initial_state(scene)] * 2))
    alone = simulate(scene, keep="summary").summary
    assert alone["outcome"] == "outside-model-validity"
    for one in told:
        assert one["outcome"] == "outside-model-validity"
        assert one["detail"].partition("; mode")[2][:30] == alone["detail"].partition("; mode")[2][:30]
