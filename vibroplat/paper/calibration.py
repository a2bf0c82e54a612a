"""Calibration: the numbers that the paper does not print are fitted to its claims.

The search judges thousands of sets by periodic orbits, in half a second each (:mod:`vibroplat.paper.orbit_evidence`).
It is scipy's differential evolution (Storn and Price 1997) from several starts, with the candidates of a generation
evaluated side by side. The best sets that differ are judged by coarse sweeps, and the best of these again with other
seeds. All depends on the seed of the search alone, so a resumed search repeats the same candidates, and what is stored
is not computed again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, ValidationError, model_validator
from scipy.optimize import differential_evolution

from vibroplat.columns import Column, Columns
from vibroplat.config.reader import ENGINE, flat, load_tree, merge, nest
from vibroplat.config.scene import Scene
from vibroplat.config.schema import Real, Section, explain
from vibroplat.errors import ConfigError
from vibroplat.model.parameters import FloatArray
from vibroplat.paper.claims import judge
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.orbit_evidence import screening
from vibroplat.paper.root_finding import match_beta
from vibroplat.paper.scenes import BETA, IMPACT, NON_IMPACT, SEED, claims, coarse_scene, paper_scene
from vibroplat.study import sweep
from vibroplat.study.branches import branches
from vibroplat.study.pool import Pool, StoredChain, Tasks, run_stored
from vibroplat.study.store import Record, Store

#: Smallest population that differential evolution allows.
LEAST_POPULATION = 5
#: Share of a linear range below which a value counts as 0: rounding leaves so much of a low end of 0.
ZERO = 1e-9
#: Least difference of two sets that are both swept, of any parameter over its range.
APART = 0.03
#: A set that holds at most so many claims fewer than the best one counts as equally good.
WITHIN = 1.0
#: Ending of the columns of verdicts.
HOLDS = ".holds"

#: The table ``screening``, a row for each set of numbers that is judged by orbits; besides, it has the searched keys.
SCREENING: Columns = {
    "start": Column("number of the search that found the set"),
    "score": Column("mean score of the claims that orbits can judge", "1: all hold with an ample margin"),
    "held": Column("number of these claims that hold"),
}
#: The table ``evaluations``, a row for each set of numbers that is judged by sweeps. Besides, it has the searched keys,
#: and of each claim a column with its score and one with ending :data:`HOLDS`.
EVALUATIONS: Columns = {
    "start": SCREENING["start"],
    "score": Column("mean score of all claims", "1: all hold"),
    "held": Column("number of claims that hold"),
    "seeds": Column("seeds the set was judged with"),
    "held_mean": Column("mean of held over these seeds"),
    "held_least": Column("least of held over these seeds"),
    "score_mean": Column("mean of score over these seeds"),
}
#: The table ``confirmation``, a row for each of the best sets and seed; with the same columns of keys and claims.
CONFIRMATION: Columns = {
    "seed": Column("seed of the perturbations"),
    **{name: EVALUATIONS[name] for name in ("score", "held")},
}
#: The table ``left-out``, a row for each claim; besides, it has the searched keys.
LEFT_OUT: Columns = {
    "claim": Column("claim that is left out"),
    "held": Column("number of the other claims that hold with the set they select"),
    "of": Column("number of the other claims"),
    "holds": Column("whether the claim holds with that set"),
    "score": Column("score of the claim with that set"),
}
#: The table ``spread``, a row for each searched key.
SPREAD: Columns = {
    "parameter": Column("the key"),
    "best": Column("its value in the best set"),
    "least": Column("least value in sets within one claim of the best"),
    "lower_quartile": Column("their lower quartile"),
    "median": Column("their median"),
    "upper_quartile": Column("their upper quartile"),
    "largest": Column("their largest value"),
    "width": Column("distance of the largest and the least value", "as a share of the searched range"),
    "middle_width": Column("distance of the quartiles", "as a share of the searched range"),
    "sets": Column("number of these sets"),
}


# -- the plan ---------------------------------------------------------------------------------------------


class Range(Section):
    """The range in which a parameter is searched."""

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
        """Both ends on the scale of the search."""
        return self.place(self.low), self.place(self.high)

    def place(self, value: float) -> float:
        """Return a value on the scale of the search."""
        return math.log10(value) if self.scale == "log" else value

    def value(self, x: float) -> float:
        """Return the value at a place on the scale of the search, to five digits."""
        if self.scale == "log":
            x = 10.0**x
        elif abs(x) < ZERO * (self.high - self.low):
            x = 0.0
        return float(f"{x:.5g}")


class Confirm(Section):
    """Section ``calibration.confirm``: how many of the best sets are judged again, and with how many other seeds."""

    sets: Annotated[int, Field(ge=0, le=10_000)] = 0
    seeds: Annotated[int, Field(ge=1, le=1_000)] = 3


class CalibrationPlan(Section):
    """Section ``calibration``: the parameters and the length of the search.

    Each start is a separate search, with the seeds ``seed``, ``seed + 1``, …; ``begin`` lists sets of parameters that
    are in the first population of each start. So many of the best sets as ``sweeps`` says are judged by sweeps.
    """

    parameters: Annotated[dict[str, Range], Field(min_length=1)]
    starts: Annotated[int, Field(ge=1, le=1_000)] = 1
    population_per_parameter: Annotated[int, Field(ge=2, le=1_000)] = 8
    generations: Annotated[int, Field(ge=0, le=10_000)] = 6
    seed: Annotated[int, Field(ge=0)] = 0
    sweeps: Annotated[int, Field(ge=1, le=10_000)] = 24
    begin: Annotated[list[dict[str, Real]], Field(default_factory=list)]
    confirm: Confirm = Confirm()

    @model_validator(mode="after")
    def _begin_fits(self) -> Self:
        for number, chosen in enumerate(self.begin):
            for key, value in chosen.items():
                r = self.parameters.get(key)
                if r is None:
                    raise ValueError(f"begin.{number}: unknown key {key}; allowed: {', '.join(self.parameters)}")
                if not r.low <= value <= r.high:
                    allowed = f"allowed: {r.low} … {r.high}, where it is searched"
                    raise ValueError(f"begin.{number}.{key} = {value}; {allowed}")
            if missing := [key for key in self.parameters if key not in chosen]:
                raise ValueError(f"begin.{number}: no {missing[0]}; allowed: a value of each parameter")
        if len(self.begin) > self.population:
            raise ValueError(f"begin holds {len(self.begin)} sets; allowed: {self.population}, the population")
        return self

    @property
    def population(self) -> int:
        """Number of candidates in a generation."""
        return max(LEAST_POPULATION, self.population_per_parameter * len(self.parameters))

    @property
    def evaluations(self) -> int:
        """Number of evaluations by orbits in all starts."""
        return self.starts * self.population * (self.generations + 1)

    @property
    def confirmations(self) -> int:
        """Largest number of evaluations in the confirmation."""
        return min(self.confirm.sets, self.sweeps) * self.confirm.seeds


def load_plan(
    path: Path, overrides: Mapping[str, Any], changes: Mapping[str, Any] | None = None
) -> tuple[dict[str, Any], CalibrationPlan]:
    """Read the machine's fixed numbers (dotted keys and values) and the plan from a YAML file.

    ``overrides`` are keys of the plan, ``changes`` dotted keys of the machine.

    Raises
    ------
    ConfigError
        A key or value is not allowed.
    """
    tree = load_tree(path)
    section = tree.pop("calibration", None)
    if section is None:
        raise ConfigError(f"{path}: no section calibration; allowed: calibration: {{parameters: …}}")
    if not isinstance(section, dict):
        raise ConfigError(f"{path}: calibration = {section!r}; allowed: a section of keys and values")
    fixed = {**flat(tree), **(changes or {})}
    try:
        plan = CalibrationPlan.model_validate({**section, **overrides})
    except ValidationError as error:
        raise ConfigError(f"{path}: calibration: {explain(error, CalibrationPlan)}") from None
    for end in ("low", "high"):  # keys and values that no scene takes are refused before the search
        paper_scene(IMPACT[0], laid(fixed, {key: getattr(r, end) for key, r in plan.parameters.items()}))
    return fixed, plan


def laid(fixed: Mapping[str, Any], searched: Mapping[str, Any]) -> dict[str, Any]:
    """Lay searched numbers over those of a machine, those of one motor or exciter over those that both have."""
    single = {key: value for key, value in searched.items() if key.startswith(("motors.", "exciters."))}
    common = {key: value for key, value in searched.items() if key not in single}
    return flat(merge(merge(nest(fixed), nest(common)), nest(single)))


# -- the search -------------------------------------------------------------------------------------------

#: Called after each evaluation: their number so far, the most claims held, and the best score of those that hold most.
Progress = Callable[[int, int, float], None]


def conditions(fixed: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the points depend on besides the parameters that are searched."""
    engine = {ENGINE: fixed[ENGINE]} if ENGINE in fixed else {}  # other numbers may not fit without those searched
    scenes = {name: sweep.conditions(coarse_scene(name, engine)) for name in (*IMPACT, NON_IMPACT)}
    return {"machine": dict(fixed), **scenes}


