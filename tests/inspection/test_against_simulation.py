"""How often an inspection is right: random machines, the sweep of the quickstart, starts through a resonance.

``python -m pytest -m campaign tests/inspection -s`` prints the shares that ``results/method.md``
tells; half an hour.
"""

import numpy as np
import pytest

from inspection.machines import STARTS as FROM_REST
from inspection.machines import machine, rocking, settled
from vibroplat import find, load_config, simulate, sweep
from vibroplat.config.reader import configurations
from vibroplat.inspection.linear import natural_speeds

pytestmark = pytest.mark.campaign
CONFIGS = configurations()
MACHINES = 100

RAMP = [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 3.0, "supply_frequency_hz": 66.0}]
#: Starts of an example: with other damping, in 0.7 s, and in 10 s.
STARTS = {
    "threshold-torque": {},
    "damping": {"machine.damping_y_n_s_per_m": 200.0},
    "little damping": {"machine.damping_y_n_s_per_m": 70.0},
    "fast": {"drive.program": [RAMP[0], {"t_s": 0.7, "supply_frequency_hz": 66.0}]},
    "slow": {"drive.program": [RAMP[0], {"t_s": 10.0, "supply_frequency_hz": 66.0}]},
}
#: Other machines: their files and changes, keys of the motors' sizes, a speed that is passed (Hz) and a duration (s).
OTHERS = {
    "40 kg": (
        "examples/threshold-torque",
        {
            "machine.platform_mass_kg": 40.0,
            "machine.stiffness_y_n_per_m": 1.5e6,
            "machine.damping_y_n_s_per_m": 250.0,
            "machine.rotor_inertia_kg_m2": 2e-3,
            "machine.unbalance_mass_kg": 0.09,
        },
        ["motor.critical_torque_n_m"],
        31.5,
        15.0,
    ),
    "screen on stiff springs": (
        "templates/screen",
        {
            "machine.stiffness_x_n_per_m": 2.7e6,
            "machine.stiffness_y_n_per_m": 10.65e6,
            "machine.stiffness_phi_n_m_per_rad": 3.87e6,
            "machine.damping_y_n_s_per_m": 2500.0,
            "material.mass_ratio": 0.0,
            "drive": {"program": [RAMP[0], {"t_s": 6.0, "supply_frequency_hz": 36.0}]},
        },
        ["exciters.0.rated_power_w", "exciters.1.rated_power_w"],
        15.5,
        20.0,
    ),
}


def test_random_machines():
    right, errors = [], []
    for number in range(MACHINES):
        scene = machine(number)
        row, found = settled(scene), scene.inspect()
        right.append(row["sync"] == found["expected"])
        if right[-1] and row["sync"] != "none" and row["stroke_y_m"] > row["stroke_x_m"]:
            told = [found["stroke_y_m"], found["throw_index"], found["dynamic_force_y_n"]]
            errors.append(
                np.abs(np.array(told) / [row["stroke_y_m"], row["gamma"], row["foundation_force_y_amplitude_n"]] - 1.0)
            )
    errors = np.array(errors)
    print(f"\nsynchronization of {MACHINES} machines: {sum(right)} right")
    print(f"stroke, throw index, force within 3 % at {(errors <= 0.03).sum(axis=0)} of {len(errors)} along y")
    assert sum(right) >= 0.95 * MACHINES
    assert (errors <= 0.03).all(axis=1).mean() >= 0.95


def test_sweep_of_the_quickstart():
    scene = load_config(CONFIGS / "quickstart.yaml").replace({"solver.engine": "taylor"})
    table = sweep(scene, jobs=1).table("sweep")
    for ratio, rows in table.groupby("material.mass_ratio"):
        right, rows = 0, rows.iloc[:: 1 if ratio == 0.0 else 6]  # noqa: PLW2901
        for _, row in rows.iterrows():
            supply = float(row["supply_frequency_hz"])
            other = scene.replace({"material.mass_ratio": float(ratio), "drive.supply_frequency_hz": supply})
            found = other.inspect()
            names = found["loaded_expected"] if ratio else f"{found['expected']} {found['coexisting']}"
            right += row["sync"] in names
        print(f"\nmass ratio {ratio:g}: {right} of {len(rows)} points right")
        assert right >= (0.95 if ratio == 0.0 else 0.85) * len(rows)


def test_how_starts_end():
    """A start that is told to pass does with each seed; one that may be captured is with some."""
    counts = {}
    for scene in [*(machine(number).replace(FROM_REST) for number in range(60)), *map(rocking, range(40))]:
        resonances = natural_speeds(scene)
        highest = resonances[resonances < min(scene.synchronous_speeds)].max(initial=0.0) / (2.0 * np.pi)
        summaries = [simulate(scene.replace({"run.seed": n}), keep="summary").summary for n in range(20)]
        slowest = [one["excitation_frequency_hz"] - 0.5 * abs(one["frequency_split_hz"]) for one in summaries]
        counts.setdefault(scene.inspect()["start"], []).append(sum(speed <= highest for speed in slowest))
    for start, captured in counts.items():
        print(f"\n{start}: {len(captured)} machines, captured {captured} of 20")
    assert not any(counts["passes"] + counts["barely passes"])
    assert np.mean(np.array(counts["may be captured"]) > 0) >= 0.9
    assert np.mean(counts["is likely captured"]) >= 0.9 * 20


@pytest.mark.parametrize("name", list(STARTS))
def test_torque_to_pass_a_resonance(name):
    scene = load_config(CONFIGS / "examples" / "threshold-torque.yaml").replace(
        STARTS[name] | {"solver.engine": "taylor", "find.max_settle_s": 30.0, "find.scan": 24}
    )
    table = find(scene, jobs=1).table("thresholds")
    found = table["value"].to_numpy()
    told = scene.exciter_pair[0].critical_torque_n_m * scene.inspect()["passage_ratio"]
    print(f"\n{name}: {told:.4g} N·m, `find` {found}")
    assert np.abs(told / found - 1.0).min(initial=1.0) <= 0.15


@pytest.mark.parametrize("name", list(OTHERS))
def test_torque_to_pass_a_resonance_of_other_machines(name):
    file, changes, keys, speed, duration = OTHERS[name]
    scene = load_config(CONFIGS / f"{file}.yaml", changes | {"solver.engine": "taylor"})
    section, _, last = keys[0].rpartition(".")
    given = getattr(scene.motor if section == "motor" else scene.exciters[0], last)
    told = given * scene.inspect()["passage_ratio"]
    low, high = told / 2.0, told * 2.0
    for _ in range(8):
        middle = np.sqrt(low * high)
        run = simulate(scene.replace(dict.fromkeys(keys, middle) | {"run.duration_s": duration}), keep="summary")
        passed = run.summary["excitation_frequency_hz"] > speed
        low, high = (low, middle) if passed else (middle, high)
    print(f"\n{name}: {last} {told:.4g}, simulated {low:.4g} … {high:.4g}")
    assert told == pytest.approx(high, rel=0.15)
