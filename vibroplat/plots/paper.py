"""The paper's figures in its axes and numbering, from the tables of a reproduction alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.columns import COORDINATES, PHASE, PHASE_COLUMN, display_name, unit_of
from vibroplat.plots.pictures import draw_response, marker_legend
from vibroplat.plots.style import begin_at_zero, entry, head, new_figure
from vibroplat.plots.timelines import FloatArray, in_units
from vibroplat.results.picture import BLACK, BLUE, GREEN, ORANGE, PURPLE, REFERENCE, VERMILION, finite
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.bands import find_jumps
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
#: Least change at a jump that is shown, over the range of the quantity.
VISIBLE = 0.02
#: The paper's symbols of the RMS.
_SYMBOLS = {
    "rms_y_m": r"$\widetilde{A}_y$ (mm)",
    "rms_x_m": r"$\widetilde{A}_x$ (mm)",
    "rms_phi_rad": r"$\widetilde{A}_\varphi$ (mrad)",
    PHASE_COLUMN: PHASE,
}


def paper_figures(directories: Sequence[Path], _: Sequence[str] = ()) -> Iterator[tuple[Path, str, Figure]]:
    """Draw Figs. 2–7 from the tables of reproductions; yield the directory and the name of each."""
    for directory in directories:
        result = Result.read(directory, "paper")
        for name, draw in FIGURES.items():
            yield directory, name, draw(result)


def _table(result: Result, name: str) -> pd.DataFrame:
    """Read a table of the reproduction as axes can show it."""
    return finite(result.table(name))


def _branches(axis: Axes, table: pd.DataFrame, column: str, colour: str, size: float = 1.0) -> None:
    """Draw the branches of a quantity over f, with a vertical arrow at each jump."""
    for _, rows in table.groupby("direction", sort=False):
        draw_response(axis, rows, column, color=colour, size=size)
        _arrows(axis, rows, column, colour)
    axis.set_ylabel(_SYMBOLS[column])


def _arrows(axis: Axes, rows: pd.DataFrame, column: str, colour: str) -> None:
    """Draw jumps as vertical arrows, from the last point before to the height of the first one after.

    A dotted line leads on to that point. Where a quantity does not change visibly there is no arrow.
    """
    f, values = rows[EXCITATION].to_numpy(dtype=float), in_units(rows[column], column)
    up = rows["direction"].iloc[0] != "down"
    arrow = {"arrowstyle": "->", "color": colour, "lw": 0.6, "ls": "-" if up else "--", "shrinkA": 0.0, "shrinkB": 0.0}
    known = [0.0, 2.0 * np.pi] if column == PHASE_COLUMN else [0.0, *values[np.isfinite(values)]]
    least = VISIBLE * float(np.ptp(known))
    for i in np.flatnonzero(find_jumps(rows)):
        if abs(values[i + 1] - values[i]) > least:
            axis.annotate("", (f[i], values[i + 1]), (f[i], values[i]), arrowprops=arrow)
            axis.hlines(values[i + 1], min(f[i : i + 2]), max(f[i : i + 2]), colors=colour, ls=":", lw=0.6)


class Panel(NamedTuple):
    """A panel over f: its title, its quantity, its curves (points, colour, size) and its share of the height."""

    title: str
    column: str
    curves: Sequence[tuple[pd.DataFrame, str, float]]
    height: float = 1.0


def _over_frequency(height: float, panels: Sequence[Panel], names: Curves = ()) -> Figure:
    """Draw panels over f in a figure of a height (inch); below it are the names of curves and markers."""
    figure, axes = new_figure(len(panels), 1, (8.0, height), sharex=True, height_ratios=[p.height for p in panels])
    for axis, panel in zip(axes[:, 0], panels, strict=True):
        for rows, colour, size in panel.curves:
            _branches(axis, rows, panel.column, colour, size)
        if panel.column != PHASE_COLUMN:
            begin_at_zero(axis)
        axis.set_title(panel.title, loc="left")
    axes[-1, 0].set_xlabel("$f$ (Hz)")
    head(figure, _largest(panels[0]))
    handles = [entry(name, color=colour, lw=2.0) for name, colour in names]
    markers = marker_legend(pd.concat([rows for panel in panels for rows, _, _ in panel.curves]))
    figure.legend(handles=[*handles, *markers], loc="outside lower center", ncols=4)
    return figure


def _largest(panel: Panel) -> str:
    """Say the largest value of each curve of a panel, and where it is."""
    known = [rows.dropna(subset=[panel.column]).sort_values(panel.column) for rows, *_ in panel.curves]
    best = [rows.iloc[-1] for rows in known if len(rows)]
    if not best:
        return "Every point failed"
    largest = titles.several([float(row[panel.column]) for row in best], unit_of(panel.column))
    where = titles.place(EXCITATION, [float(row[EXCITATION]) for row in best])
    return f"{display_name(panel.column)} at most {largest} at {where}"


def _fig2(result: Result) -> Figure:
    curves = [(_table(result, "fig2"), MASSES[0.0], 1.0)]
    titles = [r"Fig. 2(a). $\mu_w$ = 0", "", "", "Fig. 2(b)"]
    return _over_frequency(8.6, [Panel(title, column, curves) for title, column in zip(titles, _SYMBOLS, strict=True)])


def _fig3(result: Result) -> Figure:
    table = _table(result, "fig3")
    curves = [(table[table["material.mass_ratio"] == mass], colour) for mass, colour in MASSES.items()]
    sized = [(rows, colour, 1.4 - 0.3 * i) for i, (rows, colour) in enumerate(curves)]
    phases = [
        Panel(f"Fig. 3(b). {name}", PHASE_COLUMN, [(rows, colour, 1.0)], 1.2)
        for (name, _), (rows, colour) in zip(_MASS_CURVES, curves, strict=True)
    ]
    return _over_frequency(9.0, [Panel("Fig. 3(a). $R$ = 0", "rms_y_m", sized, 3.0), *phases], _MASS_CURVES)


def _fig6(result: Result) -> Figure:
    table = _table(result, "fig6")
    shown = [table[table["contact.restitution"] == r] for r in RESTITUTIONS]
    if "fig6-nonimpact" in result.tables:
        shown.append(_table(result, "fig6-nonimpact"))
    curves = [
        (rows[rows["direction"] == "up"], colour, 1.5 - 0.25 * i)
        for i, (rows, (_, colour)) in enumerate(zip(shown, _MODEL_CURVES, strict=False))
    ]
    return _over_frequency(5.0, [Panel(r"Fig. 6. $\mu_w$ = 0.2", "rms_y_m", curves)], _MODEL_CURVES[: len(curves)])


def history(name: str, column: str, curves: Curves, title: str, *, near: float = 0.0) -> Callable[[Result], Figure]:
    """Make a drawer of time histories, a panel for each of the paper's frequencies.

    Parameters
    ----------
    name
        Of the table, and of the figure.
    column
        What is drawn.
    curves, title
        Names and colours of the curves, and what they have in common.
    near
        Differences from the first curve that stay below this share of its amplitude are drawn below.
    """

    def draw(result: Result) -> Figure:
        table, quantity = _table(result, name), COORDINATES[column]
        panels = [table[table["panel"] == panel] for panel in dict.fromkeys(table["panel"])]
        beside = [_differences(rows, column, near) for rows in panels]
        heights = [h for found in beside for h in ([2.2, 1.0] if found else [2.2])]
        figure, axes = new_figure(len(heights), 1, (8.0, 1.2 + 0.95 * sum(heights)), height_ratios=heights)
        left = iter(axes[:, 0])
        for letter, rows, found in zip("abcd", panels, beside, strict=False):
            axis = next(left)
            for number, curve in _curves(rows).items():  # the first ones are wider, visible below the others
                label, colour = curves[number - 1]
                look = {"lw": 1.6 - 0.3 * (number - 1), "color": colour, "label": label}
                axis.plot(1e3 * curve["t_s"], quantity.factor * curve[column], **look)
            axis.set_ylabel(quantity.label)
            shown = " … ".join(dict.fromkeys(f"{f:.2f}" for f in (rows[EXCITATION].min(), rows[EXCITATION].max())))
            axis.set_title(f"Fig. {name[3:]}({letter}). {title}, $f$ = {shown} Hz", loc="left")
            if found:
                below = next(left)
                below.axhline(0.0, color=REFERENCE, lw=0.6)
                for number, (times, change) in found.items():
                    below.plot(1e3 * times, quantity.factor * change, lw=0.9, color=curves[number - 1][1])
                below.set_ylabel(f"{', '.join(map(str, found))} minus 1\n(mm)", fontsize=8.5)
                below.sharex(axis)
                axis.tick_params(labelbottom=False)
        axes[-1, 0].set_xlabel("time (ms)")
        head(figure, _heights(panels, column))
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        return figure

    return draw


def _heights(panels: Sequence[pd.DataFrame], column: str) -> str:
    """Say from the least to the largest value of each curve, by panels."""
    told = []
    for rows in panels:
        ranges = [float(curve[column].max() - curve[column].min()) for curve in _curves(rows).values()]
        where = titles.place(EXCITATION, rows[EXCITATION])
        told.append(f"{titles.several(ranges, unit_of(column))}{f' at {where}' if where else ''}")
    return f"{display_name(column)} peak to peak {'; '.join(told)}"


def _curves(rows: pd.DataFrame) -> dict[int, pd.DataFrame]:
    """Return the curves of a panel by their numbers."""
    return {int(str(number)): curve for number, curve in rows.groupby("curve")}


def _differences(rows: pd.DataFrame, column: str, near: float) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return times (s) and differences from the first curve where these stay below a share of its amplitude."""
    curves = _curves(rows)
    first = curves.pop(min(curves))
    times = first["t_s"].to_numpy()
    amplitude = 0.5 * float(np.ptp(first[column]))
    found = {}
    for number, curve in curves.items():
        shown = times[times <= curve["t_s"].max()]
        change = np.interp(shown, curve["t_s"], curve[column]) - first[column].to_numpy()[: len(shown)]
        if np.abs(change).max() <= near * amplitude:
            found[number] = (shown, change)
    return found


#: By the name of the file.
FIGURES: dict[str, Callable[[Result], Figure]] = {
    "fig2": _fig2,
    "fig3": _fig3,
    "fig4": history("fig4", "y_m", _MASS_CURVES, "$R$ = 0", near=0.5),
    "fig5": history("fig5", "gap_m", _MASS_CURVES[:2], "$R$ = 0"),
    "fig6": _fig6,
    "fig7": history("fig7", "y_m", _MODEL_CURVES, r"$\mu_w$ = 0.2", near=0.2),
}
