"""What the paper's claims are read off: branches of one machine by mass ratio, restitution and contact model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vibroplat.physics.parameters import FloatArray
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.study.branches import EXCITATION, FREQUENCY, SUPPLY, Branch, branches, sweep_plan
from vibroplat.study.point import measure_point
from vibroplat.study.store import Store

Row = dict[str, Any]

#: Width of supply frequencies (Hz) down to which a boundary is narrowed: 0.05 Hz of excitation frequency.
WIDTH = 0.1
#: Distance of neighbouring rows (Hz) that a curve is not drawn across.
JUMP = 1.0
#: Frequency of rows.
F = EXCITATION

#: The regimes that claims name, as properties of a row.
REGIMES: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "antiphase": lambda row: row["sync"] == "antiphase",
    "in-phase": lambda row: row["sync"] == "in-phase",
    "attached": lambda row: row["flight_fraction"] == 0.0,
    "period-1": lambda row: row["period"] == 1,
    "period-1 with flight": lambda row: row["period"] == 1 and row["flight_fraction"] > 0.0,
    "periodic": lambda row: row["period"] > 0,
    "non-periodic": lambda row: row["period"] == 0,
}


class Key(NamedTuple):
    """Which branch: mass ratio, restitution, contact model, impact law, direction."""

    mass_ratio: float
    restitution: float = 0.0
    model: str = "impact"
    law: str = "conservative"
    direction: str = "up"


class Boundary(NamedTuple):
    """Rows on both sides of a change of regime, the one before it first."""

    before: Row
    after: Row


@dataclass
class Course:
    """Rows of one branch in its order, each with its supply frequency and final state; how many points failed."""

    branch: Branch
    plan: Sweep
    rows: list[Row]
    failed: int = 0


@dataclass
class Evidence:
    """Branches of one machine.

    Attributes
    ----------
    courses
        By key.
    narrowed
        Whether boundaries are narrowed by further points; without, they are as wide as the sweep's step.
    beta
        β of the non-impact model (1/s), if it was found.
    """

    courses: dict[Key, Course] = field(default_factory=dict)
    narrowed: bool = True
    beta: float | None = None
    _boundaries: dict[tuple[Key, str, float], Boundary | None] = field(default_factory=dict)

    def add(self, scene: Scene, store: Store) -> None:
        """Take in the branches of a finished sweep."""
        for branch in branches(scene):
            rows = [
                record["row"] | {SUPPLY: branch.frequencies[point], "state": record["state"]}
                for point, record in store.read(branch.number)
            ]
            key = key_of(branch)
            if key not in self.courses:  # figures share branches; each is read off the first that has it
                ended = [row for row in rows if row["outcome"] == "ok"]
                self.courses[key] = Course(branch, sweep_plan(scene), ended, len(rows) - len(ended))

    def rows(self, key: Key, low: float = 0.0, high: float = np.inf) -> list[Row]:
        """Return the rows of a branch between two excitation frequencies (Hz); empty if there is no such branch."""
        course = self.courses.get(key)
        return [row for row in course.rows if low <= row[F] <= high] if course else []

    def curve(self, key: Key, column: str, at: FloatArray) -> FloatArray:
        """Interpolate a column of a branch's antiphase rows over excitation frequency; nan beyond them."""
        end = self.end_of(key, "antiphase", 20.0)
        rows = [row for row in (*self.rows(key), *(end or ())) if row["sync"] == "antiphase"]
        rows.sort(key=lambda row: float(row[F]))
        if len(rows) < 2:
            return np.full(len(at), np.nan)
        f, values = np.array([r[F] for r in rows]), np.array([r[column] for r in rows], dtype=float)
        found = np.interp(at, f, values, left=np.nan, right=np.nan)
        place = np.clip(np.searchsorted(f, at), 1, len(f) - 1)
        found[np.diff(f)[place - 1] > JUMP] = np.nan
        return np.asarray(found)

    def end_of(self, key: Key, regime: str, above: float = 0.0) -> Boundary | None:
        """Find where a branch first leaves a regime that it is in at, or enters beyond, a frequency.

        None where it never is in it, or does not leave it.
        """
        place = (key, regime, above)
        if place not in self._boundaries:
            self._boundaries[place] = self._find_end(key, regime, above)
        return self._boundaries[place]

    def _find_end(self, key: Key, regime: str, above: float) -> Boundary | None:
        holds = REGIMES[regime]
        course = self.courses.get(key)
        inside = False
        for i, row in enumerate(course.rows if course else []):
            if holds(row) and (inside or row[F] >= above):
                inside = True
            elif inside:
                assert course is not None
                return self._narrow(course, course.rows[i - 1], row, holds)
        return None

    def start_of_last(self, key: Key, regime: str) -> Boundary | None:
        """Find where the regime begins in which a branch ends; None where it does not end in it, or always is in it."""
        holds = REGIMES[regime]
        course = self.courses.get(key)
        rows = course.rows if course else []
        outside = [i for i, row in enumerate(rows) if not holds(row)]
        if course is None or not outside or outside[-1] == len(rows) - 1:
            return None
        i = outside[-1]
        return self._narrow(course, rows[i], rows[i + 1], lambda row: not holds(row))

    def _narrow(self, course: Course, before: Row, after: Row, holds: Callable[[Row], bool]) -> Boundary:
        """Halve the step in which a regime ends, each new point begun with the state before the change."""
        plan = course.plan.model_copy(update={"lyapunov": False})
        number = 0
        while self.narrowed and abs(after[SUPPLY] - before[SUPPLY]) > WIDTH:
            middle = 0.5 * (before[SUPPLY] + after[SUPPLY])
            scene = course.branch.scene.replace({FREQUENCY: middle})
            point = measure_point(scene, plan, before["state"], (course.branch.number, 1_000_000 + number))
            number += 1
            row = point.row | {SUPPLY: middle, "state": point.state}
            if point.state is None:
                break
            before, after = (row, after) if holds(row) else (before, row)
        return Boundary(before, after)


def key_of(branch: Branch) -> Key:
    """Return the key of a branch."""
    contact = branch.scene.contact
    return Key(
        branch.scene.material.mass_ratio, contact.restitution, contact.model, contact.impact_law, branch.direction
    )


def runs(rows: Iterable[Row], regime: str) -> list[tuple[float, float]]:
    """First and last excitation frequency (Hz) of each stretch of rows in a regime."""
    holds = REGIMES[regime]
    found: list[tuple[float, float]] = []
    inside = False
    for row in rows:
        if holds(row):
            found[-1:] = [(found[-1][0], row[F])] if inside else [*found[-1:], (row[F], row[F])]
        inside = holds(row)
    return found