def evaluation(numbers: Mapping[str, Any]) -> Tasks[Record]:
    """Run the coarse sweeps with a set of numbers, one point after the other, and judge all claims.

    The result is their mean ``score`` and the number ``held``, and for each claim ``ID``, its score, and ``ID.holds``.
    """
    evidence = Evidence()
    for name in IMPACT:
        yield from _swept(evidence, coarse_scene(name, numbers))
    evidence.beta = yield from match_beta(evidence)
    if evidence.beta is not None:
        yield from _swept(evidence, coarse_scene(NON_IMPACT, numbers, {BETA: evidence.beta}))
    findings = {claim["id"]: judge(claim, evidence) for claim in claims()}
    score = float(np.mean([float(finding.score) for finding in findings.values()]))
    result: Record = {"score": score, "held": sum(bool(finding.holds) for finding in findings.values())}
    for name, finding in findings.items():
        result |= {name: float(finding.score), f"{name}{HOLDS}": bool(finding.holds)}
    return result


def _swept(evidence: Evidence, scene: Scene) -> Tasks[None]:
    """Run a sweep and add its branches to the evidence."""
    for branch in branches(scene):
        records: list[Record] = []
        yield from sweep.branch_points(branch, records.append)
        evidence.add(branch, records)


@dataclass
class _Judged:
    """Judges sets of numbers side by side, and counts them."""

    fixed: Mapping[str, Any]
    records: Store
    workers: Pool
    progress: Progress
    count: int = 0
    best: tuple[int, float] = (0, 0.0)

    def __call__(
        self, sets: Sequence[dict[str, Any]], judged: Callable[[Mapping[str, Any]], Tasks[Record]]
    ) -> list[Record]:
        """Return what is found for each set; one that was judged before is read from the records."""
        names = [f"{judged.__name__} {json.dumps(numbers)}" for numbers in sets]
        chains = {
            name: StoredChain(judged(laid(self.fixed, numbers)), self.records, name)
            for name, numbers in dict(zip(names, sets, strict=True)).items()
        }
        results = run_stored(chains.values(), self.workers, lambda done: self.progress(self.count + done, *self.best))
        found = dict(zip(chains, results, strict=True))
        self.best = max([self.best, *((result["held"], result["score"]) for result in results)])
        self.count += len(sets)
        self.progress(self.count, *self.best)
        return [found[name] for name in names]


