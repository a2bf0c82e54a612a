"""What ``vibroplat design`` asks, of sensitivities, tolerances and best values, and the tables that answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import pandas as pd

from vibroplat.columns import Column
from vibroplat.config.keys import key_of
from vibroplat.config.scene import Scene
from vibroplat.designs import samples as of_samples
from vibroplat.designs import sensitivities as of_keys
from vibroplat.errors import ConfigError
from vibroplat.frames import labelled
from vibroplat.model.sensitivity import value_of
from vibroplat.results.files import Command
from vibroplat.study import WAIT
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.question import Answer, Progress, ask
from vibroplat.study.store import Record, Store
from vibroplat.study.sweep import SWEEP

#: Most keys that are printed of each measure.
SHOWN = 4


class Design:
    """The question of section ``design``; see :class:`vibroplat.study.question.Question`.

    Raises
    ------
    ConfigError
        The scene has no such section, or it names keys, measures or values that the scene does not have.
    """

    command: Command = "design"
    counted = "steps"
    absent = frozenset({"samples", "evaluations", "pareto"})

    def __init__(self, scene: Scene) -> None:
        if scene.design is None:
            raise ConfigError("section design is missing; allowed: one, as design: {}")
        self.scene, self.plan = scene, scene.design
        of_keys.require_keys(scene, list(self.plan.keys), "design.keys")
        of_keys.require_keys(scene, list(self.plan.spread), "design.spread")
        of_keys.require_measures(scene, self.plan.named, "design")
        for key, share in self.plan.spread.items():
            for end in (-share, share):
                require_allowed(scene, f"design.spread.{key} = {share}", key, value_of(scene, key) * (1.0 + end))
        for key, ends in self.plan.keys.items():
            for value in ends:
                require_allowed(scene, f"design.keys.{key} = {ends}", key, value)
        self.keys = list(self.plan.keys) or of_keys.varied_keys(scene)
        allowed = of_keys.measured_names(scene)
        self.names = [n for n in dict.fromkeys((*of_keys.USUAL, *self.plan.named)) if n in allowed]
        self.chains = max(self.plan.samples // of_samples.CHUNK, self.plan.starts)

    def scenes(self) -> Iterable[Scene]:
        """Yield the scenes on whose input there may be notes."""
        return [self.scene]

    def answer(self, store: Store, workers: Pool, progress: Progress) -> Answer:
        """Find the orbit, differentiate it, measure samples around it."""
        run = _Runner(store, workers, progress)
        known = run.one("settled", of_keys.settled, self.scene)
        found = run.one("sensitivities", of_keys.differentiated, self.scene, self.keys, self.names, known)
        tables = {"sensitivities": of_keys.table(found["rows"])}
        home = of_samples.regime(known["sync"], "periodic", known["period"])
        margin = found["measures"]["margin"]
        lines = {"motion": f"{home}, multipliers up to {1.0 - margin:.6g}"}
        text = list(_told_of_keys(found, self.names))
        if self.plan.spread and self.plan.samples:
            tables["samples"] = self._samples(run, known)
            lines |= _lines_of_samples(tables["samples"], home)
            told = tables["sensitivities"].dropna(subset=["elasticity"])["measure"].unique().tolist()
            text += _told_of_samples(tables["samples"], list(self.plan.spread), told)
        return Answer(tables, lines, text)

    def _samples(self, run: _Runner, known: Record) -> pd.DataFrame:
        """Measure all samples, in parts that do not depend on who measures them."""
        ends = [*range(0, self.plan.samples, of_samples.CHUNK), self.plan.samples]
        parts = {
            f"samples {first}": (of_samples.sampled, self.scene, self.names, known, first, stop)
            for first, stop in pairwise(ends)
        }
        rows = [row for part in run.all(parts) for row in part["rows"]]
        measures = [name for name in self.names if name != "margin"]
        columns = ["sample", *self.plan.spread, "stable", "regime", "margin", *measures]
        types = dict.fromkeys(columns, float) | {"sample": "int64", "stable": "bool", "regime": "str"}
        meant = {**{key: Column(key_of(key).meaning) for key in self.plan.spread}, **of_samples.SAMPLES, **SWEEP}
        return labelled(pd.DataFrame(rows, columns=columns).astype(types), meant)


class _Runner:
    """Runs stored tasks side by side, and counts them."""

    def __init__(self, store: Store, workers: Pool, progress: Progress) -> None:
        self._store, self._workers, self._progress = store, workers, progress
        self._done = self._known = 0

    def one(self, name: str, function: Callable[..., Any], *arguments: Any) -> Record:
        """Run a task."""
        return self.all({name: (function, *arguments)})[0]

    def all(self, tasks: Mapping[str, tuple[Any, ...]]) -> list[Record]:
        """Run tasks by the names under which they are stored."""
        before, self._known = self._done, self._known + len(tasks)

        def tell(done: int) -> None:
            self._done = before + done
            self._progress(self._done, self._known)

        chains = [StoredChain(_single(Task(task[0], task[1:])), self._store, name) for name, task in tasks.items()]
        return run_stored(chains, self._workers, tell)


def _single(task: Task) -> Tasks[Record]:
    return (yield task)


def require_allowed(scene: Scene, what: str, key: str, value: float) -> None:
    """Refuse a value that a key of a scene cannot have (ConfigError)."""
    try:
        scene.replace({key: value})
    except ConfigError as error:
        raise ConfigError(f"{what}: {error}") from None


def _told_of_keys(found: Record, names: Sequence[str]) -> Iterable[str]:
    """Yield a line for each measure: its value, and its largest elasticities."""
    yield "elasticities: relative change of a measure over that of a key, largest first"
    for name in names:
        own = of_keys.largest(found["rows"], name, SHOWN)
        if own:
            told = ", ".join(f"{row['key']} {row['elasticity']:+.3g}" for row in own)
            yield f"  {name} {found['measures'][name]:.6g}: {told}"


def _lines_of_samples(table: pd.DataFrame, home: str) -> dict[str, str]:
    """Tell how many samples keep the orbit and the regime of the scene as given."""
    kept = float((table["regime"] == home).mean())
    told = {
        "samples": f"{len(table)}",
        "orbit stable": f"{100.0 * table['stable'].mean():.1f} %",
        "regime kept": f"{100.0 * kept:.1f} %",
    }
    others = table.loc[table["regime"] != home, "regime"].value_counts()
    if len(others):
        told["others"] = "; ".join(f"{name}: {count}" for name, count in others.items())
    return told


def _told_of_samples(table: pd.DataFrame, keys: Sequence[str], names: Sequence[str]) -> Iterable[str]:
    """Yield lines on the distribution of each measure, and on what its variance comes from."""
    yield "samples: 5 %, 50 % and 95 % lie below; shares of the variance by linear regression"
    for name in names:
        if table[name].count() == 0:
            continue
        low, middle, high = table[name].quantile(of_samples.QUANTILES)
        of_keys_, explained = of_samples.shares(table, keys, name)
        first = sorted(of_keys_.items(), key=lambda item: -item[1])[:SHOWN]
        told = ", ".join(f"{key} {100.0 * share:.0f} %" for key, share in first if share >= 0.005)
        yield f"  {name} {low:.5g} {middle:.5g} {high:.5g}: {told} (of {100.0 * explained:.0f} % explained)"


def design(
    scene: Scene,
    jobs: int = 1,
    scheduler: str | None = None,
    wait: float = WAIT,
    progress: Progress = lambda done, known: None,
) -> Answer:
    """Answer the question of a scene's section ``design``: sensitivities, tolerances, best values of keys.

    Parameters
    ----------
    scene
        With a section ``design``.
    jobs, scheduler, wait, progress
        As in :func:`vibroplat.sweep`.

    Returns
    -------
    Answer
        Its ``tables`` by name, as ``vibroplat design`` writes them, and its printed ``lines`` and ``text``.

    Raises
    ------
    ConfigError
        The section is missing, or names what the scene does not have.
    OrbitError
        The motion comes to no periodic orbit.
    """
    return ask(Design(scene), jobs, scheduler, wait, progress)
