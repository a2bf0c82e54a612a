"""Changes that must not affect a motion: tolerance, engine, time origin, whole turns, mirroring."""

import math

from common.known import TURN

from stability.checks import off, row, sound, spread_over, steady, with_engine
from vibroplat.bench.scenes import kinds
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.motion.run import simulate

SCENES = ("attached, f_e 46", "impacts, f_e 50", "one layer, f_e 50", "bare, f_e 50")
#: Compared statistics.
STATISTICS = (
    "rms_x_m",
    "rms_y_m",
    "rms_phi_rad",
    "excitation_frequency_hz",
    "flight_fraction",
    "contact_force_max_n",
    "impulse_max_n_s",
    "impacts_per_period",
)
#: Largest relative difference of a statistic from its value at 1e-11, over the tolerance. The largest force and impulse
#: are single values; the motor's speed turns phase errors into slow oscillations that decay slowly.
FACTOR = 2e3
REFERENCE = 1e-11
TOLERANCES = (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: Seconds to settle and to measure.
SETTLE, MEASURE = 12.0, 2.0


def invariance(count, engine):
    """Apply changes that must not matter to at most ``count`` scenes that are not chaotic."""
    unequal = {"motors": [{"critical_slip": 0.15}, {"critical_slip": 0.16}], "solver.engine": engine}
    scenes = {name: kinds(1e-7, SETTLE + MEASURE)[name].replace(unequal) for name in SCENES}
    cases = [(name, *changed) for name, scene in scenes.items() for changed in _changes(scene).items()]
    expected = {}
    rows = []
    for name, change, changed in spread_over(cases, count):
        if name not in expected:
            expected[name] = steady(scenes[name].replace({"solver.tolerance": REFERENCE}), SETTLE, MEASURE)
        found = steady(changed, SETTLE, MEASURE)
        allowed = FACTOR * changed.solver.tolerance
        limits = {f"{key}_off": (off(found[key], expected[name][key]), allowed) for key in STATISTICS}
        phase = expected[name]["phase_difference_rad"]
        away = math.remainder(found["phase_difference_rad"] - (-phase if change == "mirrored" else phase), TURN)
        limits["phase_off_rad"] = (abs(away), allowed)
        rows.append(row(f"{name}: {change}", found["outcome"], limits | sound(changed, found)))
    return rows


def _changes(scene):
    """Return variants that must have the same statistics."""
    changed = {f"tolerance {t:g}": scene.replace({"solver.tolerance": t}) for t in TOLERANCES}
    changed |= {engine: with_engine(scene, engine) for engine in ("sundae", "taylor")}
    changed["whole turns"] = scene.replace(
        {"run.initial": {"phi1_rad": 14.0 * TURN, "phase_sum_rad": math.pi - 6.0 * TURN}}
    )
    state = simulate(scene.replace({"run.duration_s": 3.21}), keep="summary").final_state
    return changed | {"later": _from(scene, state), "mirrored": _mirrored(scene)}


def _mirrored(scene):
    """Exchange the exciters with their motors and mirror the start: x → −x, φ → −φ, φ₁ → π − φ₂, φ₂ → π − φ₁."""
    start = simulate(scene.replace({"run.duration_s": 0.5}), keep="summary").final_state
    state = start.copy()
    for place in (0, 2, 7, 9):
        state[place] = -start[place]
    state[3], state[4], state[10], state[11] = math.pi - start[4], math.pi - start[3], -start[11], -start[10]
    other = {"counter-clockwise": "clockwise", "clockwise": "counter-clockwise"}
    exciters = [e.model_dump() | {"rotation": other[e.rotation or ""]} for e in reversed(scene.exciter_pair)]
    return _from(scene.replace({"exciters": exciters}), state)


def _from(scene, state):
    """Return a scene that begins with a full state."""
    names = (*COORDINATES, *RATES)
    named = {names[i]: float(state[i]) for index in scene.coordinates for i in (index, index + 7)}
    return scene.replace(run={"duration_s": scene.run.duration_s, "initial": {"state": named}})
