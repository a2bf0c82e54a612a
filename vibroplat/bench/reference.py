"""Errors of a run against reference tables.

A reference is ``NAME.yaml`` (the scene), ``NAME.trajectory.csv`` (without rows at events) and
``NAME.events.csv``, with the columns of this package's tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import COORDINATES
from vibroplat.config.reader import load_config
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.results.run import Trajectory

#: Slower impacts (m/s) are not compared: each integration ends an accumulation at its own threshold.
SLOWEST = 1e-3


@dataclass(frozen=True)
class Reference:
    """One reference case."""

    name: str
    scene: Scene
    trajectory: pd.DataFrame
    events: pd.DataFrame


def load_reference(directory: Path, name: str) -> Reference:
    """Read a reference case.

    Raises
    ------
    TableError
        A table is missing.
    """
    try:
        trajectory, events = (pd.read_csv(directory / f"{name}.{kind}.csv") for kind in ("trajectory", "events"))
    except FileNotFoundError as error:
        raise TableError(f"no reference {name} in {directory}: {error.filename} is missing") from None
    return Reference(name, load_config(directory / f"{name}.yaml"), trajectory, events)


def names(directory: Path) -> list[str]:
    """Names of the reference cases in a directory."""
    found = sorted(path.stem for path in directory.glob("*.yaml"))
    if not found:
        raise TableError(f"{directory} holds no reference cases; give their directory with --reference")
    return found


def load_references(directory: Path) -> list[Reference]:
    """Read all reference cases of a directory; raises as :func:`load_reference` does."""
    return [load_reference(directory, name) for name in names(directory)]


def compared_events(events: pd.DataFrame) -> pd.DataFrame:
    """Liftoffs, and impacts faster than :data:`SLOWEST`."""
    impacts = (events["kind"] == "impact") & (events["gap_rate_before_m_per_s"] < -SLOWEST)
    return events[(events["kind"] == "liftoff") | impacts].reset_index(drop=True)


def coordinate_errors(run: Trajectory, trajectory: pd.DataFrame, until: float = np.inf) -> dict[str, float]:
    """Largest error of each coordinate, and of the contact force relative to its largest value.

    The force is compared while both are attached; its error is ``contact_force``.
    """
    end = min(until, run.scene.run.duration_s)
    theirs = trajectory[trajectory["t_s"] <= end].reset_index(drop=True)
    mine = run(theirs["t_s"])
    errors = {c: float((mine[c] - theirs[c]).abs().max()) for c in COORDINATES if c in mine}
    if "contact_force_n" in mine:
        attached = (mine["mode"] == "attached") & (theirs["mode"] == "attached")
        force = theirs["contact_force_n"][attached]
        errors["contact_force"] = float((mine["contact_force_n"][attached] - force).abs().max() / force.max())
    return errors


def event_errors(mine: pd.DataFrame, theirs: pd.DataFrame) -> dict[str, float]:
    """Largest error of event times (s) and largest relative error of impact speeds; nan if the sequences differ."""
    mine, theirs = compared_events(mine), compared_events(theirs)
    if list(mine["kind"]) != list(theirs["kind"]):
        return {"event_time_s": np.nan, "impact_speed": np.nan}
    impacts = mine["kind"] == "impact"
    speeds = mine["gap_rate_before_m_per_s"][impacts] / theirs["gap_rate_before_m_per_s"][impacts]
    return {
        "event_time_s": float((mine["t_s"] - theirs["t_s"]).abs().max()) if len(mine) else 0.0,
        "impact_speed": float((speeds - 1.0).abs().max()) if impacts.any() else 0.0,
    }
