"""Pictures of a sweep, or of several laid over each other: response, bifurcation diagram and map of regimes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.columns import PHASE_COLUMN, QUANTITIES, describe_sync, quantity_of
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.reader import flat
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.hybrid.state import static_rest
from vibroplat.results import picture
from vibroplat.results.labels import (
    ABSCISSAE,
    SPECIAL_POINTS,
    compared,
    distinct,
    is_number,
    key_name,
    sweep_parameters,
    value_words,
)
from vibroplat.results.result import Result
from vibroplat.study.bands import find_jumps
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of

OPTIONS = ("x", "data", "measure")
#: The column that tells several results apart.
RESULT = "result"
#: Most values of a key that have colours of their own; more of them follow a colour scale.
DISTINCT = 5
#: Markers of directions; the way down is wide and pale below the way up, so that both are seen where they coincide.
DIRECTIONS = {"up": "^", "down": "v"}
_LOOKS: dict[bool, dict[str, Any]] = {True: {}, False: {"dash": "--", "width": 2.4, "size": 1.4, "pale": True}}
#: Colours of the directions of a bifurcation diagram.
_COLOURS = {"up": picture.BLUE, "down": picture.VERMILION}
#: Classes of periods: upper limits and labels; after them the motions that do not repeat, and their colours.
_ENDS = ((1, "1"), (2, "2"), (4, "3, 4"), (8, "5 … 8"), (64, "9 … 64"))
_APERIODIC = {"quasi-periodic": "quasi-periodic", "chaotic": "chaotic", "undecided": "not periodic"}
PERIODS = {
    **dict(
        zip(
            (name for _, name in _ENDS),
            (picture.BLUE, picture.SKY, picture.GREEN, picture.ORANGE, picture.VERMILION),
            strict=True,
        )
    ),
    "quasi-periodic": picture.PURPLE,
    "chaotic": "#5c2a4d",
    "not periodic": "#d4d4d4",
}
#: Lines of boundaries that have one colour, by the kinds of special points; what thin ones are.
_DASHES: Sequence[Any] = ("-", "--", "-.", ":", (0, (7, 2)), (0, (1, 2, 1, 2, 5, 2)), (0, (9, 1, 2, 1)))
UNREACHED = "thin: of unstable orbits"
#: Columns of texts and of numbers that a table of a sweep needs.
_TEXTS = ("direction", "sync")
_NUMBERS = (EXCITATION, "rms_x_m", "rms_y_m", PHASE_COLUMN, "period")


@dataclass(frozen=True)
class Sweeps:
    """Tables of one sweep or more as one: a column ``result`` tells several apart.

    Attributes
    ----------
    results, names, labels
        The results, what they are called, and what they are called in a legend.
    table, key, grid
        All points, the column of the key along branches, and columns that tell branches apart.
    x
        The horizontal axis in print.
    """

    results: Sequence[Result]
    names: Sequence[str]
    table: pd.DataFrame
    key: str
    grid: Sequence[str]
    x: str
    labels: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def varied(self) -> list[str]:
        """Columns of the grid that have several values."""
        return [key for key in self.grid if key == RESULT or len(self.table[key].unique()) > 1]

    @property
    def scale(self) -> str:
        """The key whose numbers colours can follow, if it alone varies."""
        return self.varied[0] if len(self.varied) == 1 and is_number(self.table[self.varied[0]]) else ""

    @cached_property
    def rotation(self) -> str:
        """How the exciters rotate; "" if that varies or is not known."""
        if "rotation" in self.table:
            found = {*self.table["rotation"].dropna()}
        else:
            scenes = [] if any("rotation" in key for key in self.grid) else [one.known_scene for one in self.results]
            found = {scene.rotation for scene in scenes if scene is not None}
        return str(found.pop()) if len(found) == 1 else ""

    @cached_property
    def branches(self) -> list[pd.DataFrame]:
        """The rows of each branch, in the order of the table."""
        return [*picture.in_groups(self.table, [*self.grid, "branch"])]

    def label(self, row: pd.Series) -> str:
        """Return what a combination of the grid's values is called in a legend; results differ by their labels."""
        return ", ".join(self.labels[row[key]] if key == RESULT else value_words(key, row[key]) for key in self.varied)

    def scene_of(self, rows: pd.DataFrame, keys: Sequence[str]) -> Scene | None:
        """Return the scene of a single result, if it is known, with the values of keys that some rows share."""
        scene = self.results[0].known_scene if len(self.results) == 1 else None
        return scene and scene.replace({key: rows[key].astype(object).iloc[0] for key in keys})

    def told(self, *more: str) -> str:
        """Return what a reader wants to know of the scene, without keys that axes and curves show."""
        scene = self.scene_of(self.table, [key for key in self.grid if key not in self.varied])
        return sweep_parameters(scene, [self.key, *self.varied, *more])

    @property
    def meaning(self) -> str:
        """A sentence on what the machine does in each synchronization, or ""."""
        found = [
            describe_sync(str(sync), self.rotation)
            for sync in self.table.get("sync", pd.Series(dtype=str)).dropna().unique()
        ]
        told = "; ".join(text for text in found if ": " in text)
        return told and f" {told[0].upper()}{told[1:]}."


