"""The supply of both motors: a constant frequency, or a program over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import accumulate, pairwise, takewhile
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeVar

from pydantic import BeforeValidator, Field, model_validator

from vibroplat.config.schema import NonNegative, Positive, Section, described

#: Supply frequency where none is given (Hz).
FREQUENCY = 50.0

#: Fraction of a program's largest frequency below which the critical slip speed falls no more with the frequency.
#: Kloss's formula with a constant critical slip has no limit at 0 Hz and standstill: the torque depends on the way
#: there, and the motor becomes infinitely stiff.
MIN_FREQUENCY_RATIO = 1e-3

#: Minimum supply frequency of a program above 0 (Hz).
MIN_FREQUENCY = 1e-3

#: Minimum time between two entries that are not at the same one (s): no motor can tell a shorter ramp from a jump.
MIN_INTERVAL = 1e-6

#: Most entries of a program.
MAX_ENTRIES = 1000


def _switch(value: Any) -> Any:
    """Accept true and false as well: YAML 1.1 reads on and off so."""
    return ("off", "on")[value] if isinstance(value, bool) else value


T = TypeVar("T")
Switch = Annotated[Literal["on", "off"], BeforeValidator(_switch)]


class Entry(Section):
    """An entry of a program. What it leaves out is as in the entry before; at first both exciters are on."""

    t_s: NonNegative = described(..., "t", "time of the entry")
    supply_frequency_hz: NonNegative | None = described(
        None,
        "f_e",
        "supply frequency at that time; linear between entries, and a jump between two entries of the same time; the "
        "maximum frequency defines the scaled units; below 1/1000 of it the critical slip speed stays constant",
    )
    exciter_1: Switch | None = described(None, "", "exciter 1 on or off from that time; off: no motor torque")
    exciter_2: Switch | None = described(None, "", "exciter 2 on or off from that time")
    off: bool | None = described(None, "", "true: both exciters off from that time; false: both on")

    alternatives = (("off", "exciter_1"), ("off", "exciter_2"))

    @property
    def driven(self) -> tuple[bool | None, bool | None]:
        """Whether exciters 1 and 2 are on from then on; None: as before."""
        if self.off is not None:
            return not self.off, not self.off
        first, second = (None if switch is None else switch == "on" for switch in (self.exciter_1, self.exciter_2))
        return first, second

    @model_validator(mode="after")
    def _no_minute_frequency(self) -> Self:
        if self.supply_frequency_hz is not None and 0.0 < self.supply_frequency_hz < MIN_FREQUENCY:
            raise ValueError(
                f"supply_frequency_hz = {self.supply_frequency_hz}; allowed: 0, or at least {MIN_FREQUENCY:g}"
            )
        return self


class SupplyInterval(NamedTuple):
    """A time over which the supply frequency is linear and nothing is switched.

    Attributes
    ----------
    start, end
        When it begins and ends (s); the last one ends at infinity.
    frequency
        Supply frequency at its start (Hz).
    ramp
        Rate of that frequency (Hz/s).
    driven
        Whether exciters 1 and 2 are on.
    slip_frequency
        Frequency at its start from which critical slip speeds follow (Hz), and that frequency's rate (Hz/s).
    corner
        Whether it begins with an entry of the program.
    """

    start: float
    end: float
    frequency: float
    ramp: float
    driven: tuple[bool, bool]
    slip_frequency: tuple[float, float]
    corner: bool = True

    def frequency_at(self, time: float) -> float:
        """Supply frequency at a time (Hz)."""
        return self.frequency + self.ramp * (time - self.start) if self.ramp else self.frequency


class Drive(Section):
    """The common supply of both motors."""

    supply_frequency_hz: Positive | None = described(
        None, "f_e", f"supply frequency of both motors; default: {FREQUENCY:g}, or as in program", "20 … 60"
    )
    program: Annotated[list[Entry], Field(max_length=MAX_ENTRIES)] | None = Field(
        None, description="supply over time: a list of entries, instead of supply_frequency_hz"
    )

    alternatives = (("supply_frequency_hz", "program"),)

    @model_validator(mode="before")
    @classmethod
    def _default(cls, given: Any) -> Any:
        if isinstance(given, dict) and "supply_frequency_hz" not in given and given.get("program") is None:
            return given | {"supply_frequency_hz": FREQUENCY}
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.program is None:
            if self.supply_frequency_hz is None:
                raise ValueError("supply_frequency_hz = None; allowed: a number, or a program instead")
            return self
        if not self.program:
            raise ValueError("program is empty; allowed: one entry or more")
        if self.program[0].supply_frequency_hz is None:
            raise ValueError("program.0: supply_frequency_hz is required in the first entry")
        times = [entry.t_s for entry in self.program]
        for i, (before, after) in enumerate(pairwise(times), start=1):
            if after < before:
                raise ValueError(f"program.{i}.t_s = {after} lies before {before}; allowed: times in ascending order")
            if 0.0 < after - before < MIN_INTERVAL - math.ulp(after):
                raise ValueError(
                    f"program.{i}.t_s = {after} is {after - before:.2g} s after {before}; allowed: the same time, "
                    f"for a jump, or at least {MIN_INTERVAL:g} s later"
                )
            if i > 1 and times[i - 2] == after:
                raise ValueError(f"program.{i}.t_s = {after} is given three times; allowed: twice, for a jump")
        if not self.largest_frequency > 0.0:
            raise ValueError("program has no supply_frequency_hz above 0; allowed: at least one, the scales follow it")
        return self

    @property
    def largest_frequency(self) -> float:
        """Largest supply frequency (Hz)."""
        if self.program is None:
            assert self.supply_frequency_hz is not None  # ensured by the validator
            return self.supply_frequency_hz
        return max(entry.supply_frequency_hz or 0.0 for entry in self.program)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy the supply, with some values changed; its intervals are found anew."""
        copied = super().model_copy(update=update, deep=deep)
        copied.__dict__.pop("intervals", None)
        return copied

    @cached_property
    def intervals(self) -> tuple[SupplyInterval, ...]:
        """The intervals between corners of the program in order of time; a constant supply has one."""
        if self.program is None:
            constant = self.largest_frequency
            return (SupplyInterval(-math.inf, math.inf, constant, 0.0, (True, True), (constant, 0.0)),)
        parts: list[SupplyInterval] = []
        least = MIN_FREQUENCY_RATIO * self.largest_frequency
        frequencies = _fill_forward([entry.supply_frequency_hz for entry in self.program], 0.0)
        first, second = (_fill_forward([entry.driven[i] for entry in self.program], True) for i in range(2))
        times = [*(entry.t_s for entry in self.program), math.inf]
        for i, (start, end) in enumerate(pairwise(times)):
            if end > start:
                rise = frequencies[i + 1] - frequencies[i] if end < math.inf else 0.0
                parts += _split_interval(start, end, frequencies[i], rise / (end - start), (first[i], second[i]), least)
        return tuple(parts)

    def until(self, time: float) -> Drive:
        """Return the supply by a program that stays as it is just before a time (s); itself, if that is 0 Hz always."""
        before = [entry for entry in self.program or () if entry.t_s < time - MIN_INTERVAL]
        frequency = [supply for supply in self.intervals if supply.start < time][-1].frequency_at(time)
        last = Entry(t_s=time, supply_frequency_hz=frequency if frequency >= MIN_FREQUENCY else 0.0)
        entries = [*before, last]
        return Drive(program=entries) if any(entry.supply_frequency_hz for entry in entries) else self

    def last_change(self, time: float) -> float:
        """When the supply last changes before a time (s); the end of the ramp if it is changing then. -inf: never."""
        supplies = [supply for supply in self.intervals if supply.start < time]
        now = supplies[-1] if supplies else self.intervals[0]
        if now.ramp:  # of which a part may be a piece of its own
            later = takewhile(lambda supply: supply.ramp, self.intervals[max(len(supplies), 1) :])
            return [now, *later][-1].end
        begin = now.start
        for before in reversed(supplies[:-1]):
            if before.ramp or (before.frequency, before.driven) != (now.frequency, now.driven):
                return begin
            begin = before.start
        return -math.inf

    def last_switch(self, begin: float, time: float) -> tuple[float, str] | None:
        """When motors were last switched in a run that begins at a time (s) before another one, and how; None: never.

        They are off at the beginning if they are so from there on, as in a run that stops a machine.
        """
        before, switch = (True, True), None
        for supply in self.intervals:
            if supply.start > time:
                break
            changed = [n for n, (was, now) in enumerate(zip(before, supply.driven, strict=True), 1) if was != now]
            if changed:
                who = "" if changed[1:] else f"motor {changed[0]} "
                switch = max(supply.start, begin), f"{who}{'on' if supply.driven[changed[0] - 1] else 'off'}"
            before = supply.driven
        return switch

    def at(self, time: float) -> SupplyInterval:
        """Interval of a time (s); at a corner the one that begins there."""
        return interval_at(self.intervals, time)


