"""The section ``sweep``: what it makes of a user's values, and the line that a wrong one is answered with."""

import pytest
from common.limits import cpu_seconds
from common.places import LOADED

from vibroplat import Scene, load_config
from vibroplat.config.plans import Frequencies
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

from .helpers import planned


def upward(start, stop, step):
    return Frequencies(start=start, stop=stop, step=step).over.upward


# -- frequencies ----------------------------------------------------------------------------------------


def test_stop_is_taken_where_whole_steps_reach_it():
    """Frequencies are as a user would write them."""
    assert upward(42.0, 80.0, 0.05) == [float(f"{42 + i / 20:.2f}") for i in range(761)]
    wanted = {
        (42.0, 80.0, 0.5): (80.0, 77),
        (42.0, 42.3, 0.1): (42.3, 4),
        (42.0, 42.29, 0.1): (42.2, 3),
        (42.0, 42.0, 0.5): (42.0, 1),
        (42.0, 42.4, 0.5): (42.0, 1),
        (0.1, 0.7, 0.1): (0.7, 7),
        (50.0, 51.0, 1.0 / 3.0): (51.0, 4),
        (1.0, 1000.0, 0.01): (1000.0, 99_901),
    }
    for case, (last, count) in wanted.items():
        found = upward(*case)
        assert (found[0], found[-1], max(found), len(found)) == (case[0], last, last, count)


# -- branches -------------------------------------------------------------------------------------------


def test_branches_are_combinations_times_directions_the_first_key_slowest():
    grid = {"material.mass_ratio": [0.2, 0.1], "contact.restitution": [0.5, 0.0]}
    found = branches(planned(LOADED, 50.0, 51.0, step=0.5, direction=["down", "up"], grid=grid))
    places = [(0.2, 0.5), (0.2, 0.0), (0.1, 0.5), (0.1, 0.0)]
    assert [b.number for b in found] == list(range(8))
    assert [b.direction for b in found] == ["down", "up"] * 4
    assert [tuple(b.grid.values()) for b in found] == [place for place in places for _ in range(2)]
    assert [list(b.grid) for b in found] == [list(grid)] * 8
    assert {b.key_values for b in found[::2]} == {(51.0, 50.5, 50.0)}
    assert {b.key_values for b in found[1::2]} == {(50.0, 50.5, 51.0)}


def test_points_of_all_branches_are_limited():
    """10 000 combinations and 100 000 frequencies, each allowed by itself, would be 1e9 points."""
    settings = {"sweep.supply_frequency_hz": {"start": 50.0, "stop": 149.99, "step": 1e-3, "direction": ["up", "down"]}}
    settings["sweep.grid"] = {"contact.restitution": [0.1 * k for k in range(6)]}
    told = r"sweep: 6 × 2 branches of 99991 points are 1199892; allowed: at most 1000000$"
    with pytest.raises(ConfigError, match=told):
        Scene().replace(settings)
    keys = ("contact.restitution", "material.mass_ratio", "material.damping_ratio", "material.lower_share")
    with (
        cpu_seconds(5.0),
        pytest.raises(ConfigError, match=r"100000000 combinations; allowed: at most 10000$"),
    ):
        Scene().replace(settings | {"sweep.grid": {key: [0.001 * k for k in range(1, 101)] for key in keys}})
    found = branches(Scene().replace(settings | {"sweep.grid": {"contact.restitution": [0.0, 0.5]}}))
    assert len({id(branch.key_values) for branch in found}) == 2


def test_scenes_of_a_branch_have_its_values_and_frequencies():
    grid = {"material.stiffness_n_per_m": [7000.0, 8000.0], "solver.tolerance": [1e-5]}
    branch = branches(planned(LOADED, 50.0, 51.0, direction="down", grid=grid))[1]
    for point, frequency in enumerate((51.0, 50.5, 50.0)):
        scene = branch.at(point)
        assert (scene.drive.supply_frequency_hz, scene.solver.tolerance) == (frequency, 1e-5)
        assert (scene.material.stiffness_n_per_m, scene.material.natural_frequency_hz) == (8000.0, None)  # replaced
        assert scene.machine == load_config(LOADED).machine


