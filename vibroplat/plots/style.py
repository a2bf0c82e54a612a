"""Common style of figures: colours that colour-blind readers can tell apart, and how figures are made and saved."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from vibroplat.results.labels import plain
from vibroplat.results.picture import BLUE, GREEN, VERMILION
from vibroplat.results.tables import replace_file, result_directory

Form = Literal["png", "pdf", "svg"]

PLATFORM, MATERIAL, FORCE = BLUE, VERMILION, GREEN
#: Shade of contact.
CONTACT = "#e3eaf0"
#: Markers of curves that may lie on each other.
MARKERS = "osD^vPX<>hp"
#: Most curves that a legend names; hundreds would cover the figure, and setting them takes longer than drawing it.
MOST_ENTRIES = 24
#: Share of an axis beyond what is on it, so that markers are whole.
MARGIN = 0.05
#: Least range of an axis over its largest number.
LEAST_SHARE = 2e-4
#: Ratio of the ends of a logarithmic axis up to which there are ticks between its powers of ten.
NEAR_DECADES = 300.0
#: Letters of a legend that an inch has room for.
LETTERS = 14.0

_STYLE: Any = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 130,
    "figure.titleweight": "bold",
    "figure.titlesize": 10.5,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.formatter.useoffset": False,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.2,
    "font.size": 9.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "pdf.fonttype": 42,  # text stays text, as publishers ask for
    "svg.hashsalt": "vibroplat",  # the same figure gives the same file
    # settings of matplotlib that start programs; a file in the current directory may have others
    "text.usetex": False,
    "animation.ffmpeg_path": "ffmpeg",
    "animation.ffmpeg_args": [],
}
#: Dates that would make two files of the same figure differ.
_DATES: dict[Form, dict[str, None]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}


@dataclass(frozen=True)
class Saving:
    """How and where figures are saved.

    Attributes
    ----------
    form
        Format of the files.
    dpi
        Dots per inch, also of what is drawn as dots in a PDF or SVG; that of the style if None.
    directory
        Where they are saved; that of the result if None.
    """

    form: Form = "png"
    dpi: int | None = None
    directory: Path | None = None


@contextmanager
def styled() -> Iterator[None]:
    """Use the common style."""
    with mpl.rc_context(_STYLE):
        yield


class _Figure(Figure):
    """A figure that is none of pyplot's, so that drawing needs no display and changes no backend."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG: so a notebook shows it, without a backend."""
        written = io.BytesIO()
        with styled():
            self.savefig(written, format="png", dpi="figure")
        return written.getvalue()


def new_figure(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Figure, Any]:
    """Return a figure of a size (inch) and its axes, an array of rows and columns."""
    figure = _Figure(figsize=size)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def panel_grid(count: int, columns: int, size: tuple[float, float], label: str) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels, which share a horizontal axis of this label; each column is filled downwards."""
    figure, axes = new_figure(-(-count // columns), columns, size, sharex=True)
    panels = list(axes.T.ravel())
    for axis in panels[count:]:
        axis.set_axis_off()
    for axis in (panels[len(axes) - 1], panels[count - 1]):
        axis.set_xlabel(label)
        axis.tick_params(labelbottom=True)
    return figure, panels


def begin_at_zero(axis: Axes, end: float | None = None) -> None:
    """Begin a vertical axis at 0, with room for lines and markers at both ends; one below 0 stays as it is."""
    top = axis.get_ylim()[1] if end is None else end
    if top > 0.0:
        axis.set_ylim(-MARGIN * top, (1.0 + MARGIN) * top)


def widen_ticks(axis: Axes, which: Literal["x", "y"]) -> None:
    """Widen an axis whose numbers would differ in so many digits that there is no room for them."""
    low, high = axis.get_xlim() if which == "x" else axis.get_ylim()
    missing = LEAST_SHARE * max(abs(low), abs(high)) - (high - low)
    if missing > 0.0:
        axis.set(**{f"{which}lim": (low - 0.5 * missing, high + 0.5 * missing)})


def in_decades(axis: Axes, which: Literal["x", "y"]) -> None:
    """Make an axis logarithmic once all is drawn, with plain numbers as its ticks."""
    axis.set(**{f"{which}scale": "log"})
    along = axis.xaxis if which == "x" else axis.yaxis
    low, high = along.get_view_interval()
    along.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < NEAR_DECADES * low else (1.0,)))
    along.set_major_formatter("{x:g}")
    along.set_minor_formatter("")


def head(figure: Figure, name: str, parameters: str = "") -> None:
    """Put the name of a result above a figure, and below it its parameters."""
    figure.suptitle(plain(name), x=0.01, ha="left")
    if parameters:
        first: Axes = figure.axes[0]
        own = first.get_title(loc="left")
        first.set_title(f"{parameters}\n{own}" if own else parameters, loc="left")


def entry(label: str, **look: Any) -> Line2D:
    """Return an entry of a legend with the look of a line or of its markers."""
    return Line2D([], [], label=label, **look)


def few(entries: Sequence[Line2D]) -> list[Line2D]:
    """Return at most as many entries of a legend as fit below a figure; the last says how many were left out."""
    if len(entries) <= MOST_ENTRIES:
        return list(entries)
    places = np.linspace(0, len(entries) - 1, MOST_ENTRIES).round().astype(int)
    return [entries[i] for i in places] + [entry(f"and {len(entries) - MOST_ENTRIES} more between them", ls="")]


def legend_below(figure: Figure, handles: Iterable[Any]) -> None:
    """Put a legend below a figure, with one entry for each label, in as many columns as the labels leave room for."""
    entries = {str(handle.get_label()): handle for handle in handles}
    longest = max((len(re.sub(r"\$[^$]*\$", "MM", label)) for label in entries), default=0)
    room = figure.get_figwidth() * LETTERS
    columns = max(1, min(5, len(entries), int(room / (longest + 6))))
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)


def save(figure: Figure, directory: Path, name: str, saving: Saving | None = None) -> Path:
    """Write a figure into a directory, or that of ``saving``, and return the path.

    Raises
    ------
    TableError
        It cannot be written.
    """
    saving = saving or Saving()
    place = saving.directory
    if place is not None:
        result_directory(place.parent, place.name)
    path = (place or directory) / f"{name}.{saving.form}"
    metadata: Any = _DATES[saving.form]
    with styled():
        replace_file(path, lambda file: figure.savefig(file, dpi=saving.dpi or "figure", metadata=metadata))
    return path
