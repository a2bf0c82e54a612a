"""Keys from measured data: a ring-down with noise, what its data do not determine, and data that cannot be of it."""

import numpy as np
import pandas as pd
import pytest

import vibroplat
from vibroplat import Scene, load_config, simulate
from vibroplat.errors import ConfigError
from vibroplat.fitting.search import correlated
from vibroplat.hybrid.state import static_rest

STIFFNESS, DAMPING, MASS = "machine.stiffness_y_n_per_m", "machine.damping_y_n_s_per_m", "machine.platform_mass_kg"
HANGING = {"phi1_rad": -0.5 * np.pi, "phi2_rad": -0.5 * np.pi}
RINGING = {
    "solver.engine": "taylor",
    "drive": {"program": [{"t_s": 0, "supply_frequency_hz": 50, "off": True}]},
    "run": {"duration_s": 0.6, "perturbation": 0.0, "initial": {"state": HANGING | {"y_m": -1e-3}}},
    "output": {"accelerations": True},
}
TRUE = {STIFFNESS: 437e3, DAMPING: 61.0}
KEYS = {STIFFNESS: [350e3, 550e3], DAMPING: [5.0, 200.0]}


@pytest.fixture(scope="module")
def machine():
    return Scene().replace(RINGING)


@pytest.fixture(scope="module")
def data(machine, tmp_path_factory):
    """A function that writes what a sensor would: noise, gravity, and a clock of its own."""
    table = simulate(machine.replace(TRUE)).trajectory
    table = table[table["t_s"].between(0.031, 0.531)]
    values = table["acceleration_y_m_per_s2"].to_numpy()

    def write(change=lambda a: a, noise=0.03):
        path = tmp_path_factory.mktemp("data") / "sensor.csv"
        own = change(values) + noise * values.std() * np.random.default_rng(1).standard_normal(len(values))
        pd.DataFrame({"time": table["t_s"] + 1e3, "a": own + 9.81}).to_csv(path, index=False)
        return {"data": [{"file": str(path), "columns": {"t": "time", "ay": "a"}}], "offset": "fit"}

    return write


def test_a_ring_down_identifies_a_spring_and_its_damper(machine, data):
    plan = data() | {"keys": KEYS}
    found = vibroplat.fit(machine.replace({"fit": plan}))
    table = found.keys.set_index("key")
    for key, true in TRUE.items():
        value, error = table.loc[key, ["value", "error"]]
        assert abs(value - true) < 3.5 * error
    assert table.loc[STIFFNESS, "error"] < 1e-3 * TRUE[STIFFNESS]
    assert table["determined"].all()
    assert found.answer.short[2].startswith("sensor.csv, acceleration y: differs by 2.1 %, before by")
    assert "as good as" in found.answer.lines["data"]


def test_the_best_machine_is_a_configuration(machine, data, tmp_path):
    found = vibroplat.fit(machine.replace({"fit": data(noise=0.0) | {"keys": KEYS}}))
    (tmp_path / "best.yaml").write_text(found.configurations["best"])
    best = load_config(tmp_path / "best.yaml")
    assert best.machine.stiffness_y_n_per_m == pytest.approx(TRUE[STIFFNESS], rel=1e-5)
    assert static_rest(best)[1] == pytest.approx(static_rest(machine.replace(TRUE))[1], rel=1e-5)


@pytest.mark.long
def test_what_data_do_not_determine_is_told(machine, data):
    """A ring-down knows stiffness and mass by their ratio alone, and nothing of a spring along x."""
    other = "machine.stiffness_x_n_per_m"
    keys = {STIFFNESS: [350e3, 550e3], MASS: [10.0, 16.0], other: [500e3, 700e3]}
    found = vibroplat.fit(machine.replace({"fit": data() | {"keys": keys}}))
    notes = " ".join(found.answer.notes)
    assert f"the data do not determine {other}" in notes
    assert f"{STIFFNESS} and {MASS} are correlated by 1.00: only their ratio is known" in notes


@pytest.mark.long
def test_data_of_another_motion_make_a_fit_doubtful(machine, data):
    other = data(lambda a: np.sin(np.arange(len(a)) ** 1.5))
    found = vibroplat.fit(machine.replace({"fit": other | {"keys": {STIFFNESS: [430e3, 440e3]}, "starts": 2}}))
    assert "the fit is doubtful" in " ".join(found.answer.notes)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"columns": {"t": "Zeit"}}, "t=Zeit: no such column in the file; allowed: time, a"),
        ({"columns": {"t": "time", "speed_1_m": "a"}}, "runs have no column speed_1_m; allowed: "),
        ({"columns": {"t": "time"}}, "needs a column t and one more; allowed: "),
    ],
)
def test_data_that_cannot_be_compared_are_refused(machine, data, change, line):
    plan = data() | {"keys": KEYS}
    plan["data"][0] |= change
    with pytest.raises(ConfigError, match=line):
        vibroplat.fit(machine.replace({"fit": plan}))


def test_a_key_that_is_no_number_is_refused(machine, data):
    with pytest.raises(ConfigError, match=r"fit.keys.material.layers = 2 does not vary continuously"):
        vibroplat.fit(machine.replace({"fit": data() | {"keys": {"material.layers": [1, 2]}}}))


def test_errors_are_those_of_correlated_noise():
    """Of an autoregressive process, the spread of estimates of a mean and of an amplitude is what is predicted."""
    draws, count, own = np.random.default_rng(2), 400, 0.9
    columns = np.column_stack([np.ones(count), np.sin(0.3 * np.arange(count))])
    inverse = np.linalg.inv(columns.T @ columns)
    estimates, predicted = [], []
    for _ in range(200):
        noise = np.empty(count)
        noise[0] = draws.standard_normal() / np.sqrt(1.0 - own**2)
        for k in range(1, count):
            noise[k] = own * noise[k - 1] + draws.standard_normal()
        estimates.append(inverse @ columns.T @ noise)
        predicted.append(np.diag(inverse @ columns.T @ correlated(noise, columns) @ inverse))
    assert np.mean(predicted, axis=0) == pytest.approx(np.var(estimates, axis=0), rel=0.25)
