"""The derivative of a motion's state against differences of motions, and against what is known of it."""

from operator import attrgetter

import numpy as np
import pytest
from common.known import motion_of
from model.helpers import MATERIALS, exciters

from vibroplat import simulate, variation
from vibroplat.config.coordinates import Mode
from vibroplat.config.drive import Drive, Entry
from vibroplat.config.scene import Scene
from vibroplat.config.sections import Contact, Machine, Material
from vibroplat.hybrid.modes import IMPACT, KINDS
from vibroplat.hybrid.state import state_scales
from vibroplat.model.parameters import IMPACT_LAWS
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.motion.recorder import Recorder
from vibroplat.observe.tables import state_places
from vibroplat.observe.variation import Variation

TOLERANCES = {"native": 1e-12, "taylor": 1e-13}

#: Steps of the differences of order 4, in the scales of the scene, and of keys, over their values.
STEPS = {"native": 5e-4, "taylor": 1e-4}
WEIGHTS = ((1, 2.0 / 3.0), (2, -1.0 / 12.0))

KEYS = ("drive.supply_frequency_hz", "machine.stiffness_y_n_per_m")

LOPSIDED = {"exciter_distance_m": 0.18, "exciter_angle_deg": -35.0, "damping_y_n_s_per_m": 400.0}


SETUPS = {"paper": {"machine": Machine(damping_y_n_s_per_m=400.0)}} | {
    name: {"machine": Machine(**LOPSIDED), "exciters": exciters("counter-clockwise", second, mounted_on="deck")}
    for name, second in (("unequal", "clockwise"), ("co-rotating", "counter-clockwise"))
}
LAYERS = MATERIALS | {1: Material(mass_ratio=0.2, layers=1)}


def scene_of(layers, setup="paper", engine="native", frequency=51.0, **contact):
    """A scene with so many layers, as accurate as its engine can."""
    scene = Scene(
        **SETUPS[setup],
        material=LAYERS[layers],
        contact=Contact(**contact),
        drive=Drive(supply_frequency_hz=frequency),
    )
    return scene.replace({"solver": {"engine": engine, "tolerance": TOLERANCES[engine]}})


def end(scene, state, seconds, observers=()):
    with motion_of(scene, state) as motion:
        motion.to_time(seconds, observers)
        assert motion.outcome == "ok"
        return motion.state


def difference(function, step):
    """Derivative at 0 by differences of order 4."""
    return sum(weight * (function(n * step) - function(-n * step)) for n, weight in WEIGHTS) / step


def by_differences(scene, start, seconds, keys, step):
    """Derivative of the end by the start and by keys, in the scales of the scene and in parts of their values."""
    scales = state_scales(scene)
    found = np.zeros((14, 14 + len(keys)))
    for place in state_places(scene).values():
        if start[GAP] > 0.0 or place not in (GAP, GAP_RATE):
            unit = scales[place] * np.eye(14)[place]
            found[:, place] = difference(lambda s, unit=unit: end(scene, start + s * unit, seconds), step)
    for k, key in enumerate(keys):
        value = attrgetter(key)(scene)
        found[:, 14 + k] = difference(
            lambda s, key=key, value=value: end(scene.replace({key: (1.0 + s) * value}), start, seconds), step
        )
    return found / scales[:, np.newaxis]


def scaled(varied, scene):
    """Derivative of a variation in the scales of the scene, keys in parts of their values."""
    places, scales, table = list(state_places(scene).values()), state_scales(scene), varied.derivative
    found = np.zeros((14, 14 + len(table.columns) - len(places)))
    inside = table.to_numpy()[:, : len(places)]
    found[np.ix_(places, places)] = inside * scales[places] / scales[places][:, np.newaxis]
    for k, key in enumerate(table.columns[len(places) :]):
        found[places, 14 + k] = table[key] * attrgetter(key)(scene) / scales[places]
    return found


def assert_close(found, expected, relative):
    """Each column within a share of its largest number."""
    largest = np.abs(expected).max(axis=0)
    assert (largest < 1e6).all()
    error = np.abs(found - expected).max(axis=0)
    assert (error / np.maximum(largest, 1e-3)).max() <= relative


def agrees(scene, start, seconds, relative=1e-6, keys=(), step=None):
    """Compare both ways; return the kinds of events."""
    expected = by_differences(scene, start, seconds, keys, step or STEPS[scene.solver.engine])
    assert_close(scaled(variation(scene, start, seconds, keys), scene), expected, relative)
    events = Recorder(scene, "events")
    end(scene, start, seconds, [events])
    return [KINDS[kind] for kind in events.events["kind"]]


