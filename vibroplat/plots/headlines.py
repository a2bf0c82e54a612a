"""What figures of runs show, in one sentence each, from the headlines and the data sheets of the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from vibroplat.plots.histories import Run
from vibroplat.results.labels import capital, plain
from vibroplat.results.run_answer import headline as answer_of
from vibroplat.results.sheet import Sheet

#: Rows of the short data sheet that a figure tells, by how their labels begin.
_ROWS = {
    "motion": ("no steady", "stroke", "rotation", "throw index"),
    "conveying": ("no steady", "conveying"),
    "loads": ("no steady", "foundation", "stroke"),
    "force": ("no steady", "throw index"),
    "acceleration": ("no steady", "throw index", "acceleration"),
    "spectrum": ("no steady", "throw index", "acceleration"),
}


def headline(kind: str, runs: Sequence[Run]) -> str:
    """Return the title of a figure of runs: a sentence for one of them, the first number of each of several."""
    told = [[*_told(kind, run)] for run in runs]
    if len(runs) > 1:
        named = [f"{plain(run.name)}: {parts[0]}" for run, parts in zip(runs, told, strict=True) if parts]
        return "; ".join(dict.fromkeys(named)) or ", ".join(plain(run.name) for run in runs)
    sentence = "; ".join(told[0]) or plain(runs[0].name)
    return capital(sentence)


def _told(kind: str, run: Run) -> Iterator[str]:
    """Yield what a run does, or what its data sheet says of what a figure shows, with the largest of the whole run."""
    if run.scene is None:
        return
    if kind not in _ROWS:
        yield plain(answer_of(run.scene, run.summary).removeprefix(f"{run.name}: "))
        return
    for label, value, *words in Sheet(run.scene, run.summary).short():
        if label.startswith(_ROWS[kind]):
            more = [
                part for part in "; ".join(words).split("; ") if part.startswith(("largest", "material in", "sticks"))
            ]
            yield ", ".join([f"{label} {value}", *more])
