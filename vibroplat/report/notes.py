"""Notes on what was measured: where the model is inaccurate, where motors are captured, what samples do not resolve.

Each is a short sentence without a semicolon, because the sweep table joins them by one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.coordinates import COORDINATES, RATES, TURN
from vibroplat.config.digits import given, number, percent, quantity
from vibroplat.config.engine_choice import chosen_engine
from vibroplat.config.engines import uses_sundials
from vibroplat.config.plausibility import HINT, WARNING
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes
from vibroplat.kernels.compiled import FloatArray
from vibroplat.observe.conveying import INTERNAL_FRICTION
from vibroplat.report.data_sheet import steady_supply

#: Rotation of the platform (rad) beyond which a model of first order in φ is inaccurate.
LARGE_ROTATION = 0.1
#: Slip over critical slip above which a motor counts as captured: it gives more than 0.6 of its critical torque.
CAPTURED = 1.0 / 3.0
#: How the notes end on an exciter that stays far below its synchronous speed.
HELPS_START = "more torque or a longer run may help"
#: Change of the phase difference over the measured part (rad) above which it is noted.
DRIFTING = 0.1
#: Tolerance of SUNDIALS above which impacts that amplify errors make measures inaccurate: with a restitution of 0.99
#: the quickstart's RMS of y was 6 % off at 1e-3 and 0.2 % at 1e-4.
COARSE = 1e-4
#: Steps of engine ``taylor`` that a turn of the synchronous speed needs, and a restart.
STEPS_A_TURN, STEPS_A_RESTART = 5.0, 2.0
#: Multiple of them above which a scene counts as stiff for it. Engine ``native`` is as fast at 10 to 11, with a damped
#: layer of 1 kHz in calm contact as with a critical slip of 0.001.
STIFF = 10.0
#: Stroke along one axis over that along the other up to which a motion is symmetric; a perturbation that breaks this.
SYMMETRIC, DISTURBANCE = 1e-3, 0.01
#: Strokes (m) that are round-off.
MIN_STROKE = 1e-9
#: How many exciters there are.
EXCITERS = 2
#: Fraction of the contact from which on shear inside is told.
MIN_SHEARED_FRACTION = 0.05
#: Throw index at which a flight without rebound lasts a whole period, √(1 + π²) (Holmes 1982).
WHOLE_PERIOD = math.hypot(1.0, math.pi)
#: Relative difference of speeds up to which exciters turn together; range of angles of a swing (rad) from which on it
#: is told, and least whole turns in which it is seen.
EQUAL_SPEEDS, MIN_SWING_RAD, MIN_ROWS = 1e-3, 0.02, 8


def notes_on_measures(scene: Scene, measures: Mapping[str, Any]) -> list[str]:
    """List warnings on measures outside the range of validity of the model or of the motors."""
    notes = (
        *(rotation(measures["phi_max_rad"]), *captures(scene, measures), coarseness(scene, measures)),
        shear(measures.get("sheared_fraction")),
        long_flight(scene, measures.get("gamma"), measures.get("impacts_per_period")),
    )
    return [note for note in notes if note]


def long_flight(scene: Scene, throw: float | None, impacts: float | None = None) -> str:
    """Return the note on material along the deck that flies longer than a period, or an empty text.

    If its impacts in a turn are known, it is about those that are rarer than turns.
    """
    often = impacts is not None and impacts >= 1.0 - 1e-3
    if scene.transport is None or throw is None or not throw > WHOLE_PERIOD or often:
        return ""
    return (
        f"throw index {number(throw)}: above {number(WHOLE_PERIOD)} a flight lasts longer than a period, material "
        "lands at any phase of the vibration, and its conveying speed may fall to a fraction"
    )


def shear(fraction: float | None) -> str:
    """Return the note on layers that would slip on each other in a fraction of their contact, or an empty text."""
    if fraction is None or fraction <= MIN_SHEARED_FRACTION:
        return ""
    return (
        f"{WARNING}in {percent(fraction)} of the contact shear between the layers is above {given(INTERNAL_FRICTION)} "
        "of their pressure: a bed shears inside there, but here the layers are rigid in shear"
    )


def coarseness(scene: Scene, measures: Mapping[str, Any]) -> str:
    """Return the note on a tolerance that is coarse for impacts which amplify errors, or an empty text.

    Engines other than SUNDIALS are far more accurate than their tolerance.
    """
    tolerance = scene.solver.tolerance
    if not scene.contact.restitution or tolerance <= COARSE:
        return ""
    if not uses_sundials(measures.get("engine") or chosen_engine(scene)):
        return ""
    if not (measures["impacts_per_period"] or 0.0) > 1.0:
        return ""
    return (
        f"{WARNING}several impacts per turn amplify errors: at tolerance {given(tolerance)} the results may be wrong "
        "by several per cent, so lower solver.tolerance"
    )


def rotation(largest: float | None) -> str:
    """Return the note on the largest rotation of a platform (rad), or an empty text if it is small."""
    if largest is None or largest <= LARGE_ROTATION:
        return ""
    return (
        f"{WARNING}the platform turns by up to {number(largest, 2)} rad, over {given(LARGE_ROTATION)} rad: inaccurate "
        "in a model of first order in phi, and less unbalance reduces it"
    )


def drift(measures: Mapping[str, Any]) -> str:
    """Return the note on a phase difference that changes while it is measured, or an empty text if it does not.

    For runs only: points of a sweep have settled, and their synchronization is none if the phase difference drifts.
    """
    if measures["impacts_per_period"] is None:  # no whole turn
        return ""
    change = abs(TURN * measures["frequency_split_hz"] * measures["measured_s"])
    if change <= DRIFTING:
        return ""
    turns = change / TURN
    size = quantity(math.degrees(change), "°") if turns < 1.0 else f"{number(turns)} turns"
    return (
        f"{WARNING}the phase difference changes by {size} while it is measured: the motion has "
        "not settled, and a longer run.duration_s helps, or the exciters do not synchronize"
    )


def change(scene: Scene, measures: Mapping[str, Any], start: float) -> str:
    """Return the note on a supply that changes while it is measured, or an empty text; the run began at a time (s)."""
    last, begin = scene.drive.last_change(measures["measured_to_s"]), measures["measured_from_s"]
    if last <= begin:
        return ""
    return (
        f"{WARNING}the supply changes until {given(last)} s, but the measured part begins at {quantity(begin, 's')}: "
        f"means include the change; run.duration_s = {given(2.0 * (last - start))} or more avoids that"
    )


def symmetry(scene: Scene, strokes: Mapping[str, float | None], begin: float, end: float) -> str:
    """Return the note on motors that stop or change while the motion is symmetric for want of a disturbance, or "".

    ``strokes`` are the largest ones along x and y of a run between two times (s).
    """
    changes = scene.drive.last_change(end) > begin
    if changes and scene.has_mirrored_exciters and not any(scene.drive.intervals[-1].driven):
        return (
            "a stop within a run keeps the symmetry that its motion has reached, but a real machine also moves across: "
            f"compute it in a run of its own with run.initial.from and run.perturbation = {given(DISTURBANCE)}, or "
            "give one exciter 5 % more friction"
        )
    steady = not changes and all(scene.driven(begin, end))
    if steady or scene.run.perturbation is not None or scene.start_perturbation:
        return ""
    least, most = sorted((size or 0.0, axis) for axis, size in strokes.items())
    if least[0] > SYMMETRIC * most[0] or most[0] < MIN_STROKE:
        return ""
    return (
        f"next to nothing moves along {least[1]}, as this start is symmetric and nothing disturbs it, but a real "
        f"machine moves there at a resonance: set run.perturbation = {given(DISTURBANCE)} to compute how much"
    )


def of_each(notes: Sequence[str]) -> list[str]:
    """Return notes on exciters 1 and 2; where they say the same, as one note on each exciter."""
    alike = len(notes) == EXCITERS and notes[0].partition(" 1 ")[2] == notes[1].partition(" 2 ")[2]
    return [notes[0].replace("exciter 1", "each exciter", 1)] if alike else list(notes)


def stiffness(scene: Scene, engine: str, steps: int | None, restarts: int, seconds: float) -> str:
    """Return the note on a scene that makes the steps of engine ``taylor`` short, or an empty text.

    The engine took these steps and restarts in so many seconds of the motion; other engines are implicit.
    """
    needed = STEPS_A_TURN * seconds * scene.speed_scale / TURN + STEPS_A_RESTART * restarts
    if engine != "taylor" or not steps or steps <= STIFF * needed:
        return ""
    return (
        f"{HINT}engine taylor takes {number(steps / needed, 2)} times the steps that the excitation needs, because a "
        "layer, a motor or the suspension is stiff: solver.engine = native is likely to be faster"
    )


def free_swing(scene: Scene, measures: Mapping[str, Any], rows: Any, begins: float = 0.0) -> str:
    """Return the note on an exciter without drive that moves freely while the other one turns, or an empty text.

    ``rows`` are the section, at whole turns of exciter 1. There a motion that the platform forces on exciter 2 repeats,
    and a free swing does not; of exciter 1 the two are not told apart. The run ``begins`` at a time (s).
    """
    begin, end, split = (measures[name] for name in ("measured_from_s", "measured_to_s", "frequency_split_hz"))
    mean, driven = measures["excitation_frequency_hz"], scene.driven(begin, end)
    if not mean or driven.count(True) != 1 or abs(split) <= EQUAL_SPEEDS * mean:
        return ""
    if not driven[0] or len(rows) < MIN_ROWS:
        return f"{WARNING}exciter {driven.index(False) + 1} is off: whether it still swings, a run twice as long shows"
    half = len(rows) // 2
    angles, times = rows["state"][:, COORDINATES.index("phi2_rad")], rows["t"]
    first, last = float(np.ptp(angles[:half])), float(np.ptp(angles[half:]))
    rate = math.log(first / last) / float(times[half] - times[0]) if first > last > 0.0 else 0.0
    # the last turns are kept, and the measured part may have begun long before
    size = first * math.exp(min(rate * float(times[0] - begin), 50.0))
    if size <= MIN_SWING_RAD:
        return ""
    if size > TURN or not rate:
        return f"{WARNING}exciter 2, off, still turns or swings: not steady, and a longer run.duration_s helps"
    seconds = 2.0 * (end - begins + max(math.log(last / (0.5 * MIN_SWING_RAD)), 0.0) / rate)
    return (
        f"{WARNING}exciter 2, off, still swings by ± {quantity(math.degrees(0.5 * size), '°')}: not steady before "
        f"about run.duration_s = {given(float(f'{seconds:.2g}'))}"
    )


def unfinished_stop(scene: Scene, measures: Mapping[str, Any], state: FloatArray) -> str:
    """Return the note on exciters that still turn in the last state of a run without drive, or an empty text."""
    interval = measures["measured_from_s"], measures["measured_to_s"]
    if any(scene.driven(*interval)):
        return ""
    speeds = natural_modes(scene).speeds
    slowest = min(speeds[speeds > 0.0].tolist(), default=0.0)
    places = [len(COORDINATES) + RATES.index(f"phi{n}_rate_rad_per_s") for n in (1, 2)]
    fastest = float(np.max(np.abs(state[places])))
    if fastest <= 0.5 * slowest:
        return ""
    switched = "braked" if scene.braked(*interval) else "off"
    return (
        f"{WARNING}exciters, {switched}, still turn or swing at up to {quantity(fastest / TURN, 'Hz')}: larger values "
        "may follow as they pass resonances, and a longer run.duration_s shows them"
    )


class SlowMotor(NamedTuple):
    """A motor that is on and stays far below its synchronous speed: the exciter's number, and both speeds (Hz)."""

    exciter: int
    speed: float
    synchronous: float

    @property
    def slip(self) -> float:
        """Slip of the motor."""
        return 1.0 - self.speed / self.synchronous