def later(scene, seconds):
    return simulate(scene.replace({"run.duration_s": seconds, "run.perturbation": 0.01}), keep="summary").final_state


def flying(state, gap=3e-3, rate=0.05):
    """The same state with the material above the platform."""
    found = state.copy()
    found[[GAP, GAP_RATE]] = gap, rate
    return found


def falling(scene):
    """A state of a scene with restitution whose material is about to fall onto the platform."""
    return flying(later(scene.replace({"contact.restitution": 0.0}), 0.3), 1e-3, 0.0)


@pytest.mark.parametrize(
    ("layers", "flies", "setup", "engine"),
    [
        (0, False, "co-rotating", "native"),
        (1, False, "unequal", "taylor"),
        (2, False, "paper", "native"),
        (1, True, "paper", "native"),
        (2, True, "unequal", "taylor"),
    ],
)
def test_in_each_system(layers, flies, setup, engine):
    scene = scene_of(layers, setup, engine, frequency=30.0)
    state = later(scene, 0.31)
    kinds = agrees(scene, flying(state, 0.1) if flies else state, 0.06, keys=KEYS)
    assert kinds == []


@pytest.mark.parametrize(
    ("engine", "changes", "speeds"),
    [
        ("taylor", {"motor.critical_slip": 0.02, "motor.critical_torque_n_m": 30.0}, (0.2, -0.6)),
        ("native", {}, (8.0, -9.0)),
    ],
    ids=["stiff motors pass their critical slip", "exciters much faster than synchronous"],
)
def test_where_the_motion_changes_quickly(engine, changes, speeds):
    """Ten steps in a turn of the synchronous speed left errors of 0.35 and 2e-3."""
    scene = scene_of(0, engine=engine, frequency=50.0).replace(changes)
    start = np.zeros(14)
    start[10:12] = np.array(speeds) * scene.speed_scale * [e.direction for e in scene.exciter_pair]
    assert agrees(scene, start, 0.05, relative=1e-5) == []


@pytest.mark.parametrize(("setup", "layers", "engine"), [("unequal", 1, "native"), ("co-rotating", 2, "taylor")])
def test_through_liftoff_and_inelastic_closing(setup, layers, engine):
    scene = scene_of(layers, setup, engine)
    kinds = agrees(scene, later(scene, 0.5), 0.07, keys=KEYS)
    assert {"liftoff", "impact"} <= set(kinds)