# -- one mistake, one line ------------------------------------------------------------------------------

FREQUENCIES = {
    "{}": ".start is missing; allowed: a value (and 1 more)",
    "{start: 44, stop: 42}": ": stop = 42.0 is below start = 44.0; allowed: at least start; see direction",
    "{start: 42, stop: 44, direction: [up, up]}": ": direction = ['up', 'up']; allowed: up and down, each once",
}


def test_mistakes_in_frequencies_are_told_in_a_line(complaint):
    found = {text: complaint(f"sweep: {{supply_frequency_hz: {text}}}") for text in FREQUENCIES}
    assert found == {text: f"c.yaml: sweep.supply_frequency_hz{line}" for text, line in FREQUENCIES.items()}


NOT_SWEPT = "cannot be swept by the grid; allowed: keys of machine, material, …"
NO_MAP = ": kind = map needs exactly one grid key with several numbers"
KEYS = {
    "kind: map": NO_MAP,
    "kind: map, grid: {material.mass_ratio: [0.1]}": NO_MAP,
    "kind: map, grid: {material.mass_ratio: [0.1, 0.2], contact.restitution: [0.0, 0.1]}": NO_MAP,
    "grid: {contact.restitution: 0.1}": ".grid.contact.restitution = 0.1; allowed: a list",
    "grid: {contact.restitution: [0, 0.0]}": ".grid: contact.restitution = [0, 0.0]; allowed: each value once",
    "grid: {run.duration_s: [1.0]}": f": grid.run.duration_s {NOT_SWEPT}",
    "grid: {name: [1.0]}": f": grid.name {NOT_SWEPT}",
    "grid: {drive.supply_frequency_hz: [50.0]}": f": grid.drive.supply_frequency_hz {NOT_SWEPT}",
    # values that scenes do not take are told before anything runs
    "grid: {contact.restitution: [0.0, -1.0]}": ".grid: contact.restitution = -1.0; allowed: at least 0.0",
    "grid: {contact: [0.1]}": ".grid: contact = 0.1; allowed: a section of keys and values",
    "grid: {material.mass_ratio: [0.1]}": ".grid: material: two layers need a spring between them; give "
    "natural_frequency_hz or stiffness_n_per_m",
}


def with_plan(text):
    return f"sweep: {{supply_frequency_hz: {{start: 42, stop: 44}}, {text}}}"


def test_mistakes_in_other_keys_are_told_in_a_line(complaint):
    found = {text: complaint(with_plan(text)).removeprefix("c.yaml: ") for text in KEYS}
    assert found == {text: f"sweep{line}" for text, line in KEYS.items()}


def test_names_of_keys_are_guessed(complaint):
    line = complaint(with_plan("settle_s: 3"))
    assert line.startswith("c.yaml: unknown key sweep.settle_s in line 1; did you mean settle_by? allowed: ")
    line = complaint(with_plan("grid: {material.mas_ratio: [0.1]}"))
    assert line.startswith("sweep.grid: unknown key material.mas_ratio; did you mean mass_ratio? allowed: ")
    for values in ("material: [{mass_ratio: 0.1}]", "contact.restitution: []"):  # no values of a grid
        assert f"grid.{values.partition(':')[0]}" in complaint(with_plan(f"grid: {{{values}}}"))


# -- run and sweep --------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["name: c", "sweep: null"])
def test_sweep_of_a_configuration_without_one_says_so(text, command, here):
    (here / "c.yaml").write_text(f"{text}\n")
    line = "vibroplat: c.yaml: this configuration has no sweep section; add sweep: {supply_frequency_hz: …}\n"
    assert command("sweep", "c.yaml") == (2, "", line)
    assert [path.name for path in here.iterdir()] == ["c.yaml"]
