"""Pictures of designs: elasticities of an orbit, measures within tolerances, and what a search looked at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from textwrap import fill
from typing import Any

import numpy as np

from vibroplat.columns import indexed_name
from vibroplat.config.study_plans import DesignPlan
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results import picture
from vibroplat.results.labels import key_name, sweep_parameters
from vibroplat.results.result import Result

#: Pictures by their names, which are those of the tables that they show.
OPTIONS = ()
#: Tolerances that are told, at most, and letters of a line above the first panel, whose middle must lie above it.
MOST, LETTERS = 10, 88
#: Ratio of values from which on an axis is logarithmic: searches begin far away.
WIDE = 5.0


def pictures(results: Sequence[Result], kinds: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the pictures of each result: those that its tables have, or these kinds."""
    found = []
    for result in results:
        plan = DesignPlan.model_validate(result.given("design"))
        held = [kind for kind in ("sensitivities", "samples", "evaluations") if kind in result.tables]
        for kind in kinds or held:
            if kind not in held:
                raise TableError(f"{result.name} holds no table {kind}; allowed: {', '.join(held)}")
            found.append(_MAKERS[kind](result, plan))
    return found


def _told(result: Result, plan: DesignPlan, told: str = "") -> str:
    """Return the parameters of a scene, without keys whose best values are not those of the scene, and more."""
    varied = [] if plan.minimize is None else list(plan.keys)
    return "\n".join(filter(None, (sweep_parameters(result.known_scene, varied), told)))


def _elastic(result: Result) -> pd.DataFrame:
    """Return the rows of the measures that depend on keys; others are round-off."""
    found = picture.finite(result.columns("sensitivities", ("measure", "key"), ("elasticity",)))
    return found.dropna(subset=["elasticity"])


