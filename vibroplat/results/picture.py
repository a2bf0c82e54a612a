"""A picture as data: what a study's tables show, drawn in print by one function and on the page by another.

A picture has points, the rows of a table and behind them those of a second table of special points. Whatever it shows
tells its points by their places in this order: series, marks and the choice among facets. How numbers are named, and in
which unit they stand on an axis, follows from the names of their columns. Nothing here draws.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results.files import SavedFiles, directory_of
from vibroplat.results.labels import EXCITATION, in_ratios, is_number
from vibroplat.results.result import Result

#: Colours of curves: those of Okabe and Ito, without their yellow, which is too pale for lines on white.
CURVES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK = CURVES
#: Lines of reference, what failed, and what is behind.
REFERENCE, FAILED, BEHIND = "#666666", "#a00000", "#b4b4b4"
#: Kinds of synchronization and their colours.
SYNC = {"antiphase": BLUE, "in-phase": ORANGE, "intermediate": GREEN, "none": "#3c3c3c"}
#: The colour scale viridis at even distances, from which all its colours follow to a few parts of 256.
_SCALE = ("#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725")
#: Share of the scale that curves use: its palest end is too pale for lines on white.
_DARK = 0.9
#: What is known of a point, in the order of their numbers in :attr:`Picture.states`.
STATES = ("full", "open", "half", "failed")
FULL, OPEN, HALF, LOST = range(4)
#: What states of points of motions mean.
MOTIONS = ("periodic", "not periodic", "undecided", "failed")
#: The place at which a line is broken.
BROKEN = -1
#: What exciters do that are not synchronous.
NOT_SYNCHRONOUS = "not synchronous"
#: Measures that pictures show, one panel each, in this order.
DRAWN = (
    *("rms_y_m", PHASE_COLUMN, "gap_max_m", "contact_force_max_n", "motor_power_w", "flight_fraction"),
    *("impulse_max_n_s", "rms_x_m", "rms_phi_rad", "lyapunov_per_s"),
)
#: Least range of an axis of RMS, relative to the largest RMS: small quantities are drawn small.
LEAST_RANGE = 0.02
#: Share of the largest RMS (m or rad) up to which another one is rounding: orbits in antiphase have 2e-13 m along x and
#: 4e-11 rad beside 9e-3 m along y.
ROUNDING = 1e-7

Places = np.ndarray[Any, np.dtype[np.int_]]


# -- what is drawn -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Panel:
    """A panel: a column over the axis of its picture, or over another one.

    Attributes
    ----------
    column, x
        Columns of the vertical and of the horizontal axis; "" for the axis of the picture.
    kind
        ``points``: curves and dots; ``tiles``: one for each point, in rows; ``bars``: horizontal ones, over the words
        of ``column``; ``stack``: fractions on each other; ``plane``: of complex numbers, with the unit circle.
    by, classes
        Column by which dots and tiles are coloured, "" for the colour of their series; and colours and names by its
        values, without them along a scale.
    label, title
        What is said beside the column and above the panel; what follows from the column if "".
    least
        The axis begins at 0 and goes at least to here (SI units); None: as far as the points.
    scale
        Of the vertical axis; ``one`` has room for numbers near 1.
    """

    column: str
    x: str = ""
    kind: Literal["points", "tiles", "bars", "stack", "plane"] = "points"
    by: str = ""
    classes: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    label: str = ""
    title: str = ""
    least: float | None = None
    scale: Literal["linear", "log", "one"] = "linear"


@dataclass(frozen=True)
class Series:
    """Points that belong together.

    Attributes
    ----------
    label, look
        What colour, and what line and symbol say; each is named once.
    rows
        Places of its points; :data:`BROKEN` where its line is.
    mode
        ``lines`` (a single point is a dot), ``markers``, ``both``, or ``dots``: many small ones.
    symbol, dash, width, size, pale
        Matplotlib's marker and style of lines, factors of its width and of markers, and whether it is half transparent.
    """

    label: str
    rows: Sequence[int] | Places
    look: str = ""
    colour: str = BLUE
    mode: Literal["lines", "markers", "both", "dots"] = "both"
    symbol: str = "o"
    dash: Any = "-"
    width: float = 1.0
    size: float = 1.0
    pale: bool = False

    @cached_property
    def places(self) -> Places:
        """The places of its points as an array."""
        return np.asarray(self.rows, dtype=int)


class Mark(NamedTuple):
    """Special points of one kind, what they mean, and their marker; ``rows`` are their places."""

    kind: str
    meaning: str
    symbol: str
    rows: Sequence[int]
    colour: str = ""


class Facet(NamedTuple):
    """Panels of some series alone, by their numbers, with others in grey behind."""

    label: str
    series: Sequence[int]
    behind: Sequence[int] = ()


class Line(NamedTuple):
    """Lines of reference at values of a column, across each panel that has it as an axis."""

    column: str
    at: Sequence[float]
    label: str = ""
    dash: str = "--"


class Range(NamedTuple):
    """An interval of a column that is shaded."""

    column: str
    low: float
    high: float
    label: str


@dataclass(frozen=True)
class Orbits:
    """Points whose orbits the page can move through.

    Attributes
    ----------
    table
        A row for each, from which its orbit can be computed: its period, and an outcome.
    first
        Rows that come first where there is no room for all.
    owner
        For each place of the picture the row whose orbit it has; None: the row at its place.
    words
        What is said above the orbit of a special point, and of a point that moves as one of another table.
    """

    table: pd.DataFrame
    first: Sequence[int] = ()
    owner: Sequence[int | None] | None = None
    words: str = ""


@dataclass(frozen=True)
class Picture:
    """What is shown of a study.

    Attributes
    ----------
    name, heading, title
        The name of the figure, of its section on the page, and of the result.
    table, special
        The points, and special ones behind them; ``table_name`` and ``special_name`` say what their rows are.
    axes
        Columns that it may be drawn over; in print over the first one.
    panels, series, marks, lines, ranges, facets
        What is drawn; without facets all series at once.
    drawn
        Where points are, by their places; only where these are not in both tables.
    states, meanings
        Number in :data:`STATES` of each place, and what these mean; None: all are full.
    told, meaning
        What is said below the title in print, and below the figure on the page.
    rotation
        How the exciters rotate; "" if that varies or is not known.
    choice
        Column by which facets are chosen.
    scale
        Column whose numbers the colours of series follow.
    orbits
        What moves on the page.
    high, counted
        Whether panels are high; and whether each measure is drawn over itself in print, which shows how often its
        values occur.
    places
        Where it is shown.
    """

    name: str
    heading: str
    title: str
    table: pd.DataFrame
    table_name: str
    axes: Sequence[str]
    panels: Sequence[Panel]
    series: Sequence[Series]
    marks: Sequence[Mark] = ()
    lines: Sequence[Line] = ()
    ranges: Sequence[Range] = ()
    facets: Sequence[Facet] = ()
    special: pd.DataFrame | None = None
    special_name: str = ""
    drawn: pd.DataFrame | None = None
    states: Places | None = None
    meanings: Sequence[str] = MOTIONS
    told: str = ""
    meaning: str = ""
    rotation: str = ""
    choice: str = ""
    scale: str = ""
    orbits: Orbits | None = None
    high: bool = False
    counted: bool = False
    places: Collection[str] = ("print", "page")

    @cached_property
    def points(self) -> pd.DataFrame:
        """Where points are, a row for each place."""
        count = len(self.table) + (0 if self.special is None else len(self.special))
        if self.drawn is not None:
            return finite(self.drawn if len(self.drawn) >= count else self.drawn.reindex(range(count)))
        return finite(self.table if self.special is None else pd.concat([self.table, self.special], ignore_index=True))

    def log(self, column: str) -> bool:
        """Whether a horizontal axis is logarithmic."""
        return column in self.points and is_number(self.points[column]) and in_ratios(self.points[column])


# -- colours and symbols -----------------------------------------------------------------------------------------------


def shade(share: float) -> str:
    """Return a colour of the scale at a share of its length, from 0, dark, to 1, pale."""
    known = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in _SCALE])
    place = np.linspace(0.0, 1.0, len(_SCALE))
    return "#" + "".join(f"{round(float(np.interp(share, place, part))):02x}" for part in known.T)


def shades(values: Sequence[float]) -> list[str]:
    """Return colours of curves that follow numbers."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    return [shade(_DARK * (value - low) / (high - low or 1.0)) for value in values]


