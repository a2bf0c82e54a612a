"""The tables by which the paper's claims are judged: branches of one machine, by mass ratio, R and contact model."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.plans import SweepPlan
from vibroplat.model.parameters import FloatArray
from vibroplat.study.branches import EXCITATION, SUPPLY, Branch
from vibroplat.study.point import ERRORS
from vibroplat.study.store import Record, Store
from vibroplat.study.sweep import branch_records

#: Row of a sweep table, by column.
Row = dict[str, Any]

#: Distance of neighbouring rows (Hz) above which a curve is not interpolated between them.
JUMP = 1.0
#: Column of the frequency over which curves are drawn.
F = EXCITATION

#: Motions that do not repeat; ``non-periodic`` is one whose Lyapunov exponent was not asked for.
NON_PERIODIC = ("quasi-periodic", "chaotic", "non-periodic")

#: The regimes that claims name, as conditions on a row. Undecided motion is in none of MOTIONS.
REGIMES: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "antiphase": lambda row: row["sync"] == "antiphase",
    "in-phase": lambda row: row["sync"] == "in-phase",
    "attached": lambda row: row["flight_fraction"] == 0.0,
    "period-1": lambda row: row["period"] == 1,
    "period-1 with flight": lambda row: row["period"] == 1 and row["flight_fraction"] > 0.0,
    "periodic": lambda row: row["motion"] == "periodic",
    "non-periodic": lambda row: row["motion"] in NON_PERIODIC,
}
MOTIONS = ("period-1", "period-1 with flight", "periodic", "non-periodic")


class Key(NamedTuple):
    """Identifies a branch: mass ratio, restitution, contact model, impact law, direction."""

    mass_ratio: float
    restitution: float = 0.0
    model: str = "impact"
    law: str = "conservative"
    direction: str = "up"


class Boundary(NamedTuple):
    """The rows before and after a change of regime."""

    before: Row
    after: Row


class Step(NamedTuple):
    """A step of a branch in which a regime ends or begins: supply frequencies (Hz) of the rows before and after."""

    key: Key
    regime: str
    begins: bool
    before: float
    after: float


class Curve(NamedTuple):
    """A measure over excitation frequency and its standard error."""

    values: FloatArray
    errors: FloatArray


@dataclass
class Course:
    """The points of one branch, in its order.

    Attributes
    ----------
    branch, plan
        The branch and the plan of its sweep.
    rows
        Rows of the sweep table with their supply frequency, of the points that ended ``ok``.
    states
        Full states at the ends of these points, shape (14,), by supply frequency (Hz).
    failed
        Supply frequencies (Hz) of the other points.
    """

    branch: Branch
    plan: SweepPlan
    rows: list[Row]
    states: dict[float, list[float]] = field(default_factory=dict)
    failed: tuple[float, ...] = ()


@dataclass
class Evidence:
    """Branches of one machine.

    Attributes
    ----------
    courses
        By key.
    beta
        β of the non-impact model (1/s); None if there is none.
    boundaries
        Boundaries narrowed by further points (:mod:`vibroplat.paper.narrowing`), by the step of the sweep in which they
        are. Any other boundary is as wide as its step.
    """

    courses: dict[Key, Course] = field(default_factory=dict)
    beta: float | None = None
    boundaries: dict[Step, Boundary] = field(default_factory=dict)

    def add(self, branches: Sequence[Branch], store: Store) -> None:
        """Add the branches of a finished sweep from its stored points."""
        for branch in branches:
            self.add_branch(branch, list(branch_records(branch, store)))

    def add_branch(self, branch: Branch, records: Sequence[Record]) -> None:
        """Add a branch by the records of its points; one that is there already, as sweeps share branches, is kept."""
        points = [
            (record["row"] | {SUPPLY: supply}, record["state"])
            for supply, record in zip(branch.frequencies, records, strict=True)
        ]
        course = Course(
            branch,
            branch.plan,
            rows=[row for row, _ in points if row["outcome"] == "ok"],
            states={row[SUPPLY]: state for row, state in points if state is not None},
            failed=tuple(row[SUPPLY] for row, _ in points if row["outcome"] != "ok"),
        )
        self.courses.setdefault(key_of(branch), course)

    def without(self, keys: Collection[Key]) -> Evidence:
        """Return the evidence without these branches."""
        return replace(self, courses={key: course for key, course in self.courses.items() if key not in keys})

    def rows(self, key: Key, low: float = 0.0, high: float = np.inf) -> list[Row]:
        """Return the rows of a branch between two excitation frequencies (Hz); empty if there is no such branch."""
        course = self.courses.get(key)
        return [row for row in course.rows if low <= row[F] <= high] if course else []

    def curve(self, key: Key, column: str, at: FloatArray) -> Curve:
        """Interpolate a measure of a branch's antiphase motion over excitation frequency.

        Parameters
        ----------
        key
            The branch.
        column
            Column of the sweep table.
        at
            Excitation frequencies (Hz), shape (n,).

        Returns
        -------
        Curve
            Two arrays of shape (n,): nan and inf beyond the rows and across jumps. The errors of neighbouring rows are
            taken as independent.
        """
        end = self.end_of(key, "antiphase", 20.0)
        rows = [row for row in (*self.rows(key), *(end or ())) if row["sync"] == "antiphase"]
        rows.sort(key=lambda row: float(row[F]))
        if len(rows) < 2:
            return Curve(np.full(len(at), np.nan), np.full(len(at), np.nan))
        f, values = np.array([r[F] for r in rows]), np.array([r[column] for r in rows], dtype=float)
        # at equal frequency a curve is also off by its slope times the error of the frequency
        slope = np.abs(np.diff(values) / np.maximum(np.diff(f), 1e-6))
        steepest = np.maximum(np.append(slope, 0.0), np.insert(slope, 0, 0.0))
        across = np.array([error_of(r, F) for r in rows])
        # the least slope is above 0, as inf · 0 is nan
        errors = np.array([error_of(r, column) for r in rows]) + across * np.maximum(steepest, 1e-300)
        found = np.interp(at, f, values, left=np.nan, right=np.nan)
        place = np.clip(np.searchsorted(f, at), 1, len(f) - 1)
        found[np.diff(f)[place - 1] > JUMP] = np.nan
        share = np.clip((at - f[place - 1]) / np.maximum(np.diff(f)[place - 1], 1e-12), 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            mixed = np.hypot((1.0 - share) * errors[place - 1], share * errors[place])
        return Curve(found, np.nan_to_num(mixed, nan=np.inf, posinf=np.inf))

    def end_of(self, key: Key, regime: str, above: float = 0.0) -> Boundary | None:
        """Find where a branch leaves a regime for the first time above an excitation frequency (Hz).

        Returns None if the branch is never in the regime there, or does not leave it.
        """
        rows = self._decided(key, regime)
        holds = REGIMES[regime]
        inside = False
        for i, row in enumerate(rows):
            if holds(row) and (inside or row[F] >= above):
                inside = True
            elif inside:
                return self._boundary(key, regime, rows[i - 1], row)
        return None

    def start_of_last(self, key: Key, regime: str) -> Boundary | None:
        """Find where the regime begins in which a branch ends.

        Returns None if the branch does not end in this regime, or is in it from its first row on.
        """
        rows = self._decided(key, regime)
        holds = REGIMES[regime]
        outside = [i for i, row in enumerate(rows) if not holds(row)]
        if not outside or outside[-1] == len(rows) - 1:
            return None
        return self._boundary(key, regime, rows[outside[-1]], rows[outside[-1] + 1], begins=True)

    def _decided(self, key: Key, regime: str) -> list[Row]:
        """Return the rows of a branch that are known to be inside or outside a regime."""
        rows = self.rows(key)
        return [row for row in rows if row["motion"] != "undecided"] if regime in MOTIONS else rows

    def _boundary(self, key: Key, regime: str, before: Row, after: Row, *, begins: bool = False) -> Boundary:
        return self._narrowed(Step(key, regime, begins, before[SUPPLY], after[SUPPLY]), Boundary(before, after))

    def _narrowed(self, step: Step, boundary: Boundary) -> Boundary:
        return self.boundaries.get(step, boundary)


def error_of(row: Row, column: str) -> float:
    """Return the standard error of a measure: 0 if the motion is periodic, inf if the error is not known."""
    error = row.get(ERRORS[column])
    if error is not None and math.isfinite(error):
        return float(error)
    return 0.0 if row["motion"] == "periodic" else math.inf


def key_of(branch: Branch) -> Key:
    """Return the key of a branch."""
    contact = branch.scene.contact
    return Key(
        branch.scene.material.mass_ratio, contact.restitution, contact.model, contact.impact_law, branch.direction
    )


def runs(rows: Iterable[Row], regime: str) -> list[tuple[float, float]]:
    """Return the first and last excitation frequency (Hz) of each stretch of rows in a regime."""
    holds = REGIMES[regime]
    found: list[tuple[float, float]] = []
    inside = False
    for row in rows:
        if holds(row):
            found[-1:] = [(found[-1][0], row[F])] if inside else [*found[-1:], (row[F], row[F])]
        inside = holds(row)
    return found
