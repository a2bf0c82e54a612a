"""Curves of runs: the range of each turn, pale, over the whole run, and the last turns beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.digits import NEGLIGIBLE, quantity
from vibroplat.page.run import EXCITERS, LAST_TURNS, PANELS, Course, accelerations
from vibroplat.page.svg import Floats, Plot, Scale
from vibroplat.page.tables import hint
from vibroplat.results.picture import CURVES, ORANGE, VERMILION

#: Difference, over their range, up to which two curves are one.
COINCIDE = 0.015
#: Width of a band, over the range of the curve, up to which it is a line.
NARROW = 0.02
#: The same of speeds, which change within a turn while exciters start.
SPEEDING = 0.25
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


class Line(NamedTuple):
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
    courses
        What the page shows of each.
    names
        What they are called, where there are several.
    """

    def __init__(self, courses: Sequence[Course], names: Sequence[str]) -> None:
        self.courses, self.names = courses, names if len(names) > 1 else [""]
        self.chosen = any(one.detail["t_s"].iloc[-1] < one.last - 1e-9 for one in courses)
        known = all(one.frequency for one in courses)
        #: What the detail is called.
        self.last = "interval" if self.chosen else f"last {LAST_TURNS} turns" if known else "whole run"

    # -- lines --------------------------------------------------------------------------------------

    def whole(self, columns: Mapping[str, str], until: float = math.inf) -> list[Line]:
        """Return the ranges of curves over the runs, up to a time (s)."""
        return self._lines(columns, lambda course, column: course.band(column, until))

    def detail(self, columns: Mapping[str, str]) -> list[Line]:
        """Return curves of the last turns, or of the interval that was asked for."""
        return self._lines(columns, lambda course, column: course.turns(column, self._origin(course)))

    def _origin(self, course: Course) -> float:
        """Return the time (s) from which those of the detail are counted."""
        return 0.0 if self.chosen else float(course.detail["t_s"].iloc[0])

    def _lines(self, columns: Mapping[str, str], parts_of: Callable[[Course, str], Any]) -> list[Line]:
        """Return curves: of several runs each has a colour, of one run each of its curves."""
        found = []
        for run, (course, name) in enumerate(zip(self.courses, self.names, strict=True)):
            for number, (column, label) in enumerate(columns.items()):
                if (parts := parts_of(course, column)) is not None:
                    own = _COLOURS.get(column, CURVES[number % len(CURVES)])
                    dash = "2 3" if column == "synchronous_hz" else "6 3" if name and number else ""
                    called = ", ".join(filter(None, (name, label if len(columns) > 1 else ""))) or label
                    found.append(Line(called, CURVES[run % len(CURVES)] if name else own, dash, *parts))
        return one_line(found)

    # -- figures ------------------------------------------------------------------------------------

    def key_figures(self) -> list[str]:
        """Return the curves that matter: the force into the foundation over the run, and the platform's last turns."""
        found = []
        if force := self.whole(PANELS[0][1]):
            plot = drawn("Force into the foundation, y: each turn of the run", force, "force_y_n")
            self._mark_largest(plot)
            found.append(plot.html())
        main = self.courses[0].main
        columns = {main: "platform"} | ({"underside_m": "underside of the material"} if main == "y_m" else {})
        if lines := self.detail(columns):
            words = {"y_m": "Platform y", "x_m": "Platform x", "phi_rad": "Rotation"}[main]
            if main == "y_m" and any("underside_m" in one.detail for one in self.courses):
                words = "Platform and material"
            found.append(drawn(f"{words}, {self.last}", lines, main, detail=not self.chosen).html())
        return found

    def third(self) -> str:
        """Return the speeds while the exciters start, or the force of the last turns."""
        courses, column = self.courses, "speed_1_hz"
        if not any(one.size(f"speed_{n}_hz") > 0.1 * (one.frequency or 0.0) for one in courses for n in (1, 2)):
            lines, title, column = self.detail(PANELS[0][1]), f"Force into the foundation, {self.last}", "force_y_n"
        elif any(one.steady is None for one in courses):
            lines, title = self.whole(EXCITERS), "Speed, whole run"
        else:
            until = max(max(one.steady or 0.0, one.first + START) for one in courses)
            lines, title = self.whole(EXCITERS, until), "Speed until the stroke is steady"
        if not lines:
            return ""
        plot = drawn(title, lines, column, detail=column == "force_y_n" and not self.chosen)
        plot.height = "--h:150px"
        return plot.html()

    def _mark_largest(self, plot: Plot) -> None:
        """Mark the static force, and the largest one with its time."""
        for course in self.courses:
            s, band = course.result.summary, course.band("force_y_n")
            most, at = (s.get(f"whole_foundation_force_y_max_{end}") for end in ("n", "at_s"))
            if s.get("foundation_force_y_mean_n") is not None and len(self.courses) == 1:
                plot.rule("static", y=-s["foundation_force_y_mean_n"])
            if most is not None and at is not None and band is not None:
                side = 1.0 if np.nanmax(band[2]) >= -np.nanmin(band[1]) else -1.0
                plot.mark(at, side * most, f"{quantity(most, 'N')} at {quantity(at, 's')}")

    def all_figures(self) -> tuple[str, int, list[str]]:
        """Return all curves in pairs, how many quantities these are, and what has nothing to show."""
        pairs, none = [], []
        measured = {column: label for one in self.courses for column, label in accelerations(one.result.scene).items()}
        for title, columns in (*PANELS, *[("Acceleration", measured)] * bool(self.whole(measured))):
            whole, detail, column = self.whole(columns), self.detail(columns), next(iter(columns))
            if not whole or not any(self._matters(one, column) for one in self.courses for column in columns):
                none.append(title[0].lower() + title[1:])
                continue
            right = hint(f"{self.last.capitalize()}: 0")
            if not self._rests(whole, detail):
                right = drawn(self.last.capitalize(), detail, column, detail=not self.chosen).html() if detail else ""
            pairs.append(drawn(f"{title}, whole run", whole, column).html() + right)
        if any(len(one.impulses) for one in self.courses):
            pairs.append(self._impulses(detail=False) + self._impulses(detail=True))
        return "".join(pairs), len(pairs), none

    def _rests(self, whole: list[Line], detail: list[Line]) -> bool:
        """Whether curves that swing about 0 hardly do so in the detail."""
        most = max(max(abs(np.nanmin(one.low)), abs(np.nanmax(one.high))) for one in whole)
        return bool(detail) and all(np.nanmax(np.abs(one.low)) < NEGLIGIBLE * most for one in detail)

    def _matters(self, course: Course, column: str) -> bool:
        """Whether a curve has content beside the largest one of its kind."""
        arms = {"phi_rad": course.result.scene.body.distance}
        kinds = (("x_m", "y_m", "phi_rad"), ("force_x_n", "force_y_n"))
        alike = next((kind for kind in kinds if column in kind), ())
        largest = max((arms.get(name, 1.0) * course.size(name) for name in alike), default=0.0)
        return arms.get(column, 1.0) * course.size(column) > NEGLIGIBLE * largest

    def _impulses(self, *, detail: bool) -> str:
        """Return the impulses of all impacts of the runs, or of their last turns."""
        struck, times = [], []
        for one in self.courses:
            origin = self._origin(one) if detail else 0.0
            first, last = one.detail["t_s"].iloc[[0, -1]] if detail else (one.first, one.last)
            times += [first - origin, last - origin]
            inside = one.impulses[one.impulses["t_s"].between(first, last)].to_numpy(dtype=float)
            struck.append((inside[:, 0] - origin, inside[:, 1]))
        unit = ("ms", 1e3) if detail and not self.chosen else ("s", 1.0)
        x = Scale(float(min(times)), float(max(times)), *unit)
        title = self.last.capitalize() if detail else "Impulse of each impact, whole run"
        plot = Plot(title, x, Scale.of(np.concatenate([[0.0], *(size for _, size in struck)]), "impulse_n_s"))
        for run, (t, size) in enumerate(struck):
            name, colour = self.names[run] or "impulse", CURVES[run % len(CURVES)] if self.names[run] else VERMILION
            if detail:
                stems = np.column_stack([0.0 * size, size, np.full(len(size), np.nan)]).ravel()
                plot.curve(np.repeat(t, 3), stems, "", colour, width=1.0)
            plot.dots(t, size, name, colour, size=5.0 if detail else 2.5)
        return plot.html()


