"""Notes on the input of a scene: numbers outside their usual range, and numbers taken by default.

A scene with such numbers is simulated like any other; a note points at what may be a slip of units or a missing key.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import repeat
from typing import Any, NamedTuple

from pydantic import BaseModel

from vibroplat.config.consistency import given_by_exciters, given_elsewhere
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import given, number, quantity
from vibroplat.config.keys import value_at
from vibroplat.config.scene import Scene
from vibroplat.config.sections import Exciter, Motor
from vibroplat.config.suspension import natural_modes
from vibroplat.config.unread import BARE, INELASTIC, NOT_RANDOM, unread_by_command, unread_by_scene, unread_by_study

#: Torque over the weight's largest moment m r g that carries an unbalance which hangs past its upper position in one
#: swing: the largest (1 - cos a)/a. With less it swings, more each time if the torque grows with the speed, or stays.
SWING_TORQUE_RATIO = 0.7246
#: Keys whose default holds for any machine.
UNIVERSAL_KEYS = frozenset({"gravity_m_per_s2", "mounted_on"})
#: Size from which on a number that may be a slip of units is written by a power of ten.
MAX_PLAIN = 1e6
#: Damping ratio of springs below which free vibrations are long, and what a run may have left of them (ratio).
MIN_DAMPING_RATIO, MAX_REMAINDER = 0.005, 0.01
#: Minimum number of samples of a turn in a trajectory, and the number that a spectrum needs more of.
MIN_SAMPLES_PER_TURN, MIN_SAMPLES_OF_SPECTRUM = 20.0, 2.0
#: Largest usual phase difference (rad), a turn, and distance of an exciter from the centre of mass (m).
LARGE_PHASE, LARGE_DISTANCE = 6.3, 10.0
#: The key of a rotor's moment of inertia.
INERTIA = "rotor_inertia_kg_m2"
#: Maximum number of missing keys that are all named.
MAX_NAMED = 3
#: How notes begin by which the answer is wrong for who asks: another machine than theirs, a motion that has not settled
#: or is captured, or one outside the model. They come first, and no print leaves them out.
WARNING = "warning: "
#: How notes begin that put no number in doubt: they come last.
HINT = "hint: "
#: How notes on keys without effect begin.
_OF_KEYS = "no effect of "
#: Axes of the platform with the ends of the names of its springs and dampers.
_AXES = (
    ("x", "stiffness_x_n_per_m", "damping_x_n_s_per_m"),
    ("y", "stiffness_y_n_per_m", "damping_y_n_s_per_m"),
    ("phi", "stiffness_phi_n_m_per_rad", "damping_phi_n_m_s_per_rad"),
)


class UsualRange(NamedTuple):
    """A quantity of a scene and its usual range.

    Attributes
    ----------
    value
        In its unit; None if there is no such quantity, as the natural frequency of a free platform.
    low, high, unit
        Ends of the usual range and their unit; with ``low`` 0 small values are usual, too.
    keys
        Keys that give it; of several that exclude each other the one that is given.
    text
        What it is, with a place for its value; empty if it is the key itself.
    """

    value: float | None
    low: float
    high: float
    unit: str
    keys: tuple[str, ...]
    text: str = ""


def notes_on_input(scene: Scene, *, of_run: bool = True, ends: float | None = None) -> list[str]:
    """Say what is unusual in a scene or ``of_run``, and which numbers of machine and motors it takes by default.

    Of a run that continues another one, it must be known when it ``ends`` (s).
    """
    notes = [*_weak_motors(scene), _unequal_motors(scene), _steep_deck(scene), _weakly_damped(scene) if of_run else ""]
    notes += [*(_note_if_unusual(quantity, scene) for quantity in quantities(scene)), _replaced(scene)]
    notes += _given_in_vain(scene, of_run=of_run)
    if ends is None:
        ends = math.inf if scene.run.initial.from_ is not None else scene.run.duration_s
    notes += [_unreached(scene, ends), _coarse(scene)] if of_run else []
    motors = [(name, motor, motor.replaced()) for name, motor in _motors(scene)]
    notes += _notes_on_defaults([("machine", scene.machine, given_elsewhere(scene)), *motors])
    return [note for note in notes if note]


def split_severity(note: str) -> tuple[str, str]:
    """Return how a note begins, ``WARNING``, ``HINT`` or "", and the rest of it."""
    begin = next((begin for begin in (WARNING, HINT) if note.startswith(begin)), "")
    return begin, note.removeprefix(begin)


def by_severity(notes: Iterable[str]) -> list[str]:
    """Return notes in their order, warnings first, those last that put no number in doubt."""
    return sorted(notes, key=lambda note: (WARNING, "", HINT).index(split_severity(note)[0]))


def notes_on_inputs(scenes: Iterable[Scene], places: Sequence[str] = ()) -> list[str]:
    """Say the same of several scenes of a study, each note once, with its place unless it holds at all places."""
    notes: dict[str, list[str]] = {}
    pairs = [*zip(scenes, places or repeat(""), strict=False)]
    for scene, prefix in pairs:
        for note in notes_on_input(scene, of_run=False):
            notes.setdefault(note, []).append(prefix)
    everywhere = max(len(places), 1)
    placed = list[str]()
    for note, at in notes.items():
        if _OF_KEYS in note and len(at) < len(pairs) and not places:
            continue  # elsewhere they have one
        begin, text = split_severity(note)
        holds = len(at) == everywhere or not at[0] or at[0] in note
        placed.append(note if holds else f"{begin}at {', '.join(at)}: {text}")
    return placed


#: Keys by which a study may vary what other keys have an effect on.
MAKES_MATERIAL = {"material.mass_ratio", "material.mass_kg", "material.layers", "contact.model"}


def notes_on_plan(scene: Scene, kind: str) -> list[str]:
    """Say which keys have no effect on a study, and that rotors stay as they are where it varies their motors.

    Inertias of catalogue motors of one torque differ by more than a factor of 2, with frame, poles and efficiency
    class, so none is derived from the torque.
    """
    plan = getattr(scene, kind, None)
    notes = [*set_in_vain(scene.set_keys, kind, plan), *_without_effect(scene, kind)]
    notes += _no_effect({key: why for key, why in unread_by_study(scene, kind).items() if key in scene.set_keys})
    varied = str({} if plan is None else plan.model_dump(exclude={"parameter_tolerances"}, exclude_none=True))
    sizes = dict.fromkeys(re.findall(r"[\w.]+\.(?:critical_torque_n_m|rated_power_w)\b", varied))
    if not sizes or INERTIA in varied:
        return notes
    each = " and ".join(dict.fromkeys(given(getattr(exciter, INERTIA)) for exciter in scene.exciter_pair))
    where = "exciters.N" if scene.exciters is not None else "machine"
    return [
        *notes,
        f"{', '.join(sizes)} varies, but {where}.{INERTIA} stays {each} kg·m²: rotors do not grow with their motors; "
        "repeat with --set for the motor that is found",
    ]


def _without_effect(scene: Scene, kind: str) -> list[str]:
    """Return the notes on keys that are given and have no effect on a study: another one's seed, material without any.

    Sections of other studies are not told.
    """
    plan, run = getattr(scene, kind, None), scene.run
    if plan is None:
        return []
    notes = []
    for key in ("seed", "perturbation"):
        if key in run.model_fields_set and key in type(plan).model_fields:
            notes.append(
                f"{WARNING}run.{key} = {given(getattr(run, key) or 0)} has no effect on {kind}: {kind}.{key} = "
                f"{given(getattr(plan, key))} counts"
            )
    if "seed" in plan.model_fields_set and getattr(plan, "perturbation", 1.0) == 0.0:
        notes.append(f"{WARNING}{kind}.seed has no effect: {kind}.perturbation is 0, so nothing is random")
    varied = str(plan.model_dump(exclude_none=True))
    keys = set(re.findall(r"\b(?:material|contact|transport)\.\w+", varied))
    if keys & MAKES_MATERIAL:
        return notes
    unread = {key: why for key, why in unread_by_scene(scene).items() if key in keys and why != INELASTIC}
    return [*notes, *_no_effect(unread)]


def _given_in_vain(scene: Scene, *, of_run: bool) -> list[str]:
    """Return the notes on keys that are given and that a scene does not read; a bare platform may be meant."""
    bare_is_meant = not scene.material.is_there and bool({"mass_ratio", "mass_kg"} & scene.material.model_fields_set)
    set_over, unread = {}, {}
    for key, why in unread_by_scene(scene).items():
        section, _, name = key.partition(".")
        model = getattr(scene, section)
        if model is None or name not in model.model_fields_set:
            continue
        if section == "run" and not of_run:  # studies have seeds of their own
            continue
        if key in scene.set_keys:
            set_over[key] = why
        elif not bare_is_meant and why != INELASTIC and getattr(model, name) != type(model).model_fields[name].default:
            unread[key] = why
    return [*_no_effect(set_over), *_no_effect(unread, HINT)]


def set_in_vain(keys: Iterable[str], command: str, plan: BaseModel | None = None) -> list[str]:
    """Return the notes on keys that are set for a command, or a study with a plan, and do not change its result."""
    return [f"{WARNING}no effect of {key} on {command}{why}" for key, why in unread_by_command(keys, command, plan)]


def _no_effect(unread: Mapping[str, str], of_choices: str = WARNING) -> list[str]:
    """Say which keys have no effect, a note for each reason.

    A choice, such as one layer, is seldom a slip: its note begins with ``of_choices``.
    """
    notes = []
    for why in dict.fromkeys(unread.values()):
        begin = WARNING if why in (BARE, NOT_RANDOM) else of_choices
        notes.append(f"{begin}{_OF_KEYS}{', '.join(key for key in unread if unread[key] == why)}: {why}")
    return notes


def quantities(scene: Scene) -> Iterator[UsualRange]:
    """Yield what of a scene has a usual range."""
    machine, drive, initial = scene.machine, scene.drive, scene.run.initial
    modes, of_machine = natural_modes(scene), "machine." if scene.springs is None else "springs."
    oscillators = zip(modes.inertia.tolist(), modes.damping.tolist(), modes.stiffness.tolist(), strict=True)
    for (axis, spring, damper), name, (mass, damping, stiffness) in zip(_AXES, modes.names, oscillators, strict=True):
        frequency = math.sqrt(stiffness / mass) / TURN if stiffness > 0.0 else None
        yield UsualRange(frequency, 1.0, 150.0, "Hz", (f"{of_machine}{spring}",), f"natural frequency {{}} in {name}")
        keys = (f"{of_machine}{damper}", *(["contact.viscous_per_mass_per_s"] if axis == "y" else []))
        ratio = _damping_ratio(damping, stiffness, mass)
        yield UsualRange(ratio, 0.0, 1.0, "", keys, f"damping ratio {{}} in {name}")
    weight = (scene.platform_mass + sum(scene.layer_masses)) * machine.gravity_m_per_s2
    sag = weight / scene.suspension.stiffness_y
    yield UsualRange(sag, 0.0, 0.05, "m", (f"{of_machine}stiffness_y_n_per_m",), "static sag {}")
    yield UsualRange(scene.mass_ratio, 0.0, 5.0, "", ("material.mass_ratio",))
    ratio = _damping_ratio(scene.layer_spring[1], scene.layer_spring[0], 1.0)
    keys = ("material.damping_ratio", "material.damping_n_s_per_m")
    yield UsualRange(ratio, 0.0, 1.0, "", keys, "damping ratio {} of the layers")
    yield UsualRange(drive.supply_frequency_hz, 0.0, 400.0, "Hz", ("drive.supply_frequency_hz",))
    if drive.program:
        yield UsualRange(drive.largest_frequency, 0.0, 400.0, "Hz", (), "drive.program: supply frequency {}")
    if machine.gravity_m_per_s2:
        acceleration = scene.length_scale * scene.speed_scale**2 / machine.gravity_m_per_s2
        unbalance = ("machine.unbalance_mass_kg", "machine.unbalance_radius_m")
        keys = ("machine.platform_mass_kg", *unbalance, "drive.supply_frequency_hz")
        text = "acceleration {} of the platform far above resonance"
        yield UsualRange(acceleration, 0.0, 30.0, "g", keys, text)
    inertia = max(exciter.rotor_inertia_kg_m2 for exciter in scene.exciter_pair)
    yield UsualRange(inertia, 0.0, 100.0, "kg·m²", ("machine.rotor_inertia_kg_m2",))
    yield UsualRange(initial.speed_ratio, -1.5, 1.5, "", ("run.initial.speed_ratio",))
    for key in ("phase_difference_rad", "phi1_rad"):
        yield UsualRange(getattr(initial, key), -LARGE_PHASE, LARGE_PHASE, "rad", (f"run.initial.{key}",))
    places = {f"exciters.{i}": exciter.position_m or (0.0, 0.0) for i, exciter in enumerate(scene.exciters or ())}
    places |= {f"springs.{name}": spring.position_m for name, spring in (scene.springs or {}).items()}
    for name, place in places.items():
        text = f"{name}.position_m: {{}} from the centre of mass"
        yield UsualRange(math.hypot(*place), 0.0, LARGE_DISTANCE, "m", (), text)
    for key in ("x_m", "y_m") if initial.state is not None else ():
        yield UsualRange(getattr(initial.state, key), -1.0, 1.0, "m", (f"run.initial.state.{key}",))
    for name, motor in _motors(scene):
        torque, slip = motor.critical_values()
        plate = motor.rated_power_w is not None
        of_slip, of_torque = ("rated_speed_rpm", "rated_power_w") if plate else ("critical_slip", "critical_torque_n_m")
        yield UsualRange(slip, 0.0, 1.0, "", (f"{name}.{of_slip}",), "critical slip {}" if plate else "")
        yield UsualRange(motor.friction_radius_m, 0.0, 0.01, "m", (f"{name}.friction_radius_m",))
        yield UsualRange(torque, 0.0, 1e4, "N·m", (f"{name}.{of_torque}",), "critical torque {}" if plate else "")


def _weak_motors(scene: Scene) -> list[str]:
    """Return the note on motors that may not start from rest, as they hardly lift their unbalance."""
    initial, weak = scene.run.initial, {}
    if initial.speed_ratio or initial.state is not None or initial.from_ is not None:
        return []
    for i, (exciter, moment) in enumerate(zip(scene.exciter_pair, scene.unbalances, strict=True)):
        largest, needed = exciter.critical_torque_n_m, SWING_TORQUE_RATIO * moment * scene.machine.gravity_m_per_s2
        starting = 0.0
        for supply in (one for one in scene.drive.intervals if one.driven[i]):
            first, last = sorted(map(supply.frequency_at, (supply.start, min(supply.end, scene.run.duration_s))))
            # the torque at standstill is largest where the synchronous speed is the critical slip speed
            best = exciter.critical_slip * (exciter.rated_frequency_hz or 0.0)
            for frequency in (first, min(max(best, first), last), last):
                if frequency > 0.0:
                    speed = scene.synchronous_speeds_at(frequency)[i]
                    starting = max(starting, exciter.torque(speed, frequency))
        if 0.0 < starting < needed:
            numbers = "{} at standstill, {} at most, where {}".format(
                *(quantity(torque, "N·m") for torque in (starting, largest, needed))
            )
            weak[f"motor {i + 1}"] = f"gives {numbers} carry its unbalance over the top in one swing"
    same = len(weak) == 2 and len({*weak.values()}) == 1
    texts = {"each motor": weak["motor 1"]} if same else weak
    what_helps = "it may start late or not at all, and more torque or run.initial.speed_ratio helps"
    return [f"{who} {what}: {what_helps}" for who, what in texts.items()]


def _unequal_motors(scene: Scene) -> str:
    """Return the note on motors with different pole pairs, or an empty text."""
    first, second = (exciter.pole_pairs for exciter in scene.exciter_pair)
    if first == second:
        return ""
    ratio = max(first, second) / min(first, second)
    return (
        f"the motors have {first} and {second} pole pairs: at one supply their synchronous speeds differ "
        f"{given(round(ratio, 2))} times, and they cannot turn at the same speed; give both the same pole_pairs"
    )


def _steep_deck(scene: Scene) -> str:
    """Return the note on a deck that holds material at rest but none that slips, or an empty text."""
    transport = scene.transport
    if transport is None or not transport.runs_away:
        return ""
    angle = math.degrees(math.atan(transport.friction))
    return (
        f"transport.deck_angle_deg = {given(transport.deck_angle_deg)}: once material slips it runs away, faster and "
        f"faster; its speed is bounded up to {number(angle)} deg with transport.friction = {given(transport.friction)}"
    )


def _weakly_damped(scene: Scene) -> str:
    """Return the note on springs of the platform whose free vibrations outlast a run, or an empty text.

    They decay at the rate b / 2M, and the second half of a run is measured. Material damps y.
    """
    weak, enough, decay, modes = [], [], 0.0, natural_modes(scene)
    oscillators = zip(modes.inertia.tolist(), modes.damping.tolist(), modes.stiffness.tolist(), strict=True)
    for (axis, _, key), name, (mass, damping, stiffness) in zip(_AXES, modes.names, oscillators, strict=True):
        critical = 2.0 * math.sqrt(stiffness * mass)
        if damping < MIN_DAMPING_RATIO * critical and not (axis == "y" and scene.has_contact):
            of_springs = f"damping ratio {number(damping / critical, 2)} in {name}"
            given_one = f"machine.{key} = {given(getattr(scene.machine, key))}"
            weak.append(given_one if scene.springs is None else of_springs)
            enough.append(number(0.01 * critical))
            decay = max(decay, 2.0 * mass / damping if damping else math.inf)
    shortest = 2.0 * decay * math.log(1.0 / MAX_REMAINDER)
    if shortest <= scene.run.duration_s:
        return ""
    contains = "never decay, so every run contains"
    if math.isfinite(decay):
        size, limit = quantity(decay, "s"), quantity(shortest, "s", digits=2)
        contains = f"decay by e in {size}, so a run below {limit} contains"
    helps = f"{', '.join(enough)} would be 1 % of critical damping" if scene.springs is None else "more damping helps"
    what = ("springs: " if scene.springs is not None else "") + ", ".join(weak)
    return f"{WARNING}{what}: free vibrations {contains} what its start leaves; {helps}"


def _unreached(scene: Scene, ends: float) -> str:
    """Return the note on entries of a program that a run does not reach which ends at a time (s), or an empty text."""
    entries = enumerate(scene.drive.program or ())
    late = [f"drive.program.{n}.t_s = {given(entry.t_s)}" for n, entry in entries if entry.t_s > ends]
    if not late:
        return ""
    names = ", ".join(late[:MAX_NAMED])
    more = f" and {len(late) - MAX_NAMED} more" * (len(late) > MAX_NAMED)
    return (
        f"{WARNING}{names}{more}: the run ends before, at {given(ends)} s, and does not get there; times are in "
        "seconds, and a longer run.duration_s helps"
    )


def _coarse(scene: Scene) -> str:
    """Return the note on a trajectory with few samples of each turn, or an empty text."""
    rate = scene.output.sample_rate_hz
    each = TURN * rate / scene.speed_scale
    if each >= MIN_SAMPLES_PER_TURN:
        return ""
    spectrum = " and give no spectrum" * (each <= MIN_SAMPLES_OF_SPECTRUM and scene.output.accelerations)
    return (
        f"{HINT}output.sample_rate_hz = {given(rate)}: {number(each, 2)} samples per turn miss the extremes{spectrum}"
    )


def _replaced(scene: Scene) -> str:
    """Return the note on keys of the machine that are given and have no effect, or an empty text."""
    keys = sorted(given_by_exciters(scene) & scene.machine.model_fields_set)
    values = ", ".join(f"machine.{key} = {given(getattr(scene.machine, key))}" for key in keys)
    return f"{WARNING}no effect of {values}: each exciter has its own value, which counts" if keys else ""


def _damping_ratio(damping: float, stiffness: float, mass: float) -> float | None:
    """Damping ratio of a mass on a spring and a damper; None without a spring."""
    return 0.5 * damping / (math.sqrt(stiffness) * math.sqrt(mass)) if stiffness > 0.0 else None


def _motors(scene: Scene) -> Iterator[tuple[str, Motor]]:
    """Yield the sections of the motors with their keys."""
    if scene.motor is not None:
        yield "motor", scene.motor
    yield from ((f"motors.{i}", motor) for i, motor in enumerate(scene.motors or ()))
    yield from ((f"exciters.{i}", exciter) for i, exciter in enumerate(scene.exciters or ()))


def _note_if_unusual(quantity: UsualRange, scene: Scene) -> str:
    """Return the note on a quantity, or an empty text if it has a usual value or none."""
    value, low, high, unit, keys, text = quantity
    if value is None or low <= value <= high:
        return ""
    own = [key for key in keys if key.removeprefix("machine.") in given_by_exciters(scene)]
    keys = (
        *(key for key in keys if key not in own),
        *(f"exciters.{i}.{_given_key(exciter, key)}" for key in own for i, exciter in enumerate(scene.exciters or ())),
    )
    tree: Any = scene.model_dump()
    named = ", ".join(f"{key} = {given(size)}" for key in keys if (size := value_at(tree, key)))
    what = text.format(_in_unit(value, unit))
    ends = f"{given(low)} to {given(high)}" if low else f"up to {given(high)}"
    return f"{WARNING}{': '.join(part for part in (named, what) if part)}; usual: {ends} {unit}".rstrip()


def _given_key(exciter: Exciter, key: str) -> str:
    """Return the key of an exciter that takes the place of one of the machine's."""
    name = key.removeprefix("machine.")
    by_moment = name == "unbalance_radius_m" and exciter.static_moment_kg_m is not None
    return "static_moment_kg_m" if by_moment else name


