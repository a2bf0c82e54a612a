"""Runs that are drawn over each other: their tables, the measured data beside them, and the series of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import TURN
from vibroplat.measured.data import Measured, curve_of
from vibroplat.plots.headlines import headline
from vibroplat.plots.histories import RunTables, run_of, turns_of, whole_of
from vibroplat.plots.reading import rest_of
from vibroplat.results import picture
from vibroplat.results.labels import named, run_parameters
from vibroplat.results.picture import BROKEN, CURVES, LOW, Facet, Panel
from vibroplat.results.run import RunResult

#: Name of the axis of y where it is counted from the static rest.
FROM_REST = "$y$ from rest"
#: Most turns that are drawn as a line; more of them as a range.
MOST_TURNS = 60
#: Colours of columns of one run; quantities along x are orange in all figures.
_COLOURS = {
    "gap_m": picture.VERMILION,
    "contact_force_n": picture.GREEN,
    "x_m": picture.ORANGE,
    "force_x_n": picture.ORANGE,
}


@dataclass
class RunPicture:
    """The runs of a figure, measured data, the names of several runs, and the series that are drawn of them.

    :meth:`draw` adds series: of whole runs, whose numbers are in ``whole``, or of their last turns, shown next to them.
    """

    runs: Sequence[RunTables]
    data: Measured | None = None
    names: Sequence[str] = ()
    parts: list[pd.DataFrame] = field(default_factory=list)
    series: list[picture.Series] = field(default_factory=list)
    words: list[picture.Word] = field(default_factory=list)
    whole: list[int] = field(default_factory=list)

    @property
    def only(self) -> RunTables | None:
        """The run, if there is one."""
        return self.runs[0] if len(self.runs) == 1 else None

    @property
    def both(self) -> bool:
        """Whether whole runs and their last turns are shown next to each other."""
        return not any(run.chosen for run in self.runs) and any(run.is_long for run in self.runs)

    @property
    def aligned(self) -> bool:
        """Whether last turns are counted from a whole turn of exciter 1, to compare those of several runs."""
        return self.only is None and self.data is None and not any(run.chosen for run in self.runs)

    def anew(self) -> RunPicture:
        """Return it without series."""
        return RunPicture(self.runs, self.data, self.names)

    def last(self, run: RunTables) -> pd.DataFrame:
        """Return the last turns of a run."""
        if not self.aligned:
            return run.last
        turns = run.last["phi1_rad"].abs() // TURN
        begin = float(run.last["t_s"].iloc[int(turns.gt(turns.iloc[0]).argmax())])
        shortest = min(float(np.ptp(one.last["t_s"])) for one in self.runs)
        return run.last[run.last["t_s"].between(begin, begin + shortest)].assign(t_s=run.last["t_s"] - begin)

    def during(self, run: RunTables) -> pd.DataFrame:
        """Return the events of the last turns, at the times of these."""
        last = self.last(run)
        begin, end = run.last.loc[last.index[[0, -1]], "t_s"]
        inside = run.events[run.events["t_s"].between(begin, end)]
        return inside.assign(t_s=inside["t_s"] - (begin - float(last["t_s"].iloc[0])))

    def colour(self, run: RunTables, column: str) -> str:
        """Return the colour of a quantity, or of each run if there are several."""
        number = next(number for number, one in enumerate(self.runs) if one is run)
        return _COLOURS.get(column, picture.BLUE) if self.only else CURVES[number % len(CURVES)]

    def called(self, run: RunTables, alone: str = "") -> str:
        """Return the name of one of several runs."""
        return self.names[next(n for n, one in enumerate(self.runs) if one is run)] if self.names else alone

    def draw(self, table: pd.DataFrame, label: str = "", breaks: Any = (), whole: bool = False, **look: Any) -> None:
        """Add a table as a series of its own, broken before some of its rows."""
        places = sum(map(len, self.parts)) + np.arange(len(table))
        if whole:
            self.whole.append(len(self.series))
        self.series.append(picture.Series(label, np.insert(places, breaks, BROKEN), **{"mode": "lines"} | look))
        self.parts.append(table.reset_index(drop=True))

    def picture(self, kind: str, panels: Sequence[Panel], *lines: str, facets: int = 2, **more: Any) -> picture.Picture:
        """Return the picture of all drawn series, in up to two facets: the whole run, and its last turns."""
        last = [n for n in range(len(self.series)) if n not in self.whole]
        table = pd.concat(self.parts, ignore_index=True) if self.parts else pd.DataFrame()
        columns = [*more.get("axes", ["t_s"]), *(panel.column for panel in panels)]
        turns = turns_of(self.runs[0].last)
        end = f"last {turns:.0f} turns" if 1.5 < turns < np.inf else "the end"
        where = "from a whole turn on" if self.aligned else end
        shown = [Facet(where, last, width=1.0)]
        shown = [Facet("whole run: range of each turn", self.whole, width=2.2), *shown] if self.both else shown
        shown = shown if facets > 1 and self.both else [one._replace(width=0.0) for one in shown[:facets]]
        begin = float(self.runs[0].whole["t_s"].iloc[0])
        names = named([run.name for run in self.runs], run_parameters(self.only.scene, begin) if self.only else "")
        rotations = {run.co_rotating for run in self.runs}
        return picture.Picture(
            name=kind,
            heading=kind,
            title=headline(kind, self.runs),
            table=table.reindex(columns=list(dict.fromkeys([*columns, *table]))).astype(float),
            table_name="trajectory",
            panels=panels,
            series=self.series,
            words=self.words,
            facets=shown if self.both or self.aligned else (),
            caption="\n".join(filter(None, (names, *lines))),
            rotation={True: "co-rotating", False: "counter-rotating"}[rotations.pop()] if len(rotations) == 1 else "",
            **{"axes": ["t_s"]} | more,
        )

    def panel(self, column: str, **look: Any) -> Panel:
        """Return the panel of a coordinate."""
        is_from_rest = column == "y_m" and all(run.from_rest for run in self.runs)
        return Panel(column, label=FROM_REST if is_from_rest else "", **look)


def beside(data: Measured, results: Sequence[RunResult], start: float | None, stop: float | None) -> list[RunTables]:
    """Cut runs to an interval, or else to that of measured data if these are shifted, and compare both."""
    given = [*map(str, data.given)]
    scene = results[0].known_scene
    if data.is_trajectory and scene:
        data.from_rest(rest_of(scene))
    wholes = [whole_of(one, given) for one in results] if start is stop is None else []
    if data.shift != 0.0 and wholes:
        start, stop = data.interval_in(wholes[0])
    runs = [run_of(one, start, stop, given) for one in results]
    numbers = [column for column in map(str, runs[0].shown.select_dtypes("number")) if column != "t_s"]
    data.select("t_s", numbers).fit(runs[0].shown)
    for column in numbers:
        tables = [table for table in wholes or [run.shown for run in runs] if column in table]
        data.compare(column, "t_s", [curve_of(table, column) for table in tables])
    return runs


def curve(shown: RunPicture, run: RunTables, column: str, panel: str = "", label: str = "", **look: Any) -> None:
    """Draw a column of a run: its range in each turn of the whole run, and its last turns."""
    look = {"colour": shown.colour(run, column), "of": (panel or column,)} | look
    low, high = (run.envelope[f"{column}:{end}"] for end in ("min", "max"))
    if shown.both or run.turns > MOST_TURNS:
        ranges = run.envelope[["t_s"]].assign(**{panel or column: high, f"{panel or column}{LOW}": low})
        shown.draw(ranges, label, whole=shown.both, mode="band", pale=shown.only is None, **look)
    if shown.both or run.turns <= MOST_TURNS:
        last = shown.last(run)
        shown.draw(last[["t_s"]].assign(**{panel or column: last[column]}), label, **look)
