"""The study ``fit``: the values of keys with which runs differ least from measured data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Unpack

from vibroplat.columns import FLAG, TEXT, Column, Columns
from vibroplat.config.fit_plan import FitPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.fitting.answer import answer_of
from vibroplat.fitting.misfit import Misfit
from vibroplat.fitting.search import SMALL, error_with, refine, require_numbers, search, starting_places
from vibroplat.model.sensitivity import value_of
from vibroplat.results.result import Result
from vibroplat.study.branches import study_table
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store, digest
from vibroplat.study.study import CrossCheckCase, Options, Progress, Study, configuration_text, run_study

KEYS: Columns = {
    "key": Column("dotted key", kind=TEXT),
    "value": Column("value found", "unit of the key"),
    "error": Column("its standard error", "what remains is taken as an autoregressive process; unit of the key"),
    "before": Column("value of the scene", "unit of the key"),
    "low": Column("lower end of its range", "unit of the key"),
    "high": Column("upper end of its range", "unit of the key"),
    "determined": Column("whether the data determine it: its error is below a quarter of its range", kind=FLAG),
    "most_correlated": Column("key with whose error its own is most correlated", kind=TEXT),
    "correlation": Column("their correlation", "-1 … 1"),
}
CURVES: Columns = {
    "file": Column("file of measured data", kind=TEXT),
    "column": Column("column of a run", kind=TEXT),
    "t_s": Column("time in the run"),
    "measured": Column("measured value, with factor and offset", "unit of the column"),
    "computed": Column("computed value", "unit of the column"),
}
SEARCHES: Columns = {
    "search": Column("number of the search"),
    "error": Column("RMS of what it leaves over that of measured values", "all curves"),
    "simulations": Column("runs that it took"),
    "failed": Column("why it ended", "empty if it did not", kind=TEXT),
}
TABLES: dict[str, tuple[str, Columns]] = {
    "keys": ("`vibroplat fit`: one row per key.", KEYS),
    "curves": ("`vibroplat fit`: measured and computed values, up to 5000 of each curve.", CURVES),
    "searches": ("`vibroplat fit`: one row per search.", SEARCHES),
}
#: Error of a key over its range from which on data do not determine it.
UNDETERMINED = 0.25


class FitStudy(Study):
    """Keys and measured data of a section ``fit``.

    Raises
    ------
    ConfigError
        The scene has no such section, its data cannot be read, or its keys cannot be varied.
    """

    kind = "fit"
    described = TABLES
    counted = "searches"

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.plan: FitPlan = scene.plan_of("fit")
        require_numbers(scene, self.plan)
        Misfit(scene, self.plan)  # whose files can be read

    @property
    def conditions(self) -> dict[str, Any]:
        """What stored searches depend on: also on the contents of the files."""
        contents = [digest(Path(entry.file).read_bytes().hex()) for entry in self.plan.data]
        return super().conditions | {"data": contents}

    def chains(self, store: Store) -> int:
        """Return how many searches run side by side."""
        return self.plan.starts

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Search from the values of the scene, and from others if that leaves a difference; then weight and judge."""
        places = starting_places(self.scene, self.plan)

        def from_place(number: int) -> Tasks[Record]:
            return (yield Task(search, (self.scene, self.plan, places[number])))

        def run(numbers: range) -> list[Record]:
            chains = [StoredChain(from_place(n), store, f"search {n}") for n in numbers]
            return run_stored(chains, workers, lambda done: progress(numbers.start + done, numbers.stop))

        searches = run(range(1))
        if searches[0]["failed"] or searches[0]["cost"] > SMALL**2:
            searches += run(range(1, self.plan.starts))
        best = min((one for one in searches if not one["failed"]), key=lambda one: one["cost"], default=None)
        if best is None:
            store.finish()
            raise ConfigError(
                f"fit: no search came to an end; the first: {searches[0]['failed']}; allowed: other ranges"
            )

        def judged() -> Tasks[Record]:
            return (yield Task(refine, (self.scene, self.plan, best["u"], places[0], best["alike"])))

        (found,) = run_stored([StoredChain(judged(), store, "judged")], workers)
        return self._result(searches, found)

    def _result(self, searches: list[Record], found: Record) -> Result:
        keys = self._key_rows(found)
        files = [entry.file for entry in self.plan.data]
        rows = [
            {"file": files[part["file"]], "column": part["column"], "t_s": t, "measured": m, "computed": c}
            for part in found["parts"]
            for t, m, c in zip(part["t_s"], part["measured"], part["computed"], strict=True)
        ]
        of_searches = [
            {"search": n, "error": None if one["failed"] else one["cost"] ** 0.5, **_without(one, "cost", "u", "alike")}
            for n, one in enumerate(searches, 1)
        ]
        tables = {
            "keys": study_table(keys, list(KEYS), KEYS),
            "curves": study_table(rows, list(CURVES), CURVES),
            "searches": study_table(of_searches, list(SEARCHES), SEARCHES),
        }
        values = dict(zip(self.plan.keys, found["values"], strict=True))
        best = configuration_text(self.scene.replace(values), "fit")
        answer = answer_of(self.plan, keys, searches, found)
        document = {"fit": _without(found, "parts", "correlations") | {"parts": [_scalars(p) for p in found["parts"]]}}
        return Result("fit", self.scene, tables, answer, configurations={"best": best}, documents=document)

    def _key_rows(self, found: Record) -> list[dict[str, Any]]:
        """Return the rows of the table of keys."""
        rows, names = [], [*self.plan.keys]
        for n, (key, (low, high)) in enumerate(self.plan.keys.items()):
            others = {name: found["correlations"][n][k] for k, name in enumerate(names) if k != n}
            other = max(others, key=lambda name: abs(others[name]), default="")
            error = found["errors"][n]
            rows.append(
                {
                    "key": key,
                    "value": found["values"][n],
                    "error": error,
                    "before": value_of(self.scene, key),
                    "low": low,
                    "high": high,
                    "determined": error < UNDETERMINED * (high - low),
                    "most_correlated": other,
                    "correlation": others.get(other),
                }
            )
        return rows

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose the values found: the data differ as much from runs of the other engine."""
        values = dict(zip(result.keys["key"], result.keys["value"].tolist(), strict=True))
        own = error_with(self.scene, self.plan, values)["row"]
        task = Task(error_with, (other(self.scene), self.plan, values))
        return [CrossCheckCase("at the values found", task, own, 1e-2)]


STUDY = FitStudy


def _without(record: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in record.items() if name not in names}


def _scalars(record: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in record.items() if not isinstance(value, list)}


def fit(scene: Scene, **options: Unpack[Options]) -> Result:
    """Find the values of keys with which runs differ least from measured data, as set in the section ``fit``.

    Squares of differences are summed over all curves of all files, each over what remains of it in the end. Errors are
    standard errors: what remains of a sampled signal is correlated, and taken as an autoregressive process.

    Parameters
    ----------
    scene
        Scene with a section ``fit``.
    options
        As in :func:`vibroplat.sweep`; ``progress`` is called with the numbers of finished and of known searches.

    Returns
    -------
    Result
        Table ``keys`` has the values, errors and correlations, ``curves`` measured and computed values, ``searches``
        what each search left. ``configurations["best"]`` is the machine as YAML.

    Raises
    ------
    ConfigError
        The section is missing, its data cannot be read, or runs lack its keys or columns.
    """
    return run_study(FitStudy, scene, **options)
