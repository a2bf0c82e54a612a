"""What the evaluations of a calibration show: which claims are predicted, which parameters are determined."""

from __future__ import annotations

import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.paper.calibration.plan import CalibrationPlan

#: A set that holds at most so many claims fewer than the best one counts as equally good.
WITHIN = 1.0
#: Columns of the spread of a parameter, and their quantiles.
QUANTILES = {"least": 0.0, "lower_quartile": 0.25, "median": 0.5, "upper_quartile": 0.75, "largest": 1.0}
#: Ending of the columns of verdicts.
HOLDS = ".holds"


#: The table ``evaluations``, a row for each set of numbers. Besides, it has the searched keys, and of each claim a
#: column with its score and one with ending :data:`HOLDS`.
EVALUATIONS: Columns = {
    "start": Column("number of the search that found the set"),
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


def claim_names(evaluations: pd.DataFrame) -> list[str]:
    """Return the names of the claims that were judged."""
    return [name.removesuffix(HOLDS) for name in evaluations.columns if name.endswith(HOLDS)]


def left_out(evaluations: pd.DataFrame, plan: CalibrationPlan) -> pd.DataFrame:
    """Choose the best set by all claims but one, and check whether that one holds with it; a row for each claim.

    The best set is that with which most of the other claims hold, then that with their highest mean score. Only the
    first seed counts, as sets with more seeds were chosen by all claims, including the one left out. All claims have
    also guided the search, so this is less strict than a search without the claim.
    """
    names = claim_names(evaluations)
    rows = []
    for name in names:
        others = [other for other in names if other != name]
        held = evaluations[[f"{other}{HOLDS}" for other in others]].sum(axis=1)
        order = pd.DataFrame({"held": held, "score": evaluations[others].mean(axis=1)})
        place = order.sort_values(["held", "score"], ascending=False, kind="stable").index[0]
        best = evaluations.loc[place]
        rows.append(
            {"claim": name, "held": int(held[place]), "of": len(others)}
            | {key: float(best[key]) for key in plan.parameters}
            | {"holds": bool(best[f"{name}{HOLDS}"]), "score": float(best[name])}
        )
    return pd.DataFrame(rows)


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
        found = dict(zip(QUANTILES, near[key].map(searched.place).quantile(list(QUANTILES.values())), strict=True))
        low, high = searched.bounds
        rows.append(
            {"parameter": key, "best": float(evaluations[key].iloc[0])}
            | {name: searched.value(float(place)) for name, place in found.items()}
            | {
                "width": (found["largest"] - found["least"]) / (high - low),
                "middle_width": (found["upper_quartile"] - found["lower_quartile"]) / (high - low),
                "sets": len(near),
            }
        )
    return pd.DataFrame(rows)


def overview(evaluations: pd.DataFrame, left: pd.DataFrame, spreads: pd.DataFrame) -> dict[str, str]:
    """Summarize a calibration in a few lines: label and text."""
    best, claims = evaluations.iloc[0], len(left)
    lines = {
        str(row["parameter"]): f"{row['best']:<12.5g}{row['least']:.5g} … {row['largest']:.5g}, "
        f"{row['width']:.0%} of the range, middle half {row['middle_width']:.0%}"
        for _, row in spreads.iterrows()
    }
    count = int(spreads["sets"].iloc[0])
    lines["ranges"] = f"of {count} {'set' if count == 1 else 'sets'} within one claim of the best"
    lines["claims held"] = f"{best['held']} of {claims}, score {best['score']:.3f}"
    if best["seeds"] > 1:
        lines["claims held over seeds"] = (
            f"{best['held_mean']:.3g} of {claims} in the mean of {best['seeds']} seeds, at least {best['held_least']}, "
            f"score {best['score_mean']:.3f}"
        )
    lines["predicted"] = f"{int(left['holds'].sum())} of {claims} claims hold with the set that the others choose"
    lines["evaluations"] = str(len(evaluations))
    return lines
