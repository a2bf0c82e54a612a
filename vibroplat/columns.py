"""What columns of tables mean, their names, symbols and units, and their figures.

Descriptions stand where columns are made; units, and words for people, follow from names. A table carries the units and
meanings of its columns in ``DataFrame.attrs`` (``units``, ``meanings``), and a Parquet file in the metadata of its
fields.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

#: Units by the ends of names, longer ends before those that they end with.
UNITS = {
    "n_m_s_per_rad": "N·m·s/rad",
    "n_m_per_rad": "N·m/rad",
    "rad_per_s": "rad/s",
    "w_per_m2": "W/m²",
    "m_per_s2": "m/s²",
    "n_s_per_m": "N·s/m",
    "n_per_m": "N/m",
    "m_per_s": "m/s",
    "kg_per_s": "kg/s",
    "per_s": "1/s",
    "per_turn": "1/turn",
    "kg_m2": "kg·m²",
    "kg_m": "kg·m",
    "n_s": "N·s",
    "n_m": "N·m",
    "kg": "kg",
    "hz": "Hz",
    "rpm": "1/min",
    "rad": "rad",
    "deg": "°",
    "m": "m",
    "s": "s",
    "n": "N",
    "j": "J",
    "w": "W",
}


#: What a column holds: floating-point numbers, texts, whole numbers or flags; any but a flag may be missing.
NUMBER, TEXT, COUNT, FLAG = "number", "text", "count", "flag"


class Column(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    meaning
        What it is, in a few words.
    definition
        How it is computed, where the meaning does not say so.
    kind
        What it holds: ``NUMBER``, ``TEXT``, ``COUNT`` or ``FLAG``.
    """

    meaning: str
    definition: str = ""
    kind: str = NUMBER

    @property
    def text(self) -> str:
        """Meaning and definition in one line."""
        return f"{self.meaning}; {self.definition}" if self.definition else self.meaning


Columns = Mapping[str, Column]


def unit_of(name: str) -> str:
    """Return the unit that a key or column has by its name; "" for pure numbers, texts and counts."""
    return split(name)[1]


@cache
def split(name: str) -> tuple[str, str]:
    """Return the last part of a dotted key that is no place in a list, or a column, without its unit, and the unit."""
    *_, before, last = "", *name.split(".")
    last = before if last.isdecimal() else last
    found = next((end for end in UNITS if last.endswith(f"_{end}")), None)
    return (last, "") if found is None else (last.removesuffix(f"_{found}"), UNITS[found])


#: Parts of names that are written otherwise.
_WORDS = {"rms": "RMS", "phi": "φ", "phi1": "φ₁", "phi2": "φ₂", "lyapunov": "Lyapunov", "re": "(real)", "im": "(imag.)"}
_WORDS |= {"sync": "synchronization", "gamma": "throw index", "settle": "settling time"}
_EXTREMES = {"max": "largest", "min": "smallest"}


def display_name(name: str) -> str:
    """Return a key or column as a person says it, without its unit: ``gap_max_m`` is "largest gap".

    ``whole_stroke_x_at_s`` and ``whole_stroke_x_at_hz`` are the "time of" it in the whole run, and the "speed at" it.
    """
    last, unit = split(name)
    parts = last.split("_")
    begin = ""
    if parts[0] == "whole":
        parts = parts[1:]
        if parts[-1] == "at":
            parts, begin = parts[:-1], "speed at " if unit == "Hz" else "time of "
    end = next((part for part in parts[1:] if part in _EXTREMES), None)
    if end is not None:
        parts.remove(end)
        parts = [_EXTREMES[end], *parts]
    return begin + " ".join(_WORDS.get(part, part) for part in parts)


def list_place(key: str) -> str:
    """Return the place of a key in a list, counted from 1; "" for other keys."""
    return next((str(int(part) + 1) for part in key.split(".") if part.isdecimal()), "")


