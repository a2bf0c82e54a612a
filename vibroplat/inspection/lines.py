"""The lines of an inspection: the answer first, then one quantity a line."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from vibroplat.columns import unit_of
from vibroplat.config.circular import degrees_text
from vibroplat.config.digits import MISSING, NEGLIGIBLE, given, interval, number, percent, quantity, spread, together
from vibroplat.inspection.material import BANDS, ERROR, STRAIGHT
from vibroplat.results.answer import fitting, of_both, short_line

Numbers = Mapping[str, Any]

#: Most characters of the name of a machine, and the ratio of frequencies that are far from each other.
MACHINE, FAR = 36, 2.0
#: Change of ranges from which on material that jumps has not settled.
MAX_CHANGE = 0.02
#: Centrifugal forces of both exciters.
FORCE = "centrifugal_force_{}_n"


def answer(name: str, v: Numbers) -> str:
    """Return the answer in a sentence, and how a start ends."""
    load = _load(v)
    sync, speeds = v[f"{load}expected"], [v[f"{load}excitation_frequency_{i}_hz"] for i in (1, 2)]
    if not any(speeds):
        return f"{name[:MACHINE]}: no motor drives, the exciters rest"
    at = _speeds(v, load) if sync == "none" else quantity(speeds[0], "Hz")
    expected, where = f"{'no synchronization' if sync == 'none' else sync} expected at {at}", _where(v, max(speeds))
    empty = "without material" if v["loaded_expected"] and not load else ""
    off = f"driven until {quantity(v['motors_off_s'], 's')}" if math.isfinite(v["motors_off_s"]) else ""
    start = f"a start {v['start']}" if v["start"] else ""
    below = f" below {quantity(v['passage_frequency_hz'], 'Hz', digits=3)}" if "captured" in start else ""
    return fitting(f"{name[:MACHINE]}: ", [expected, start + below, off, empty, where])


def short_lines(v: Numbers) -> list[str]:
    """Return the lines below the answer; remarks that do not fit into a line are left out."""
    return [short_line(title, value, "; ".join(filter(None, remarks))) for title, value, *remarks in _rows(v)]


def _where(v: Numbers, speed: float) -> str:
    """Compare a speed (Hz) with the resonances of the axes along which the platform moves."""
    axes = {axis: v[f"natural_frequency_{axis}_hz"] for axis in v["moving_axes"].split(", ")}
    ratios = [speed / resonance if resonance else math.inf for resonance in axes.values()]
    side = "above" if min(ratios) > 1.0 else "below" if max(ratios) < 1.0 else "between"
    far = "far " if min(ratios) > FAR or max(ratios) < 1.0 / FAR else ""
    names = ", ".join(f"{axis.replace('phi', 'φ')} {number(resonance)}" for axis, resonance in axes.items())
    return f"{far}{side} resonance{'s' * (len(axes) > 1)} ({names} Hz)"


def _load(v: Numbers) -> str:
    """Return how names of the loaded machine begin; nothing if only the empty one is known."""
    return "loaded_" if math.isfinite(v["loaded_stroke_y_m"]) else ""


def _apart(v: Numbers) -> bool:
    """Return whether both exciters turn, and at different speeds."""
    return math.isnan(v["excitation_frequency_hz"]) and all(v[f"excitation_frequency_{i}_hz"] for i in (1, 2))


def _speeds(v: Numbers, load: str) -> str:
    """Write the speeds of both exciters: once if they turn together."""
    both = [v[f"{load}excitation_frequency_{i}_hz"] for i in (1, 2)]
    return quantity(both[0], "Hz") if both[0] == both[1] else " and ".join(quantity(one, "Hz") for one in both)


def _rows(v: Numbers) -> Iterator[tuple[str, ...]]:
    """Yield name, value and remarks of each quantity: of the loaded machine, and what differs of the empty one."""
    texts = {name: quantity(value, unit_of(name)) for name, value in v.items() if isinstance(value, float)}
    load = _load(v)

    def both(name: str) -> str:
        return of_both([v[name.format(i)] for i in (1, 2)], unit_of(name))

    def empty(text: str) -> str:
        return f"empty {text}" if load else ""

    weighed = "loaded_" if math.isfinite(v["loaded_mass_kg"]) else ""
    yield "mass", *_mass(v), f"sag {v['spring_sags'] or texts[f'{weighed}static_sag_m']}"
    moments, force = " + ".join(number(v[f"static_moment_{i}_kg_m"]) for i in (1, 2)), both(load + FORCE)
    fastest = max(v[f"{load}excitation_frequency_{i}_hz"] for i in (1, 2))
    alike = v[f"{load}excitation_frequency_1_hz"] == v[f"{load}excitation_frequency_2_hz"]
    speed = _speeds(v, load) + (f" ({quantity(60.0 * fastest, 'rpm')})" if alike and fastest else "")
    yield "static moment", f"{moments} kg·m", f"centrifugal {force} at {speed}", empty(_speeds(v, ""))
    beat = "where both vibrations add" if _apart(v) else ""
    far_above = f"{texts['stroke_far_above_m']} far above resonance" if v["expected"] != "none" else ""
    yield "stroke", _strokes(v, load), empty(_strokes(v, "")), far_above, beat
    yield "throw index", _throw(v, load), *_throw_angle(v), empty(_throw(v, "")), *_of_material(v, load)
    if math.isfinite(v["unique_friction"]):
        yield "conveying speed", *_conveying(v)
    axes = ("x", "y", "phi", "y_loaded_1", "y_loaded_2")
    x, y, phi, *contact = (number(v[f"natural_frequency_{axis}_hz"]) for axis in axes)
    with_load = " and ".join(frequency for frequency in contact if frequency != MISSING)
    damping = ", ".join(percent(v[f"damping_ratio_{axis}"]) for axis in axes[:3])
    resting = f"with material y {with_load}" if with_load else ""
    near = [f"{v[f'mode_{axis}'].replace('phi', 'φ')} {size}" for axis, size in zip(axes[:3], (x, y, phi), strict=True)]
    yield "resonances (Hz)", ", ".join(near), resting, f"damping {damping}"
    yield "foundation force", _foundation(v, load), *_beside(v, load)
    yield "torque at rest", both("starting_torque_{}_n_m"), f"to lift {both('lifting_torque_{}_n_m')}", _passing(v)
    power, friction = f"power {texts[f'{load}motor_power_w']}", f"friction {both('friction_torque_{}_n_m')}"
    yield "running", both(f"{load}motor_torque_{{}}_n_m"), power, empty(texts["motor_power_w"]), friction
    yield "synchronization", *_synchronization(v, load, both("synchronous_speed_{}_hz"))


def _passing(v: Numbers) -> str:
    """Write the torque that passes a resonance and what both motors give there."""
    if not v["passage_axis"]:
        return "no resonance below holds the motors" if v["start"] else ""
    where = f"{v['passage_axis'].replace('phi', 'φ')} ({quantity(v['passage_frequency_hz'], 'Hz', digits=3)})"
    if v["passage_available_n_m"] <= 0.0:
        return f"no torque left at {where}"
    needed = together([v["passage_torque_n_m"], v["passage_available_n_m"]], "N·m", " of ")
    return f"to pass {where} {needed}"


def _mass(v: Numbers) -> tuple[str, ...]:
    """Return the mass and what it consists of."""
    empty, load, material = (v[f"{name}_kg"] for name in ("mass", "loaded_mass", "material_mass"))
    if not material:
        return quantity(empty, "kg"), "with unbalances", "no material"
    if load > 0.0:
        part = f"{percent(material / empty)} of the empty {quantity(empty, 'kg')}"
        return quantity(load, "kg"), f"with {quantity(material, 'kg')} of material, {part}"
    return quantity(empty, "kg"), f"with unbalances; {quantity(material, 'kg')} of material cannot lift off"


def _throw(v: Numbers, load: str) -> str:
    """Write a throw index, 0 if it is negligible."""
    size = v[f"{load}throw_index"]
    return number(0.0 if size < NEGLIGIBLE else size)


def _throw_angle(v: Numbers) -> Iterator[str]:
    """Yield the direction of the throw to the deck, of a path that is no circle, if material may move along it."""
    if v["path_ratio"] <= STRAIGHT:
        yield f"at {quantity(math.degrees(v['throw_angle_rad']), '°')} to the deck"
    elif math.isfinite(v["path_ratio"]):
        yield f"elliptic path, axis ratio {number(v['path_ratio'], 2)}"


def _conveying(v: Numbers) -> Iterator[str]:
    """Yield the expected conveying speed, or for what there is a formula."""
    low, high = v["conveying_speed_low_m_per_s"], v["conveying_speed_high_m_per_s"]
    ranges = ", ".join(f"{given(first)} … {given(last)}" for (first, last), _ in BANDS)
    text = (
        "formulas are for straight paths"
        if v["path_ratio"] > STRAIGHT
        else f"formulas valid only for throw index {ranges}"
    )
    known = math.isfinite(low)
    yield interval(low, high, "m/s") if known else MISSING
    yield f"formula of practice; simulations are up to {percent(ERROR)} off" if known else text


def _of_material(v: Numbers, load: str) -> Iterator[str]:
    """Yield what the material does."""
    if load:
        yield f"not settled: ranges change by {percent(v['loaded_change'])}" if v["loaded_change"] > MAX_CHANGE else ""
        yield "material lifts off" if v["loaded_throw_index"] > 1.0 else "material stays on the deck"
    elif not math.isfinite(v["throw_index"]):
        yield "no gravity: all numbers are of the empty machine" if v["material_mass_kg"] else ""
    elif v["loaded_expected"] and max(v[f"excitation_frequency_{i}_hz"] for i in (1, 2)):
        yield "empty; with material –, no common speed"


def _foundation(v: Numbers, load: str) -> str:
    """Write weight and dynamic force along y."""
    weight, along = v[f"{load}static_force_n"], v[f"{load}dynamic_force_y_n"]
    largest = max(weight, v["centrifugal_force_1_n"] + v["centrifugal_force_2_n"])
    return spread(weight, along, "N") if along > NEGLIGIBLE * largest else quantity(weight, "N")


def _beside(v: Numbers, load: str) -> Iterator[str]:
    """Yield the remarks on the force into the foundation."""
    yield "along y, empty" if v["loaded_expected"] and not load else "along y"
    if v["isolation"] > 0.0:
        size = percent(v["isolation"]) if v["isolation"] < 1.0 else f"{number(v['isolation'])} times"
        makes = v["dynamic_force_y_n"] / v["isolation"]
        total = v["centrifugal_force_1_n"] + v["centrifugal_force_2_n"]
        reach = f"{size} of {quantity(makes, 'N')}" if makes > NEGLIGIBLE * total else ""
        yield f"empty {_foundation(v, '')}{reach and f': {reach}'}" if load else reach and f"{reach} reach it"
    across = v[f"{load}dynamic_force_x_n"]
    if across > NEGLIGIBLE * max(v[f"{load}dynamic_force_y_n"], v[f"{load}static_force_n"]):
        yield f"along x ± {quantity(across, 'N')}"


def _synchronization(v: Numbers, load: str, synchronous: str) -> Iterator[str]:
    """Yield the synchronization, and what else there is."""
    none = v["expected"] == "none"
    yield v["expected"] + ("" if none else f" at {degrees_text(v['phase_difference_rad'])}")
    resting = [i for i in (1, 2) if not v[f"excitation_frequency_{i}_hz"]]
    yield f"exciter {resting[0]} comes to rest" if len(resting) == 1 else ""
    yield f"synchronous speeds {synchronous}" if none and not resting else ""
    if v["loaded_expected"] and not none:
        yield (
            "with and without material"
            if v["loaded_expected"] == v["expected"]
            else f"with material {v['loaded_expected']}"
        )
    if v["holding_axis"]:
        resonance = quantity(v[f"natural_frequency_{v['holding_axis']}_hz"], "Hz", digits=3)
        name = v[f"mode_{v['holding_axis']}"].replace("phi", "φ")
        yield f"resonance of {name} ({resonance}) decides"
    yield v["coexisting"] and (f"{v['coexisting']} is stable, too" if none else f"also {v['coexisting']}")
    yield f"holds torques {quantity(v['holding_torque_n_m'], 'N·m')} apart"


def _strokes(v: Numbers, load: str) -> str:
    """Write the strokes along x and y, without one that is negligible."""
    sizes = {axis: v[f"{load}stroke_{axis}_m"] for axis in "xy"}
    least = NEGLIGIBLE * max(*sizes.values(), v["stroke_far_above_m"])
    return ", ".join(f"{axis} {quantity(size, 'm')}" for axis, size in sizes.items() if size > least) or "0"
