"""Figures of designs: elasticities of an orbit, measures within tolerances, and what a search looked at."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from vibroplat.config.questions import DesignPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.labels import key_name, sweep_parameters
from vibroplat.plots.reading import Saved, finite, has_table
from vibroplat.plots.style import (
    BLUE,
    FAILED,
    GREEN,
    REFERENCE,
    VERMILION,
    entry,
    head,
    in_decades,
    legend_below,
    new_figure,
)
from vibroplat.plots.timelines import in_units, name_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Figures by their names, which are those of the tables that they show.
FIGURES = ("sensitivities", "samples", "evaluations")
#: Keys of which a panel has bars, at most, and panels beside each other.
MOST, ACROSS = 10, 3
#: Bars of a histogram, and letters of a line above it, whose middle must lie above the first panel.
BARS, LETTERS = 30, 88
#: Ratio of values from which on an axis is logarithmic.
WIDE = 5.0


def design_figures(directories: Sequence[Path], kinds: Collection[str] = ()) -> Iterator[tuple[Path, str, Figure]]:
    """Yield the figures of each result of ``vibroplat design``: those that its tables have, or these kinds.

    Raises
    ------
    TableError
        A table is missing or damaged.
    """
    for directory in directories:
        saved = Saved(directory, "design")
        plan = DesignPlan.model_validate(saved.given("design"))
        names = [name for name in (*FIGURES, "pareto") if has_table(directory, name)]
        tables = {name: saved.table(name) for name in names}
        for kind in kinds or [name for name in FIGURES if name in tables]:
            yield directory, kind, design_figure(directory.resolve().name, saved.known_scene, plan, tables, kind)


def design_figure(
    name: str, scene: Scene | None, plan: DesignPlan, tables: Mapping[str, pd.DataFrame], kind: str
) -> Figure:
    """Draw one of the figures of a plan's tables."""
    if kind not in tables:
        raise TableError(f"{name} holds no table {kind}; allowed: {', '.join(k for k in FIGURES if k in tables)}")
    found = {name: finite(table) for name, table in tables.items()}
    figure, told = {"sensitivities": _sensitivities, "samples": _samples}.get(kind, _evaluations)(found, plan)
    varied = list(plan.keys) if plan.minimize is not None and kind != "sensitivities" else []  # not as in the scene
    parameters = sweep_parameters(scene, varied)
    head(figure, name, "\n".join(filter(None, (parameters, told))))
    return figure