def calibrate(
    fixed: Mapping[str, Any], plan: CalibrationPlan, records: Store, workers: Pool, progress: Progress | None = None
) -> dict[str, pd.DataFrame]:
    """Search from all starts, one after the other, by orbits; judge the best sets by sweeps; confirm the best of these.

    Parameters
    ----------
    fixed
        Dotted keys and values of the machine that are not searched.
    plan
        What is searched, and for how long.
    records
        Where results are stored; those that are stored already are not repeated.
    workers
        Where orbits and points are computed.
    progress
        Called after each evaluation with their number, the most claims held and the best score of those that hold most.

    Returns
    -------
    dict
        ``screening``: a row for each evaluation by orbits, the best first. ``evaluations``: a row for each set that was
        swept, the best first; the verdicts on claims are those with the first seed, and confirmed sets come before all
        others. ``confirmation``: a row for each confirmed set and each seed. ``left-out`` and ``spread``: see
        :func:`left_out` and :func:`spread`.
    """
    judged, keys = _Judged(fixed, records, workers, progress or (lambda *_: None)), list(plan.parameters)
    found = [{"start": n, **row} for n in range(plan.starts) for row in _search(plan, plan.seed + n, judged)]
    screened = pd.DataFrame(found).sort_values("score", ascending=False, ignore_index=True, kind="stable")
    chosen = differing(screened, plan)
    first = int(fixed.get(SEED, 0))
    rows = [{"seed": first, **s, **r} for s, r in zip(chosen, judged(chosen, evaluation), strict=True)]
    rows.sort(key=lambda row: (-row["held"], -row["score"]))
    best = rows[: plan.confirm.sets]
    again = [{**{k: row[k] for k in keys}, SEED: first + 1 + n} for row in best for n in range(plan.confirm.seeds)]
    confirmed = [{"seed": s[SEED], **s, **r} for s, r in zip(again, judged(again, evaluation), strict=True)]
    confirmation = pd.DataFrame([*best, *confirmed]).drop(columns=SEED, errors="ignore")
    # the mean of a column, as pandas rounds that of a group otherwise
    own = {"held_mean": ("held", "mean"), "held_least": ("held", "min"), "score_mean": ("score", pd.Series.mean)}
    over_seeds = pd.DataFrame([*rows, *confirmed]).groupby(keys).agg(seeds=("held", "size"), **own)
    table = pd.DataFrame(rows).drop(columns="seed").join(over_seeds, on=keys)
    table = table.join(screened.groupby(keys)["start"].min(), on=keys)
    by = ["seeds", "held_mean", "score_mean"]
    table = table.sort_values(by, ascending=False, ignore_index=True, kind="stable")
    front = ["start", *keys, *list(EVALUATIONS)[1:]]
    table = table[[*front, *table.columns.difference(front, sort=False)]]
    tables = {"screening": screened, "evaluations": table, "confirmation": confirmation}
    return tables | {"left-out": left_out(table, plan), "spread": spread(table, plan)}


