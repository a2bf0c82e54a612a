"""Engines and their integrators: agreement, fallback, threads, counters, what is freed."""

from __future__ import annotations

import gc
import logging
import resource
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracle import REFERENCE

from vibroplat import integrate as engines
from vibroplat import load_config, simulate
from vibroplat.bench.measure import compared_events, coordinate_errors, event_errors
from vibroplat.hybrid.loop import automaton, first_mode
from vibroplat.hybrid.state import NON_FINITE, RUNNING, no_steps
from vibroplat.integrate.native import NativeEngine, self_check
from vibroplat.integrate.sundials import Library, UnavailableError, library
from vibroplat.model.parameters import parameters

COUNTERS = ("steps", "residual_calls", "jacobian_calls", "error_test_failures", "newton_failures", "restarts")


def with_engine(scene, engine):
    return scene.replace({"solver.engine": engine})


# -- agreement ------------------------------------------------------------------------------------------

#: Errors over tolerance, for lengths in units of the scale 2k/M, angles in rad, event times over 1/ω₀, of a
#: work–precision run over 1e-4 … 1e-12: 3400 where errors grow from impact to impact. Then what remains at 1e-14, where
#: errors are round-off: those of the reference tables, of sums over hundreds of steps, and where the motion amplifies
#: them, what it makes of that.
GROWN = {
    "attached-mu01-fe46": (0.26, 6.5e-13),
    "bare-printed-fe60": (33.0, 5.1e-12),
    "inelastic-mu02-fe51.5": (3.6, 1.5e-12),
    "onelayer-R03-mu01-fe48": (71.0, 2.2e-12),
    "restitution05-mu02-fe51.5": (3400.0, 4e-10),
}


@pytest.mark.parametrize("tolerance", [1e-6, 1e-14])
@pytest.mark.parametrize("name", GROWN)
def test_errors_of_a_series_follow_the_tolerance_to_round_off(name, tolerance):
    """Within ten times what the motion makes of its tolerance and three times what remains."""
    scene = with_engine(load_config(REFERENCE / f"{name}.yaml"), "taylor").replace({"solver.tolerance": tolerance})
    run = simulate(scene)
    trajectory, events = (pd.read_csv(REFERENCE / f"{name}.{kind}.csv") for kind in ("trajectory", "events"))
    scales = dict.fromkeys(("x_m", "y_m", "gap_m", "upper_m"), scene.length_scale)
    errors = {of: error / scales.get(of, 1.0) for of, error in coordinate_errors(run, trajectory).items()}
    errors["event_time_s"] = event_errors(run.events, events)["event_time_s"] * scene.speed_scale
    grown, remains = GROWN[name]
    for quantity, error in errors.items():
        assert error <= 10.0 * grown * tolerance + 3.0 * remains, quantity


def test_engines_of_sundials_agree_event_by_event():
    scene = load_config(REFERENCE / "onelayer-R03-mu01-fe48.yaml").replace({"solver.tolerance": 1e-9})
    mine, theirs = (compared_events(simulate(with_engine(scene, e)).events) for e in ("native", "sundae"))
    assert list(mine["kind"]) == list(theirs["kind"])
    assert (mine["t_s"] - theirs["t_s"]).abs().max() <= 2e-7
    impacts = mine["kind"] == "impact"
    for column in ("gap_rate_before_m_per_s", "impulse_n_s"):
        values, expected = mine[column][impacts], theirs[column][impacts]
        assert (np.abs(values - expected) <= 1e-5 * np.abs(expected).max()).all()


def test_a_scene_without_a_guard_is_integrated_in_one_piece(quickstart):
    scene = quickstart.replace({"contact.model": "non-impact", "run.duration_s": 10.0})
    run = simulate(with_engine(scene, "native"))
    assert run.summary["restarts"] == 1
    assert (run.trajectory["t_s"].diff().dropna() > 0.0).all()


@pytest.mark.parametrize("engine", ["native", "taylor", pytest.param("sundae", marks=pytest.mark.long)])
def test_a_run_may_end_at_an_event(quickstart, engine):
    scene = with_engine(quickstart.replace({"contact.restitution": 0.4, "run.duration_s": 0.2}), engine)
    for t in simulate(scene).events["t_s"][:6]:
        for end in (np.nextafter(t, 0.0), t, np.nextafter(t, 1.0)):
            run = simulate(scene.replace({"run.duration_s": float(end)}))
            assert (run.outcome, run.summary["simulated_s"]) == ("ok", end)


