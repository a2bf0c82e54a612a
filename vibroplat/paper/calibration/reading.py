"""What the evaluations of a calibration say: which claims are predicted, which parameters are determined."""

from __future__ import annotations

import pandas as pd

from vibroplat.paper.calibration.plan import CalibrationPlan

#: Claims that a set may hold less than the best to count among those as good.
WITHIN = 1.0
#: Columns of the spread of a parameter, and the shares of sets below them.
QUANTILES = {"least": 0.0, "lower_quartile": 0.25, "median": 0.5, "upper_quartile": 0.75, "largest": 1.0}
#: Ending of the columns of verdicts.
HOLDS = ".holds"


def claim_names(evaluations: pd.DataFrame) -> list[str]:
    """Return the claims that evaluations judge."""
    return [name.removesuffix(HOLDS) for name in evaluations.columns if name.endswith(HOLDS)]


def left_out(evaluations: pd.DataFrame, plan: CalibrationPlan) -> pd.DataFrame:
    """Choose the best set by all claims but one, and see whether it makes that one hold; a row for each claim.

    The best set is the one with which most of the other claims hold, then the one of their highest mean score. Only
    the first seed counts: the sets judged with more seeds were chosen by all claims, the left-out one among them. All
    claims have guided the search, too, so a claim that holds here is predicted less strictly than by a search without
    it.
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
    """Tell how far each parameter spreads over the sets within one claim of the best; a row for each parameter.

    ``width`` is from the least to the largest value and ``middle_width`` from the lower to the upper quartile, both as
    a share of the searched range on the scale of the search: a parameter that the claims determine is narrow. Sets are
    compared by the mean of claims held over their seeds, and each counts once.
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
    """Say in a few lines what a calibration has found."""
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
