import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq
from study.helpers import MACHINE

from vibroplat.config.reader import flat, load_tree
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.paper import reproduction, tables
from vibroplat.paper.evidence import BranchRecords, Evidence, F, PaperCurve
from vibroplat.paper.root_finding import JUMP_WIDTH, MATCHED_HZ, MAX_BETA, beta_without_excess, match_beta, narrow
from vibroplat.paper.scenes import BETA, machine_numbers, paper_scene
from vibroplat.plots.command import plot_results
from vibroplat.plots.paper import FIGURES
from vibroplat.study.branches import branches
from vibroplat.study.point import measure_point
from vibroplat.study.pool import Inline, StoredChain, run_stored
from vibroplat.study.store import Store
from vibroplat.study.sweep import branch_records, run_branches

COARSE = {
    "sweep.supply_frequency_hz.start": 42.0,
    "sweep.supply_frequency_hz.stop": 81.0,
    "sweep.supply_frequency_hz.step": 13.0,
    "sweep.measure_s": 0.5,
    "sweep.max_settle_s": 2.0,
    "sweep.lyapunov": False,
    "solver.tolerance": 1e-5,
    "solver.max_events_per_period": 200,
    "run.duration_s": 1.5,
}
FINE = {
    "sweep.lyapunov": False,
    "sweep.supply_frequency_hz.direction": ["up"],
    "sweep.supply_frequency_hz.start": 60.0,
    "sweep.supply_frequency_hz.stop": 66.0,
}

VERDICTS = {
    "reproduced",
    "not reproduced",
    "not judged at R = 1",
    "depends on an unprinted number",
    "depends on the seed",
}


def test_machines_are_known_by_their_names():
    assert machine_numbers("printed")["machine.damping_y_n_s_per_m"] == 40.0
    assert machine_numbers("damped")["machine.damping_y_n_s_per_m"] > 200.0
    with pytest.raises(ConfigError, match=r"--machine steel; allowed: calibrated, damped, printed"):
        machine_numbers("steel")


@pytest.mark.long
def test_beta_is_found_again():
    """The impact curve is replaced by that of the non-impact model with a known β."""
    known = 20.0
    # without perturbation, for near the jump the phase difference may leave π, which takes from y
    changes = {**FINE, BETA: known, "sweep.perturbation": 0.0}
    scene = paper_scene("fig6-nonimpact", machine_numbers("damped"), changes)
    evidence = Evidence()
    with Store(None, {}) as store:
        run_branches(branches(scene), store, Inline())
        add(evidence, scene, store)
    records = evidence.branches.pop(PaperCurve(0.2, model="non-impact"))
    impact = records.branch.scene.replace({"contact.model": "impact", BETA: 0.0})
    branch = branches(scene)[0]
    evidence.branches[PaperCurve(0.2)] = BranchRecords(replace(branch, scene=impact), records.rows)
    assert records.rows[0][F] < MATCHED_HZ < max(row[F] for row in records.rows)
    pool = Counting()
    with Store(None, {}) as store:
        beta = beta_of(evidence, store, pool)
        # the curve is straight between points 0.2 Hz apart
        assert beta == pytest.approx(known, abs=0.2)
        assert len(store) == pool.count > 10
        assert beta_of(evidence, store, Refusing()) == beta


def add(evidence, scene, store):
    """Add a finished sweep."""
    for branch in branches(scene):
        evidence.add(branch, branch_records(branch, store))


def beta_of(evidence, records, pool):
    """β of a mass ratio of 0.2."""
    return run_stored([StoredChain(match_beta(evidence), records, 0)], pool)[0]


def test_no_beta_where_the_frequency_is_not_reached():
    with Store(None, {}) as store:
        assert beta_of(Evidence(), store, Refusing()) is None


class Counting(Inline):
    """This process; counts tasks and notes their engines, and may be interrupted after some."""

    def __init__(self, most=math.inf):
        self.count = 0
        self.most = most
        self.engines = set()

    def submit(self, function, *arguments):
        if self.count >= self.most:
            raise Interrupted
        self.count += 1
        self.engines.add(arguments[0].solver.engine)
        return super().submit(function, *arguments)


class Interrupted(BaseException):
    pass


class Refusing(Inline):
    """For what needs no simulation."""

    def submit(self, function, *arguments):
        raise AssertionError(f"{function} is simulated")


# -- tables of β ------------------------------------------------------------------------------------------


def beta_by_table(excess, tolerance=1e-3):
    """β by an excess that is known as a function; returns it with the table that was asked for."""
    table = {}
    while True:
        try:
            return beta_without_excess(table, tolerance), table
        except KeyError as unknown:
            (beta,) = unknown.args
            table[beta] = excess(beta)