def one_line(lines: list[Line]) -> list[Line]:
    """Return curves, of which those that coincide are one."""
    found: list[Line] = []
    for line in lines:
        twin = next((n for n, one in enumerate(found) if _coincide(one, line)), None)
        if twin is None:
            found.append(line)
            continue
        kind, _, number = line.name.rpartition(" ")
        same = found[twin].name.rpartition(" ")[0] == kind
        found[twin] = found[twin]._replace(name=f"{found[twin].name} = {number if same else line.name}")
    return found


def _coincide(one: Line, other: Line) -> bool:
    if one.dash != other.dash or one.t.shape != other.t.shape or not np.array_equal(one.t, other.t):
        return False
    span = float(np.nanmax(one.high) - np.nanmin(one.low))
    away = np.nanmax(np.abs([one.low - other.low, one.high - other.high]))
    return bool(span > 0.0 and away < COINCIDE * span)


def drawn(title: str, lines: Iterable[Line], column: str, *, detail: bool = False) -> Plot:
    """Return a drawing of curves over time; a wide range is a band."""
    lines = list(lines)
    t = np.concatenate([line.t for line in lines])
    values = np.concatenate([part for line in lines for part in (line.low, line.high)])
    x = Scale(float(t.min()), float(t.max()), *(("ms", 1e3) if detail else ("s", 1.0)))
    y = Scale.of(values, column, least=0.0 if column.startswith("speed") and not detail else None)
    plot = Plot(title, x, y)
    span = float(np.nanmax(values) - np.nanmin(values)) or 1.0
    for line in lines:
        narrow = NARROW if not column.startswith("speed") else SPEEDING
        if line.low is not line.high and np.nanmax(line.high - line.low) > narrow * span:
            plot.band(line.t, line.low, line.high, line.name, line.colour)
        else:
            plot.curve(line.t, 0.5 * (line.low + line.high), line.name, line.colour, dash=line.dash)
    plot.key = [(line.name, line.colour) for line in lines] if len(lines) > 1 or " = " in lines[0].name else []
    return plot