@pytest.mark.parametrize(("name", "rows"), [("native", 8), ("sundae", 20), ("taylor", 8)])
def test_pieces_of_a_few_steps_do_not_show(quickstart, monkeypatch, name, rows):
    """Room for a few steps cuts a run into many pieces; nothing but round-off of sums tells."""
    changes = {"contact.restitution": 0.5, "run.duration_s": 0.5, "solver.tolerance": 1e-8}
    scene = with_engine(quickstart.replace(changes), name)
    whole = simulate(scene)
    monkeypatch.setattr(f"vibroplat.integrate.{name}.{name.capitalize()}Engine.rows", rows)
    cut = simulate(scene)
    assert len(cut.segments) > len(whole.segments)
    pd.testing.assert_frame_equal(cut.events, whole.events, check_exact=True)
    pd.testing.assert_frame_equal(cut.trajectory, whole.trajectory, check_exact=False, rtol=1e-12, atol=1e-12)
    assert set(cut.summary) == set(whole.summary)
    for key, value in whole.summary.items():
        same = value is None or isinstance(value, str | int)
        assert key == "wall_s" or cut.summary[key] == (value if same else pytest.approx(value, rel=1e-12, abs=1e-12))


# -- counters, work, memory -----------------------------------------------------------------------------


def test_work_is_counted(quickstart):
    summary = simulate(with_engine(quickstart, "native"), keep="summary").summary
    assert all(isinstance(summary[name], int) for name in COUNTERS)
    assert summary["steps"] + summary["error_test_failures"] < summary["residual_calls"]
    assert 0 < summary["jacobian_calls"] < summary["steps"]
    through_python = simulate(with_engine(quickstart, "sundae"), keep="summary").summary
    assert through_python["steps"] > 0
    assert through_python["error_test_failures"] is None


def test_every_handle_is_freed(quickstart, monkeypatch):
    """Each object that SUNDIALS makes goes back to its own function, vectors and solvers before the context."""
    found, calls = library(), []
    made = {"N_VMake_Serial": 5, "SUNDenseMatrix": 2, "SUNLinSol_Dense": 2, "IDACreate": 2}
    frees = ("N_VDestroy", "SUNMatDestroy", "SUNLinSolFree", "IDAFree", "SUNContext_Free")

    def watched(name):
        function = found._functions[name]

        def call(*arguments):
            calls.append(name)
            return function(*arguments)

        return call

    monkeypatch.setattr(found, "address", {name: found.address(name) for name in found._functions}.get)
    monkeypatch.setattr(found, "_functions", found._functions | {name: watched(name) for name in (*made, *frees)})
    scene = with_engine(quickstart, "native")
    NativeEngine(scene, parameters(scene), found).close()
    assert {name: calls.count(name) for name in made} == made
    assert sum(calls.count(name) for name in frees) == sum(made.values()) + 1
    assert calls[-1] == "SUNContext_Free"
    # an engine that nobody closes is freed with its object
    engine = NativeEngine(scene, parameters(scene), found)
    calls.clear()
    del engine
    gc.collect()
    assert len(calls) == 12


@pytest.mark.long
@pytest.mark.parametrize("engine", ["native", "taylor"])
def test_engines_leave_no_memory_behind(quickstart, engine):
    scene = with_engine(quickstart, engine).replace({"run.duration_s": 1e-3})
    for _ in range(200):
        simulate(scene, keep="summary")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(1000):
        simulate(scene, keep="summary")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1024  # KiB


@pytest.mark.parametrize("engine", ["native", "taylor"])
def test_two_threads_give_the_tables_of_one(quickstart, engine):
    scenes = [
        with_engine(quickstart, engine).replace(
            {"drive.supply_frequency_hz": f, "contact.restitution": r, "run.duration_s": 0.5}
        )
        for f, r in ((46.0, 0.0), (51.5, 0.4), (58.0, 0.4))
    ]
    alone = [simulate(scene) for scene in scenes]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(simulate, scenes))
    for one, other in zip(alone, together, strict=True):
        pd.testing.assert_frame_equal(one.trajectory, other.trajectory, check_exact=True)
        pd.testing.assert_frame_equal(one.events, other.events, check_exact=True)
        assert one.summary | {"wall_s": 0.0} == other.summary | {"wall_s": 0.0}


def test_threads_of_sundae_leave_standard_output_alone(quickstart):
    scene = with_engine(quickstart.replace({"run.duration_s": 0.05}), "sundae")
    before = sys.stdout
    with ThreadPoolExecutor(2) as pool:
        tables = [run.trajectory for run in pool.map(simulate, [scene] * 6)]
    assert sys.stdout is before
    for table in tables[1:]:
        pd.testing.assert_frame_equal(table, tables[0], check_exact=True)


# -- failures -------------------------------------------------------------------------------------------


