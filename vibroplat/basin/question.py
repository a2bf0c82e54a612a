"""The command ``basins``: attractors of a scene, the share of starts that comes to each, and what becomes of a start.

Starts are followed in blocks of fixed size. The first block finds the attractors that most starts come to; the others
know these, and what they find besides is compared in the order of blocks, so that nothing depends on who is first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.basin.carry import identities
from vibroplat.basin.follow import TOLD, follow_starts, representative, same_orbit
from vibroplat.basin.starts import begun, values_of
from vibroplat.columns import Column, Columns, words_in_place
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.questions import BasinsPlan
from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import accurate
from vibroplat.errors import ConfigError
from vibroplat.hybrid.state import state_scales
from vibroplat.observe.sheet import SHEET, of_points
from vibroplat.results.files import Command
from vibroplat.study import WAIT
from vibroplat.study.branches import column_of, study_table
from vibroplat.study.point import ERRORS, MEASURED, distinct
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.question import Answer, Progress, ask
from vibroplat.study.store import Record, Store
from vibroplat.study.sweep import SWEEP

#: Starts that a task follows.
BLOCK = 100
#: Error of the bounds of a fraction: they hold it in 95 of 100 samples.
DOUBT = 0.05
#: Motions that do not repeat are of one class if their measures are this near, over themselves.
ALIKE = 0.2
#: The same of motions that repeat.
REPEATED = 1e-3

#: Columns of the tables after the key that varies.
ATTRACTORS: Columns = {
    "attractor": Column("its name", "synchronization, motion and period, and more where these are not enough"),
    "motion": SWEEP["motion"],
    "period": SWEEP["period"],
    "sync": SWEEP["sync"],
    "count": Column("starts that come to it"),
    "fraction": Column("share of the starts"),
    "fraction_low": Column("lower bound of the share in the box of starts", "95 %, Clopper and Pearson (1934)"),
    "fraction_high": Column("upper bound", "as the lower one; of an attractor without starts 3 over their number"),
    "multiplier_max": SWEEP["multiplier_max"],
    "radius": Column(
        "size of the ellipsoid in which a start is assigned to it",
        "distances in left eigenvectors of the return map, in the scales of the scene; 0: each start by itself",
    ),
    **{name: SWEEP[name] for name in MEASURED},
    **{name: SWEEP[name] for name in (*ERRORS.values(), "coexists", "outcome", "detail", "notes")},
    **{name: Column(f"{name} of a state of it on the Poincaré section") for name in (*COORDINATES, *RATES)},
    **SHEET,
}
STARTS_TABLE: Columns = {
    "attractor": ATTRACTORS["attractor"],
    "turns": Column("turns of exciter 1 until the start was assigned"),
}
FRACTIONS: Columns = {
    name: ATTRACTORS[name] for name in ("attractor", "count", "fraction", "fraction_low", "fraction_high")
}


class Basins:
    """The question that the section ``basins`` of a scene asks; see :class:`vibroplat.study.question.Question`.

    Raises
    ------
    ConfigError
        There is no such section, a start is outside the model, or the supply is not constant.
    """

    command: Command = "basins"
    counted = "starts"
    absent = frozenset({"fractions"})

    def __init__(self, scene: Scene) -> None:
        if scene.basins is None:
            raise ConfigError("this configuration has no basins section; add basins: {starts: …}")
        accurate(scene, 1e-8)  # refuses a program of the drive
        self.scene, self.plan = scene, scene.basins
        over = self.plan.over
        self.key = None if over is None else over.key
        self.values: list[float] = [math.nan] if over is None else over.upward
        if over is not None and over.direction == ["down"]:
            self.values.reverse()
        self._scenes = [begun(self._at(value), self.plan) for value in self.values]
        self._blocks = [(first, min(BLOCK, self.plan.number - first)) for first in range(0, self.plan.number, BLOCK)]
        self.chains = len(self._blocks) * len(self.values)

    def _at(self, value: float) -> Scene:
        plain = self.scene.model_copy(update={"basins": None, "sweep": None, "orbits": None})
        try:
            return plain if self.key is None else plain.replace({self.key: value})
        except ConfigError as error:
            raise ConfigError(f"basins.over: {error}") from None

    def scenes(self) -> Sequence[Scene]:
        """Return the scenes at the values of the key."""
        return self._scenes

    def answer(self, store: Store, workers: Pool, progress: Progress) -> Answer:
        """Follow all starts, classify what does not repeat, and make the tables."""
        done, total = 0, self.plan.number * len(self.values)

        def block(place: int, number: int, known: Sequence[Record]) -> StoredChain[Record]:
            first, count = self._blocks[number]

            def tasks() -> Tasks[Record]:
                nonlocal done
                record = yield Task(follow_starts, (self._scenes[place], self.plan, first, count, list(known)))
                done += count
                progress(done, total)
                return record

            return StoredChain(tasks(), store, f"{place}: {number}")

        places = range(len(self.values))
        firsts = run_stored([block(place, 0, ()) for place in places], workers)
        rest = [(place, number) for place in places for number in range(1, len(self._blocks))]
        others = run_stored([block(place, number, firsts[place]["found"]) for place, number in rest], workers)
        found = []
        for place in places:
            own = [record for (at, _), record in zip(rest, others, strict=True) if at == place]
            found.append(_merged(self._scenes[place], firsts[place], own))
        self._classify(found, store, workers)
        names = identities(self._scenes, self.key, self.values, found, store, workers)
        return _told(self, found, names)

    def _classify(self, found: Sequence[_Found], store: Store, workers: Pool) -> None:
        """Measure one motion of each group that has come to no orbit, and count what is alike as one attractor."""
        groups = [(place, group) for place, f in enumerate(found) for group in f.groups()]

        def chain(number: int, place: int, group: Sequence[int]) -> StoredChain[Record]:
            f = found[place]
            state = f.starts[group[0]]["state"]

            def tasks() -> Tasks[Record]:
                return (yield Task(representative, (self._scenes[place], state)))

            return StoredChain(tasks(), store, f"motion {number}")

        chains = [chain(number, place, group) for number, (place, group) in enumerate(groups)]
        for (place, group), record in zip(groups, run_stored(chains, workers), strict=True):
            found[place].take(group, record)


class _Found:
    """What was found at one value of the key: attractors, and for each start its attractor's number and turns."""

    def __init__(self, scene: Scene, attractors: list[Record], starts: list[Record]) -> None:
        self.scene, self.attractors, self.starts = scene, attractors, starts
        for start in starts:  # a motion that has ended early is an outcome of its own
            if start["attractor"] is None and start["outcome"] != "ok":
                start["attractor"] = self._failed(start)

    def _failed(self, start: Record) -> int:
        for number, known in enumerate(self.attractors):
            if known["row"].get("outcome") == start["outcome"]:
                return number
        row = {"outcome": start["outcome"], "detail": start["detail"], "sync": None, "motion": None, "period": None}
        return self.add({"row": row, "state": None, "centres": [], "radius": None})

    def add(self, record: Record) -> int:
        """Add an attractor; its number."""
        self.attractors.append(record)
        return len(self.attractors) - 1

    def groups(self) -> list[list[int]]:
        """Group the starts that have come to no orbit by their synchronization and RMS displacements."""
        found: list[list[int]] = []
        for place, start in enumerate(self.starts):
            if start["attractor"] is not None:
                continue
            for group in found:
                if _alike(self.starts[group[0]]["row"], start["row"]):
                    group.append(place)
                    break
            else:
                found.append([place])
        return found

    def take(self, group: Sequence[int], record: Record) -> None:
        """Take what the first motion of a group is; it may be that of an attractor that is there already."""
        same = (k for k, known in enumerate(self.attractors) if _same(known["row"], record["row"]))
        number = next(same, None)
        if number is None:
            number = self.add(record)
        for place in group:
            self.starts[place]["attractor"] = number