def indexed_name(key: str) -> str:
    """Return a key as a person says it, with exciter, spring or place in a list: "critical slip of exciter 2"."""
    name, place, section = display_name(key), list_place(key), key.partition(".")[0]
    if section == "springs":
        _, spring, key = key.split(".", 2)
        return f"{indexed_name(key)} of spring {spring}"
    if not place:
        return name
    return f"{name} of {section[:-1]} {place}" if section in ("exciters", "motors") else f"{name} ({place})"


#: Phase difference of the exciters, everywhere.
PHASE = r"$\Delta\varphi$"

#: What a machine does, by how its exciters are driven and synchronize. Forces of equal exciters that are mirror images
#: add so, and cancel otherwise; where exciters differ, something is left over.
VIBRATION_PATTERN = {
    ("counter-rotating", "antiphase"): "vibrates along y",
    ("counter-rotating", "in-phase"): "vibrates along x and rocks",
    ("co-rotating", "antiphase"): "rocks",
    ("co-rotating", "in-phase"): "moves in circles",
}


#: What exciters are called whose phase difference drifts.
NOT_SYNCHRONIZED = "not synchronized"
#: Distance of the phase difference from 0 or π (rad) up to which exciters count as in phase or in antiphase.
SYNCHRONOUS = math.pi / 3.0


def sync_name(phase: float) -> str:
    """Name the synchronization of exciters with a constant phase difference (rad, −π … π)."""
    if abs(phase) <= SYNCHRONOUS:
        return "in-phase"
    return "antiphase" if math.pi - abs(phase) <= SYNCHRONOUS else "intermediate"


def name_sync(sync: str) -> str:
    """Return what a synchronization, as tables have it, is called."""
    return NOT_SYNCHRONIZED if sync == "none" else sync


def describe_sync(sync: str, rotation: str) -> str:
    """Return the name of a synchronization, and what it does to a machine if that is known."""
    return ": ".join(filter(None, (name_sync(sync), VIBRATION_PATTERN.get((rotation, sync)))))


PHASE_COLUMN = "phase_difference_rad"


def name_regime(row: Mapping[str, Any], *further: str) -> str:
    """Name the motion of a row: "antiphase, period 1"; of one that ended early without a motion its outcome.

    Further words stand between the synchronization and the kind of motion.
    """
    if row.get("motion") is None:
        return str(row["outcome"])
    kind = f"period {row['period']}" if row["motion"] == "periodic" else row["motion"]
    return ", ".join(filter(None, (name_sync(row["sync"]), *further, kind)))


def is_angle(name: str) -> bool:
    """Whether a key or column holds angles on a circle: values a whole turn apart are the same.

    These are phase differences, also those beside a threshold (``below_…``). Rotations of the platform are small, and
    angles of exciters have all their turns; both are plain numbers, and so are standard errors of angles.
    """
    return name.endswith(PHASE_COLUMN)


def is_rotation(name: str) -> bool:
    """Whether a column holds rotations of the platform, which are small."""
    return "phi" in name.split("_")


#: Columns of a sweep, and of branches, and what they are called on an axis.
MEASURES = {
    "rms_y_m": "RMS $y$",
    "rms_x_m": "RMS $x$",
    "rms_phi_rad": r"RMS $\varphi$",
    PHASE_COLUMN: PHASE,
    "motor_power_w": "motor power",
    "contact_force_max_n": "largest $F_c$",
    "gap_max_m": "largest gap",
    "flight_fraction": "flight fraction",
    "amplitude_y_m": "amplitude of $y$",
    "impulse_max_n_s": "largest impulse",
    "impacts_per_period": "impacts per period",
    "lyapunov_per_s": "Lyapunov exponent",
}
#: Columns of a trajectory.
COORDINATES = {
    "y_m": "$y$",
    "x_m": "$x$",
    "phi_rad": r"$\varphi$",
    "gap_m": "gap $y_{w1}$",
    "along_m": "place $s$ along the deck",
    "contact_force_n": "contact force $F_c$",
}
#: Forces of springs and dampers, which follow from a trajectory.
FORCES = {"force_y_n": "force $y$ into\nfoundation", "force_x_n": "force $x$ into\nfoundation"}
#: What columns are called on axes, if not by their names.
AXIS_NAMES = MEASURES | COORDINATES | FORCES | {"t_s": "time"}
