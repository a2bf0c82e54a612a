"""The study ``design``: sensitivities, effects of tolerances and best values, and their tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Unpack

import pandas as pd

from vibroplat.columns import Column, Columns, is_angle, name_regime, unit_of
from vibroplat.config.circular import bound_meaning
from vibroplat.config.digits import DIGITS, decimal, number, percent, places
from vibroplat.config.plausibility import HINT, WARNING
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import DesignPlan
from vibroplat.designs import optimum
from vibroplat.designs import samples as of_samples
from vibroplat.designs import sensitivities as of_keys
from vibroplat.designs.answer import (
    count_satisfied,
    elasticity_lines,
    measure_text,
    quantile_lines,
    short_answer,
    with_confidence,
)
from vibroplat.designs.motions import NO_ORBITS
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import value_of
from vibroplat.report.data_sheet import more_columns
from vibroplat.results.answer import Answer
from vibroplat.results.result import Result
from vibroplat.study.branches import study_table
from vibroplat.study.fingerprint import lapack
from vibroplat.study.pool import Pool, Task, run_tasks
from vibroplat.study.store import Record, Store
from vibroplat.study.study import CrossCheckCase, Options, Progress, Study, configuration_text, run_study
from vibroplat.study.sweep import SWEEP

_VARIED: Columns = {"…": Column("values of the keys that vary, under their dotted names", "see configuration.md")}
_MEASURED: Columns = {"measures": Column("the measures of the plan", "named as in the table sweep")}
#: The tables of a design: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "sensitivities": ("`vibroplat design`: one row per measure and key.", of_keys.SENSITIVITIES),
    "samples": (
        "`vibroplat design` with `parameter_tolerances`: one row per sample.",
        {**_VARIED, **of_samples.SAMPLES, **_MEASURED},
    ),
    "variance_contributions": (
        "`vibroplat design` with `parameter_tolerances`: contribution of each key to the variance of each measure.",
        of_samples.VARIANCE_CONTRIBUTIONS,
    ),
    "evaluations": (
        "`vibroplat design` with `minimize`: one row per evaluated point.",
        {**_VARIED, **_MEASURED, **optimum.EVALUATIONS},
    ),
    "pareto": ("`vibroplat design` with `pareto`: one row per bound.", {**_VARIED, **_MEASURED, **optimum.PARETO}),
}

#: What is said of a measure that is an angle.
OF_ANGLES = (
    "is an angle: its quantiles and contributions are those of its deviations from the circular mean, and it has no "
    "elasticity, because its zero is arbitrary"
)


class DesignStudy(Study):
    """Sensitivities, tolerances and best values of a section ``design``.

    Raises
    ------
    ConfigError
        The scene has no such section, or it names keys, measures or values that the scene does not have.
    """

    kind = "design"
    described = TABLES
    counted = "steps"

    def __init__(self, scene: Scene) -> None:
        plan = scene.plan_of("design")
        tolerances, self.notes = of_keys.tolerances_of_keys(scene, plan.parameter_tolerances)
        self.notes += [] if scene.transport is None else [f"{HINT}{NO_ORBITS}"]
        self.plan: DesignPlan = plan.model_copy(update={"parameter_tolerances": tolerances})
        self.scene = scene = scene.model_copy(update={"design": self.plan})
        of_keys.require_keys(scene, list(self.plan.keys), "design.keys")
        of_keys.require_keys(scene, list(self.plan.parameter_tolerances), "design.parameter_tolerances")
        of_keys.require_measures(scene, self.plan.named, "design")
        self.notes += [bound_meaning(name, *self.plan.bound(name)) for name in filter(is_angle, plan.constraints)]
        self.notes += [f"{HINT}{name} {OF_ANGLES}" for name in filter(is_angle, self.plan.named)]
        for key, width in self.plan.parameter_tolerances.items():
            for end in (-width, width):
                of_keys.require_allowed(
                    scene, f"design.parameter_tolerances.{key} = {width}", key, value_of(scene, key) * (1.0 + end)
                )
        for key, ends in self.plan.keys.items():
            width = self.plan.parameter_tolerances.get(key, 0.0)
            more = f" with design.parameter_tolerances.{key} = {width}" if width else ""
            for value in (ends[0] * (1.0 - width), ends[1] * (1.0 + width)):
                of_keys.require_allowed(scene, f"design.keys.{key} = {ends}{more}", key, value)
        self.keys = list(self.plan.keys) or of_keys.varied_keys(scene)
        allowed = of_keys.measured_names(scene)
        self.names = [n for n in dict.fromkeys((*of_keys.PRINTED, *self.plan.named)) if n in allowed]
        self.aims = [n for n in (self.plan.minimize, *self.plan.constraints) if n is not None]

    @property
    def conditions(self) -> dict[str, Any]:
        """What stored steps depend on: also on scipy's LAPACK, if designs are optimized."""
        return super().conditions | ({"LAPACK": lapack()} if self.plan.minimize is not None else {})

    def chains(self, store: Store) -> int:
        """Return how many parts of samples, or searches, run side by side."""
        return max(self.plan.samples // of_samples.SAMPLES_PER_TASK, self.plan.starts)

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Find the orbit, differentiate it, search for the optimum, and measure samples around it."""
        run = _Runner(store, workers, progress)
        known = run.one("settled", of_keys.settle_on_orbit, self.scene)
        sensitivities = run.one("sensitivities", of_keys.orbit_sensitivities, self.scene, self.keys, self.names, known)
        if self.plan.minimize is not None and not known["period"]:
            raise ConfigError(f"design.minimize: {name_regime(known)} motion has no smooth measures; allowed: samples")
        for name in self.aims:
            if sensitivities["measures"][name] is None:
                raise ConfigError(
                    f"design: {name} has no value for the motion of this scene; allowed: a measure that has one"
                )
        tables = {"sensitivities": of_keys.table(sensitivities["rows"])}
        lines = {"motion": f"{name_regime(known)}, {_stability(sensitivities['measures'].get('stability_margin'))}"}
        text = [*elasticity_lines(tables["sensitivities"])]
        if self.plan.minimize is None:
            return self._with_samples(run, self.scene, known, self._result(tables, Answer(lines, text, self.notes)))
        best, best_lines = self._best(run, known, tables)
        lines |= best_lines
        if best is None:
            return self._result(tables, Answer(lines, text, self.notes))
        scene = self.scene.replace(best["values"])
        row = run.one("confirmed", optimum.measure_design, self.scene, known, best["values"])
        texts = [measure_text(name, row["row"][name]) for name in self.aims if row["row"].get(name) is not None]
        lines |= {"from rest": ", ".join([row["regime"], *texts])}
        other = f"{WARNING}started from rest, the best design converges to {row['regime']}, not to the optimized orbit"
        notes = self.notes + ([] if row["same"] else [other])
        if not row["same"] and self.plan.parameter_tolerances and self.plan.samples:
            notes[-1] += ", so its tolerances were not sampled"
        result = self._result(tables, Answer(lines, text, notes), {"best": configuration_text(scene, "design")})
        if not (row["same"] and self.plan.parameter_tolerances):
            return result
        return self._with_samples(run, scene, run.one("settled there", of_keys.settle_on_orbit, scene), result)

    def _result(
        self, tables: Mapping[str, pd.DataFrame], answer: Answer, configurations: Mapping[str, str] | None = None
    ) -> Result:
        headline, short = short_answer(self.plan, tables, answer.lines["motion"])
        answer = answer._replace(headline=headline, short=short)
        return Result("design", self.scene, tables, answer, configurations=configurations)

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose the orbit of the scene as given and the orbit of the best evaluated design."""
        significant = result.sensitivities.dropna(subset=["elasticity"])  # others are round-off
        nominal: Record = dict(zip(significant["measure"], significant["value"].tolist(), strict=True))
        cases = [("at the values of the scene", Record(), nominal)]
        evaluations = result.tables.get("evaluations")
        for _, best in () if evaluations is None else evaluations[evaluations["best"]].iterrows():
            cases.append(("at the best design", {k: best[k] for k in self.plan.keys}, {n: best[n] for n in nominal}))
        return [CrossCheckCase(name, Task(of_keys.measure_at, (other(self.scene), at)), row) for name, at, row in cases]

    def _best(
        self, run: _Runner, known: Record, tables: dict[str, pd.DataFrame]
    ) -> tuple[Record | None, dict[str, str]]:
        """Search for the optimum and the Pareto front; add their tables, and return the optimum and printed lines."""
        bounds = {name: self.plan.bound(name) for name in self.plan.constraints}
        search, asked = optimum.run_search, (self.scene, self.names, known)
        parts = run.all({f"start {n}": Task(search, (*asked, bounds, n, None)) for n in range(self.plan.starts)})
        rows = [row | {"best": False, "period": known["period"]} for part in parts for row in part["rows"]]
        bests = [part["best"] for part in parts if part["best"] is not None]
        best = min(bests, key=lambda best: best["objective"], default=None)
        if best is not None:
            next(row for row in rows if best["values"].items() <= row.items())["best"] = True
        last = ("objective", "violation", "feasible", "best", "period")
        tables["evaluations"] = self._table(rows, optimum.EVALUATIONS, ("start",), last)
        for name, values in self.plan.pareto.items():
            front, begin = list[Record](), None if best is None else best["values"]
            for value in values:
                ends = bounds | {name: (bounds[name][0], value)}
                part = run.one(f"{name} {value!r}", search, *asked, ends, 0, begin)["best"]
                begin = begin if part is None else part["values"]
                row = {} if part is None else part["values"] | part["measures"] | {"objective": part["objective"]}
                front.append({"bound": value, "feasible": part is not None, "period": known["period"], **row})
            tables["pareto"] = self._table(front, optimum.PARETO, ("bound",), ("objective", "feasible", "period"))
        if best is None:
            nearest = min(rows, key=lambda row: row["violation"], default=None)
            return None, {} if nearest is None else {"closest": self._values(nearest)}
        return best, {"best": self._values(best["values"])}

    def _values(self, values: Mapping[str, float]) -> str:
        return ", ".join(f"{key} {number(values[key], 6)} {unit_of(key)}".rstrip() for key in self.plan.keys)

    def _table(self, rows: Sequence[Record], meant: Columns, first: Sequence[str], last: Sequence[str]) -> pd.DataFrame:
        """Make a table of the plan's keys and measures, with the columns ``first`` before and ``last`` after them."""
        columns = [*first, *self.plan.keys, *self.names, *last]
        return study_table(rows, columns, {**SWEEP, **more_columns(self.scene), **of_samples.SAMPLES, **meant})

    def _with_samples(self, run: _Runner, scene: Scene, known: Record, result: Result) -> Result:
        """Add the samples of a scene's tolerances, if there are any."""
        if not (self.plan.parameter_tolerances and self.plan.samples):
            return result
        plan, home = self.plan, name_regime(known)
        keys, elasticities = list(plan.parameter_tolerances), result.sensitivities.dropna(subset=["elasticity"])
        places = of_samples.sobol_points(plan.seed, len(keys), 0, plan.samples)
        table = self._samples(run, scene, known, places)
        measures = [name for name in self.names if is_angle(name) or name in {*elasticities["measure"]}]
        contributions = of_samples.variance_contributions(table, keys, measures)
        lines = dict(result.answer.lines) | _lines_of_samples(table, home)
        counts = {of: with_confidence(count, len(table)) for of, count in count_satisfied(plan, table).items()}
        answer = result.answer._replace(
            lines=counts | lines if plan.minimize is None else lines | counts,
            text=[*result.answer.text, *quantile_lines(plan, table, contributions)],
        )
        tables = {**result.tables, "samples": table, "variance_contributions": contributions}
        return self._result(tables, answer, result.configurations)

    def _samples(self, run: _Runner, scene: Scene, known: Record, places: FloatArray) -> pd.DataFrame:
        """Measure samples at places, in parts that are the same for any number of workers."""
        parts = {
            f"samples {first}": Task(of_samples.measure_samples, (scene, self.names, known, first, part.tolist()))
            for first in range(0, len(places), of_samples.SAMPLES_PER_TASK)
            for part in [places[first : first + of_samples.SAMPLES_PER_TASK]]
        }
        rows = [row for part in run.all(parts) for row in part["rows"]]
        names = sorted(self.names, key="stability_margin".__ne__)  # first, where there is one
        columns = ["sample", *self.plan.parameter_tolerances, "stable", "regime", *names]
        return study_table(rows, columns, {**SWEEP, **more_columns(scene), **of_samples.SAMPLES})


class _Runner:
    """Runs stored tasks side by side, and counts them."""

    def __init__(self, store: Store, workers: Pool, progress: Progress) -> None:
        self._store, self._workers, self._progress = store, workers, progress
        self._done = self._known = 0

    def one(self, name: str, function: Callable[..., Any], *arguments: Any) -> Record:
        """Run a task."""
        return self.all({name: Task(function, arguments)})[0]

    def all(self, tasks: Mapping[str, Task]) -> list[Record]:
        """Run tasks by the names under which they are stored."""
        before, self._known = self._done, self._known + len(tasks)

        def tell(done: int) -> None:
            self._done = before + done
            self._progress(self._done, self._known)

        return run_tasks(tasks, self._store, self._workers, tell)


def _stability(margin: float | None) -> str:
    """Say how far multipliers are inside the unit circle, or that the motion is no orbit."""
    known = "" if margin is None else decimal(1.0 - margin, max(DIGITS, places(margin, 1)))
    return f"multipliers up to {known}" if known else "by settled motions"


def _lines_of_samples(table: pd.DataFrame, home: str) -> dict[str, str]:
    """Return the percentages of samples with a stable orbit and with the regime of the scene as given."""
    fraction = float((table["regime"] == home).mean())
    stable = {"orbit stable": percent(table["stable"].mean())} if "stability_margin" in table else {}
    lines = {"samples": f"{len(table)}"} | stable | {"regime kept": percent(fraction)}
    others = table.loc[table["regime"] != home, "regime"].value_counts()
    if len(others):
        lines["others"] = "; ".join(f"{name}: {count}" for name, count in others.items())
    return lines


STUDY = DesignStudy


def design(scene: Scene, **options: Unpack[Options]) -> Result:
    """Find sensitivities, effects of tolerances and best values of keys, as set in the section ``design`` of a scene.

    The periodic orbit to which the scene settles is differentiated by all keys. With tolerances, samples within them
    are measured. With a measure to minimize, a gradient method searches for the values that satisfy the constraints.

    Parameters
    ----------
    scene
        Scene with a section ``design``.
    options
        As in :func:`vibroplat.sweep`; ``progress`` is called with the numbers of finished and of known steps.

    Returns
    -------
    Result
        Table ``sensitivities``. With tolerances, tables ``samples`` and ``variance_contributions``. With a measure to
        minimize, tables ``evaluations`` and ``pareto``, and the configuration of the best design as YAML in
        ``configurations["best"]``.

    Raises
    ------
    ConfigError
        The section is missing, or names a key or measure that the scene does not have.
    OrbitError
        The motion converges to no periodic orbit.
    """
    return run_study(DesignStudy, scene, **options)
