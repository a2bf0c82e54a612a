"""Curves of runs: the range of each turn, pale, over the whole run, and the last turns beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vibroplat.config.digits import NEGLIGIBLE, quantity
from vibroplat.page.run import EXCITERS, LAST_TURNS, PANELS, RunCurves, accelerations
from vibroplat.page.svg import Floats, Plot, Scale
from vibroplat.page.tables import hint
from vibroplat.results.picture import CURVES, ORANGE, VERMILION

#: Difference, over their range, up to which two curves are one.
COINCIDE = 0.015
#: Width of a band, over the range of the curve, up to which it is a line.
LINE_WIDTH = 0.02
#: The same of speeds, which change within a turn while exciters start.
SPEED_WIDTH = 0.25
#: What lines with these dashes are called.
DASHES = {"6 3": "dashed", "2 3": "dotted"}
#: Least time from the beginning of a run in which its start is shown (s).
START = 1.0
#: Colours of the curves of a panel: along y blue, along x orange.
_COLOURS = {
    "x_m": ORANGE,
    "force_x_n": ORANGE,
    "underside_m": VERMILION,
    "contact_force_n": VERMILION,
    "gap_m": VERMILION,
}


class RunLine(NamedTuple):
    """A curve of a panel: its look, times (s), smallest and largest values; one array is both."""

    name: str
    colour: str
    dash: str
    t: Floats
    low: Floats
    high: Floats


class Runs:
    """Draws the curves of some runs.

    Parameters
    ----------
    run_curves
        What the page shows of each.
    names
        What they are called, where there are several.
    """

    def __init__(self, run_curves: Sequence[RunCurves], names: Sequence[str]) -> None:
        self.names = names if len(names) > 1 else [""]
        self.chosen = any(one.detail["t_s"].iloc[-1] < one.last - 1e-9 for one in run_curves)
        shortest = min(float(np.ptp(one.detail["t_s"])) for one in run_curves)
        self.run_curves = run_curves if self.chosen else [one.in_last(shortest) for one in run_curves]
        known = all(one.detail["t_s"].iloc[0] > one.first for one in run_curves)
        #: What the detail is called.
        whole = "whole run" if len(names) == 1 else f"last {quantity(shortest, 's')}"
        self.last = "interval" if self.chosen else f"last {LAST_TURNS} turns" if known else whole

    # -- drawings -----------------------------------------------------------------------------------

    def _origin(self, curves: RunCurves, *, detail: bool) -> float:
        """Return the time (s) from which those of a drawing are counted."""
        return float(curves.detail["t_s"].iloc[0]) if detail and not self.chosen else 0.0

    def _time(self, first: float, last: float, *, detail: bool) -> Scale:
        """Return an axis of times."""
        return Scale(first, last, *(("ms", 1e3) if detail and not self.chosen else ("s", 1.0)), label="time")

    def _lines(self, columns: Mapping[str, str], *, detail: bool = False, until: float = math.inf) -> list[RunLine]:
        """Return curves of the detail, or their ranges over the runs up to a time (s).

        Of several runs each has a colour, of one run each of its curves.
        """
        lines = []
        for run, (curves, name) in enumerate(zip(self.run_curves, self.names, strict=True)):
            for number, (column, label) in enumerate(columns.items()):
                parts = curves.turns(column) if detail else curves.band(column, until)
                if parts is not None:
                    own = _COLOURS.get(column, CURVES[number % len(CURVES)])
                    dash = "2 3" if column == "synchronous_hz" else "6 3" if name and number else ""
                    called = ", ".join(filter(None, (name, label if len(columns) > 1 else ""))) or label
                    t = parts[0] - self._origin(curves, detail=detail)
                    lines.append(RunLine(called, CURVES[run % len(CURVES)] if name else own, dash, t, *parts[1:]))
        return one_line(lines)

    def _drawn(self, title: str, lines: Sequence[RunLine], columns: Mapping[str, str], *, detail: bool = False) -> Plot:
        """Return a drawing of curves over time; a wide range is a band."""
        column = next(iter(columns))
        t = np.concatenate([line.t for line in lines])
        values = np.concatenate([part for line in lines for part in (line.low, line.high)])
        is_speed = column.startswith("speed")
        narrow = SPEED_WIDTH if is_speed else LINE_WIDTH
        y = Scale.of(values, column, least=0.0 if is_speed and not detail else None)
        plot = Plot(title, self._time(float(t.min()), float(t.max()), detail=detail), y)
        span = float(np.nanmax(values) - np.nanmin(values)) or 1.0
        for line in lines:
            if line.low is not line.high and np.nanmax(line.high - line.low) > narrow * span:
                plot.band(line.t, line.low, line.high, line.name, line.colour)
            else:
                plot.curve(line.t, 0.5 * (line.low + line.high), line.name, line.colour, dash=line.dash)
        plot.key = [(line.name, line.colour) for line in lines] if len(lines) > 1 or " = " in lines[0].name else []
        if self.names[0] and len(columns) > 1:  # a colour is a run, and dashes tell its curves apart
            solid, *others = columns.values()
            plot.key = [(line.name.replace(f", {solid}", ""), line.colour) for line in lines if not line.dash]
            dashes = {label: line.dash for line in lines for label in others if line.name.endswith(f", {label}")}
            plot.note = "; ".join(f"{DASHES[dash]}: {label}" for label, dash in dashes.items() if dash)
        return plot

    # -- figures ------------------------------------------------------------------------------------

    def key_figures(self) -> str:
        """Return the curves that matter: the force into the foundation over the run, and the platform's last turns."""
        html = ""
        if force := self._lines(PANELS[0][1]):
            shown = "whole run" if any(curves.few for curves in self.run_curves) else "each turn of the run"
            plot = self._drawn(f"Force into the foundation, y: {shown}", force, PANELS[0][1])
            self._mark_largest(plot, force)
            html += plot.html()
        main = self.run_curves[0].main
        columns = {main: "platform"} | ({"underside_m": "underside of the material"} if main == "y_m" else {})
        if lines := self._lines(columns, detail=True):
            words = {"y_m": "Platform y", "x_m": "Platform x", "phi_rad": "Rotation"}[main]
            if main == "y_m" and any("underside_m" in one.detail for one in self.run_curves):
                words = "Platform and material"
            html += self._drawn(f"{words}, {self.last}", lines, columns, detail=True).html()
        return html

    def starts(self) -> str:
        """Return the speeds of a run whose exciters start or stop, until its stroke is steady; "" of others."""
        (curves,) = self.run_curves
        if not any(curves.size(f"speed_{n}_hz") > 0.1 * (curves.frequency or 0.0) for n in (1, 2)):
            return ""
        until = math.inf if curves.steady is None else max(curves.steady, curves.first + START)
        title = "Speed, whole run" if curves.steady is None else "Speed until the stroke is steady"
        plot = self._drawn(title, self._lines(EXCITERS, until=until), EXCITERS)
        plot.height = "--h:150px"
        return plot.html()

    def _mark_largest(self, plot: Plot, lines: Sequence[RunLine]) -> None:
        """Mark the static force of a single run, and the largest force of all with its time."""
        size, at = "whole_foundation_force_y_max_n", "whole_foundation_force_y_max_at_s"
        summaries = [curves.result.summary for curves in self.run_curves]
        static, machine = summaries[0].get("foundation_force_y_mean_n"), self.run_curves[0].result.scene.machine
        if static is not None and machine.gravity_m_per_s2 and len(summaries) == 1:
            plot.rule("static", y=-static)
        known = [s for s in summaries if s.get(size) and s.get(at) is not None]
        if known:
            largest = max(known, key=lambda s: float(s[size]))
            upwards = max(np.nanmax(one.high) for one in lines) >= -min(np.nanmin(one.low) for one in lines)
            height = largest[size] if upwards else -largest[size]
            plot.mark(largest[at], height, f"{quantity(largest[size], 'N')} at {quantity(largest[at], 's')}")

    def all_figures(self) -> tuple[str, int, list[str]]:
        """Return all curves in pairs, how many quantities these are, and what has nothing to show."""
        pairs, none = [], []
        measured = {place: label for one in self.run_curves for place, label in accelerations(one.result.scene).items()}
        for title, columns in (*PANELS, *[("Acceleration", measured)] * bool(self._lines(measured))):
            whole, detail = self._lines(columns), self._lines(columns, detail=True)
            if not whole or not any(self._matters(one, column) for one in self.run_curves for column in columns):
                none.append(title[0].lower() + title[1:])
                continue
            right = hint(f"{self.last.capitalize()}: 0")
            if not self._rests(whole, detail):
                right = self._drawn(self.last.capitalize(), detail, columns, detail=True).html() if detail else ""
            pairs.append(self._drawn(f"{title}, whole run", whole, columns).html() + right)
        if any(len(one.impulses) for one in self.run_curves):
            pairs.append(self._impulses(detail=False) + self._impulses(detail=True))
        return "".join(pairs), len(pairs), none

    def _rests(self, whole: list[RunLine], detail: list[RunLine]) -> bool:
        """Whether curves that swing about 0 hardly do so in the detail."""
        most = max(max(abs(np.nanmin(one.low)), abs(np.nanmax(one.high))) for one in whole)
        return bool(detail) and all(np.nanmax(np.abs(one.low)) < NEGLIGIBLE * most for one in detail)

    def _matters(self, curves: RunCurves, column: str) -> bool:
        """Whether a curve has content beside the largest one of its kind."""
        arms = {"phi_rad": curves.result.scene.body.distance}
        kinds = (("x_m", "y_m", "phi_rad"), ("force_x_n", "force_y_n"))
        alike = next((kind for kind in kinds if column in kind), ())
        largest = max((arms.get(name, 1.0) * curves.size(name) for name in alike), default=0.0)
        return arms.get(column, 1.0) * curves.size(column) > NEGLIGIBLE * largest

    def _impulses(self, *, detail: bool) -> str:
        """Return the impulses of all impacts of the runs, or of their last turns."""
        struck, ends = [], []
        for one in self.run_curves:
            origin = self._origin(one, detail=detail)
            first, last = one.detail["t_s"].iloc[[0, -1]] if detail else (one.first, one.last)
            ends += [float(first) - origin, float(last) - origin]
            inside = one.impulses[one.impulses["t_s"].between(first, last)].to_numpy(dtype=float)
            struck.append((inside[:, 0] - origin, inside[:, 1]))
        x = self._time(min(ends), max(ends), detail=detail)
        title = self.last.capitalize() if detail else "Impulse of each impact, whole run"
        plot = Plot(title, x, Scale.of(np.concatenate([[0.0], *(size for _, size in struck)]), "impulse_n_s"))
        for run, (t, size) in enumerate(struck):
            name, colour = self.names[run] or "impulse", CURVES[run % len(CURVES)] if self.names[run] else VERMILION
            if detail:
                stems = np.column_stack([0.0 * size, size, np.full(len(size), np.nan)]).ravel()
                plot.curve(np.repeat(t, 3), stems, "", colour, width=1.0)
            plot.dots(t, size, name, colour, size=5.0 if detail else 2.5)
        return plot.html()


def one_line(lines: list[RunLine]) -> list[RunLine]:
    """Return curves, of which those that coincide are one."""
    distinct: list[RunLine] = []
    for line in lines:
        twin = next((n for n, one in enumerate(distinct) if _coincide(one, line)), None)
        if twin is None:
            distinct.append(line)
            continue
        kind, _, number = line.name.rpartition(" ")
        same = distinct[twin].name.rpartition(" ")[0] == kind
        distinct[twin] = distinct[twin]._replace(name=f"{distinct[twin].name} = {number if same else line.name}")
    return distinct


def _coincide(one: RunLine, other: RunLine) -> bool:
    """Whether two curves are one; turns of several runs need not end at the same times."""
    if one.dash != other.dash or np.abs(one.t[[0, -1]] - other.t[[0, -1]]).max() > COINCIDE * np.ptp(one.t):
        return False
    span = float(np.nanmax(one.high) - np.nanmin(one.low))
    resampled = (np.interp(one.t, other.t, values) for values in (other.low, other.high))
    away = np.nanmax(np.abs([a - b for a, b in zip((one.low, one.high), resampled, strict=True)]))
    return bool(span > 0.0 and away < COINCIDE * span)