def _alike(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether short measurements of two motions may be of one attractor."""
    return one["sync"] == other["sync"] and all(
        abs(one[name] - other[name]) <= ALIKE * max(abs(one[name]), abs(other[name])) for name in TOLD
    )


def _same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two measured motions are of one attractor."""
    if any(one.get(name) != other.get(name) for name in ("motion", "period", "sync", "outcome")):
        return False
    if not other.get("period"):
        return other.get("motion") is not None and not distinct(one, other)
    return all(abs(one[name] - other[name]) <= REPEATED * max(abs(one[name]), abs(other[name])) for name in TOLD)


def _merged(scene: Scene, first: Record, others: Sequence[Record]) -> _Found:
    """Gather blocks, in which the attractors that some have found for themselves may be the same."""
    attractors, starts = list(first["found"]), [dict(start) for start in first["starts"]]
    known, scales = len(attractors), state_scales(scene)
    for record in others:
        numbers = list(range(known))
        for found in record["found"]:
            same = [k for k, a in enumerate(attractors) if same_orbit(found, a, scales)]
            if not same:
                attractors.append(found)
            numbers.append(same[0] if same else len(attractors) - 1)
        for start in record["starts"]:
            number = start["attractor"]
            starts.append(start | {"attractor": None if number is None else numbers[number]})
    return _Found(scene, attractors, starts)


def bounds(count: int, number: int) -> tuple[float, float]:
    """Bounds of a share of which so many of a number were seen, one-sided where none or all were.

    Clopper and Pearson (1934), Biometrika 26, 404.
    """
    from scipy.special import betaincinv  # noqa: PLC0415  (half a second)

    tail = DOUBT / 2.0 if 0 < count < number else DOUBT
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return low, high


# -- tables -----------------------------------------------------------------------------------------------


def _told(question: Basins, found: Sequence[_Found], names: Sequence[Sequence[str]]) -> Answer:
    """Make the tables, and say what they tell."""
    plan, key = question.plan, question.key
    column = {} if key is None else {column_of(key): None}
    attractors, starts, places = [], [], values_of(plan, range(plan.number))
    for value, f, labels in zip(question.values, found, names, strict=True):
        at = dict.fromkeys(column, value)
        counts = np.bincount([start["attractor"] for start in f.starts], minlength=len(f.attractors)).tolist()
        order = sorted(range(len(counts)), key=lambda k: (-counts[k], k))
        attractors += [at | _row(f.attractors[k], labels[k], counts[k], plan.number) for k in order]
        ordered = np.lexsort(places.T[::-1]) if plan.shape and not plan.random else range(plan.number)
        starts += [
            at
            | dict(zip(plan.starts, places[k].tolist(), strict=True))
            | {"attractor": labels[f.starts[k]["attractor"]], "turns": f.starts[k]["turns"]}
            for k in ordered
        ]
    more = of_points(question.scene.output.points)
    tables = {
        "attractors": study_table(attractors, [*column, *ATTRACTORS, *more], {}, {**SWEEP, **ATTRACTORS, **more}),
        "starts": study_table(starts, [*column, *plan.starts, *STARTS_TABLE], {}, {**SWEEP, **STARTS_TABLE}),
    }
    if key is not None:
        tables["fractions"] = tables["attractors"][[*column, *FRACTIONS]]
    return Answer(
        tables,
        lines=_lines(plan, tables, len(question.values)),
        text=_text(tables["attractors"], key),
        notes=_notes(plan, tables["attractors"]),
        failures=_failures(tables["attractors"]),
    )


def _row(record: Record, label: str, count: int, number: int) -> dict[str, Any]:
    """Return the row of an attractor to which a count of a number of starts comes."""
    low, high = bounds(count, number)
    found = {"attractor": label, "count": count, "fraction": count / number, "fraction_low": low, "fraction_high": high}
    state = zip((*COORDINATES, *RATES), record["state"] or [None] * 14, strict=True)
    return {**record["row"], **dict(state), **found, "radius": record["radius"]}


def _lines(plan: BasinsPlan, tables: Mapping[str, pd.DataFrame], values: int) -> dict[str, str]:
    """Summarize: the box of starts is part of the answer."""
    ways = [f"{plan.number}"] + ([f"at each of {values} values of {plan.over.key}"] if plan.over else [])
    lines = {"starts": " ".join(ways)}
    for key, (low, high, *count) in plan.starts.items():
        lines[words_in_place(key)] = f"{low:g} … {high:g}" + (f", {int(count[0])} values" if count else ", at random")
    turns = tables["starts"]["turns"]
    lines["turns of a start"] = f"{turns.median():.0f} in the median, at most {turns.max():.0f}"
    return lines


def _text(table: pd.DataFrame, key: str | None) -> list[str]:
    """Return a line for each attractor."""
    column = None if key is None else column_of(key)
    width = max(map(len, table["attractor"]))
    return [
        ("" if column is None else f"{row[column]:<12g}")
        + f"{row['attractor']:<{width}}  {row['fraction']:.4f} ({row['fraction_low']:.4f} … {row['fraction_high']:.4f})"
        + (f"  RMS y {1e3 * row['rms_y_m']:.4g} mm" if pd.notna(row["rms_y_m"]) else "")
        + (f", multiplier {row['multiplier_max']:.4f}" if pd.notna(row["multiplier_max"]) else "")
        for _, row in table.iterrows()
    ]


def _notes(plan: BasinsPlan, table: pd.DataFrame) -> list[str]:
    """Return what deserves a second look."""
    notes = [f"an attractor with less than {3.0 / plan.number:.2g} of the box is easily missed by {plan.number} starts"]
    restless = table[(table["period"] == 0) & (table["count"] > 0)]
    if len(restless):
        notes.append(
            f"motions that came to no orbit in {plan.longest_turns} turns are told from each other by their RMS values "
            "alone; one of each kind was classified"
        )
    return notes


def _failures(table: pd.DataFrame) -> list[str]:
    """Return a line for each way in which motions have ended early."""
    failed = table[table["outcome"] != "ok"]
    return [f"{row['outcome']} from {row['count']} starts: {row['detail']}" for _, row in failed.iterrows()]


def basins(
    scene: Scene,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    progress: Progress | None = None,
) -> Answer:
    """Find the attractors that a scene comes to from the starts of its ``basins`` section, and how many come to each.

    Parameters
    ----------
    scene
        A scene with a section ``basins``.
    jobs, scheduler, wait
        As of :func:`vibroplat.sweep`.
    progress
        Called with the numbers of finished and of all starts.

    Returns
    -------
    Answer
        ``tables`` has ``attractors``, ``starts`` and, over a key, ``fractions``; a row of ``attractors`` is a guess for
        :func:`vibroplat.orbit`.

    Raises
    ------
    ConfigError
        There is no such section, a start is outside the model, or the supply is not constant.

    Examples
    --------
    >>> from vibroplat import Scene, basins
    >>> starts = {"run.initial.phase_difference_rad": [-3.0, 3.0, 4]}
    >>> found = basins(Scene().replace({"basins": {"starts": starts}}))
    >>> found.tables["starts"]["turns"].size
    4
    """
    return ask(Basins(scene), jobs, scheduler, wait, progress or (lambda done, known: None))
