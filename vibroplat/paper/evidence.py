"""The evidence by which the paper's claims are judged: branches of one machine, by mass ratio, R and contact model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vibroplat.model.parameters import FloatArray
from vibroplat.study.branches import EXCITATION, SUPPLY, Branch
from vibroplat.study.point import ERRORS
from vibroplat.study.store import Record

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


#: The branches by which the contact models are compared.
IMPACT_KEY, NON_IMPACT_KEY = Key(0.2), Key(0.2, model="non-impact")


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


#: RMS y over excitation frequency, or a ratio of two, and its standard error.
Curve = tuple[FloatArray, FloatArray]


class Course(NamedTuple):
    """A branch and the rows of its points in the sweep table, each with its supply frequency and its final state."""

    branch: Branch
    rows: list[Row]


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
        Boundaries narrowed by further points (:func:`vibroplat.paper.root_finding.narrow`), by the step of the sweep in
        which they are. Any other boundary is as wide as its step.
    read
        The steps whose boundaries have been read: those that are worth narrowing.
    """

    courses: dict[Key, Course] = field(default_factory=dict)
    beta: float | None = None
    boundaries: dict[Step, Boundary] = field(default_factory=dict)
    read: dict[Step, None] = field(default_factory=dict, compare=False)

    def add(self, branch: Branch, records: Iterable[Record]) -> None:
        """Add a branch by the records of its points; one that is there already, as sweeps share branches, is kept."""
        points = zip(branch.frequencies, records, strict=True)
        rows = [record["row"] | {SUPPLY: supply, "state": record["state"]} for supply, record in points]
        mass_ratio, contact = branch.scene.material.mass_ratio, branch.scene.contact
        key = Key(mass_ratio, contact.restitution, contact.model, contact.impact_law, branch.direction)
        self.courses.setdefault(key, Course(branch, rows))

    def restitutions(self, mass_ratio: float) -> list[Key]:
        """Return the keys of the upward branches of the impact model that a mass ratio has, in the order of R."""
        return sorted(key for key in self.courses if key == Key(mass_ratio, key.restitution))

    def rows(self, key: Key, low: float = 0.0, high: float = math.inf) -> list[Row]:
        """Return the rows of a branch that ended ``ok`` between two excitation frequencies (Hz); it may be missing."""
        rows = self.courses[key].rows if key in self.courses else []
        return [row for row in rows if row["outcome"] == "ok" and low <= row[F] <= high]

    def curve(self, key: Key, at: FloatArray) -> Curve:
        """Interpolate RMS y (m) of a branch's antiphase motion at excitation frequencies (Hz), shape (n,).

        The result are its values and their standard errors, shape (n,): nan and inf beyond the rows and across jumps.
        The errors of neighbouring rows are taken as independent.
        """
        rows = [row for row in (*self.rows(key), *(self.jump(key) or ())) if row["sync"] == "antiphase"]
        rows.sort(key=lambda row: float(row[F]))
        if len(rows) < 2:
            return np.full(len(at), np.nan), np.full(len(at), np.nan)
        f, values = np.array([r[F] for r in rows]), np.array([r["rms_y_m"] for r in rows])
        # at equal frequency a curve is also off by its slope times the error of the frequency
        slope = np.abs(np.diff(values) / np.maximum(np.diff(f), 1e-6))
        steepest = np.maximum(np.append(slope, 0.0), np.insert(slope, 0, 0.0))
        across = np.array([error_of(r, F) for r in rows])
        # the least slope is above 0, as inf · 0 is nan
        errors = np.array([error_of(r, "rms_y_m") for r in rows]) + across * np.maximum(steepest, 1e-300)
        found = np.interp(at, f, values, left=np.nan, right=np.nan)
        place = np.clip(np.searchsorted(f, at), 1, len(f) - 1)
        gap = np.diff(f)[place - 1]
        found[gap > JUMP] = np.nan
        share = np.clip((at - f[place - 1]) / np.maximum(gap, 1e-12), 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            mixed = np.hypot((1.0 - share) * errors[place - 1], share * errors[place])
        return found, np.nan_to_num(mixed, nan=np.inf, posinf=np.inf)

    def jump(self, key: Key) -> Boundary | None:
        """Find where antiphase rotation below the second resonance ends."""
        return self.end_of(key, "antiphase", 20.0)

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
                return self._narrowed(key, regime, rows[i - 1], row)
        return None

    def start_of_last(self, key: Key, regime: str) -> Boundary | None:
        """Find where the regime begins in which a branch ends.

        Returns None if the branch does not end in this regime, or is in it from its first row on.
        """
        rows = self._decided(key, regime)
        last = max((i for i, row in enumerate(rows) if not REGIMES[regime](row)), default=-1)
        if last in (-1, len(rows) - 1):
            return None
        return self._narrowed(key, regime, rows[last], rows[last + 1], begins=True)

    def _decided(self, key: Key, regime: str) -> list[Row]:
        """Return the rows of a branch that are known to be inside or outside a regime."""
        return [row for row in self.rows(key) if regime not in MOTIONS or row["motion"] != "undecided"]

    def _narrowed(self, key: Key, regime: str, before: Row, after: Row, *, begins: bool = False) -> Boundary:
        step = Step(key, regime, begins, before[SUPPLY], after[SUPPLY])
        self.read[step] = None
        return self.boundaries.get(step, Boundary(before, after))


def error_of(row: Row, column: str) -> float:
    """Return the standard error of a measure: 0 if the motion is periodic, inf if the error is not known."""
    error = row.get(ERRORS[column])
    if error is not None and math.isfinite(error):
        return float(error)
    return 0.0 if row["motion"] == "periodic" else math.inf


# -- findings ---------------------------------------------------------------------------------------------

Claim = Mapping[str, Any]

#: Allowed error of the ends of a band (Hz of excitation frequency): the paper's step is 0.5 Hz of supply frequency.
EDGE = 0.25


class Finding(NamedTuple):
    """What was found for a claim: in words, whether it holds, and how close it is, from 0 to 1.

    ``judged`` is False if it does not hold for the sole reason that points at R = 1 failed.
    """

    measured: str
    holds: bool
    score: float
    judged: bool = True


Judge = Callable[[Claim, Evidence], Finding]


def listed(value: Any) -> list[float]:
    """Return a value of a claim as a list."""
    return list(value) if isinstance(value, Sequence) else [value]


def name_of(key: Key) -> str:
    """Name a branch."""
    return f"μ {key.mass_ratio:g}" + (f", R {key.restitution:g}" if key.restitution else "")


def keys_of(claim: Claim) -> list[Key]:
    """Return the keys of a claim's branches, from its mass ratios and restitutions."""
    return [Key(mu, r) for mu in listed(claim.get("mu", 0.0)) for r in listed(claim.get("R", 0.0))]


def joined(findings: Mapping[str, Finding]) -> Finding:
    """Join the findings of several branches; all must hold."""
    if len(findings) == 1:
        return next(iter(findings.values()))
    text = "; ".join(f"{name}: {finding.measured}" for name, finding in findings.items())
    return Finding(text, all(f.holds for f in findings.values()), float(np.mean([f.score for f in findings.values()])))


def interval(low: float, high: float) -> str:
    """Return an interval of frequencies (Hz) as text."""
    return f"{low:.2f} … {high:.2f} Hz" if high > low else f"{low:.2f} Hz"


def closeness(off: float, tolerance: float) -> float:
    """Return 1 up to a tolerance; the value falls to 0 at four times the tolerance."""
    return float(np.clip((4.0 - off / tolerance) / 3.0, 0.0, 1.0))
