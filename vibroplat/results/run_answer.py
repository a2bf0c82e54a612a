"""The answer of a run in a few lines: what it does, or what is wrong; strokes, forces, motors and start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from vibroplat.columns import describe_sync, split
from vibroplat.config.digits import interval, number, quantity, share, spread
from vibroplat.config.scene import Scene
from vibroplat.observe.summary import COHERENCE, INACCURATE, synchronization
from vibroplat.results.answer import are_alike, counted, of_both, short_line

#: Rotation at the exciters' distance, over the largest stroke, above which it is told.
ROCKS = 0.1
#: Ripple of an exciter's speed, over the larger of both speeds, above which one without a motor is stopping.
STOPPING = 0.1
#: Change of places at whole turns, over the largest stroke, above which strokes include a transient.
SETTLED = 0.02
#: Most named points, and springs at them, that are told.
MAX_POINTS = 2


def headline(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what a run does in a sentence, or what is wrong with it."""
    name, outcome = summary["name"], summary["outcome"]
    if outcome not in ("ok", INACCURATE):
        return f"{name}: STOPPED at {quantity(summary['simulated_s'], 's')}: {outcome}"
    told = _motion(scene, summary)
    return f"{name}: {'INACCURATE, ' if outcome == INACCURATE else ''}{told}"


