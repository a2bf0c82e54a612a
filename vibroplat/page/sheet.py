"""The data sheet of runs on the page: of one run its largest values and when these were, of several a column each."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from vibroplat.page.tables import hint
from vibroplat.results.sheet import FURTHER, Row, Sheet


def sheet_html(sheets: Sequence[Sheet], names: Sequence[str]) -> str:
    """Return the data sheet of one run, or of several with a column for each."""
    single = len(sheets) == 1
    heads = ["", sheets[0].transient or "in operation", "largest, with start", "when"] if single else ["", *names]
    groups = ""
    for name in dict.fromkeys(name for one in sheets for name in one.groups if name != FURTHER):
        found = [{row.label: row for row in one.groups.get(name, [])} for one in sheets]
        labels = dict.fromkeys(label for rows in found for label in rows)
        lines = "".join(_line(label, [rows.get(label, Row(label)) for rows in found]) for label in labels)
        title = f'<tr class="group"><th scope="rowgroup" colspan="{len(heads)}">{escape(name)}</th></tr>'
        groups += f"<tbody>{title}{lines}</tbody>"
    if not groups:
        return ""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    more = "" if single else hint("Pale: the largest value of the whole run, with its start.")
    return f'<table class="sheet{"" if single else " several"}"><thead><tr>{head}</tr></thead>{groups}</table>{more}'


def _line(label: str, rows: Sequence[Row]) -> str:
    """Return a line: of a single run with what was largest and when, of several their values beside each other."""
    cells = []
    for row in rows:
        cells.append(f"<b>{escape(row.now)}</b>" + (f" <small>{escape(row.also)}</small>" if row.also else ""))
        if len(rows) == 1:
            cells += [escape(row.most), escape(row.when)]
        elif row.most:
            cells[-1] += f' <small class="most">{escape(row.most)}</small>'
    return f'<tr><th scope="row">{escape(label)}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
