"""The study ``find`` of a scene: its tables, and what is printed of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Unpack

import pandas as pd

from vibroplat.columns import COUNT, FLAG, TEXT, Column, Columns, unit_of
from vibroplat.config.digits import MOST_DECIMALS, decimal, given, number, places, quantity
from vibroplat.config.keys import number_of
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.scene import Scene
from vibroplat.config.schema import did_you_mean
from vibroplat.config.study_plans import FindPlan
from vibroplat.continuation.special_points import KINDS
from vibroplat.errors import ConfigError, errors_about
from vibroplat.observe.conveying import CONVEYING
from vibroplat.observe.data_sheet import SHEET, more_columns, point_columns
from vibroplat.results.answer import Answer, counted
from vibroplat.results.result import Result
from vibroplat.study.branches import SUPPLY, column_of, measures_text, place_words, study_table
from vibroplat.study.point import failed_record
from vibroplat.study.pool import Pool, Task
from vibroplat.study.store import Store
from vibroplat.study.study import COMPARED, CrossCheckCase, Options, Progress, Study, run_study
from vibroplat.study.sweep import COLUMNS, SWEEP
from vibroplat.thresholds.evidence import DISTANCES, PAIRS, ClearRange, Threshold, Zone, facts, is_wanted
from vibroplat.thresholds.search import ThresholdSearch, start_key
from vibroplat.thresholds.values import ScanPoint, evaluate

#: Printed texts of kinds whose names alone are unclear.
KIND_TEXTS = {"unresolved-transient": "the outcome changed with twice the settling time: the motion has not converged"}
#: Outcomes of an expression in words.
OUTCOME_TEXTS = {True: "true", False: "false", None: "empty"}
#: Columns of a sweep that are given for both sides of a threshold.
SIDE_COLUMNS = (
    *("sync", "motion", "period", "multiplier_max", "excitation_frequency_hz", "rms_x_m", "rms_y_m"),
    *("phase_difference_rad", "motor_power_w"),
)
#: Kinds of thresholds.
KINDS_OF_CHANGE = {
    "jump": "both sides keep their outcome with twice the settling time; their measures differ at any distance",
    "level-crossing": "the difference of the measures vanishes as the interval between both sides shrinks",
    "unresolved-transient": "one side changes with twice the settling time, or is still leaving an unstable orbit",
}
#: What the columns mean.
THRESHOLDS: Columns = {
    "key": Column("dotted name of the varied key", kind=TEXT),
    "below": Column("largest evaluated value of the key below the threshold"),
    "above": Column("smallest evaluated value of the key above the threshold"),
    "value": Column("the threshold", "special point if an orbit loses stability there; otherwise the middle"),
    "kind": Column(
        "kind of threshold", "; ".join(f"{kind}: {meaning}" for kind, meaning in KINDS_OF_CHANGE.items()), kind=TEXT
    ),
    "special_point": Column("special point of the orbit", f"{', '.join(KINDS)}; empty if there is none", kind=TEXT),
    "fractal": Column(
        "whether the boundary is fractal",
        "pairs of values in the mixed interval have different outcomes even at the smallest distance",
        kind=FLAG,
    ),
    "mixed_low": Column(
        "smallest value of the mixed interval",
        "outcomes alternate between mixed_low and mixed_high, or a value changes with twice the settling time; "
        "empty if no evaluated value contradicts the threshold",
    ),
    "mixed_high": Column("largest value of the mixed interval"),
    "tried_below": Column(
        "number of values evaluated below the threshold or mixed interval", "all have the same outcome", kind=COUNT
    ),
    "tried_down_to": Column("smallest of the tried_below values", "it ends at another threshold or the range"),
    "tried_above": Column("number of values evaluated above it", "see tried_below", kind=COUNT),
    "tried_up_to": Column("largest of the tried_above values"),
    **{f"{side}_{name}": SWEEP[name] for side in ("below", "above") for name in SIDE_COLUMNS},
}
_POINT = tuple(name for name in COLUMNS if name not in ("direction", "branch"))
VALUES: Columns = {
    "reason": Column(
        "reason for which the value was evaluated",
        "scan; seed: with another seed than the scan; orbit: on a branch; beside a special point; bisection; extended: "
        "with twice the settling time; near a threshold; beyond a mixed interval; pair: in a mixed interval",
        kind=TEXT,
    ),
    "seed": Column(
        "seed of the initial perturbation",
        "run.seed; other seeds challenge it: seed, near, and most of beyond",
        kind=COUNT,
    ),
    **{name: SWEEP[name] for name in (*_POINT, *SHEET)},
}


#: The tables of a search: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "thresholds": ("`vibroplat find`: one row per threshold.", THRESHOLDS),
    "scan": (
        "`vibroplat find`: one row per evaluated value.",
        {"…": Column("value of the key, under its dotted name"), **VALUES, **point_columns(), **CONVEYING},
    ),
}


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
        headline, short = self._short(zones, scan)
        short += self._starts(search, zones)
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
            if self.plan.from_ == "neighbour" or (row["kind"] == "unresolved-transient" and not mixed):
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
        names = [key, "reason", "seed", *_POINT, *SHEET, *more_columns(self.scene)]
        return study_table(rows, names, {**columns, **VALUES, SUPPLY: SWEEP[SUPPLY]})

    # -- in words ------------------------------------------------------------------------------------------------------

    def _side(self, value: ScanPoint) -> str:
        if self.plan.compared is None:
            return value.text
        column = self.plan.compared[0]
        measure = value.row.get(column)
        return f"{column} = {quantity(measure, unit_of(column), digits=5)}" if measure is not None else f"no {column}"

    def _failure(self, value: ScanPoint) -> str:
        where = place_words(column_of(self.plan.key), value.value)
        return f"{value.row['outcome']} at {where}: {value.row['detail'].partition(', state [')[0]}"

    def _short(self, zones: Sequence[Zone], scan: Sequence[ScanPoint]) -> tuple[str, list[str]]:
        """Return the headline and the lines below it: thresholds and mixed intervals with the motion on both sides."""
        thresholds = [one for zone in zones for one in zone.thresholds]
        if not thresholds:
            return self._no_threshold(scan), []
        lines = [line for zone in zones for line in self._lines_of(zone)]
        mixed = [zone for zone in zones if zone.mixed]
        if len(zones) == len(mixed) == 1:
            return lines[0], lines[1:]
        if len(thresholds) == 1:
            return self._threshold(thresholds[0]), self._both_sides(thresholds[0])
        sharp = sum(len(zone.thresholds) for zone in zones if not zone.mixed)
        counts = [(sharp, "threshold"), (len(mixed), "mixed interval")]
        ends = place_words(column_of(self.plan.key), self.plan.start, self.plan.stop)
        return f"{' and '.join(counted(n, noun) for n, noun in counts if n)} over {ends}", lines

    def _starts(self, search: ThresholdSearch, zones: Sequence[Zone]) -> list[str]:
        """Return the line on the duration of starts at the first threshold where a motor hangs on one side."""
        for below, above in ((zone.below.nearest, zone.above.nearest) for zone in zones):
            if self.plan.from_ != "initial" or below is None or above is None or below.hangs == above.hangs:
                continue
            hangs, passes = (below, above) if below.hangs else (above, below)
            times, unit = search.start_times(passes, hangs), unit_of(self.plan.key)
            places = [self._round(passes.value), *(f"{number(at)} {unit}" for at in [*times][1:])]
            took = [f"{quantity(t, 's', digits=2)} at {at}" for t, at in zip(times.values(), places, strict=False)]
            allowed = f"find.max_settle_s = {given(self.plan.max_settle_s)} s"
            where = f"at {self._round(hangs.value)}"
            limit = f"{where} not within {allowed}, more may move it"
            if hangs.row.get("multiplier_max") is not None and not hangs.leaving:
                limit = f"{where} it hangs for ever, on a stable orbit"
            return [f"starts in {', '.join(took) or 'an unknown time'}; {limit}"]
        return []

    def _lines_of(self, zone: Zone) -> list[str]:
        """Return a line for each threshold, or those of a mixed interval."""
        if zone.mixed:
            return list(self._mixed_lines(zone))
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
        if one.kind == "level-crossing" and self.plan.expression is None:
            return "the measures on both sides meet"
        return KIND_TEXTS.get(one.kind, one.kind)

    def _mixed_lines(self, zone: Zone) -> Iterator[str]:
        """Yield the lines of a mixed interval, first the side where the expression holds, otherwise the upper side."""
        low, high = self._ends(zone)
        sides = [(f"above {high}", zone.above, "up to"), (f"below {low}", zone.below, "down to")]
        if is_wanted(zone, False, self.plan) and not is_wanted(zone, True, self.plan):
            sides.reverse()
        first, second = (self._clear(*side) for side in sides)
        yield f"{self.plan.key} {first}"
        good = [value for value in zone.mixed if value.is_classified(self.plan)]
        outcomes = Counter(self._outcome(value) for value in good).most_common()
        counted = ", ".join(f"{outcome} at {count}" for outcome, count in outcomes)
        yield f"mixed from {low} to {high}: {counted} of {len(good)} values tried"
        yield second

    def _ends(self, zone: Zone) -> tuple[str, str]:
        """Return the ends of a mixed interval with their unit, rounded outward to three digits of its width."""
        assert zone.ends is not None
        decimals = min(self._digits + 1, places(max(zone.ends[1] - zone.ends[0], self.plan.narrow), 3))
        step, unit = 10.0**-decimals, unit_of(self.plan.key)
        low, high = math.floor(zone.ends[0] / step) * step, math.ceil(zone.ends[1] / step) * step
        return f"{decimal(low, decimals)} {unit}".rstrip(), f"{decimal(high, decimals)} {unit}".rstrip()

    def _round(self, end: float) -> str:
        return f"{number(end, MOST_DECIMALS, 0.5 * self.plan.narrow)} {unit_of(self.plan.key)}".rstrip()

    def _clear(self, where: str, clear: ClearRange, way: str) -> str:
        if clear.nearest is None:
            return f"{where}: unknown, because the mixed interval reaches the end of the range"
        unknown = f"; {clear.unknown} further values have no clear outcome" if clear.unknown else ""
        outcome = self._outcome(clear.nearest)
        if self.plan.expression is not None:
            outcome = f"{'' if outcome == OUTCOME_TEXTS[True] else 'not '}{self.plan.expression}"
        return (
            f"{where}: {outcome} at all {clear.tried} values tried {way} {given(float(f'{clear.last:.4g}'))}"
            f"{f' with {clear.seeds} seeds' if clear.seeds > 1 else ''}{unknown}"
        )

    def _outcome(self, value: ScanPoint) -> str:
        """Return the outcome at a value in words."""
        if self.plan.expression is None:
            return value.row["sync"] if self.plan.compare == "regime" else value.text
        return OUTCOME_TEXTS[value.outcome(self.plan)]

    @property
    def _expressed(self) -> str:
        """Text before an outcome: the expression."""
        return "" if self.plan.expression is None else f"{self.plan.expression} is "

    @property
    def _digits(self) -> int:
        return max(math.ceil(-math.log10(self.plan.narrow)), 0)

    def _no_threshold(self, scan: Sequence[ScanPoint]) -> str:
        plan, good = self.plan, [value for value in scan if not value.failed]
        key_range = f"from {plan.key} = {given(plan.start)} to {given(plan.stop)}"
        if not good:
            return f"nothing is known {key_range}"
        where = f"at all {len({value.value for value in good})} values tried {key_range}"
        return f"no threshold: {self._expressed}{self._outcome(good[0])} {where}"

    def _notes(self, every: Sequence[ScanPoint], zones: Sequence[Zone]) -> Iterator[str]:
        for zone in zones:
            if zone.mixed:
                interval = "the mixed interval from {} to {}".format(*self._ends(zone))
                if zone.fractal:
                    counts = " / ".join(f"{part * PAIRS:.0f}" for part in zone.shares)
                    yield (
                        f"the boundary is fractal: of {PAIRS} pairs of values in {interval}, {counts} have different "
                        f"outcomes at distances of {' / '.join(map(given, DISTANCES))} of its width"
                    )
                if zone.open_ended:
                    yield (
                        f"{interval} still grew in the last round of values: outcomes may be mixed beyond this interval"
                    )
            for one in zone.thresholds:
                if one.kind == "unresolved-transient" and one.special:
                    yield (
                        f"near {self.plan.key} = {number(one.value, 6)} the orbit is so weakly unstable that the "
                        "motion had not left it when it was measured"
                    )
        if {value.seed for value in every} == {self.scene.run.seed} and self.scene.start_perturbation:
            yield f"with seed {self.scene.run.seed} only: another run.seed disturbs each start otherwise"
        unsettled = [value.value for value in every if value.unsettled and not value.failed]
        if unsettled and self.plan.expression is not None:
            yield (
                f"at {len(unsettled)} of {len(every)} values, first at {self._round(unsettled[0])}, the motion was "
                "measured in a transient or has no clear class: a larger find.max_settle_s may change the outcome"
            )


def _columns(scene: Scene) -> Columns:
    return {**VALUES, **more_columns(scene)}


def _required_plan(scene: Scene) -> FindPlan:
    """Return the plan of a scene; see :class:`ThresholdStudy` for what is refused."""
    plan = scene.find
    if plan is None:
        raise ConfigError("this configuration has no find section; add find: {key: …, start: …, stop: …}")
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
