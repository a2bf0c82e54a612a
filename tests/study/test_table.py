"""The table of a sweep: its columns, what is in them, points that fail, seeds."""

import itertools
import json
import math

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from common.places import FLYING, LOADED
from common.results import bits

from vibroplat import Scene, load, load_config, simulate, sweep
from vibroplat.config.plausibility import WARNING, notes_on_inputs
from vibroplat.hybrid.state import initial_state, perturb_state, state_scales
from vibroplat.integrate import make_engine
from vibroplat.report import summary
from vibroplat.results.tables import read_table
from vibroplat.study.branches import branches
from vibroplat.study.point import MEASURED, SweepPoint, synchronization
from vibroplat.study.pool import Inline
from vibroplat.study.store import Store
from vibroplat.study.sweep import SweepStudy, notes_on_points, run_branches

from .helpers import CHAOTIC, MACHINE, planned, swept

#: Columns that users rely on, in their order.
INTERFACE = [
    *("direction", "branch", "excitation_frequency_hz", "frequency_split_hz", "rms_x_m", "rms_y_m", "rms_phi_rad"),
    *("amplitude_y_m", "phase_difference_rad", "phase_coherence", "sync", "motion", "period", "flight_fraction"),
    *("impacts_per_period", "gap_max_m", "contact_force_max_n", "impulse_max_n_s", "motor_power_w", "energy_residual"),
    *("outcome", "steps", "residual_calls", "events", "simulated_s", "wall_s"),
]
TEXTS = {"direction", "relative_rotation", "sync", "motion", "outcome", "detail", "notes"}
COUNTS = {"branch", "period", "steps", "residual_calls", "events"}
#: What every row has, also of a point that failed.
OF_THE_OUTCOME = [*INTERFACE[:2], "detail", *INTERFACE[-6:]]
GRID = {"contact.restitution": [0.0, 0.3], "material.layers": [2]}
STORM = {"solver.max_events_per_period": 1}


@pytest.fixture(scope="module")
def table():
    """Two directions of two combinations of values."""
    return swept(LOADED, 50.0, 51.0, step=1.0, direction=["up", "down"], grid=GRID)


# -- rows and columns -----------------------------------------------------------------------------------


def test_columns_are_those_of_the_interface_and_have_its_types(table):
    found = list(table.columns)
    assert found[:3] == ["supply_frequency_hz", *GRID]
    assert [column for column in found[3:] if column in INTERFACE] == INTERFACE
    assert len(set(found)) == len(found)
    kinds = {"supply_frequency_hz": "float64", **dict(zip(GRID, ("float64", "int64"), strict=True))}
    kinds |= dict.fromkeys(TEXTS, "str") | dict.fromkeys(COUNTS, "Int64")
    assert table.dtypes.astype(str).to_dict() == {column: kinds.get(column, "float64") for column in found}
    assert set(table["relative_rotation"]) == {"counter-rotating"}


def test_types_do_not_depend_on_what_was_found():
    """A table without a period, an exponent or a good point has the types of any other."""
    grid = {key: values[:1] for key, values in GRID.items()}
    failed = swept(LOADED, 51.0, changes=STORM, grid=grid)
    chaotic = swept(MACHINE, 62.5, changes=CHAOTIC, grid=grid, max_settle_s=3.0, measure_s=0.5)
    assert set(failed["outcome"]) == {"too-many-events"}
    assert failed.dtypes.equals(chaotic.dtypes)


def test_branch_goes_on_from_point_to_point():
    """Both ways of turning are stable from 69 Hz on: a branch keeps the one that it comes with."""
    begun = {"run.initial.phase_difference_rad": 0.3}
    up = swept(MACHINE, 67.0, 71.0, step=1.0, changes=begun)
    down = swept(MACHINE, 67.0, 71.0, step=1.0, direction="down")
    assert up["sync"].tolist() == ["in-phase"] * 5
    assert down["sync"].iloc[[0, 1, -1]].tolist() == ["antiphase", "antiphase", "in-phase"]


# -- points that fail -----------------------------------------------------------------------------------


#: The engine that counts calls of the residual, too.
NATIVE = {"solver.engine": "native"}


@pytest.fixture(scope="module")
def storming():
    """Changes with which the loaded machine begins attached; below 47 Hz it stays so, above one event ends it."""
    attached = simulate(load_config(LOADED, {"drive.supply_frequency_hz": 44.0})).trajectory.iloc[-1]
    return {**STORM, "run.initial": {"state": attached.to_dict()}}


