"""Builds the page: one HTML file with its data, scripts and style inside, which opens offline."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import logging
import zlib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.kinds import KINDS
from vibroplat.page import run, static
from vibroplat.page.pictures import MOST_SAMPLES, Motions, Mover, Progress, picture_data, table_data
from vibroplat.page.results import differences, find_results, parameters, remarks, summary_of, summary_rows
from vibroplat.plots.reading import ends_of
from vibroplat.results.picture import finite
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult
from vibroplat.results.tables import replace_file, require_replaceable

_LOG = logging.getLogger("vibroplat")

#: The parts of the script, in the order in which they use each other.
SCRIPTS = ("text", "tables", "curves", "machine", "player", "orbit", "pictures", "page")
#: What draws curves: plotly.js 4.1.1 with its traces in Cartesian axes alone, a third of the whole library. It is the
#: file of npm's package plotly.js-cartesian-dist-min as it is, and its license is ``plotly-LICENSE.txt`` beside it.
LIBRARY = "plotly-cartesian.min.js"
#: What the page says about how a result was made.
_MADE = ("vibroplat", "git_commit", "created", "engine", "tolerance")
#: Size of a page that is told (bytes): mail takes what is smaller.
LARGE = 8_000_000
#: How a page begins, whatever wrote it.
BEGINS = b"<!doctype html"
#: Name of the page where none is given.
NAME = "report.html"


def write_report(
    directories: Sequence[Path],
    out: Path | None = None,
    start: float | None = None,
    stop: float | None = None,
    *,
    mover: Mover | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a page of the results in some directories.

    Parameters
    ----------
    directories
        Result directories, shown side by side.
    out
        The file. Default: ``report.html`` in the first directory.
    start, stop
        The interval of runs that is kept at full resolution and moves (s). Default: the whole run; if it has too many
        rows, its end, or its beginning where the supply or the speeds change.
    mover, progress
        What computes the orbits of the points of sweeps and branches, and who is told of each. Default: the page has
        no orbits.
    overwrite
        Whether the page may replace a file of another kind.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    TableError
        A directory holds no result, or the page cannot be written or would replace something else.
    """
    path = directories[0] / NAME if out is None else out
    require_replaceable(path, BEGINS, overwrite=overwrite)
    found = find_results(directories)
    data = page_data(found, start, stop, mover=mover, progress=progress)
    text = page(data, static.figures(found))
    replace_file(path, lambda place: place.write_text(text, encoding="utf-8", newline="\n"))
    if (size := path.stat().st_size) > LARGE:
        _LOG.warning("%s has %.1f MB, over %.0f MB; %s", path, size / 1e6, LARGE / 1e6, _smaller(data))
    return path


def _smaller(data: Mapping[str, Any]) -> str:
    """Say what would make a page smaller."""
    ways = [
        ("fewer results", len(data["results"]) > 1),
        ("--no-orbits", any(one["motions"]["list"] for one in data["pictures"])),
        ("a shorter interval, by --start and --stop", bool(data["runs"])),
        ("fewer rows", not data["runs"] and len(data["results"]) == 1),
    ]
    return "smaller with " + ", or ".join(way for way, helps in ways if helps)


