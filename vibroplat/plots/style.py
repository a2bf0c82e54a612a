"""Common style of figures: colours that colour-blind readers can tell apart, and how figures are made and saved."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, MaxNLocator

from vibroplat.results.tables import replace_file, result_directory

Form = Literal["png", "pdf", "svg"]

#: Room for a tick of a horizontal and of a vertical axis (inch), and letters of a label of the latter that an inch has.
TICK, TICK_ABOVE, LABEL = 0.65, 0.28, 13.5
#: Lines of a legend that a figure has room for, and the height of another one (inch).
LINES, LINE = 3, 0.2
#: Characters per inch of a legend, of a title and of the text below the title; colour of this text.
LETTERS, TITLE_LETTERS, CAPTION_LETTERS, CAPTION_COLOUR = 14.0, 11.5, 15.0, "#777777"

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
    "axes.titley": 1.0,  # as no ticks are above; to look for them takes a sixth of the time
    "axes.formatter.useoffset": False,
    "grid.alpha": 0.25,
    "lines.linewidth": 1.2,
    "font.size": 9.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "pdf.fonttype": 42,  # text stays text, as publishers ask for
    "svg.hashsalt": "vibroplat",  # the same figure gives the same file
    "text.usetex": False,  # it starts programs; a file in the current directory may have it
}
#: What matplotlib reads as mathematics: between dollar signs without a backslash.
_FORMULA = r"(?<!\\)\$[^$]*(?<!\\)\$"
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
        Dots per inch, also of rasterized parts of a PDF or SVG. Default: that of the style.
    directory
        Where they are saved. Default: the directory of the result.
    """

    form: Form = "png"
    dpi: int | None = None
    directory: Path | None = None


@contextmanager
def styled() -> Iterator[None]:
    """Use the common style. Letters that the font lacks are drawn as boxes, without a warning."""
    told = logging.getLogger("matplotlib.mathtext")
    level = told.level
    with mpl.rc_context(_STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        told.setLevel(logging.ERROR)
        try:
            yield
        finally:
            told.setLevel(level)


class _Figure(Figure):
    """A figure that is none of pyplot's, so that drawing needs no display and changes no backend."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG: so a notebook shows it, without a backend."""
        written = io.BytesIO()
        with styled():
            write_png(self, written)
        return written.getvalue()


def new_figure(
    rows: int,
    columns: int,
    size: tuple[float, float],
    above: float = 0.0,
    *,
    heights: Sequence[float] | None = None,
    widths: Sequence[float] | None = None,
    **shared: Any,
) -> tuple[Figure, Any, list[Any]]:
    """Return a figure of a size (inch), its axes in rows and columns, and those of a height above each column, if any.

    ``shared`` says which axes share their values, as matplotlib's ``Figure.subplots`` takes it.
    """
    figure = _Figure(figsize=(size[0], size[1] + above))
    each = size[1] / max(rows, 1)
    parts = [*([above] if above else []), *(each * height for height in heights or [1.0] * rows)]
    look: dict[str, Any] = {"height_ratios": parts, "width_ratios": widths, "squeeze": False}
    axes: Any = figure.subplots(len(parts), columns, **look, **shared)
    return (figure, axes[1:], list(axes[0])) if above else (figure, axes, [])


def head(figure: Figure, title: str, caption: str = "") -> None:
    """Put the title above a figure, and below the title, in grey, which result it shows."""
    _set_ticks(figure)
    for axis in figure.axes:
        room = axis.get_position().height * figure.get_figheight()
        if "\n" not in axis.get_ylabel():
            axis.set_ylabel(_wrapped(axis.get_ylabel(), LABEL * room, least=12))
    width = figure.get_figwidth()
    figure.suptitle(_wrapped(title, TITLE_LETTERS * width), x=0.01, ha="left")
    if caption:
        first = figure.axes[0]
        beside = max((len(text.get_text()) for text in first.get_yticklabels()), default=0) / CAPTION_LETTERS
        lines = "\n".join(_wrapped(line, CAPTION_LETTERS * (width - 0.8 - beside)) for line in caption.splitlines())
        own = first.get_title(loc="left") or first.get_title(loc="right")
        first.set_title("", loc="right")
        first.set_title(f"{lines}\n{own}" if own else lines, loc="left", color=CAPTION_COLOUR, fontsize=8.5)


def _set_ticks(figure: Figure) -> None:
    """Give linear axes as many ticks as there is room for."""
    for axis in figure.axes:
        box = axis.get_position()
        across, up = box.width * figure.get_figwidth() / TICK, box.height * figure.get_figheight() / TICK_ABOVE
        for along, room in ((axis.xaxis, across), (axis.yaxis, up)):
            if isinstance(along.get_major_locator(), AutoLocator):
                along.set_major_locator(MaxNLocator(int(np.clip(room, 2, 9)), steps=[1, 2, 5, 10]))


def _wrapped(text: str, letters: float, least: int = 20) -> str:
    """Break a text into lines of at most ``letters`` characters; a formula counts as one character."""
    formulas = iter(re.findall(_FORMULA, text))
    short = re.sub(_FORMULA, "\x00", text).replace("\x00 = ", "\x00\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}")
    short = short.replace(" … ", "\N{NO-BREAK SPACE}…\N{NO-BREAK SPACE}")
    lines = wrap(short, max(int(letters), least), break_on_hyphens=False)
    broken = "\n".join(lines).replace("\N{NO-BREAK SPACE}", " ")
    return re.sub("\x00", lambda _: next(formulas), broken)


def legend_below(figure: Figure, handles: Iterable[Any]) -> None:
    """Put a legend below a figure, with one entry for each label, in as many columns as the labels leave room for."""
    entries = {str(handle.get_label()): handle for handle in handles}
    longest = max((len(re.sub(r"\$[^$]*\$", "MM", label)) for label in entries), default=0)
    room = figure.get_figwidth() * LETTERS
    columns = max(1, min(5, len(entries), int(room / (longest + 6))))
    lines = -(-len(entries) // columns)
    figure.set_figheight(figure.get_figheight() + LINE * max(lines - LINES, 0))
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)


def write_png(figure: Figure, file: Any) -> None:
    """Write a figure as PNG, once all axes have their places: matplotlib would draw it twice to find them itself."""
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    figure.savefig(file, format="png", dpi=figure.dpi)


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
    figure.set_dpi(saving.dpi or figure.dpi)
    with styled():
        if saving.form == "png":
            replace_file(path, lambda file: write_png(figure, file))
        else:
            replace_file(path, lambda file: figure.savefig(file, dpi=figure.dpi, metadata=metadata))
    return path