def test_failed_points_are_rows_and_the_branch_goes_on(storming):
    table = swept(LOADED, 44.0, 52.0, step=2.0, direction=["up", "down"], changes=storming | NATIVE)
    good = table["supply_frequency_hz"] < 47.0
    assert table["outcome"].tolist() == ["ok" if g else "too-many-events" for g in good]
    assert not table[list(OF_THE_OUTCOME)].isna().any(axis=None)
    failed = table[~good]
    assert failed["detail"].str.contains("raise solver.max_events_per_period", regex=False).all()
    assert (failed["simulated_s"] > 0.0).all()
    assert (failed["steps"] > 0).all()
    missing = ["rms_y_m", "sync", "motion", "period", "excitation_frequency_hz", "lyapunov_per_s"]
    assert failed[missing].isna().all(axis=None)
    assert not table.loc[good, ["rms_y_m", "sync", "period"]].isna().any(axis=None)
    assert failed["notes"].isna().all()


def test_points_that_do_not_keep_their_balances_are_inaccurate_and_not_gone_on_from(monkeypatch):
    scene = planned(LOADED, 50.0, 50.5, settle_by="section", measure_s=0.1)
    good = sweep(scene).sweep
    monkeypatch.setattr(summary, "MIN_ENERGY_LIMIT", 0.0)
    monkeypatch.setattr(summary, "ENERGY", 1e-9)
    table = sweep(scene).sweep
    assert good["outcome"].tolist() == ["ok", "ok"]
    assert table["outcome"].tolist() == ["inaccurate", "inaccurate"]
    assert (
        table["detail"].str.match(r"engine taylor: energy residual \S+ exceeds 1e-12, .*; engine native: energy").all()
    )
    assert (table["energy_residual"] > 1e-12).all()
    assert table["energy_residual"][0] == good["energy_residual"][0]
    assert table[["rms_y_m", "sync", "period", "excitation_frequency_hz"]].isna().all(axis=None)
    assert (table["simulated_s"] == good["simulated_s"])[0]


class Recorder:
    """In the place of ``measure_point``: what it was asked for, and points that fail on demand."""

    def __init__(self, failing):
        self.failing = failing
        self.asked = []

    def __call__(self, scene, plan, state, key):
        frequency = scene.drive.supply_frequency_hz
        self.asked.append((frequency, state, key))
        if frequency in self.failing:
            return SweepPoint({"outcome": "too-many-events", "events": 3}, None)
        return SweepPoint({"outcome": "ok", "events": 2}, [frequency] * 14)


def test_points_begin_with_the_state_of_the_last_good_one(monkeypatch):
    recorder = Recorder(failing=(50.0, 51.5, 52.0))
    monkeypatch.setattr("vibroplat.study.sweep.measure_point", recorder)
    sweep(planned(LOADED, 50.0, 52.5, direction=["up", "down"]))
    begun = [(frequency, None if state is None else state[0], key) for frequency, state, key in recorder.asked]
    assert [call for call in begun if call[2][0] == 0] == [
        (50.0, None, (0, 50000000)),
        (50.5, None, (0, 50500000)),
        (51.0, 50.5, (0, 51000000)),
        (51.5, 51.0, (0, 51500000)),
        (52.0, 51.0, (0, 52000000)),
        (52.5, 51.0, (0, 52500000)),
    ]
    down = [call[:2] for call in begun if call[2] == (1, round(1e6 * call[0]))]
    assert down == [(52.5, None), (52.0, 52.5), (51.5, 52.5), (51.0, 52.5), (50.5, 51.0), (50.0, 50.5)]


def test_progress_counts_points(monkeypatch):
    monkeypatch.setattr("vibroplat.study.sweep.measure_point", Recorder(failing=()))
    told = []
    sweep(planned(LOADED, 50.0, 51.0, direction=["up", "down"]), progress=lambda *counts: told.append(counts))
    assert told == [(points, 6) for points in range(7)]


# -- synchronization ------------------------------------------------------------------------------------


def found(phase, *, split=0.0, coherence=1.0, seconds=2.0):
    return {
        "phase_difference_rad": phase,
        "impacts_per_period": 0.0,
        "frequency_split_hz": split,
        "phase_coherence": coherence,
        "measured_s": seconds,
    }


