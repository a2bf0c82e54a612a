"""How often an inspection is right: random machines, the sweep of the quickstart, starts through a resonance.

``python -m pytest -m long tests/inspection/test_against_simulation.py -s`` prints the shares that ``results/method.md``
tells; half an hour.
"""

import numpy as np
import pytest

from inspection.machines import machine, settled
from vibroplat import find, load_config, sweep
from vibroplat.config.reader import configurations

pytestmark = pytest.mark.long
CONFIGS = configurations()
MACHINES = 100

RAMP = {"drive": {"program": [{"t_s": 0.0, "supply_frequency_hz": 0.0}, {"t_s": 3.0, "supply_frequency_hz": 66.0}]}}
#: Starts of other machines: heavier damping, a start in 0.7 s, in 10 s, and with another rotor and lighter unbalances.
STARTS = {
    "threshold-torque": {},
    "damping": {"machine.damping_y_n_s_per_m": 200.0},
    "little damping": {"machine.damping_y_n_s_per_m": 70.0},
    "fast": {"drive.program": [RAMP["drive"]["program"][0], {"t_s": 0.7, "supply_frequency_hz": 66.0}]},
    "slow": {"drive.program": [RAMP["drive"]["program"][0], {"t_s": 10.0, "supply_frequency_hz": 66.0}]},
    "other machine": {
        "machine.platform_mass_kg": 40.0,
        "machine.stiffness_y_n_per_m": 1.5e6,
        "machine.damping_y_n_s_per_m": 250.0,
        "machine.rotor_inertia_kg_m2": 2e-3,
        "machine.unbalance_mass_kg": 0.09,
    },
}


def test_random_machines():
    right, errors = [], []
    for number in range(MACHINES):
        scene = machine(number)
        row, found = settled(scene), scene.inspect()
        right.append(row["sync"] == found["expected"])
        if right[-1] and row["sync"] != "none" and row["stroke_y_m"] > row["stroke_x_m"]:
            force = row["foundation_force_y_max_n"] - abs(row["foundation_force_y_mean_n"])
            told = [found["stroke_y_m"], found["throw_index"], found["dynamic_force_y_n"]]
            errors.append(np.abs(np.array(told) / [row["stroke_y_m"], row["gamma"], force] - 1.0))
    errors = np.array(errors)
    print(f"\nsynchronization of {MACHINES} machines: {sum(right)} right")
    print(f"stroke, throw index, force within 3 % at {(errors <= 0.03).sum(axis=0)} of {len(errors)} along y")
    assert sum(right) >= 0.95 * MACHINES
    assert (errors <= 0.03).all(axis=1).mean() >= 0.95


def test_sweep_of_the_quickstart():
    scene = load_config(CONFIGS / "quickstart.yaml").replace({"solver.engine": "taylor"})
    table = sweep(scene, jobs=1).table("sweep")
    for ratio, rows in table.groupby("material.mass_ratio"):
        right, rows = 0, rows.iloc[:: 1 if ratio == 0.0 else 3]  # noqa: PLW2901
        for _, row in rows.iterrows():
            supply = float(row["drive.supply_frequency_hz"])
            other = scene.replace({"material.mass_ratio": float(ratio), "drive.supply_frequency_hz": supply})
            found = other.inspect()
            names = found["loaded_expected"] if ratio else f"{found['expected']} {found['coexisting']}"
            right += row["sync"] in names
        print(f"\nmass ratio {ratio:g}: {right} of {len(rows)} points right")
        assert right >= (0.95 if ratio == 0.0 else 0.85) * len(rows)


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
