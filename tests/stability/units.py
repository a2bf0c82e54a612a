"""The same machine in other units: the solver must not contain absolute constants."""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

from stability.checks import Limit, off, row, sound, spread_over, with_engine
from vibroplat.bench.scenes import kinds
from vibroplat.config.scene import Scene
from vibroplat.motion.run import simulate


class Units(NamedTuple):
    """Factors of masses, lengths and times."""

    mass: float
    length: float
    time: float


#: Powers of two change no digits but may change pivots of linear systems; powers of ten change all digits.
CHOICES = [
    *(Units(*u) for u in product((1.0, 2.0**10), (1.0, 2.0**-10), (1.0, 2.0**7))),
    *(Units(*u) for u in product((1.0, 1e3, 1e-6), (1.0, 1e-3, 1e3), (1.0, 1e3, 1e-2))),
]
#: Dimensions (mass, length, time) of compared statistics.
DIMENSIONS = {
    "rms_x_m": (0, 1, 0),
    "rms_y_m": (0, 1, 0),
    "rms_phi_rad": (0, 0, 0),
    "excitation_frequency_hz": (0, 0, -1),
    "phase_difference_rad": (0, 0, 0),
    "flight_fraction": (0, 0, 0),
    "contact_force_max_n": (1, 1, -2),
    "impulse_sum_n_s": (1, 1, -1),
    "motor_work_j": (1, 2, -2),
    "impacts": (0, 0, 0),
}
#: Relative difference that rounding may cause in a statistic within a second, and in the number of steps: the order of
#: the method may depend on the last digit.
ROUNDING, STEPS = 1e-6, 0.1
TOLERANCE = 1e-8

#: Dimensions of keys by the ends of their names; other keys are dimensionless.
_KEYS = {
    "_kg": (1, 0, 0),
    "_kg_m2": (1, 2, 0),
    "_m": (0, 1, 0),
    "_n_per_m": (1, 0, -2),
    "_n_m_per_rad": (1, 2, -2),
    "_n_s_per_m": (1, 0, -1),
    "_n_m_s_per_rad": (1, 2, -1),
    "_m_per_s2": (0, 1, -2),
    "_n_m": (1, 2, -2),
    "_hz": (0, 0, -1),
    "_m_per_s": (0, 1, -1),
    "_per_s": (0, 0, -1),
    "_s": (0, 0, 1),
}


def units(count: int, engine: str) -> list[dict[str, Any]]:
    """Compare at most ``count`` scenes with the same scenes in other units."""
    rows: list[dict[str, Any]] = []
    changes = {"output.sample_rate_hz": 1.0, "run.initial.phase_sum_rad": 2.6}  # symmetric motions have no x, φ
    scenes = {name: with_engine(scene, engine).replace(changes) for name, scene in kinds(TOLERANCE, 1.0).items()}
    expected = {name: simulate(scene, keep="summary").summary for name, scene in scenes.items()}
    others = [other for other in CHOICES if other != Units(1.0, 1.0, 1.0)]
    for other, (name, scene) in spread_over(list(product(others, scenes.items())), count):
        rows.append(_compared(name, converted(scene, other), other, expected[name]))
    return rows


def converted(scene: Scene, other: Units) -> Scene:
    """Return a scene in other units."""

    def convert(node: Any, key: str = "") -> Any:
        if isinstance(node, dict):
            return {k: convert(v, k) for k, v in node.items()}
        if isinstance(node, list):
            return [convert(v, key) for v in node]
        ends = [end for end in _KEYS if key.endswith(end)]
        if not ends or isinstance(node, bool) or not isinstance(node, int | float):
            return node
        mass, length, time = _KEYS[max(ends, key=len)]
        return node * other.mass**mass * other.length**length * other.time**time

    return Scene.from_tree(convert(scene.to_tree()))


def _compared(name: str, scene: Scene, other: Units, expected: dict[str, Any]) -> dict[str, Any]:
    summary = simulate(scene, keep="summary").summary
    limits: dict[str, Limit] = {}
    for key, (mass, length, time) in DIMENSIONS.items():
        unit = other.mass**mass * other.length**length * other.time**time
        value = None if summary[key] is None else summary[key] / unit
        limits[f"{key}_off"] = (off(value, expected[key]), ROUNDING)
    share = abs(summary["steps"] / expected["steps"] - 1.0)
    limits["steps_off"] = (share, STEPS)
    label = f"{name}: masses × {other.mass:g}, lengths × {other.length:g}, times × {other.time:g}"
    return row(label, summary["outcome"], limits | sound(scene, summary))