def pictures(
    results: Sequence[Result], kinds: Sequence[str] = (), *, x: str | None = None, measure: Sequence[str] = ()
) -> list[picture.Picture]:
    """Return the pictures of a sweep, or of several laid over each other.

    ``response`` shows measures over the key, ``bifurcation`` points of the Poincaré section and impact speeds, ``map``
    synchronization, period and flight over the key and one of the grid, with boundaries of orbits over both in the same
    directory. Default: response, and the kind of a single sweep.

    Raises
    ------
    TableError
        Tables are missing, or lack data that a picture needs.
    """
    if not kinds:
        own = [str(results[0].given("sweep", "kind"))] if len(results) == 1 else []
        kinds = list(dict.fromkeys(["response", *own]))
    if measure and not {"response", "map"} & {*kinds}:
        raise TableError(f"--measure {', '.join(measure)}: {kinds[0]} does not show it; allowed: response, map")
    if len(results) > 1 and {*kinds} != {"response"}:
        other = next(kind for kind in kinds if kind != "response")
        raise TableError(f"--kind {other} shows one sweep; allowed with {len(results)} of them: response")
    sweeps = read(results, x=None if x is None else ABSCISSAE[x], columns=measure)
    return [_MAKERS[kind](sweeps, measure) for kind in kinds]


def read(results: Sequence[Result], *, x: str | None = None, columns: Sequence[str] = ()) -> Sweeps:
    """Read the table of a sweep, or those of several as one."""
    tables: list[pd.DataFrame] = []
    keys = [swept(result) for result in results]
    for key, result in zip(keys, results, strict=True):
        if key != keys[0]:
            raise TableError(f"{result.place} is over {key}, not {keys[0]}; allowed: several sweeps over one key")
        numbers = (key, "branch", *_NUMBERS, *columns, *([x] if x else []))
        tables.append(picture.rows_in(result, "sweep", _TEXTS, numbers, list(QUANTITIES)))
    grid = list(dict.fromkeys(key for table in tables for key in grid_of(table)))
    made = [flat(result.given()) for result in results]
    tables = [
        table.assign(**{key: own[key] for key in grid if key not in table and key in own})
        for table, own in zip(tables, made, strict=True)
    ]
    names = distinct([result.name for result in results], [result.directory or Path() for result in results])
    if len(tables) > 1:
        tables = [table.assign(**{RESULT: name}) for name, table in zip(names, tables, strict=True)]
    table = picture.finite(pd.concat(tables, ignore_index=True))
    found = Sweeps(results, names, table, keys[0], [RESULT, *grid][len(tables) == 1 :], x or abscissa(keys[0]))
    labels = compared("sweep", names, [result.known_scene for result in results], found.varied)
    return replace(found, labels=dict(zip(names, labels, strict=True)))


def swept(result: Result) -> str:
    """Return the column of the key along the branches of a sweep."""
    return column_of(str(flat(result.given()).get("sweep.over.key", FREQUENCY)))


