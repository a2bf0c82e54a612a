"""Pictures of studies on the page: their figures, what moves when a point is clicked, and their tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vibroplat.page.machine import PLAY, as_json
from vibroplat.page.orbits import Motions
from vibroplat.page.panels import entry_html, figures
from vibroplat.page.svg import Plot, Scale, plain_text
from vibroplat.page.tables import fold, hint, rows_on_page, table_html
from vibroplat.page.text import escape
from vibroplat.page.view import View, axis_name, ends_of_scale, heading
from vibroplat.results.legend import legend_of
from vibroplat.results.picture import Facet, Picture

#: Room of the figures of a picture, over further axes too, which have all panels once more (bytes).
ROOM = 450_000
#: Most rows of special points on the page.
MOST_SPECIAL = 500


def picture_html(number: int, picture: Picture, motions: Motions) -> str:
    """Return the section of a picture: figures, what a click shows, further axes and facets, and tables, folded."""
    count = len(picture.table)
    rows = rows_on_page(picture.table)
    special = np.arange(0 if picture.special is None else min(len(picture.special), MOST_SPECIAL))
    places = np.concatenate([rows, count + special])
    renumbered = np.full(max(len(picture.points), count + len(special), 1), -1)
    renumbered[places] = np.arange(len(places))
    view = View(picture, picture.axes[0] if picture.axes else "", renumbered)
    facets: list[Facet | None] = [*picture.facets] if len(picture.facets) > 1 else [None]
    bars = bool(picture.panels) and picture.panels[0].kind == "bars"
    shown, others = (facets, []) if bars else (facets[:1], facets[1:])
    first = [figure for facet in shown for figure in figures(view, facet)]
    name = f"<h3>{escape(plain_text(facets[0].label))}</h3>" if facets[0] is not None and not bars else ""
    nothing = plain_text(picture.panels[0].title) if picture.panels else ""
    empty = hint(nothing or "Nothing here has a value that could be drawn.")
    moved = motions.of(picture, places)
    more = _more(view, others, facets, ROOM - sum(map(len, first)))
    home, tables = _home(number, picture, motions), ""
    if home == number:
        tables = table_html(f"Table {picture.table_name}", picture.table, rows)
    if picture.special is not None:
        tables += table_html(picture.special_name, picture.special, special)
    texts = [picture.caption.replace("\n", "; "), picture.meaning, _count_orbits(moved, len(places))]
    sentences = " ".join(f"{text.removesuffix('.')}." for text in texts if text)
    marks = {str(renumbered[row]): mark.kind for mark in picture.marks for row in mark.rows if renumbered[row] >= 0}
    own = moved if home == number else moved | {"list": []}
    data = as_json(own | {"home": home, "rows": len(rows), "marks": marks})
    look = "panels bars" if bars else "panels"
    return (
        f'<section class="study" id="picture-{number}"><h2>{escape(picture.heading)} '
        f"<small>{escape(plain_text(picture.title))}</small></h2>{_key(picture)}"
        f'<div class="beside{"" if moved["list"] else " wide-one"}">'
        f'<div class="{look}">{name}{"".join(first) or empty}</div>'
        f"{_aside(moved)}</div>{hint(plain_text(sentences))}{more}{tables}"
        f'<script type="application/json" class="data">{data}</script></section>'
    )


def _home(number: int, picture: Picture, motions: Motions) -> int:
    """Return the number of the first picture that has the table and the orbits of a picture, which may be its own."""
    if picture.special is not None or picture.orbits is None:
        return number
    return motions.homes.setdefault((id(picture.table), id(picture.orbits.table)), number)


def _more(view: View, others: Sequence[Facet | None], facets: Sequence[Facet | None], room: int) -> str:
    """Return the other facets of a picture, and it over its other axes, folded."""
    html = "".join(_figures(plain_text(facet.label), view, [facet]) for facet in others if facet is not None)
    over, axes, left = "", list[str](), list[str]()
    for axis in view.picture.axes[1:]:
        drawn = _figures(f"Over {axis_name(axis)}", replace(view, axis=axis), facets)
        fits = len(over) + len(drawn) <= room
        over += drawn if fits else ""
        (axes if fits else left).extend([axis_name(axis)] * bool(drawn))
    none = hint(f"The page has no room for curves over {', '.join(left)}.") if left else ""
    return html + (fold("Over another column", ", ".join(axes), over) if axes[1:] else over) + none


def _figures(label: str, view: View, facets: Sequence[Facet | None]) -> str:
    html = "".join(figure for facet in facets for figure in figures(view, facet))
    return fold(label, "", f'<div class="panels">{html}</div>') if html else ""


def _count_orbits(moved: dict[str, Any], count: int) -> str:
    """Say how many points have an orbit."""
    if not moved["owner"]:
        return ""
    if not moved["asked"]:
        return "This page was written without orbits."
    with_orbit = sum(one >= 0 for one in moved["owner"])
    return f"The page holds the orbits of {f'{with_orbit} of {count}' if with_orbit < count else 'all'} points."


def _key(picture: Picture) -> str:
    """Return the legend of a picture, and what colours along a scale mean."""
    entries = [entry_html(one) for one in legend_of(picture)]
    for panel in picture.panels:
        if panel.by and not panel.classes and panel.by in picture.points:
            values = picture.points[panel.by].to_numpy(dtype=float, na_value=np.nan)
            (low, high), (unit, factor) = ends_of_scale(panel, values), picture.unit(panel.by)
            text = f"{heading(panel)}: {low * factor:.3g}, pale, to {high * factor:.3g} {unit}, dark"
            entries.append(f"<span>{escape(text.replace(' ,', ','))}</span>")
    return f'<p class="key">{"".join(dict.fromkeys(entries))}</p>' if entries else ""


# -- what a click shows ------------------------------------------------------------------------------------------------


def _aside(moved: dict[str, Any]) -> str:
    """Return the place for what a click on a point shows: its orbit, the moving machine, and its numbers."""
    more, orbit = "", ""
    if moved["list"]:
        more = " and its orbit with the moving machine"
        motion = _empty("Platform and underside of the material", "mm", "turns", "motion")
        portrait = _empty("Speed of the platform over its height", "m/s", "mm", "portrait")
        player = f'<div class="controls">{PLAY}<span class="told hint"></span></div>'
        orbit = f'<div class="orbit" hidden><h3></h3><div class="stage"></div>{player}{motion}{portrait}</div>'
    click = hint(f"Click or tap a point, or a row of the table, to see its numbers{more}.")
    numbers = '<div class="circle"></div><div class="numbers"></div>'
    return f'<aside class="row scripted">{orbit}{click}{numbers}</aside>'


def _empty(title: str, unit: str, across: str, look: str) -> str:
    """Return a drawing without curves, which the script fills."""
    plot = Plot(title, Scale(0.0, 1.0, across), Scale(0.0, 1.0, unit), look)
    plot.height = "--h:130px"
    return plot.html()