def test_by_restitution_at_an_inelastic_impact_after_which_flight_goes_on():
    key, step = "contact.restitution", 1e-4
    scene = scene_of(1, engine="taylor")
    start, events = flying(later(scene, 0.51), 1e-3, 0.0), Recorder(scene, "events")
    ends = [end(scene.replace({key: n * step}), start, 0.02, [events]) for n in range(3)]
    assert [(e["kind"], e["mode_after"]) for e in events.events] == 3 * [(IMPACT, Mode.FLIGHT)]
    expected = (4.0 * ends[1] - 3.0 * ends[0] - ends[2]) / (2.0 * step)
    found = variation(scene, start, 0.02, key).derivative[key]
    places = list(state_places(scene).values())
    np.testing.assert_allclose(found, expected[places], rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_impact_too_slow_to_rebound_after_which_flight_goes_on():
    """As below the speed that round-off resolves; here that is above the speeds of this motion."""
    scene = scene_of(1, engine="taylor", frequency=63.0, restitution=0.3)
    start = flying(later(scene.replace({"contact.restitution": 0.0}), 0.5), rate=0.0)
    events, varied, scales = Recorder(scene, "events"), Variation(), state_scales(scene)

    def end(state, observers=()):
        with motion_of(scene, state) as motion:
            motion.automaton.run["slowest"] = 10.0
            motion.to_time(0.05, observers)
            return varied.derivative(motion.automaton) if observers else motion.state

    found, expected = end(start, [events, varied]) * scales, np.zeros((14, 14))
    assert [(e["kind"], e["rate_after"], e["mode_after"]) for e in events.events] == [(IMPACT, 0.0, Mode.FLIGHT)]
    for place in state_places(scene).values():
        unit = scales[place] * np.eye(14)[place]
        expected[:, place] = difference(lambda s, unit=unit: end(start + s * unit), 1e-4)
    assert_close(found / scales[:, np.newaxis], expected / scales[:, np.newaxis], 1e-6)


@pytest.mark.parametrize(
    ("setup", "law", "layers", "engine"),
    [*zip(("paper", "unequal", "co-rotating"), IMPACT_LAWS, (2, 2, 1), ("taylor", "native", "taylor"), strict=True)],
)
def test_through_impacts_with_restitution(setup, law, layers, engine):
    scene = scene_of(layers, setup, engine, restitution=0.8, impact_law=law)
    kinds = agrees(scene, falling(scene), 0.07, keys=KEYS)
    assert set(kinds) == {"impact"}
    assert len(kinds) >= 2


@pytest.mark.parametrize(
    ("law", "layers", "engine"), [*zip(IMPACT_LAWS, (2, 1, 2), ("native", "taylor", "taylor"), strict=True)]
)
def test_through_impacts_that_accumulate(law, layers, engine):
    scene = scene_of(layers, engine=engine, restitution=0.3, impact_law=law, frequency=46.0)
    kinds = agrees(scene, falling(scene), 0.08, 1e-4, KEYS)
    assert {"impact", "chatter"} <= set(kinds)


@pytest.mark.parametrize(("layers", "frequency", "engine"), [(1, 52.0, "taylor"), (2, 50.0, "native")])
def test_through_impacts_that_stick(layers, frequency, engine):
    scene = scene_of(layers, engine=engine, restitution=0.5, restitution_threshold_m_per_s=0.1, frequency=frequency)
    kinds = agrees(scene, falling(scene), 0.08, keys=KEYS)
    assert set(kinds) == {"impact", "liftoff"}  # what sticks need not accumulate
    assert kinds[0] == "impact"


@pytest.mark.parametrize(("layers", "engine"), [(0, "native"), (2, "taylor")])
def test_through_corners_of_a_drive_program(layers, engine):
    """The second corner switches an exciter off, the third brings the supply back at once."""
    entries = [
        Entry(t_s=0.0, supply_frequency_hz=45.0),
        Entry(t_s=0.02, supply_frequency_hz=52.0),
        Entry(t_s=0.05, exciter_1="off"),
        Entry(t_s=0.07, supply_frequency_hz=49.0, exciter_1="on"),
    ]
    scene = scene_of(layers, engine=engine)
    start = later(scene, 0.5)
    scene = scene.replace(drive={"program": entries, "supply_frequency_hz": None})
    kinds = agrees(scene, start, 0.1, keys=KEYS[1:])
    assert kinds.count("drive") >= 3
    assert layers == 0 or "impact" in kinds


@pytest.mark.parametrize("ratio", [1.0, 10.0])
def test_with_a_stiff_layer(ratio):
    """A step of collocation is up to 500 times as long as the decay of the layer: an explicit one would overflow.

    Smaller steps of the differences, and larger ones with Taylor's series, are lost in round-off of the layer's force.
    """
    scene = scene_of(2).replace({"material.natural_frequency_hz": 1000.0, "material.damping_ratio": ratio})
    start = later(scene.replace({"solver.tolerance": 1e-8}), 0.5)
    kinds = agrees(scene, start, 0.08, step=1e-3)
    assert {"liftoff", "impact"} <= set(kinds)


@pytest.mark.parametrize(("layers", "engine"), [(1, "native"), (2, "taylor")])
def test_inelastic_closing_loses_two_dimensions(layers, engine):
    """Gap and gap rate at the start are forgotten, and what follows, a liftoff too, brings nothing back."""
    scene = scene_of(layers, engine=engine)
    start = flying(later(scene, 0.3))
    found = scaled(variation(scene, start, 0.08), scene)
    places = list(state_places(scene).values())
    values = np.linalg.svd(found[np.ix_(places, places)], compute_uv=False)
    assert values[-3] > 1e-6
    assert (values[-2:] < 1e-12).all()


def test_a_column_does_not_depend_on_how_many_others_there_are():
    scene = Scene(material=LAYERS[2], **SETUPS["unequal"])
    keys = [*KEYS, *(f"machine.{name}" for name in Machine.model_fields if name.startswith(("damping", "stiffness")))]
    keys += ["material.natural_frequency_hz", "material.damping_ratio", "machine.platform_mass_kg"] * 7
    wide = variation(scene, seconds=0.3, keys=keys).derivative
    assert wide.shape[1] > 3 * 14
    for k in (0, 1, len(keys) - 1):
        alone = variation(scene, seconds=0.3, keys=keys[k]).derivative
        np.testing.assert_array_equal(wide.iloc[:, [*range(14), 14 + k]], alone)