def test_beta_follows_from_a_table_that_is_filled_on_demand():
    beta, table = beta_by_table(lambda beta: math.exp(-beta / 10.0) - 0.2)
    assert beta == pytest.approx(10.0 * math.log(5.0), abs=1e-3)
    assert beta == brentq(lambda beta: math.exp(-beta / 10.0) - 0.2, 0.0, MAX_BETA, xtol=1e-3)
    assert beta in table
    assert {0.0, MAX_BETA} < table.keys()


def test_beta_is_none_where_no_value_makes_amplitudes_equal():
    assert beta_by_table(lambda beta: 1.0)[0] is None
    assert beta_by_table(lambda beta: -1.0)[0] is None
    assert beta_by_table(lambda beta: 1.0 if beta < 3.0 else -1.0)[0] is None  # a jump over it


# -- boundaries -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bare():
    """Evidence of the bare machine around the jump."""
    scene = paper_scene("fig2", machine_numbers("damped"), FINE)
    evidence = Evidence()
    with Store(None, {}) as store:
        run_branches(branches(scene), store, Inline())
        add(evidence, scene, store)
    return evidence


def jump(evidence):
    return evidence.jump(PaperCurve(0.0))


@pytest.mark.long
def test_jump_is_narrowed_and_resumed(bare, tmp_path):
    evidence, again = Evidence(bare.branches), Evidence(bare.branches)
    outer = jump(evidence)
    with Store(tmp_path, {}) as store, pytest.raises(Interrupted):
        narrow([(evidence, store)], Counting(3))
    assert evidence.boundaries == {}
    pool = Counting()
    with Store(tmp_path, {}, resume=True) as store:
        narrow([(evidence, store)], pool)
        assert (pool.count, len(store)) == (2, 5)
        inner = jump(evidence)
        assert jump(again) == outer
        narrow([(again, store)], Refusing())
    assert jump(again) == inner
    column = "supply_frequency_hz"
    assert outer.after[column] - outer.before[column] == pytest.approx(0.5)
    assert 0.0 < inner.after[column] - inner.before[column] <= JUMP_WIDTH
    assert outer.before[column] <= inner.before[column] < inner.after[column] <= outer.after[column]
    assert inner.before["sync"] == "antiphase" != inner.after["sync"]


@pytest.mark.parametrize(
    ("one", "other", "changes"),
    [
        (("fig3", {"material.mass_ratio": 0.2}), ("fig6", {"contact.restitution": 0.0}), {}),
        (("fig3", {"material.mass_ratio": 0.0}), ("fig2", {}), {}),
        (("fig2", {}), ("fig2", {}), {"material.damping_ratio": 0.3, "contact.restitution_threshold_m_per_s": 0.1}),
    ],
)
def test_curves_that_figures_share_are_computed_once(one, other, changes):
    """Their points do not depend on the figure, nor those of a bare platform on the material."""
    numbers = machine_numbers("calibrated") | {"sweep.measure_s": 0.5, "sweep.max_settle_s": 1.0}
    rows, curves = [], set()
    for (name, place), changed in ((one, {}), (other, changes)):
        scene = paper_scene(name, numbers | changed)
        branch = next(b for b in branches(scene) if b.grid == place and b.direction == "up")
        curves.add(reproduction.curve_of(branch))
        point = measure_point(branch.at(20), scene.sweep, None, branch.perturbation_key(branch.key_values[20]))
        rows.append({key: value for key, value in point.row.items() if key != "wall_s"})
    assert rows[0] == rows[1]
    assert len(curves) == 1


def test_curves_that_differ_are_computed_each():
    """Of the branches of Figs. 2, 3 and 6 three are there twice."""
    numbers = machine_numbers("calibrated")
    machine, _ = reproduction.PaperStudy(numbers).trials()
    found = [b for trial in machine for name in trial.names for b in branches(trial.scene(name))]
    assert len(found) == len(set(map(reproduction.curve_of, found))) + 3
    assert reproduction.PaperStudy(numbers).chains(None) == len(found) - 3


def test_sweeps_of_figures_differ_in_their_grid_alone():
    """Settings that differ would make a curve that they share another one."""
    first, second = (paper_scene(name, machine_numbers("printed")).sweep for name in ("fig3", "fig6"))
    differing = {"grid", "supply_frequency_hz"}
    assert first.model_dump(exclude=differing) == second.model_dump(exclude=differing)


@pytest.fixture
def coarse(monkeypatch):
    """The numbers of a coarse reproduction with one alternative."""
    monkeypatch.setattr(reproduction, "QUICK", COARSE)
    monkeypatch.setattr(reproduction, "load_list", lambda path: [{"material.damping_ratio": 0.3}])
    return flat(load_tree(MACHINE)) | COARSE | {"solver.engine": "taylor"}


