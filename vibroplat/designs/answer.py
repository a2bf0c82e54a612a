"""The answer of a design in a few lines: the best values, what tolerances change, what measures depend on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.basin.fractions import clopper_pearson
from vibroplat.columns import display_name, is_angle, unit_of
from vibroplat.config.circular import NO_MEAN, centre_text, on_line, value_text
from vibroplat.config.digits import DIGITS, FREQUENCY_DIGITS, MISSING, NEGLIGIBLE, number, percent, prefixed, quantity
from vibroplat.config.study_plans import DesignPlan
from vibroplat.designs.samples import QUANTILES
from vibroplat.results.answer import counted, in_columns

#: Most keys, measures, and keys of a measure that have a line or a place.
MAX_KEYS, MAX_MEASURES, MAX_ELASTICITIES = 4, 3, 3
#: Distance of a best value from an end of its range, over the range, at which it lies at the end.
END_DISTANCE = 1e-3
#: Relative difference of objectives up to which searches agree.
OBJECTIVE_TOLERANCE = 1e-4
#: What begins the line of samples.
SAMPLED = "within the tolerances"
#: Smallest fraction of a variance that is printed.
MIN_PRINTED_FRACTION = 0.005


def short_answer(plan: DesignPlan, tables: Mapping[str, pd.DataFrame], motion: str) -> tuple[str, list[str]]:
    """Return the headline of a design and the lines below it, from its tables; ``motion`` describes the nominal one."""
    evaluations, samples = tables.get("evaluations"), tables.get("samples")
    tolerances = [] if samples is None else list(_samples(plan, samples, tables["variance_contributions"]))
    if evaluations is not None:
        best_rows = evaluations[evaluations["best"].astype(bool)]
        if evaluations.empty:
            return "unknown: the orbit was lost on the way to every starting point of the search", []
        if best_rows.empty:
            return "no design in this box satisfies all constraints", list(_nearest(plan, evaluations))
        best = best_rows.iloc[0]
        return _best(plan, best), [_agreement(plan, best, evaluations), *_values(plan, best), *tolerances]
    if tolerances:
        return tolerances[0], tolerances[1:]
    return f"what measures depend on, for {motion}", list(elasticity_lines(tables["sensitivities"], 2 * MAX_MEASURES))


def measure_text(name: str, value: Any) -> str:
    """Write a measure with its name and unit."""
    return f"{display_name(name)} {value_text(name, value)}"


def _best(plan: DesignPlan, best: pd.Series) -> str:
    assert plan.minimize is not None
    bounds = [measure_text(name, best[name]) for name in plan.constraints]
    text = f"best: {measure_text(plan.minimize, best[plan.minimize])}"
    text += f" with {', '.join(bounds)}" if bounds else ""
    if plan.parameter_tolerances:
        text += f"; up to {quantity(best['objective'], unit_of(plan.minimize))} within the tolerances"
    return text


def _agreement(plan: DesignPlan, best: pd.Series, evaluations: pd.DataFrame) -> str:
    """Return how many searches came to the best design."""
    objectives = evaluations[evaluations["feasible"].astype(bool)].groupby("start")["objective"].min()
    same = int((objectives <= best["objective"] + OBJECTIVE_TOLERANCE * abs(best["objective"])).sum())
    return f"found by {same} of {plan.starts} searches:"


def _values(plan: DesignPlan, best: pd.Series) -> Iterator[str]:
    """Yield the best values of the keys, and which of them lie at an end of their range."""
    for key in [*plan.keys][:MAX_KEYS]:
        low, high = plan.keys[key]
        room = END_DISTANCE * (high - low)
        end = "lower" if best[key] - low < room else "upper" if high - best[key] < room else ""
        more = f"at the {end} end of its range in design.keys" if end else ""
        value = f"{number(best[key], 4)} {unit_of(key)}".rstrip()
        yield f"{key:<32}  {value:<14}  {more}".rstrip()
    if plan.keys.keys() - [*plan.keys][:MAX_KEYS]:
        yield f"and {counted(len(plan.keys) - MAX_KEYS, 'more key')}: -v"


def _nearest(plan: DesignPlan, evaluations: pd.DataFrame) -> Iterator[str]:
    """Yield the evaluated design that violates the constraints least."""
    nearest = evaluations.sort_values("violation").iloc[0]
    size = "half a turn" if any(map(is_angle, plan.constraints)) else "it"
    yield f"the closest one violates a bound by {percent(nearest['violation'])} of {size}; wider design.keys may help"
    yield from _values(plan, nearest)
    yield ", ".join(measure_text(name, nearest[name]) for name in plan.constraints)


def _samples(plan: DesignPlan, samples: pd.DataFrame, contributions: pd.DataFrame) -> Iterator[str]:
    """Yield how many samples within the tolerances are good, and the quantiles of the first measures."""
    texts = [f"{percent(samples['stable'].mean())} {'stable' if 'stability_margin' in samples else 'settle alike'}"]
    together = [*count_satisfied(plan, samples).values()][:1]
    texts += [f"{with_confidence(count, len(samples))} within bounds" for count in together]
    yield f"{counted(len(samples), 'machine')} {SAMPLED}: {', '.join(texts)}"
    yield from quantile_lines(plan, samples, contributions, MAX_MEASURES)


def quantile_lines(
    plan: DesignPlan, samples: pd.DataFrame, contributions: pd.DataFrame, most: int | None = None
) -> list[str]:
    """Return the quantiles of measures, at most ``most`` of them, and what explains their variance."""
    asked = (plan.minimize, *plan.constraints, *plan.measures)
    names = [name for name in (*asked, *contributions["measure"].unique()) if name]
    shown = [name for name in dict.fromkeys(names) if name in samples and samples[name].notna().any()][:most]
    each = len(plan.constraints) > 1
    rows = [["", *(f"{100.0 * of:.0f} %" for of in QUANTILES), *["within bound"] * each, "fraction of the variance"]]
    for name in shown:
        values = pd.Series(on_line(name, samples[name])).quantile(list(QUANTILES)).tolist()
        factor, unit = (1.0, "rad") if is_angle(name) else prefixed(values[1], unit_of(name))
        digits = FREQUENCY_DIGITS if unit == "Hz" else DIGITS
        label = display_name(name) + centre_text(name, samples[name])
        texts = [f"{label} ({unit})" if unit else label]
        within = percent(plan.keeps(name, samples[name]).mean()) if name in plan.constraints else MISSING
        own = contributions[contributions["measure"] == name].sort_values("regression", ascending=False, kind="stable")
        parts = zip(own["key"].head(MAX_KEYS if most is None else 1), own["regression"], strict=False)
        explained = ", ".join(f"{key} {percent(part)}" for key, part in parts if part >= MIN_PRINTED_FRACTION)
        if most is None and explained:
            explained += f" (of {percent(own['explained'].iloc[0])} explained)"
        if not np.isfinite(values).any():
            explained = NO_MEAN
        rows.append([*texts, *(number(value / factor, digits) for value in values), *[within] * each, explained])
    return in_columns(rows)


def count_satisfied(plan: DesignPlan, samples: pd.DataFrame) -> dict[str, int]:
    """Count the samples that satisfy all constraints, and each of several; tolerances together may violate one."""
    within = {f"  {name} {bound}": plan.keeps(name, samples[name]) for name, bound in plan.constraints.items()}
    together = {"constraints satisfied": pd.DataFrame(within).all(axis=1)} if within else {}
    return {label: int(inside.sum()) for label, inside in (together | (within if len(within) > 1 else {})).items()}


def with_confidence(count: int, number_of_samples: int) -> str:
    """Write a fraction of samples with its confidence bounds.

    These are binomial; the samples are distributed more evenly than at random, so they err on the safe side.
    """
    low, high = clopper_pearson(count, number_of_samples)
    return f"{percent(count / number_of_samples)} ({percent(low)} to {percent(high)} with 95 % confidence)"


def elasticity_lines(table: pd.DataFrame, most: int | None = None) -> Iterator[str]:
    """Yield the largest elasticities of measures, ``most`` of them at most."""
    known = table.dropna(subset=["elasticity"])
    yield "relative change of a measure divided by that of a key, largest first"
    rows = []
    for name, own in list(known.groupby("measure", sort=False))[:most]:
        first = own.reindex(own["elasticity"].abs().sort_values(ascending=False, kind="stable").index)
        first = first[first["elasticity"].abs() > NEGLIGIBLE * first["elasticity"].abs().max()]
        texts = _of_keys(dict(zip(first["key"], first["elasticity"], strict=True)))[:MAX_ELASTICITIES]
        rows.append([display_name(str(name)), value_text(str(name), own["value"].iloc[0]), ", ".join(texts)])
    yield from in_columns(rows) if rows else ()


def _of_keys(elasticities: Mapping[str, float]) -> list[str]:
    """Write elasticities by the last parts of their keys: equal ones of both exciters once, others with its number."""
    indices_of: dict[tuple[str, str], list[str]] = {}
    for key, elasticity in elasticities.items():
        prefix, _, name = key.rpartition(".")
        indices_of.setdefault((name, number(elasticity, 2)), []).append(prefix.rpartition(".")[2])
    texts = []
    for (name, text), indices in indices_of.items():
        which = f" ({int(indices[0]) + 1})" if indices[0].isdigit() and not indices[1:] else ""
        texts.append(f"{name}{which} {text}{' each' if indices[1:] else ''}")
    return texts
