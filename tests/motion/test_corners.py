"""A supply that ramps, jumps and is switched: its corners are events, and all engines take them alike."""

import numpy as np
import pandas as pd
import pytest
from common.known import motion_of

from vibroplat import simulate
from vibroplat.config.coordinates import COORDINATES, RATES, Mode
from vibroplat.hybrid.state import state_scales
from vibroplat.model.accelerations import accelerations
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import systems

#: A ramp, a jump, and switching; the first entry is the run's beginning.
PROGRAM = [
    {"t_s": 0.0, "supply_frequency_hz": 20.0},
    {"t_s": 0.4, "supply_frequency_hz": 46.0},
    {"t_s": 0.6, "supply_frequency_hz": 50.0},
    {"t_s": 0.6, "supply_frequency_hz": 44.0},
    {"t_s": 0.8, "exciter_2": "off"},
    {"t_s": 1.0, "off": True},
]
CORNERS = [0.4, 0.6, 0.8, 1.0]

#: From standstill; the supply passes a thousandth of its largest frequency at 1 ms.
STARTING = [
    {"t_s": 0.0, "supply_frequency_hz": 0.0},
    {"t_s": 1.0, "supply_frequency_hz": 50.0},
    {"t_s": 1.2, "exciter_1": "off"},
]

BARE = {"material.mass_ratio": 0.0}
ONE_LAYER = {"material": {"mass_ratio": 0.1, "layers": 1}}


@pytest.fixture
def scene(quickstart):
    return quickstart.replace({"drive.program": PROGRAM, "run.duration_s": 1.3, "run.perturbation": 0.01})


def corners(events):
    return events.loc[events["kind"] == "drive", "t_s"].to_list()


@pytest.mark.parametrize("changes", [ONE_LAYER, BARE], ids=["one layer", "bare"])
def test_corners_are_events(scene, changes):
    run = simulate(scene.replace(changes))
    assert run.outcome == "ok"
    assert corners(run.events) == CORNERS
    told = run.events[run.events["kind"] == "drive"]
    zeros = ["gap_rate_before_m_per_s", "gap_rate_after_m_per_s", "impulse_n_s", "energy_loss_j", "impacts"]
    assert (told[zeros] == 0.0).all(axis=None)
    attached = told["mode_after"] == "attached"
    assert ((told["contact_force_after_n"] > 0.0) == attached).all()
    assert attached.any() == bool(changes != BARE)
    assert run.summary["events"] == len(run.events) - len(CORNERS)  # liftoffs, impacts, chatters


def test_two_rows_share_the_time_of_a_corner(scene):
    table = simulate(scene).trajectory
    for time in CORNERS:
        before, after = table[table["t_s"] == time].to_dict("records")
        for name in (*COORDINATES, *RATES):
            assert after[name] == pytest.approx(before[name], rel=1e-15, abs=0.0)  # whole turns are taken off anew
    frequencies = [table.loc[table["t_s"] == time, "supply_frequency_hz"].to_list() for time in CORNERS]
    assert np.array(frequencies) == pytest.approx(np.array([[46, 46], [50, 44], [44, 44], [44, 44]]), rel=1e-14)
    powers = table.set_index("t_s")[["motor_power_1_w", "motor_power_2_w"]]
    assert (powers.loc[0.8].to_numpy() != 0.0).tolist() == [[True, True], [True, False]]
    assert (powers.loc[1.0].to_numpy() != 0.0).tolist() == [[True, False], [False, False]]
    assert (powers.loc[1.0001:] == 0.0).all(axis=None)


def test_corner_that_is_none_of_the_program_is_not_told(quickstart):
    """Where the critical slip speed begins to follow the frequency the integration restarts, and nothing happens."""
    starting = {"drive.program": STARTING, "run.initial": {"speed_ratio": 0.0}, "run.duration_s": 0.2}
    scene = quickstart.replace({**BARE, **starting, "output.sample_rate_hz": 3000.0})
    assert scene.drive.intervals[0].end == pytest.approx(1e-3, rel=1e-12)
    assert not scene.drive.intervals[1].corner
    run = simulate(scene)
    assert run.summary["restarts"] == 2
    assert corners(run.events) == []
    assert not run.trajectory["t_s"].duplicated().any()


