"""The same machine in other units: the solver must not contain absolute constants."""

from itertools import product

from stability.checks import off, row, sound, spread_over, with_engine
from vibroplat.bench.measure import kinds
from vibroplat.config.scene import Scene
from vibroplat.motion.run import simulate

#: Factors of masses, lengths and times. Powers of two change no digits but may change pivots of linear systems; powers
#: of ten change all digits.
CHOICES = [
    *product((1.0, 2.0**10), (1.0, 2.0**-10), (1.0, 2.0**7)),
    *product((1.0, 1e3, 1e-6), (1.0, 1e-3, 1e3), (1.0, 1e3, 1e-2)),
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


def units(count, engine):
    """Compare at most ``count`` scenes with the same scenes in other units."""
    rows = []
    changes = {"output.sample_rate_hz": 1.0, "run.initial.phase_difference_rad": 2.6}  # symmetric motions have no x, φ
    scenes = {name: with_engine(scene, engine).replace(changes) for name, scene in kinds(1e-8, 1.0).items()}
    expected = {name: simulate(scene, keep="summary").summary for name, scene in scenes.items()}
    for factors, name in spread_over(list(product([c for c in CHOICES if set(c) != {1.0}], scenes)), count):
        scene = Scene.from_tree(converted(scenes[name].to_tree(), factors))
        summary, known = simulate(scene, keep="summary").summary, expected[name]
        limits = {"steps_off": (abs(summary["steps"] / known["steps"] - 1.0), STEPS)}
        for key, dimensions in DIMENSIONS.items():
            value = None if summary[key] is None else summary[key] / unit(dimensions, factors)
            limits[f"{key}_off"] = (off(value, known[key]), ROUNDING)
        label = "{}: masses × {:g}, lengths × {:g}, times × {:g}".format(name, *factors)
        rows.append(row(label, summary["outcome"], limits | sound(scene, summary)))
    return rows


def unit(dimensions, factors):
    return factors[0] ** dimensions[0] * factors[1] ** dimensions[1] * factors[2] ** dimensions[2]


def converted(node, factors, key=""):
    if isinstance(node, dict):
        return {k: converted(v, factors, k) for k, v in node.items()}
    if isinstance(node, list):
        return [converted(v, factors, key) for v in node]
    ends = [end for end in _KEYS if key.endswith(end)]
    if not ends or isinstance(node, bool) or not isinstance(node, int | float):
        return node
    return node * unit(_KEYS[max(ends, key=len)], factors)
