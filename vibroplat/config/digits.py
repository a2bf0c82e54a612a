"""Numbers for people: digits, prefixes and zeros by one rule, for prints, notes, pages and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vibroplat.columns import PHASE_COLUMN, is_rotation, unit_of

#: Digits that a number has, and a frequency.
DIGITS, FREQUENCY_DIGITS = 3, 4
#: Size below which a quantity counts as nothing, over the largest one of its kind.
NEGLIGIBLE = 1e-3
#: Size, and decimals, from which on a number has a power of ten; and those of numbers on an axis.
HUGE, MOST_DECIMALS = 1e12, 12
HUGE_TICK, MOST_TICK_DECIMALS = 1e6, 6
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What stands where there is no number.
MISSING = "–"
#: Units that take a prefix, with the factors to those that are written, in ascending order. Motion is in mm and mrad
#: whatever its size, so that columns can be compared.
PREFIXES: dict[str, tuple[tuple[float, str], ...]] = {
    "m": ((1e-3, "mm"),),
    "rad": ((1e-3, "mrad"),),
    "N": ((1.0, "N"), (1e3, "kN"), (1e6, "MN")),
    "N·s": ((1e-3, "mN·s"), (1.0, "N·s"), (1e3, "kN·s")),
    "N·m": ((1e-3, "mN·m"), (1.0, "N·m"), (1e3, "kN·m")),
    "W": ((1e-3, "mW"), (1.0, "W"), (1e3, "kW")),
    "J": ((1e-3, "mJ"), (1.0, "J"), (1e3, "kJ"), (1e6, "MJ")),
    "N/m": ((1.0, "N/m"), (1e3, "kN/m"), (1e6, "MN/m")),
}
#: Units whose numbers are written without decimals.
WHOLE = ("rpm", "1/min", "°")
#: A size this close to the next prefix is written with it, as rounding would.
_ALMOST = 1.0 - 0.5 * 10.0**-DIGITS


def prefixed(size: float, unit: str) -> tuple[float, str]:
    """Return the factor and the name of the unit in which a size has 1 … 999 before its point, as far as one has it."""
    ladder = PREFIXES.get(unit, ((1.0, unit),))
    return next((step for step in reversed(ladder) if abs(size) >= _ALMOST * step[0]), ladder[0])


def shown_unit(column: str, size: float) -> tuple[str, float]:
    """Return the unit in which numbers of a column up to a size are shown, and the factor from SI units to it.

    Phase differences are in degrees, lengths in mm, rotations of the platform in mrad; forces, torques, powers and
    works have a prefix. Keys, whose names have a dot, have the unit of their name, in which a user gives them.
    """
    if column == PHASE_COLUMN:
        return "°", 180.0 / math.pi
    unit = unit_of(column)
    if "." in column or (unit == "rad" and not is_rotation(column)):
        return unit, 1.0
    step, name = prefixed(size, unit)
    return name, 1.0 / step


def places(value: float, digits: int = DIGITS, error: float | None = None) -> int:
    """Return the decimals of a number: so many digits, none beyond the first digit of its error; negative for tens."""
    if not value or not math.isfinite(value):
        return 0
    count = digits - 1 - _first_digit(value, digits)
    return count if not error else min(count, -_first_digit(error, 1))


def decimal(value: float, decimals: int) -> str:
    """Write a number with so many decimals; never −0, and a power of ten only where no machine has such numbers."""
    if not math.isfinite(value):
        return MISSING
    if abs(value) >= HUGE or decimals > MOST_DECIMALS:
        return power_of_ten(value)
    return f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}".replace("-", "−")


def power_of_ten(value: float) -> str:
    """Write a number that is very small or large with a power of ten."""
    mantissa, _, power = f"{value:.2e}".partition("e")
    front = f"{float(mantissa):g}·".removesuffix("1·") if abs(float(mantissa)) == 1.0 else f"{float(mantissa):g}·"
    return f"{front}10{str(int(power)).translate(_RAISED)}".replace("-", "−")


def tick_text(value: float, step: float) -> str:
    """Write a number of an axis with the decimals that its step needs; what has many zeros as a power of ten."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9)) if step else 0
    if decimals > MOST_TICK_DECIMALS or abs(value) >= HUGE_TICK:
        return power_of_ten(value) if value else "0"
    return decimal(value, decimals)


def number(value: float | None, digits: int = DIGITS, error: float | None = None) -> str:
    """Write a number without a unit and without an exponent; what is not finite is ``MISSING``."""
    if value is None or not math.isfinite(value):
        return MISSING
    return decimal(value, places(value, digits, error))


