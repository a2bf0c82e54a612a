"""The scenes on which peers are compared, and the motion that errors are measured against.

That motion is the Taylor series of :mod:`vibroplat.bench.peers.taylor` at round-off. Where there are
reference tables it is held against them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.bench.peers.following import Followed, at_tolerance, follow
from vibroplat.bench.reference import compared_events, load_reference
from vibroplat.bench.scenes import base
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.model.parameters import FloatArray

#: Errors at which run times are compared: of coordinates over their scales, of event times (s), of F_c over its
#: largest value.
LEVELS = {"coordinates": 1e-6, "event_time_s": 1e-8, "contact_force": 1e-6}

#: The same where the motion amplifies what errors a step leaves: an offset of y at the beginning grows there 5e3 and
#: 3e5 times.
AMPLIFIED = {
    "latches, R 0.5": {"coordinates": 1e-3, "event_time_s": 5e-6},
    "flights of many periods": {"coordinates": 1e-2, "event_time_s": 3e-6},
}

#: Distance of the times at which states are compared (s).
GRID = 0.01

#: Tolerance of the oracle.
FINEST = 1e-16


@dataclass(frozen=True)
class Case:
    """A scene to compare on.

    Attributes
    ----------
    reference
        Name of its reference tables, if there are any.
    statistics
        Whether neighbouring motions part, so that only statistics can be compared.
    """

    name: str
    scene: Scene
    reference: str = ""
    statistics: bool = False

    @property
    def levels(self) -> dict[str, float]:
        """Errors at which run times are compared."""
        return LEVELS | AMPLIFIED.get(self.name, {})

    @property
    def times(self) -> FloatArray:
        """Times at which states are compared (s)."""
        return np.linspace(0.0, self.scene.run.duration_s, round(self.scene.run.duration_s / GRID) + 1)


def cases(directory: Path) -> list[Case]:
    """Return the scenes, those of the reference tables in a directory and our own."""
    known = {
        "attached": "attached-mu01-fe46",
        "one impact a period": "inelastic-mu02-fe51.5",
        "latches, R 0.5": "restitution05-mu02-fe51.5",
    }
    own: dict[str, dict[str, Any]] = {
        "bare run-up": {
            "material.mass_ratio": 0.0,
            "drive.supply_frequency_hz": 60.0,
            "run.initial.speed_ratio": 0.2,
            "run.duration_s": 2.0,
        },
        "flights of many periods": {
            "drive.supply_frequency_hz": 78.0,
            "contact.restitution": 0.3,
            "run.duration_s": 0.6,
        },
        "not periodic": {
            "drive.supply_frequency_hz": 62.5,
            "contact.restitution": 0.5,
            "run.duration_s": 20.0,
        },
    }
    found = [Case(name, load_reference(directory, of).scene, of) for name, of in known.items()]
    scene = base(1e-6, 1.0)
    found += [Case(name, scene.replace(changes), statistics=name == "not periodic") for name, changes in own.items()]
    order = ("bare run-up", *known, "flights of many periods", "not periodic")
    return sorted(found, key=lambda case: order.index(case.name))


def truth(case: Case) -> Followed:
    """Integrate a case at round-off.

    Raises
    ------
    ImportError
        heyoka is not installed.
    """
    from vibroplat.bench.peers.taylor import Taylor  # noqa: PLC0415  (optional)

    return follow(at_tolerance(case.scene, FINEST), Taylor(case.scene, FINEST), case.times)


def agreement(case: Case, found: Followed, directory: Path) -> dict[str, Any]:
    """How far the oracle is from the reference tables of a case: event times (s) and coordinates (m, rad).

    Raises
    ------
    TableError
        The events differ in kind or number.
    """
    table = load_reference(directory, case.reference)
    mine, theirs = compared_events(found.events), compared_events(table.events)
    mine, theirs = (events[events["t_s"] < case.scene.run.duration_s] for events in (mine, theirs))
    if list(mine["kind"]) != list(theirs["kind"]):
        raise TableError(f"{case.reference}: {len(mine)} events of the oracle, {len(theirs)} in the table")
    rows = table.trajectory.set_index(np.round(table.trajectory["t_s"], 9))
    times = [t for t in np.round(case.times, 9) if t in rows.index]
    states = found.states[: len(times), :7]
    coordinates = rows.loc[times, ["x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad"]].to_numpy()
    return {
        "case": case.name,
        "until_s": case.scene.run.duration_s,
        "events": len(mine),
        "event_time_s": float(np.abs(mine["t_s"] - theirs["t_s"]).max()) if len(mine) else 0.0,
        "coordinates": float(np.abs(states[:, :5] - coordinates).max()),
    }
