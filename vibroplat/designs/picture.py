"""Pictures of designs: elasticities of an orbit, measures within tolerances, and the evaluations of searches."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from textwrap import fill

import numpy as np

from vibroplat.columns import display_name, indexed_name, is_angle
from vibroplat.config import digits
from vibroplat.config.circular import beyond, circular_mean, on_line
from vibroplat.config.study_plans import DesignPlan
from vibroplat.designs.answer import SAMPLED
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results import content, picture
from vibroplat.results.labels import key_name, named, sweep_parameters
from vibroplat.results.result import Result
from vibroplat.study import titles

#: Pictures by their names, which are those of the tables that they show.
OPTIONS = ()
#: Maximum number of listed tolerances, and letters of a line above the first panel, whose middle must lie above it.
MAX_LISTED, LINE_WIDTH = 10, 88
#: Ratio of values from which on an axis is logarithmic: searches begin far away.
LOG_SCALE_RATIO = 5.0
#: Label of designs that keep all bounds.
FEASIBLE = "keeps all bounds"
#: Distance of a bound from samples up to which it is drawn, over their range.
BOUND_DISTANCE = 0.3


def pictures(results: Sequence[Result], kinds: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the pictures of each result: those that its tables have, or these kinds."""
    made = []
    for result in results:
        plan = DesignPlan.model_validate(result.given("design"))
        available = [kind for kind in ("sensitivities", "samples", "evaluations") if kind in result.tables]
        for kind in kinds or available:
            if kind not in available:
                raise TableError(f"{result.name} holds no table {kind}; allowed: {', '.join(available)}")
            made.append(_MAKERS[kind](result, plan))
    return made


def _caption(result: Result, plan: DesignPlan, told: str = "") -> str:
    """Return names, the parameters of a scene without keys whose best values are not those of the scene, and more."""
    varied = [] if plan.minimize is None else list(plan.keys)
    return "\n".join(filter(None, (named([result.name], sweep_parameters(result.known_scene, varied)), told)))


def bound_of(plan: DesignPlan, name: str) -> str:
    """Return a bound in words and in the unit of its axis: "RMS y ≥ 1 mm"."""
    sign, value = plan.bound(name)
    unit, factor = digits.shown_unit(name, value)
    return f"{display_name(name)} {'≥' if sign > 0.0 else '≤'} {digits.given(factor * value)} {unit}".strip()


def _elasticities(result: Result) -> pd.DataFrame:
    """Return elasticities of measures on keys; missing ones are round-off."""
    return picture.finite(result.columns("sensitivities", ("measure", "key"), ("elasticity",)))


