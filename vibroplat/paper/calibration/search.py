"""The search: differential evolution from several starts, and the best sets judged again with other seeds.

A set of parameters is judged by the coarse sweeps of :mod:`vibroplat.paper.trial`. The search is differential
evolution (Storn and Price 1997) as scipy has it, with the candidates of a generation evaluated side by side. It depends
on nothing but its seed, so a resumed search repeats it with the evaluations that are already there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution
from scipy.stats import qmc

import vibroplat
from vibroplat.model.parameters import FloatArray
from vibroplat.paper.calibration.plan import CalibrationPlan
from vibroplat.paper.trial import QUICK, claims, quick_findings
from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.store import Store

#: Told after each evaluation: how many there are, the most claims held, and the best score among these.
Progress = Callable[[int, int, float], None]
Record = dict[str, Any]

#: Key of the seed of the sweeps' perturbations.
SEED = "sweep.seed"
#: First number in the store of evaluations that confirm; those of the search have the number of their start.
CONFIRMING = 1_000_000


def conditions(fixed: Mapping[str, Any], plan: CalibrationPlan) -> dict[str, Any]:
    """Return what the evaluations rest on; how many there are may change."""
    return {
        "vibroplat": vibroplat.__version__,
        "machine": dict(fixed),
        "calibration": plan.model_dump(exclude={"starts", "generations", "confirm"}),
        "claims": claims(),
        "trial": QUICK,
    }


def evaluate(numbers: Mapping[str, Any]) -> Record:
    """Judge all claims with a set of numbers: mean score, claims held, and the score and verdict of each claim."""
    findings = quick_findings(numbers)
    scores = {name: float(finding.score) for name, finding in findings.items()}
    holds = {name: bool(finding.holds) for name, finding in findings.items()}
    return {
        "score": float(np.mean(list(scores.values()))),
        "held": sum(holds.values()),
        "scores": scores,
        "holds": holds,
    }


def objective(result: Mapping[str, Any]) -> float:
    """Return what the search makes small: 1 less the mean of (score + holds)/2 over the claims.

    With scores alone, 0.99 for a claim that fails is worth as much as a claim that holds, though the best set is the
    one of most claims held. With the number of claims held first, the search would see steps alone, and those of
    motions that are not periodic turn with the seed. Half and half, a claim is worth more the nearer it is, and as much
    again once it holds.
    """
    return 1.0 - 0.5 * (float(result["score"]) + float(np.mean(list(result["holds"].values()))))


@dataclass(frozen=True)
class Calibration:
    """What came of a calibration.

    Attributes
    ----------
    evaluations
        A row for each evaluation of the search, the best first: start, parameters, score and claims held; how many
        ``seeds`` it was judged with, and over these ``held_mean``, ``held_least`` and ``score_mean``; score and verdict
        of each claim (``ID`` and ``ID.holds``) with the first seed. Sets that were confirmed come before the others.
    confirmation
        A row for each set that was confirmed and each seed: seed, parameters, score, claims held, and each claim.
    """

    evaluations: pd.DataFrame
    confirmation: pd.DataFrame


def calibrate(
    fixed: Mapping[str, Any], plan: CalibrationPlan, store: Store, workers: Pool, progress: Progress | None = None
) -> Calibration:
    """Search from all starts, one after the other, and confirm the best sets.

    Parameters
    ----------
    fixed
        Dotted keys and values of the machine that are not searched.
    plan
        What is searched.
    store
        Keeps evaluations; those that it has are not repeated.
    workers
        Where they run.
    progress
        Called with the number of evaluations, the most claims held and the best score among these.
    """
    book = _Book(fixed, plan, store, workers, progress)
    found = [(start, e) for start in range(plan.starts) for e in _search(plan, start, book)]
    rows = pd.DataFrame([{"start": start, **_row(e)} for start, e in found])
    rows = rows.sort_values(["held", "score"], ascending=False, kind="stable")
    chosen = [found[i][1] for i in rows.drop_duplicates(list(plan.parameters)).index[: plan.confirm.sets]]
    first = int(fixed.get(SEED, 0))
    seeds = range(first + 1, first + 1 + plan.confirm.seeds)
    again = book.judge([(e.searched, seed) for e in chosen for seed in seeds], CONFIRMING)
    store.finish()
    confirmation = pd.DataFrame([{"seed": first if e.seed is None else e.seed, **_row(e)} for e in (*chosen, *again)])
    return Calibration(_over_seeds(rows, confirmation, plan), confirmation)


def _search(plan: CalibrationPlan, start: int, book: _Book) -> list[_Evaluation]:
    """Search from one start; returns its evaluations in their order."""
    evaluations: list[_Evaluation] = []

    def values(_: Callable[..., float], candidates: Iterable[FloatArray]) -> list[float]:
        sets = [{k: r.value(v) for (k, r), v in zip(plan.parameters.items(), x, strict=True)} for x in candidates]
        judged = book.judge([(searched, None) for searched in sets], start)
        evaluations.extend(judged)
        return [objective(e.result) for e in judged]

    bounds = [r.bounds for r in plan.parameters.values()]
    differential_evolution(
        lambda x: math.nan,  # the map below evaluates a generation's candidates side by side
        bounds,
        init=_population(plan, plan.seed + start),
        maxiter=plan.generations,
        tol=0.0,
        rng=plan.seed + start,
        workers=values,
        updating="deferred",
        polish=False,
    )
    return evaluations


def _population(plan: CalibrationPlan, seed: int) -> FloatArray:
    """Return the first population: a Latin hypercube, the sets to begin with in place of its first ones."""
    ranges = plan.parameters
    low, high = np.array([r.bounds for r in ranges.values()]).T
    shares = qmc.LatinHypercube(len(ranges), rng=seed).random(plan.population)
    population = low + shares * (high - low)
    for place, chosen in enumerate(plan.begin):
        population[place] = [r.place(chosen[key]) for key, r in ranges.items()]
    return np.asarray(population)


def _row(e: _Evaluation) -> dict[str, Any]:
    row: dict[str, Any] = {**e.searched, "score": e.result["score"], "held": e.result["held"]}
    for name, score in e.result["scores"].items():
        row |= {name: score, f"{name}.holds": e.result["holds"][name]}
    return row


def _over_seeds(rows: pd.DataFrame, confirmation: pd.DataFrame, plan: CalibrationPlan) -> pd.DataFrame:
    """Add what all seeds say to evaluations, and sort them, those that were confirmed first."""
    keys = list(plan.parameters)
    at = rows.columns.get_loc("held")
    assert isinstance(at, int)
    own: dict[str, Any] = {
        "seeds": 1,
        "held_mean": rows["held"].astype(float),
        "held_least": rows["held"],
        "score_mean": rows["score"],
    }
    for place, (name, values) in enumerate(own.items(), at + 1):
        rows.insert(place, name, values)
    for values, judged in confirmation.groupby(keys) if len(confirmation) else ():
        same = (rows[keys] == list(values)).all(axis=1)
        held, score = judged["held"], judged["score"]
        for name, value in zip(own, (len(judged), held.mean(), held.min(), score.mean()), strict=True):
            rows.loc[same, name] = value
    return rows.sort_values(["seeds", "held_mean", "score_mean"], ascending=False, ignore_index=True, kind="stable")


class _Book:
    """Evaluations by set and seed: those that the store has, and those that are made."""

    def __init__(
        self, fixed: Mapping[str, Any], plan: CalibrationPlan, store: Store, workers: Pool, progress: Progress | None
    ) -> None:
        self._fixed = fixed
        self._store = store
        self._workers = workers
        self._progress = progress
        self._done = 0
        self._best = (-1, 0.0)
        self._written: dict[int, int] = {}
        self._known: dict[Any, Record] = {}
        for first in (*range(plan.starts), CONFIRMING):
            for second, record in store.read(first):
                self._written[first] = second + 1
                self._known[_key(record["numbers"], record["seed"])] = record

    def judge(self, wanted: Iterable[tuple[dict[str, float], int | None]], first: int) -> list[_Evaluation]:
        """Judge sets, each with a seed or the machine's own, side by side."""
        judged: list[_Evaluation] = []
        pending: dict[Any, _Evaluation] = {}  # a set that comes twice is judged once
        for searched, seed in wanted:
            key = _key(searched, seed)
            e = _Evaluation(searched, seed, self._fixed, self._known.get(key))
            judged.append(e)
            if e.record is not None or pending.setdefault(key, e) is not e:
                self._tell(e)
        for e in run_chains(pending.values(), self._workers):
            second = self._written.get(first, 0)
            self._store.write(first, second, e.result)
            self._written[first] = second + 1
            self._known[_key(e.searched, e.seed)] = e.result
            self._tell(e)
        for e in judged:
            e.record = self._known[_key(e.searched, e.seed)]
        return judged

    def _tell(self, e: _Evaluation) -> None:
        self._done += 1
        if e.seed is None and e.record is not None:
            self._best = max(self._best, (e.result["held"], e.result["score"]))
        if self._progress is not None:
            self._progress(self._done, *self._best)


def _key(searched: Mapping[str, float], seed: int | None) -> Any:
    return tuple(searched.items()), seed


class _Evaluation:
    """A chain of one task: the claims judged with one set of parameters and one seed."""

    def __init__(
        self, searched: dict[str, float], seed: int | None, fixed: Mapping[str, Any], record: Record | None
    ) -> None:
        self.searched = searched
        self.seed = seed
        self.record = record
        self._numbers = {**fixed, **searched} | ({} if seed is None else {SEED: seed})

    @property
    def result(self) -> Record:
        """What the evaluation has found."""
        assert self.record is not None  # its chain has run to its end
        return self.record

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the evaluation, if it is still to be made."""
        return None if self.record is not None else (evaluate, (self._numbers,))

    def take(self, result: Record | WorkerLostError) -> None:
        """Keep what was found."""
        if isinstance(result, WorkerLostError):
            raise result
        self.record = {"numbers": self.searched, "seed": self.seed, **result}