def _motion(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what the exciters and the platform do in the measured part."""
    frequency, last = summary["excitation_frequency_hz"], summary["measured_to_s"]
    if frequency is None:
        return "nothing measured, the run is too short"
    pace, driven = quantity(frequency, "Hz"), scene.driven(summary["measured_from_s"], last)
    named = synchronization(summary)
    if summary.get("captured_by"):
        wanted = [speed / (2.0 * math.pi) for speed in scene.synchronous_speeds_at(scene.drive.at(last).frequency)]
        return f"CAPTURED by the resonance in {summary['captured_by']}: {pace}, {quantity(max(wanted), 'Hz')} wanted"
    if not summary["measured_turns"] and driven != (False, True):
        return f"the exciters {'hardly turn' if any(driven) else 'have come to rest, motors off'}"
    off = [str(n) for n, on in enumerate(driven, 1) if not on]
    if len(off) == 1 and transient(scene, summary):
        paces = of_both(speeds_of_both(summary) or [frequency] * 2, "Hz")
        return f"motor {off[0]} is switched off and its exciter is stopping: exciters at {paces} in the mean"
    runs = {0: "runs", 1: f"runs with motor {''.join(off)} off", 2: "coasts with the motors off"}[len(off)]
    speeds = speeds_of_both(summary)
    if named == "none" and speeds and not are_alike(speeds):
        return f"{runs}, not synchronized: exciters at {of_both(speeds, 'Hz')}"
    phase = f"phase difference {phase_text(summary)}"
    told = {"none": "not synchronized", "intermediate": phase}.get(named) or sync_text(scene, summary)
    return f"{runs} at {pace} ({quantity(60.0 * frequency, 'rpm')}), {told}{'' if off[1:] else _period(summary)}"


def transient(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what exciters do in the measured part if that is no steady operation; "" if it is."""
    driven = scene.driven(summary["measured_from_s"], summary["measured_to_s"])
    if not any(driven):
        return "while it coasts down"
    pace = max(speeds_of_both(summary) or [summary["excitation_frequency_hz"] or 0.0])
    for n, on in enumerate(driven, 1):
        if not on and (summary.get(f"speed_ripple_{n}_hz") or 0.0) > STOPPING * pace:
            return f"while exciter {n} stops"
    return "" if summary.get("measured_turns") or driven == (False, True) else "without a whole turn"


def sync_text(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return the name of the synchronization and what it does; where exciters differ, what it mainly does."""
    told = describe_sync(synchronization(summary), scene.rotation)
    return told if scene.has_mirrored_exciters else told.replace(": ", ": mainly ")


def _period(summary: Mapping[str, Any]) -> str:
    turns = summary.get("period")
    if turns == 0:
        return "; does not repeat yet"
    if (summary.get("stroke_change") or 0.0) > SETTLED:
        return f"; strokes still change by {share(summary['stroke_change'])}"
    return "" if turns is None else f"; repeats every {'turn' if turns == 1 else f'{turns} turns'}"


def speeds_of_both(summary: Mapping[str, Any]) -> list[float] | None:
    """Return the mean speeds of both exciters (Hz) where they differ."""
    mean, split_hz = summary["excitation_frequency_hz"], summary["frequency_split_hz"]
    return [mean + 0.5 * split_hz, mean - 0.5 * split_hz] if mean and abs(split_hz) > 1e-3 * mean else None


def phase_text(summary: Mapping[str, Any]) -> str | None:
    """Return the mean phase difference in degrees, unless it drifts so much that it has no mean; None if unknown."""
    if summary["phase_coherence"] is not None and summary["phase_coherence"] < COHERENCE:
        return "drifts"
    phase = summary["phase_difference_rad"]
    return None if phase is None else quantity(math.degrees(phase), "°")


def short_lines(scene: Scene, summary: Mapping[str, Any]) -> list[str]:
    """Return the few lines below the headline; none of a run that measured nothing."""
    if summary.get("foundation_force_y_rms_n") is None or summary["stroke_y_m"] is None:
        return []
    found = [_strokes(summary), *_rotation(scene, summary), _throw(scene, summary)]
    found += [*_conveying(summary), *_forces(scene, summary)]
    told = [*found, *_motors(scene, summary), _bearings(summary), *_start(summary), *_points(scene, summary)]
    if now := transient(scene, summary):
        window = interval(summary["measured_from_s"], summary["measured_to_s"], "s")
        told.insert(0, short_line("no steady motion", window, f"largest values of this time, {now}"))
    return told


def peak_time(summary: Mapping[str, Any], column: str) -> str:
    """Return when the largest value of the whole run was, and the speed then, as far as they are known."""
    at, pace = (summary.get(f"whole_{split(column)[0]}_at_{end}") for end in ("s", "hz"))
    if at is None:
        return ""
    return ", ".join([quantity(at, "s") if at else "0 s", *([] if pace is None else [quantity(pace, "Hz", digits=3)])])


def peak_text(summary: Mapping[str, Any], column: str, unit: str) -> str:
    """Return the largest value of the whole run, its time and speed, as far as they are known."""
    value, when = summary[f"whole_{column}"], peak_time(summary, column)
    return f"largest {quantity(value, unit)}{f' at {when}' if when else ''}" if value else ""


def static_and_dynamic(summary: Mapping[str, Any]) -> str:
    """Return the force into the foundation along y: the static one and what it varies by; "" if it is not known."""
    mean, most = summary.get("foundation_force_y_mean_n"), summary.get("foundation_force_y_max_n")
    if mean is None or most is None:
        return ""
    varies = summary.get("foundation_force_y_amplitude_n")
    return spread(-mean, max(most - abs(mean), 0.0) if varies is None else varies, "N")


def _strokes(summary: Mapping[str, Any]) -> str:
    strokes = {axis: summary[f"stroke_{axis}_m"] for axis in "xy"}
    axis = max(strokes, key=lambda one: strokes[one])
    other = "xy".replace(axis, "")
    aside = f"{other} {quantity(strokes[other], 'm', largest=strokes[axis])}"
    more = _joined(aside, peak_text(summary, f"stroke_{axis}_m", "m"))
    return short_line(f"stroke {axis}", quantity(strokes[axis], "m"), more)


def _rotation(scene: Scene, summary: Mapping[str, Any]) -> Iterator[str]:
    strokes = max(summary["stroke_x_m"], summary["stroke_y_m"])
    if summary["rms_phi_rad"] * scene.body.distance * 2.0 * math.sqrt(2.0) > ROCKS * strokes:
        yield short_line("rotation", quantity(summary["rms_phi_rad"], "rad"), "RMS of phi")


def _throw(scene: Scene, summary: Mapping[str, Any]) -> str:
    if not scene.has_contact:
        flies = "material that cannot lift off" if scene.material_mass else "no material"
    elif summary["flight_fraction"]:
        impacts = summary["impacts_per_period"]
        told = "1 impact" if number(impacts) == "1.00" else f"{number(impacts)} impacts"
        rate = "" if impacts is None else f", {told} a turn"
        flies = f"material in flight {share(summary['flight_fraction'])}{rate}"
    else:
        flies = "material does not lift off"
    if summary.get("gamma") is not None:
        return short_line("throw index", number(summary["gamma"]), flies)
    return short_line("acceleration", quantity(summary["acceleration_max_m_per_s2"], "m/s²"), flies)


def _conveying(summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield how fast material moves along the deck, and in which modes, in a scene with transport."""
    speed = summary.get("conveying_speed_m_per_s")
    if speed is None:
        return
    slips = summary["slip_plus_fraction"] + summary["slip_minus_fraction"]
    told = f"sticks {share(summary['stick_fraction'])}, slips {share(slips)} of the time"
    if summary.get("throughput_kg_per_s") is not None:
        told = f"{quantity(summary['throughput_kg_per_s'], 'kg/s')}; {told}"
    yield short_line("conveying speed", quantity(speed, "m/s"), told)


def _forces(scene: Scene, summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield forces into the foundation: along y the static one and what it varies by; along x if there is any."""
    x, most = summary["foundation_force_x_max_n"], summary["foundation_force_y_max_n"]
    largest = max(most, x)
    gravity = scene.machine.gravity_m_per_s2
    value = static_and_dynamic(summary) if gravity else quantity(most, "N", largest=largest)
    about = "static ± dynamic" if gravity else ""
    yield short_line("foundation, y", value, _joined(about, peak_text(summary, "foundation_force_y_max_n", "N")))
    if quantity(x, "N", largest=largest) != "0":
        yield short_line("foundation, x", quantity(x, "N"), peak_text(summary, "foundation_force_x_max_n", "N"))


def _motors(scene: Scene, summary: Mapping[str, Any]) -> Iterator[str]:
    on = scene.driven(summary["measured_from_s"], summary["measured_to_s"])
    driven = [n for n, is_on in enumerate(on, 1) if is_on]
    powers = [summary[f"motor_power_{n}_mean_w"] for n in driven]
    if not driven or None in powers:
        return
    ratios, slips = ([summary.get(f"{name}_{n}") for n in driven] for name in ("torque_ratio", "slip"))
    more = [of_both(powers, "W") if powers[1:] else f"motor {driven[0]}"]
    told = {"slip {}": slips, "{} of critical torque": ratios}
    known = [(text, [value for value in values if value is not None]) for text, values in told.items()]
    more += [text.format(share(max(values, key=abs))) for text, values in known if values]
    yield short_line("motor power", quantity(sum(powers), "W"), _joined(*more))


def _bearings(summary: Mapping[str, Any]) -> str:
    forces = [summary[f"bearing_force_{n}_max_n"] for n in (1, 2)]
    alike = are_alike(forces)
    value = quantity(max(forces), "N") if alike else of_both(forces, "N")
    return short_line("bearing force", value, f"{'each exciter, ' if alike else 'of exciters 1 and 2, '}centrifugal")


def _start(summary: Mapping[str, Any]) -> Iterator[str]:
    at = summary["synchronized_at_s"]
    if at and not summary["captured_by"]:
        work = quantity(summary["start_energy_j"], "J")
        yield short_line("start", quantity(at, "s"), f"until synchronized, {work} of motor work")


def _points(scene: Scene, summary: Mapping[str, Any]) -> Iterator[str]:
    names = [*scene.output.points]
    for name in names[:MAX_POINTS]:
        strokes = [summary[f"stroke_{axis}_{name}_m"] for axis in "yx" if f"stroke_{axis}_{name}_m" in summary]
        if strokes:
            y, x = (quantity(stroke, "m", largest=max(strokes)) for stroke in strokes)
            acceleration = quantity(summary.get(f"acceleration_max_{name}_m_per_s2"), "m/s²")
            yield short_line(f"at {name}", f"stroke y {y}", f"x {x}; acceleration {acceleration}")
    for name in [*scene.output.springs][:MAX_POINTS]:
        mean, varies = (summary[f"spring_force_{what}_{name}_n"] for what in ("mean", "amplitude"))
        yield short_line(f"spring at {name}", spread(-mean, varies, "N"), "each, static ± dynamic")
    if names[MAX_POINTS:]:
        yield f"and {counted(len(names) - MAX_POINTS, 'more point')}: -v"


def _joined(*parts: str) -> str:
    return "; ".join(filter(None, parts))
