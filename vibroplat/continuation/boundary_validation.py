"""Boundaries checked: on both sides of a point of a curve the motion settles as at a point of a sweep."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vibroplat.config.plans import UNITS, OrbitsPlan, SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.boundaries import ONE_SIDED
from vibroplat.continuation.event_sequence import spelled, whole
from vibroplat.continuation.kinds import BRANCH_POINT, DOUBLING, FOLD, TORUS
from vibroplat.continuation.shooting import Shooter
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import with_value
from vibroplat.study.point import measure_point
from vibroplat.study.store import Record

#: Distances from the curve, across it, over the ranges of the keys, one after the other until both sides differ as they
#: should: nearer ones, where settling takes longer, only where another boundary is as near.
ASIDE = (1.0 / 400.0, 1.0 / 2000.0, 1.0 / 10000.0)
#: Motion that does not repeat settles this long (s); a sweep gives motion that draws together some times as much.
LONGEST = 20.0
#: A motion that stays by an orbit is nearer to it than one that has left it by this factor.
NEARER = 3.0
#: Distance of a multiplier from the unit circle that counts, beside the one that passes it.
OUTSIDE = 1e-3

AGREES, DIFFERS, UNDECIDED, UNSTABLE, FAILED = "agrees", "differs", "undecided", "unstable", "failed"


@dataclass(frozen=True)
class Side:
    """What was found on one side.

    Attributes
    ----------
    period
        Turns after which the motion repeats; 0 if it does not.
    word
        Sequence of events in a period.
    distance
        From the orbit on the curve, on the section φ₁ = 0, in the scales of the scene.
    """

    period: int
    word: str
    distance: float

    def __str__(self) -> str:
        return f"period {self.period}: {spelled(self.word)}" if self.period else "no period"


def others_outside(kind: str, multipliers: npt.NDArray[np.complex128]) -> int:
    """Count the multipliers outside the unit circle but those that pass it at a special point of a kind."""
    passing = {FOLD: 1.0, BRANCH_POINT: 1.0, DOUBLING: -1.0}
    rest = multipliers
    if kind in passing and rest.size:
        rest = np.delete(rest, np.argmin(np.abs(rest - passing[kind])))
    elif kind == TORUS:
        pairs = np.flatnonzero(np.abs(rest.imag) > 0.0)
        rest = np.delete(rest, pairs[np.argsort(np.abs(np.abs(rest[pairs]) - 1.0))[:2]])
    return int((np.abs(rest) > 1.0 + OUTSIDE).sum())


def chosen(rows: Sequence[Record], plan: OrbitsPlan) -> list[int]:
    """Choose the points of a curve that are checked: inner ones, evenly along it."""
    if len(rows) < 3:
        return []
    assert plan.boundaries is not None
    places = np.array([[row["value"] / plan.unit, row["second"] / plan.boundaries.unit] for row in rows])
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    wanted = lengths[-1] * (np.arange(plan.boundaries.check) + 0.5) / max(plan.boundaries.check, 1)
    return sorted({int(np.abs(lengths[1:-1] - length).argmin()) + 1 for length in wanted})


def across(rows: Sequence[Record], place: int, plan: OrbitsPlan) -> tuple[float, float]:
    """Find the direction across a curve at a point, to where the first key is larger, in units of the keys."""
    assert plan.boundaries is not None
    before, after = rows[place - 1], rows[place + 1]
    one = (after["value"] - before["value"]) / plan.unit
    other = (after["second"] - before["second"]) / plan.boundaries.unit
    length = math.copysign(math.hypot(one, other), other) or 1.0
    return other / length, -one / length


def check(scene: Scene, plan: OrbitsPlan, kind: str, row: Record, way: tuple[float, float]) -> Record:
    """Settle on both sides of a point of a curve, and compare with what its kind says.

    Parameters
    ----------
    row
        Of the curve, with the orbit there.
    way
        Direction across the curve, in units of the keys.

    Returns
    -------
    dict
        Columns ``below``, ``above`` and ``check`` of the table of boundaries.
    """
    if row["others_outside"]:
        return {"check": UNSTABLE}
    assert plan.boundaries is not None
    orbit = _on_section(scene, plan, row)
    found: Record = {"check": FAILED}
    for share in ASIDE:
        length = share * UNITS
        changes = length * way[0] * plan.unit, length * way[1] * plan.boundaries.unit
        sides = []
        for sense in (-1.0, 1.0):
            values = {
                plan.key: row["value"] + sense * changes[0],
                plan.boundaries.key: row["second"] + sense * changes[1],
            }
            sides.append(_settled(scene, values, row, orbit))
        below, above = sides
        if below is None or above is None:
            continue
        said = {"below": str(below), "above": str(above)}
        if differ(kind, row, below, above):
            return said | {"check": AGREES}
        if found["check"] != DIFFERS:
            found = said | {"check": DIFFERS if below.period or above.period else UNDECIDED}
    return found


def differ(kind: str, row: Record, below: Side, above: Side) -> bool:
    """Whether what was found on both sides of a boundary differs as its kind says."""
    turns: int = abs(row["turns"][0])
    repeats = [side.period == turns for side in (below, above)]
    stays = [again and side.word == row["word"] for again, side in zip(repeats, (below, above), strict=True)]
    if kind in ONE_SIDED:
        return stays[0] != stays[1]
    if kind in (DOUBLING, TORUS):
        return repeats[0] != repeats[1] and any(stays)
    near, far = sorted((below.distance, above.distance))
    return repeats[0] != repeats[1] or NEARER * near < far


def _on_section(scene: Scene, plan: OrbitsPlan, row: Record) -> FloatArray:
    """Points of an orbit of a curve on the section φ₁ = 0, in the scales of the scene, shape (turns, 14)."""
    assert plan.boundaries is not None
    for key, value in ((plan.key, row["value"]), (plan.boundaries.key, row["second"])):
        scene = with_value(scene, key.split("."), value)
    points = []
    with closing(Shooter(scene)) as shooter:
        shooter.motion.reset(np.array(row["state"]))
        for _ in range(abs(row["turns"][0])):
            shooter.motion.to_section(1, 2.0 * row["period_s"])
            points.append(_point(shooter.motion.state, scene, shooter.scales))
    return np.array(points)


def _settled(scene: Scene, values: Mapping[str, float], row: Record, orbit: FloatArray) -> Side | None:
    """Let the motion settle from an orbit nearby; None if the values of the keys are not allowed or it ends early."""
    try:
        scene = scene.replace(values)
    except ConfigError:
        return None
    supply = scene.drive.at(0.0).frequency_at(0.0)
    plan = SweepPlan.model_validate(
        {
            "supply_frequency_hz": {"start": supply, "stop": supply},
            "max_settle_s": LONGEST,
            "measure_s": row["period_s"],
            "lyapunov": False,
        }
    )
    point = measure_point(scene, plan, row["state"], (0,))
    if point.state is None:
        return None
    period, state = int(point.row["period"]), np.array(point.state)
    with closing(Shooter(scene)) as shooter:
        seconds = period / abs(point.row["excitation_frequency_hz"])
        word = whole(shooter.shot(state, seconds).word, scene.contact.restitution) if period else ""
        distance = np.abs(orbit - _point(state, scene, shooter.scales)).max(axis=1).min()
    return Side(period, word, float(distance))


def _point(state: FloatArray, scene: Scene, scales: FloatArray) -> FloatArray:
    """Return a state on the section in the scales of the scene, with the phase difference instead of the angles."""
    found = state / scales
    phase = state[3:5] @ scene.phase_weights
    found[3:5] = math.cos(phase), math.sin(phase)
    return found