def test_program_of_one_entry_is_a_constant_supply(quickstart):
    scene = quickstart.replace({"run.duration_s": 0.5})
    constant, program = (
        simulate(scene.replace(drive=drive))
        for drive in ({"supply_frequency_hz": 51.5}, {"program": [{"t_s": 0.0, "supply_frequency_hz": 51.5}]})
    )
    pd.testing.assert_frame_equal(program.events, constant.events, check_exact=True)
    assert (program.trajectory.pop("supply_frequency_hz") == 51.5).all()
    pd.testing.assert_frame_equal(program.trajectory, constant.trajectory, check_exact=True)


def test_exciter_that_is_off_slows_down_by_its_resistance(quickstart):
    """On a platform that does not move: J_e ω′ = −k_R k ω² has the solution ω₀/(1 + k_R k ω₀ t/J_e)."""
    heavy = {"platform_mass_kg": 1e9, "platform_inertia_kg_m2": 1e9, "gravity_m_per_s2": 0.0}
    motor = {"friction_radius_m": 5e-3}
    entries = [{"t_s": 0.0, "supply_frequency_hz": 50.0, "off": True}]
    scene = quickstart.replace({"machine": heavy, "motor": motor, "drive.program": entries, **BARE})
    scene = scene.replace({"run.initial": {"speed_ratio": 1.0}, "run.duration_s": 1.0, "solver.tolerance": 1e-9})
    run = simulate(scene)
    speed, share = scene.synchronous_speeds[0], 5e-3 * scene.unbalances[0] / scene.exciter_inertias[0]
    expected = speed / (1.0 + share * speed * run.trajectory["t_s"])
    np.testing.assert_allclose(run.trajectory["phi1_rate_rad_per_s"], expected, rtol=1e-7)
    np.testing.assert_allclose(run.trajectory["phi2_rate_rad_per_s"], -expected, rtol=1e-7)
    assert expected.iloc[-1] < 0.4 * speed


def force_behind(scene, before, time):
    """Return the contact force of a row of a trajectory by the equations under the supply from a time on (N)."""
    system = systems(scene)[Mode.ATTACHED]
    y, yp = np.zeros(system.size), np.empty(system.size)
    full = np.array([before.get(name, 0.0) for name in (*COORDINATES, *RATES)])
    y[: system.differential] = full[system.places]
    assert accelerations(system.index, time, y, yp, parameters(scene, time))
    return y[-1]


@pytest.fixture(scope="module")
def near_liftoff(quickstart):
    """A scene, the row of its trajectory shortly before a liftoff, when little force is left; strong motors."""
    strong = {"motor.critical_torque_n_m": 10.0, "solver.tolerance": 1e-10, "run.duration_s": 0.7}
    scene = quickstart.replace(strong)
    run = simulate(scene)
    liftoffs = run.events.loc[run.events["kind"] == "liftoff", "t_s"]
    before = run(liftoffs[liftoffs > 0.5].iloc[0] - 1e-4).iloc[0].to_dict()
    assert before["mode"] == "attached"
    assert 0.0 < before["contact_force_n"] < 1.0
    return scene, before


def jumping(scene, time, frequency):
    entries = [(0.0, 51.5), (time, 51.5), (time, frequency)]
    return scene.replace({"drive.program": [{"t_s": t, "supply_frequency_hz": f} for t, f in entries]})


def test_force_jumps_where_the_torque_does(near_liftoff):
    scene, before = near_liftoff
    time = before["t_s"]
    scene = jumping(scene, time, 44.0)
    run, expected = simulate(scene), force_behind(scene, before, time)
    assert expected > 1.5 * before["contact_force_n"]
    (event,) = run.events[run.events["t_s"] == time].to_dict("records")
    assert (event["kind"], event["mode_after"]) == ("drive", "attached")
    assert event["contact_force_after_n"] == pytest.approx(expected, rel=1e-6)
    forces = run.trajectory.loc[run.trajectory["t_s"] == time, "contact_force_n"].to_list()
    assert forces == pytest.approx([before["contact_force_n"], expected], rel=1e-6)