def key_of(table: pd.DataFrame) -> str:
    """Return the column of the key along the branches of a sweep: of the supply, or the first one."""
    return SUPPLY if SUPPLY in table else str(table.columns[0])


def grid_of(table: pd.DataFrame) -> list[str]:
    """Return the keys of the grid of a sweep."""
    key = key_of(table)
    return [str(column) for column in table.columns[: list(table.columns).index("direction")] if column != key]


def abscissa(key: str) -> str:
    """Return the column that pictures of points over a key have on their horizontal axis."""
    return EXCITATION if key == SUPPLY else key


# -- response ----------------------------------------------------------------------------------------------------------


def branch_series(rows: pd.DataFrame, label: str = "", colour: str = picture.BLUE, size: float = 1.0) -> picture.Series:
    """Return the points of a branch, whose line is broken where the motion jumps."""
    behind = np.flatnonzero(find_jumps(rows)) + 1
    direction = str(rows["direction"].iloc[0])
    look = {"width": 1.0, "size": 1.0} | _LOOKS[direction != "down"]
    look |= {name: size * look[name] for name in ("width", "size")}
    symbol = DIRECTIONS["down" if direction == "down" else "up"]
    places = np.insert(rows.index.to_numpy(), behind, picture.BROKEN)
    return picture.Series(label, places, f"{key_name(key_of(rows))} {direction}", colour, "both", symbol, **look)


def failed_places(rows: pd.DataFrame, x: str) -> Any:
    """Return where points failed; excitation frequencies they do not have follow from those of their neighbours."""
    failed = (rows["outcome"] != "ok" if "outcome" in rows else rows[EXCITATION].isna()).to_numpy(dtype=bool)
    key = key_of(rows)
    over = rows[key].to_numpy(dtype=float)
    if x == key or not failed.any():
        return over[failed]
    expected = over if key == SUPPLY else np.ones(len(over))
    ratio = rows[x].to_numpy(dtype=float, na_value=np.nan) / expected
    known = np.flatnonzero(np.isfinite(ratio))
    known = known[np.argsort(over[known])]
    if not len(known):
        return np.full(int(failed.sum()), np.nan)
    return expected[failed] * np.interp(over[failed], over[known], ratio[known])


def placed(rows: pd.DataFrame, x: str) -> pd.Series:
    """Return a column along a branch, with the places of points that failed where it can tell them."""
    failed = rows["outcome"] != "ok" if "outcome" in rows else rows[EXCITATION].isna()
    found = rows[x].astype(float)
    found[failed] = failed_places(rows, x)
    return found


def response(sweeps: Sweeps, columns: Sequence[str] = ()) -> picture.Picture:
    """Return all measures of a sweep that say something, or these, along its branches.

    Where all points failed none has an excitation frequency, and the values of the key show where they are.
    """
    table = sweeps.table
    drawn = table.astype({sweeps.x: float})
    labels = [sweeps.label(rows.iloc[0]) for rows in sweeps.branches]
    numbers, names = pd.factorize(np.array(labels, dtype=object))
    scale = sweeps.scale if len(names) > DISTINCT else ""
    shown = table.groupby([*sweeps.varied], sort=False)[scale].first() if scale else ()
    colours = picture.shades(list(map(float, shown))) if scale else picture.palette(len(names))
    series = []
    for number, rows in zip(numbers, sweeps.branches, strict=True):
        series.append(branch_series(rows, names[number], colours[number], _size(int(number), len(names))))
        drawn.loc[rows.index, sweeps.x] = placed(rows, sweeps.x)
    known = sweeps.x if drawn[sweeps.x].notna().any() else sweeps.key
    return picture.Picture(
        name="response",
        heading="Sweep",
        title=", ".join(sweeps.names),
        table=table,
        table_name="sweep",
        drawn=drawn,
        axes=list(dict.fromkeys([known, *picture.axes_of(table, (sweeps.x, EXCITATION, sweeps.key, *sweeps.grid))])),
        panels=picture.measures(table, asked=columns),
        series=series,
        states=picture.motions_of(table),
        rotation=sweeps.rotation,
        scale=scale,
        told=sweeps.told(),
        meaning="▲ up, ▼ down; filled: periodic, open: not periodic, with a dot: undecided, ×: failed. Where the "
        f"motion jumps, a line is broken.{sweeps.meaning}",
        orbits=picture.Orbits(table),
    )