def test_synchronization_by_the_phase_difference():
    limits = {"in-phase": (0, 59, -59), "intermediate": (61, -119), "antiphase": (121, 180, -180)}
    for name, angles in limits.items():
        assert {synchronization(found(math.radians(degrees))) for degrees in angles} == {name}


def test_exciters_that_drift_apart_are_not_synchronous():
    """Drift by more than a quarter turn over the measured part, or incoherence."""
    for changes in ({"split": 0.1}, {"split": -0.1}, {"coherence": 0.81}):
        assert synchronization(found(math.pi, **changes)) == "antiphase"
    drifting = ({"split": 0.15}, {"split": -0.15}, {"split": 0.1, "seconds": 4.0})
    for changes in (*drifting, {"coherence": 0.79}):
        assert synchronization(found(math.pi, **changes)) == "none"
    assert synchronization(found(math.pi) | {"impacts_per_period": None}) == "none"  # nothing turns


# -- perturbation ---------------------------------------------------------------------------------------


def test_equal_scenes_have_equal_rows_in_any_sweep(table):
    """All curves without restitution are one, whatever else is swept and in whichever order."""
    masses = swept(LOADED, 50.0, 51.0, step=1.0, direction=["down", "up"], grid={"material.mass_ratio": [0.2]})
    places = ["material.mass_ratio", "material.layers", "contact.restitution", "direction", "branch"]

    def curve(found, direction):
        return bits(found[found["direction"] == direction].drop(columns=places, errors="ignore"))

    for direction in ("up", "down"):
        assert curve(masses, direction) == curve(table[table["contact.restitution"] == 0.0], direction)
        assert curve(masses, direction) != curve(table[table["contact.restitution"] == 0.3], direction)


def test_perturbation_changes_rates_by_its_size_and_follows_from_its_key():
    scene = planned(LOADED, 50.0, perturbation=0.02, seed=5)
    state, scales = initial_state(scene), state_scales(scene)
    changes = np.array([perturb_state(state, scene, 0.02, (5, 0, k)) - state for k in range(400)]) / scales
    assert not changes[:, [0, 1, 2, 3, 4, 5, 6, 12, 13]].any()
    assert changes[:, 7:12].std(axis=0) == pytest.approx([0.02] * 5, rel=0.15)
    assert changes[:, 7:12].mean(axis=0) == pytest.approx([0.0] * 5, abs=0.005)
    assert len(np.unique(changes[:, 7])) == 400
    draws = [perturb_state(state, scene, 0.01, key)[7] for key in itertools.product((0, 1), repeat=3)]
    assert len(set(draws)) == len(draws)
    assert perturb_state(state, scene, 0.01, (0, 0, 1))[7] == draws[1]
    assert np.abs(np.corrcoef(changes[:, 7:12].T) - np.eye(5)).max() < 0.25


# -- bifurcation ----------------------------------------------------------------------------------------


def both_tables(scene):
    result = sweep(scene)
    return result.sweep, result.section, result.impacts


def test_bifurcation_tables_show_the_last_turns_and_impacts_of_each_point():
    plan = {"kind": "bifurcation", "settle_by": "section", "grid": {"contact.restitution": [0.0]}}
    scene = planned(LOADED, 50.0, 51.0, step=1.0, direction=["up", "down"], **plan)
    rows, section, impacts = both_tables(scene)
    keys = ["supply_frequency_hz", "contact.restitution", "direction", "branch", "excitation_frequency_hz"]
    assert list(section.columns) == [*keys, "y_m"]
    assert list(impacts.columns) == [*keys, "impact_speed_m_per_s"]
    turns = section.groupby(["branch", "supply_frequency_hz"])["y_m"]
    assert turns.size().between(48, 64).all()
    assert len(turns) == len(rows) == 4
    # period 1: one height, one speed
    assert (turns.max() - turns.min()).max() < 1e-2 * scene.length_scale
    speeds = impacts.groupby(["branch", "supply_frequency_hz"])["impact_speed_m_per_s"]
    assert (len(speeds), speeds.min().min() > 0.0) == (4, True)
    assert ((speeds.max() - speeds.min()) < 0.02 * speeds.min()).all()
    _, section, impacts = both_tables(planned(MACHINE, 50.0, kind="bifurcation"))  # it has no impacts
    assert (len(section) > 0, len(impacts)) == (True, 0)
    assert str(impacts["impact_speed_m_per_s"].dtype) == "float64"


