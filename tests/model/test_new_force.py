"""What it takes to add forces: four of them in a copy of the package.

They are a viscous drag between platform and lower layer in flight, a cubic spring on y, springs beside the centre of
mass, which couple x and φ, and a torque curve that is another rational function of the slip speed.

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

from vibroplat import load_config, orbit, simulate, variation
from vibroplat.config.sections import Contact
from vibroplat.hybrid.state import static_rest
from vibroplat.model.systems import GAP, GAP_RATE

from . import helpers, test_energy, test_equations, test_jacobians, test_series

#: Keys of the forces, and their coefficients: b_g (N·s/m), c_3 (N/m³), c_xφ (N/rad), by how much the torque is bent
#: (1/s).
KEYS = {
    "contact.gap_damping_n_s_per_m": 20.0,
    "contact.cubic_stiffness_n_per_m3": 3.0e9,
    "contact.coupling_n_per_rad": 1.5e4,
    "contact.torque_bend_per_s": 0.3,
}
FIELDS = dict(zip(("gap_damping", "cubic", "coupling", "bend"), KEYS.values(), strict=True))

#: What is added, by files, and the line before which it stands.
ADDED = {
    "vibroplat/config/sections.py": {
        "    added_mass_share: Fraction = described(": [
            f'    {key.partition(".")[2]}: NonNegative = described(0.0, "{field}", "a force that is new")'
            for key, field in zip(KEYS, FIELDS, strict=True)
        ]
    },
    "vibroplat/model/parameters.py": {
        '        ("lower_mass", float),  # m_w1 (kg)': [f'        ("{field}", float),' for field in FIELDS],
        '        "restitution": scene': [
            f'        "{field}": scene.{key},' for key, field in zip(KEYS, FIELDS, strict=True)
        ],
    },
    "vibroplat/model/source.py": {
        "    return torque": [
            "    torque = torque + p.direction * (p.bend * slip) / (critical * critical + 4.0 * slip * slip)",
        ],
        "    return Holds(": [
            "    hold_gap = hold_gap + p.gap_damping * v.gap",
            "    hold_y = hold_y + p.cubic * (q.y * q.y * q.y)",
            "    hold_x, hold_phi = hold_x + p.coupling * q.phi, hold_phi + p.coupling * q.x",
        ],
    },
}
#: Pages that a command writes.
PAGES = {"configuration": ("schema", "--markdown"), "columns": ("columns",)}

#: Files to touch, at most.
FILES = 6


def line_of(copy, *arguments):
    environment = os.environ | {"PYTHONPATH": f"{copy}{os.pathsep}{copy / 'tests'}"}
    done = subprocess.run([sys.executable, *arguments], cwd=copy, env=environment, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout.decode()


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A copy of the package with the forces."""
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
    assert sum(new.values()) <= 5 * len(KEYS) + 4


@pytest.mark.long
def test_added_force_acts_in_all_that_is_made_of_forces(extended):
    """The copy judges itself; without the forces its numbers are those of the package.

    They are so to the last bit, but for the work of the motors: with one term more, products are added unrounded in
    another order; and for the extremes of the force along y: of a force that is not linear there is no polynomial.
    """
    found, expected = json.loads(line_of(extended, "-m", "model.test_new_force")), numbers()
    for engine in ("taylor", "native"):
        work = float(expected[f"{engine} motor_work_j"])
        for name in ("motor_work_j", "energy_residual_j", "energy_residual"):
            one, other = found.pop(f"{engine} {name}"), expected.pop(f"{engine} {name}")
            assert float(one) == pytest.approx(float(other), rel=0.0, abs=1e-14 * work)
    for name in [name for name in expected if "foundation_force_y" in name]:
        assert float(found.pop(name)) == pytest.approx(float(expected.pop(name)), rel=1e-9)
    assert found == expected


def scene_with(engine, forces=None, **changes):
    scene = load_config(ROOT / "configs/paper/f30.7-mu0.2-R0.3.yaml")
    return scene.replace({"solver.engine": engine, "run.duration_s": 0.5} | (forces or {}) | changes)


def numbers(forces=None):
    """Summaries of motions with both engines that make steps here; times apart, and the drag's work, which is new."""
    runs = {engine: simulate(scene_with(engine, forces)).summary for engine in ("taylor", "native")}
    return {
        f"{engine} {name}": repr(value)
        for engine, summary in runs.items()
        for name, value in summary.items()
        if name not in ("wall_s", "damping_gap_work_j")
    }