def interval_at(intervals: Sequence[SupplyInterval], time: float) -> SupplyInterval:
    """Pick the interval of a time (s) among all of a drive; at a corner the one that begins there."""
    return intervals[max(bisect_right(intervals, time, key=lambda interval: interval.start) - 1, 0)]


def _fill_forward(values: Sequence[T | None], first: T) -> list[T]:
    """Replace each None by the value before it; at the beginning by the first one."""
    return list(accumulate(values, lambda before, value: before if value is None else value, initial=first))[1:]


def _split_interval(
    start: float, end: float, frequency: float, ramp: float, driven: tuple[bool, bool], least: float
) -> list[SupplyInterval]:
    """Split the time between two entries where the supply passes the least frequency of a critical slip speed."""
    passed = start + (least - frequency) / ramp if ramp else end
    if not start < passed < end:
        low = max(frequency, frequency + ramp * (end - start) if ramp else frequency) <= least
        return [SupplyInterval(start, end, frequency, ramp, driven, (least, 0.0) if low else (frequency, ramp))]
    falls = ramp < 0.0
    first, second = ((frequency, ramp), (least, 0.0)) if falls else ((least, 0.0), (least, ramp))
    return [
        SupplyInterval(start, passed, frequency, ramp, driven, first),
        SupplyInterval(passed, end, least, ramp, driven, second, corner=False),
    ]
