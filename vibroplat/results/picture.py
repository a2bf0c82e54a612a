"""A picture as data: what a study's tables show, drawn in print by one function and on the page by another.

A picture has points, the rows of a table and behind them those of a second table of special points. Series, marks
and strips refer to points by index into this sequence. Names of numbers and units follow from names of columns.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from vibroplat.columns import PHASE_COLUMN, name_sync
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import shown_unit
from vibroplat.frames import pd
from vibroplat.results.labels import halfway, in_ratios, is_number

#: Colours of curves: those of Okabe and Ito, without their yellow, which is too pale for lines on white.
CURVES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK = CURVES
#: Lines of reference, what failed, and what is behind.
REFERENCE, FAILED, BEHIND = "#666666", "#a00000", "#b4b4b4"
#: Kinds of synchronization and their colours.
SYNC = {"antiphase": BLUE, "in-phase": ORANGE, "intermediate": GREEN, "none": "#3c3c3c"}
#: Colours of modes of material that moves along the deck, and what they are called.
MODES = {
    "stick": (GREEN, "stick"),
    "slip+": (ORANGE, "slip towards +x"),
    "slip-": (PURPLE, "slip towards −x"),
    "flight": (SKY, "flight"),
}
#: The colour scale viridis at even distances, from which all its colours follow to a few parts of 256.
_SCALE = ("#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725")
#: Fraction of the scale that curves use: its palest end is too pale for lines on white.
_DARK = 0.9
#: Where axes of phase differences begin, so that 0 and π, near which exciters synchronize, are well inside.
LOWEST_PHASE = -0.5 * math.pi
#: What is known of a point in :attr:`Picture.states`; how markers show it.
FULL, OPEN, HALF, LOST = range(4)
#: What states of points of motions mean.
MOTIONS = ("periodic", "non-periodic", "undecided", "failed")
#: The place at which a line is broken, and the end of the columns that have the lower ends of bands.
BROKEN, LOW = -1, ":min"
#: Distance of two points relative to that of their neighbours from which strips do not go from one to the other.
MAX_GAP_RATIO = 4.0

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
        of ``column``; ``stack``: fractions on each other; ``plane``: of complex numbers, with the unit circle;
        ``ranks``: each point a dot in the order of its values, at the fraction of those that are not larger.
    height
        Its height over that of others.
    by, classes
        Column by which dots and tiles are coloured, "" for the colour of their series; and colours and names by its
        values, without them along a scale.
    label, title
        What is said beside the column and above the panel; what follows from the column if "".
    least
        The axis begins at 0 and goes at least to here (SI units); None: as far as the points.
    scale
        Of the vertical axis; ``asinh`` has room for numbers near 0.
    note
        What is said within the panel, in grey: which curves coincide, or that a bound is far away.
    hatch, hatches, contours
        Of tiles the column of their hatches and what these mean, and contours over them.
    """

    column: str
    x: str = ""
    kind: Literal["points", "tiles", "bars", "stack", "plane", "ranks"] = "points"
    by: str = ""
    classes: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    label: str = ""
    title: str = ""
    least: float | None = None
    scale: Literal["linear", "log", "asinh"] = "linear"
    note: str = ""
    hatch: str = ""
    hatches: Mapping[str, str] = field(default_factory=dict)
    contours: Contours | None = None
    height: float = 1.0

    def has(self, of: Collection[str]) -> bool:
        """Whether it is among panels that are given by their columns or titles."""
        return self.column in of or (self.title != "" and self.title in of)