def test_torque_that_leaves_no_force_lifts_off_at_once(near_liftoff):
    scene, before = near_liftoff
    time = before["t_s"]
    scene = jumping(scene, time, 60.0)
    run = simulate(scene)
    assert force_behind(scene, before, time) < -0.5
    found = run.events[run.events["t_s"] == time]
    assert found["kind"].to_list() == ["drive", "liftoff"]
    assert (found["contact_force_after_n"] == 0.0).all()
    assert found["mode_after"].iloc[-1] == "flight"
    rows = run.trajectory[run.trajectory["t_s"] == time]
    assert rows["mode"].to_list() == ["attached", "flight"]
    assert rows["contact_force_n"].to_list() == pytest.approx([before["contact_force_n"], 0.0], rel=1e-6)
    after = run.events[run.events["t_s"] > time].iloc[0]
    assert after["kind"] == "impact"
    assert after["t_s"] - time > 1e-3
    assert run.summary["gap_min_m"] >= 0.0
    assert run.summary["energy_residual"] < 1e-7


def time_of(scene, kind):
    events = simulate(scene).events
    return float(events.loc[(events["kind"] == kind) & (events["t_s"] > 0.5), "t_s"].iloc[0])


@pytest.mark.parametrize(("kind", "shift"), [("liftoff", 0.0), ("impact", 0.0), ("liftoff", 1e-9), ("impact", -1e-9)])
def test_corner_at_another_event(quickstart, kind, shift):
    """To whichever side round-off takes it, each of the two is told once; a rise of the supply takes force away."""
    scene = quickstart.replace({"solver.tolerance": 1e-9, "run.duration_s": 0.6})
    time = time_of(scene, kind) + shift
    run = simulate(jumping(scene, time, 52.0))
    assert run.outcome == "ok"
    assert corners(run.events) == [time]
    near = run.events[(run.events["t_s"] - time).abs() < 1e-6]
    assert sorted(near["kind"]) == sorted(["drive", kind])
    assert run.summary["energy_residual"] < 1e-7


def test_motion_reaches_its_section_across_corners(scene):
    with motion_of(scene.replace(BARE)) as motion:
        assert motion.to_section(12, 1.3)
        assert motion.now > 0.6
        assert motion.state[3] == pytest.approx(24.0 * np.pi, abs=1e-9)


FROM_0_HZ = {"drive.program": STARTING, "run.initial": {"speed_ratio": 0.0}}
CO_ROTATING = {
    "exciters": [{"rated_frequency_hz": 50.0}, {"rotation": "counter-clockwise", "unbalance_radius_m": 0.08}],
    "run.initial": {"phase_difference_rad": 3.0, "speed_ratio": 0.98},
}


@pytest.mark.parametrize(
    ("changes", "engine"),
    [(FROM_0_HZ, "native"), ({}, "taylor"), ({}, "sundae"), (BARE | FROM_0_HZ, "taylor"), (CO_ROTATING, "native")],
)
def test_engines_agree_through_ramps_and_switching(scene, changes, engine):
    """At tolerance 1e-8; errors of the angles are up to 700 times as large, those of coordinates in scales 10 times."""
    scene, other = scene.replace(changes), "native" if engine == "taylor" else "taylor"
    reference = simulate(scene.replace({"solver": {"engine": other, "tolerance": 1e-11}}))
    run = simulate(scene.replace({"solver": {"engine": engine, "tolerance": 1e-8}}))
    assert (run.outcome, reference.outcome) == ("ok", "ok")
    assert run.events["kind"].to_list() == reference.events["kind"].to_list()
    assert np.abs(run.events["t_s"] - reference.events["t_s"]).max() < 2e-7
    times = np.linspace(0.0, 1.3, 2001)
    mine, theirs = run(times), reference(times)
    same = (mine["mode"] == theirs["mode"]).to_numpy()
    assert same.mean() > 0.998
    for name, scale in zip(COORDINATES, state_scales(scene), strict=False):
        if name in mine:
            error = np.abs(mine[name] - theirs[name])[same].max() / scale
            assert error < 2e-5, name
