"""What a page shows without its scripts: how results were made, summary, parameters, tables and figures, as HTML.

Texts from files are escaped; only markup of this file is read as such.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from vibroplat.errors import TableError
from vibroplat.plots.command import families
from vibroplat.plots.style import styled
from vibroplat.results.result import Result

#: Significant digits of numbers, as in the script.
DIGITS = 6
#: Most rows of a table, of which the script shows all.
ROWS = 40
#: Dots per inch of figures.
DPI = 80
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GREEK = {"rho": "ρ", "mu": "μ", "gamma": "γ", "phi": "φ", "beta": "β", "omega": "ω", "pi": "π", "sigma": "σ"}
_SYMBOL = re.compile(r"\b([A-Za-z]{1,5})_(\w{1,3})\b|\b(" + "|".join(_GREEK) + r")\b")


def shown(value: Any) -> str:
    """Return a value as a person reads it: what is very small or large as a power of ten, what is unknown as a dash."""
    if value is None or isinstance(value, bool):
        return {None: "–", True: "yes", False: "no"}[value]
    if not isinstance(value, int | float):
        return str(value)
    if value and not 1e-4 <= abs(value) < 1e7:
        mantissa, _, exponent = f"{value:.3e}".partition("e")
        return f"{float(mantissa):g}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", "−")
    return f"{float(f'{value:.{DIGITS}g}'):.10g}".replace("-", "−")


def header(data: Mapping[str, Any]) -> str:
    """Return the title, how results were made, and remarks."""
    results = data["results"]
    lines = []
    for one in results:
        commit = f" ({one['git_commit'][:10]})" if one["git_commit"] else ""
        made = (
            ("engine", "engine", ""),
            ("tolerance", "tolerance", ""),
            ("vibroplat", "vibroplat", commit),
            ("made", "created", ""),
        )
        told = [f"{word} {shown(one[key])}{more}" for word, key, more in made if one[key] is not None]
        lines.append(", ".join([f"{one['label']}: {one['command']}" if len(results) > 1 else one["command"], *told]))
    remarks = []
    for one in data["remarks"]:
        text = f"{one['result']}: {one['text']}" if len(results) > 1 else one["text"]
        look, word = ("failed", "Failed") if one["failed"] else ("", "Note")
        remarks.append(f'<li class="{look}"><b>{word}: </b>{escape(text)}</li>')
    return "\n".join(
        [
            f'<h1 id="title">{escape(data["title"])}</h1>',
            f'<p id="origin">{"".join(f"<span>{escape(line)}</span>" for line in lines)}</p>',
            f'<ul id="remarks"{"" if remarks else " hidden"}>{"".join(remarks)}</ul>',
        ]
    )


def summary(data: Mapping[str, Any]) -> str:
    """Return the summary of runs: what a person asks for first, the data sheet by its groups, and the rest, folded."""
    results, rows = data["summary"]["results"], data["summary"]["rows"]
    if not results:
        return ""
    heads = ["", "unit", *(data["results"][n]["label"] if len(results) > 1 else "value" for n in results)]
    groups: dict[str, list[str]] = {}
    for row in rows:
        groups.setdefault(row["group"], []).append(_row(row["words"], row["unit"], map(shown, row["values"])))
    first, rest = (listing(heads, groups.pop(group, [])) for group in ("first", ""))
    lines = [line for group, found in groups.items() for line in (_section(group, heads), *found)]
    sheet = f"<h3>Data sheet</h3>{listing(heads, lines)}" if lines else ""
    more = f"<details><summary>All other numbers of the summary</summary>{rest}</details>"
    return f'<section id="summary"><h2>Summary</h2>{first}{sheet}{more}</section>'


def _section(name: str, heads: Sequence[str]) -> str:
    """Return the row of a table that names those below it."""
    return f'<tr class="section"><th scope="rowgroup" colspan="{len(heads)}">{escape(name)}</th></tr>'


def _row(name: str, unit: str, values: Any) -> str:
    """Return a row of the summary; values are texts, one for each run."""
    cells = "".join(f'<td class="number">{escape(value)}</td>' for value in values)
    return f'<tr><th scope="row">{escape(name)}</th><td class="unit">{escape(unit)}</td>{cells}</tr>'


def answers(data: Mapping[str, Any]) -> str:
    """Return what commands printed: an overview, and lines below it."""
    found = ""
    for one in data["answers"]:
        label, told = data["results"][one["result"]]["label"], one["told"]
        lines = [_row(name, "", [str(text)]) for name, text in told.get("lines", {}).items()]
        text = escape("\n".join(told.get("text", [])))
        found += f"<section><h2>Answer: {escape(label)}</h2>{listing([], lines)}<pre>{text}</pre></section>"
    return found and f'<div id="answers">{found}</div>'


def parameters(data: Mapping[str, Any]) -> str:
    """Return the parameters of results by their sections."""
    results = data["results"]
    several = len(results) > 1
    note = "Highlighted and marked ●: not the default, which is the paper's test rig."
    note += " Marked ≠: not the same in all results." if several else ""
    names = [f"{one['label']} ({one['command']})" if several else "value" for one in results]
    heads = ["parameter", "symbol or meaning", "unit", "default", *names]
    lines, section = [], None
    for row in data["parameters"]:
        if row["section"] != section:
            section = row["section"]
            lines.append(_section(row["section"], heads))
        lines.append(_parameter(row, names))
    table = listing(heads, lines)
    return f'<section id="parameters"><h2>Parameters</h2><p class="hint">{note}</p>{table}</section>'


def _parameter(row: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return a row of the parameters; its cells carry their headings, which a narrow screen shows beside them."""
    values = [
        f'<td class="number{" changed" if changed else ""}" data-head="{escape(name)}">'
        f"{'● ' if changed else ''}{escape(shown(value))}</td>"
        for value, changed, name in zip(row["values"], row["changed"], names, strict=True)
    ]
    return (
        f'<tr><th scope="row">{"≠ " if row["differs"] else ""}{escape(row["words"])}</th>'
        f'<td class="meaning">{_typeset(row["meaning"])}</td><td class="unit">{escape(row["unit"])}</td>'
        f'<td class="number" data-head="default">{escape(shown(row["default"]))}</td>{"".join(values)}</tr>'
    )