def test_rows_and_diagrams_of_a_point_are_those_of_a_run():
    """Without a perturbation a point is the end of a run."""
    plan = {"settle_by": "section", "measure_s": 3.0, "perturbation": 0.0, "kind": "bifurcation"}
    scene = planned(LOADED, 51.0, changes={"contact.restitution": 0.3}, **plan)
    rows, section, impacts = both_tables(scene)
    row = rows.iloc[0]
    seconds = row["settle_s"]
    run = simulate(scene.replace({"drive.supply_frequency_hz": 51.0, "run.duration_s": row["simulated_s"]}))
    same = ("excitation_frequency_hz", "rms_y_m", "amplitude_y_m", "phase_coherence")
    for column in (*same, "flight_fraction", "impacts_per_period", "motor_power_w"):
        assert row[column] == pytest.approx(run.summary[column], rel=1e-3), column
    assert abs(row["phase_difference_rad"]) == pytest.approx(math.pi, abs=1e-6)
    late = run.trajectory[run.trajectory["t_s"] >= seconds]
    assert row["gap_max_m"] == pytest.approx(late["gap_m"].max(), rel=1e-3)
    assert row["contact_force_max_n"] == pytest.approx(late["contact_force_n"].max(), rel=1e-2)
    struck = run.events.query("kind == 'impact' and t_s > @seconds")
    assert row["impulse_max_n_s"] == pytest.approx(struck["impulse_n_s"].max(), rel=1e-3)
    assert row["simulated_s"] == pytest.approx(seconds + 3.0, abs=0.05)
    assert row["events"] == pytest.approx(len(run.events), abs=2)
    heights = run.section.loc[run.section["t_s"] > seconds, "y_m"].to_numpy()[-64:]
    assert len(section) - len(heights) in (0, 1)  # the point ends on the section
    assert section["y_m"].to_numpy()[: len(heights)] == pytest.approx(heights, abs=1e-3 * scene.length_scale)
    speeds = -struck["gap_rate_before_m_per_s"].to_numpy()[-64:]
    assert impacts["impact_speed_m_per_s"].to_numpy() == pytest.approx(speeds, abs=1e-3)


# -- the command ----------------------------------------------------------------------------------------


def test_command_with_failed_points_exits_1_and_names_them(command, here, storming):
    (here / "c.yaml").write_text(
        f"{FLYING}solver: {{max_events_per_period: 1}}\nrun: {json.dumps({'initial': storming['run.initial']})}\n"
        "sweep: {supply_frequency_hz: {start: 44.0, stop: 52.0, step: 4.0}, grid: {material.layers: [2]}}\n"
    )
    done = command("sweep", "c.yaml", "--format", "csv")
    assert done.code == 1
    first, second, last = done.err.splitlines()
    place = "too-many-events at supply_frequency_hz {}, material.layers 2, direction up: 1 restarts within "
    assert first.startswith(f"vibroplat: {place.format(48.0)}")
    assert second.startswith(f"vibroplat: {place.format(52.0)}")
    assert last == "vibroplat: 2 of the points failed"
    assert read_table(here / "results/c/sweep", "sweep")["outcome"].tolist() == [
        "ok",
        "too-many-events",
        "too-many-events",
    ]
    done = command("sweep", "c.yaml", "--set", "sweep.supply_frequency_hz.start=52", "--out", "failed")
    assert (done.code, len(done.err.splitlines()), "nan" in done.out) == (1, 2, False)
    assert done.out.startswith("1 of 1 point FAILED (too-many-events), f_e 52 Hz, up\n")


def test_another_kind_removes_what_the_one_before_wrote(command, here):
    (here / "c.yaml").write_text(f"{FLYING}sweep: {{supply_frequency_hz: {{start: 50.0, stop: 50.0}}}}\n")
    directory = here / "results/c/sweep"
    kinds = ("--set", "sweep.kind=bifurcation", "--format", "csv"), ("--set", "sweep.kind=response")
    both = {"section.csv", "impacts.csv", "bands.csv", "sweep.csv"}, {"bands.parquet", "sweep.parquet"}
    for kind, written in zip(kinds, both, strict=True):
        assert command("sweep", "c.yaml", *kind).code == 0
        assert {path.name for path in directory.glob("*.[pc]*")} == written


