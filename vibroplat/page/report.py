"""Builds the page: one HTML file with its drawings, data, script and style inside, which opens offline."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config.digits import given, percent, quantity
from vibroplat.config.engine_choice import COMPUTED_BY
from vibroplat.config.kinds import KINDS
from vibroplat.config.plausibility import by_severity
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.measured.data import Measured, read_data
from vibroplat.page.curves import Runs, beside_measured
from vibroplat.page.machine import PLAY, as_json, drawing, machine_of
from vibroplat.page.orbits import MOST_SAMPLES, Motions, Mover, Progress
from vibroplat.page.pictures import picture_html
from vibroplat.page.results import differences, find_results, parameters
from vibroplat.page.run import ShownRun, shown_run
from vibroplat.page.tables import align_lines, fold, hint, listing, parameters_html, table_html
from vibroplat.page.text import escape
from vibroplat.results.answer import first_failures, noted
from vibroplat.results.labels import capital
from vibroplat.results.picture import Picture, finite
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult
from vibroplat.results.run_answer import sync_text
from vibroplat.results.sheet import FURTHER, Row, Sheet
from vibroplat.results.tables import as_written, replace_file, require_replaceable

#: How a page begins, whatever wrote it.
BEGINS = b"<!doctype html"
#: Name of the page where none is given.
NAME = "report.html"
#: Maximum number of runs whose data sheet has room next to their curves.
MAX_SHEETS = 2
#: Last events of a run on the page.
EVENTS = 100
_READING = (
    "Mouse: point to read, drag to zoom, double-click to return. Finger: tap to read; the page scrolls as always."
)


def write_report(
    directories: Sequence[Path],
    out: Path | None = None,
    start: float | None = None,
    stop: float | None = None,
    *,
    mover: Mover | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
    data: str | Path | None = None,
) -> Path:
    """Write a page of the results in some directories.

    Parameters
    ----------
    directories
        Result directories, shown side by side.
    out
        The file. Default: ``report.html`` in the first directory.
    start, stop
        The interval of runs that is shown in detail and in which the machine moves (s). Default: the last turns in
        detail, and turns evenly over the whole run.
    mover, progress
        What computes the orbits of the points of sweeps and branches, and who is told of each. Default: the page has
        no orbits.
    overwrite
        Whether the page may replace a file of another kind.
    data
        Measured data beside the first run, as :func:`vibroplat.measured.data.read_data` takes it.

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
    with as_written(*directories):
        text = Report(
            find_results(directories), start, stop, mover, progress, None if data is None else read_data(data)
        ).page()
    replace_file(path, lambda file: file.write_text(text, encoding="utf-8", newline="\n"))
    return path


