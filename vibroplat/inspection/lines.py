"""The twelve lines of an inspection: the answer first, then one quantity a line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vibroplat.config.digits import MISSING, NEGLIGIBLE, number, quantity, share, spread

Numbers = Mapping[str, Any]
#: Name, value and remark of a quantity.
Row = tuple[str, str, str]

#: Widths of a row's name and value.
NAME, VALUE = 21, 24
#: Torque to pass a resonance over what there is from which on a start is tight.
TIGHT = 0.7
#: Relative difference up to which both exciters are told once, and ratio of frequencies that are far from each other.
EQUAL, FAR = 0.01, 2.0
NO_MATERIAL = "no material"


def twelve_lines(name: str, v: Numbers) -> list[str]:
    """Write the lines of the numbers of an inspection."""
    rows = (_mass, _moments, _stroke, _throw, _frequencies, _sag, _foundation, _at_rest, _passing, _running, _sync)
    found = [_headline(name, v)]
    for row in rows:
        title, value, note = row(v)
        found.append(f"  {title:<{NAME}}{value:<{VALUE - 1}} {note}".rstrip())
    return found


def _headline(name: str, v: Numbers) -> str:
    ratio = v["excitation_frequency_hz"] / v["natural_frequency_y_hz"]
    far = "far " if ratio > FAR or ratio < 1.0 / FAR else ""
    where = f"{far}{'above' if ratio > 1.0 else 'below'} resonance"
    speed = f"{_frequency(v)} ({quantity(60.0 * v['excitation_frequency_hz'], 'rpm')})"
    machine = f"{quantity(v['mass_kg'], 'kg')} on springs of {quantity(v['natural_frequency_y_hz'], 'Hz', digits=3)}"
    sync = "no synchronization" if v["expected"] == "none" else v["expected"]
    start = f", {_verdict(v['passage_ratio'])} from rest" if v["passage_axis"] else ""
    return f"{name}: {machine}, {speed} {where}; expected: {sync}{start}"


def _mass(v: Numbers) -> Row:
    more = v["loaded_mass_kg"] / v["mass_kg"] - 1.0
    material = (
        f"with material {quantity(v['loaded_mass_kg'], 'kg')} ({share(more)} more)" if more > 0.0 else NO_MATERIAL
    )
    return "mass", quantity(v["mass_kg"], "kg"), f"with unbalances; {material}"


def _moments(v: Numbers) -> Row:
    moments = " + ".join(number(v[f"static_moment_{i}_kg_m"]) for i in (1, 2))
    force = _pair(v, "centrifugal_force_{}_n", "N")
    return "static moment", f"{moments} kg·m", f"centrifugal force {force} at {_frequency(v)}"


def _stroke(v: Numbers) -> Row:
    far = f"{quantity(v['stroke_far_above_m'], 'm')} far above resonance"
    if not _has_material(v):
        return "stroke", _strokes(v, ""), far
    moving = f"with material {_strokes(v, 'loaded_')}, {share(max(v['moving_fraction'], 0.0))} of it moves along"
    return "stroke", _strokes(v, ""), f"{moving}; {far}"


def _strokes(v: Numbers, load: str) -> str:
    """Write the strokes along x and y, without one that is nothing beside the other."""
    sizes = {axis: v[f"{load}stroke_{axis}_m"] for axis in "xy"}
    told = {axis: size for axis, size in sizes.items() if size > NEGLIGIBLE * max(sizes.values())}
    return ", ".join(f"{axis} {quantity(size, 'm')}" for axis, size in told.items())


def _throw(v: Numbers) -> Row:
    loaded = f"with material {number(v['loaded_throw_index'])}; it lifts off from 1 on"
    return "throw index", number(v["throw_index"]), loaded if _has_material(v) else NO_MATERIAL


def _frequencies(v: Numbers) -> Row:
    x, y, phi = (number(v[f"natural_frequency_{axis}_hz"]) for axis in ("x", "y", "phi"))
    ratios = ", ".join(share(v[f"damping_ratio_{axis}"]) for axis in ("x", "y", "phi"))
    loaded = [
        number(f) for f in (v["natural_frequency_y_loaded_1_hz"], v["natural_frequency_y_loaded_2_hz"]) if f > 0.0
    ]
    contact = f"y with material in contact {' and '.join(loaded)}; " if loaded else ""
    return "natural frequencies", f"x {x}, y {y}, φ {phi} Hz", f"{contact}damping ratios {ratios}"


def _sag(v: Numbers) -> Row:
    if not _has_material(v):
        return "static sag", quantity(v["static_sag_m"], "m"), f"spring force {quantity(v['static_force_n'], 'N')}"
    empty = f"empty {quantity(v['static_sag_m'], 'm')} and {quantity(v['static_force_n'], 'N')}"
    force = f"spring force {quantity(v['loaded_static_force_n'], 'N')}; {empty}"
    return "static sag", quantity(v["loaded_static_sag_m"], "m"), force


def _foundation(v: Numbers) -> Row:
    load = "loaded_" if _has_material(v) else ""
    force = spread(v[f"{load}static_force_n"], v[f"{load}dynamic_force_y_n"], "N")
    total = v["centrifugal_force_1_n"] + v["centrifugal_force_2_n"]
    size = share(v["isolation"]) if v["isolation"] < 1.0 else f"{number(v['isolation'])} times"
    x = v[f"{load}dynamic_force_x_n"]
    along = f"; along x ± {quantity(x, 'N')}" if x > NEGLIGIBLE * v[f"{load}dynamic_force_y_n"] else ""
    return "force on foundation", force, f"along y; {size} of {quantity(total, 'N')} reach it{along}"


def _at_rest(v: Numbers) -> Row:
    needed = _pair(v, "lifting_torque_{}_n_m", "N·m")
    breakdown = _pair(v, "critical_torque_{}_n_m", "N·m")
    ratios = [v[f"starting_torque_{i}_n_m"] / max(v[f"lifting_torque_{i}_n_m"], 1e-300) for i in (1, 2)]
    lifts = f" ({number(min(ratios))} times)" if max(ratios) < 1e6 else ""
    return "motor at rest", _pair(v, "starting_torque_{}_n_m", "N·m"), f"lifts {needed}{lifts}; breakdown {breakdown}"


def _passing(v: Numbers) -> Row:
    title = "passing resonance"
    if not v["passage_axis"]:
        return title, "any torque" if v["passage_torque_n_m"] == 0.0 else MISSING, "no resonance below holds the motors"
    where = f"{v['passage_axis'].replace('phi', 'φ')} at {quantity(v['passage_frequency_hz'], 'Hz')}"
    available = v["passage_available_n_m"]
    needed = quantity(v["passage_torque_n_m"], "N·m", size=available).partition(" ")[0]
    value = f"{needed} of {quantity(available, 'N·m')}"
    steady = f"if slowly {quantity(v['passage_steady_torque_n_m'], 'N·m')}"
    return title, value, f"in {where}: {_verdict(v['passage_ratio'])}; {steady}"


def _running(v: Numbers) -> Row:
    friction = f"bearing friction {_pair(v, 'friction_torque_{}_n_m', 'N·m')}"
    power = f"{quantity(v['motor_power_w'], 'W')} in all"
    loaded = v["loaded_motor_power_w"]
    more = f", with material {quantity(loaded, 'W')}" if loaded > 0.0 else ""
    return "running", _pair(v, "motor_torque_{}_n_m", "N·m"), f"{friction}; {power}{more}"


def _sync(v: Numbers) -> Row:
    phase = v["phase_difference_rad"]
    at = "" if math.isnan(phase) else f" at {quantity(math.degrees(phase), '°')}"
    loaded = f"with material {v['loaded_expected']}; " if _has_material(v) else ""
    others = f"also {v['coexisting']}; " if v["coexisting"] else ""
    alone = ""
    if v["expected"] == "none":
        speeds = [quantity(v[f"synchronous_speed_{i}_hz"], "Hz") for i in (1, 2)]
        alone = f"synchronous speeds {' and '.join(speeds)}; "
    holds = f"holds torques that differ by {quantity(v['holding_torque_n_m'], 'N·m')}"
    return "synchronization", f"{v['expected']}{at}", f"{alone}{loaded}{others}{holds}"


def _has_material(v: Numbers) -> bool:
    return bool(v["loaded_expected"])


def _frequency(v: Numbers) -> str:
    return quantity(v["excitation_frequency_hz"], "Hz")


def _verdict(ratio: float) -> str:
    if ratio < TIGHT:
        return "passes the resonance"
    return "passes the resonance barely" if ratio < 1.0 else "captured by the resonance"


def _pair(v: Numbers, name: str, unit: str) -> str:
    """Write what both exciters have, once if it is equal."""
    first, second = (v[name.format(i)] for i in (1, 2))
    largest = max(abs(first), abs(second))
    if abs(first - second) <= EQUAL * largest:
        return f"{quantity(first, unit)} each"
    return f"{quantity(first, unit, size=largest)} and {quantity(second, unit, size=largest)}"
