"""The measures of two motions of a scene are compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

from vibroplat.check.changes import FLOOR, MULTIPLE
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.observe.summary import COHERENCE
from vibroplat.study.point import ERRORS

#: Standard errors of the difference of two means over blocks that are allowed. With eight blocks each it follows
#: Student's distribution with 14 degrees of freedom, beyond six of them once in 30 000 cases.
SIGMAS: Final = 6.0
#: Change under repetitions, over the standard error, from which on errors of the tolerance have become those of chance:
#: of independent motions, one in 10 000 times all repetitions stay below it.
CHANCE: Final = 0.1
#: Columns that say what kind of motion a row is.
CLASS: Final = ("outcome", "sync", "motion", "period")

_EXPONENT: Final = "lyapunov_per_s"
_PHASE: Final = "phase_difference_rad"
_ERRORS: Final = ERRORS | {_EXPONENT: "lyapunov_error_per_s"}

#: A row of the sweep table.
Row = Mapping[str, Any]


class Difference(NamedTuple):
    """The difference of a column between two engines, and what is allowed, in units of the column."""

    column: str
    first: float
    other: float
    difference: float
    allowed: float
    scale: float


def scales_of(scene: Scene) -> dict[str, float]:
    """Return the scales of the columns that are compared, in their units."""
    scales, speed = state_scales(scene), scene.speed_scale
    torque = sum(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    frequency = speed / (2.0 * math.pi)
    return {
        "excitation_frequency_hz": frequency,
        "frequency_split_hz": frequency,
        "rms_x_m": float(scales[0]),
        "rms_y_m": float(scales[1]),
        "rms_phi_rad": float(scales[2]),
        "amplitude_y_m": float(scales[1]),
        _PHASE: 1.0,
        "phase_coherence": 1.0,
        "flight_fraction": 1.0,
        "impacts_per_period": 1.0,
        "gap_max_m": float(scales[GAP]),
        "contact_force_max_n": force_spread(scene),
        "impulse_max_n_s": scene.material_mass * float(scales[GAP_RATE]),
        "motor_power_w": torque * speed,
        _EXPONENT: frequency,
    }


def class_of(row: Row) -> tuple[Any, ...]:
    """Return the kind of motion that a row is of."""
    return tuple(row.get(column) for column in CLASS)


def compared(scene: Scene, plan: SweepPlan, first: Sequence[Row], other: Sequence[Row]) -> list[Difference]:
    """Compare two rows of one class, each with repetitions of the class, which show what is allowed.

    Means over blocks of chaotic motion may differ by SIGMAS of their standard errors; so may those of other motion that
    does not repeat if repetitions differ by a share of them. Otherwise both motions are the same from start to end, and
    so are their means, whatever scatters from block to block. Extremes of motion that does not repeat have no standard
    error and are not compared. Motions that settled for different times are compared to the settling tolerance, which
    is how far from the steady motion either may be.

    Parameters
    ----------
    scene, plan
        Of the point.
    first, other
        Rows of the first engine and of the other one, each with its repetitions after it.
    """
    one, two = first[0], other[0]
    floor = FLOOR * scene.solver.tolerance
    turn = 2.0 * math.pi / scene.speed_scale
    if abs((one.get("settle_s") or 0.0) - (two.get("settle_s") or 0.0)) > turn:
        floor = max(floor, plan.settle_tolerance)
    found = []
    for column, scale in scales_of(scene).items():
        if scale == 0.0 or _absent(one, column) or _absent(two, column):
            continue
        pairs = [(rows[0], row) for rows in (first, other) for row in rows[1:] if not _absent(row, column)]
        change = max((_apart(column, *pair) for pair in pairs), default=0.0)
        error = math.hypot(*(row.get(_ERRORS.get(column, "")) or 0.0 for row in (one, two)))
        by_chance = one.get("motion") == "chaotic" or column == _EXPONENT or change > CHANCE * error
        allowed = floor * scale + MULTIPLE * change + (SIGMAS * error if by_chance else 0.0)
        found.append(Difference(column, one[column], two[column], _apart(column, one, two), allowed, scale))
    return found


def _absent(row: Row, column: str) -> bool:
    """Whether a row has no value of a column that can be compared."""
    if row.get(column) is None:
        return True
    if column == _PHASE and (row.get("sync") == "none" or (row.get("phase_coherence") or 0.0) < COHERENCE):
        return True
    return row.get("period") == 0 and row.get(_ERRORS.get(column, "")) is None


def _apart(column: str, one: Row, two: Row) -> float:
    """Return how far two values are apart; angles at most half a turn."""
    difference = abs(float(one[column]) - float(two[column]))
    return abs(math.remainder(difference, 2.0 * math.pi)) if column == _PHASE else difference
