"""What a run does, or what is wrong with it, in a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from vibroplat.columns import NOT_SYNCHRONIZED, describe_sync
from vibroplat.config.circular import degrees_text
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import percent, quantity
from vibroplat.config.scene import Scene
from vibroplat.observe.section import LATEST_DISTANCE, few_turns
from vibroplat.report.data_sheet import columns
from vibroplat.report.notes import MIN_STROKE, slow_motors
from vibroplat.report.summary import COHERENCE, INACCURATE, MEASURES, synchronization
from vibroplat.results.answer import are_alike, of_both

#: Mean power into motors, over their largest, from which on they brake.
BRAKES = 0.01
#: Ripple of an exciter's speed, over the larger of both speeds, above which one without a motor is stopping.
STOPPING = 0.1
#: Maximum ripple of an exciter at rest, relative to the largest synchronous speed. Minimum measuring interval, in turns
#: at that speed, for the statement that an exciter hardly turns.
AT_REST, ENOUGH = 1e-3, 10.0
#: Size of measures of a machine at rest that are round-off, in SI units and relative to the largest value of the run.
ROUND_OFF = 1e-7
#: Ratio of a transient to the largest stroke above which it is printed.
SETTLED = 0.02


def headline(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what a run does in a sentence, or what is wrong with it."""
    name, outcome = summary["name"], summary["outcome"]
    if outcome not in ("ok", INACCURATE):
        return f"{name}: STOPPED at {quantity(summary['simulated_s'], 's')}: {outcome}"
    parts = _motion(scene, summary)
    return f"{name}: {'INACCURATE, ' if outcome == INACCURATE else ''}{parts}"


def limit_text(stroke: float, transient: float, damped: bool) -> str:
    """Say what a stroke (m) may tend to of which an estimated part is a transient; "" if that is little."""
    if transient <= SETTLED * stroke:
        return ""
    limit = quantity(stroke - transient, "m", error=0.1 * transient)
    return "most is transient" if limit == "0" else f"{'may tend to' if damped else 'steady part'} {limit}"


