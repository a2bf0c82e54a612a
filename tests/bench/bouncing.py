"""Periodic orbits of bodies that hit a shaken table: ours beside those of MapPy, and beside formulas."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from common.shaken_table import GRAVITY, OMEGA, shaken, stable_range

from bench.maps import Bouncing, Spring, missing, rebound
from vibroplat.bench.orbits import processor_time
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import Orbit, beginning_at, orbit
from vibroplat.continuation.tables import orbits
from vibroplat.continuation.test_functions import DOUBLING, FOLD
from vibroplat.hybrid.state import static_rest

KEY = "machine.gravity_m_per_s2"

#: Where MapPy begins to search at each kind of special point: angle of the multiplier, and part of Γ beside the point.
#: It converges from nearby only, and at a fold not from the angle 0.
BEGINS = {FOLD: (0.05, 1e-4), DOUBLING: (math.pi, 1e-3)}


@dataclass(frozen=True)
class Case:
    """Bodies on a table.

    Attributes
    ----------
    gamma, restitution
        Where the orbit is compared.
    ends
        Γ beyond each kind of special point, up to which a branch is followed.
    spring
        With a second mass.
    """

    name: str
    gamma: float
    restitution: float
    ends: dict[str, float]
    spring: Spring | None = None

    @property
    def scene(self) -> Scene:
        """The table, at its frequency of 25 Hz."""
        scene = shaken(self.gamma, self.restitution)
        if self.spring is None:
            return scene
        layers = {"mass_ratio": 1e-12, "layers": 2, "lower_share": self.spring.share}
        layers |= {"natural_frequency_hz": self.spring.frequency * 25.0, "damping_ratio": self.spring.damping}
        return scene.replace({"material": layers})


_LOW, _HIGH = stable_range(0.5)

#: A stop that does not move, as textbooks have it, is no scene of the package; so it is a body of
#: two masses and a spring that hits the table.
CASES = (
    Case("ball on a table", 0.5 * (_LOW + _HIGH), 0.5, {FOLD: 0.98 * _LOW, DOUBLING: 1.05 * _HIGH}),
    Case("two masses and a spring", 3.0, 0.5, {FOLD: 2.3, DOUBLING: 3.7}, Spring(0.5, 0.16, 0.1)),
)


def compare(repeats: int) -> pd.DataFrame:
    """Compare orbits, multipliers and special points; times are processor times (ms), medians over repeats.

    ``rebound`` is the speed from the table after the impact (g/ω), ``multiplier_…`` that of the bodies with the largest
    imaginary part, ``determinant`` the product of theirs. Γ of a special point costs the branch up to it as well: ours
    in steps that it chooses, MapPy's in ten, to 0.1 % from where we have found it, at a fold 0.01 %.
    """
    rows = []
    for case in CASES:
        rows.append(_ours(case, repeats))
        if not missing():
            rows.append(_theirs(case, rows[-1], repeats))
        if case.spring is None:
            rows.append(_formulas(case))
    return pd.DataFrame(rows)


def _formulas(case: Case) -> dict[str, Any]:
    """Return what is known of the ball."""
    cosine = math.pi * (1.0 - case.restitution) / (1.0 + case.restitution)
    sine = math.sqrt(case.gamma**2 - cosine**2)
    trace = (1.0 + case.restitution) ** 2 * (1.0 - sine) - 2.0 * case.restitution
    fold, doubling = stable_range(case.restitution)
    return {
        "case": case.name,
        "program": "formulas",
        "rebound": math.pi - cosine,
        **_multipliers(np.roots([1.0, -trace, case.restitution**2]).astype(complex)),
        "fold_gamma": fold,
        "doubling_gamma": doubling,
    }


def _ours(case: Case, repeats: int) -> dict[str, Any]:
    """Measure ours."""
    scene = case.scene
    found, took = _timed(lambda: orbit(scene, _guess(scene)), repeats)
    speed = float(found.run.events["gap_rate_after_m_per_s"].iloc[0])
    row = {"case": case.name, "program": "vibroplat", "rebound": speed * OMEGA / GRAVITY}
    row |= _multipliers(_bodies(found, 2 if case.spring is None else 4)) | {"orbit_ms": took}
    for kind, name in ((FOLD, "fold"), (DOUBLING, "doubling")):
        plan = {"key": KEY, "start": GRAVITY, "stop": GRAVITY * case.gamma / case.ends[kind], "from": "state"}
        begun = beginning_at(scene, found.state).replace({"orbits": plan | {"switch": []}})
        tables, took = _timed(lambda begun=begun: orbits(begun), repeats)  # type: ignore[misc]
        special = tables.special[tables.special["kind"] == kind].iloc[0]
        row |= {f"{name}_gamma": case.gamma * GRAVITY / special[KEY], f"{name}_ms": took}
    return row


def _guess(scene: Scene) -> Any:
    """Give the orbit a start: that of the ball is known; else the motion settles."""
    return scene.run.initial.state.model_dump() if scene.layers == 1 and scene.run.initial.state else None


def _bodies(found: Orbit, count: int) -> npt.NDArray[np.complex128]:
    """Multipliers that the table alone does not have: those that change with restitution."""
    other = orbit(found.scene.replace({"contact.restitution": found.scene.contact.restitution * 1.001}), found)
    apart = [np.abs(other.multipliers - m).min() for m in found.multipliers]
    return found.multipliers[np.argsort(apart)[-count:]]


def _theirs(case: Case, ours: dict[str, Any], repeats: int) -> dict[str, Any]:
    """Measure MapPy, from our values to three digits."""
    peer = Bouncing(case.restitution, case.spring)
    phase, speed, *rest = (float(f"{value:.3g}") for value in impact(case))
    found, took = _timed(lambda: peer.orbit(phase, speed, case.gamma, tuple(rest)), repeats)
    row = {"case": case.name, "program": "MapPy", "rebound": rebound(found.y, case.gamma)}
    row |= _multipliers(np.asarray(found.eigvals, dtype=complex)) | {"orbit_ms": took}
    for kind, name in ((FOLD, "fold"), (DOUBLING, "doubling")):
        exact = ours[f"{name}_gamma"]
        angle, part = BEGINS[kind]
        beside = exact * (1.0 + math.copysign(part, case.gamma - exact))

        def search(beside: float = beside, angle: float = angle) -> float:
            return peer.special(found.y, case.gamma, beside, angle)

        try:
            value, took = _timed(search, repeats)
            row |= {f"{name}_gamma": value, f"{name}_ms": took}
        except RuntimeError as error:
            row["failed"] = f"{kind}: {error}"
    return row


def impact(case: Case) -> list[float]:
    """Phase of the table at the impact of our orbit, speed after it (g/ω); height and speed of the other mass."""
    scene = case.scene
    run = orbit(scene, _guess(scene)).run
    after = run.trajectory[run.trajectory["t_s"] == run.events["t_s"].iloc[0]].iloc[-1]
    length, rate = GRAVITY / OMEGA**2, GRAVITY / OMEGA
    height = (after["y_m"] - static_rest(scene)[1]) / length
    speed = (after["y_rate_m_per_s"] + after["gap_rate_m_per_s"]) / rate
    found = [math.atan2(height, after["y_rate_m_per_s"] / rate), speed]
    if case.spring is not None:
        found += [height + after["upper_m"] / length, speed + after["upper_rate_m_per_s"] / rate]
    return found


def _multipliers(values: npt.NDArray[np.complex128]) -> dict[str, float]:
    """Columns of the multipliers of bodies."""
    first = values[np.lexsort((values.real, values.imag))[-1]]
    product = np.prod(values).real
    return {"multiplier_re": first.real, "multiplier_im": first.imag, "determinant": float(product)}


def _timed(what: Callable[[], Any], repeats: int) -> tuple[Any, float]:
    """Do something repeatedly; its result, and the median of its processor time (ms)."""
    done = [processor_time(what) for _ in range(repeats)]
    return done[-1][1], 1e3 * statistics.median(seconds for seconds, _ in done)