def ready(scene):
    """Return an engine and the automaton of a scene, about to take its first step."""
    p = parameters(scene)
    engine = NativeEngine(scene, p, library())
    h = automaton(scene, p, no_steps(engine.rows, engine.degree), engine.turns_per_segment)
    first_mode(h)
    return engine, h


def test_residual_that_is_not_finite_ends_the_run(quickstart):
    scene = with_engine(quickstart.replace({"material.mass_ratio": 0.0, "run.duration_s": 1000.0}), "native")
    engine, h = ready(scene)
    engine.advance(h)
    assert h.run["outcome"] == RUNNING
    engine._p["gravity"] = np.nan
    reached, state = float(h.run["now"]), h.run["state"].copy()
    engine.advance(h)
    assert h.run["outcome"] == NON_FINITE
    assert engine.detail == "the residual is not finite"
    assert h.steps.used["steps"] == 0
    assert h.run["now"] == reached
    assert (h.run["state"] == state).all()
    assert np.isfinite(state).all()
    engine.close()


def test_integrator_that_gets_stuck_is_stopped(quickstart, monkeypatch):
    monkeypatch.setattr("vibroplat.integrate.native.MAX_STEPS", 10)
    monkeypatch.setattr("vibroplat.integrate.native.STEPS_PER_EVENT", 0)
    run = simulate(with_engine(quickstart, "native"))
    assert run.outcome == "solver-failure"
    assert run.summary["detail"].startswith("SUNDIALS: more than 10 steps within a period; mode attached, t = ")
    assert len(run.trajectory) > 1


@pytest.fixture
def fresh_choice():
    """Let engine ``native`` be looked for anew, and again after the test."""
    engines.native_library.cache_clear()
    library.cache_clear()
    yield
    engines.native_library.cache_clear()
    library.cache_clear()


LIBRARY = "vibroplat.integrate.sundials."
TYPES = "its number types are {}; known: double, int"
BREAKAGES = {
    "symbol": (f"{LIBRARY}_FUNCTIONS", {"IDANoSuchFunction": "ip"}, "SUNDIALS function IDANoSuchFunction is missing"),
    "configuration": (f"{LIBRARY}package", lambda: Path("nowhere"), "scikit-sundae does not tell its configuration"),
    "extension module": (f"{LIBRARY}EXTENSION_SUFFIXES", [], "scikit-sundae has no _cy_ida"),
    "version": (f"{LIBRARY}_MAJOR", "6.", "is not known; known: 6.x"),
    "types": (f"{LIBRARY}_TYPES", {"SUNDIALS_INT_TYPE": "long"}, TYPES.format("int")),
    "module": (f"{LIBRARY}_TYPES", {"NO_SUCH_NAME": ""}, TYPES.format("None")),
    "linear solver": (
        "vibroplat.integrate.native._SOLVER_WORDS",
        2,
        "SUNLinSolSetup_Dense is not found among the operations of its dense linear solver",
    ),
}


@pytest.mark.parametrize(("target", "value", "reason"), BREAKAGES.values(), ids=BREAKAGES)
def test_sundae_takes_over_with_one_notice(quickstart, monkeypatch, caplog, fresh_choice, target, value, reason):
    monkeypatch.setattr(target, value)
    scene = quickstart.replace({"run.duration_s": 0.02})
    with caplog.at_level(logging.WARNING, logger="vibroplat"):
        runs = [simulate(with_engine(scene, asked), keep="summary") for asked in ("auto", "native")]
    assert [run.summary["engine"] for run in runs] == ["sundae", "sundae"]
    assert len(caplog.records) == 1
    notice = caplog.records[0].getMessage()
    assert notice.startswith("engine native is not available: ")
    assert reason in notice
    assert notice.endswith("; engine sundae takes over, ten to twenty times slower")


class Spoiled(Library):
    """A library that does not integrate: what is taken for its solver returns at once without an error."""

    def address(self, name):
        return super().address({"IDASolve": "IDAGetNumErrTestFails"}.get(name, name))


def test_threads_share_one_notice(quickstart, monkeypatch, caplog, fresh_choice):
    monkeypatch.setattr("vibroplat.integrate.sundials._MAJOR", "6.")
    scene = quickstart.replace({"run.duration_s": 0.01})
    with caplog.at_level(logging.WARNING, logger="vibroplat"), ThreadPoolExecutor(4) as pool:
        list(pool.map(simulate, [scene] * 4))
    assert len(caplog.records) == 1


def test_self_check_notices_a_library_that_does_not_integrate():
    self_check(library())
    with pytest.raises(UnavailableError, match=r"it fails the self-check \(error "):
        self_check(Spoiled())