def added_to(state, p, scene):
    """Generalized forces that are new, in the order of the full state's coordinates."""
    force = np.zeros(7)
    force[0] = -FIELDS["coupling"] * state[2]
    force[1] = -FIELDS["cubic"] * state[1] ** 3
    force[2] = -FIELDS["coupling"] * state[0]
    force[GAP] = -FIELDS["gap_damping"] * state[GAP_RATE]
    for i in (0, 1):
        elapsed = helpers.TIME - p.since
        slip = p.speed[i] + p.speed_ramp[i] * elapsed - p.direction[i] * state[10 + i]
        critical = p.slip_speed[i] + p.slip_ramp[i] * elapsed
        torque = p.direction[i] * FIELDS["bend"] * slip / (critical**2 + 4.0 * slip**2)
        force[3 + i] = torque
        force[2] -= p.deck[i] * torque
    return force


def check_equations():
    """Lagrange's equations with the forces; then the judges of Jacobians, series and energies."""

    def changed(layers, machine):
        p = of_package(layers, machine)
        for field, value in FIELDS.items():
            p[field] = value
        return p

    of_package = helpers.record_of
    for module in (test_jacobians, test_series):
        module.record_of = changed
    for system, machine in helpers.PAIRS:
        scene, p = helpers.scene_of(system.layers, machine), changed(system.layers, machine)
        n = system.differential // 2
        for full in helpers.random_states(seed=1, count=8):
            state = system.full(system.unknowns(full))
            y, yp, _, _ = helpers.settled(system, state[system.places], p)
            wanted = test_equations.expected(system, state, scene, added_to(state, p, scene))
            got = np.append(yp[n : 2 * n], y[2 * n :])
            assert np.abs(got - wanted).max() < 1e-10 * np.abs(wanted).max()
        test_jacobians.test_jacobian_is_that_of_the_residual(system, machine)
        test_jacobians.test_next_derivative_is_that_along_the_motion(system, machine)
        test_jacobians.test_linearized_accelerations_are_those_of_the_state(system, machine)
        test_series.test_series_is_the_motion(system, machine)
        check_energy(system, p)
        test_energy.check_foundation(p)


def check_energy(system, p):
    """Energies change by powers alone, momentum by forces."""
    for state in test_energy.states_of(system, seed=7):
        rates, (power, force, size) = test_energy.rates_of(system, state, p), test_energy.powers_of(state, p)
        losses = sum(value for name, value in power.items() if name.startswith(("damping", "resistance")))
        energies = rates[: test_energy.MOMENTUM]
        unexplained = energies.sum() - (power["motor"] + power["truncation"] - losses)
        assert abs(unexplained) < 1e-8 * np.max(np.abs([*energies, *power.values()]))
        assert rates[test_energy.MOMENTUM] == pytest.approx(force, abs=1e-7 * max(size, abs(state[10:12]).max()))


def check_motions():
    """The engines agree, the energy is kept, and the drag takes a good part of it."""
    runs = [simulate(scene_with(engine, KEYS, **{"solver.tolerance": 1e-10})) for engine in ("taylor", "native")]
    without = simulate(scene_with("taylor", **{"solver.tolerance": 1e-10}))
    times = np.linspace(0.0, 0.5, 101)
    first, second, free = (run(times)["y_m"].to_numpy() for run in (*runs, without))
    size = np.abs(first).max()
    assert np.abs(first - second).max() < 1e-6 * size < 1e-3 * np.abs(first - free).max()
    for run in runs:
        check_loads(run)
        assert run.summary["flight_fraction"] > 0.1
        assert run.summary["energy_residual"] < 1e-6
        assert run.summary["momentum_residual"] < 1e-6
        assert run.summary["damping_gap_work_j"] > 1e-3 * run.summary["motor_work_j"]


def feeder_with(engine):
    """A feeder on a slope with transport, and the forces as large as its softer springs take."""
    sizes = KEYS | {"contact.cubic_stiffness_n_per_m3": 1e8, "contact.coupling_n_per_rad": 400.0}
    changes = {"transport.deck_angle_deg": 5.0, "run.duration_s": 0.5, "solver.tolerance": 1e-9}
    return load_config(ROOT / "configs/examples/conveying.yaml", {"solver.engine": engine} | changes | sizes)


def check_transport():
    """With transport the engines agree too, and the momentum along the deck is kept."""
    runs, times = [simulate(feeder_with(engine)) for engine in ("taylor", "native")], np.linspace(0.0, 0.5, 101)
    for name in ("x_m", "y_m", "phi_rad"):
        first, second = (run(times)[name].to_numpy() for run in runs)
        assert np.abs(first - second).max() < 1e-6 * np.abs(first).max()
    for run in runs:
        residuals = (run.summary[name] for name in ("energy_residual", "momentum_residual", "momentum_along_residual"))
        assert max(residuals) < 1e-6
        assert run.summary["flight_fraction"] > 0.1