def _panels(count: int, height: float, width: float = 3.6) -> tuple[Figure, list[Axes]]:
    """Return a figure with so many panels, at least one; those left over are not drawn."""
    across = min(max(count, 1), ACROSS)
    rows = -(-max(count, 1) // across)
    figure, axes = new_figure(rows, across, (max(width * across, 5.0), height * rows + 0.9))
    panels: list[Axes] = list(axes.ravel())
    for axis in panels[max(count, 1) :]:
        axis.set_axis_off()
    return figure, panels


def _nothing(axis: Axes, why: str) -> None:
    axis.set_axis_off()
    axis.text(0.5, 0.5, why, ha="center", va="center", color=REFERENCE, transform=axis.transAxes)


def _label(column: str) -> str:
    """Return what a measure is called on an axis, with its unit."""
    from matplotlib.figure import Figure  # noqa: PLC0415  (of an axis of its own, as curves name theirs)

    return name_axis(Figure().add_subplot(), column).get_ylabel()


def _sensitivities(tables: Mapping[str, pd.DataFrame], _: DesignPlan) -> tuple[Figure, str]:
    """Draw bars of the elasticities of each measure, the largest first."""
    known = tables["sensitivities"].dropna(subset=["elasticity"])
    measures = known["measure"].unique().tolist()
    longest = min(int(known.groupby("measure").size().max()) if measures else 0, MOST)
    figure, panels = _panels(len(measures), 0.7 + 0.22 * max(longest, 4), 4.2)
    if not measures:
        _nothing(panels[0], "no measure has elasticities")
    for axis, measure in zip(panels, measures, strict=False):
        own = known[known["measure"] == measure]
        own = own.loc[own["elasticity"].abs().sort_values(ascending=False, kind="stable").index].head(MOST)
        values, places = own["elasticity"].to_numpy(float), np.arange(len(own))
        axis.barh(places, values, color=[BLUE if value > 0.0 else VERMILION for value in values], height=0.7)
        axis.set_yticks(places, [key_name(key) for key in own["key"]], fontsize=8.0)
        axis.set_ylim(longest - 0.4, -0.6)
        axis.axvline(0.0, color=REFERENCE, lw=0.8)
        axis.set_title(_label(measure).rpartition(" (")[0] or _label(measure), loc="left")
        axis.grid(visible=False, axis="y")
    for axis in panels[max(len(measures) - ACROSS, 0) : len(measures)]:
        axis.set_xlabel("change in %, for 1 % of the key")
    return figure, ""


def _samples(tables: Mapping[str, pd.DataFrame], plan: DesignPlan) -> tuple[Figure, str]:
    """Draw a histogram of each measure that varies, of samples with and without a stable orbit."""
    table = tables["samples"]
    told = tables["sensitivities"].dropna(subset=["elasticity"])["measure"].unique()  # others are round-off
    measures = [m for m in told if m in table and table[m].max() > table[m].min()]
    nominal, stable = _nominal(tables, plan), table["stable"].to_numpy(bool)
    figure, panels = _panels(len(measures), 2.4)
    if not measures:
        _nothing(panels[0], "no measure varies")
    looks = {"stable": (BLUE, stable), "unstable or lost": (VERMILION, ~stable)}
    for axis, measure in zip(panels, measures, strict=False):
        values = in_units(table[measure], measure)
        known = np.isfinite(values)
        axis.hist(
            [values[mask & known] for _, mask in looks.values()],
            bins=BARS,
            stacked=True,
            color=[colour for colour, _ in looks.values()],
        )
        if measure in nominal:
            axis.axvline(float(in_units(nominal[measure], measure)), color="black", lw=1.0, ls="--")
        axis.set_xlabel(_label(measure))
        axis.xaxis.set_major_locator(MaxNLocator(5))
    for axis in panels[: len(measures) : ACROSS]:
        axis.set_ylabel("samples")
    entries = [entry(name, color=c, marker="s", ls="") for name, (c, mask) in looks.items() if mask.any()]
    entries += [entry("nominal", color="black", lw=1.0, ls="--")] if nominal and measures else []
    legend_below(figure, entries)
    spread = [f"{key_name(key)} ±{100.0 * share:g} %" for key, share in list(plan.parameter_tolerances.items())[:MOST]]
    spread += [f"{len(plan.parameter_tolerances) - MOST} more"] if len(plan.parameter_tolerances) > MOST else []
    return figure, fill(", ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in spread), LETTERS)


def _nominal(tables: Mapping[str, pd.DataFrame], plan: DesignPlan) -> dict[str, float]:
    """Return the measures about which samples lie: those of the best design, or of the scene as given."""
    if plan.minimize is not None:
        return _best(tables["evaluations"]) or {}
    return {str(row["measure"]): float(row["value"]) for _, row in tables["sensitivities"].iterrows()}


def _best(table: pd.DataFrame) -> dict[str, float] | None:
    """Return the best design that was looked at; None if none keeps the bounds."""
    best = table[table["best"].to_numpy(bool)]
    return None if best.empty else dict(best.iloc[0].astype(float))


def _evaluations(tables: Mapping[str, pd.DataFrame], plan: DesignPlan) -> tuple[Figure, str]:
    """Draw the objective of all that was looked at over a bounded measure, with the Pareto front."""
    table, objective = tables["evaluations"], plan.minimize or ""
    across = next(
        iter([*plan.pareto, *(m for m in plan.constraints if m != "stability_margin"), *plan.constraints]), "start"
    )
    figure, axes = new_figure(1, 1, (6.4, 4.4))
    axis: Axes = axes[0, 0]
    name_axis(axis, objective)
    axis.set_xlabel("number of the start" if across == "start" else _label(across))
    kept, entries = table["feasible"].to_numpy(bool), []
    looks = {"keeps all bounds": (kept, BLUE, BLUE), "violates a bound": (~kept, REFERENCE, "white")}
    for label, (mask, colour, filling) in looks.items():
        if mask.any():
            look: dict[str, Any] = {"marker": "o", "ls": "", "color": colour, "mfc": filling, "ms": 3.6, "mew": 0.8}
            axis.plot(
                in_units(table.loc[mask, across], across), in_units(table.loc[mask, objective], objective), **look
            )
            entries.append(entry(label, **look))
    best = _best(table)
    if best is not None:
        look = {"marker": "*", "ls": "", "color": VERMILION, "ms": 11.0}
        axis.plot(in_units([best[across]], across), in_units([best[objective]], objective), zorder=4.0, **look)
        entries.append(entry("best", **look))
    if across in plan.constraints:
        axis.axvline(float(in_units(plan.bound(across)[1], across)), color=REFERENCE, lw=0.9, ls=":")
        entries.append(entry("bound", color=REFERENCE, lw=0.9, ls=":"))
    if "pareto" in tables:
        front, look = tables["pareto"].sort_values("bound"), {"color": GREEN, "marker": "D", "ms": 4.0}
        found = front[front["feasible"].to_numpy(bool)]
        axis.plot(in_units(found[across], across), in_units(found[objective], objective), zorder=3.0, **look)
        lost = in_units(front.loc[~front["feasible"].to_numpy(bool), "bound"], across)
        cross: dict[str, Any] = {"marker": "x", "ls": "", "color": FAILED, "ms": 5.0, "mew": 1.4}
        if len(lost):  # a line without points that is not clipped counts as one at the figure's corner
            axis.plot(lost, [0.0] * len(lost), clip_on=False, transform=axis.get_xaxis_transform(), **cross)
        fronts = {"Pareto front": (len(found), look), "bound that nothing keeps": (len(lost), cross)}
        entries += [entry(label, **how) for label, (count, how) in fronts.items() if count]
    if table.empty:
        _nothing(axis, "every start lost the orbit")
    for name in {across, objective} - {"start", "stability_margin"}:
        values = table[name].to_numpy(float)
        if values.size and values.min() > 0.0 and values.max() > WIDE * values.min():  # searches begin far away
            in_decades(axis, "x" if name == across else "y")
    if across == "start":
        axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    legend_below(figure, entries)
    return figure, ", ".join(f"{key_name(measure)} {bound}" for measure, bound in plan.constraints.items())
