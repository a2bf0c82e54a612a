"""Units of measured data, as loggers write them, and their factors to those of columns."""

from __future__ import annotations

import math
import re

#: Standard gravity (m/s²), in whose units many sensors measure.
GRAVITY = 9.80665
#: Factors to SI units by the ends of names of columns, of which the first that fits counts.
_FACTORS = {
    "_m_per_s2": {"m/s²": 1.0, "mm/s²": 1e-3, "cm/s²": 1e-2, "g": GRAVITY, "mg": 1e-3 * GRAVITY},
    "_rad_per_s": {"rad/s": 1.0, "°/s": math.pi / 180.0, "rpm": math.pi / 30.0, "1/min": math.pi / 30.0},
    "_m_per_s": {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2},
    "_n_m": {"N·m": 1.0, "kN·m": 1e3},
    "_rad": {"rad": 1.0, "mrad": 1e-3, "°": math.pi / 180.0},
    "_hz": {"Hz": 1.0, "kHz": 1e3, "rpm": 1.0 / 60.0, "1/min": 1.0 / 60.0},
    "_n": {"N": 1.0, "kN": 1e3},
    "_w": {"W": 1.0, "kW": 1e3},
    "_s": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "_m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "µm": 1e-6},
}
#: Other spellings.
_SPELLINGS = {
    **dict.fromkeys(("m/s2", "m/s^2", "m/s**2", "m/s/s", "ms-2", "ms^-2", "m*s^-2", "m·s⁻²", "m/sec2"), "m/s²"),
    **dict.fromkeys(("mm/s2", "mm/s^2", "mms-2", "mm/s/s"), "mm/s²"),
    **dict.fromkeys(("cm/s2", "cm/s^2"), "cm/s²"),
    **dict.fromkeys(("G", "gs", "gn", "g0", "g_n"), "g"),
    **dict.fromkeys(("sec", "secs", "second", "seconds", "sek"), "s"),
    **dict.fromkeys(("msec", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "usec", "μs"), "µs"),
    **dict.fromkeys(("deg", "degree", "degrees", "grad"), "°"),
    **dict.fromkeys(("deg/s", "dps"), "°/s"),
    **dict.fromkeys(("um", "μm"), "µm"),
    **dict.fromkeys(("Nm", "N*m"), "N·m"),
    **dict.fromkeys(("r/min", "min-1", "U/min"), "rpm"),
    **dict.fromkeys(("mm/sec",), "mm/s"),
}
#: A name and its unit behind it: ``Acc y (m/s^2)``, ``Acc y [g]``, ``Time: s``.
_NAMED = re.compile(r"(.*?)\s*(?:[(\[{]([^()\[\]{}]+)[)\]}]|[:,/]\s+(\S+))")


def _unit(text: str) -> str:
    """Return a unit as it is known here, or the text."""
    bare = text.strip().strip("()[]{} ").replace(" ", "")
    return _SPELLINGS.get(bare, bare)


def is_unit(text: str) -> bool:
    """Whether a text is a unit; in a row of units, ``-`` stands for none."""
    unit = _unit(text)
    return unit in ("-", "1") or any(unit in factors for factors in _FACTORS.values())


def split_name(name: str) -> tuple[str, str]:
    """Split a name of a column and the unit behind it, "" if there is none."""
    match = _NAMED.fullmatch(name)
    if match is None or not is_unit(match[2] or match[3]):
        return name, ""
    return match[1], _unit(match[2] or match[3])


def factor_of(column: str, text: str) -> float | None:
    """Return the factor of a unit to that of a column; None if it is of another quantity."""
    factors = next((of for end, of in _FACTORS.items() if column.endswith(end)), {})
    return factors.get(_unit(text))


def units_of(column: str) -> list[str]:
    """Return the units that values of a column may have."""
    return next(([*of] for end, of in _FACTORS.items() if column.endswith(end)), [])
