"""Whatever a configuration holds, it becomes a scene or one line for the user."""

import json

import pytest
from common.drawing import given

from vibroplat import Motor, Scene, load_config
from vibroplat.config.schema import nodes
from vibroplat.errors import ConfigError

VALID = {
    "material": {"mass_ratio": 0.2, "natural_frequency_hz": 18.5, "damping_ratio": 0.05},
    "motors": [{"pole_pairs": 2}, {"pole_pairs": 3}],
    "run": {"duration_s": 1.0},
}

#: A file with a list of sections, a sweep and a state.
TEXT = b"""
motors: [{pole_pairs: 2}, {pole_pairs: 3}]
run: {duration_s: 1.0, initial: {state: {x_m: 0.0, gap_m: 1.0e-3}}}
material:
  mass_ratio: 0.2
  natural_frequency_hz: 18.5
sweep: {supply_frequency_hz: {start: 46, stop: 47, direction: [up, down]}, grid: {material.layers: [1, 2]}}
"""

#: All keys of a configuration, sections too.
KEYS = sorted(name.replace(".N", ".1") for name in nodes(Scene))
EDGES = [0, 1, 2, -1, 0.0, 0.5, 1.0, 1e-320, 1e300, 10**400, float("nan"), float("inf")]


#: Characters of texts: Latin ones, controls, and some that change what is around them or cannot be printed. A text of
#: all of Unicode would take a second to begin with.
CHARACTERS = "".join(map(chr, (*range(0x180), 0x2028, 0x202E, 0x0301, 0xFEFF, 0xFFFF, 0x1F600)))


def numbers(st):
    return st.one_of(st.floats(), st.integers(), st.sampled_from(EDGES))


def values(st):
    plain = st.one_of(st.none(), st.booleans(), numbers(st), st.text(CHARACTERS, max_size=20), st.just("impact"))
    names = st.sampled_from([key.rpartition(".")[2] for key in KEYS])
    return st.one_of(plain, st.lists(plain, max_size=3), st.dictionaries(names, plain, max_size=3))


def accepted(load, kind=Scene):
    """Whether a scene comes of it; if not, the complaint is one short line that can be printed."""
    try:
        assert isinstance(load(), kind)
    except ConfigError as error:
        line = str(error)
    else:
        return True
    assert line.isprintable(), line
    assert 10 < len(line) < 500, line
    return False


@given(examples=12, changes=lambda st: st.dictionaries(st.sampled_from(KEYS), values(st), min_size=1, max_size=3))
def test_any_value_is_accepted_or_told_in_a_line(changes, here):
    (here / "c.yaml").write_text(json.dumps(VALID))
    accepted(lambda: load_config("c.yaml", changes))


#: What YAML gives a meaning of its own, what is no text or cannot be printed, and what is far too long.
ODD = (
    rb"""
!!int 1.5 | !!binary x | !!set {a, b} | !!python/name:os.system | &a [*a] | {<<: 5} | *a | ? [a] | 1:30 | 2001-13-45 | ~
"\ud800" | "a\x1b[31mb": 1 | extends: . | extends: /dev/null | extends: c.yaml | extends: "a\0b" | extends: [a] | 1: 2
sweep: {} | name: ../up | name: "a\nb" | %YAML 1.3
""".replace(b"\n", b" | ")
    .strip(b" |")
    .split(b" | ")
)
ODD += [b"\n" + odd + b"\n" for odd in ODD] + [
    b"\n---\n",
    b"0x" + b"f" * 5000,
    b"[" * 150,
    b"\n? " + b"k" * 2000 + b"\n: 1",
]
ODD += [b"\t", b"\r", b"\x00", b"\x1b[2J", b"\xff\xfe", b"\xed\xa0\x80", b"\xe2\x80\xae", b"\xef\xbb\xbf"]


