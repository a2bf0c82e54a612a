"""The search: differential evolution from several starts; the best sets are judged again with other seeds.

A set of parameters is judged by the coarse sweeps of :mod:`vibroplat.paper.trial`. The search is scipy's differential
evolution (Storn and Price 1997), with the candidates of a generation evaluated side by side. It depends on its seed
alone, so a resumed search repeats the same candidates, and the points that are stored are not simulated again.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution

from vibroplat.config.reader import ENGINE
from vibroplat.model.parameters import FloatArray
from vibroplat.paper.calibration.plan import CalibrationPlan
from vibroplat.paper.claims import judge
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.trial import IMPACT, NON_IMPACT, QUICK, SEED, SHARED, claims, paper_scene, quick_trial
from vibroplat.study import sweep
from vibroplat.study.pool import Pool, StoredChain, Tasks, run_chains
from vibroplat.study.store import Record, Store

#: Called after each evaluation: their number so far, the most claims held, and the best score of those that hold most.
Progress = Callable[[int, int, float], None]


def conditions(fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the points depend on besides the parameters that are searched."""
    engine = {ENGINE: fixed[ENGINE]} if ENGINE in fixed else {}  # other numbers may not fit without those searched
    scenes = {name: paper_scene(name, engine, QUICK | SHARED.get(name, {})) for name in (*IMPACT, NON_IMPACT)}
    return {"machine": dict(fixed), **{name: sweep.conditions(scene) for name, scene in scenes.items()}}


def evaluation(numbers: Mapping[str, Any]) -> Tasks[Record]:
    """Run the coarse sweeps with a set of numbers; the result is what :func:`scored` returns."""
    return scored((yield from quick_trial(numbers)))


def scored(evidence: Evidence) -> Record:
    """Judge all claims: their mean ``score``, the number ``held``, and the ``scores`` and ``holds`` of each claim."""
    findings = {claim["id"]: judge(claim, evidence) for claim in claims()}
    scores = {name: float(finding.score) for name, finding in findings.items()}
    holds = {name: bool(finding.holds) for name, finding in findings.items()}
    return {
        "score": float(np.mean(list(scores.values()))),
        "held": sum(holds.values()),
        "scores": scores,
        "holds": holds,
    }


def objective(result: Mapping[str, Any]) -> float:
    """Return what the search minimizes: 1 − the mean of (score + holds)/2 over the claims.

    By scores alone, a claim that fails with 0.99 would count almost as much as one that holds, but the best set is that
    with most claims held. By the number of claims held alone, the search would see nothing but steps, and those of
    motions that are not periodic depend on the seed. With both, a claim counts more the closer it is, and twice as much
    once it holds.
    """
    return 1.0 - 0.5 * (float(result["score"]) + float(np.mean(list(result["holds"].values()))))


@dataclass(frozen=True)
class Calibration:
    """The tables of a calibration.

    Attributes
    ----------
    evaluations
        A row for each evaluation of the search, the best first: start, parameters, score and claims held; the number of
        ``seeds`` that it was judged with, and over these ``held_mean``, ``held_least`` and ``score_mean``; score and
        verdict of each claim (``ID`` and ``ID.holds``) with the first seed. Confirmed sets come before all others.
    confirmation
        A row for each confirmed set and each seed: seed, parameters, score, claims held, and each claim.
    """

    evaluations: pd.DataFrame
    confirmation: pd.DataFrame


def calibrate(
    fixed: Mapping[str, Any], plan: CalibrationPlan, records: Store, workers: Pool, progress: Progress | None = None
) -> Calibration:
    """Search from all starts, one after the other, and confirm the best sets.

    Parameters
    ----------
    fixed
        Dotted keys and values of the machine that are not searched.
    plan
        What is searched, and for how long.
    records
        Where points are stored; points that are stored already are not repeated.
    workers
        Where points are simulated.
    progress
        Called after each evaluation with their number, the most claims held and the best score of those that hold most.
    """
    book = _Book(fixed, records, workers, progress)
    found = [(start, e) for start in range(plan.starts) for e in _search(plan, start, book)]
    rows = pd.DataFrame([{"start": start, **_row(e)} for start, e in found])
    rows = rows.sort_values(["held", "score"], ascending=False, kind="stable")
    chosen = [found[i][1] for i in rows.drop_duplicates(list(plan.parameters)).index[: plan.confirm.sets]]
    first = int(fixed.get(SEED, 0))
    seeds = range(first + 1, first + 1 + plan.confirm.seeds)
    again = book.judge([(e.searched, seed) for e in chosen for seed in seeds])
    confirmation = pd.DataFrame([{"seed": first if e.seed is None else e.seed, **_row(e)} for e in (*chosen, *again)])
    return Calibration(_over_seeds(rows, confirmation, plan), confirmation)


def _search(plan: CalibrationPlan, start: int, book: _Book) -> list[_Evaluation]:
    """Search from one start and return its evaluations in their order."""
    evaluations: list[_Evaluation] = []

    def values(_: Callable[..., float], candidates: Iterable[FloatArray]) -> list[float]:
        sets = [{k: r.value(v) for (k, r), v in zip(plan.parameters.items(), x, strict=True)} for x in candidates]
        judged = book.judge([(searched, None) for searched in sets])
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
    """Return the first population: a Latin hypercube, whose first sets are replaced by the plan's ``begin``."""
    from scipy.stats import qmc  # noqa: PLC0415  (takes half a second to load)

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
    """Add the columns over all seeds to evaluations, and sort them, confirmed sets first."""
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


class _Evaluation(NamedTuple):
    """A set of parameters, the seed with which it was judged (None: that of the machine), and what was found."""

    searched: dict[str, float]
    seed: int | None
    result: Record


class _Book:
    """Evaluations by set and seed, each made once."""

    def __init__(self, fixed: Mapping[str, Any], records: Store, workers: Pool, progress: Progress | None) -> None:
        self._fixed = fixed
        self._records = records
        self._workers = workers
        self._progress = progress
        self._count = 0
        self._best = (-1, 0.0)
        self._known: dict[str, _Evaluation] = {}

    def judge(self, wanted: Sequence[tuple[dict[str, float], int | None]]) -> list[_Evaluation]:
        """Judge sets of parameters, each with a seed, side by side."""
        names = [json.dumps(place) for place in wanted]
        chains: dict[str, StoredChain[_Evaluation]] = {}
        for name, place in zip(names, wanted, strict=True):
            if name in self._known or name in chains:
                self._report(self._known.get(name))
            else:
                chains[name] = StoredChain(self._evaluated(*place), self._records, name)
        stored = (chain for chain in chains.values() if chain.done)
        for chain in itertools.chain(stored, run_chains(chains.values(), self._workers, in_turn=False)):
            if chain.done:
                self._report(chain.result)
        self._known |= {name: chain.result for name, chain in chains.items()}
        return [self._known[name] for name in names]

    def _evaluated(self, searched: dict[str, float], seed: int | None) -> Tasks[_Evaluation]:
        numbers = {**self._fixed, **searched} | ({} if seed is None else {SEED: seed})
        return _Evaluation(searched, seed, (yield from evaluation(numbers)))

    def _report(self, e: _Evaluation | None) -> None:
        self._count += 1
        if e is not None and e.seed is None:
            self._best = max(self._best, (e.result["held"], e.result["score"]))
        if self._progress is not None:
            self._progress(self._count, *self._best)
