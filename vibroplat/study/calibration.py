"""Calibration: the numbers that the paper does not print, fitted to its claims.

The objective is the mean of the claims' scores (:mod:`vibroplat.study.claims`), each between 0 and 1 and all alike
in weight, judged by the coarse sweeps of :mod:`vibroplat.study.trial`. Of all evaluations the best is that with which
most claims hold, and among these the one of the highest score. The search is differential evolution
(Storn and Price 1997) as scipy has it, with the candidates of a generation evaluated side by side. It depends on
nothing but its seed, so going on after an interruption repeats it with the evaluations that are already there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, ValidationError, model_validator
from scipy.optimize import differential_evolution

import vibroplat
from vibroplat.config import load_tree
from vibroplat.errors import ConfigError
from vibroplat.fields import Real, Section
from vibroplat.messages import explain
from vibroplat.overrides import flat
from vibroplat.physics.parameters import FloatArray
from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.store import Store
from vibroplat.study.trial import claims, quick_findings

#: Told after each evaluation: how many there are, and the best score.
Progress = Callable[[int, float], None]


class Range(Section):
    """Where a parameter is searched."""

    low: Real
    high: Real
    scale: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"high = {self.high} is not above low = {self.low}")
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f"low = {self.low}; allowed: more than 0 with scale = log")
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Ends on the scale of the search."""
        return (math.log10(self.low), math.log10(self.high)) if self.scale == "log" else (self.low, self.high)

    def value(self, x: float) -> float:
        """Return the parameter at a place on the scale of the search, to five digits."""
        return float(f"{10.0**x if self.scale == 'log' else x:.5g}")


class Plan(Section):
    """Section ``calibration``: what is searched, and how long."""

    parameters: Annotated[dict[str, Range], Field(min_length=1)]
    population_per_parameter: Annotated[int, Field(ge=2, le=1_000)] = 8
    generations: Annotated[int, Field(ge=0, le=10_000)] = 6
    seed: Annotated[int, Field(ge=0)] = 0

    @property
    def evaluations(self) -> int:
        """Evaluations of the whole search; scipy takes at least five candidates a generation."""
        return max(5, self.population_per_parameter * len(self.parameters)) * (self.generations + 1)


def load_plan(path: Path, overrides: Mapping[str, Any]) -> tuple[dict[str, Any], Plan]:
    """Read the machine's fixed numbers and the plan from a YAML file.

    Raises
    ------
    ConfigError
        One line that names the key, the value and what is allowed.
    """
    tree = load_tree(path)
    section = tree.pop("calibration", None)
    if section is None:
        raise ConfigError(f"{path}: no section calibration; allowed: calibration: {{parameters: …}}")
    if not isinstance(section, dict):
        raise ConfigError(f"{path}: calibration = {section!r}; allowed: a section of keys and values")
    try:
        return flat(tree), Plan.model_validate({**section, **overrides})
    except ValidationError as error:
        raise ConfigError(f"{path}: calibration: {explain(error, Plan)}") from None


def conditions(fixed: Mapping[str, Any], plan: Plan) -> dict[str, Any]:
    """Return what the evaluations rest on, but for how many generations there are."""
    return {
        "vibroplat": vibroplat.__version__,
        "machine": dict(fixed),
        "calibration": plan.model_dump(exclude={"generations"}),
        "claims": claims(),
    }


def evaluate(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Judge all claims with a set of numbers; returns the mean score and what each claim is worth."""
    findings = quick_findings(numbers)
    scores = {name: finding.score for name, finding in findings.items()}
    return {
        "score": float(np.mean(list(scores.values()))),
        "held": sum(finding.holds for finding in findings.values()),
        "scores": {name: float(score) for name, score in scores.items()},
    }


def calibrate(
    fixed: Mapping[str, Any], plan: Plan, store: Store, workers: Pool, progress: Progress | None = None
) -> pd.DataFrame:
    """Search, and return a row for each evaluation, the best first: most claims held, then the highest score.

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
        Called with the number of evaluations and the best score so far.
    """
    evaluations: list[_Evaluation] = []
    known = dict(store.read(0))

    def scores(_: Callable[..., float], candidates: Iterable[FloatArray]) -> list[float]:
        first = len(evaluations)
        for x in candidates:
            searched = {key: r.value(v) for (key, r), v in zip(plan.parameters.items(), x, strict=True)}
            number = len(evaluations)
            record = known.get(number)
            if record is not None and record["numbers"] != searched:
                record = None  # the search has gone another way, as with another scipy
            evaluations.append(_Evaluation(number, searched, fixed, store, record))
        for _done in run_chains(evaluations[first:], workers):
            if progress is not None:
                finished = [e.record["score"] for e in evaluations if e.record is not None]
                progress(len(finished), max(finished))
        return [1.0 - float(e.result["score"]) for e in evaluations[first:]]

    differential_evolution(
        lambda x: math.nan,  # the map below evaluates a generation's candidates side by side
        [r.bounds for r in plan.parameters.values()],
        popsize=plan.population_per_parameter,
        maxiter=plan.generations,
        tol=0.0,
        rng=plan.seed,
        workers=scores,
        updating="deferred",
        polish=False,
    )
    store.finish()
    rows = [e.searched | {k: e.result[k] for k in ("score", "held")} | e.result["scores"] for e in evaluations]
    return pd.DataFrame(rows).sort_values(["held", "score"], ascending=False, ignore_index=True, kind="stable")


class _Evaluation:
    """A chain of one task: the claims judged with one set of numbers."""

    def __init__(
        self,
        number: int,
        searched: dict[str, float],
        fixed: Mapping[str, Any],
        store: Store,
        record: dict[str, Any] | None,
    ) -> None:
        self.searched = searched
        self.record = record
        self._number = number
        self._numbers = {**fixed, **searched}
        self._store = store

    @property
    def result(self) -> dict[str, Any]:
        """What the evaluation has found."""
        assert self.record is not None  # its chain has run to its end
        return self.record

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the evaluation, if it is still to be made."""
        return None if self.record is not None else (evaluate, (self._numbers,))

    def take(self, result: dict[str, Any] | WorkerLostError) -> None:
        """Keep what was found."""
        if isinstance(result, WorkerLostError):
            raise result
        self.record = {"numbers": self.searched, **result}
        self._store.write(0, self._number, self.record)
