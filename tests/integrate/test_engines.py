"""Engines and their integrators: agreement, fallback, threads, counters, what is freed."""

import gc
import logging
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from vibroplat import integrate as engines
from vibroplat import simulate
from vibroplat.hybrid.loop import automaton, first_mode
from vibroplat.hybrid.state import NON_FINITE, RUNNING, empty_steps
from vibroplat.integrate.native import NativeEngine, self_check
from vibroplat.integrate.sundials import Library, UnavailableError, library
from vibroplat.model.parameters import parameters
from vibroplat.results.tables import TableFile

COUNTERS = ("steps", "residual_calls", "jacobian_calls", "error_test_failures", "newton_failures", "restarts")


def with_engine(scene, engine):
    return scene.replace({"solver.engine": engine})


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


@pytest.mark.parametrize(("engine", "seconds"), [("native", 0.5), ("taylor", 0.5), ("sundae", 0.05)])
def test_two_threads_give_the_tables_of_one(quickstart, engine, seconds):
    scenes = [
        with_engine(quickstart, engine).replace(
            {"drive.supply_frequency_hz": f, "contact.restitution": r, "run.duration_s": seconds}
        )
        for f, r in ((46.0, 0.0), (51.5, 0.4), (58.0, 0.4))
    ]
    alone, output = [simulate(scene) for scene in scenes], sys.stdout
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(simulate, scenes))
    assert sys.stdout is output
    for one, other in zip(alone, together, strict=True):
        pd.testing.assert_frame_equal(one.trajectory, other.trajectory, check_exact=True)
        pd.testing.assert_frame_equal(one.events, other.events, check_exact=True)
        assert one.summary | {"wall_s": 0.0} == other.summary | {"wall_s": 0.0}


def test_residual_that_is_not_finite_ends_the_run(quickstart):
    scene = with_engine(quickstart.replace({"material.mass_ratio": 0.0, "run.duration_s": 1000.0}), "native")
    p = parameters(scene)
    engine = NativeEngine(scene, p, library())
    h = automaton(scene, p, empty_steps(engine.rows, engine.degree), engine.turns_per_segment)
    first_mode(h)
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


def test_auto_repeats_a_run_by_the_engine_that_can(quickstart, tmp_path):
    """Tables on disk are those of the repeated run alone. A named engine is kept, and the message names the other."""
    changes = {"run.duration_s": 0.06, "run.initial.state.upper_m": 1e9, "material.damping_ratio": 0.05}
    scene = quickstart.replace(changes | {"machine.damping_y_n_s_per_m": 400.0})
    with TableFile(tmp_path, "trajectory", "csv") as rows, TableFile(tmp_path, "events", "csv") as events:
        run = simulate(scene, sink=(rows, events))
        assert (run.outcome, run.summary["engine"]) == ("ok", "taylor")
        table = pd.read_csv(rows.finish())
        assert len(pd.read_csv(events.finish())) == run.summary["events"]
    assert table["t_s"].tolist() == run.trajectory["t_s"].tolist()
    named = simulate(with_engine(scene, "native"), keep="summary")
    assert named.outcome == "solver-failure"
    assert " s; solver.engine = taylor may succeed, state [" in named.summary["detail"]


def test_integrator_that_gets_stuck_is_stopped(quickstart, monkeypatch):
    monkeypatch.setattr("vibroplat.integrate.interface.MAX_STEPS", 10)
    monkeypatch.setattr("vibroplat.integrate.interface.STEPS_PER_EVENT", 0)
    run = simulate(with_engine(quickstart, "native"))
    assert run.outcome == "solver-failure"
    assert run.summary["detail"].startswith("SUNDIALS: more than 10 steps within a period; mode attached, t = ")
    assert len(run.trajectory) > 1


def test_steps_that_are_taken_back_count_too_where_a_motion_is_stuck(quickstart, monkeypatch):
    """Nearly all are, of a mass so large that its rates are round-off."""
    monkeypatch.setattr("vibroplat.integrate.interface.MAX_STEPS", 3000)
    monkeypatch.setattr("vibroplat.integrate.interface.STEPS_PER_EVENT", 0)
    run = simulate(with_engine(quickstart, "taylor").replace({"machine.platform_mass_kg": 1e30}))
    assert run.summary["detail"].startswith("taylor: more than 3000 steps within a period; mode attached, t = ")
    assert run.summary["error_test_failures"] > 1000
    assert run.summary["steps"] <= 3001


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
    "configuration": (f"{LIBRARY}package", lambda: Path("nowhere"), "scikit-sundae does not report its configuration"),
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
    """Whatever asks for it, and from whichever thread."""
    monkeypatch.setattr(target, value)
    scene = quickstart.replace({"run.duration_s": 0.02})
    scenes = [with_engine(scene, asked) for asked in ("auto", "native")]
    with caplog.at_level(logging.WARNING, logger="vibroplat"), ThreadPoolExecutor(2) as pool:
        assert [run.summary["engine"] for run in pool.map(simulate, scenes)] == ["sundae", "sundae"]
    assert len(caplog.records) == 1
    notice = caplog.records[0].getMessage()
    assert notice.startswith("engine native is not available: ")
    assert reason in notice
    assert notice.endswith("; engine sundae is used instead and is ten to twenty times slower")


def test_self_check_notices_a_library_that_does_not_integrate():
    class Spoiled(Library):
        """What is taken for its solver returns at once without an error."""

        def address(self, name):
            return super().address({"IDASolve": "IDAGetNumErrTestFails"}.get(name, name))

    self_check(library())
    with pytest.raises(UnavailableError, match=r"it fails the self-check \(error "):
        self_check(Spoiled())
