"""Sweeps over any key: the section ``sweep.over``, states carried from layers to others, tables and bands."""

import numpy as np
import pandas as pd
import pytest
from common.handmade import after, branch
from common.known import motion_of
from common.places import FLYING, LOADED
from common.results import bits

from vibroplat import load_config, sweep
from vibroplat.config.coordinates import Mode
from vibroplat.config.plans import ParameterRange
from vibroplat.errors import ConfigError
from vibroplat.hybrid.state import static_rest
from vibroplat.study.bands import band_lines, bands, find_jumps
from vibroplat.study.branches import branches, convert_state
from vibroplat.study.sweep import notes_on_points

from .helpers import planned

MASS = "material.mass_ratio"


def over(key, changes=None, config=LOADED, plan=None, **values):
    """Load a configuration as a sweep over a key."""
    scene = load_config(config, changes).model_copy(update={"sweep": None})
    return scene.replace({"sweep": {"over": {"key": key, **values}, **(plan or {})}})


def upward(**values):
    return ParameterRange(key=MASS, **values).upward


# -- values ----------------------------------------------------------------------------------------------


def test_values_follow_from_step_count_scale_or_are_given():
    assert upward(start=0.0, stop=0.3, step=0.1) == [0.0, 0.1, 0.2, 0.3]
    assert upward(start=0.0, stop=1.0, count=4) == [0.0, 0.333333333333, 0.666666666667, 1.0]
    assert upward(start=0.01, stop=10.0, count=4, scale="log") == [0.01, 0.1, 1.0, 10.0]
    assert upward(values=[0.3, 0.0, 0.1]) == [0.0, 0.1, 0.3]
    assert upward(start=-0.3, stop=0.3, step=0.1)[3] == 0.0
    third = 1.0 / 3.0  # ends are as they are given
    assert upward(start=third, stop=1.0, count=2) == [third, 1.0]
    assert upward(start=third, stop=third, count=1) == [third]


def test_keys_of_whole_numbers_get_them():
    (found,) = branches(over("motor.pole_pairs", start=1, stop=3, step=1))
    assert [(value, type(value)) for value in found.key_values] == [(1, int), (2, int), (3, int)]


def test_perturbations_differ_where_values_do_however_small_they_are():
    found = branches(over("motor.friction_radius_m", values=[0.0, 1e-9, 2e-9], direction=["up", "down"]))
    assert len({one.perturbation_key(value) for one in found for value in one.key_values}) == 6