@dataclass
class Report:
    """A page of some results.

    Attributes
    ----------
    results
        The results.
    start, stop, mover, progress
        As in :func:`write_report`.
    data
        Measured data.
    """

    results: Sequence[Result]
    start: float | None = None
    stop: float | None = None
    mover: Mover | None = None
    progress: Progress | None = None
    data: Measured | None = None

    @cached_property
    def runs(self) -> list[RunResult]:
        """The runs."""
        return [one for one in self.results if isinstance(one, RunResult)]

    @cached_property
    def run_curves(self) -> list[ShownRun]:
        """What is shown of each run that has rows."""
        found = [shown_run(one, _events(one), self.start, self.stop) for one in self.runs]
        return [one for one in found if one is not None]

    @cached_property
    def sheets(self) -> dict[RunResult, Sheet]:
        """The data sheets of the runs."""
        steady = {curves.result: curves.steady for curves in self.run_curves}
        return {one: Sheet(one.scene, one.summary, steady.get(one)) for one in self.runs}

    @cached_property
    def pictures(self) -> list[tuple[Result, Picture]]:
        """The pictures of all studies."""
        studies = [one for one in self.results if not isinstance(one, RunResult)]
        pictures = [(one, picture) for one in studies for picture in KINDS[one.command].pictures.pictures([one])]
        return [(one, picture) for one, picture in pictures if "page" in picture.places]

    # -- the page -----------------------------------------------------------------------------------

    def page(self) -> str:
        """Return the text of the page.

        Whatever comes from files is escaped, or data in which no character can end the element, and the script never
        reads it as HTML. Should it ever do so, the policy of the page still lets no other script run and nothing be
        loaded.
        """
        machines: list[dict[str, Any]] = []
        parts = {
            "TITLE": escape(self.title),
            "STYLE": _web("style.css"),
            "HEADER": self._header(),
            "RUNS": (self._runs() if self.runs else "") + self._measured(),
            "STUDIES": self._studies(machines),
            "FOLDS": self._folds(),
            "MACHINES": _machines(machines),
        }
        studies = len(self.runs) < len(self.results)
        names = [*["machine"] * bool(self.run_curves or machines), "plots", *["points"] * studies, "tables"]
        ours = "\n".join(_web(f"{name}.js") for name in names)
        script = f'(() => {{\n"use strict";\n{ours}\ndocument.documentElement.dataset.ready = "true";\n}})();'
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        parts |= {"SCRIPT": script, "POLICY": f"'sha256-{digest}'"}
        return re.sub(r"\{\{(\w+)\}\}", lambda name: parts[name[1]], _web("page.html"))

    @property
    def title(self) -> str:
        """Names of the results."""
        return ", ".join(dict.fromkeys(one.label for one in self.results))

    def _header(self) -> str:
        """Return title and answers, and what is to be noted."""
        made = self.results[0].provenance
        day = f"{str(made.get('created', ''))[:10]}, vibroplat {made.get('vibroplat', '')}"
        several = len(self.results) > 1
        differing = differences([one.command for one in self.results], [one.scene.to_tree() for one in self.results])
        answers = ""
        for one, differs in zip(self.results, differing, strict=True):
            called = ", ".join([one.label, *[one.command] * (one not in self.runs)]) + f" ({differs})" * bool(differs)
            answers += f"<div>{self._answer(one, f'<small>{escape(called)}</small><br>' * several)}</div>"
        look = "two" if several else "one"
        return f'<h1 id="title">{escape(self.title)} <span>{escape(day)}</span></h1><div class="{look}">{answers}</div>'

    def _answer(self, one: Result, name: str) -> str:
        """Return the answer of a result, what failed before it."""
        answer, check, more = one.answer, one.provenance.get("check") or {}, ""
        headline = answer.headline.removeprefix(f"{one.scene.name}: ")
        headline = capital(headline)
        failures = [*check.get("disagreements", ()), *answer.failures]
        bad, short = bool(failures), align_lines(answer.short) if answer.short else ""
        if isinstance(one, RunResult):
            differ = (one.summary.get("check") or {}).get("agrees") is False
            failures = [*failures, *["engines disagree"] * differ]
            facts = "; ".join(self.sheets[one].facts())
            short = f'<p class="more">{escape(capital(facts))}</p>' if facts else ""
            bad = bool(failures or one.summary.get("captured_by"))
        if failures:
            more = f'<p class="more">{escape(headline)}</p>'
            headline = "; ".join(first_failures(failures))
        parts = [noted(note).partition(": ") for note in by_severity(answer.notes) if not note.startswith(COMPUTED_BY)]
        notes = "".join(f"<li><b>{what.capitalize()}:</b> {escape(note)}</li>" for what, _, note in parts)
        more += short + f'<ul class="notes">{notes}</ul>' * bool(notes)
        return f'<p class="answer{" bad" * bad}{" run" * (name != "")}">{name}{escape(headline)}</p>{more}'

    # -- runs ---------------------------------------------------------------------------------------

    def _measured(self) -> str:
        """Return measured data beside the runs, and how they differ; raises TableError without runs."""
        if self.data is None:
            return ""
        if not self.run_curves:
            raise TableError(f"--data {self.data}: there is no run to compare with; allowed: with the results of a run")
        names = [one.label for one in self.runs]
        figures = beside_measured(self.data, self.runs, names, self.start, self.stop)
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.data.lines())
        return (
            f'<section class="study" id="measured"><h2>Measured data</h2><ul class="notes">{lines}</ul>'
            f'<div class="panels">{figures}</div></section>'
        )

    def _runs(self) -> str:
        """Return the first screen of runs: machines, data sheet, and the curves that matter."""
        several = len(self.runs) > 1
        key = self._curves.key_figures() if self._curves else ""
        third = f'<div class="third">{self._curves.starts()}</div>' if self._curves and not several else ""
        sheet = sheet_html([*self.sheets.values()], [one.label for one in self.runs])
        stages = f'<section id="machines">{self._stages(several=several)}{third}</section>'
        section = f'<section id="sheet" aria-label="Data sheet">{sheet}</section>'
        curves = f'<section id="curves" aria-label="Curves">{key}</section>'
        kind = " ".join(["several"] * several + ["many"] * (len(self.runs) > MAX_SHEETS))
        return f'<main class="{kind}">{stages}{section}{curves}</main>'

    @cached_property
    def _curves(self) -> Runs | None:
        """What draws the curves of the runs."""
        return Runs(self.run_curves, [curves.result.label for curves in self.run_curves]) if self.run_curves else None

    def _stages(self, *, several: bool) -> str:
        """Return the drawings of the machines with what moves them, and what they are."""
        inputs = "" if several else _inputs(self.runs[0].scene)
        if not self.run_curves:
            return inputs
        figures = ""
        for one in (curves.result for curves in self.run_curves):
            caption = escape(f"{one.label}: " * several + sync_text(one.scene, self.sheets[one].numbers))
            picture = drawing(machine_of(one.scene), escape(f"Drawing of the machine: {one.label}"))
            figures += f"<figure><figcaption>{caption}</figcaption>{picture}</figure>"
        motions = [curves.motion for curves in self.run_curves]
        count = len(motions[0]["windows"])
        note = f"motion × {motions[0]['k']:g}" + (f"; {count} turns, evenly over the run" if count > 1 else "")
        controls = (
            f'{PLAY}<button type="button" class="whole">Whole run</button>'
            f'<input type="range" min="0" max="{count - 1}" value="{count - 1}" aria-label="time">'
            f'<span class="clock"></span><span>{escape(note)}</span>'
        )
        aside = f'<div><div class="controls scripted">{controls}</div>{inputs}</div>'
        data = f'<script type="application/json" id="frames">{as_json(motions)}</script>'
        return f'<div class="stages">{figures}</div>{aside}{data}'

    # -- studies ------------------------------------------------------------------------------------

    def _studies(self, machines: list[dict[str, Any]]) -> str:
        """Return the pictures of all studies; machines of orbits are added."""
        studies = list(dict.fromkeys(one for one, _ in self.pictures))
        room = MOST_SAMPLES // max(len(studies), 1)
        motions = {one: Motions(one.scene, self.mover, room, machines, self.progress) for one in studies}
        shown = enumerate(self.pictures)
        return "".join(picture_html(number, picture, motions[one]) for number, (one, picture) in shown)

    # -- what is folded -----------------------------------------------------------------------------

    def _folds(self) -> str:
        """Return what is folded: all curves, events, what was printed, parameters, and how it was made."""
        html = ""
        if self._curves is not None:
            figures, count = self._curves.all_figures()
            html += fold("All curves", f"{count} quantities", hint(_READING) + figures)
        for one, events in ((one, _events(one)) for one in self.runs):
            name = f"events of {one.label}" if len(self.runs) > 1 else "events"
            kinds = ", ".join(f"{number} {kind}" for kind, number in events["kind"].value_counts().items())
            rows = np.arange(max(len(events) - EVENTS, 0), len(events))
            html += table_html(name, events, rows, contents=kinds) if kinds else ""
        for result, answer in ((one, one.answer) for one in self.results):
            text = f"<pre>{escape(chr(10).join(answer.text))}</pre>" if answer.text else ""
            printed = listing([], [[label, text] for label, text in answer.lines.items()]) + text
            html += fold("All that was printed", f"{result.label}, {result.command}", printed)
        trees = [one.given() for one in self.results]
        names = [f"{one.label} ({one.command})" for one in self.results]
        return html + parameters_html(parameters([one.command for one in self.results], trees), names) + self._made()

    def _made(self) -> str:
        """Return how results were made."""
        rows = []
        for one in self.results:
            made = one.provenance | {"directory": str(one.directory)}
            made["libraries"] = ", ".join(map(" ".join, (made.get("libraries") or {}).items()))
            name = f"{one.label}, " * (len(self.results) > 1)
            facts = {key: value for key, value in made.items() if not isinstance(value, dict | list)}
            rows += [[f"{name}{key.replace('_', ' ')}", str(value)] for key, value in facts.items()]
        first = self.results[0].provenance
        origin = ", ".join(str(first[key])[:10] for key in ("vibroplat", "engine", "created") if first.get(key))
        return fold("How it was made", f"vibroplat {origin}", listing([], rows))


