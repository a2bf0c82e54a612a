"""What a branch has passed before: points and special points of its own, and of others of its family."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from vibroplat.config.plans import OrbitsPlan
from vibroplat.study.store import Record

#: Distance of two special points, as a part of the key's range, within which they are one.
SAME_PLACE = 1e-4
#: Points back within which a branch that meets itself has not gone round, but come back from a corner.
RETURN = 8
RETURNED = "no point beyond a corner: the branch came back on itself"
#: Measures that tell points apart, and how far that of a point may lie from a former one, as a part of the step between
#: its neighbours, to be the same. Where impacts accumulate, the parts of a branch between its folds differ in stability
#: much more than in other measures.
MEASURES = ("period_s", "rms_x_m", "rms_y_m", "rms_phi_rad", "motor_power_w")
COMPARED = dict.fromkeys(MEASURES, 0.1) | {"multiplier_1_re": 0.3}


def same_special(one: Record, other: Record, plan: OrbitsPlan) -> bool:
    """Whether two branches have found the same point where they cross."""
    near = abs(one["value"] - other["value"]) <= SAME_PLACE * abs(plan.stop - plan.start)
    frequencies = one["excitation_frequency_hz"], other["excitation_frequency_hz"]
    return bool(near and one["kind"] == other["kind"] and abs(frequencies[0] / frequencies[1] - 1.0) < SAME_PLACE)


def seen(special: Record) -> Record:
    """Return what tells a special point from others, see :func:`same_special`."""
    return {name: special[name] for name in ("kind", "value", "excitation_frequency_hz")}


def compared(row: Record) -> Record:
    """Return what tells points apart."""
    return {name: row[name] for name in ("value", "period", "sequence", "phase_difference_rad", *COMPARED)}


class Known(NamedTuple):
    """What a part of a branch is told of all that is known of its family.

    Attributes
    ----------
    special
        Special points from which other branches have been followed.
    others
        Numbers and points of other branches.
    own
        Points of this branch.
    """

    special: Sequence[Record]
    others: Sequence[tuple[int, Sequence[Record]]]
    own: Sequence[Record]

    def met_again(self, rows: Sequence[Record]) -> str:
        """Say in which way a branch has passed the last of its new points before; empty if it has not."""
        row = rows[-1]
        for number, former in self.others:
            mirrored = _passed(row, former)
            if mirrored is not None:
                return f"{'mirror image of' if mirrored else 'joins'} branch {number}"
        own = [*self.own, *rows[:-1]][:-2]
        mirrored = _passed(row, own)
        if mirrored is None:
            return ""
        back = not mirrored and _passed(row, own[-RETURN:]) is not None
        return RETURNED if back else "mirror image" if mirrored else "loop"


def _passed(row: Record, former: Sequence[Record]) -> bool | None:
    """Whether a branch has passed a point: None if not, else whether as its mirror image."""
    beyond = np.fromiter(map(itemgetter("value"), former), float, len(former)) - row["value"]
    for i in np.flatnonzero(beyond[:-1] * beyond[1:] <= 0.0).tolist():
        first, second = former[i], former[i + 1]
        if row["period"] != first["period"] or row["sequence"] not in (first["sequence"], second["sequence"]):
            continue
        low, high = sorted((first["value"], second["value"]))
        thirds = [p for p in (*former[max(i - 1, 0) : i], *former[i + 2 : i + 3]) if not low <= p["value"] <= high]
        ways = [[first, second], *([first, second, third] for third in thirds)]
        if any(all(_near(row, *alike, known) for alike in COMPARED.items()) for known in ways):
            here, there = row["phase_difference_rad"], first["phase_difference_rad"]
            apart, mirrored = (abs(np.angle(np.exp(1j * (here - sign * there)))) for sign in (1, -1))
            return bool(mirrored < apart - 1e-6)
    return None


def _near(row: Record, name: str, part: float, known: Sequence[Record]) -> bool:
    """Whether a measure lies on the polynomial through those of known points, as exactly as it can be told."""
    first, second = known[0][name], known[1][name]
    expected = 0.0
    for point in known:
        weight = 1.0
        for other in known:
            if other is not point:
                weight *= (row["value"] - other["value"]) / (point["value"] - other["value"] or math.inf)
        expected += weight * point[name]
    return bool(abs(row[name] - expected) <= part * abs(second - first) + 1e-7 * abs(expected) + 1e-12)