def _size(number: int, count: int) -> float:
    """Return the size of a curve, from large to small: where curves lie on each other, the first ones stand out."""
    if count == 1:
        return 1.0
    largest = 1.6 if count <= DISTINCT else 1.1
    return largest - (largest - 0.7) * number / (count - 1)


# -- bifurcation diagram -----------------------------------------------------------------------------------------------


def bifurcation(sweeps: Sweeps, _: Sequence[str] = ()) -> picture.Picture:
    """Return the Poincaré section and impact speeds, a facet for each branch.

    Behind the points of a branch are those of the other direction: where both are alike, none is hidden.
    """
    (result,), x = sweeps.results, sweeps.x
    section, impacts = (
        result.columns(name, ("direction",), (x, sweeps.key, "branch", column))
        for name, column in (("section", "y_m"), ("impacts", "impact_speed_m_per_s"))
    )
    rest = _rests(sweeps, section)
    table = pd.concat([section.assign(y_m=section["y_m"] - rest), impacts], ignore_index=True)
    name = "y from rest" if sweeps.results[0].known_scene else "y"
    panels = [picture.Panel("y_m", label=f"${name[0]}${name[1:]} at whole turns of exciter 1 (mm)")]
    panels += [picture.Panel("impact_speed_m_per_s")] if len(impacts) else []
    first = [rows.iloc[0] for rows in sweeps.branches]
    series = [
        picture.Series(
            f"{key_name(sweeps.key)} {row['direction']}",
            picture.rows_of(table["branch"] == row["branch"]),
            colour=_COLOURS.get(row["direction"], picture.BLUE),
            mode="dots",
        )
        for row in first
    ]
    labels = [sweeps.label(row) for row in first]
    facets = [
        picture.Facet(
            ", ".join(filter(None, (labels[number], row["direction"]))),
            [number],
            [n for n, label in enumerate(labels) if label == labels[number] and n != number],
        )
        for number, row in enumerate(first)
    ]
    return picture.Picture(
        name="bifurcation",
        heading="Bifurcation diagram",
        title=result.name,
        table=table,
        table_name="section and impacts",
        axes=picture.axes_of(table, (x, sweeps.key)),
        panels=panels,
        series=series,
        facets=facets,
        choice="branch",
        told=sweeps.told(),
        meaning="Each dot is a point of the Poincaré section, or an impact. Grey: those of the other direction.",
        high=True,
    )


def _rests(sweeps: Sweeps, section: pd.DataFrame) -> list[float]:
    """Return y at the static rest of the scene of each point (m); 0 where that is not known."""
    scenes = {rows["branch"].iloc[0]: sweeps.scene_of(rows, sweeps.grid) for rows in sweeps.branches}
    found = {}
    for (branch, value), _ in section.groupby(["branch", sweeps.key]):
        if (scene := scenes[branch]) is not None:
            placed = scene if sweeps.key == SUPPLY else scene.replace({sweeps.key: value})
            found[branch, value] = float(static_rest(placed)[1])
    return [found.get(place, 0.0) for place in zip(section["branch"], section[sweeps.key], strict=True)]


# -- map of regimes ----------------------------------------------------------------------------------------------------


def period_classes(table: pd.DataFrame) -> pd.Series:
    """Return the name of each point's class in ``PERIODS``, missing if it failed."""
    period = table["period"].to_numpy(dtype=float, na_value=np.nan)
    repeats = np.searchsorted([end for end, _ in _ENDS], np.nan_to_num(period))
    motion = table["motion"] if "motion" in table else pd.Series("undecided", table.index)
    names = np.array([*PERIODS], dtype=object)[repeats]
    names = np.where(period == 0.0, motion.map(_APERIODIC).fillna("not periodic").to_numpy(dtype=object), names)
    return pd.Series(names, table.index, dtype=object).where(np.isfinite(period))