def test_point_without_memory_has_an_outcome_and_the_next_one_goes_on(monkeypatch):
    made = []

    def without(scene, p):
        made.append(scene)
        if len(made) == 2:
            raise MemoryError
        return make_engine(scene, p)

    monkeypatch.setattr("vibroplat.study.point.make_engine", without)
    table = swept(LOADED, 50.0, 51.0, settle_by="section", measure_s=0.3)
    assert table["outcome"].tolist() == ["ok", "out-of-memory", "ok"]
    assert table["detail"].tolist()[1].startswith("the system gave no more memory; ")
    assert table["steps"].tolist()[1] == 0


# -- notes ----------------------------------------------------------------------------------------------


def noted(*notes):
    found = pd.DataFrame({"supply_frequency_hz": 60.0 + np.arange(len(notes)), "notes": list(notes)})
    return found.assign(motion="periodic", outcome="ok")


def test_each_kind_of_note_is_told_once_with_its_points():
    turning = "the platform turns by up to {} rad, where a model of first order in phi is inaccurate"
    captured = "exciter {} turns at {} Hz, 7.6 % below its synchronous speed 33 Hz: overloaded"
    both = f"{captured.format(1, 30.5)}; {captured.format(2, 30.5)}"
    found = notes_on_points(noted("", both, f"{turning.format(0.2)}; {captured.format(2, 1e-5)}", both, None))
    assert found == [
        f"3 points at a supply of 61 … 63 Hz, the first: {captured.format(1, 30.5)}",
        f"1 point at a supply of 62 Hz: {turning.format(0.2)}",
    ]
    assert notes_on_points(noted("", None, np.nan)) == notes_on_points(noted()) == []


def test_notes_on_the_input_are_those_of_all_branches_each_once():
    grid = {"material.mass_ratio": [0.2, 20.0], "contact.restitution": [0.0, 0.5]}
    scene = planned(LOADED, 300.0, 500.0, step=100.0, direction=["up", "down"], grid=grid)
    notes = notes_on_inputs(SweepStudy(scene).scenes())
    assert len(set(notes)) == len(notes)
    assert f"{WARNING}material.mass_ratio = 20; usual: up to 5" in notes
    assert f"{WARNING}drive.supply_frequency_hz = 500; usual: up to 400 Hz" in notes
    assert not [note for note in notes if "not given" in note]


def test_an_answer_in_python_has_the_notes_on_keys_without_effect_once():
    times = {"settle_by": "section", "max_settle_s": 0.1, "measure_s": 0.1, "lyapunov": False}
    scene = planned(LOADED, 50.0, changes={"run.seed": 7}, **times)
    note = f"{WARNING}run.seed = 7 has no effect on sweep: sweep.seed = 0 counts"
    assert sweep(scene).answer.notes.count(note) == 1


def test_a_sweep_prints_its_notes_and_keeps_those_of_points(command, kernels, here):
    frequencies = "{start: 50.0, stop: 50.5}"
    times = "measure_s: 0.5, lyapunov: false"
    sweep = f"{{supply_frequency_hz: {frequencies}, grid: {{motor.critical_torque_n_m: [1.2, 0.01]}}, {times}}}"
    plan = "run: {initial: {speed_ratio: 0.7}}\nsolver: {tolerance: 1.0e-5}\n"
    (here / "own.yaml").write_text(
        f"motor: {{critical_slip: 0.15}}\nmachine: {{damping_y_n_s_per_m: 400.0}}\n{plan}sweep: {sweep}\n"
    )
    done = command("sweep", "own.yaml", "--format", "csv")
    assert (done.code, done.err) == (0, "")
    notes = load(here / "results/own").answer.notes
    assert notes[0].startswith("computed by engine taylor")
    assert notes[1].startswith(f"{WARNING}2 points at a supply of 50 … 50.5 Hz, the first: each exciter ")
    assert notes[2].startswith(f"{WARNING}1 point at a supply of 50 Hz: may be a transient: excitation_frequency_hz ch")
    assert notes[3:5] == [
        f"{WARNING}machine: platform_mass_kg and 11 more keys not given; taken from the paper's test rig",
        f"{WARNING}motor: pole_pairs and friction_radius_m not given; taken from the paper's test rig",
    ]
    assert len(notes) == 6
    assert "rotor_inertia_kg_m2" in notes[5]
    assert f"  {notes[3]}" in done.out.splitlines()
    table = read_table(here / "results/own/sweep", "sweep")
    assert table["notes"].notna().tolist() == [False, False, True, True]


