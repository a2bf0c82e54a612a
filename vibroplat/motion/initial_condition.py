"""Where a run begins: as its scene says, slightly perturbed, or where another run ended."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.coordinates import ALONG, COORDINATES, RATES, Mode
from vibroplat.config.scene import Scene
from vibroplat.config.schema import MAX_ANGLE
from vibroplat.errors import ConfigError, TableError
from vibroplat.hybrid.state import initial_state, perturb_state, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import GAP
from vibroplat.observe.tables import state_places
from vibroplat.results.files import SavedFiles

#: Largest coordinates and rates, in scaled units, that the end of a run may have to be gone on from; the
#: exciters' angles grow for ever and have a limit of their own. Round-off of its time may turn an exciter in step by at
#: most the angle EXACT (rad).
MAX_SIZE, MAX_ANGLE_ERROR = 1e4, 1e-6
#: How far below 0 the gap may be there, in its scale: the largest tolerance.
MAX_PENETRATION = 1e-2


_MODES = {mode.label: mode for mode in Mode}


class Start(NamedTuple):
    """Where a run begins.

    Attributes
    ----------
    state
        Full state, shape (14,).
    time
        When (s).
    mode
        Its mode, where the run continues from another.
    origin
        What provenance says of that other run.
    """

    state: FloatArray
    time: float = 0.0
    mode: Mode | None = None
    origin: dict[str, Any] | None = None


def initial_condition(scene: Scene) -> Start:
    """Find where a run of a scene begins.

    Raises
    ------
    ConfigError
        ``run.initial.from`` names no finished run, or one whose end this scene cannot continue from.
    """
    source, perturbation = scene.run.initial.from_, scene.start_perturbation
    start = Start(initial_state(scene)) if source is None else end_of(Path(source), scene)
    key = (scene.run.seed, 0, round(1e6 * scene.drive.largest_frequency))  # as the first point of a sweep
    start = start._replace(state=perturb_state(start.state, scene, perturbation, key))
    if scene.drive.program is not None and scene.drive.program[0].t_s > start.time:
        raise ConfigError(
            f"drive.program.0.t_s = {scene.drive.program[0].t_s} but the run starts at {start.time:g} s; allowed: "
            "an entry at or before its start"
        )
    return start


def end_of(directory: Path, scene: Scene) -> Start:
    """Read the last row of a run's trajectory.

    Raises
    ------
    ConfigError
        The directory holds no finished run, or one that this scene cannot continue from.
    """
    key = f"run.initial.from = {str(directory)!r}"
    try:
        result = SavedFiles(directory, "run")
        origin, summary = result.provenance, result.document("summary")
        table = deque(result.parts("trajectory", last=True), maxlen=1)[0]  # its last rows
    except TableError as error:
        wrong = str(error).partition("; allowed: ")[0]
        raise ConfigError(f"{key}: {wrong}; allowed: the directory of a finished run") from None
    outcome = summary.get("outcome") if isinstance(summary, dict) else None
    if outcome != "ok":
        raise ConfigError(f"{key}: the run ended early ({outcome}); allowed: the directory of a finished run")
    try:
        row = {str(column): value for column, value in table.iloc[-1].items()}
        time, mode = float(row["t_s"]), _MODES[str(row["mode"])]
        state = _state_of(row, scene, key)
    except (IndexError, KeyError, TypeError, ValueError):
        raise ConfigError(f"{key}: its trajectory is not as vibroplat writes it") from None
    run = {"directory": str(directory), "t_s": time} | {
        name: origin.get(name) for name in ("result", "configuration_sha256", "created")
    }
    return Start(state, time, mode if mode in scene.modes else None, run)


def _state_of(row: dict[str, Any], scene: Scene, key: str) -> FloatArray:
    """Full state of a row; what the scene has beyond the row's coordinates is at rest."""
    state, places = initial_state(scene), state_places(scene)
    names = (*COORDINATES, *RATES, *ALONG)
    for name in names:
        if name in row and name in places:
            state[places[name]] = row[name]
        elif row.get(name, 0.0) != 0.0:
            raise ConfigError(
                f"{key} ends with {name} = {row[name]:g} but this scene has no such coordinate; "
                "allowed: a run with the same layers"
            )
    if not np.isfinite([*state, row["t_s"]]).all():
        raise ValueError
    limits = {name: MAX_SIZE * scale for name, scale in zip(names, state_scales(scene), strict=False)}
    limits |= dict.fromkeys(("phi1_rad", "phi2_rad"), MAX_ANGLE)
    limits.pop("along_m", None)  # it grows for ever
    limits["t_s"] = MAX_ANGLE_ERROR / (np.finfo(float).eps * scene.speed_scale)
    for name, limit in limits.items():
        if abs(row.get(name, 0.0)) > limit:
            raise ConfigError(f"{key} ends with {name} = {row[name]:g}; allowed for this scene: up to {limit:.3g}")
    if row.get("gap_m", 0.0) < (least := -MAX_PENETRATION * float(state_scales(scene)[GAP])):
        raise ConfigError(f"{key} ends with gap_m = {row['gap_m']:g}; allowed for this scene: at least {least:.3g}")
    return state