def page_data(
    found: Sequence[Result],
    start: float | None = None,
    stop: float | None = None,
    *,
    mover: Mover | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return all that a page shows of some results."""
    runs, transient = _runs(found, start, stop)
    from_mean = len(runs) > 1 and not transient
    numbers = [number for number, one in enumerate(found) if one.command == "run"]
    summaries = [found[number] for number in numbers]
    studies = [(number, one) for number, one in enumerate(found) if one.command != "run"]
    room = MOST_SAMPLES // max(len(studies), 1)
    commands, trees = [one.command for one in found], [one.given() for one in found]
    different = differences(commands, [one.scene.to_tree() for one in found])
    return {
        "title": ", ".join(dict.fromkeys(one.label for one in found)),
        "results": [_origin(one) | {"differs": how} for one, how in zip(found, different, strict=True)],
        "parameters": parameters(commands, trees),
        "summary": {
            "results": numbers,
            "rows": summary_rows([summary_of(one) for one in summaries]),
        },
        "remarks": [remark for one in found for remark in remarks(one.label, _told(one))],
        "runs": runs,
        "transient": transient,
        "turns": run.SHOWN_TURNS,
        "panels": run.panels(runs, from_mean=from_mean),
        "pictures": [
            shown for n, one in studies for shown in _pictures(n, one, Motions(one.scene, mover, room, progress))
        ],
        "answers": [{"result": n, "told": told} for n, one in studies if (told := _told(one))],
        "tables": [table_data("events", number, _events(found[number])) for number in numbers],
    }


def page(data: dict[str, Any], figures: str = "") -> str:
    """Return the text of a page, with the HTML of figures that it shows without scripts.

    Whatever comes from files is escaped, or in the data, where no character can end the element, and the script never
    reads it as HTML. Should it ever do so, the policy of the page still lets no other script run and nothing be loaded.
    """
    ours = "\n".join(_web(f"{name}.js") for name in SCRIPTS)
    library, script = _web(LIBRARY), f'(() => {{\n"use strict";\n{ours}}})();'
    parts = {
        "LIBRARY": base64.b64encode(zlib.compress(library.encode(), 9)).decode("ascii"),
        "SCRIPT": script,
        "POLICY": " ".join(f"'sha256-{_sha256(text)}'" for text in (library, script)),
        "TITLE": html.escape(data["title"]),
        "STYLE": _web("style.css"),
        "HEADER": static.header(data),
        "SUMMARY": static.summary(data),
        "ANSWERS": static.answers(data),
        "PARAMETERS": static.parameters(data),
        "FIGURES": figures,
        "TABLES": static.tables(data),
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


def _origin(one: Result) -> dict[str, Any]:
    """Return how a result was made."""
    told = {key: one.provenance.get(key) for key in _MADE}
    return {"label": one.label, "command": one.command, "directory": str(one.directory), **told}


def _runs(found: Sequence[Result], start: float | None, stop: float | None) -> tuple[list[dict[str, Any]], bool]:
    """Return all runs, and whether they are shown from their beginning, as a start is.

    Otherwise speeds of several runs are counted from their means, or their ripple would not be seen beside these.
    The machines move side by side until the first run ends, if all have begun by then.
    """
    ours = []
    for number, one in enumerate(found):
        if not isinstance(one, RunResult):
            continue
        ends = ends_of(map(finite, one.column_parts("trajectory", (), ("t_s", *run.SPEEDS))))
        if ends is not None and ends.rows > 1:
            ours.append((number, one, ends))
    common = min((float(ends.last["t_s"]) for _, _, ends in ours), default=0.0)
    if stop is None and all(ends.first["t_s"] < common for _, _, ends in ours):
        stop = common
    most = max(run.ROWS // max(len(ours), 1), 2)
    transient = any(run.is_transient(ends, one.scene) for _, one, ends in ours)
    how = {"from_beginning": transient, "from_mean": len(ours) > 1 and not transient}
    runs = [{"result": n} | run.run_data(one, _events(one), ends, most, start, stop, **how) for n, one, ends in ours]
    return runs, transient


def _told(one: Result) -> dict[str, Any]:
    """Return the summary of a run, or what a command printed with its check, if its provenance has it."""
    if isinstance(one, RunResult) or not isinstance(one.provenance.get("answer"), dict):
        return summary_of(one)
    return one.answer.to_tree() | {"check": one.provenance.get("check")}


def _events(one: Result) -> pd.DataFrame:
    return finite(one.columns("events", ("kind",), ("t_s", "impulse_n_s")))


def _pictures(number: int, one: Result, motions: Motions) -> list[dict[str, Any]]:
    """Return the pictures of a result, with their tables and what moves when a point is clicked."""
    shown = [picture for picture in KINDS[one.command].pictures.pictures([one]) if "page" in picture.places]
    return [picture_data(number, picture, motions) for picture in shown]