class Contours(NamedTuple):
    """Lines over tiles where a column has these values, with what each means and its dash."""

    column: str
    levels: Mapping[float, tuple[str, str]]


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
        ``lines`` (a single point is a dot), ``markers``, ``both``, or ``dots``: many small ones; ``band``:
        between a column and that whose name ends with :data:`LOW`; ``stems`` from 0; ``shade`` of the whole
        height, between the breaks of the series.
    symbol, dash, width, size, pale
        Matplotlib's marker and style of lines, factors of its width and of markers, and whether it is half transparent.
    of
        Columns, or titles, of its panels; () for all: a curve is left out where it coincides with another one.
    """

    label: str
    rows: Sequence[int] | Places
    look: str = ""
    colour: str = BLUE
    mode: Literal["lines", "markers", "both", "dots", "band", "stems", "shade"] = "both"
    symbol: str = "o"
    dash: Any = "-"
    width: float = 1.0
    size: float = 1.0
    pale: bool = False
    of: Collection[str] = ()

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


class Jump(NamedTuple):
    """A jump between two points, by their places: a thin arrow in the panels of some columns or titles."""

    before: int
    after: int
    colour: str
    of: Collection[str]


class Word(NamedTuple):
    """A text at a point of the panel of a column, or beside it; values are in SI units. It names an area or a curve."""

    text: str
    column: str
    x: float
    y: float
    colour: str = BLACK
    beside: bool = False


class StripSpan(NamedTuple):
    """An interval of a strip: its ends, its class or "", its hatch or "", whether it has a line, and its text."""

    low: float
    high: float
    kind: str
    hatch: str
    lined: bool
    text: str


class Strip(NamedTuple):
    """What happens along one branch, in colours of classes over the axis.

    Attributes
    ----------
    label, colour
        What is said beside it, and the colour of that.
    rows
        Places of its points in the order of the axis.
    kinds, hatches, lined, texts
        Of each point its class, "" where it failed, its hatch, whether a line is below, and what is said above.
    """

    label: str
    colour: str
    rows: Sequence[int]
    kinds: Sequence[str]
    hatches: Sequence[str] = ()
    lined: Sequence[bool] = ()
    texts: Sequence[str] = ()

    def spans(self, values: Any) -> list[StripSpan]:
        """Return its intervals for the values that points have on the axis, each as far as points reach."""
        at = np.asarray(values, dtype=float)[[*self.rows]]
        order = np.flatnonzero(np.isfinite(at))[np.argsort(at[np.isfinite(at)], kind="stable")]
        if not len(order):
            return []
        spans = list[StripSpan]()
        for low, high, row in zip(*_neighbourhoods(at[order]), order, strict=True):
            defaults: Any = ((self.hatches, ""), (self.lined, False), (self.texts, ""))
            flags = [of[row] if of else none for of, none in defaults]
            span = StripSpan(float(low), float(high), self.kinds[row], *flags)
            if spans and spans[-1].high == low and spans[-1][2:] == span[2:]:
                span = spans.pop()._replace(high=span.high)
            spans.append(span)
        return spans


def _neighbourhoods(at: Any) -> tuple[Any, Any]:
    """Return from where to where points at ascending values reach.

    They reach half way to the next. Where that is :data:`MAX_GAP_RATIO` times the usual distance, as after a jump, they
    reach as far as usual: nothing is known of what is between.
    """
    edges = halfway(at)
    low, high = edges[:-1].copy(), edges[1:].copy()
    if len(at) > 2 and not in_ratios(at):
        half = 0.5 * np.diff(at)
        usual = np.maximum(np.maximum(np.append(0.0, half[:-1]), np.append(half[1:], 0.0)), np.median(half))
        far = np.flatnonzero(half > MAX_GAP_RATIO * usual)
        high[far], low[far + 1] = at[far] + usual[far], at[far + 1] - usual[far]
        low[0] = at[0] - (usual[0] if 0 in far else half[0])
        high[-1] = at[-1] + (usual[-1] if len(half) - 1 in far else half[-1])
    return low, high


@dataclass(frozen=True)
class Strips:
    """Strips over the axis of a picture, one below the other.

    Attributes
    ----------
    rows
        The strips.
    classes
        Colours of classes and what these mean.
    hatches, line
        What matplotlib's hatches mean, and what a line means.
    label
        What is said beside them all.
    """

    rows: Sequence[Strip]
    classes: Mapping[str, tuple[str, str]]
    hatches: Mapping[str, str] = field(default_factory=dict)
    line: str = ""
    label: str = ""

    def of(self, facet: Facet | None) -> Sequence[Strip]:
        """Return the strips of a facet, or all of them."""
        return [self.rows[number] for number in facet.strips] if facet and facet.strips else self.rows


class Facet(NamedTuple):
    """Panels of some series alone, by their numbers, and strips, all of them if there are no numbers.

    With a ``width``, over that of others, they have a horizontal axis of their own.
    """

    label: str
    series: Sequence[int]
    width: float = 0.0
    strips: Sequence[int] = ()


class Line(NamedTuple):
    """Lines of reference at values of a column, across each panel that has it as an axis.

    ``label`` is what they mean in a legend.
    """

    column: str
    at: Sequence[float]
    label: str = ""
    dash: str = "--"
    colour: str = REFERENCE


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
        The name of the figure, of its section on the page, and the result in one sentence, from its tables.
    table, special
        The points, and special ones behind them; ``table_name`` and ``special_name`` say what their rows are.
    axes
        Columns that it may be drawn over; in print over the first one.
    panels, series, marks, lines, ranges, facets
        What is drawn; without facets all series at once.
    strips, jumps, words
        Strips above the panels, arrows between points, and texts within panels.
    drawn
        Where points are, by their places; only where these are not in both tables.
    states, meanings
        One of FULL, OPEN, HALF, LOST for each place, and what these mean; without any all are full.
    caption, meaning
        What is said below the title in print, and below the figure on the page.
    rotation
        How the exciters rotate; "" if that varies or is not known.
    scale
        Column whose numbers the colours of series follow.
    orbits
        What moves on the page.
    high
        Whether panels are high.
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
    strips: Strips | None = None
    jumps: Sequence[Jump] = ()
    words: Sequence[Word] = ()
    special: pd.DataFrame | None = None
    special_name: str = ""
    drawn: pd.DataFrame | None = None
    states: Places = field(default_factory=lambda: np.zeros(0, dtype=int))
    meanings: Sequence[str] = MOTIONS
    caption: str = ""
    meaning: str = ""
    rotation: str = ""
    scale: str = ""
    orbits: Orbits | None = None
    high: bool = False
    places: Collection[str] = ("print", "page")

    @cached_property
    def points(self) -> pd.DataFrame:
        """Where points are, a row for each place."""
        count = len(self.table) + (0 if self.special is None else len(self.special))
        if self.drawn is not None:
            return finite(self.drawn if len(self.drawn) >= count else self.drawn.reindex(range(count)))
        return finite(self.table if self.special is None else pd.concat([self.table, self.special], ignore_index=True))

    @cached_property
    def _sizes(self) -> Mapping[Any, float]:
        """The largest sizes of numbers."""
        return self.points.select_dtypes("number").abs().max().fillna(0.0).to_dict()

    def unit(self, column: str) -> tuple[str, float]:
        """Return the unit in which a column is shown, in print and on the page, and the factor from SI units to it."""
        return shown_unit(column, self._sizes.get(column, 0.0))

    def log(self, column: str) -> bool:
        """Whether a horizontal axis is logarithmic."""
        return column in self.points and is_number(self.points[column]) and in_ratios(self.points[column])


# -- colours and symbols -----------------------------------------------------------------------------------------------


def shade(fraction: float) -> str:
    """Return a colour of the scale at a fraction of its length, from 0, dark, to 1, pale."""
    known = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in _SCALE])
    positions = np.linspace(0.0, 1.0, len(_SCALE))
    return "#" + "".join(f"{round(float(np.interp(fraction, positions, part))):02x}" for part in known.T)


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
    known = {name_sync(sync): colour for sync, colour in SYNC.items()}
    colours = {name: known[sync] for sync, name in firsts.items() if sync in known}
    left = sorted((c for c in CURVES if c not in colours.values()), key=lambda colour: colour in SYNC.values())
    others = [name for name in names if name not in colours]
    colours |= {name: left[number % len(left)] for number, name in enumerate(others)}
    return {name: colours[name] for name in given}


# -- tables ------------------------------------------------------------------------------------------------------------


def on_axis(column: str, values: Any) -> Any:
    """Return values of a column as an axis has them: in SI units, phase differences from −π/2 to 3π/2."""
    numbers = np.asarray(values, dtype=float)
    return np.mod(numbers - LOWEST_PHASE, TURN) + LOWEST_PHASE if column == PHASE_COLUMN else numbers


def finite(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose infinite numbers are missing, as no axis has room for them."""
    numbers = table.select_dtypes("number")
    wrong = [str(name) for name in numbers if np.isinf(numbers[name].to_numpy(dtype=float, na_value=np.nan)).any()]
    return table.assign(**{name: numbers[name].replace([np.inf, -np.inf], np.nan) for name in wrong})