def _sensitivities(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return bars of the elasticities of each measure, the largest first."""
    table = _elasticities(result)
    known = table.dropna(subset=["elasticity"])
    series, facets = [], []
    for number, measure in enumerate(known["measure"].unique()):
        own = known.loc[known["measure"] == measure, "elasticity"].abs().sort_values(ascending=False, kind="stable")
        series.append(picture.Series("", own.index.to_numpy()))
        facets.append(picture.Facet(indexed_name(measure), [number]))
    return picture.Picture(
        name="sensitivities",
        heading="Elasticities",
        title=titles.sentence(result.answer.headline),
        table=table,
        table_name="sensitivities",
        axes=["elasticity"],
        panels=[
            picture.Panel(
                "key",
                kind="bars",
                label="change in %, for 1 % of the key",
                title="" if facets else "no measure has elasticities",
            )
        ],
        series=series,
        facets=facets,
        caption=_caption(result, plan),
        meaning="Relative change of the measure divided by that of a key. Blue: both grow together, orange: one falls"
        " while the other grows.",
    )


def _samples(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return samples in the order of each measure that varies, in the colours of their regimes, with bounds."""
    table = picture.finite(content.rows_in(result, "samples", ("regime",)))
    known = _elasticities(result)
    angles = known["measure"].map(is_angle)  # which have no elasticity
    asked = [m for m in known.loc[angles | known["elasticity"].notna(), "measure"].unique() if m in table]
    texts = content.content_of(table, [*asked, *(name for name in plan.constraints if name in table)])
    shown = [name for name, text in texts.items() if not text]
    nominal = _nominal(result, plan)
    panels, _ = content.measures(table, asked=shown) if shown else ([], "")
    lost = ~table["stable"].astype(bool) & ("stability_margin" in table)
    answer = [result.answer.headline, *result.answer.short]
    regimes = table["regime"].mask(lost, table["regime"] + ", orbit lost").fillna("lost")
    colours = picture.attractor_colours(regimes)
    classes = {name: (colour, name) for name, colour in colours.items()}
    spread = [f"{key_name(key)} ±{100.0 * tolerance:g} %" for key, tolerance in plan.parameter_tolerances.items()]
    spread[MAX_LISTED:] = [f"{len(spread) - MAX_LISTED} more"] if spread[MAX_LISTED:] else []
    omitted = ", ".join(filter(None, texts.values()))
    lines = [picture.Line(name, [nominal[name]], "nominal") for name in shown if pd.notna(nominal.get(name))]
    notes = dict[str, str]()
    for name in (name for name in plan.constraints if name in shown):
        notes[name] = f"{bound_of(plan, name)}: {digits.percent(float(plan.keeps(name, table[name]).mean()))} keep it"
        bound, numbers = plan.bound(name)[1], on_line(name, table[name].dropna())
        at = beyond(name, bound, circular_mean(table[name])) if is_angle(name) else bound
        low, high = (float(end) for end in (numbers.min(), numbers.max()))
        if low - BOUND_DISTANCE * (high - low) <= at <= high + BOUND_DISTANCE * (high - low):
            lines.append(picture.Line(name, [bound], "bound", "-", picture.VERMILION))
    more = (
        fill(", ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in spread), LINE_WIDTH),
        omitted and f"hardly varies: {omitted}",
    )
    return picture.Picture(
        name="samples",
        heading="Tolerances",
        title=titles.sentence(next((line for line in answer if SAMPLED in line), answer[0])),
        table=table,
        table_name="samples",
        drawn=table.assign(regime=regimes),
        axes=content.axes_of(table, (*plan.parameter_tolerances, *shown)) or ["sample"],
        panels=[
            picture.Panel(p.column, kind="ranks", by="regime", classes=classes, note=notes.get(p.column, ""))
            for p in panels
        ]
        or [picture.Panel("sample", title="no measure varies")],
        series=[picture.Series("", np.arange(len(table)) if panels else np.zeros(0, dtype=int), mode="dots")],
        lines=lines,
        caption=_caption(result, plan, "\n".join(filter(None, more))),
        meaning="Each dot is a scene within the tolerances, in the colour of its regime; rings: 5, 50 and 95 %.",
    )


def _nominal(result: Result, plan: DesignPlan) -> Mapping[str, float]:
    """Return the measures about which samples lie: those of the best design, or of the scene as given."""
    if plan.minimize is not None:
        table = result.tables["evaluations"]
        best = table[table["best"].astype(bool)]
        return {} if best.empty else {str(name): best[name].iloc[0] for name in table.select_dtypes("number")}
    return dict(zip(*(result.tables["sensitivities"][name] for name in ("measure", "value")), strict=True))


def _evaluations(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return all evaluated designs, with the best one and the Pareto front behind them."""
    aims = [column for column in (plan.minimize, *plan.constraints) if column]
    table = picture.finite(result.columns("evaluations", (), ("start", *aims)))
    feasible, best = table["feasible"].astype(bool), table[table["best"].astype(bool)].reset_index(drop=True)
    front = picture.finite(result.tables["pareto"]) if "pareto" in result.tables else table.iloc[:0].assign(bound=0.0)
    lost = ~front["feasible"].astype(bool)
    special = pd.concat([best, front], ignore_index=True) if len(front) else best
    bounded = sorted(plan.constraints, key=lambda name: (name not in plan.pareto, name == "stability_margin"))
    panels, omitted = _measures(table, aims)
    shown = [panel.column for panel in panels]
    reasons = _reasons(plan, table)
    series = [
        picture.Series(
            f"{why} ({(reasons == why).sum()})", content.rows_of(reasons == why), colour=colour, mode="markers"
        )
        for why, colour in zip(dict.fromkeys(sorted(reasons, key=FEASIBLE.__ne__)), picture.CURVES, strict=False)
    ]
    mark = picture.Mark("best", "the least that keeps all bounds", "*", [len(table)], picture.VERMILION)
    begin = len(table) + len(best)
    if len(front):
        places = range(begin, begin + len(front))
        series.append(picture.Series("Pareto front", places, colour=picture.GREEN, symbol="D"))
    # A bound that nothing keeps stands on the axis, where it is.
    bounds = front.assign(**{name: front[name].mask(lost, front["bound"]) for name in plan.pareto})
    drawn = pd.concat([part for part in (table, best, bounds) if len(part)] or [table], ignore_index=True)
    states = content.states_of(~feasible).tolist() + [0] * len(best) + content.states_of(False, lost).tolist()
    outcomes = ["ok"] * begin + ["outside the bounds" if one else "ok" for one in lost]
    everything = pd.concat([table, special], ignore_index=True).assign(outcome=outcomes)
    return picture.Picture(
        name="evaluations",
        heading="Searches",
        title=titles.sentence(result.answer.headline),
        table=table,
        table_name="evaluations",
        special=special,
        special_name="best design and Pareto front" if len(front) else "best design",
        drawn=drawn,
        axes=content.axes_of(drawn, [*bounded[:1], *sorted(shown, key=aims.__contains__), "start"]),
        panels=panels,
        series=series,
        marks=[mark] if len(best) else [],
        lines=[
            picture.Line(name, [plan.bound(name)[1]], bound_of(plan, name), ":", picture.VERMILION)
            for name in plan.constraints
        ],
        states=np.array(states, dtype=int),
        meanings=("", "", "", "bound that nothing keeps"),
        caption=_caption(result, plan, omitted),
        meaning="Filled: all bounds are kept, open: they are not.",
        orbits=picture.Orbits(everything, range(len(table), len(everything)), words="Orbit of this design."),
    )


def _reasons(plan: DesignPlan, table: pd.DataFrame) -> pd.Series:
    """Say of each evaluation that it keeps all bounds, or the first one that it violates."""
    drawn = "only as drawn, not at the ends of tolerances" if plan.parameter_tolerances else "not feasible"
    reasons = pd.Series(drawn, table.index)
    if "stability_margin" in table:
        reasons = reasons.mask(table["stability_margin"].astype(float) <= 0.0, "unstable")
    for name in reversed(plan.constraints):
        reasons = reasons.where(plan.keeps(name, table[name]), f"violates {bound_of(plan, name)}")
    return reasons.mask(table["feasible"].astype(bool), FEASIBLE)


def _measures(table: pd.DataFrame, aims: Sequence[str]) -> tuple[list[picture.Panel], str]:
    """Return the panels of all evaluated designs, the measures of the plan first, and the names of omitted measures."""
    if table.empty:
        return [picture.Panel(aims[0], title="every start lost the orbit")], ""
    others = [
        str(name) for name in table if name not in {"start", "objective", "violation", "period", "feasible", "best"}
    ]
    shown, omitted = content.measures(table, [*aims, *others])
    least, largest = table.min(numeric_only=True), table.max(numeric_only=True)
    wide = (least > 0.0) & (largest > LOG_SCALE_RATIO * least)
    return [replace(panel, scale="log" if wide[panel.column] else "linear") for panel in shown], omitted


_MAKERS: Mapping[str, Callable[[Result, DesignPlan], picture.Picture]] = {
    "sensitivities": _sensitivities,
    "samples": _samples,
    "evaluations": _evaluations,
}
