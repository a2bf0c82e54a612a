"""Builds the page: one HTML file with its data, scripts and style inside, which opens offline."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd
from plotly.offline import get_plotlyjs

from vibroplat.errors import TableError
from vibroplat.page import points, run
from vibroplat.page.parameters import parameters
from vibroplat.page.reading import Found, find_results
from vibroplat.page.summary import remarks, summary_rows
from vibroplat.plots.reading import read_columns
from vibroplat.results import Result
from vibroplat.tables import replace_files

#: The parts of the script, in the order in which they use each other.
SCRIPTS = ("text", "tables", "curves", "machine", "player", "points", "page")
#: Tables of results with points, and the columns that they need.
POINTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "sweep": ("sweep", ("branch", "direction", "sync", "motion", "outcome", "rms_x_m", "rms_y_m")),
    "orbits": ("branches", ("branch", "stable")),
}
#: What is told of how a result was made.
_MADE = ("vibroplat", "git_commit", "created", "engine", "tolerance")
#: Name of the page where none is given.
NAME = "report.html"


def write_report(
    directories: Sequence[Path], out: Path | None = None, start: float | None = None, stop: float | None = None
) -> Path:
    """Write a page of the results in some directories.

    Parameters
    ----------
    directories
        Result directories of ``run``, ``sweep`` and ``orbits``, shown side by side.
    out
        The file. Default: ``report.html`` in the first directory.
    start, stop
        The interval of runs that is kept at full resolution and moves (s). Default: the whole run, or the last rows of
        it if there are too many.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TableError
        A directory holds no result, or the page cannot be written.
    """
    path = directories[0] / NAME if out is None else out
    text = page(page_data(find_results(directories), start, stop))
    replace_files({path: lambda place: place.write_text(text, encoding="utf-8", newline="\n")})
    return path


def page_data(found: Sequence[Found], start: float | None = None, stop: float | None = None) -> dict[str, Any]:
    """Return all that a page shows of some results."""
    runs = _runs(found, start, stop)
    summaries = [one for one in found if one.command == "run"]
    return {
        "title": ", ".join(dict.fromkeys(one.label for one in found)),
        "results": [_origin(one) for one in found],
        "parameters": parameters([one.command for one in found], [one.configuration for one in found]),
        "summary": {
            "results": [found.index(one) for one in summaries],
            "rows": summary_rows([one.summary for one in summaries]),
        },
        "remarks": [remark for one in summaries for remark in remarks(one.label, one.summary)],
        "runs": runs,
        "turns": run.SHOWN_TURNS,
        "panels": run.panels(runs),
        "points": [shown for number, one in enumerate(found) for shown in _points(number, one)],
        "tables": [table for number, one in enumerate(found) for table in _tables(number, one)],
        "boundaries": [table for number, one in enumerate(found) for table in _boundaries(number, one)],
    }


def page(data: dict[str, Any]) -> str:
    """Return the text of a page.

    Whatever comes from files is in the data, where no character can end the element; the script never reads it as HTML.
    Should it fail to do so, the policy of the page lets no other script run and nothing be loaded.
    """
    ours = "\n".join(_web(f"{name}.js") for name in SCRIPTS)
    scripts = {"PLOTLY": str(get_plotlyjs()), "SCRIPT": f'(() => {{\n"use strict";\n{ours}}})();'}
    policy = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts.values())
    parts = scripts | {
        "POLICY": policy,
        "TITLE": html.escape(data["title"]),
        "STYLE": _web("style.css"),
        "DATA": _inside_script(json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))),
    }
    before, *rest = _web("page.html").split("{{")
    pieces = [before]
    for piece in rest:
        name, _, after = piece.partition("}}")
        pieces += [parts[name], after]
    return "".join(pieces)


def _web(name: str) -> str:
    return files("vibroplat.page").joinpath("web", name).read_text(encoding="utf-8")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _inside_script(text: str) -> str:
    """Write JSON without characters that HTML gives a meaning."""
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _origin(one: Found) -> dict[str, Any]:
    """Return how a result was made."""
    told = {key: one.result.provenance.get(key) for key in _MADE}
    return {"label": one.label, "command": one.command, "directory": str(one.result.directory), **told}


def _runs(found: Sequence[Found], start: float | None, stop: float | None) -> list[dict[str, Any]]:
    """Return all runs. The machines move side by side until the first one ends, if all have begun by then."""
    ours = [(number, one, run.run_times(one.result)) for number, one in enumerate(found) if one.command == "run"]
    ours = [(number, one, times) for number, one, times in ours if times.rows > 1]
    common = min((times.last for _, _, times in ours), default=0.0)
    if stop is None and all(times.first < common for _, _, times in ours):
        stop = common
    most = max(run.ROWS // max(len(ours), 1), 2)
    return [
        {"result": number, **run.run_data(one.result, one.scene, one.summary, _events(one), times, most, start, stop)}
        for number, one, times in ours
    ]


def _events(one: Found) -> pd.DataFrame:
    return read_columns(one.result, "events", "kind", ("t_s", "impulse_n_s"))


def _tables(number: int, one: Found) -> list[dict[str, Any]]:
    """Return the tables that belong to no figure with points: those of events."""
    if one.command != "run":
        return []
    events = _events(one)
    return [points.table_data("events", number, points.thinned(events), len(events))]


def _points(number: int, one: Found) -> list[dict[str, Any]]:
    """Return the figure of a sweep or of orbits, with its table."""
    if one.command == "run":
        return []
    name, needed = POINTS[one.command]
    whole = _table(one.result, name, needed)
    table = points.thinned(whole)
    figure = {
        "command": one.command,
        "result": number,
        "table": points.table_data(one.command, number, table, len(whole)),
        "axes": points.axes(table, points.EXCITATION),
        "measures": points.measures(table),
        "series": points.sweep_series(table) if one.command == "sweep" else points.orbit_series(table),
        "marks": [],
        "special": None,
    }
    if one.command == "orbits" and one.has("special"):
        special = points.thinned(_table(one.result, "special", ("branch", "kind")))
        figure["marks"] = points.special_marks(special, table)
        figure["special"] = points.table_data("special points", number, special, len(special))
    return [figure]


def _boundaries(number: int, one: Found) -> list[dict[str, Any]]:
    """Return the table of boundaries of orbits in the plane of two keys."""
    if one.command != "orbits" or not one.has("boundaries"):
        return []
    whole = _table(one.result, "boundaries", ("kind",))
    keys = [name for name in whole.columns if name != "kind" and points.is_numeric(whole[name])][:2]
    if len(keys) < 2:
        raise TableError(f"the boundaries table in {one.result.directory} has no numbers of two keys")
    return [{"table": points.table_data("boundaries", number, points.thinned(whole), len(whole)), "keys": keys}]


def _table(result: Result, name: str, needed: Sequence[str]) -> pd.DataFrame:
    """Read a table that has these columns."""
    table = result.table(name)
    missing = [column for column in needed if column not in table]
    if missing:
        raise TableError(f"the {name} table in {result.directory} has no column {missing[0]}")
    return table
