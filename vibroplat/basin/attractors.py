"""The attractors found so far by blocks of initial conditions, and classes of aperiodic motions.

Over a key, attractors are carried from value to value, and keep their identity where their orbit is continued.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroplat.basin.mapper import AttractorMapper, same_orbit, window_length
from vibroplat.basin.windows import classify_windows, components, is_alike, same_motion
from vibroplat.columns import PHASE_COLUMN, name_regime
from vibroplat.config.circular import degrees_text
from vibroplat.config.scene import Scene
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.continuation.orbit_neighbourhood import OrbitNeighbourhood
from vibroplat.hybrid.state import state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.store import Record

#: A window of a motion that repeats is of it if its measures are this near, over themselves, as its turns need not be a
#: multiple of the period.
WINDOW_TOLERANCE = 0.02
#: A parameter step is divided into CONTINUATION_PARTS sub-steps. The orbit keeps its identity if its largest
#: displacement in a sub-step is at most MAX_PART_RATIO times the smallest plus SMALL_PART (scaled units).
CONTINUATION_PARTS, MAX_PART_RATIO, SMALL_PART = 4, 3.0, 0.05


#: What names of attractors say further where they are alike otherwise, by column.
_FURTHER_WORDS: Mapping[str, Callable[[float], str]] = {
    PHASE_COLUMN: lambda phase: f"Δφ {degrees_text(phase)}",
    "rms_y_m": lambda height: f"RMS y {1e3 * height:.3g} mm",
    "impacts_per_period": lambda impacts: f"{impacts:.3g} impact{'s' * (impacts != 1.0)} a period",
}
#: Errors of a conveying speed up to which it may be 0.
SPEED_ERRORS = 3.0


@dataclass
class AperiodicGroup:
    """Starts whose motions have converged to no orbit, and are alike or change into each other.

    Attributes
    ----------
    starts, escaped
        Records of those that are not assigned yet, and of those that converged to an orbit when they were followed
        longer.
    """

    starts: list[Record]
    escaped: list[Record]


class AttractorSet:
    """What was found at one value of the key: attractors, and for each start its attractor's number and turns.

    Parameters
    ----------
    scene, known
        The scene, and attractors that were known before.
    """

    def __init__(self, scene: Scene, known: Sequence[Record]) -> None:
        self.scene, self.attractors, self.starts = scene, list(known), list[Record]()

    def add(self, blocks: Sequence[Record]) -> None:
        """Add records of :func:`vibroplat.basin.mapper.map_initial_conditions`; what several have found is the same."""
        scales = state_scales(self.scene)
        for block in blocks:
            numbers = list(range(block["known"]))
            for record in block["found"]:
                same = [k for k, one in enumerate(self.attractors) if same_orbit(record, one, scales)]
                numbers.append(same[0] if same else self._add(record))
            for start in block["starts"]:
                number = start["attractor"]
                if number is not None:
                    number = numbers[number]
                elif start["outcome"] != "ok":  # a motion that has ended early is an outcome of its own
                    row = {"outcome": start["outcome"], "detail": start["detail"]} | dict.fromkeys(_CLASS)
                    number = self._number(_record(row))
                self.starts.append(start | {"attractor": number})

    def _add(self, record: Record) -> int:
        self.attractors.append(record)
        return len(self.attractors) - 1

    def _number(self, record: Record) -> int:
        """Return the number of the attractor of a measured motion; a new one is added."""
        row, scales = record["row"], state_scales(self.scene)
        same = (k for k, known in enumerate(self.attractors) if same_motion(known["row"], row, scales))
        number = next(same, None)
        return self._add(record) if number is None else number

    @property
    def counts(self) -> list[int]:
        """Number of initial conditions that converged to each attractor."""
        counts = Counter(start["attractor"] for start in self.starts)
        return [counts[number] for number in range(len(self.attractors))]

    def count_seen_turns(self, max_turns: int) -> int:
        """Return the turns in which motions without an orbit might have been seen to change into each other."""
        windows = [start["windows"] for start in self.starts if "windows" in start]
        return sum(len(path) - 1 for path in windows) * (window_length(max_turns) + 1)

    def groups(self) -> list[AperiodicGroup]:
        """Group the starts that have converged to no orbit by the motions into which their windows change for good.

        Where a group was left for one other group alone, its starts join that one, behind the other's own starts.
        """
        left = [start for start in self.starts if start["attractor"] is None]
        ends, closed = components(classify_windows([start["windows"] for start in left], state_scales(self.scene)))
        groups: dict[int, AperiodicGroup] = {}
        for start, end in zip(left, ends, strict=True):
            group = groups.setdefault(min(closed[end]) if len(closed[end]) == 1 else end, AperiodicGroup([], []))
            group.starts.append(start)
        for name, group in groups.items():
            own = {id(start) for start, end in zip(left, ends, strict=True) if end == name}
            group.starts.sort(key=lambda start: id(start) not in own)
        return list(groups.values())

    def find_alike(self, group: AperiodicGroup, record: Record) -> list[Record]:
        """Return the starts of a group whose last windows are like a motion that repeats: they may be on its orbit."""
        scales, row = state_scales(self.scene), record["row"]
        if not row.get("period"):
            return []
        return [start for start in group.starts if is_alike(start["windows"][-1], row, scales, WINDOW_TOLERANCE)]

    def take_continued(self, group: AperiodicGroup, record: Record, repeating: Sequence[Record]) -> None:
        """Take what the motion of the first start of a group is when it is followed longer.

        Where it repeats, ``repeating`` are the starts that were on its orbit already. If the first is none of them, it
        has escaped to this orbit; another one has to tell what the motion of the group is.
        """
        record = _record(record["row"], record["state"])
        number, first = self._number(record), group.starts[0]
        if record["row"].get("period"):
            mine = list(repeating)
            group.escaped += [first] if first not in mine else []
        else:
            mine = group.starts + group.escaped
            self.attractors[number]["escaped"] = len(group.escaped)
        self._assign(mine, number)
        group.starts = [start for start in group.starts if start["attractor"] is None and start is not first]

    def mark_undecided(self, group: AperiodicGroup) -> None:
        """Call the motion of a group undecided, as all that were followed longer have escaped to orbits."""
        left = group.starts + group.escaped
        left = [start for start in left if start["attractor"] is None]
        if not left:
            return
        why = f"{len(group.escaped)} such motions were continued, and all converged to an orbit"
        undecided = {"motion": "undecided", "period": 0, "outcome": "ok", "detail": why}
        record = _record({**left[0]["windows"][-1], **undecided}, left[0]["state"])
        self._assign(left, self._add(record | {"escaped": len(group.escaped)}))

    @staticmethod
    def _assign(starts: Sequence[Record], number: int) -> None:
        for start in starts:
            start["attractor"] = number


_CLASS = ("motion", "period", "sync")


def _record(row: Mapping[str, Any], state: Sequence[float] | None = None) -> Record:
    """Return the record of a motion that is no orbit."""
    centres = [] if state is None else [state]
    return {"row": dict(row), "state": state, "centres": centres, "forms": [], "radius": None, "ellipsoids": None}


# -- over a key -------------------------------------------------------------------------------------------------------


def continue_attractors(
    before: Scene, scene: Scene, key: str, max_turns: int, ends: Sequence[float], attractors: Sequence[Record]
) -> Record:
    """Continue the orbits of attractors from one value of a key to the next, in parts of the step.

    Those that stay stable are returned as attractors there, each with ``former``, its number among the given ones.
    """
    with closing(AttractorMapper(scene, max_turns, ())) as mapper:
        for number, attractor in enumerate(attractors):
            if not attractor["row"].get("period") or attractor["state"] is None:
                continue
            try:
                state = _continue_orbit(before, key, ends, attractor)
                if state is not None:
                    index = mapper.register_near(state, attractor["row"]["period"])
                    mapper.attractors[index].setdefault("former", number)
            except (NoConvergenceError, OrbitError, ValueError):
                continue
        return {"found": [record for record in mapper.attractors if "former" in record]}


def _continue_orbit(scene: Scene, key: str, ends: Sequence[float], attractor: Record) -> FloatArray | None:
    """Return a full state of the orbit at the end of a step, None where it is unstable or another one."""
    local = OrbitNeighbourhood.near(scene, [key], np.array(attractor["state"]), period=attractor["row"]["period"])
    with closing(local):
        places = [_location(local)]
        for value in np.linspace(ends[0], ends[1], CONTINUATION_PARTS + 1)[1:]:
            local = local.correct([float(value)])
            places.append(_location(local))
        ways = np.abs(np.diff(places, axis=0)).max(axis=1)
        alike = ways.max() <= MAX_PART_RATIO * ways.min() + SMALL_PART
        return local.state if alike and local.margin > 0.0 else None


def _location(local: OrbitNeighbourhood) -> list[float]:
    """Say where an orbit is, by its measures in scaled units."""
    scales, measures = state_scales(local.scene), local.measures
    phase = measures["phase_difference_rad"] or 0.0
    lengths = (measures[name] / scales[index] for index, name in enumerate(("rms_x_m", "rms_y_m", "rms_phi_rad")))
    return [*lengths, np.cos(phase), np.sin(phase)]


def match_attractors(sets: Sequence[AttractorSet]) -> list[list[int]]:
    """Give each attractor a number at all values of a key; those that were carried, and motions of a class, keep it."""
    numbers: list[list[int]] = []
    count = 0
    for index, now in enumerate(sets):
        own: list[int] = []
        for record in now.attractors:
            former = record.get("former")
            if former is None and index and not record["row"].get("period"):
                former = _number_of_class(sets[index - 1].attractors, record["row"])
            free = former is not None and numbers[-1][former] not in own
            own.append(numbers[-1][former] if free and former is not None else count)
            count += own[-1] == count
        numbers.append(own)
    return numbers


def _number_of_class(attractors: Sequence[Record], row: Mapping[str, Any]) -> int | None:
    """Return the number of the first attractor that has the class of a row."""
    names = (*_CLASS, "outcome")
    same = (k for k, a in enumerate(attractors) if all(a["row"].get(name) == row.get(name) for name in names))
    return next(same, None)


# -- names ------------------------------------------------------------------------------------------------------------


def name_attractors(sets: Sequence[AttractorSet]) -> Iterator[list[str]]:
    """Name attractors as a reader would, at each value: by synchronization and period, where these are alike by more.

    One that is continued over a key has the name that it has where it is first.
    """
    numbers = match_attractors(sets)
    first: dict[int, Mapping[str, Any]] = {}
    for own, now in zip(numbers, sets, strict=True):
        for number, record in zip(own, now.attractors, strict=True):
            first.setdefault(number, record["row"])
    rows = [first[number] for number in range(len(first))]
    names = [name_regime(row, _conveying(row)) for row in rows]
    for column, text in _FURTHER_WORDS.items():
        known = [row.get(column) for row in rows]
        longer = [name if at is None else f"{name}, {text(at)}" for name, at in zip(names, known, strict=True)]
        different = Counter(name for name, _ in {*zip(names, longer, strict=True)})
        names = [more if different[name] > 1 else name for name, more in zip(names, longer, strict=True)]
    counts, seen = Counter(names), Counter[str]()
    for index, name in enumerate(names):
        seen[name] += 1
        names[index] = f"{name} ({seen[name]})" if counts[name] > 1 else name
    for own in numbers:
        yield [names[number] for number in own]


def _conveying(row: Mapping[str, Any]) -> str:
    """Say where material goes, if it may go along the deck."""
    speed, error = row.get("conveying_speed_m_per_s"), row.get("conveying_speed_error_m_per_s") or 0.0
    if speed is None:
        return ""
    if row.get("stick_fraction") == 1.0:
        return "material sticks"
    return "conveys nowhere" if abs(speed) <= SPEED_ERRORS * error else f"conveys to {'+' if speed > 0.0 else '−'}x"