@pytest.mark.long
def test_paper_is_reproduced_and_judged_again_from_what_is_stored(tmp_path, coarse, figures):
    told = []
    seeds = (2, 3)
    study, cases = reproduction.PaperStudy(coarse, seeds, "coarse"), []

    def reproduce(pool, *, resume=True):
        with Store(tmp_path, study.conditions, resume=resume) as store:
            result = study.run(store, pool, lambda *counts: told.append(counts))
            cases.extend(study.cross_check_cases(result, store, lambda scene: scene))
            store.finish()
            return result

    pool = Counting()
    found = reproduce(pool, resume=False)
    assert cases[0].task.function(*cases[0].task.arguments).row["rms_y_m"] == cases[0].row["rms_y_m"]
    assert pool.engines == {"taylor"}
    assert told[0] == (0, told[0][1])
    beta = found.provenance["beta_per_s"]
    viscous = {"fig6-nonimpact"} if beta else set()
    names = {*reproduction.SWEEPS, *tables.PANELS, *viscous}
    names |= {"sync-bands", "claims"}
    assert names == found.tables.keys()
    board = found.tables["claims"].set_index("id")
    assert set(board["verdict"].str.removesuffix(", without margin")) <= VERDICTS
    assert set(board["seeds"]) <= {"0 of 2", "1 of 2", "2 of 2"}
    bands = found.tables["sync-bands"]
    assert set(bands["direction"]) == {"up", "down"}
    counts = bands[bands["restitution"] < 1.0].groupby(["mass_ratio", "restitution", "model", "law", "direction"])
    assert counts["points"].sum().eq(4).all()  # with R = 1 points have too many events
    shown = found.tables["fig7"].groupby(["panel", "curve"]).size()
    assert len(shown) == (16 if beta else 12)
    assert np.isfinite(found.tables["fig4"]["y_m"]).all()
    found.save(tmp_path, "csv")
    assert found.answer.lines["machine"].startswith("coarse; ")
    plot_results([tmp_path])
    assert list(figures) == list(FIGURES)
    same(reproduce(Refusing()), found)  # judged again from what is stored


def same(found, expected):
    """Whether two reproductions are equal."""
    assert found.tables.keys() == expected.tables.keys()
    for name, table in expected.tables.items():
        pd.testing.assert_frame_equal(found.tables[name], table, check_exact=True)


def test_unfinished_reproduction_is_refused_before_anything_is_simulated(tmp_path, coarse):
    def reproduce(numbers, workers, *, resume=False):
        study = reproduction.PaperStudy(numbers)
        with Store(tmp_path, study.conditions, resume=resume) as store:
            study.run(store, workers, lambda done, known: None)

    with pytest.raises(Interrupted):
        reproduce(coarse, Counting(3))
    with pytest.raises(ConfigError, match="3 tasks of unfinished work"):
        reproduce(coarse, Refusing())
    changed = {**coarse, "machine.unbalance_radius_m": 0.01}
    with pytest.raises(ConfigError, match=r"cannot resume: .*unbalance_radius_m = 0\.01; allowed: "):
        reproduce(changed, Refusing(), resume=True)
    other = {**coarse, "solver.engine": "sundae"}
    with pytest.raises(ConfigError, match=r"cannot resume: .*\.engine = sundae; allowed: taylor"):
        reproduce(other, Refusing(), resume=True)


def test_history_begins_at_a_whole_turn():
    scene = Scene().replace({"drive.supply_frequency_hz": 50.0, "run.duration_s": 2.0})
    table = pd.DataFrame(tables.history(scene))
    assert table["t_s"].iloc[0] == 0.0
    turn = 1.0 / table["excitation_frequency_hz"].iloc[0]
    assert tables.SHOWN_TURNS * turn <= table["t_s"].iloc[-1] <= (tables.SHOWN_TURNS + 1) * turn
    assert "gap_m" not in table
    assert abs(table["y_m"].mean()) < 0.1 * table["y_m"].max()


def test_settings_of_sweeps_are_left_out_of_time_histories():
    numbers = machine_numbers("printed") | {"sweep.max_settle_s": 50.0, "material.mass_ratio": 0.15}
    history, swept = paper_scene("f25.75-mu0.2", numbers), paper_scene("fig3", numbers)
    assert history.sweep is None
    assert swept.sweep.max_settle_s == 50.0
    assert history.material.mass_ratio == 0.15


def test_unknown_setting_is_refused_before_anything_is_computed(command, here):
    done = command("paper", "--machine", "printed", "--set", "contact.restituton=1")
    assert done.code == 2
    assert "did you mean restitution?" in done.err
    assert len(done.err.strip().splitlines()) == 1
