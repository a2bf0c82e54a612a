"""Pictures on the page: each as data for its script, with the orbits that a click on a point shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import display_name, display_unit, indexed_name
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.page.run import impacts_of, initial, machine_of, packed_coarsely
from vibroplat.plots.reading import rest_of
from vibroplat.results.picture import BROKEN, Panel, Picture, Series, finite

#: Most rows of a table on the page, and of one whose rows are dots, which are drawn together.
MOST_ROWS, MOST_DOTS = 5000, 10_000
#: Most samples of all orbits on a page, some 65 for each turn: 1.5 MB.
MOST_SAMPLES = 50_000
#: Significant digits of the numbers in tables.
DIGITS = 9
#: Columns of a state, which few readers want to see.
_STATE = {*COORDINATES, *RATES}
#: Columns of an orbit.
_ORBIT = (
    *("t_s", "x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "y_rate_m_per_s"),
    *("gap_m", "upper_m", "contact_force_n"),
)
#: What the script calls markers and lines; lines of other patterns are long dashes.
SYMBOLS = dict(
    zip("osD^vXP*", ("circle", "square", "diamond", "triangle-up", "triangle-down", "x", "cross", "star"), strict=True)
)
_DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}

# -- tables ------------------------------------------------------------------------------------------------------------


def kept_rows(count: int, most: int) -> Any:
    """Return the rows of a table that the page has; one that is too long loses some evenly."""
    return np.arange(count) if count <= most else np.unique(np.linspace(0, count - 1, most).round().astype(int))


def table_data(title: str, result: int, whole: pd.DataFrame, rows: Any = None) -> dict[str, Any]:
    """Return some rows of a table for the page, and how many it had."""
    table = finite(whole.iloc[kept_rows(len(whole), MOST_ROWS) if rows is None else rows])
    columns = [
        {
            "name": str(name),
            "words": display_name(str(name)),
            "unit": display_unit(str(name))[0],
            "factor": display_unit(str(name))[1],
            "state": name in _STATE,
            "values": plain_column(table[name]),
        }
        for name in table.columns
    ]
    return {"title": title, "result": result, "columns": columns, "rows": len(table), "of": len(whole)}


def plain_column(column: pd.Series) -> list[Any]:
    """Return the values of a column for JSON; numbers have :data:`DIGITS` digits, what is missing is None."""
    return [_plain(value) for value in column.astype(object).tolist()]


def _plain(value: Any) -> Any:
    if value is None or value is pd.NA or (isinstance(value, float) and not math.isfinite(value)):
        return None
    if isinstance(value, bool | int | str):
        return value
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else str(value)


# -- pictures ----------------------------------------------------------------------------------------------------------


def picture_data(number: int, picture: Picture, motions: Motions) -> dict[str, Any]:
    """Return what the page shows of a picture of a result with a number; of a long table it has some rows."""
    count, points = len(picture.table), picture.points
    kept = kept_rows(count, MOST_DOTS if picture.series and picture.series[0].mode == "dots" else MOST_ROWS)
    places = np.concatenate([kept, np.arange(count, len(points))])
    renumbered = np.full(len(points) + 1, BROKEN - 1)
    renumbered[places], renumbered[BROKEN] = np.arange(len(places)), BROKEN
    shown = (name for panel in picture.panels for name in (panel.column, panel.by, panel.hatch) if name)
    drawn = {*picture.axes, *shown}
    values = {name: points[name].iloc[places] for name in drawn if name in points}
    special = None if picture.special is None else table_data(picture.special_name, number, picture.special)
    return {
        "name": picture.name,
        "title": picture.heading,
        "answer": picture.title.replace("$", ""),
        "result": number,
        "meaning": picture.meaning,
        "table": table_data(picture.table_name, number, picture.table, kept),
        "special": special,
        "values": {name: plain_column(column) for name, column in values.items()},
        "axes": [_column(name) | {"log": picture.log(name)} for name in picture.axes],
        "measures": [_panel(panel, points) for panel in picture.panels],
        "series": [_series(one, renumbered) for one in picture.series],
        "states": [] if picture.states is None else np.append(picture.states, [0] * len(points))[places].tolist(),
        "facets": [
            {"label": one.label.replace("$", ""), "series": [*one.series], "behind": [*one.behind]}
            for one in (picture.facets if len(picture.facets) > 1 else ())
        ],
        "choice": indexed_name(picture.choice),
        "marks": [
            one._asdict() | {"symbol": SYMBOLS[one.symbol], "rows": renumbered[[*one.rows]].tolist()}
            for one in picture.marks
        ],
        "lines": [
            one._asdict()
            | {
                "at": [_plain(value) for value in one.at],
                "dash": _DASHES.get(one.dash, "longdash"),
                **_column(one.column),
            }
            for one in picture.lines
        ],
        "strips": None if picture.strips is None else _strips(picture),
        "jumps": [
            one._asdict() | {"before": int(renumbered[one.before]), "after": int(renumbered[one.after])}
            for one in picture.jumps
        ],
        "words": [one._asdict() for one in picture.words],
        "ranges": [one._asdict() | _column(one.column) for one in picture.ranges],
        "high": picture.high,
        **motions.of(picture, places),
    }


def _strips(picture: Picture) -> dict[str, Any]:
    """Return strips with their intervals over each axis, in SI units."""
    strips = picture.strips
    assert strips is not None
    rows = [
        {
            "label": one.label.replace("$", ""),
            "colour": one.colour,
            "spans": {name: [[*span] for span in one.spans(picture.points[name])] for name in picture.axes},
        }
        for one in strips.rows
    ]
    classes = [[name, colour, told] for name, (colour, told) in strips.classes.items()]
    more = {"hatches": [[*one] for one in strips.hatches.items()], "line": strips.line, "label": strips.label}
    return {"rows": rows, "classes": classes, **more}


def _column(name: str) -> dict[str, Any]:
    unit, factor = display_unit(name)
    return {"column": name, "words": indexed_name(name), "unit": unit, "factor": factor}


def _panel(panel: Panel, points: pd.DataFrame) -> dict[str, Any]:
    """Return a panel; ``least`` is the end of an axis of what is small."""
    found, size = _column(panel.column), float(points[panel.column].abs().max()) if panel.least else 0.0
    least = found["factor"] * panel.least if panel.least is not None and not panel.by and size < panel.least else 0.0
    more: dict[str, Any] = {"note": panel.note, "kind": panel.kind, "by": panel.by, "title": panel.title}
    more |= {"least": least, "log": panel.scale == "log", "hatch": panel.hatch, "hatches": dict(panel.hatches)}
    label = panel.label.replace("$", "").rpartition(" (")[0] if panel.label.endswith(")") else panel.label
    classes = [[name, colour, told] for name, (colour, told) in panel.classes.items()]
    of = _column(panel.by) if panel.by else None
    if of is not None and not panel.classes:
        known = points[panel.by].dropna().astype(float)
        least, largest = (known.min(), known.max()) if len(known) else (0.0, 1.0)
        ends = [least, largest] if panel.least is None else [0.0, panel.least]
        of |= {"ends": [*map(float, ends)], "white": panel.least is not None}
    return (
        found
        | more
        | {
            "words": found["words"] if panel.by else label or found["words"],
            "label": label,
            "classes": classes,
            "of": of,
        }
    )


def _series(series: Series, renumbered: Any) -> dict[str, Any]:
    """Return a series of rows; None stands where its line is broken."""
    rows = renumbered[series.places]
    return {
        "label": ", ".join(filter(None, (series.label.replace("$", ""), series.look))),
        "rows": [None if row == BROKEN else row for row in rows[rows >= BROKEN].tolist()],
        "colour": series.colour,
        "mode": series.mode,
        "symbol": SYMBOLS[series.symbol],
        "dash": _DASHES.get(series.dash, "longdash") if isinstance(series.dash, str) else "longdash",
        "width": series.width,
        "size": series.size,
        "opacity": 0.5 if series.pale else 1.0,
        "of": [*series.of],
    }


# -- orbits of points --------------------------------------------------------------------------------------------------

Row = Mapping[str, Any]
#: Computes one period of the orbit of a row: its scene, trajectory, events. Raises VibroplatError.
Mover = Callable[[Scene, Row], tuple[Scene, pd.DataFrame, pd.DataFrame]]
#: Called with how many points are done, and how many there are.
Progress = Callable[[int, int], None]


@dataclass
class Motions:
    """Computes the orbits of the pictures of a result.

    Attributes
    ----------
    scene
        Whose points they are.
    mover
        Computes them; None for a page without orbits.
    room
        How many samples they may have.
    progress
        Told of each point.
    found
        The orbits of tables so far; pictures may share one.
    """

    scene: Scene
    mover: Mover | None
    room: int
    progress: Progress | None = None
    found: list[tuple[pd.DataFrame, dict[str, Any]]] = field(default_factory=list)

    def of(self, picture: Picture, places: Any) -> dict[str, Any]:
        """Return what moves at some places of a picture.

        Returns
        -------
        dict
            ``motions``: what :meth:`_computed` returns; ``owner``: for each place the row whose orbit it has;
            ``owned``: whether these are rows of another table; ``display_name`` about them.
        """
        orbits = picture.orbits
        if orbits is None:
            return {"motions": _none(asked=False), "owner": [], "owned": False, "words": ""}
        own = range(len(orbits.table)) if orbits.owner is None else orbits.owner
        owner = [own[place] if place < len(own) else None for place in places]
        known = next((one for table, one in self.found if table is orbits.table), None)
        if known is None:
            known = self._computed(orbits.table, orbits.first, [row for row in owner if row is not None])
            self.found.append((orbits.table, known))
        owned = orbits.owner is not None and orbits.table is not picture.table
        return {"motions": known, "owner": owner, "owned": owned, "words": orbits.words}

    def _computed(self, table: pd.DataFrame, first: Iterable[int], rows: Sequence[int]) -> dict[str, Any]:
        """Return the orbits of some rows of a table, then of those evenly chosen among others while there is room.

        Returns
        -------
        dict
            ``list``: the orbits; ``machines`` that move through them; ``rows``: for each row the place of its orbit, or
            why it has none; ``asked``: whether orbits were to be computed.
        """
        chosen = sorted({*rows})
        records = dict(zip(chosen, _records(table.iloc[chosen]), strict=True))
        data = _none(asked=self.mover is not None)
        found: dict[int, int | str] = {row: text for row in chosen if (text := _why_none(records[row]))}
        order = dict.fromkeys([*(row for row in first if row in records), *(chosen[n] for n in spread(len(chosen)))])
        wanted, used = [row for row in order if row not in found], 0
        for done, row in enumerate(wanted if self.mover is not None else ()):
            assert self.mover is not None
            if self.progress is not None:
                self.progress(done, len(wanted))
            try:
                scene, trajectory, events = self.mover(self.scene, records[row])
            except VibroplatError as error:
                found[row] = f"It has no orbit on this page: {error}."
                continue
            used += len(trajectory)
            if used > self.room:
                break
            found[row], machine = len(data["list"]), machine_of(scene)
            data["machines"] += [] if machine in data["machines"] else [machine]
            packed = _packed(trajectory.assign(y_m=trajectory["y_m"] - rest_of(scene)), events)
            data["list"].append(packed | {"machine": data["machines"].index(machine)})
        return data | {"rows": found}


def _none(*, asked: bool) -> dict[str, Any]:
    """Return what a picture without orbits has."""
    return {"rows": {}, "list": [], "machines": [], "asked": asked}


def _packed(trajectory: pd.DataFrame, events: pd.DataFrame) -> dict[str, Any]:
    """Return what the page shows of an orbit."""
    seconds = float(trajectory["t_s"].iloc[-1])
    turns = abs(float(np.ptp(trajectory["phi1_rad"].iloc[[0, -1]]))) / (2.0 * np.pi)
    return {
        "end": seconds,
        "turns": round(turns),
        "columns": {name: packed_coarsely(trajectory[name]) for name in _ORBIT if name in trajectory},
        "modes": "".join(trajectory["mode"].map(initial)),
        "impacts": impacts_of(events, 0.0, seconds),
    }


def spread(count: int) -> list[int]:
    """Order numbers from 0 so that the first ones, however many, lie evenly among all: by their bits, backwards."""
    bits = max(count - 1, 1).bit_length()
    return sorted(range(count), key=lambda number: int(f"{number:0{bits}b}"[::-1], 2))


def _records(table: pd.DataFrame) -> list[Row]:
    """Return the rows of a table by column, without what is missing as a whole."""
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _why_none(row: Row) -> str:
    """Say why a row of a sweep cannot have an orbit; "" if it can."""
    if row.get("outcome", "ok") != "ok":
        return f"This point failed ({row['outcome']}), so it has no orbit."
    period = row.get("period")
    return "" if pd.notna(period) and period else "The motion of this point does not repeat, so it has no orbit."