def slow_motors(scene: Scene, measures: Mapping[str, Any]) -> list[SlowMotor]:
    """List the motors that slip as a captured one does; none if their supply changes in the measured part.

    Without a whole turn of exciter 1 these are the exciters that turn less than once.
    """
    mean, split = measures["excitation_frequency_hz"], measures["frequency_split_hz"]
    begin, end = measures["measured_from_s"], measures["measured_to_s"]
    supply = steady_supply(scene, begin, end)
    if supply is None or mean is None:
        return []
    found, turned = [], measures["impacts_per_period"] is not None
    for i, exciter in enumerate(scene.exciter_pair):
        speed = mean + (0.5 - i) * split
        synchronous = scene.synchronous_speeds_at(supply.frequency)[i] / TURN
        critical = exciter.critical_slip_speed(supply.frequency) / TURN
        highest = speed if turned else 2.0 / (end - begin)
        slips = synchronous - highest > CAPTURED * critical and (turned or speed * (end - begin) < 1.0)
        if slips and synchronous > 0.0 and scene.driven(begin, end)[i]:
            found.append(SlowMotor(i + 1, speed, synchronous))
    return found


def captures(scene: Scene, measures: Mapping[str, Any]) -> list[str]:
    """List the notes on motors that stay far below their synchronous speed."""
    notes = []
    for exciter, speed, synchronous in slow_motors(scene, measures):
        wanted = quantity(synchronous, "Hz")
        still = f"{WARNING}exciter {exciter} hardly turns, although its synchronous speed is {wanted}: {HELPS_START}"
        slow = (
            f"{WARNING}exciter {exciter} turns at {quantity(speed, 'Hz')}, {percent(1.0 - speed / synchronous)} below "
            f"its synchronous speed {wanted}: captured by a resonance, overloaded or still running up, and "
            f"{HELPS_START}"
        )
        notes.append(still if measures["impacts_per_period"] is None else slow)
    return of_each(notes)
