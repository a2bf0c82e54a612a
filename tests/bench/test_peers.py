"""The peers find the motion, the oracle that of the reference tables, and run times are compared at equal errors."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from model.helpers import EACH_MACHINE, EACH_SYSTEM, TIME, central_difference, random_states, scene_of, settled

from vibroplat import simulate
from vibroplat.bench.peers import cases, precision, siconos
from vibroplat.bench.peers.following import Followed, Legs, flow, follow, guard, jacobian, straight
from vibroplat.bench.peers.peers import PEERS, Peer
from vibroplat.bench.reference import load_reference
from vibroplat.errors import TableError
from vibroplat.model.parameters import parameters
from vibroplat.plots.bench import SCALED, plot_precision

REFERENCE = Path(__file__).parents[1] / "reference"

#: Setting, and bounds of the errors of coordinates over their scales, event times (s) and F_c over its largest:
#: those of "one impact a period" over 0.8 s, tripled.
SETTINGS = {
    "vibroplat": (1e-8, 4.4e-6, 9.3e-9, 3.7e-7),
    "vibroplat, Taylor": (1e-6, 1.8e-6, 3.8e-9, 6.2e-7),
    "scikit-sundae, Python callbacks": (1e-7, 2.8e-5, 5.6e-8, 3.8e-6),
    "scipy DOP853": (1e-6, 4.6e-5, 1.1e-7, 5.4e-6),
    "scipy LSODA": (1e-8, 1.6e-6, 3.7e-9, 1.5e-7),
    "scipy Radau": (1e-6, 8.5e-6, 2.6e-8, 1.1e-6),
    "heyoka": (1e-6, 3.3e-6, 6.4e-9, 5.1e-7),
    "PathSim": (1e-6, 1.4e-5, 5e-8, 2.9e-6),
    "Siconos, event-driven": (1e-8, 1.8e-5, 1.8e-5, 3.5e-6),
    "Siconos, Moreau–Jean": (1e-4, 0.5, 1.3e-3, 0.06),
}


@pytest.mark.peers
@EACH_MACHINE
@EACH_SYSTEM
def test_explicit_equations_are_those_of_the_dae(system, machine):
    p = parameters(scene_of(system.layers, machine))
    for state in random_states(seed=7, count=8):
        y, yp, ypp, found = settled(system, state[system.places], p)
        assert found
        differential = y[: system.differential]
        slopes = yp[: system.differential]
        explicit = flow(system, p)
        np.testing.assert_allclose(explicit(TIME, differential), slopes, atol=1e-10 * np.abs(slopes).max())
        if system.algebraic:
            assert guard(system, p)(TIME, differential) == pytest.approx(y[-1], rel=1e-9, abs=1e-9 * abs(y).max())
        # y″ is the derivative of f along the motion, and in time where the supply changes
        along = jacobian(system, p)(TIME, differential) @ slopes
        in_time = central_difference(lambda d, y=differential, f=explicit: f(TIME + d, y), 1e-2)
        second = ypp[: system.differential]
        np.testing.assert_allclose(along + in_time, second, atol=1e-11 * np.abs(second).max())


@pytest.fixture(scope="module")
def case():
    scene = load_reference(REFERENCE, "inelastic-mu02-fe51.5").scene
    return cases.Case("one impact a period", scene.replace({"run.duration_s": 0.8}), "inelastic-mu02-fe51.5")


@pytest.fixture(scope="module")
def exact(case):
    pytest.importorskip("heyoka")
    return cases.truth(case)


def test_each_peer_has_a_setting_here():
    assert {peer.name for peer in PEERS} == set(SETTINGS)


@pytest.mark.peers
@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_peer_finds_the_motion(peer, case, exact):
    if peer.missing:
        pytest.skip(peer.missing)
    setting, coordinates, event_time, force = SETTINGS[peer.name]
    run = peer.prepare(case.scene, setting)
    found = precision.errors(case.scene, run(case.times), exact)
    assert found["coordinates"] < coordinates
    assert found["event_time_s"] < event_time
    assert found["contact_force"] < force
    timed = run(None)
    assert 0.0 < timed.core_s <= timed.wall_s
    assert len(timed.states) == 0
    assert len(timed.rows) == len(exact.rows)


@pytest.mark.peers
def test_oracle_is_the_reference(case, exact):
    found = cases.agreement(case, exact, REFERENCE)
    assert found["events"] == len(exact.rows) == 41
    assert found["event_time_s"] < 1e-12
    assert found["coordinates"] < 1e-11


@pytest.mark.peers
def test_oracle_is_the_reference_on_all_scenes():
    pytest.importorskip("heyoka")
    found = precision.references(REFERENCE, cases.cases(REFERENCE))
    assert list(found["case"]) == ["attached", "one impact a period", "latches, R 0.5"]
    assert (found["event_time_s"] < [1e-12, 1e-12, 2e-11]).all()  # the last motion amplifies errors
    assert (found["coordinates"] < 1e-11).all()


def test_oracle_refuses_a_table_of_other_events(case):
    none = Followed(np.zeros((len(case.times), 14)), ["attached"] * len(case.times))
    with pytest.raises(TableError, match=r"0 events of the oracle, \d+ in the table"):
        cases.agreement(case, none, REFERENCE)


class Bouncing(Legs):
    """An integrator that finds another impact at once."""

    def leg(self, mode, t, y, until):
        end = y.copy()
        end[-2] = -1.0  # gap rate, with two layers
        return straight([y, end], [1e-9], fell=True)


def test_storm_of_a_peer_is_an_error(case):
    scene = case.scene.replace({"contact.restitution": 0.5})
    with pytest.raises(RuntimeError, match="event-storm: 5000 restarts within "):
        follow(scene, Bouncing())


@pytest.mark.peers
def test_peers_share_the_sticking_speed(case):
    contact = {"restitution": 0.5, "sticking_speed_m_per_s": 0.15}
    scene = case.scene.replace({"contact": contact, "run.duration_s": 0.4, "solver.tolerance": 1e-9})
    peer = next(peer for peer in PEERS if peer.name == "scipy DOP853")
    found, expected = peer.prepare(scene, 1e-9)(None).events, simulate(scene, keep="events").events
    assert (expected["gap_rate_after_m_per_s"] > 0.0).any()
    assert (expected["mode_after"] == "attached").any()
    assert list(found["kind"]) == list(expected["kind"])
    assert found["t_s"].to_numpy() == pytest.approx(expected["t_s"].to_numpy(), abs=1e-6)


def test_siconos_refuses_a_sticking_speed(case):
    scene = case.scene.replace({"contact.sticking_speed_m_per_s": 0.15})
    with pytest.raises(RuntimeError, match="Siconos: Newton's impact law has no sticking speed; allowed: 0"):
        siconos.run(scene, "event-driven", 1e-6)


@pytest.mark.peers
def test_failed_run_is_a_row_with_its_reason(case, exact, monkeypatch, capsys):
    def fail(times):
        raise RuntimeError("no step is small enough\nmore of it")

    peer = Peer("failing", (1e-3,), (), lambda scene, setting: fail)
    monkeypatch.setattr(precision, "truth", lambda case: exact)
    table = precision.precision(case, [peer], 1, quick=False)
    assert list(table["failed"]) == ["RuntimeError: no step is small enough"]
    assert "failing at 0.001: RuntimeError: no step is small enough" in capsys.readouterr().out


def test_run_time_at_an_error_is_on_the_line_between_the_fastest_runs():
    errors, times = pd.Series([1e-2, 1e-4, 1e-3, 1e-6, np.nan]), pd.Series([1.0, 2.0, 3.0, 8.0, 0.1])
    assert precision.time_at(errors, times, 1e-3) == pytest.approx(2**0.5)  # the one at 1e-3 is slower than at 1e-4
    assert precision.time_at(errors, times, 1e-5) == pytest.approx(4.0)
    assert precision.time_at(errors, times, 1.0) == 1.0  # all are more accurate
    assert np.isnan(precision.time_at(errors, times, 1e-7))


def test_ratios_are_to_our_own_time(case):
    table = pd.DataFrame(
        {
            "case": case.name,
            "peer": ["vibroplat", "vibroplat", "other", "other"],
            "coordinates": [1e-4, 1e-8, 1e-4, 1e-8],
            "event_time_s": 0.0,
            "ms_per_s": [1.0, 4.0, 10.0, 40.0],
            "core_ms_per_s": [1.0, 4.0, 5.0, 20.0],
            "ms_per_event": [0.1, 0.4, 1.0, 4.0],
        }
    )
    found = precision.at_equal_error(table, [case]).set_index("peer")
    assert found.loc["vibroplat", "coordinates"] == pytest.approx(2.0)
    assert found.loc["other", "coordinates_ratio"] == pytest.approx(10.0)
    assert found.loc["other", "core_ratio"] == pytest.approx(5.0)
    assert found.loc["other", "ms_per_event"] == pytest.approx(2.0)
    assert "event_time_s" not in found  # nothing to compare where all are exact


def test_work_precision_is_drawn(case, tmp_path, figures):
    table = pd.DataFrame(
        {"case": case.name, "peer": ["a", "a", "b"], "coordinates": [1e-3, 1e-5, 1e-4], "ms_per_s": [1.0, 2.0, 3.0]}
    )
    path = plot_precision(table, tmp_path, "peers", SCALED, ["peer"])
    assert path == tmp_path / "peers.png"
    (coordinates,) = figures["peers"].axes
    assert [line.get_xydata().tolist() for line in coordinates.lines] == [[[1e-3, 1.0], [1e-5, 2.0]], [[1e-4, 3.0]]]
    assert (coordinates.get_xscale(), coordinates.get_yscale(), coordinates.xaxis_inverted()) == ("log", "log", True)
    assert [text.get_text() for text in figures["peers"].legends[0].texts] == ["a", "b"]


def test_absence_of_siconos_is_told(monkeypatch):
    monkeypatch.setattr(siconos, "INTERPRETER", ("/no/such/python",))
    assert siconos.available() == "/no/such/python: No such file or directory"