def _search(plan: CalibrationPlan, seed: int, judged: _Judged) -> list[dict[str, Any]]:
    """Search with a seed and return the sets that were judged, in their order, with their results."""
    from scipy.stats import qmc  # noqa: PLC0415  (takes half a second to load)

    ranges = plan.parameters
    rows: list[dict[str, Any]] = []

    def values(_: Callable[..., float], candidates: Iterable[FloatArray]) -> list[float]:
        sets = [{k: r.value(v) for (k, r), v in zip(ranges.items(), x, strict=True)} for x in candidates]
        results = judged(sets, screening)
        rows.extend({**searched, **result} for searched, result in zip(sets, results, strict=True))
        return [1.0 - result["score"] for result in results]

    # the first population is a Latin hypercube, whose first sets are replaced by the plan's ``begin``
    low, high = np.array([r.bounds for r in ranges.values()]).T
    population = low + qmc.LatinHypercube(len(ranges), rng=seed).random(plan.population) * (high - low)
    for place, chosen in enumerate(plan.begin):
        population[place] = [r.place(chosen[key]) for key, r in ranges.items()]
    differential_evolution(
        lambda x: math.nan,  # the map below evaluates a generation's candidates side by side
        [r.bounds for r in ranges.values()],
        init=population,
        maxiter=plan.generations,
        tol=0.0,
        rng=seed,
        workers=values,
        updating="deferred",
        polish=False,
    )
    return rows


