"""The legend of a picture as data: what its colours, lines, fillings and marks mean, drawn in print and on the page."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

from vibroplat.results.picture import BEHIND, BLACK, BROKEN, FAILED, LOST, REFERENCE, Panel, Picture, Series, Strips

#: Fillings of markers by the state of a point.
FILLINGS = ("full", "none", "bottom", "none")
#: Opacity of tiles, of bands, of shaded intervals, and of pale marks.
TILE, BAND, SHADE, HALF = 0.75, 0.25, 0.15, 0.5
#: Most curves that a legend names; hundreds would cover the figure, and setting them takes longer than drawing it.
MOST_ENTRIES = 24
#: Hatch of tiles of points that failed.
HATCH = "xxxx"


class Entry(NamedTuple):
    """An entry of a legend.

    Attributes
    ----------
    text, more
        What it is, and a further meaning.
    kind
        ``line``, also with markers on it, ``marker`` or ``area``.
    colour, opacity
        Of all of it.
    dash, width
        Of a line.
    symbol, size, filling
        Of a marker, as matplotlib has them.
    hatch
        Of an area.
    """

    text: str
    kind: Literal["line", "marker", "area"]
    colour: str = BLACK
    more: str = ""
    opacity: float = 1.0
    dash: Any = "-"
    width: float = 0.9
    symbol: str = ""
    size: float = 4.0
    filling: str = "full"
    hatch: str = ""

    @property
    def label(self) -> str:
        """All that it says."""
        return f"{self.text}: {self.more}" if self.more else self.text


def legend_of(picture: Picture, *, colours: bool = True) -> list[Entry]:
    """Return the entries of what a picture shows, with those of its colours or without them; strips have their own."""
    named = {one.label: _of_colour(one) for one in picture.series if one.label and colours}
    entries = _few([*named.values()])
    for panel in picture.panels:
        entries += _of_panel(picture, panel)
    entries += _of_looks(picture)
    if picture.jumps:
        entries.append(Entry("jump", "line", REFERENCE, dash=":", width=0.6, symbol="^", size=3.0))
    for mark in picture.marks:
        filling = "full" if mark.colour else "none"
        look: dict[str, Any] = {"symbol": mark.symbol, "size": 5.0, "filling": filling}
        entries.append(Entry(mark.kind, "marker", mark.colour or BLACK, mark.meaning, **look))
    for line in picture.lines:
        if line.label and line.at:
            entries.append(Entry(line.label, "line", line.colour, dash=line.dash))
    entries += [Entry(one.label, "area", REFERENCE, opacity=SHADE) for one in picture.ranges]
    return [*{entry.text: entry for entry in entries}.values()]


def legend_of_strips(strips: Strips) -> list[Entry]:
    """Return the entries of the colours, hatches and lines of strips."""
    entries = [Entry(text, "area", colour, opacity=TILE) for colour, text in strips.classes.values()]
    entries += [Entry(text, "area", "white", hatch=hatch) for hatch, text in strips.hatches.items()]
    return entries + ([Entry(strips.line, "line", width=1.4)] if strips.line else [])


def _few(entries: list[Entry]) -> list[Entry]:
    """Return at most as many entries as there is room for; the last says how many were left out."""
    if len(entries) <= MOST_ENTRIES:
        return entries
    places = np.linspace(0, len(entries) - 1, MOST_ENTRIES).round().astype(int)
    return [*(entries[n] for n in places), Entry(f"and {len(entries) - MOST_ENTRIES} more between them", "marker")]


def _of_colour(one: Series) -> Entry:
    """Return the entry of the colour of a series."""
    if one.mode in ("band", "shade"):
        return Entry(one.label, "area", one.colour, opacity=BAND if one.mode == "band" else 1.0)
    if one.mode in ("markers", "dots"):
        return Entry(one.label, "marker", one.colour, symbol=one.symbol)
    dash = one.dash if one.mode == "lines" and not one.look else "-"
    return Entry(one.label, "line", one.colour, dash=dash, width=2.0)


def _of_panel(picture: Picture, panel: Panel) -> Iterator[Entry]:
    """Yield entries of the colours, hatches and contours of a panel."""
    rows = np.concatenate([one.places for one in picture.series if one.mode == "dots"] or [np.zeros(0, dtype=int)])
    is_tiles = panel.kind == "tiles"
    if is_tiles and (picture.states == LOST).any():
        yield Entry("failed", "area", "white", hatch=HATCH)
    known = {*picture.points[panel.by].iloc[rows]} if panel.classes else ()
    for name in (name for name in panel.classes if name in known):
        colour, text = panel.classes[name]
        yield Entry(text or name, "area", colour, opacity=TILE if is_tiles else 1.0)
    yield from (Entry(text, "area", "white", hatch=hatch) for hatch, text in panel.hatches.items())
    for dash, text in panel.contours.levels.values() if panel.contours else ():
        yield Entry(text, "line", dash=dash)


def _of_looks(picture: Picture) -> Iterator[Entry]:
    """Yield the entries of lines and symbols, and of states of points."""
    for one in (one for one in picture.series if one.look):
        look: dict[str, Any] = {"dash": one.dash, "width": 0.9 * one.width, "opacity": HALF if one.pale else 1.0}
        symbol = "" if one.mode == "lines" else one.symbol
        kind: Any = "line" if one.mode in ("lines", "both") else "marker"
        colour = BEHIND if one.colour == BEHIND else REFERENCE
        yield Entry(one.look, kind, colour, symbol=symbol, size=4.5 * one.size, **look)
    marked = [one.places[one.places != BROKEN] for one in picture.series if one.mode in ("both", "markers")]
    rows, states = np.concatenate([*marked, np.zeros(0, dtype=int)]), picture.states
    present = np.unique(states[rows[rows < len(states)]])
    for state in present if present.any() else ():
        look = {"symbol": "x", "size": 5.0} if state == LOST else {"symbol": "o", "size": 6.0}
        if meaning := picture.meanings[state]:
            colour = FAILED if state == LOST else BLACK
            yield Entry(meaning, "marker", colour, filling=FILLINGS[state], **look)
