"""The twelve lines of an inspection: the answer first, then one quantity a line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from vibroplat.columns import unit_of
from vibroplat.config.digits import MISSING, NEGLIGIBLE, number, quantity, share, spread
from vibroplat.results.answer import of_both

Numbers = Mapping[str, Any]

#: Widths of a line, of the name of its quantity, of the value, and of the name of a machine.
WIDTH, NAME, VALUE, MACHINE = 110, 18, 23, 36
#: Torque to pass a resonance over what there is from which on a start is tight, and ratio of frequencies that are far
#: from each other.
TIGHT, FAR = 0.7, 2.0


def twelve_lines(name: str, v: Numbers) -> list[str]:
    """Write the lines of the numbers of an inspection; remarks that do not fit into a line are left out."""
    rows = [_line(f"  {title:<{NAME}}{value:<{VALUE}}", remarks) for title, value, *remarks in _rows(v)]
    return [_line(f"{name[:MACHINE]}: ", _answer(v)), *rows]


def _line(begin: str, remarks: Sequence[str]) -> str:
    told = [remark for remark in remarks if remark]
    while len(begin + "; ".join(told)) > WIDTH:
        told.pop()
    return (begin + "; ".join(told)).rstrip()


def _answer(v: Numbers) -> list[str]:
    """Return the answer in a sentence, and how a start ends."""
    ratio = v["excitation_frequency_hz"] / v["natural_frequency_y_hz"]
    far = "far " if ratio > FAR or ratio < 1.0 / FAR else ""
    sync = "no synchronization" if v["expected"] == "none" else v["expected"]
    resonance = quantity(v["natural_frequency_y_hz"], "Hz", digits=3)
    where = f"{far}{'above' if ratio > 1.0 else 'below'} resonance ({resonance})"
    expected = f"{sync} expected at {quantity(v['excitation_frequency_hz'], 'Hz')}, {where}"
    return [expected, f"a start {_verdict(v)}" if v["passage_axis"] else ""]


def _verdict(v: Numbers) -> str:
    if v["passage_ratio"] < TIGHT:
        return "passes"
    return "barely passes" if v["passage_ratio"] < 1.0 else "is captured"


def _rows(v: Numbers) -> Iterator[tuple[str, ...]]:
    """Yield name, value and remarks of each quantity."""
    told = {name: quantity(value, unit_of(name)) for name, value in v.items() if isinstance(value, float)}
    load = "loaded_" if v["loaded_expected"] else ""

    def both(name: str) -> str:
        return of_both([v[name.format(i)] for i in (1, 2)], unit_of(name))

    def loaded(text: str) -> str:
        return f"with material {text}" if load else ""

    mass = "no material"
    if v["loaded_mass_kg"] > 0.0:
        mass = f"with material {told['loaded_mass_kg']} ({share(v['loaded_mass_kg'] / v['mass_kg'] - 1.0)} more)"
    yield "mass", told["mass_kg"], "with unbalances", mass
    speed = f"{told['excitation_frequency_hz']} ({quantity(60.0 * v['excitation_frequency_hz'], 'rpm')})"
    moments, force = " + ".join(number(v[f"static_moment_{i}_kg_m"]) for i in (1, 2)), both("centrifugal_force_{}_n")
    yield "static moment", f"{moments} kg·m", f"centrifugal force {force} at {speed}"
    yield "stroke", _strokes(v, ""), loaded(_strokes(v, load)), f"{told['stroke_far_above_m']} far above resonance"
    moving = f"lifts off from 1 on; {share(max(v['moving_fraction'], 0.0))} of it moves along"
    yield "throw index", told["throw_index"], loaded(told["loaded_throw_index"]), load and moving
    axes = ("x", "y", "phi", "y_loaded_1", "y_loaded_2")
    x, y, phi, *contact = (number(v[f"natural_frequency_{axis}_hz"]) for axis in axes)
    with_load = loaded(f"y {' and '.join(frequency for frequency in contact if frequency != MISSING)}")
    damping = ", ".join(share(v[f"damping_ratio_{axis}"]) for axis in axes[:3])
    yield "resonances (Hz)", f"x {x}, y {y}, φ {phi}", with_load, f"damping {damping}"
    sag, weight = told["static_sag_m"], told["static_force_n"]
    empty = f"empty {sag} and {weight}" if load else ""
    yield "static sag", told[f"{load}static_sag_m"], f"spring force {told[f'{load}static_force_n']}", empty
    total = quantity(v["centrifugal_force_1_n"] + v["centrifugal_force_2_n"], "N")
    size = share(v["isolation"]) if v["isolation"] < 1.0 else f"{told['isolation']} times"
    along, across = (v[f"{load}dynamic_force_{axis}_n"] for axis in "yx")
    sideways = f"along x ± {quantity(across, 'N')}" if across > NEGLIGIBLE * along else ""
    foundation = spread(v[f"{load}static_force_n"], along, "N")
    yield "foundation force", foundation, "along y", f"{size} of {total} reach it", sideways
    lifting = [v[f"starting_torque_{i}_n_m"] / (v[f"lifting_torque_{i}_n_m"] or math.nan) for i in (1, 2)]
    lifts = f"lifts {both('lifting_torque_{}_n_m')} ({number(min(lifting))} times)"
    yield "motor at rest", both("starting_torque_{}_n_m"), lifts, f"breakdown {both('critical_torque_{}_n_m')}"
    needed = f"{told['passage_torque_n_m']} of {told['passage_available_n_m']}"
    where = f"{v['passage_axis'].replace('phi', 'φ')} at {told['passage_frequency_hz']}"
    passes = (needed, f"in {where}: a start {_verdict(v)}", f"{told['passage_steady_torque_n_m']} if infinitely slow")
    yield "passing resonance", *(passes if v["passage_axis"] else ("any torque", "no resonance below holds the motors"))
    friction = f"friction {both('friction_torque_{}_n_m')}"
    powers = ", ".join(filter(None, (told["motor_power_w"], loaded(told["loaded_motor_power_w"]))))
    yield "running", both("motor_torque_{}_n_m"), friction, f"power {powers}"
    none = v["expected"] == "none"
    at = "" if none else f" at {quantity(math.degrees(v['phase_difference_rad']), '°')}"
    alone = f"synchronous speeds {both('synchronous_speed_{}_hz')}" if none else ""
    other = v["coexisting"] and f"also {v['coexisting']}"
    holds = f"holds torques {told['holding_torque_n_m']} apart"
    yield "synchronization", f"{v['expected']}{at}", alone, loaded(v["loaded_expected"]), other, holds


def _strokes(v: Numbers, load: str) -> str:
    """Write the strokes along x and y, without one that is nothing beside the other."""
    sizes = {axis: v[f"{load}stroke_{axis}_m"] for axis in "xy"}
    least = NEGLIGIBLE * max(*sizes.values(), v["stroke_far_above_m"])
    return ", ".join(f"{axis} {quantity(size, 'm')}" for axis, size in sizes.items() if size > least) or "0"