def differing(screened: pd.DataFrame, plan: CalibrationPlan) -> list[dict[str, float]]:
    """Choose the sets to be swept: those that the plan begins with, and the best ones that differ from all before."""
    chosen: list[dict[str, float]] = []
    places: list[FloatArray] = []
    low, high = np.array([r.bounds for r in plan.parameters.values()]).T
    begin = [[numbers[key] for key in plan.parameters] for numbers in plan.begin]
    for numbers in [*begin, *screened[list(plan.parameters)].to_numpy().tolist()]:
        place = np.array([r.place(value) for r, value in zip(plan.parameters.values(), numbers, strict=True)])
        place = (place - low) / (high - low)
        if len(chosen) < plan.sweeps and all(np.abs(place - other).max() >= APART for other in places):
            chosen.append(dict(zip(plan.parameters, numbers, strict=True)))
            places.append(place)
    return chosen


# -- what the evaluations show ----------------------------------------------------------------------------


def left_out(evaluations: pd.DataFrame, plan: CalibrationPlan) -> pd.DataFrame:
    """Choose the best set by all claims but one, and check whether that one holds with it; a row for each claim.

    The best set is that with which most of the other claims hold, then that with their highest mean score. Only the
    first seed counts, as sets with more seeds were chosen by all claims, including the one left out. All claims have
    also guided the search, so this is less strict than a search without the claim.
    """
    names = [name.removesuffix(HOLDS) for name in evaluations.columns if name.endswith(HOLDS)]
    keys, rows = list(plan.parameters), []
    for name in names:
        others = [other for other in names if other != name]
        held = evaluations[[f"{other}{HOLDS}" for other in others]].sum(axis=1)
        order = pd.DataFrame({"held": held, "score": evaluations[others].mean(axis=1)})
        place = order.sort_values(["held", "score"], ascending=False, kind="stable").index[0]
        best = evaluations.loc[place]
        rows.append((name, held[place], len(others), *best[keys].astype(float), best[f"{name}{HOLDS}"], best[name]))
    return pd.DataFrame(rows, columns=["claim", "held", "of", *keys, "holds", "score"])


def spread(evaluations: pd.DataFrame, plan: CalibrationPlan) -> pd.DataFrame:
    """Return the spread of each parameter over the sets within one claim of the best; a row for each parameter.

    ``width`` is the distance of the least and the largest value, ``middle_width`` that of the quartiles, as shares of
    the range on the scale of the search: they are small if the claims determine the parameter. Sets are compared by the
    mean of claims held over their seeds, and each counts once.
    """
    sets = evaluations.drop_duplicates(list(plan.parameters))
    near = sets[sets["held_mean"] >= evaluations["held_mean"].iloc[0] - WITHIN]
    rows = []
    for key, searched in plan.parameters.items():
        low, high = searched.bounds
        places = near[key].map(searched.place).quantile([0.0, 0.25, 0.5, 0.75, 1.0]).to_numpy()
        widths = [(places[b] - places[a]) / (high - low) for a, b in ((0, 4), (1, 3))]
        rows.append((key, evaluations[key].iloc[0], *map(searched.value, places), *widths, len(near)))
    return pd.DataFrame(rows, columns=list(SPREAD))


def overview(tables: Mapping[str, pd.DataFrame]) -> dict[str, str]:
    """Summarize the tables of a calibration in a few lines: label and text."""
    evaluations, left, spreads = (tables[name] for name in ("evaluations", "left-out", "spread"))
    best, judged = evaluations.iloc[0], len(left)
    lines = {
        str(row.parameter): f"{row.best:<12.5g}{row.least:.5g} … {row.largest:.5g}, {row.width:.0%} of the range, "
        f"middle half {row.middle_width:.0%}"
        for row in spreads.itertuples()
    }
    count = int(spreads["sets"].iloc[0])
    lines["ranges"] = f"of {count} {'set' if count == 1 else 'sets'} within one claim of the best"
    lines["claims held"] = f"{best['held']} of {judged}, score {best['score']:.3f}"
    if best["seeds"] > 1:
        lines["claims held over seeds"] = (
            f"{best['held_mean']:.3g} of {judged} in the mean of {best['seeds']} seeds, at least {best['held_least']}, "
            f"score {best['score_mean']:.3f}"
        )
    lines["predicted"] = f"{int(left['holds'].sum())} of {judged} claims hold with the set that the others choose"
    lines["evaluations"] = f"{len(tables['screening'])} by orbits, {len(evaluations)} by sweeps"
    return lines