def _motion(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what the exciters and the platform do in the measured part."""
    frequency, last = summary["excitation_frequency_hz"], summary["measured_to_s"]
    if frequency is None:
        return "nothing measured, the run is too short"
    pace, driven = quantity(frequency, "Hz"), scene.driven(summary["measured_from_s"], last)
    if summary.get("captured_by"):
        wanted = max(scene.synchronous_speeds_at(scene.drive.at(last).frequency)) / TURN
        below = f"{percent(1.0 - frequency / wanted)} below the synchronous speed {quantity(wanted, 'Hz')}"
        return f"CAPTURED by the resonance in {summary['captured_by']}: {pace}, {below}"
    if not summary["measured_turns"] and driven != (False, True):
        return _without_turns(scene, summary, driven)
    off = [str(n) for n, on in enumerate(driven, 1) if not on]
    if len(off) == 1 and transient(scene, summary):
        paces = of_both(speeds_of_both(summary) or [frequency] * 2, "Hz")
        return f"motor {off[0]} is off, its exciter is stopping: exciters at {paces} in the mean"
    return _operation(scene, summary, off)


def _operation(scene: Scene, summary: Mapping[str, Any], off: Sequence[str]) -> str:
    """Return the motion of exciters that turn; ``off`` are the numbers of those whose motor is off."""
    frequency, named = summary["excitation_frequency_hz"], synchronization(summary)
    pace = quantity(frequency, "Hz")
    coasts = "coasts with the motors off"
    if scene.braked(summary["measured_from_s"], summary["measured_to_s"]):
        coasts = "is braked by the motors (supply 0 Hz)"
    if not off and brakes(scene, summary):
        off, coasts = ["1", "2"], "is braked by the motors"
    runs = {0: "runs", 1: f"runs with motor {''.join(off)} off", 2: coasts}[len(off)]
    speeds = speeds_of_both(summary)
    slip = max((motor.slip for motor in slow_motors(scene, summary)), default=0.0)
    below = f", {'up to ' * bool(speeds)}{percent(slip)} below synchronous speed" * bool(slip)
    if named == "none" and speeds and not are_alike(speeds):
        mean = " in the mean" * bool(off[1:])
        return f"{runs}, {NOT_SYNCHRONIZED}: exciters at {of_both(speeds, 'Hz')}{mean}{below}"
    phase = f"phase difference {phase_text(summary)}"
    words = phase if named == "intermediate" else sync_text(scene, summary)
    if off[1:]:
        return f"{runs}, at {pace} ({quantity(60.0 * frequency, 'rpm')}) in the mean, {words}"
    pace += f" ({quantity(60.0 * frequency, 'rpm')}){below}"
    return f"{runs} at {pace}, {words}{_period(summary)}"


def _without_turns(scene: Scene, summary: Mapping[str, Any], driven: tuple[bool, bool]) -> str:
    """Return the motion of exciters of which the first completes no turn in the measuring interval."""
    seconds, mean = summary["measured_to_s"] - summary["measured_from_s"], summary["excitation_frequency_hz"]
    if not any(driven):
        swing = _ripple(summary) > AT_REST * scene.speed_scale
        motors = "braking at 0 Hz" if scene.braked(summary["measured_from_s"], summary["measured_to_s"]) else "off"
        if rests(scene, summary):
            return f"the machine rests, motors {motors}"
        return f"the exciters {'swing out' if swing else 'have come to rest'}, motors {motors}"
    if seconds * scene.speed_scale < ENOUGH * TURN:
        return f"not a whole turn in the measured {quantity(seconds, 's')}: a longer run.duration_s helps"
    speeds = [mean + 0.5 * sign * summary["frequency_split_hz"] for sign in (1.0, -1.0)]
    turns = [speed * seconds >= 1.0 for speed in speeds]
    if turns.count(True) != 1:
        return "the exciters hardly turn"
    turning = turns.index(True)
    return f"exciter {2 - turning} hardly turns, exciter {turning + 1} at {quantity(speeds[turning], 'Hz')}"


def _ripple(summary: Mapping[str, Any]) -> float:
    """Return the larger ripple of the exciters' speeds (rad/s)."""
    return max(summary.get(f"speed_ripple_{n}_hz") or 0.0 for n in (1, 2)) * TURN


def rests(scene: Scene, summary: Mapping[str, Any]) -> bool:
    """Whether a machine moves by no more than round-off in the measured part."""
    strokes = [math.inf if (size := summary.get(f"stroke_{axis}_m")) is None else size for axis in "xy"]
    if summary.get("measured_turns"):
        return False
    return max(strokes) < MIN_STROKE and _ripple(summary) <= AT_REST * scene.speed_scale


def without_round_off(scene: Scene, summary: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the summary of a run, with measures that are round-off as 0 where the machine rests."""
    if not rests(scene, summary):
        return summary
    measured = {*MEASURES, *columns(scene)}
    values = {
        name: v for name, v in summary.items() if name.removeprefix("whole_") in measured and isinstance(v, float)
    }
    small = [n for n, v in values.items() if abs(v) < ROUND_OFF * max(1.0, abs(summary.get(f"whole_{n}") or 0.0))]
    return {**summary, **dict.fromkeys(small, 0.0)}


def brakes(scene: Scene, summary: Mapping[str, Any]) -> bool:
    """Whether motors take power from the machine in the mean, as after a jump to a lower frequency."""
    most: float = summary["excitation_frequency_hz"] * TURN * sum(e.critical_torque_n_m for e in scene.exciter_pair)
    return float(summary.get("motor_power_w") or 0.0) < -BRAKES * most


def transient(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return what exciters do in the measured part if that is no steady operation; "" if it is."""
    driven = scene.driven(summary["measured_from_s"], summary["measured_to_s"])
    if not any(driven):
        if rests(scene, summary):
            return ""
        braked = scene.braked(summary["measured_from_s"], summary["measured_to_s"])
        return "while its motors brake" if braked else "while it coasts down"
    speeds = speeds_of_both(summary) or [0.0, 0.0]
    if brakes(scene, summary):
        return "while its motors brake"
    for n, on in enumerate(driven, 1):
        if not (on or are_alike(speeds)) and (summary.get(f"speed_ripple_{n}_hz") or 0.0) > STOPPING * max(speeds):
            return f"while exciter {n} stops"
    return "" if summary.get("measured_turns") or driven == (False, True) else "without a whole turn"


def kind_of_motion(measures: Mapping[str, Any], period: int, transient: float | None) -> str:
    """Name the kind of a motion in the measured part; ``transient`` is that part of its stroke, None if not steady."""
    if not measures["measured_turns"]:
        return ""
    if transient is None or transient > (SETTLED if period else LATEST_DISTANCE):
        return "undecided"
    if period:
        return "periodic"
    return "undecided" if few_turns(measures["measured_turns"]) else "non-periodic"


def sync_text(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return the name of the synchronization and what it does; where exciters differ, what it mainly does."""
    if not summary["excitation_frequency_hz"]:
        return "the exciters do not turn"
    name = synchronization(summary)
    words = describe_sync(name, scene.rotation)
    return words if scene.has_mirrored_exciters else words.replace(": ", ": mainly ")


def _period(summary: Mapping[str, Any]) -> str:
    turns, change = summary.get("period"), summary.get("stroke_change") or 0.0
    if change > SETTLED:
        return f"; not settled: stroke may fall by {percent(change)}"
    if turns == 0:
        return f"; {repetition_text(summary) or 'does not repeat yet'}"
    return "" if turns is None else f"; repeats every {'turn' if turns == 1 else f'{turns} turns'}"


def repetition_text(summary: Mapping[str, Any]) -> str:
    """Say why it is undecided whether the motion of a run repeats; "" where it is decided or nothing was measured."""
    turns = summary["measured_turns"]
    few = few_turns(turns) if turns and summary["period"] == 0 else ""
    return f"undecided: {few}" if few else ""


def speeds_of_both(summary: Mapping[str, Any]) -> list[float] | None:
    """Return the mean speeds of both exciters (Hz) where they differ."""
    mean, split_hz = summary["excitation_frequency_hz"], summary["frequency_split_hz"]
    return [mean + 0.5 * split_hz, mean - 0.5 * split_hz] if mean and abs(split_hz) > 1e-3 * mean else None


def phase_text(summary: Mapping[str, Any]) -> str | None:
    """Return the mean phase difference in degrees, unless it drifts so much that it has no mean; None if unknown."""
    if summary["phase_coherence"] is not None and summary["phase_coherence"] < COHERENCE:
        return "drifts"
    phase = summary["phase_difference_rad"]
    return None if phase is None else degrees_text(phase)