def _typeset(text: str) -> str:
    """Write symbols such as m_0 and gamma_1 with their index below."""

    def symbol(found: re.Match[str]) -> str:
        letter, index, word = found.groups()
        return _GREEK[word] if word else f"<i>{_GREEK.get(letter, letter)}</i><sub>{_GREEK.get(index, index)}</sub>"

    return _SYMBOL.sub(symbol, escape(text))


def listing(heads: Sequence[str], rows: Sequence[str]) -> str:
    """Return a table of headings and rows."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    inside = f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="wide"><table class="listing">{inside}</table></div>'


def tables(data: Mapping[str, Any]) -> str:
    """Return the first rows of all tables."""
    found = [*data["tables"], *(table for one in data["pictures"] for table in (one["table"], one["special"]) if table)]
    return "".join(_table(table, data["results"][table["result"]]["label"]) for table in found)


def _table(table: Mapping[str, Any], label: str) -> str:
    """Return the first rows of a table, in the units in which the script shows them, and say if there are more."""
    columns, count = table["columns"], min(table["rows"], ROWS)
    heads = [f"{one['words']} ({one['unit']})" if one["unit"] else one["words"] for one in columns]
    cells = ([_scaled(value, one["factor"]) for value in one["values"][:count]] for one in columns)
    rows = ["".join(f"<td>{escape(shown(value))}</td>" for value in row) for row in zip(*cells, strict=True)]
    more = f'<p class="hint">The first {count} of {table["of"]} rows.</p>' if count < table["of"] else ""
    body = listing(heads, [f"<tr>{row}</tr>" for row in rows])
    return f"<section><h2>Table {escape(table['title'])}: {escape(label)}</h2>{body}{more}</section>"


def _scaled(value: Any, factor: float) -> Any:
    """Return a number in another unit; texts and flags have none."""
    return factor * value if isinstance(value, int | float) and not isinstance(value, bool) and factor != 1.0 else value


def figures(found: Sequence[Result]) -> str:
    """Return the figures that ``vibroplat plot`` draws of some results, as images inside the page.

    A browser that runs scripts reads them as text and decodes none of them.
    """
    return "".join(
        f'<figure><img alt="{escape(name)}" src="data:image/png;base64,{picture}"></figure>'
        for name, picture in _pictures(found)
    )


def _pictures(found: Sequence[Result]) -> Iterator[tuple[str, str]]:
    """Yield figures by their names, as base64 of PNG; a result without data has none."""
    for one in found:
        draw = next((family.draw for family in families() if family.command == one.command), None)
        if draw is None:
            continue
        with styled():
            try:
                for _, name, figure in draw([one.directory]):
                    written = io.BytesIO()
                    figure.savefig(written, format="png", dpi=DPI)
                    yield f"{one.label}: {name}", base64.b64encode(written.getvalue()).decode("ascii")
            except TableError:
                continue