def quantity(
    value: float | None,
    unit: str = "",
    *,
    digits: int | None = None,
    error: float | None = None,
    largest: float | None = None,
    size: float | None = None,
) -> str:
    """Write a number with its unit.

    Parameters
    ----------
    value
        Number, in SI units; None or one that is not finite is ``MISSING``.
    unit
        SI unit, as :data:`vibroplat.columns.UNITS` writes it; it gets a prefix where :data:`PREFIXES` has one.
    digits
        Significant digits. Default: 3, of a frequency 4, of a speed in 1/min and of an angle in degrees no decimals.
    error
        How far the number may be wrong: no digits are written beyond its first one, and what is not above it is "0".
    largest
        The largest of its kind: what is not above 1/1000 of it is "0", without a unit.
    size
        Number whose prefix is taken, for numbers beside each other.
    """
    if value is None or not math.isfinite(value):
        return MISSING
    if abs(value) <= max(error or 0.0, NEGLIGIBLE * abs(largest or 0.0)):
        return "0"
    factor, name = prefixed(value if size is None else size, unit)
    scaled = value / factor
    if digits is None and unit in WHOLE:
        decimals = 0
    else:
        decimals = places(scaled, digits or digits_of(unit), error and error / factor)
    return f"{decimal(scaled, decimals)} {name}".strip()


def spread(value: float, around: float, unit: str, error: float = 0.0) -> str:
    """Write a number and one to either side in one unit: two digits of the smaller, three or four of the larger.

    What is not above 1/1000 of the number is nothing to either side. No digits are beyond the first one of an error.
    """
    if abs(around) <= NEGLIGIBLE * abs(value) or not math.isfinite(value + around):
        return quantity(value, unit)
    factor, name = prefixed(max(abs(value), abs(around)), unit)
    small, large = sorted((abs(value) / factor, abs(around) / factor))
    first = _first_digit(large, 3) if large else 0
    decimals = min(max(1 - _first_digit(small, 2) if small else 0, 2 - first), 3 - first)
    decimals = min(decimals, -_first_digit(error / factor, 1)) if error else decimals
    return f"{decimal(value / factor, decimals)} ± {decimal(around / factor, decimals)} {name}".strip()


def interval(low: float, high: float, unit: str = "", *, digits: int | None = None) -> str:
    """Write an interval in one unit, with the decimals of its larger end."""
    factor, name = prefixed(max(abs(low), abs(high)), unit)
    decimals = places(max(abs(low), abs(high)) / factor, digits or digits_of(unit))
    first, last = (decimal(end / factor, decimals) for end in (low, high))
    return f"{first if first == last else f'{first} … {last}'} {name}".strip()


def together(values: Sequence[float], unit: str, between: str = ", ") -> str:
    """Write numbers beside each other, equal ones once, and their unit behind the last one."""
    size = max(map(abs, values))
    name = f" {prefixed(size, unit)[1]}".rstrip()
    texts = dict.fromkeys(quantity(value, unit, largest=size, size=size).removesuffix(name) for value in values)
    return between.join(texts) + name


def pair(one: float, other: float, unit: str = "") -> tuple[str, str]:
    """Write two numbers that are to be compared: in one unit, with two digits of their difference."""
    size, apart = max(abs(one), abs(other)), 0.1 * abs(one - other)
    apart = apart if math.isfinite(apart) else 0.0
    digits = MOST_DECIMALS if apart else None
    first, second = (quantity(value, unit, digits=digits, error=apart, size=size) for value in (one, other))
    return first, second


def percent(value: float | None) -> str:
    """Write a fraction in per cent: whole from 10 to 90, else with one decimal; 0 and 100 only where they are exact."""
    if value is None or not math.isfinite(value):
        return MISSING
    percent = 100.0 * value
    if percent in (0.0, 100.0):
        return f"{percent:.0f} %"
    if 0.0 < percent < 0.05:
        return "< 0.1 %"
    if -0.05 < percent < 0.0:
        return "> −0.1 %"
    if 99.95 <= percent < 100.0:
        return "> 99.9 %"
    return f"{decimal(percent, 0 if 10.0 <= abs(percent) <= 90.0 or abs(percent) > 100.0 else 1)} %"


def given(value: float) -> str:
    """Write a number that a user gave as he gave it; one with more than ten digits was computed, and has six."""
    is_given = f"{value:.10g}" == f"{value:.12g}"
    return f"{value if is_given else float(f'{value:.6g}'):.12g}"


def digits_of(unit: str) -> int:
    """Return the significant digits of numbers of a unit."""
    return FREQUENCY_DIGITS if unit == "Hz" else DIGITS


def _first_digit(value: float, digits: int) -> int:
    """Return the power of ten of the first digit of a number that is rounded to so many digits."""
    return int(f"{abs(value):.{digits - 1}e}".partition("e")[2])
