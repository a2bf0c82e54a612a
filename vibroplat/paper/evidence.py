"""The evidence by which the paper's claims are judged: branches of one machine, by mass ratio, R and contact model."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.model.parameters import FloatArray
from vibroplat.study.branches import EXCITATION, SUPPLY, SweepBranch
from vibroplat.study.point import ERRORS
from vibroplat.study.store import Record

#: Row of a sweep table, by column.
Row = dict[str, Any]
#: Column of the frequency over which curves are drawn.
F = EXCITATION

#: Allowed error of the ends of a band (Hz of excitation frequency): the paper's step is 0.5 Hz of supply frequency.
EDGE = 0.25
#: Distance of neighbouring rows (Hz) above which a curve is not interpolated between them.
MAX_INTERPOLATED_GAP = 1.0

#: The regimes that claims name, as conditions on a row. Undecided motion is in none of MOTIONS; motion is called
#: ``non-periodic`` in a row if its Lyapunov exponent was not asked for.
REGIMES: dict[str, Callable[[Row], bool]] = {
    "antiphase": lambda row: row["sync"] == "antiphase",
    "in-phase": lambda row: row["sync"] == "in-phase",
    "attached": lambda row: row["flight_fraction"] == 0.0,
    "period-1": lambda row: row["period"] == 1,
    "period-1 with flight": lambda row: row["period"] == 1 and row["flight_fraction"] > 0.0,
    "periodic": lambda row: row["motion"] == "periodic",
    "non-periodic": lambda row: row["motion"] in ("quasi-periodic", "chaotic", "non-periodic"),
}
MOTIONS = ("period-1", "period-1 with flight", "periodic", "non-periodic")


class PaperCurve(NamedTuple):
    """A curve of the paper: mass ratio, restitution, contact model, impact law, direction."""

    mass_ratio: float
    restitution: float = 0.0
    model: str = "impact"
    law: str = "conservative"
    direction: str = "up"

    @property
    def text(self) -> str:
        """Mass ratio, restitution if there is one, and another model than that of impacts."""
        parts = [f"μ {self.mass_ratio:g}", *([f"R {self.restitution:g}"] if self.restitution else [])]
        return ", ".join([*parts, *([self.model] if self.model != "impact" else [])])


#: The branches by which the contact models are compared.
IMPACT_CURVE, NON_IMPACT_CURVE = PaperCurve(0.2), PaperCurve(0.2, model="non-impact")


class RegimeChange(NamedTuple):
    """The rows before and after a change of regime."""

    before: Row
    after: Row

    @property
    def middle(self) -> float:
        """Excitation frequency (Hz) in its middle."""
        return float(0.5 * (self.before[F] + self.after[F]))


class Step(NamedTuple):
    """A step of a branch in which a regime ends or begins: supply frequencies (Hz) of the rows before and after."""

    curve: PaperCurve
    regime: str
    begins: bool
    before: float
    after: float


class BranchRecords(NamedTuple):
    """A branch and the rows of its points in the sweep table, each with its supply frequency and its final state."""

    branch: SweepBranch
    rows: list[Row]


@dataclass
class Evidence:
    """Branches of one machine.

    Attributes
    ----------
    branches
        Branches and the rows of their points.
    beta
        β of the non-impact model (1/s); None if there is none.
    boundaries
        Boundaries narrowed by further points (:func:`vibroplat.paper.root_finding.narrow`), by the step of the sweep in
        which they are. Any other boundary is as wide as its step.
    read
        The steps whose boundaries have been read: those that are worth narrowing.
    """

    branches: dict[PaperCurve, BranchRecords] = field(default_factory=dict)
    beta: float | None = None
    boundaries: dict[Step, RegimeChange] = field(default_factory=dict)
    read: dict[Step, None] = field(default_factory=dict, compare=False)

    def add(self, branch: SweepBranch, records: Iterable[Record]) -> None:
        """Add a branch by the records of its points; one that is there already, as sweeps share branches, is kept."""
        points = zip(branch.key_values, records, strict=True)
        rows = [record["row"] | {SUPPLY: supply, "state": record["state"]} for supply, record in points]
        mass_ratio, contact = branch.scene.material.mass_ratio, branch.scene.contact
        curve = PaperCurve(mass_ratio, contact.restitution, contact.model, contact.impact_law, branch.direction)
        self.branches.setdefault(curve, BranchRecords(branch, rows))

    def restitutions(self, mass_ratio: float) -> list[PaperCurve]:
        """Return the upward curves of the impact model that a mass ratio has, in the order of R."""
        return sorted(curve for curve in self.branches if curve == PaperCurve(mass_ratio, curve.restitution))

    def rows(self, curve: PaperCurve, low: float = 0.0, high: float = math.inf, *, decided: str = "") -> list[Row]:
        """Return the rows of a branch that ended ``ok`` between two excitation frequencies (Hz); it may be missing.

        With a regime ``decided`` only rows that are known to be inside or outside of it.
        """
        rows = self.branches[curve].rows if curve in self.branches else []
        rows = [row for row in rows if row["outcome"] == "ok" and low <= row[F] <= high]
        return [row for row in rows if row["motion"] != "undecided"] if decided in MOTIONS else rows

    def amplitudes(self, curve: PaperCurve, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Interpolate RMS y (m) of a branch's antiphase motion at excitation frequencies (Hz), shape (n,).

        The result are its values and their standard errors, shape (n,): nan and inf beyond the rows and across jumps.
        The errors of neighbouring rows are taken as independent.
        """
        rows = [row for row in (*self.rows(curve), *(self.jump(curve) or ())) if row["sync"] == "antiphase"]
        rows.sort(key=lambda row: float(row[F]))
        if len(rows) < 2:
            return np.full(len(at), np.nan), np.full(len(at), np.nan)
        f, values, errors, across = np.array(
            [(row[F], row["rms_y_m"], error_of(row, "rms_y_m"), error_of(row, F)) for row in rows]
        ).T
        # an error of the frequency moves a curve by its slope, here the steeper one; above 0, as inf · 0 is nan
        slope = np.maximum(np.abs(np.diff(values) / np.maximum(np.diff(f), 1e-6)), 1e-300)
        errors = errors + across * np.maximum(np.append(slope, 0.0), np.insert(slope, 0, 0.0))
        index = np.clip(np.searchsorted(f, at), 1, len(f) - 1)
        gap = np.diff(f)[index - 1]
        between = np.where(gap > MAX_INTERPOLATED_GAP, np.nan, np.interp(at, f, values, left=np.nan, right=np.nan))
        part = np.clip((at - f[index - 1]) / np.maximum(gap, 1e-12), 0.0, 1.0)
        with np.errstate(invalid="ignore"):
            mixed = np.hypot((1.0 - part) * errors[index - 1], part * errors[index])
        return between, np.nan_to_num(mixed, nan=np.inf, posinf=np.inf)

    def jump(self, curve: PaperCurve) -> RegimeChange | None:
        """Find where antiphase rotation below the second resonance ends."""
        return self.end_of(curve, "antiphase", 20.0)

    def end_of(self, curve: PaperCurve, regime: str, above: float = 0.0) -> RegimeChange | None:
        """Find where a branch leaves a regime for the first time above an excitation frequency (Hz).

        Returns None if the branch is never in the regime there, or does not leave it.
        """
        holds, inside = REGIMES[regime], False
        for before, after in pairwise(self.rows(curve, decided=regime)):
            inside = holds(before) and (inside or before[F] >= above)
            if inside and not holds(after):
                return self._narrowed(Step(curve, regime, False, before[SUPPLY], after[SUPPLY]), before, after)
        return None

    def start_of_last(self, curve: PaperCurve, regime: str) -> RegimeChange | None:
        """Find where the regime begins in which a branch ends.

        Returns None if the branch does not end in this regime, or is in it from its first row on.
        """
        rows, holds = self.rows(curve, decided=regime), REGIMES[regime]
        changes = [(before, after) for before, after in pairwise(rows) if holds(after) and not holds(before)]
        if not changes or not holds(rows[-1]):
            return None
        before, after = changes[-1]
        return self._narrowed(Step(curve, regime, True, before[SUPPLY], after[SUPPLY]), before, after)

    def _narrowed(self, step: Step, before: Row, after: Row) -> RegimeChange:
        self.read[step] = None
        return self.boundaries.get(step, RegimeChange(before, after))


def error_of(row: Row, column: str) -> float:
    """Return the standard error of a measure: 0 if the motion is periodic, inf if the error is not known."""
    error = row.get(ERRORS[column])
    if error is not None and math.isfinite(error):
        return float(error)
    return 0.0 if row["motion"] == "periodic" else math.inf
