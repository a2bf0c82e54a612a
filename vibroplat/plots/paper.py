"""The paper's figures in its axes and numbering, from the tables of a reproduction alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import PHASE, PHASE_COLUMN, display_name, unit_of
from vibroplat.results.content import motions_of
from vibroplat.results.picture import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILION,
    Jump,
    Panel,
    Picture,
    Series,
    finite,
)
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.branches import EXCITATION
from vibroplat.study.curves import curves_of
from vibroplat.study.sweeps import Sweeps, grid_of, key_of

OPTIONS = ()
#: One colour for each mass ratio, and one for each model of contact at the mass ratio 0.2, in all figures.
MASSES = {0.1: BLUE, 0.2: VERMILION, 0.0: BLACK}
RESTITUTIONS = {0.0: VERMILION, 0.3: ORANGE, 0.5: PURPLE}
NON_IMPACT = GREEN
#: Names and colours of curves, in the paper's numbering.
Curves = Sequence[tuple[str, str]]
_MASS_CURVES: Curves = [(rf"{i} – $\mu_w$ = {mass:g}", colour) for i, (mass, colour) in enumerate(MASSES.items(), 1)]
_MODEL_CURVES: Curves = [
    *((f"{i} – $R$ = {r:g}", colour) for i, (r, colour) in enumerate(RESTITUTIONS.items(), 1)),
    ("4 – non-impact", NON_IMPACT),
]
#: The paper's symbols.
_SYMBOLS = {
    "rms_y_m": r"$\widetilde{A}_y$",
    "rms_x_m": r"$\widetilde{A}_x$",
    "rms_phi_rad": r"$\widetilde{A}_\varphi$",
    PHASE_COLUMN: PHASE,
}


def pictures(results: Sequence[Result], _: Sequence[str] = ()) -> Iterator[Picture]:
    """Yield Figs. 2–7 of reproductions."""
    yield from (picture(result) for result in results for picture in FIGURES.values())


@dataclass
class _PaperFigure:
    """Collects the points of curves, one behind the other, with panels, series and jumps."""

    name: str
    parts: list[pd.DataFrame] = field(default_factory=list)
    panels: list[Panel] = field(default_factory=list)
    series: list[Series] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)

    def add(self, table: pd.DataFrame) -> pd.DataFrame:
        """Add points, and return them with their places as their index."""
        begin = sum(map(len, self.parts))
        self.parts.append(table.set_axis(range(begin, begin + len(table))))
        return self.parts[-1]

    def panel(self, title: str, column: str, curves: Sequence[tuple[pd.DataFrame, str, str]], **look: Any) -> None:
        """Add a panel of branches over f; curves have points, a name and a colour, the first ones are wide."""
        for number, (rows, name, colour) in enumerate(curves):
            sweeps = Sweeps([], [], self.add(rows), key_of(rows), grid_of(rows), EXCITATION)
            series, jumps = curves_of(sweeps, [column], {"": colour}, mark_aperiodic=True)
            wide: dict[str, Any] = {"label": name, "of": (title,), "width": 1.4 - 0.25 * number}
            self.series += [
                replace(one, **wide) if one.mode == "lines" else replace(one, of=(title,)) for one in series
            ]
            self.jumps += [jump._replace(of=(title,)) for jump in jumps]
        least = None if column == PHASE_COLUMN else 0.0
        self.panels.append(Panel(column, label=_SYMBOLS[column], title=title, least=least, **look))

    def times(self, title: str, column: str, curves: Sequence[tuple[pd.DataFrame, str, str]], **look: Any) -> None:
        """Add a panel over time."""
        for number, (rows, name, colour) in enumerate(curves):
            places = self.add(rows).index.to_numpy()
            self.series.append(Series(name, places, "", colour, "lines", width=1.6 - 0.3 * number, of=(title,)))
        self.panels.append(Panel(column, "t_s", title=title, **look))

    def picture(self, title: str, x: str = EXCITATION) -> Picture:
        """Return the picture."""
        table = pd.concat(self.parts)
        return Picture(
            name=self.name,
            heading=self.name,
            title=title,
            table=table,
            table_name=self.name,
            axes=[x],
            panels=self.panels,
            series=self.series,
            jumps=self.jumps,
            states=motions_of(table),
        )


def _largest(column: str, curves: Sequence[tuple[pd.DataFrame, str, str]]) -> str:
    """Say the largest value of each curve, and where it is."""
    known = [rows.dropna(subset=[column]).sort_values(column) for rows, *_ in curves]
    best = [rows.iloc[-1] for rows in known if len(rows)]
    if not best:
        return "Every point failed"
    largest = titles.several([float(row[column]) for row in best], unit_of(column))
    return f"Largest {display_name(column)} {largest} at {titles.place(EXCITATION, [row[EXCITATION] for row in best])}"


def _fig2(result: Result) -> Picture:
    figure, curves = _PaperFigure("fig2"), [(finite(result.table("fig2")), "", MASSES[0.0])]
    for column, title in zip(_SYMBOLS, (r"Fig. 2(a). $\mu_w$ = 0", "2(a), x", "2(a), φ", "Fig. 2(b)"), strict=True):
        figure.panel(title, column, curves)
    return figure.picture(_largest("rms_y_m", curves))


def _fig3(result: Result) -> Picture:
    figure, table = _PaperFigure("fig3"), finite(result.table("fig3"))
    curves = [
        (table[table["material.mass_ratio"] == mass], *named) for mass, named in zip(MASSES, _MASS_CURVES, strict=True)
    ]
    figure.panel("Fig. 3(a). $R$ = 0", "rms_y_m", curves, height=2.0)
    for curve in curves:
        figure.panel(f"Fig. 3(b). {curve[1]}", PHASE_COLUMN, [curve])
    return figure.picture(_largest("rms_y_m", curves))


def _fig6(result: Result) -> Picture:
    figure, table = _PaperFigure("fig6"), finite(result.table("fig6"))
    shown = [table[table["contact.restitution"] == r] for r in RESTITUTIONS]
    if "fig6-nonimpact" in result.tables:
        shown.append(finite(result.table("fig6-nonimpact")))
    curves = [(rows[rows["direction"] == "up"], *named) for rows, named in zip(shown, _MODEL_CURVES, strict=False)]
    figure.panel(r"Fig. 6. $\mu_w$ = 0.2", "rms_y_m", curves)
    return figure.picture(_largest("rms_y_m", curves))


def history(name: str, column: str, curves: Curves, title: str, *, near: float = 0.0) -> Callable[[Result], Picture]:
    """Make a function that returns the picture of time histories, a panel for each of the paper's frequencies.

    Parameters
    ----------
    name
        Of the table, and of the figure.
    column
        What is drawn.
    curves, title
        Names and colours of the curves, and what they have in common.
    near
        Differences from the first curve that stay below this fraction of its amplitude are drawn below.
    """

    def draw(result: Result) -> Picture:
        figure, table, lines = _PaperFigure(name), finite(result.table(name)), list[str]()
        for letter, (_, rows) in zip("abcd", table.groupby("panel", sort=False), strict=False):
            own = {int(str(number)): curve for number, curve in rows.groupby("curve")}
            begin, where = f"Fig. {name[3:]}({letter})", titles.place(EXCITATION, rows[EXCITATION])
            shown = [(curve, *curves[number - 1]) for number, curve in own.items()]
            figure.times(". ".join((begin, ", ".join(filter(None, (title, where))))), column, shown)
            if differences := _differences(own, column, near):
                names = ", ".join(map(str, differences))
                changes = [(change, *curves[number - 1]) for number, change in differences.items()]
                figure.times(f"{begin}, {names} minus {min(own)}", column, changes, height=0.6)
            sizes = [float(np.ptp(curve[column])) for curve in own.values()]
            lines.append(titles.several(sizes, unit_of(column)) + (f" at {where}" if where else ""))
        return figure.picture(f"{display_name(column)} peak to peak {'; '.join(lines)}", "t_s")

    return draw


def _differences(curves: dict[int, pd.DataFrame], column: str, near: float) -> dict[int, pd.DataFrame]:
    """Return differences from the first curve where these stay below a fraction of its amplitude."""
    first, differences = curves[min(curves)], {}
    for number, curve in curves.items():
        shown = first[first["t_s"] <= curve["t_s"].max()]
        change = np.interp(shown["t_s"], curve["t_s"], curve[column]) - shown[column]
        if number != min(curves) and change.abs().max() <= near * 0.5 * float(np.ptp(first[column])):
            differences[number] = shown.assign(**{column: change})
    return differences


#: By the name of the file.
FIGURES: dict[str, Callable[[Result], Picture]] = {
    "fig2": _fig2,
    "fig3": _fig3,
    "fig4": history("fig4", "y_m", _MASS_CURVES, "$R$ = 0", near=0.5),
    "fig5": history("fig5", "gap_m", _MASS_CURVES[:2], "$R$ = 0"),
    "fig6": _fig6,
    "fig7": history("fig7", "y_m", _MODEL_CURVES, r"$\mu_w$ = 0.2", near=0.2),
}