@given(
    examples=100,
    at=lambda st: st.integers(0, len(TEXT)),
    left_out=lambda st: st.integers(0, 12),
    put_in=lambda st: st.one_of(st.sampled_from(ODD), st.binary(max_size=8)),
)
def test_any_file_is_a_scene_or_told_in_a_line(at, left_out, put_in, here):
    """A valid file into which something has slipped."""
    (here / "c.yaml").write_bytes(TEXT[:at] + put_in + TEXT[at + left_out :])
    accepted(lambda: load_config("c.yaml"))
    assert [path.name for path in here.iterdir()] == ["c.yaml"]


def test_odd_file_is_a_scene_or_told_in_a_line(here):
    for odd in (*ODD, b"extends: " + b"k" * 2000, b"name: 0x" + b"f" * 5000):  # Python does not write the last one
        (here / "c.yaml").write_bytes(odd)
        accepted(lambda: load_config("c.yaml"))


def unusable(key, value):
    """Whether a scene with this value is accepted, but has no derived quantities or cannot be written as JSON."""
    try:
        scene = Scene().replace({key: value})
    except ConfigError:
        return False
    try:
        assert scene.synchronous_speeds[0] > 0.0
        json.dumps(scene.model_dump(mode="json"), allow_nan=False)
    except (ArithmeticError, ValueError):
        return True
    return False


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400], ids=["nan", "inf", "huge"])
def test_what_is_accepted_can_be_used(value):
    assert [key for key in KEYS if unusable(key, value)] == []


# -- what is accepted is written and read without a change ------------------------------------------------


def numbers_of_exciters(st):
    size = st.floats(1e-3, 10.0)
    names = ("unbalance_radius_m", "rotor_inertia_kg_m2", "critical_torque_n_m", "critical_slip", "friction_radius_m")
    return dict.fromkeys((*names, "rated_frequency_hz"), size) | {
        "pole_pairs": st.integers(1, 6),
        "rotation": st.sampled_from(["counter-clockwise", "clockwise"]),
    }


def exciters(st):
    return st.lists(st.fixed_dictionaries({}, optional=numbers_of_exciters(st)), min_size=2, max_size=2)


def machines(st):
    """Exciters by themselves, or the machine with one motor, two or the usual one."""
    each = numbers_of_exciters(st)
    motor = st.fixed_dictionaries({}, optional={name: each[name] for name in Motor.model_fields if name in each})
    common = st.fixed_dictionaries({}, optional={n: each[n] for n in ("unbalance_radius_m", "rotor_inertia_kg_m2")})
    return st.one_of(
        st.fixed_dictionaries({"exciters": exciters(st)}),
        st.fixed_dictionaries({"machine": common, "motor": motor}),
        st.fixed_dictionaries({"machine": common, "motors": st.lists(motor, min_size=2, max_size=2)}),
        st.fixed_dictionaries({"machine": common}),
    )


def drives(st):
    switch = st.sampled_from(["on", "off", True, False])
    switches = st.one_of(
        st.fixed_dictionaries({}, optional={"exciter_1": switch, "exciter_2": switch}),
        st.fixed_dictionaries({"off": st.booleans()}),
    )
    return st.one_of(
        st.fixed_dictionaries({"supply_frequency_hz": st.floats(1.0, 100.0)}),
        st.lists(st.tuples(st.one_of(st.none(), st.just(0.0), st.floats(1e-3, 100.0)), switches), max_size=5).map(
            lambda rows: {
                "program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}]
                + [{"t_s": 1.0 + i // 2, "supply_frequency_hz": f, **switches} for i, (f, switches) in enumerate(rows)]
            }
        ),
    )


@given(examples=50, given=machines, drive=drives)
def test_scene_is_written_and_read_without_a_change(given, drive):
    scene = Scene.from_tree({**given, "drive": drive})
    assert scene.replace() == scene
    tree = scene.to_tree()
    again = Scene.from_tree(json.loads(json.dumps(tree)))
    assert again.to_tree() == tree
    assert again.exciter_pair == scene.exciter_pair
    assert again.drive.intervals == scene.drive.intervals
