"""The study ``find`` of a scene: its tables and its printed answer."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Unpack

import pandas as pd

from vibroplat.columns import TEXT, Columns, is_angle, unit_of
from vibroplat.config.circular import bound_meaning, value_text
from vibroplat.config.digits import MOST_DECIMALS, decimal, given, interval, number, percent, places
from vibroplat.config.keys import number_of
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.plausibility import WARNING
from vibroplat.config.scene import Scene
from vibroplat.config.schema import did_you_mean
from vibroplat.config.study_plans import FindPlan
from vibroplat.errors import ConfigError, errors_about
from vibroplat.report.data_sheet import SHEET, more_columns
from vibroplat.results.answer import Answer, counted
from vibroplat.results.result import Result
from vibroplat.study.branches import SUPPLY, column_of, measures_text, place_words, study_table
from vibroplat.study.point import failed_record
from vibroplat.study.pool import Pool, Task
from vibroplat.study.store import Store
from vibroplat.study.study import COMPARED, CrossCheckCase, Options, Progress, Study, run_study
from vibroplat.study.sweep import SWEEP
from vibroplat.thresholds.distinct import Indistinct, is_doubtful, measures_to_ask
from vibroplat.thresholds.evidence import ERROR_PROBABILITY, NOT_NARROWED, ClearRange, Threshold, Zone, facts, is_wanted
from vibroplat.thresholds.search import ThresholdSearch, start_key
from vibroplat.thresholds.tables import POINT_COLUMNS, SIDE_COLUMNS, TABLES, THRESHOLDS, VALUES
from vibroplat.thresholds.values import LEVEL_CROSSING, OPPOSITE_CROSSING, ScanPoint, evaluate

#: Printed texts of kinds whose names alone are unclear.
KIND_TEXTS = {
    "unresolved-transient": "the outcome changed with twice the settling time: the motion has not converged",
    OPPOSITE_CROSSING: "no level-crossing, but the angle passes the opposite of the level",
}
#: Largest number of motions that show that attractors cannot be told apart, and of expressions that are proposed.
MAX_LISTED = 3
#: Outcomes of an expression in words.
OUTCOME_TEXTS = {True: "true", False: "false", None: "empty"}


class ThresholdStudy(Study):
    """A search for thresholds, of a section ``find``.

    Raises
    ------
    ConfigError
        There is none; its key has no numbers, or a value that is not allowed; the expression has no column of a sweep;
        the drive's program does not end with both exciters on.
    """

    kind = "find"
    described = TABLES
    counted = "values"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.plan = scene, _required_plan(scene)

    def chains(self, store: Store) -> int:
        """Return how many values are evaluated side by side."""
        return self.plan.scan if self.plan.from_ == "initial" else 2

    def scenes(self) -> Iterator[Scene]:
        """Yield the scenes at both ends."""
        return (self.scene.replace({self.plan.key: end}) for end in (self.plan.start, self.plan.stop))

    def places(self) -> list[str]:
        """Return the values of the key at both ends."""
        return [f"{self.plan.key} = {given(end)}" for end in (self.plan.start, self.plan.stop)]

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Scan the key, narrow each change, and make the tables."""
        search = ThresholdSearch(self.scene, self.plan, store, workers, progress)
        scan, thresholds = search.thresholds()
        zones = search.evidence(scan, thresholds)
        every = sorted([*scan, *search.evaluated], key=lambda value: value.value)
        tables = {"scan": self._scan(every), "thresholds": self._thresholds(zones)}
        seeds = len({value.seed for value in every})
        lines = {
            "values": f"{len(scan)} of the scan, {len(search.evaluated)} more, with {counted(seeds, 'seed')}",
            "thresholds": str(len(thresholds)),
        }
        if search.indistinct is not None:
            headline, short = self._indistinct(search.indistinct, zones, every)
        else:
            headline, short = self._short(zones, every)
            short += [*self._promise(zones), *self._start_line(search, zones)]
        failed = [self._failure(value) for value in every if value.failed]
        answer = Answer(lines, (), list(self._notes(every, zones)), failed, headline, short)
        return Result("find", self.scene, tables, answer)

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose the two values at each threshold; those farthest from a mixed interval, where engines differ."""
        cases: dict[float, CrossCheckCase] = {}
        values = result.scan
        values = values[values["outcome"] == "ok"]
        for _, row in result.thresholds.iterrows():
            mixed = pd.notna(row["mixed_low"])
            if self.plan.from_ == "previous" or (row["kind"] in ("unresolved-transient", NOT_NARROWED) and not mixed):
                continue
            for side in ("below", "above"):
                at, seed = float(row[side]), self.scene.run.seed
                known = {name: row[f"{side}_{name}"] for name in COMPARED}
                if mixed:  # near it the other engine may find another outcome
                    at = float(row["tried_down_to" if side == "below" else "tried_up_to"])
                    rows = values.loc[values[column_of(self.plan.key)] == at]
                    if rows.empty:
                        continue
                    seed, known = int(rows["seed"].iloc[0]), {name: rows[name].iloc[0] for name in COMPARED}
                scene = other(self.scene.replace({self.plan.key: at}))
                task = Task(evaluate, (scene, self.plan, None, 1, start_key(self.scene, seed)), failed_record)
                cases[at] = CrossCheckCase(f"at {self.plan.key} = {at:.12g}", task, known)
        return list(cases.values())

    # -- tables --------------------------------------------------------------------------------------------------------

    def _thresholds(self, zones: Sequence[Zone]) -> pd.DataFrame:
        column = () if self.plan.compared is None else (self.plan.compared[0],)
        shown = list(dict.fromkeys((*SIDE_COLUMNS, *column)))
        side_columns = {f"{side}_{name}": _columns(self.scene)[name] for side in ("below", "above") for name in shown}
        own = [name for name in THRESHOLDS if not name.startswith(("below_", "above_"))]
        rows = [
            {
                "key": self.plan.key,
                "below": one.low.value,
                "above": one.high.value,
                "value": one.value,
                "kind": one.kind,
            }
            | {"special_point": one.special, **facts(zone)}
            | {f"below_{name}": one.low.row.get(name) for name in shown}
            | {f"above_{name}": one.high.row.get(name) for name in shown}
            for zone in zones
            for one in zone.thresholds
        ]
        return study_table(rows, [*own, *side_columns], {**THRESHOLDS, **side_columns})

    def _scan(self, values: Sequence[ScanPoint]) -> pd.DataFrame:
        key, columns = column_of(self.plan.key), _columns(self.scene)
        rows = [{key: value.value, "reason": value.reason, "seed": value.seed, **value.row} for value in values]
        names = [key, "reason", "seed", *POINT_COLUMNS, *SHEET, *more_columns(self.scene)]
        return study_table(rows, names, {**columns, **VALUES, SUPPLY: SWEEP[SUPPLY]})

    # -- in words ------------------------------------------------------------------------------------------------------

    def _side(self, value: ScanPoint) -> str:
        if self.plan.compared is None:
            return f"{value.text}{' slow' * value.hangs}"
        column = self.plan.compared[0]
        measure = value.row.get(column)
        return f"{column} = {value_text(column, measure, digits=5)}" if measure is not None else f"no {column}"

    def _failure(self, value: ScanPoint) -> str:
        where = place_words(column_of(self.plan.key), value.value)
        return f"{value.row['outcome']} at {where}: {value.row['detail'].partition(', state [')[0]}"

    def _short(self, zones: Sequence[Zone], every: Sequence[ScanPoint]) -> tuple[str, list[str]]:
        """Return the headline and the lines below it: thresholds and mixed intervals with the motion on both sides."""
        thresholds = [one for zone in zones for one in zone.thresholds]
        if not thresholds:
            return self._no_threshold(every)
        lines = [line for zone in zones for line in self._lines_of(zone)]
        mixed = [zone for zone in zones if zone.mixed]
        if len(zones) == len(mixed) == 1:  # the answer first, then the interval and its other side
            wants_above = is_wanted(zones[0], True, self.plan) or not is_wanted(zones[0], False, self.plan)
            headline, *others = self._mixed_lines(zones[0])[:: -1 if wants_above else 1]
            return f"{self.plan.key} {headline}", others
        if len(thresholds) == 1:
            clear = [self._clear(zones[0], upward) for upward in (False, True) if zones[0].side(upward).sure]
            return self._threshold(thresholds[0]), [*self._both_sides(thresholds[0]), *clear]
        sharp = sum(len(zone.thresholds) for zone in zones if not zone.mixed)
        counts = [(sharp, "threshold"), (len(mixed), "mixed interval")]
        ends = place_words(column_of(self.plan.key), self.plan.start, self.plan.stop)
        return f"{' and '.join(counted(n, noun) for n, noun in counts if n)} over {ends}", lines

    def _indistinct(
        self, found: Indistinct, zones: Sequence[Zone], every: Sequence[ScanPoint]
    ) -> tuple[str, list[str]]:
        """Return the headline and the lines below it where attractors cannot be told apart."""
        key = column_of(self.plan.key)
        lines = ["ask for the synchronization instead: find.compare: regime"]
        asked = ", ".join(measures_to_ask(found, every, self.plan)[:MAX_LISTED])
        if asked:
            lines.append(f"or for a measure, find.expression: {asked}")
        narrowed = []
        for zone in zones:
            known = [one for one in zone.thresholds if one.kind != NOT_NARROWED]
            special = [f"{self._threshold(one)}: {one.low.text} → {one.high.text}" for one in known if one.special]
            narrowed += special or (self._lines_of(zone) if known else [])
        lines += narrowed[:MAX_LISTED]
        for one, other in found.pairs[:MAX_LISTED]:
            lines.append(f"at {place_words(key, one.value)}: {one.text}; with another seed: {other.text}")
        changes = [(one.low, one.high) for zone in zones for one in zone.thresholds if one.kind == NOT_NARROWED]
        for low, high in sorted(changes, key=is_doubtful)[:MAX_LISTED]:
            alone = "" if is_doubtful((low, high)) else "; narrowed in a range of its own"
            lines.append(f"between {place_words(key, low.value, high.value)}: {low.text} → {high.text}{alone}")
        where = place_words(key, found.low, found.high)
        return f"attractors cannot be told apart over {where}, beside motion that does not repeat", lines

    def _promise(self, zones: Sequence[Zone]) -> Iterator[str]:
        """Yield what starts at the same value, each with a seed of its own, tell of others; and how many are slow."""
        sides = [zone.side(upward) for zone in zones for upward in (False, True)]
        sure, where = [side for side in sides if side.sure], "there" if len(zones) == 1 else "near each change"
        if sure:
            risk = f"less than {percent(max(side.max_other_fraction for side in sure))} of other starts {where} differ"
            tried = {(value.value, value.seed) for side in sure for value in side.all_starts}
            nearest = {side.all_starts[0].value for side in sure}
            beyond = [at for at, _ in tried if at not in nearest]
            confidence = f"{given(100.0 - 100.0 * ERROR_PROBABILITY)} % confidence"
            yield f"{risk} ({confidence}); none of {len(beyond)} beyond does"
        if self.plan.expression is None and any(side.slow for side in sides):
            counts = [f"{side.slow} of {side.tried}" for side in sides]
            yield _slow(f"{'; '.join(map(' → '.join, zip(counts[::2], counts[1::2], strict=True)))} starts")

    def _start_line(self, search: ThresholdSearch, zones: Sequence[Zone]) -> list[str]:
        """Return the line on the duration of starts on both sides of the first threshold with slow ones on a side."""
        for zone in zones:
            sides = [zone.side(upward) for upward in (False, True)]
            if (
                self.plan.from_ == "initial"
                and all(side.nearest for side in sides)
                and any(side.slow for side in sides)
            ):
                return ["; ".join(sorted(self._takes(search, side) for side in sides))]
        return []

    def _takes(self, search: ThresholdSearch, side: ClearRange) -> str:
        one = side.nearest
        assert one is not None
        runs = side.slow < side.tried or one.outcome(self.plan) is True
        times, at = search.start_times(one.value) if runs else [], self._round(one.value)
        if times:
            took = interval(times[0], times[-1], "s", digits=2)
            return f"a start at {at} takes {took} ({len(times)} measured)"
        if one.row.get("multiplier_max") is not None and not one.leaving:
            return f"at {at} it hangs for ever, on a stable orbit"
        return f"at {at} not within find.max_settle_s = {given(self.plan.max_settle_s)} s"

    def _lines_of(self, zone: Zone) -> list[str]:
        """Return a line for each threshold, or those of a mixed interval."""
        if zone.mixed:
            below, *others = self._mixed_lines(zone)
            return [f"{self.plan.key} {below}", *others]
        sides = [dict.fromkeys((self._side(one.low), self._side(one.high))) for one in zone.thresholds]
        return [f"{self._threshold(one)}: {' → '.join(side)}" for one, side in zip(zone.thresholds, sides, strict=True)]

    def _threshold(self, one: Threshold) -> str:
        """Return where a threshold is, how well it is known, and its kind."""
        half = self.plan.narrow if one.special else max(one.value - one.low.value, one.high.value - one.value)
        special = f", {one.special} of the orbit" if one.special else ""
        known = decimal(one.value, min(self._digits + 1, places(one.value, MOST_DECIMALS, half)))
        value = f"{known} ± {number(half, 1)} {unit_of(self.plan.key)}".rstrip()
        return f"{self.plan.key} = {value}: {self._kind(one)}{special}{self._holds(one)}"

    def _holds(self, one: Threshold) -> str:
        """Return on which side of a threshold the expression holds, if there is one."""
        sides = {"below": one.low, "above": one.high}
        where = [side for side, value in sides.items() if value.outcome(self.plan) is True]
        return f"; {self.plan.expression} {where[0]}" if len(where) == 1 else ""

    def _both_sides(self, one: Threshold) -> list[str]:
        """Return what motion there is below and above a threshold."""
        sides = {"below": one.low, "above": one.high}
        largest = max(value.row.get(name) or 0.0 for value in sides.values() for name in ("rms_x_m", "rms_y_m"))
        compared = self.plan.compared is not None
        below, above = (
            f"{self._side(value) + '; ' if compared else ''}{value.text}: {measures_text(value.row, largest)}"
            for value in sides.values()
        )
        return [f"on both sides  {below}"] if below == above else [f"below  {below}", f"above  {above}"]

    def _kind(self, one: Threshold) -> str:
        """Return the kind of a threshold in words; without an expression there is no level to cross."""
        if one.kind == LEVEL_CROSSING and self.plan.expression is None:
            return "the measures on both sides meet"
        return KIND_TEXTS.get(one.kind, one.kind)

    def _mixed_lines(self, zone: Zone) -> tuple[str, str, str]:
        """Return the lines of a mixed interval: below it, in it, above it."""
        good = [value for value in zone.mixed if value.is_classified(self.plan)]
        outcomes = Counter(self._outcome(value, speed=True) for value in good).most_common()
        counted = ", ".join(f"{outcome} {count}" for outcome, count in outcomes)
        mixed = f"mixed {self._interval(zone)}: {counted} of {len(good)} starts"
        return self._clear(zone, False), mixed, self._clear(zone, True)

    def _interval(self, zone: Zone) -> str:
        """Return a mixed interval, its ends rounded outward."""
        return f"from {' to '.join(self._ends(zone))} {unit_of(self.plan.key)}".rstrip()

    def _ends(self, zone: Zone) -> list[str]:
        """Return the ends of a zone, rounded outward to three digits of its width."""
        decimals = min(self._digits + 1, places(max(zone.edges[1] - zone.edges[0], self.plan.narrow), 3))
        step = 10.0**-decimals
        ends = math.floor(zone.edges[0] / step) * step, math.ceil(zone.edges[1] / step) * step
        return [decimal(end, decimals) for end in ends]

    def _round(self, end: float) -> str:
        return f"{number(end, MOST_DECIMALS, 0.5 * self.plan.narrow)} {unit_of(self.plan.key)}".rstrip()

    def _clear(self, zone: Zone, upward: bool) -> str:
        clear = zone.side(upward)
        if clear.nearest is None:
            way = "above" if upward else "below"
            end = f"{way} {self._ends(zone)[upward]} {unit_of(self.plan.key)}".rstrip()
            reached = "end of the range" if clear.limit in (self.plan.start, self.plan.stop) else "next change"
            return f"{end}: unknown, because the mixed interval reaches the {reached}"
        unknown = f"; {clear.unknown} further values have no clear outcome" if clear.unknown else ""
        outcome = self._outcome(clear.nearest)
        if self.plan.expression is not None:
            outcome = f"{'' if outcome == OUTCOME_TEXTS[True] else 'not '}{self.plan.expression}"
        tried = f"{clear.tried} starts tried {'up' if upward else 'down'} to {given(float(f'{clear.last:.4g}'))}"
        where = f"{'from' if upward else 'up to'} {self._round(clear.nearest.value)}"
        return f"{where}: {outcome} in all {f'{clear.starts} starts there' if clear.sure else tried}{unknown}"

    def _outcome(self, value: ScanPoint, *, speed: bool = False) -> str:
        """Return the outcome at a value in words, without an expression also whether an exciter is slow."""
        if self.plan.expression is not None:
            return OUTCOME_TEXTS[value.outcome(self.plan)]
        outcome = str(value.row["sync"]) if self.plan.compare == "regime" else value.text
        return f"{outcome}{' slow' * (speed and value.hangs)}"

    @property
    def _digits(self) -> int:
        return max(math.ceil(-math.log10(self.plan.narrow)), 0)

    def _no_threshold(self, every: Sequence[ScanPoint]) -> tuple[str, list[str]]:
        """Return the headline and the line below it: how many values say so, and how far apart they are."""
        plan, known = self.plan, [value for value in every if not value.failed and value.reason != "orbit"]
        good = [value for value in known if not value.is_either_side(plan)] or known
        key_range = f"from {plan.key} = {given(plan.start)} to {given(plan.stop)}"
        if not good:
            return f"nothing is known {key_range}", []
        apart = max([after.value - before.value for before, after in pairwise(good)], default=0.0)
        lines = [f"up to {number(apart, 2)} {unit_of(plan.key)}".rstrip() + " apart: between them nothing is known"]
        slow, expressed = sum(value.hangs for value in good), f"{plan.expression} is " if plan.expression else ""
        if slow and not expressed:
            lines.append(_slow(f"{slow} of {len(good)} starts"))
        text = f"{expressed}{self._outcome(good[0])} in all {counted(len(good), 'start')}"
        return f"no threshold: {text} {key_range}", lines

    def _notes(self, every: Sequence[ScanPoint], zones: Sequence[Zone]) -> Iterator[str]:
        for zone in zones:
            if zone.open_ended:
                yield (
                    f"outcomes may be mixed beyond the interval {self._interval(zone)}: its ends still moved in the "
                    "last round of starts"
                )
            for one in zone.thresholds:
                if one.kind == "unresolved-transient" and one.special:
                    yield (
                        f"{WARNING}near {self.plan.key} = {number(one.value, 6)} the orbit is so weakly unstable that "
                        "the motion had not left it when it was measured"
                    )
        if self.plan.compared is not None and is_angle(self.plan.compared[0]):
            column, how, limit = self.plan.compared
            yield bound_meaning(column, 1.0 if ">" in how else -1.0, limit)
        if {value.seed for value in every} == {self.scene.run.seed} and self.scene.start_perturbation:
            yield f"with seed {self.scene.run.seed} only: another run.seed disturbs each start otherwise"
        unsettled = [value.value for value in every if value.unsettled and not value.failed]
        if unsettled and self.plan.expression is not None:
            yield (
                f"{WARNING}at {len(unsettled)} of {len(every)} values, first at {self._round(unsettled[0])}, the "
                "motion was measured in a transient or has no clear class: a larger find.max_settle_s may change the "
                "outcome"
            )


def _slow(counts: str) -> str:
    """Say in how many starts an exciter is captured, overloaded or hangs."""
    return f"slow: an exciter stays far below its synchronous speed, in {counts}"


def _columns(scene: Scene) -> Columns:
    return {**VALUES, **more_columns(scene)}


def _required_plan(scene: Scene) -> FindPlan:
    """Return the plan of a scene; see :class:`ThresholdStudy` for what is refused."""
    plan: FindPlan = scene.plan_of("find")
    with errors_about("find"):
        for value in plan.over.upward:
            scene.replace({plan.key: value})
    if number_of(plan.key) is not float:
        raise ConfigError(f"find.key = {plan.key} does not vary continuously; allowed: a key that does")
    if plan.key == FREQUENCY and scene.drive.program is not None:
        raise ConfigError(
            f"find.key = {FREQUENCY}, but drive.program is given; allowed: a constant supply, or another key"
        )
    if scene.run.initial.from_ is not None:
        raise ConfigError(
            "run.initial.from is given, but find cannot start from a run; allowed: run.initial.state, or phases"
        )
    last = scene.drive.intervals[-1]
    if last.frequency <= 0.0 or last.driven != (True, True):
        how = "with one motor off" if last.frequency > 0.0 and any(last.driven) else "without supply"
        raise ConfigError(f"drive.program ends {how}; allowed: with both exciters on, for a steady motion")
    if plan.compared is not None:
        numbers = [name for name, column in _columns(scene).items() if column.kind != TEXT]
        numbers = [name for name in numbers if name not in ("seed", "wall_s")]
        if plan.compared[0] not in numbers:
            hint = did_you_mean(plan.compared[0], numbers, 3)
            raise ConfigError(f"find.expression: no column {plan.compared[0]}; {hint}allowed: numbers of a sweep")
    return plan


STUDY = ThresholdStudy


def find(scene: Scene, **options: Unpack[Options]) -> Result:
    """Find the thresholds of a key: the values at which the outcome of the motion changes.

    The section ``find`` of the scene has the key, its range and the outcome. The range is scanned; each change is
    narrowed by continuing a periodic orbit to its loss of stability, otherwise by bisection. Further values near each
    jump show whether outcomes are mixed there.

    Parameters
    ----------
    scene
        A scene with a section ``find``.
    options
        As in :func:`vibroplat.sweep`; ``progress`` is called with the numbers of finished and of known values.

    Returns
    -------
    Result
        Table ``thresholds`` has one row per threshold, ``scan`` one row per evaluated value, both in ascending order.
        If the outcome does not change, ``thresholds`` is empty.

    Raises
    ------
    ConfigError
        The scene has no section ``find``, or the section has a value that is not allowed.

    Examples
    --------
    >>> from vibroplat import Scene, find
    >>> plan = {"key": "drive.supply_frequency_hz", "start": 40.0, "stop": 50.0, "scan": 5}
    >>> plan |= {"expression": "excitation_frequency_hz > 22", "tolerance": 0.01}
    >>> find(Scene().replace({"find": plan})).answer.headline
    'drive.supply_frequency_hz = 44.009 ± 0.005 Hz: level-crossing; excitation_frequency_hz > 22 above'
    """
    return run_study(ThresholdStudy, scene, **options)
