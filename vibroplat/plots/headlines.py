"""What figures of runs show, in one sentence each, from the headlines and the data sheets of the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vibroplat.plots.histories import RunTables
from vibroplat.results.labels import capital, plain
from vibroplat.results.run_answer import headline as answer_of
from vibroplat.results.run_answer import rests
from vibroplat.results.sheet import Sheet

#: Rows of the short data sheet that the title of a figure shows, by their columns.
_STROKES, _ACCELERATIONS = {"stroke_x_m", "stroke_y_m"}, {"acceleration_max_m_per_s2"}
_ROWS = {
    "motion": _STROKES | {"rms_phi_rad", "gamma"},
    "conveying": {"conveying_speed_m_per_s"},
    "loads": _STROKES | {"foundation_force_x_max_n", "foundation_force_y_max_n"},
    "force": {"gamma"},
    "acceleration": _ACCELERATIONS,
    "spectrum": _ACCELERATIONS,
}


def headline(kind: str, runs: Sequence[RunTables]) -> str:
    """Return the title of a figure of runs: a sentence for one of them, the first number of each of several."""
    texts = [[*_sentences(kind, run)] for run in runs]
    if len(runs) > 1:
        named = [f"{plain(run.name)}: {parts[0]}" for run, parts in zip(runs, texts, strict=True) if parts]
        return "; ".join(dict.fromkeys(named)) or ", ".join(plain(run.name) for run in runs)
    sentence = "; ".join(texts[0]) or plain(runs[0].name)
    return capital(sentence)


def _sentences(kind: str, run: RunTables) -> Iterator[str]:
    """Yield the headline of a run, or the rows of its data sheet for a figure, with the maxima of the whole run.

    Without steady operation only the maxima are shown.
    """
    if run.scene is None:
        return
    sheet, still = Sheet(run.scene, run.summary), rests(run.scene, run.summary)
    if kind not in _ROWS or still:
        yield plain(answer_of(run.scene, run.summary).removeprefix(f"{run.name}: "))
    if kind not in _ROWS:
        return
    if sheet.transient:
        yield sheet.transient.removeprefix("while ")
    every = [row.shortly(row.label, row.peak) for rows in sheet.groups.values() for row in rows]
    shown = every if kind in ("acceleration", "spectrum") else sheet.short_rows()
    for label, value, *words in (row.short for row in shown if row.column in _ROWS[kind]):
        parts = "; ".join(words).split("; ")
        largest = [part for part in parts if part.startswith("largest ")]
        if not (sheet.transient or still):
            more = [part for part in parts if part.startswith(("material in", "sticks"))]
            yield ", ".join([f"{label} {value}", *largest, *more])
        elif largest:
            yield f"largest {label} {largest[0].removeprefix('largest ')}"
