"""Notes on the input of a scene: numbers outside their usual range, and numbers taken by default.

A scene with such numbers is simulated like any other; a note points at what may be a slip of units or a missing key.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from pydantic import BaseModel

from vibroplat.config.overrides import OF_EXCITERS
from vibroplat.config.scene import Scene


@dataclass(frozen=True)
class Usual:
    """A quantity and its usual range.

    Attributes
    ----------
    text
        What it is, with a place for its value; empty if it is the key itself.
    keys
        Keys that give it, relative to what ``of`` takes; of several that exclude each other the one that is given.
    low, high
        Ends of the usual range; with ``low`` 0 small values are usual, too.
    unit
        Its unit, and that of both ends.
    of
        Computes it; None if there is no such quantity, as the natural frequency of a free platform.
    """

    text: str
    keys: tuple[str, ...]
    low: float
    high: float
    unit: str
    of: Callable[[Any], float | None]


#: Usual ranges in a scene.
OF_SCENES = (
    Usual(
        "natural frequency {} in x",
        ("machine.stiffness_x_n_per_m",),
        1.0,
        150.0,
        "Hz",
        lambda s: _natural_frequency(s.machine.stiffness_x_n_per_m, s.platform_mass),
    ),
    Usual(
        "natural frequency {} in y",
        ("machine.stiffness_y_n_per_m",),
        1.0,
        150.0,
        "Hz",
        lambda s: _natural_frequency(s.machine.stiffness_y_n_per_m, s.platform_mass),
    ),
    Usual(
        "natural frequency {} in phi",
        ("machine.stiffness_phi_n_m_per_rad",),
        1.0,
        150.0,
        "Hz",
        lambda s: _natural_frequency(s.machine.stiffness_phi_n_m_per_rad, s.machine.inertia),
    ),
    Usual(
        "damping ratio {} in x",
        ("machine.damping_x_n_s_per_m",),
        0.0,
        1.0,
        "",
        lambda s: _damping_ratio(s.machine.damping_x_n_s_per_m, s.machine.stiffness_x_n_per_m, s.platform_mass),
    ),
    Usual(
        "damping ratio {} in y",
        ("machine.damping_y_n_s_per_m", "contact.viscous_per_mass_per_s"),
        0.0,
        1.0,
        "",
        lambda s: _damping_ratio(s.damping_y, s.machine.stiffness_y_n_per_m, s.platform_mass),
    ),
    Usual(
        "damping ratio {} in phi",
        ("machine.damping_phi_n_m_s_per_rad",),
        0.0,
        1.0,
        "",
        lambda s: _damping_ratio(
            s.machine.damping_phi_n_m_s_per_rad, s.machine.stiffness_phi_n_m_per_rad, s.machine.inertia
        ),
    ),
    Usual(
        "static sag {}",
        ("machine.stiffness_y_n_per_m",),
        0.0,
        0.05,
        "m",
        lambda s: (s.platform_mass + sum(s.layer_masses)) * s.machine.gravity_m_per_s2 / s.machine.stiffness_y_n_per_m,
    ),
    Usual("", ("material.mass_ratio",), 0.0, 5.0, "", lambda s: s.material.mass_ratio),
    Usual(
        "damping ratio {} of the layers",
        ("material.damping_ratio", "material.damping_n_s_per_m"),
        0.0,
        1.0,
        "",
        lambda s: _damping_ratio(s.layer_spring[1], s.layer_spring[0], 1.0),
    ),
    Usual("", ("drive.supply_frequency_hz",), 0.0, 400.0, "Hz", lambda s: s.drive.supply_frequency_hz),
    Usual(
        "drive.program: supply frequency {}",
        (),
        0.0,
        400.0,
        "Hz",
        lambda s: s.drive.largest_frequency if s.drive.program else None,
    ),
    Usual(
        "acceleration {} of the platform far above resonance",
        ("machine.unbalance_mass_kg", "machine.unbalance_radius_m", "drive.supply_frequency_hz"),
        0.0,
        30.0,
        "g",
        lambda s: (
            s.length_scale * s.speed_scale**2 / s.machine.gravity_m_per_s2 if s.machine.gravity_m_per_s2 else None
        ),
    ),
    Usual("", ("machine.rotor_inertia_kg_m2",), 0.0, 100.0, "kg·m²", lambda s: _largest(s, "rotor_inertia_kg_m2")),
    Usual("", ("run.initial.speed_ratio",), -1.5, 1.5, "", lambda s: s.run.initial.speed_ratio),
    Usual("", ("run.initial.state.x_m",), -1.0, 1.0, "m", lambda s: s.run.initial.state and s.run.initial.state.x_m),
    Usual("", ("run.initial.state.y_m",), -1.0, 1.0, "m", lambda s: s.run.initial.state and s.run.initial.state.y_m),
)

#: Usual ranges in a motor.
OF_MOTORS = (
    Usual("", ("critical_slip",), 0.0, 1.0, "", lambda m: m.critical_slip),
    Usual("", ("friction_radius_m",), 0.0, 0.01, "m", lambda m: m.friction_radius_m),
    Usual("", ("critical_torque_n_m",), 0.0, 1e4, "N·m", lambda m: m.critical_torque_n_m),
)

#: Keys whose default is that of any machine.
COMMON = frozenset({"gravity_m_per_s2"})


def notes_on_input(scene: Scene) -> list[str]:
    """Say what is unusual in a scene, and which numbers of machine and motors it takes by default, in one line each."""
    found = [_unusual(usual, scene) for usual in OF_SCENES]
    found += [_unusual(usual, motor, f"{name}.") for name, motor in _motors(scene) for usual in OF_MOTORS]
    elsewhere = OF_EXCITERS if scene.exciters is not None else ()
    found.append(_by_default("machine", scene.machine, elsewhere))
    found += [_by_default(name, motor) for name, motor in _motors(scene)]
    return [note for note in found if note]


def notes_on_inputs(scenes: Iterable[Scene]) -> list[str]:
    """Say the same of several scenes, each note once."""
    return list(dict.fromkeys(note for scene in scenes for note in notes_on_input(scene)))


def rounded(value: float, digits: int = 3) -> str:
    """Format a value for a note, without an exponent where it can be spared."""
    return f"{float(f'{value:.{digits}g}'):g}"


def _motors(scene: Scene) -> Iterator[tuple[str, BaseModel]]:
    """Yield the sections of the motors with their keys."""
    if scene.exciters is not None:
        yield from ((f"exciters.{i}", exciter) for i, exciter in enumerate(scene.exciters))
    elif scene.motors is not None:
        yield from ((f"motors.{i}", motor) for i, motor in enumerate(scene.motors))
    elif scene.motor is not None:
        yield "motor", scene.motor


def _largest(scene: Scene, key: str) -> float:
    return float(max(getattr(exciter, key) for exciter in scene.exciter_pair))


def _unusual(usual: Usual, section: BaseModel, prefix: str = "") -> str:
    """Return the note on a quantity, or an empty text if it has a usual value or none."""
    value = usual.of(section)
    if value is None or usual.low <= value <= usual.high:
        return ""
    given = {key: reduce(getattr, key.split("."), section) for key in usual.keys}
    if (exciters := getattr(section, "exciters", None)) is not None:
        own = [key for key in given if key.split(".")[-1] in OF_EXCITERS]
        given = {key: number for key, number in given.items() if key not in own}
        for name in (key.split(".")[-1] for key in own):
            given |= {f"exciters.{i}.{name}": getattr(exciter, name) for i, exciter in enumerate(exciters)}
    named = ", ".join(f"{prefix}{key} = {number:g}" for key, number in given.items() if number)
    what = usual.text.format(f"{rounded(value)} {usual.unit}".rstrip())
    ends = f"{usual.low:g} to {usual.high:g}" if usual.low else f"up to {usual.high:g}"
    return f"{': '.join(part for part in (named, what) if part)}; usual: {ends} {usual.unit}".rstrip()


def _by_default(name: str, section: BaseModel, elsewhere: Sequence[str] = ()) -> str:
    """Return the note on keys of a section that are not given, or an empty text if there are none.

    Optional keys need not be given, nor those that are given ``elsewhere``.
    """
    needed = {key for key, field in type(section).model_fields.items() if field.default is not None}
    keys = [key for key in type(section).model_fields if key in needed - COMMON - {*elsewhere}]
    missing = [key for key in keys if key not in section.model_fields_set]
    if not missing:
        return ""
    more = len(missing) - 1
    which = missing[0] if more == 0 else f"{missing[0]} and {more} more key{'s' if more > 1 else ''}"
    what = "no key given" if missing == keys else f"{which} not given"
    return f"{name}: {what}; taken from the paper's test rig"


def _natural_frequency(stiffness: float, mass: float) -> float | None:
    """Natural frequency (Hz) of a mass (kg or kg·m²) on a spring; None without a spring."""
    return math.sqrt(stiffness / mass) / (2.0 * math.pi) if stiffness > 0.0 else None


def _damping_ratio(damping: float, stiffness: float, mass: float) -> float | None:
    """Damping ratio of a mass on a spring and a damper; None without a spring."""
    return 0.5 * damping / (math.sqrt(stiffness) * math.sqrt(mass)) if stiffness > 0.0 else None
