"""Checks of the stability suite and their report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import FORCE_ERROR, force_spread, state_scales
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import GAP
from vibroplat.motion.motion import OUTCOMES, Motion
from vibroplat.observe.audit import INACCURATE
from vibroplat.observe.summary import measured

T = TypeVar("T")

#: A measured value (None or nan if there is none) and its limit.
Limit = tuple[float | None, float]

#: Largest energy residual over tolerance and steps: each step may be off by about the tolerance, and the errors may
#: add up. In a campaign of 10 000 random scenes the largest is 2.8, the median 6e-4.
ENERGY = 5.0
#: The same for vertical momentum; its scale is the impulse of the springs, which the error of every step changes.
MOMENTUM = 5.0
#: Largest gap and contact force below zero, in units of their scales, over the tolerance.
GAP_BELOW, PULL = 1.0, 10.0


def sound(scene: Scene, summary: Mapping[str, Any]) -> dict[str, Limit]:
    """Return the limits that hold for every run: gap, contact force, energy and momentum.

    A motion that diverges where the model breaks down need not satisfy the balances.
    """
    tolerance, steps = scene.solver.tolerance, max(summary["steps"], 1)
    limits: dict[str, Limit] = {}
    if summary["outcome"] != "beyond-model":
        limits["energy_residual"] = (summary["energy_residual"], ENERGY * tolerance * steps)
        if scene.contact.impact_law != "printed":  # which does not keep the upper layer's momentum
            limits["momentum_residual"] = (summary["momentum_residual"], MOMENTUM * tolerance * steps)
    if scene.has_contact:
        below = abs(min(summary["gap_min_m"], 0.0)) / state_scales(scene)[GAP]
        limits["gap_below"] = (below, GAP_BELOW * tolerance)
        allowed = min(PULL * tolerance * force_spread(scene), FORCE_ERROR * scene.force_scale)
        limits["pull_n"] = (summary["contact_pull_n"] or 0.0, allowed)
    return limits


def with_engine(scene: Scene, engine: str) -> Scene:
    """Return a scene with an engine."""
    return scene.replace({"solver.engine": engine})


def steady(scene: Scene, settle: float, measure: float) -> dict[str, Any]:
    """Let a scene settle (s) and then measure (s); return the measures with outcome and steps."""
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine)
        motion.advance(settle)
        part = motion.advance(measure)
        work = {"outcome": motion.outcome, "detail": motion.detail, "steps": engine.work["steps"] or 0}
    return measured(part) | work


def row(name: str, outcome: str, limits: Mapping[str, Limit], *, allowed: Iterable[str] = ("ok",)) -> dict[str, Any]:
    """Make the row of a scene: its values, the one closest to its limit, and those beyond their limits.

    A value of nan exceeds its limit, and so does an outcome that is not allowed.
    """
    shares = {key: _share(*limit) for key, limit in limits.items()}
    worst = max(shares, key=lambda key: shares[key], default="")
    failed = [f"{key} {_number(limits[key][0])}, allowed {limits[key][1]:.3g}" for key, s in shares.items() if s > 1]
    if outcome not in allowed:
        failed.insert(0, f"outcome {outcome}")
    figures = {key: value for key, (value, _) in limits.items()}
    return {"scene": name, "outcome": outcome, **figures, "worst": worst, "share": shares.get(worst, 0.0)} | {
        "failed": "; ".join(failed)
    }


#: Named outcomes.
NAMED = frozenset((*OUTCOMES.values(), INACCURATE))


def overview(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return a row for each situation and engine: scenes, outcomes, failures, and the value closest to its limit."""
    rows = []
    parts = [(name, *part) for name, table in tables.items() for part in table.groupby("engine", sort=False)]
    for name, engine, table in parts:
        nearest = table.iloc[int(table["share"].to_numpy().argmax())]
        counts = table["outcome"].value_counts()
        rows.append(
            {
                "situation": name,
                "engine": engine,
                "scenes": len(table),
                "failed": int((table["failed"] != "").sum()),
                "outcomes": ", ".join(f"{outcome} {count}" for outcome, count in counts.items()),
                "nearest": f"{nearest['worst']} {nearest[nearest['worst']]:.2g}, {nearest['share']:.2g} of its limit",
                "in_scene": nearest["scene"],
            }
        )
    return pd.DataFrame(rows)


def side_by_side(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Put the rows of each scene one below the other, in the order of the first table."""
    table = pd.concat(tables, ignore_index=True)
    return table.sort_values("scene", key=lambda names: pd.Series(pd.factorize(names)[0], names.index), kind="stable")


def off(found: float | None, expected: float | None) -> float:
    """Relative difference of two values; the found value itself if the expected one is 0."""
    if found is None or expected is None:
        return 0.0 if found == expected else math.nan
    return abs(found / expected - 1.0) if expected else abs(found)


def spread_over(items: Sequence[T], count: int) -> list[T]:
    """Choose evenly spaced items of a list."""
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, min(count, len(items))).astype(int))]


def _share(value: float | None, limit: float) -> float:
    if value is None or not math.isfinite(value):
        return math.inf
    return value / limit if limit > 0.0 else (math.inf if value > 0.0 else 0.0)


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.3g}"
