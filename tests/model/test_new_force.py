"""What it takes to add a force: a viscous drag between platform and lower layer, in flight, in a copy of the package.

This file is the test, and what runs in a process of its own with the copy.
"""

import difflib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from common.places import ROOT

from vibroplat import load_config, simulate
from vibroplat.config.sections import Contact
from vibroplat.model.systems import GAP, GAP_RATE

from . import helpers, test_energy, test_equations, test_jacobians, test_series

KEY, DRAG = "contact.gap_damping_n_s_per_m", 20.0

#: What is added, by files: the line before which it stands or, where that is a literal zero, which it replaces.
ADDED = {
    "vibroplat/config/sections.py": {
        "    added_mass_share: Fraction = described(": [
            '    gap_damping_n_s_per_m: NonNegative = described(0.0, "b_g", "drag of the lower layer in flight")'
        ]
    },
    "vibroplat/model/parameters.py": {
        '        ("lower_mass", float),  # m_w1 (kg)': ['        ("gap_damping", float),  # b_g (N·s/m)'],
        '        "restitution": scene': ['        "gap_damping": scene.contact.gap_damping_n_s_per_m,'],
    },
    "vibroplat/model/springs.py": {
        "        0.0,\n": ["        p.gap_damping * v[3],"],
        '    "damping_layers": (4': ['    "damping_gap": (3, "drag between platform and lower layer"),'],
    },
}
#: Pages that a command writes.
PAGES = {"configuration": ("schema", "--markdown"), "columns": ("columns",)}

#: Files to touch, at most.
FILES = 7


def line_of(copy, *arguments):
    environment = os.environ | {"PYTHONPATH": f"{copy}{os.pathsep}{copy / 'tests'}"}
    done = subprocess.run([sys.executable, *arguments], cwd=copy, env=environment, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A copy of the package with the drag."""
    copy = tmp_path_factory.mktemp("copy")
    for name in ("vibroplat", "tests", "configs", "results"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__", "*.parquet"))
    for name, places in ADDED.items():
        text = (copy / name).read_text(encoding="utf-8")
        for before, lines in places.items():
            assert text.count(before) == 1, before
            added = "".join(f"{line}\n" for line in lines)
            text = text.replace(before, added if before.endswith("\n") else added + before)
        (copy / name).write_text(text, encoding="utf-8")
    for page, arguments in PAGES.items():
        (copy / "results" / f"{page}.md").write_text(line_of(copy, "-m", "vibroplat", *arguments), encoding="utf-8")
    return copy


def changes(copy):
    """Number of lines that are new in each file of the copy."""
    new = {}
    for file in sorted(f for name in ("vibroplat", "results") for f in (copy / name).rglob("*") if f.is_file()):
        name = file.relative_to(copy).as_posix()
        if file.suffix in (".py", ".md") and file.read_bytes() != (ROOT / name).read_bytes():
            texts = [(folder / name).read_text(encoding="utf-8").splitlines() for folder in (ROOT, copy)]
            new[name] = sum(line.startswith("+ ") for line in difflib.ndiff(*texts))
    return new


@pytest.mark.long
def test_a_force_is_written_once(extended):
    new = changes(extended)
    assert set(new) == {*ADDED, *(f"results/{page}.md" for page in PAGES)}
    assert len(new) <= FILES
    assert sum(new.values()) <= 7


@pytest.mark.long
def test_added_force_acts_in_all_that_is_made_of_forces(extended):
    """The copy judges itself; without drag its numbers are those of the package, to the last bit."""
    assert json.loads(line_of(extended, "-m", "model.test_new_force")) == numbers()


def scene_with(engine, drag=None, **changes):
    scene = load_config(ROOT / "configs/paper/f30.7-mu0.2-R0.3.yaml")
    drags = {} if drag is None else {KEY: drag}
    return scene.replace({"solver.engine": engine, "run.duration_s": 0.5} | drags | changes)


def numbers(drag=None):
    """Summaries of motions with both engines that make steps here; times apart, and the drag's work, which is new."""
    runs = {engine: simulate(scene_with(engine, drag)).summary for engine in ("taylor", "native")}
    return {
        f"{engine} {name}": repr(value)
        for engine, summary in runs.items()
        for name, value in summary.items()
        if name not in ("wall_s", "damping_gap_work_j")
    }


def check_equations():
    """Lagrange's equations with b_g ġ²/2 in Rayleigh's function; then the judges of Jacobians, series and energies."""

    def dragged(layers, machine):
        p = of_package(layers, machine)
        p["gap_damping"] = DRAG
        return p

    of_package = helpers.record_of
    for module in (test_energy, test_jacobians, test_series):
        module.record_of = dragged
    for system, machine in helpers.PAIRS:
        scene, p, n = (
            helpers.scene_of(system.layers, machine),
            dragged(system.layers, machine),
            system.differential // 2,
        )
        for full in helpers.random_states(seed=1, count=8):
            state = system.full(system.unknowns(full))
            y, yp, _, _ = helpers.settled(system, state[system.places], p)
            force = np.zeros(7)
            force[GAP] = -DRAG * state[GAP_RATE]
            wanted = test_equations.expected(system, state, scene, force)
            got = np.append(yp[n : 2 * n], y[2 * n :])
            assert np.abs(got - wanted).max() < 1e-11 * np.abs(wanted).max()
        test_jacobians.test_jacobian_is_that_of_the_residual(system, machine)
        test_jacobians.test_next_derivative_is_that_along_the_motion(system, machine)
        test_jacobians.test_linearized_accelerations_are_those_of_the_state(system, machine)
        test_series.test_series_is_the_motion(system, machine)
        test_energy.test_energy_and_momentum_change_by_powers_and_forces_alone(system, machine)


def check_motions():
    """The engines agree, the energy is kept, and the drag takes a good part of it."""
    runs = [simulate(scene_with(engine, DRAG, **{"solver.tolerance": 1e-10})) for engine in ("taylor", "native")]
    without = simulate(scene_with("taylor", 0.0, **{"solver.tolerance": 1e-10}))
    times = np.linspace(0.0, 0.5, 101)
    first, second, free = (run(times)["y_m"].to_numpy() for run in (*runs, without))
    size = np.abs(first).max()
    assert np.abs(first - second).max() < 1e-6 * size < 1e-3 * np.abs(first - free).max()
    for run in runs:
        assert run.summary["flight_fraction"] > 0.1
        assert run.summary["energy_residual"] < 1e-6
        assert run.summary["damping_gap_work_j"] > 1e-3 * run.summary["motor_work_j"]


if __name__ == "__main__":
    assert KEY.rpartition(".")[2] in Contact.model_fields
    assert Path(sys.modules["vibroplat"].__file__).parents[1] == ROOT
    check_equations()
    check_motions()
    print(json.dumps(numbers(0.0)))