def palette(count: int) -> list[str]:
    """Return so many colours, distinct ones while there are enough."""
    return list(CURVES[:count]) if count <= len(CURVES) else shades(list(map(float, range(count))))


def attractor_colours(attractors: Iterable[str]) -> dict[str, str]:
    """Return colours of attractors, which their order does not change; their names begin with the synchronization.

    The first one of a synchronization, an orbit if there is any, has its colour on maps, others have what is left.
    """
    given = list(dict.fromkeys(attractors))
    names = sorted(given, key=lambda name: (", period" not in name, name))
    firsts = {name.partition(",")[0]: name for name in reversed(names)}
    found = {name: SYNC[sync] for sync, name in firsts.items() if sync in SYNC}
    left = sorted((c for c in CURVES if c not in found.values()), key=lambda colour: colour in SYNC.values())
    others = [name for name in names if name not in found]
    found |= {name: left[number % len(left)] for number, name in enumerate(others)}
    return {name: found[name] for name in given}


# -- tables ------------------------------------------------------------------------------------------------------------


def finite(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose infinite numbers are missing, as no axis has room for them."""
    return table.replace([np.inf, -np.inf], np.nan)


def fills(table: pd.DataFrame, column: str) -> bool:
    """Whether a table has numbers in a column."""
    return column in table and is_number(table[column]) and bool(table[column].notna().any())


def axes_of(table: pd.DataFrame, columns: Iterable[str]) -> list[str]:
    """Return those of some columns that points may be drawn over, numbers that vary, in their order."""
    given = [name for name in dict.fromkeys(columns) if name in table and is_number(table[name])]
    return [name for name in given if len(table[name].dropna().unique()) > 1] or given[:1]


def measures(table: pd.DataFrame, columns: Iterable[str] = DRAWN, asked: Sequence[str] = ()) -> list[Panel]:
    """Return the panels of columns that a table fills, at least one, or of those that are asked for.

    What moves by rounding alone has none, and what is small is drawn small.
    """
    columns = [*dict.fromkeys(asked or columns)]
    largest = {name: float(table[name].abs().max()) for name in columns if fills(table, name)}
    moved = max((float(table[name].abs().max()) for name in table if str(name).startswith("rms_")), default=0.0)
    least = {name: ROUNDING * moved if name.startswith("rms") else 0.0 for name in largest}
    found = [name for name, size in largest.items() if size > least[name]] or columns[:1]
    ends = dict.fromkeys(("gap_max_m", "contact_force_max_n"), 0.0) | {"flight_fraction": 1.0}
    ends |= {name: LEAST_RANGE * np.nan_to_num(moved) for name in columns if name.startswith("rms")}
    return [Panel(name, least=ends.get(name)) for name in asked or found]


def states_of(open_: Any, failed: Any = False, undecided: Any = False) -> Places:
    """Return the states of points from what is so of each."""
    found = np.where(np.asarray(undecided, dtype=bool), HALF, np.where(np.asarray(open_, dtype=bool), OPEN, FULL))
    return np.where(np.asarray(failed, dtype=bool), LOST, found)


def motions_of(table: pd.DataFrame) -> Places:
    """Return the states of points by what is known of their motion."""
    motion = table["motion"] if "motion" in table else pd.Series("periodic", table.index)
    failed = table["outcome"] != "ok" if "outcome" in table else table.get(EXCITATION, motion).isna()
    return states_of(motion != "periodic", failed, motion == "undecided")


def in_groups(table: pd.DataFrame, keys: Sequence[str]) -> Iterator[pd.DataFrame]:
    """Yield the rows of a table that share keys, in its order."""
    yield from (rows for _, rows in table.groupby([*keys], sort=False, dropna=False))


def rows_of(chosen: Any) -> Places:
    """Return the places at which something is so."""
    return np.flatnonzero(np.asarray(chosen, dtype=bool))


def rows_in(result: Result, name: str, *columns: Collection[str]) -> pd.DataFrame:
    """Return a table of a result, with these columns as :meth:`Result.columns` has them, and one row or more."""
    table = result.columns(name, *columns)
    if table.empty:
        where = result.directory or result.name
        raise TableError(f"{where} holds an empty {name} table; there is nothing to plot")
    return table


def beside(result: Result, command: str, name: str) -> pd.DataFrame | None:
    """Return a table of another command beside a result, None if there is none."""
    place = result.home and directory_of(result.home, command)
    return SavedFiles(place, command).table(name) if place and any(place.glob(f"{name}.*")) else None