RANGE = "start: 0, stop: 0.3"
MISTAKES = {
    "key: material.mas_ratio, values: [1]": ": unknown key material.mas_ratio; did you mean mass_ratio? allowed: ",
    "key: nothing.at_all, values: [1]": ": unknown key nothing; allowed: ",
    "key: contact.model, values: [1]": ".key = contact.model has no numbers; allowed: a key of numbers, as ",
    "key: material, values: [1]": ": material = 1.0; allowed: a section of keys and values",
    "key: run.duration_s, values: [1]": "over.key = 'run.duration_s' cannot be swept; allowed: keys of machine, ",
    f"key: {MASS}, {RANGE}": ": no range is given; allowed: start and stop with step or count, or values",
    f"key: {MASS}, {RANGE}, step: 0.1, count: 4": ": step and count are both given; allowed: one of the two",
    f"key: {MASS}, count: 4, values: [0.1]": ": count and values are both given; allowed: one of the two",
    f"key: {MASS}, {RANGE}, step: 1.0e-9": ": step = 1e-09 gives too many points; allowed: at most 100000 per branch",
    f"key: {MASS}, start: 0.3, stop: 0, step: 0.1": ": stop = 0.0 is below start = 0.3; allowed: at least start; ",
    f"key: {MASS}, {RANGE}, count: 1": ": count = 1 from 0.0 to 0.3; allowed: 1 if stop is start, else at least 2",
    f"key: {MASS}, start: 1, stop: 1.0000000000001, count: 9": ": 9 values of material.mass_ratio from 1.0 to ",
    f"key: {MASS}, {RANGE}, count: 4, scale: log": ": scale = log but 0.0 is not above 0; allowed: values above 0, ",
    f"key: {MASS}, start: 1, stop: 9, step: 1, scale: log": ": scale = log but step = 1.0 is no ratio; allowed: ",
    f"key: {MASS}, values: [0, 0.0]": ": values = [0.0, 0.0]; allowed: each value once",
    f"key: {MASS}, start: -0.1, stop: 0.3, count: 3": ": material.mass_ratio = -0.1; allowed: at least 0.0",
    "key: material.layers, values: [1, 1.5]": ": material.layers = 1.5; allowed: 1 or 2",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_told_in_a_line(text, complaint):
    assert MISTAKES[text] in complaint(f"{FLYING}sweep: {{over: {{{text}}}}}\n")


def test_one_key_of_a_sweep_is_given_once(complaint):
    given = f"sweep: {{over: {{key: {MASS}, values: [0.1]}}"
    assert complaint(f"{given}, supply_frequency_hz: {{start: 1, stop: 2}}}}") == (
        "c.yaml: sweep: supply_frequency_hz and over are both given; allowed: one of the two"
    )
    assert complaint(f"{given}, grid: {{{MASS}: [0.1]}}}}") == (
        f"c.yaml: sweep: grid.{MASS} is the key of over; allowed: another key"
    )
    assert complaint("sweep: {}") == (
        "c.yaml: sweep: supply_frequency_hz and over are not given; allowed: one of the two"
    )


def test_numbers_of_exciters_are_not_put_aside_by_those_of_a_motor():
    both = {"exciters.0.critical_slip": 0.1}
    told = r"^sweep.over.key = motor.critical_slip but the scene has exciters; allowed: exciters.0.… or exciters.1.…$"
    with pytest.raises(ConfigError, match=told):
        branches(over("motor.critical_slip", both, values=[0.1]))
    (found,) = branches(over("exciters.0.critical_slip", values=[0.1, 0.2]))  # a motor becomes two
    assert [one.critical_slip for one in found.at(1).exciter_pair] == [0.2, found.scene.exciter_pair[1].critical_slip]


# -- the short form --------------------------------------------------------------------------------------

QUICK = {"measure_s": 0.5, "lyapunov": False}


def test_the_short_form_gives_the_same_bits():
    short = sweep(planned(LOADED, 50.0, 51.0, direction=["up", "down"], **QUICK)).sweep
    ends = {"start": 50.0, "stop": 51.0, "step": 0.5, "direction": ["up", "down"]}
    long = sweep(over("drive.supply_frequency_hz", plan=QUICK, **ends)).sweep
    assert bits(long) == bits(short)
    assert long.columns[0] == "supply_frequency_hz"
    assert long.attrs == short.attrs
    assert bits(bands(long)) == bits(bands(short))
    scene = planned(LOADED, 50.0, 51.0).replace(
        {"sweep.over": {"key": MASS, "values": [0.1]}}
    )  # one overrides the other
    assert branches(scene.replace({"sweep.over": {"start": 0.0, "stop": 1.0, "count": 2}}))[0].key_values == (0.0, 1.0)
    assert branches(scene.replace({"sweep.supply_frequency_hz": {"start": 40, "stop": 40}}))[0].key_values == (40.0,)


# -- from layers to others -------------------------------------------------------------------------------


def test_layers_that_come_up_lie_on_the_platform_with_their_static_sag():
    scene = load_config(LOADED, {MASS: 0.0, "drive.supply_frequency_hz": 50.0})
    loaded = scene.replace({MASS: 0.01})
    with motion_of(scene) as motion:
        motion.to_time(0.4)
        bare = motion.state.copy()
    state = convert_state(bare.tolist(), scene, loaded)
    with motion_of(loaded, np.array(state)) as motion:
        assert Mode(int(motion.automaton.run["mode"])) is Mode.ATTACHED
    bare[[5, 6, 12, 13]] = 0.0, static_rest(loaded)[6], 0.0, 0.0
    assert bare[6] < 0.0
    assert state == bare.tolist()


def test_what_a_scene_has_not_is_left_behind_and_what_it_has_is_kept():
    scene, state = load_config(LOADED), np.arange(1.0, 15.0).tolist()
    for changes, gone in (({MASS: 0.3}, []), ({MASS: 0.0}, [5, 6, 12, 13]), ({"material.layers": 1}, [6, 13])):
        left = [0.0 if place in gone else value for place, value in enumerate(state)]
        assert convert_state(state, scene, scene.replace(changes)) == left


def test_a_branch_hands_on_states_of_its_own_layers():
    (found,) = branches(over(MASS, values=[0.0, 0.1, 0.2]))
    state = [0.5] * 14
    assert found.begin(None, 1) is None
    assert found.begin(state, 0) == found.begin(state, 2) == state
    assert found.begin(state, 1)[6] == static_rest(found.at(1))[6]


# -- tables, bands, words --------------------------------------------------------------------------------


def test_two_values_show_no_jump_and_the_first_material_no_liftoff():
    """Over a key that changes the response a little, and from a bare platform to material in flight."""
    table = sweep(over(MASS, {"drive.supply_frequency_hz": 55.0}, values=[0.0, 0.05, 0.1], plan=QUICK)).sweep
    assert (table["flight_fraction"] > 0.0).tolist() == [False, True, True]
    assert set(bands(table)["kind"]) == {"band", "largest"}


def renamed(key=MASS, **columns):
    """A branch over another key: at a fixed supply its excitation frequency hardly changes."""
    table = branch(**{"excitation_frequency_hz": 25.0 + 0.01 * np.arange(21), **columns})
    return table.rename(columns={"supply_frequency_hz": key}).assign(**{key: 0.01 * np.arange(21)})


def test_the_excitation_leaps_over_another_key_where_it_changes_far_more_than_beside():
    assert not find_jumps(renamed()).any()
    steep = 25.0 + 0.1 * np.arange(21)  # motors that slip more and more
    assert not find_jumps(renamed(excitation_frequency_hz=steep)).any()
    caught = np.where(np.arange(21) < 8, steep, steep - 3.0)
    assert np.flatnonzero(find_jumps(renamed(excitation_frequency_hz=caught))).tolist() == [7]


def test_bands_and_notes_name_the_key_with_its_unit():
    key = "machine.damping_y_n_s_per_m"
    lost = renamed(key, sync=after(8, "antiphase", "none"))
    found = bands(lost)
    assert found.columns.tolist()[-6:-4] == [f"from_{key}", f"to_{key}"]
    assert found.attrs["units"][f"from_{key}"] == "N·s/m"
    jump = next(line for line in band_lines(found) if "jump" in line)
    assert "damping y 0.07 → 0.08 N·s/m  f 25.07 → 25.08 Hz" in jump
    table = pd.DataFrame({key: [40.0, 50.0], "notes": "loose", "motion": "periodic", "outcome": "ok"})
    assert notes_on_points(table) == ["2 points at damping y 40 … 50 N·s/m, the first: loose"]
    one = table.rename(columns={key: "exciters.1.critical_slip"}).head(1)
    assert notes_on_points(one) == ["1 point at critical slip of exciter 2 40: loose"]
