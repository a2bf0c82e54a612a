"""What is written from the source against numbers of the equations as they were written by hand, and what it says."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vibroplat.config.sections import Transport
from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lanes import as_lanes, lanes_record
from vibroplat.model.accelerations import accelerations, second_derivatives
from vibroplat.model.equations import jacobian, rows
from vibroplat.model.parameters import parameters, record_words
from vibroplat.model.series import ALONG_COLUMN, MOTION_ALONG, WORDS, expand, parameter_rows, room
from vibroplat.model.systems import MOVING_SIZE, SYSTEMS

from .helpers import RECORDS, SIZES, TIME, name_of, scene_of

NUMBERS = Path(__file__).parent / "equations_by_hand.json"
#: States of each system, and degree of their series.
STATES, DEGREE = 16, 16
#: Time that scales the series' coefficients (s), about their radius of convergence.
SCALE = 2e-3
#: Sizes of what a series has: seven coordinates, F_c, s and F_t.
COLUMNS = np.concatenate([SIZES[:7], [30.0, 1e-2, 30.0, 1.0, 1.0]])
DECK = Transport(friction=0.4, static_friction=0.5, deck_angle_deg=9.0, deck_height_m=0.07)


@compiled
def expand_moving(motion, degree, room, rows):
    expand(as_lanes(motion), degree, as_lanes(room), as_lanes(rows), True)


@compiled
def expand_plain(motion, degree, room, rows):
    expand(as_lanes(motion), degree, as_lanes(room), as_lanes(rows), None)


def series(system, y, p):
    """Coefficients of all columns times powers of a time."""
    motion, formed, given = lanes_record(1, MOTION_ALONG, {}), room(moving=system.slides), parameter_rows()
    full = np.append(system.full(y), [0.0, 0.0])
    motion["t"], motion["y"][:7, 0], motion["v"][:7, 0] = TIME, full[:7], full[7:14]
    motion["y"][ALONG_COLUMN, 0], motion["v"][ALONG_COLUMN, 0] = full[14:16]
    motion["attached"], motion["two"] = system.algebraic, system.layers == 2
    motion["flying"] = system.layers > 0 and not system.algebraic
    motion["lower_share"] = 1.0 / p["lower_mass"] if system.layers else 0.0
    sense = {"slip+": 1.0, "slip-": -1.0, "slip−": -1.0}.get(system.mode.label, 0.0)
    motion["stuck"], motion["sliding"] = system.algebraic and sense == 0.0, sense * p["kinetic_friction"]
    motion["slope"], motion["height"], motion["share"] = p["slope"], p["deck_height"], p["material_share"]
    given["words"][:, 0] = record_words(p).ravel()[:WORDS]
    (expand_moving if system.slides else expand_plain)(motion, DEGREE, formed, given)
    q = formed["q"][: DEGREE + 1, :, 0]
    return q / COLUMNS[: q.shape[1]] * SCALE ** np.arange(DEGREE + 1)[:, np.newaxis]


def start(system, y, p):
    """Consistent unknowns, their first and second derivatives, each in units of its kind."""
    yp, ypp, n = np.zeros(system.size), np.zeros(system.size), system.differential // 2
    assert accelerations(system.index, TIME, y, yp, p)
    assert second_derivatives(system.index, TIME, y, yp, ypp, p)
    sizes = np.append(SIZES, [1e-2, 0.3])[system.places]
    forces = np.full(system.size - 2 * n, 30.0)
    rates = np.concatenate([sizes[n:], 100.0 * sizes[n:], 100.0 * forces])
    second = np.concatenate([100.0 * sizes[n:], 1e4 * sizes[n:], forces])
    return np.concatenate([y / np.append(sizes, forces), yp / rates, ypp / second])


def found(system):
    """Numbers of a system over random states: each is a sum with random weights, beside the sum of their sizes."""
    rng, sums = np.random.default_rng(system.index), {}
    for k in range(STATES):
        scene = scene_of(system.layers, RECORDS[k % len(RECORDS)])
        if system.slides:
            scene = scene.model_copy(update={"transport": DECK})
        p = parameters(scene, TIME)
        state, other = rng.uniform(-1.0, 1.0, (2, MOVING_SIZE)) * np.append(SIZES, [1e-2, 0.3])
        y, yp = system.unknowns(state), system.unknowns(other)
        yp[system.differential // 2 :] *= 100.0
        y[system.differential :] = 30.0 * rng.normal(size=system.size - system.differential)
        residual, jac = np.empty(system.size), np.empty((system.size, system.size))
        rows(system.index, TIME, y, yp, residual, p)
        jacobian(system.index, TIME, y, yp, 1e3, jac, p)
        values = {"rows": residual, "jacobian": jac, "start": start(system, y, p), "series": series(system, y, p)}
        for name, of in values.items():
            weighed = rng.normal(size=of.size) * of.ravel()
            sums[name] = sums.get(name, 0.0) + np.array([weighed, abs(weighed)])
    return {name: fold(of) for name, of in sums.items()}


def fold(of):
    """Sum up every sixth number."""
    padded = np.pad(of, ((0, 0), (0, -of.shape[1] % 6)))
    return padded.reshape(2, -1, 6).sum(axis=1)


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: f"{name_of(s)}{'-moving' * s.slides}")
def test_written_kernels_are_those_by_hand(system):
    expected = json.loads(NUMBERS.read_text(encoding="utf-8"))[str(system.index)]
    for name, (values, sizes) in found(system).items():
        assert np.abs(values - expected[name]).max() <= 1e-13 * sizes.max(), name


def test_texts_can_be_printed():
    done = subprocess.run([sys.executable, "-m", "vibroplat.model.written"], capture_output=True, text=True, check=True)
    assert "res[n + 1] = p.mass * lifted + (p.damping_y * v_y + p.stiffness_y * q_y + " in done.stdout


if __name__ == "__main__":
    numbers = {system.index: {name: of[0].tolist() for name, of in found(system).items()} for system in SYSTEMS}
    NUMBERS.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