def regimes(sweeps: Sweeps, columns: Sequence[str] = ()) -> picture.Picture:
    """Return maps of synchronization, period and flight, or of measures, over the key and one of the grid."""
    key, table, (result,) = sweeps.scale, sweeps.table, sweeps.results
    if not key:
        raise TableError(f"{result.place} varies {sweeps.varied}; a map needs one grid key with several numbers")
    curves = picture.beside(result, "orbits", "boundaries")
    if curves is None or not {sweeps.key, key} <= {*curves.columns}:
        curves = pd.DataFrame()
    drawn = pd.concat([table.assign(period_class=period_classes(table)), curves], ignore_index=True)
    directions = list(dict.fromkeys(table["direction"]))
    series = [picture.Series("", picture.rows_of(table["direction"] == name), mode="dots") for name in directions]
    lines = boundary_series(curves, len(table), [picture.BLACK]) if len(curves) else []
    behind = [len(series) + number for number in range(len(lines))]
    return picture.Picture(
        name="map",
        heading="Map",
        title=result.name,
        table=table,
        table_name="sweep",
        special=curves if len(curves) else None,
        special_name="boundaries",
        drawn=drawn,
        axes=[sweeps.key],
        panels=[_tiles(key, column, quantity_of(column).name) for column in columns] or [*_map_panels(sweeps, key)],
        series=[*series, *lines],
        facets=[picture.Facet(name, [number, *behind]) for number, name in enumerate(directions)],
        choice="direction",
        rotation=sweeps.rotation,
        states=picture.motions_of(table),
        told=sweeps.told(),
        meaning="Each tile is a point of the sweep; white: failed.",
        orbits=picture.Orbits(table) if not len(curves) else None,
        high=True,
    )


def _tiles(key: str, by: str, title: str = "", **look: Any) -> picture.Panel:
    return picture.Panel(key, kind="tiles", by=by, title=title, **look)


def _map_panels(sweeps: Sweeps, key: str) -> Iterator[picture.Panel]:
    """Yield what maps show: classes, and flight if there is any."""
    sync = {name: (colour, describe_sync(name, sweeps.rotation)) for name, colour in picture.SYNC.items()}
    sync["none"] = (picture.SYNC["none"], picture.NOT_SYNCHRONOUS)
    yield _tiles(key, "sync", "synchronization", classes=sync)
    yield _tiles(key, "period_class", "period (turns)", classes={name: (c, name) for name, c in PERIODS.items()})
    if "flight_fraction" in sweeps.table and bool((sweeps.table["flight_fraction"] > 0.0).any()):
        yield _tiles(key, "flight_fraction", "flight", label="flight fraction; white: no flight", least=1.0)


def boundary_series(curves: pd.DataFrame, begin: int, colours: Sequence[str]) -> list[picture.Series]:
    """Return boundaries of orbits by kind, from a place on; those of orbits that no motion comes to are thin."""
    reached = (curves.groupby("curve")["n_unstable"].transform("min") == 0).astype(bool)
    kinds, series = list(SPECIAL_POINTS), []
    for (kind, is_reached), rows in curves.groupby(["kind", reached], sort=False):
        number = kinds.index(str(kind)) if kind in kinds else len(kinds)
        places = [
            place for own in picture.in_groups(rows, ["curve"]) for place in [*(begin + own.index), picture.BROKEN]
        ]
        look: dict[str, Any] = {"colour": colours[number % len(colours)], "width": 1.4}
        look |= {"dash": _DASHES[number % len(_DASHES)]} if len(colours) == 1 else {}
        if not is_reached:
            look |= {"width": 0.6, "look": UNREACHED} | ({"dash": ":"} if len(colours) > 1 else {})
        label = ": ".join(filter(None, (str(kind), SPECIAL_POINTS.get(str(kind), ""))))
        series.append(picture.Series(label, places[:-1], mode="lines", **look))
    return series


_MAKERS: Mapping[str, Callable[[Sweeps, Sequence[str]], picture.Picture]] = {
    "response": response,
    "bifurcation": bifurcation,
    "map": regimes,
}