def test_undecided_points_are_told_with_the_first_reason():
    table = noted("", "", "").assign(motion=["periodic", *["undecided"] * 2], detail=["", "sign unclear", "drifts"])
    told = "2 points are undecided, the first at a supply of 61 Hz: sign unclear; sweep.max_settle_s may help"
    assert notes_on_points(table) == [told]
    few = table.assign(detail=["", "4 turns measured, at least 31 are needed", "drifts"])
    assert notes_on_points(few)[0].endswith("4 turns measured, at least 31 are needed; sweep.measure_s may help")
    one = "1 point is undecided, at a supply of 62 Hz: drifts; sweep.max_settle_s may help"
    assert notes_on_points(table[table["detail"] != "sign unclear"]) == [one]
    assert notes_on_points(table[:1]) == []


def test_chaotic_points_say_that_other_attractors_were_not_looked_for():
    chaotic = noted("", "", "").assign(motion=["periodic", *["chaotic"] * 2], simulated_s=[1.0, 198.0, 52.0])
    assert notes_on_points(chaotic) == [
        "hint: 2 chaotic points: other attractors were not looked for: basins; chaos that ends only after "
        "the 52.0 s for which they were followed looks alike"
    ]


# -- many points ----------------------------------------------------------------------------------------

SECTION_POINTS = 64
MASSES = {"material.mass_ratio": [0.1, 0.2]}


def measured_at_once(scene, plan, state, key):
    """In the place of ``measure_point``: numbers that follow from the point's alone."""
    numbers = np.random.default_rng(key).random(len(MEASURED) + 14 + 2 * SECTION_POINTS).tolist()
    row = dict(zip(MEASURED, numbers, strict=False))
    row |= {"sync": "antiphase", "period": 1, "motion": "periodic", "settle_s": 1.0, "outcome": "ok", "detail": ""}
    row |= {"steps": 1, "residual_calls": 2, "events": 3, "simulated_s": numbers[0], "wall_s": 1e-3}
    heights, speeds = numbers[-2 * SECTION_POINTS : -SECTION_POINTS], numbers[-SECTION_POINTS:]
    return SweepPoint(row, numbers[len(MEASURED) : len(MEASURED) + 14], heights, speeds)


def sweep_of(points, directory, **plan):
    """Sweep so many quick points in four branches and write the tables."""
    last = 0.9 + 0.1 * (points // 4)
    scene = planned(LOADED, 1.0, last, step=0.1, direction=["up", "down"], grid=MASSES, **plan)
    directory.mkdir()
    with Store(directory, {}) as store:
        SweepStudy(scene).run(store, Inline(), lambda done, known: None).save(directory)


def test_no_scene_is_made_for_points_that_are_stored(tmp_path, monkeypatch):
    """Making it takes ten times as long as finding the point."""
    monkeypatch.setattr("vibroplat.study.sweep.measure_point", measured_at_once)
    sweep_of(16, tmp_path / "points")
    planned_ = branches(planned(LOADED, 1.0, 1.3, step=0.1, direction=["up", "down"], grid=MASSES))
    monkeypatch.setattr(Scene, "replace", None)
    with Store(tmp_path / "points", {}, resume=True) as store:
        run_branches(planned_, store, Inline())
        assert store.reused == 16


def test_table_of_many_points_is_in_row_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("vibroplat.study.sweep.measure_point", measured_at_once)
    monkeypatch.setattr("vibroplat.results.tables.MAX_GROUP_ROWS", 12)
    sweep_of(16, tmp_path / "points", kind="bifurcation")
    table = read_table(tmp_path / "points", "sweep")
    groups = pq.ParquetFile(tmp_path / "points/sweep.parquet").metadata
    assert groups.num_rows == len(table) == 16
    assert [groups.row_group(k).num_rows for k in range(groups.num_row_groups)] == [12, 4]
    assert table["branch"].tolist() == [branch for branch in range(4) for _ in range(4)]
    assert table["supply_frequency_hz"].iloc[-4:].tolist() == [1.3, 1.2, 1.1, 1.0]
    up = table[table["branch"] == 2]  # of the second mass
    assert up["supply_frequency_hz"].tolist() == [round(1.0 + 0.1 * k, 1) for k in range(4)]
    assert up["rms_y_m"].tolist() == [
        np.random.default_rng((0, 1_000_000 + 100_000 * k)).random(len(MEASURED))[3] for k in range(4)
    ]
    section = read_table(tmp_path / "points", "section")
    assert len(section) == 16 * SECTION_POINTS
