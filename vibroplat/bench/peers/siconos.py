"""Siconos (Acary and Brémond): the same machine with a unilateral constraint, in Debian's build of it.

It is a program for the interpreter that Debian's ``python3-siconos`` is built for, so it is run there; only
its integration is timed. Forces and mass matrix are Python functions, as in its examples.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.bench.peers.following import Followed
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import initial_state
from vibroplat.model.parameters import FloatArray, parameters
from vibroplat.model.systems import FULL_SIZE, GAP

#: The interpreter of Debian's packages, isolated: neither this directory nor PYTHONPATH is its business.
INTERPRETER = ("/usr/bin/python3", "-I")

#: The program that it runs.
PROGRAM = Path(__file__).with_name("siconos_program.py")


def available() -> str:
    """Why Siconos cannot be used here; empty if it can."""
    try:
        found = subprocess.run(
            [*INTERPRETER, "-c", "import siconos.kernel"], capture_output=True, text=True, check=False
        )
    except OSError as error:
        return f"{INTERPRETER[0]}: {error.strerror}"
    return "" if found.returncode == 0 else found.stderr.strip().rsplit("\n", 1)[-1] or f"exit code {found.returncode}"


def run(scene: Scene, kind: str, accuracy: float, times: FloatArray | None = None) -> Followed:
    """Integrate a scene.

    Parameters
    ----------
    kind
        ``time-stepping`` (Moreau and Jean) or ``event-driven`` (LSODAR, which stops at times that are asked
        for: they must be multiples of their smallest distance).
    accuracy
        Time step (s), or relative and absolute tolerance.
    times
        Ascending times at which states are wanted (s).

    Raises
    ------
    RuntimeError
        Siconos has failed; the text is the end of what it said. Or the scene has a sticking speed, which its impact
        law has not.
    """
    if scene.contact.sticking_speed_m_per_s > 0.0:
        raise RuntimeError("Siconos: Newton's impact law has no sticking speed; allowed: 0")
    wanted = np.empty(0) if times is None else times
    request = _request(scene) | {"kind": kind, "accuracy": accuracy, "times": wanted[wanted > 0.0].tolist()}
    done = subprocess.run(
        [*INTERPRETER, str(PROGRAM)], input=json.dumps(request), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"Siconos: {done.stderr.strip()[-400:] or f'exit code {done.returncode}'}")
    found = json.loads(done.stdout)
    begun = [initial_state(scene)] * int(np.sum(wanted <= 0.0))
    states = np.array([*begun, *(_full(scene, state) for state in found["states"])]).reshape(-1, FULL_SIZE)
    attached = [*(state[GAP] <= 0.0 and scene.layers > 0 for state in begun), *found["attached"]]
    away = Mode.FLIGHT if scene.layers else Mode.BARE
    modes = [(Mode.ATTACHED if on else away).label for on in attached]
    return Followed(states, modes, found["wall_s"], found["wall_s"], [tuple(row) for row in found["events"]])


def _request(scene: Scene) -> dict[str, Any]:
    """Parameters and initial state in absolute coordinates, as the program names them."""
    p, state, n = parameters(scene), initial_state(scene), 5 + scene.layers
    lower, upper = p.lower_mass, p.upper_mass
    motors = [{name: float(p[name][i]) for name in ("torque", "slip_speed", "speed", "friction")} for i in range(2)]
    return {
        "duration": scene.run.duration_s,
        "q": _absolute(state[:7])[:n].tolist(),
        "v": _absolute(state[7:])[:n].tolist(),
        "mass": float(p.mass),
        "inertia": float(p.inertia),
        "unbalance": float(p.unbalance[0]),
        "exciter_inertia": float(p.exciter_inertia[0]),
        "axis": [float(p.axis_x[0]), float(p.axis_y[0])],
        "stiffness": [float(p[f"stiffness_{name}"]) for name in ("x", "y", "phi")],
        "damping": [float(p[f"damping_{name}"]) for name in ("x", "y", "phi")],
        "gravity": float(p.gravity),
        "motors": motors,
        "layers": [lower, upper][: scene.layers],
        "spring": [upper * float(p.layer_stiffness), upper * float(p.layer_damping)],
        "restitution": float(p.restitution),
    }


def _absolute(values: FloatArray) -> FloatArray:
    """Coordinates or rates with those of the layers absolute."""
    found = values.copy()
    found[5] += found[1]
    found[6] += found[5]
    return found


def _full(scene: Scene, state: list[float]) -> FloatArray:
    """Full state of what the program returns."""
    full, n = np.zeros((2, 7)), 5 + scene.layers
    full[:, :n] = np.array(state).reshape(2, n)
    full[:, 6] -= full[:, 5] if scene.layers == 2 else 0.0
    full[:, 5] -= full[:, 1] if scene.layers else 0.0
    return full.ravel()