def _in_unit(value: float, unit: str) -> str:
    """Write a value in the unit of its range; one with more than six figures before its point by a power of ten."""
    return f"{value:.2e} {unit}".rstrip() if abs(value) >= MAX_PLAIN else f"{number(value)} {unit}".rstrip()


def _notes_on_defaults(sections: Iterable[tuple[str, BaseModel, Collection[str]]]) -> list[str]:
    """Return the notes on keys of sections that are not given; sections that lack the same have one note.

    Optional keys need not be given, nor those that are given elsewhere, which come with each section.
    """
    by_note: dict[str, list[str]] = {}
    for name, section, elsewhere in sections:
        fields = type(section).model_fields.items()
        keys = [key for key, field in fields if field.default is not None and key not in UNIVERSAL_KEYS | {*elsewhere}]
        missing = [key for key in keys if key not in section.model_fields_set]
        if not missing:
            continue
        several = len(missing) > MAX_NAMED
        *first, last = (missing[0], f"{len(missing) - 1} more keys") if several else missing
        which = f"{', '.join(first)} and {last}" if first else last
        what = "no key given" if not section.model_fields_set else f"{which} not given"
        by_note.setdefault(what, []).append(name)
    return [
        f"{WARNING}{' and '.join(names)}: {what}; taken from the paper's test rig" for what, names in by_note.items()
    ]