def _web(name: str) -> str:
    return files("vibroplat.page").joinpath("web", name).read_text(encoding="utf-8")


def _machines(machines: Sequence[Mapping[str, Any]]) -> str:
    """Return drawings that the script takes for orbits."""
    drawings = [drawing(one, "Drawing of the machine") for one in machines]
    return "".join(f'<template id="machine-{n}">{one}</template>' for n, one in enumerate(drawings))


def _events(one: Result) -> pd.DataFrame:
    return finite(one.columns("events", ("kind",), ("t_s", "impulse_n_s")))


def _inputs(scene: Scene) -> str:
    """Return what a machine is, in a few lines."""
    drive, torques = scene.drive, [exciter.critical_torque_n_m for exciter in scene.exciter_pair]
    material = f"{quantity(scene.material_mass, 'kg')} = {percent(scene.mass_ratio)}"
    supply = f"{given(drive.largest_frequency)} Hz"
    rows = {
        "platform with unbalances": quantity(scene.platform_mass, "kg", digits=4),
        "material": material if scene.material_mass else "none",
        "static moments": f"{' + '.join(f'{value:.4g}' for value in scene.unbalances)} kg·m",
        "breakdown torques": f"{' + '.join(f'{value:.4g}' for value in torques)} N·m",
        "supply": supply if drive.program is None else f"program up to {supply}",
    }
    lines = "".join(f"<li><span>{label}</span> {escape(text)}</li>" for label, text in rows.items())
    return f'<ul class="inputs">{lines}</ul>'


def sheet_html(sheets: Sequence[Sheet], names: Sequence[str]) -> str:
    """Return the data sheet of one run, or of several with a column for each."""
    single = len(sheets) == 1
    heads = ["", sheets[0].transient or "in operation", "largest of the run", "when"] if single else ["", *names]
    groups = ""
    for name in dict.fromkeys(name for one in sheets for name in one.groups if name != FURTHER):
        tables = [{row.label: row for row in one.groups.get(name, [])} for one in sheets]
        labels = dict.fromkeys(label for rows in tables for label in rows)
        lines = "".join(_line(label, [rows.get(label, Row(label)) for rows in tables]) for label in labels)
        title = f'<tr class="group"><th scope="rowgroup" colspan="{len(heads)}">{escape(name)}</th></tr>'
        groups += f"<tbody>{title}{lines}</tbody>"
    if not groups:
        return ""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    more = "" if single else hint("Pale: the largest value of the whole run.")
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