def _sensitivities(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return bars of the elasticities of each measure, the largest first."""
    table = picture.finite(result.columns("sensitivities", ("measure", "key"), ("elasticity",)))
    known = _elastic(result)
    series, facets = [], []
    for number, measure in enumerate(known["measure"].unique()):
        own = known.loc[known["measure"] == measure, "elasticity"].abs().sort_values(ascending=False, kind="stable")
        series.append(picture.Series("", own.index.to_numpy()))
        facets.append(picture.Facet(indexed_name(measure), [number]))
    return picture.Picture(
        name="sensitivities",
        heading="Elasticities",
        title=result.name,
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
        choice="measure",
        told=sweep_parameters(result.known_scene, []),
        meaning="Relative change of the measure over that of a key. Blue: both grow together, orange: one falls as the "
        "other grows.",
    )


def _samples(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return the measures that vary of samples, in the colours of their regimes."""
    table = picture.finite(picture.rows_in(result, "samples", ("regime",)))
    told = [m for m in _elastic(result)["measure"].unique() if m in table and table[m].max() > table[m].min()]
    nominal = _nominal(result, plan)
    panels = [panel for panel in picture.measures(table, told) if panel.column in told]
    regimes = table["regime"].fillna("lost").mask(~table["stable"].astype(bool), table["regime"] + ", orbit lost")
    colours = picture.attractor_colours(regimes.fillna("lost"))
    classes = {name: (colour, name) for name, colour in colours.items()}
    spread = [f"{key_name(key)} ±{100.0 * share:g} %" for key, share in list(plan.parameter_tolerances.items())[:MOST]]
    spread += [f"{len(plan.parameter_tolerances) - MOST} more"] if len(plan.parameter_tolerances) > MOST else []
    return picture.Picture(
        name="samples",
        heading="Tolerances",
        title=result.name,
        table=table,
        table_name="samples",
        drawn=table.assign(regime=regimes.fillna("lost")),
        axes=picture.axes_of(table, (*plan.parameter_tolerances, *told)) or ["sample"],
        panels=[picture.Panel(panel.column, by="regime", classes=classes, least=panel.least) for panel in panels]
        or [picture.Panel("sample", title="no measure varies")],
        series=[picture.Series("", np.arange(len(table)) if panels else np.zeros(0, dtype=int), mode="dots")],
        lines=[picture.Line(name, [nominal[name]], "nominal") for name in told if pd.notna(nominal.get(name))],
        told=_told(result, plan, fill(", ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in spread), LETTERS)),
        meaning="Each dot is a scene within the spread, in the colour of its regime. A measure drawn over itself shows "
        "how often its values occur.",
        counted=True,
    )


def _nominal(result: Result, plan: DesignPlan) -> Mapping[str, float]:
    """Return the measures about which samples lie: those of the best design, or of the scene as given."""
    if plan.minimize is not None:
        table = result.tables["evaluations"]
        best = table[table["best"].astype(bool)]
        return {} if best.empty else {str(name): best[name].iloc[0] for name in table.select_dtypes("number")}
    return dict(zip(*(result.tables["sensitivities"][name] for name in ("measure", "value")), strict=True))


def _evaluations(result: Result, plan: DesignPlan) -> picture.Picture:
    """Return all that was looked at, with the best design and the Pareto front behind it."""
    aims = [column for column in (plan.minimize, *plan.constraints) if column]
    table = picture.finite(result.columns("evaluations", (), ("start", *aims)))
    feasible, best = table["feasible"].astype(bool), table[table["best"].astype(bool)].reset_index(drop=True)
    front = picture.finite(result.tables["pareto"]) if "pareto" in result.tables else table.iloc[:0].assign(bound=0.0)
    lost = ~front["feasible"].astype(bool)
    special = pd.concat([best, front], ignore_index=True) if len(front) else best
    bounded = sorted(plan.constraints, key=lambda name: (name not in plan.pareto, name == "stability_margin"))
    panels, starts = _measures(table, aims), table["start"].unique()
    shown = [panel.column for panel in panels]
    series = [
        picture.Series(f"start {start}", picture.rows_of(table["start"] == start), colour=colour, mode="markers")
        for start, colour in zip(starts, picture.palette(len(starts)), strict=True)
    ]
    mark = picture.Mark("best", "the least that keeps all bounds", "*", [len(table)], picture.VERMILION)
    begin = len(table) + len(best)
    if len(front):
        places = range(begin, begin + len(front))
        series.append(picture.Series("Pareto front", places, colour=picture.GREEN, symbol="D"))
    # A bound that nothing keeps stands on the axis, where it is.
    bounds = front.assign(**{name: front[name].mask(lost, front["bound"]) for name in plan.pareto})
    drawn = pd.concat([part for part in (table, best, bounds) if len(part)] or [table], ignore_index=True)
    states = picture.states_of(~feasible).tolist() + [0] * len(best) + picture.states_of(False, lost).tolist()
    outcomes = ["ok"] * begin + ["outside the bounds" if one else "ok" for one in lost]
    everything = pd.concat([table, special], ignore_index=True).assign(outcome=outcomes)
    return picture.Picture(
        name="evaluations",
        heading="Searches",
        title=result.name,
        table=table,
        table_name="evaluations",
        special=special,
        special_name="best design and Pareto front" if len(front) else "best design",
        drawn=drawn,
        axes=picture.axes_of(drawn, [*bounded[:1], *sorted(shown, key=aims.__contains__), "start"]),
        panels=panels,
        series=series,
        marks=[mark] if len(best) else [],
        lines=[picture.Line(name, [plan.bound(name)[1]], "bound", ":") for name in plan.constraints],
        states=np.array(states, dtype=int),
        meanings=("keeps all bounds", "violates a bound", "", "bound that nothing keeps"),
        told=_told(result, plan, ", ".join(f"{key_name(name)} {bound}" for name, bound in plan.constraints.items())),
        meaning="Filled: all bounds are kept, open: they are not.",
        orbits=picture.Orbits(everything, range(len(table), len(everything)), words="Orbit of this design."),
    )


def _measures(table: pd.DataFrame, aims: Sequence[str]) -> list[picture.Panel]:
    """Return the panels of all that was looked at, first of what was asked about."""
    if table.empty:
        return [picture.Panel(aims[0], title="every start lost the orbit")]
    others = [str(name) for name in table if name not in {"start", "objective", "period", "feasible", "best"}]
    scales: Mapping[bool, Any] = {True: "log", False: "linear"}
    shown = picture.measures(table, [*aims, *others])
    return [replace(panel, scale=scales[_wide(table, panel.column)]) for panel in shown]


def _wide(table: pd.DataFrame, column: str) -> bool:
    """Whether the numbers of a column are positive and differ by large factors."""
    return bool(table[column].min() > 0.0 and table[column].max() > WIDE * table[column].min())


_MAKERS: Mapping[str, Callable[[Result, DesignPlan], picture.Picture]] = {
    "sensitivities": _sensitivities,
    "samples": _samples,
    "evaluations": _evaluations,
}
