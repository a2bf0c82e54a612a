"""Curves of runs: the panels of their printed figures, and of a few more pictures, drawn on the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vibroplat.columns import FORCES
from vibroplat.measured.data import Measured
from vibroplat.page.panels import entry_html, points, strips
from vibroplat.page.run import ShownRun
from vibroplat.page.svg import Plot
from vibroplat.page.view import View, axis_name, heading, places_of
from vibroplat.plots.histories import FURTHER, POWERS
from vibroplat.plots.run import FIGURES, missing, of_both
from vibroplat.plots.run_picture import RunPicture, beside, curve
from vibroplat.results.labels import capital
from vibroplat.results.legend import legend_of
from vibroplat.results.picture import VERMILION, Facet, Panel, Picture
from vibroplat.results.run import RunResult

#: Shortest time from the beginning of a run in which its start is shown (s).
START = 1.0
#: Name of the curve of the underside of the material.
_UNDERSIDE = "underside of the material"


class Runs:
    """Draws the curves of some runs.

    Parameters
    ----------
    runs
        What the page shows of each.
    names
        Names of the runs, if there are several.
    """

    def __init__(self, runs: Sequence[ShownRun], names: Sequence[str]) -> None:
        self.runs = runs
        shown = RunPicture([one.tables for one in runs], None, names if len(names) > 1 else ())
        kinds = [kind for kind in FIGURES if not missing(kind, shown)]
        self.platform = _platform(shown.anew(), runs[0].main)
        self.pictures = {kind: FIGURES[kind](shown.anew()) for kind in kinds} | {"further": _further(shown.anew())}

    def key_figures(self) -> str:
        """Return the curves that matter: the force into the foundation over the run, and the platform's last turns."""
        loads = self.pictures["loads"]
        force = [plot for panel in loads.panels if panel.column in FORCES for plot in _plots(loads, panel)]
        return "".join(plot.html() for plot in (*force[:1], *_plots(self.platform, self.platform.panels[0])))

    def starts(self) -> str:
        """Return the speeds of a run whose exciters start or stop, until its stroke is steady; "" of others."""
        (run,) = self.runs
        speeds = run.tables.envelope[[f"speed_{n}_hz:{end}" for n in (1, 2) for end in ("min", "max")]]
        if not max(float(np.ptp(speeds.iloc[:, at : at + 2])) for at in (0, 2)) > 0.1 * (run.frequency or 0.0):
            return ""
        exciters = self.pictures["exciters"]
        until = math.inf if run.steady is None else max(run.steady, run.first + START)
        times = exciters.table["t_s"].where(exciters.table["t_s"] <= until)
        plot = _plots(replace(exciters, table=exciters.table.assign(t_s=times)), exciters.panels[0])[0]
        plot.title = "Speed" if run.steady is None else "Speed until the stroke is steady"
        plot.height = "--h:150px"
        return plot.html()

    def all_figures(self) -> tuple[str, int]:
        """Return the curves of all quantities, the whole run and the last turns in pairs, and how many these are."""
        known: dict[tuple[str, str], list[Plot]] = {}
        bands = ""
        for picture in self.pictures.values():
            for panel in picture.panels:
                key = panel.column, picture.axes[0]
                known[key] = max(known.get(key, []), _plots(picture, panel), key=len)
            bands += "".join(strips(_view(picture)))
        drawn = [[plot.html() for plot in plots] for plots in known.values() if plots]
        pairs, singles = ("".join("".join(of) for of in drawn if (len(of) > 1) == two) for two in (True, False))
        html = f'<div class="pair">{pairs}</div><div class="panels">{singles}{bands}</div>'
        return html, len(drawn)


def beside_measured(
    data: Measured, results: Sequence[RunResult], names: Sequence[str], start: float | None, stop: float | None
) -> str:
    """Return the curves of measured data and of runs, and compare them."""
    shown = RunPicture(beside(data, results, start, stop), data, names if len(names) > 1 else ())
    picture = FIGURES["measured"](shown)
    return "".join(plot.html() for panel in picture.panels for plot in _plots(picture, panel))


def _platform(shown: RunPicture, main: str) -> Picture:
    """Show the largest motion of the platform in the last turns, and the underside of the material."""
    for run in shown.runs:
        last, look = shown.last(run), dict[str, Any](of=(main,))
        shown.draw(last[["t_s", main]], shown.called(run, "platform"), colour=shown.colour(run, main), **look)
        if main == "y_m" and "gap_m" in last:
            look |= {"dash": "--", "look": _UNDERSIDE} if shown.names else {}
            colour = shown.colour(run, "gap_m") if shown.names else VERMILION
            under = last[["t_s"]].assign(y_m=last["y_m"] + last["gap_m"])
            shown.draw(under, shown.called(run, _UNDERSIDE), colour=colour, **look)
    found = shown.picture("motion", [shown.panel(main)])
    return replace(found, facets=found.facets[-1:])


def _further(shown: RunPicture) -> Picture:
    """Show what no printed figure has: upper layer, contact force of the whole run, powers of the motors."""
    panels = []
    for column, label in ((FURTHER, "upper layer relative to the lower one"), ("contact_force_n", "")):
        for run in (run for run in shown.runs if column in run.shown):
            curve(shown, run, column, label=shown.called(run))
        panels.append(Panel(column, label=label))
    of_both(shown, POWERS, "motor_power_w", "motor")
    return shown.picture("further", [*panels, Panel("motor_power_w")])


def _view(picture: Picture) -> View:
    """Return a picture over its axis, whose points are no rows of a table on the page, with texts next to points."""
    words = [word for word in picture.words if word.beside]
    return View(replace(picture, words=words), picture.axes[0], np.full(len(picture.points) + 1, -1))


def _plots(picture: Picture, panel: Panel) -> list[Plot]:
    """Return the drawings of a panel: of the whole run and of its last turns, or of the curves that there are."""
    view, plots, usual = _view(picture), [], axis_name(panel.column)
    name = heading(panel, whole=True)
    name = name if name[1:2] in ("", " ") else capital(name)  # symbols keep their letters
    values = view.values(panel.column)
    for facet in picture.facets or [Facet("", range(len(picture.series)))]:
        of = [picture.series[n] for n in facet.series if panel.has(picture.series[n].of)]
        shown = [replace(one, label=one.label or usual * (one.mode != "markers")) for one in of]
        if np.isfinite(values[places_of(shown)]).any():
            plot = points(view, panel, shown)
            plot.look = ""
            plot.title = ", ".join(filter(None, (name, facet.label.partition(":")[0])))
            named = [one for one in shown if one.mode != "shade"]
            entries = legend_of(replace(picture, panels=(), lines=(), series=named))
            plot.key = [*map(entry_html, entries)] if len(entries) > 1 or " = " in entries[0].text else ()
            plots.append(plot)
    return plots