def check_rest():
    """The springs hold the weight, on a slope as well, where x and φ share the load."""
    for scene in (scene_with("taylor", KEYS), feeder_with("taylor")):
        state, machine, (slope, gravity) = static_rest(scene), scene.machine, scene.gravity
        material = sum(scene.layer_masses)
        weight, height = scene.platform_mass + material, scene.transport.deck_height_m if scene.transport else 0.0
        x, y, phi = state[:3]
        coupling = scene.contact.coupling_n_per_rad
        springs = (
            machine.stiffness_x_n_per_m * x + coupling * phi,
            machine.stiffness_y_n_per_m * y + scene.contact.cubic_stiffness_n_per_m3 * y**3,
            machine.stiffness_phi_n_m_per_rad * phi + coupling * x,
        )
        loads = weight * slope, -weight * gravity, -height * material * slope
        assert springs == pytest.approx(loads, rel=1e-12, abs=1e-12 * weight * gravity)
        assert abs(y) < 0.9999 * weight * gravity / machine.stiffness_y_n_per_m


def check_loads(run):
    """Largest forces into the foundation and torques, over the whole run, are those of dense samples."""
    machine, suspended = run.scene.machine, run(np.linspace(0.0, run.scene.run.duration_s, 200_001))
    x, y, phi = (suspended[name] for name in ("x_m", "y_m", "phi_rad"))
    rates = (suspended[name] for name in ("x_rate_m_per_s", "y_rate_m_per_s", "phi_rate_rad_per_s"))
    dampings = machine.damping_x_n_s_per_m, machine.damping_y_n_s_per_m, machine.damping_phi_n_m_s_per_rad
    damped = [damping * rate for damping, rate in zip(dampings, rates, strict=True)]
    pulls = {
        "foundation_force_x_max_n": machine.stiffness_x_n_per_m * x + FIELDS["coupling"] * phi + damped[0],
        "foundation_force_y_max_n": machine.stiffness_y_n_per_m * y + FIELDS["cubic"] * y**3 + damped[1],
        "foundation_moment_max_n_m": machine.stiffness_phi_n_m_per_rad * phi + FIELDS["coupling"] * x + damped[2],
    }
    for i in (1, 2):
        pulls[f"motor_power_{i}_max_w"] = suspended[f"motor_power_{i}_w"]
        pulls[f"motor_torque_{i}_max_n_m"] = suspended[f"motor_power_{i}_w"] / suspended[f"phi{i}_rate_rad_per_s"]
    for name, pull in pulls.items():
        assert run.summary[f"whole_{name}"] == pytest.approx(pull.abs().max(), rel=1e-7), name


def check_derivatives():
    """The derivative over an orbit is that of motions beside it, and has its multipliers."""
    scene = scene_with("taylor", KEYS, **{"solver.tolerance": 1e-11, "run.perturbation": 0.0})
    found = orbit(scene, tolerance=1e-9)
    derivative = variation(found.scene, found.state, found.period_s).derivative.to_numpy()
    sizes, numerical = np.array(scene.state_scales), np.zeros((14, 14))
    for j in range(14):
        ends = [end_of(found, j, side * 1e-6 * sizes[j]) for side in (1.0, -1.0)]
        numerical[:, j] = (ends[0] - ends[1]) / (2e-6 * sizes[j])
    scaled, expected = (matrix * sizes / sizes[:, np.newaxis] for matrix in (derivative, numerical))
    assert np.abs(scaled - expected).max() < 1e-7 * np.abs(expected).max()
    multipliers = sorted([1.0, *np.abs(found.multipliers)])
    assert sorted(np.abs(np.linalg.eigvals(expected))) == pytest.approx(multipliers, abs=1e-7 * multipliers[-1])


def end_of(found, j, change):
    """End of the orbit's motion where one number of its state is changed."""
    state = np.array(found.state)
    state[j] += change
    return variation(found.scene, state, found.period_s).state.to_numpy()


if __name__ == "__main__":
    assert {key.rpartition(".")[2] for key in KEYS} <= set(Contact.model_fields)
    assert Path(sys.modules["vibroplat"].__file__).parents[1] == ROOT
    check_equations()
    check_motions()
    check_transport()
    check_rest()
    check_derivatives()
    print(json.dumps(numbers(dict.fromkeys(KEYS, 0.0))))
