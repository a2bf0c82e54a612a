"""Figures of a run, or of several laid over each other, drawn from their tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vibroplat.errors import TableError
from vibroplat.plots.data import Data
from vibroplat.plots.differences import differing, distinct, labels
from vibroplat.plots.names import COORDINATES, PHASE, run_parameters
from vibroplat.plots.run_tables import Run, matters, range_of, read_run
from vibroplat.plots.style import (
    BLACK,
    CURVES,
    FORCE,
    MATERIAL,
    PLATFORM,
    REFERENCE,
    Saving,
    head,
    legend_below,
    new_figure,
    save,
    styled,
)
from vibroplat.plots.timelines import (
    draw_contact,
    draw_coordinate,
    draw_envelope,
    draw_impacts,
    draw_impulses,
    draw_phase_difference,
    draw_speeds,
    draw_synchronous_speed,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Least range of the axes of x and y, over the largest range of what moves, that of the exciters' axes included.
LEAST_RANGE = 0.05
#: Most turns that are drawn as a line; more of them as an envelope.
MOST_TURNS = 60


@dataclass(frozen=True)
class Shown:
    """The runs of a figure, measured data laid over them, and what several of them are called."""

    runs: list[Run]
    data: Data | None = None
    names: Sequence[str] = ()

    @property
    def only(self) -> Run | None:
        """The run, if there is one."""
        return self.runs[0] if len(self.runs) == 1 else None

    @property
    def aligned(self) -> bool:
        """Whether times are counted from a whole turn of exciter 1, to compare the last turns of several runs."""
        return self.only is None and self.data is None and not any(run.chosen for run in self.runs)

    def origin(self, run: Run) -> float:
        """Return the time (s) from which those of a run are counted in detail."""
        if not self.aligned:
            return 0.0
        turns = run.shown["phi1_rad"].abs() // (2.0 * np.pi)
        return float(run.shown["t_s"].iloc[int(turns.gt(turns.iloc[0]).argmax())])

    def look(self, number: int, column: str) -> dict[str, Any]:
        """Return the look of a run's line: a colour for each quantity, or for each run if there are several."""
        if self.only is not None:
            return {"color": {"gap_m": MATERIAL, "contact_force_n": FORCE}.get(column, PLATFORM)}
        colour = CURVES[number % len(CURVES)]
        return {"color": colour, "label": self.names[number], "lw": 1.8 - 0.9 * number / len(self.runs), "alpha": 0.9}

    def measured(self, axis: Axes, column: str) -> None:
        """Lay the data over an axis in time."""
        if self.data is not None:
            self.data.draw(axis, "t_s", column, COORDINATES[column])

    @property
    def detail(self) -> str:
        """The label of the horizontal axis where turns are shown in detail."""
        return "$t$ since a whole turn of exciter 1 (s)" if self.aligned else "$t$ (s)"


def plot_run(
    directory: Path | Sequence[Path],
    kinds: Sequence[str],
    start: float | None = None,
    stop: float | None = None,
    *,
    data: Data | None = None,
    saving: Saving | None = None,
) -> list[Path]:
    """Draw figures of a run, or of several over each other, and save them in the directory of the first.

    Parameters
    ----------
    directory
        Result directories of ``vibroplat run``.
    kinds
        ``motion`` (platform and gap: the whole run, and its last turns), ``force`` (contact force and impulses),
        ``exciters`` (speeds and phase difference).
    start, stop
        Interval shown (s). Default: the whole run, and the last ten turns of the exciters in detail.
    data
        Measured data laid over the figures, see :func:`vibroplat.plots.data.read_data`.
    saving
        Format, resolution and place of the files.

    Returns
    -------
    list of Path
        The files. ``force`` is omitted if no scene has contact, and refused if nothing else is asked for.

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval is empty.
    """
    directories = [directory] if isinstance(directory, Path) else list(directory)
    shown = _shown([read_run(place, start, stop) for place in directories], directories, data)
    compared = "" if shown.only else "-compared"
    written = []
    for kind in kinds:
        if kind == "force" and not any("contact_force_n" in run.shown for run in shown.runs):
            continue
        with styled():
            figure = FIGURES[kind](shown)
            written.append(save(figure, directories[0], f"{kind}{compared}", saving))
    if not written:
        raise TableError(f"--kind force: {directories[0]} has no contact force, as its scene is bare or non-impact")
    return written


def _shown(runs: list[Run], directories: Sequence[Path], data: Data | None) -> Shown:
    """Name several runs by how they differ."""
    if len(runs) == 1:
        return Shown(runs, data)
    trees = [run.scene.to_tree() for run in runs if run.scene is not None]
    found: Sequence[Mapping[str, Any]] = differing("run", trees) if len(trees) == len(runs) else [{}] * len(runs)
    return Shown(runs, data, labels(distinct([run.name for run in runs], directories), found))


def _head(figure: Figure, shown: Shown, named: Axes | None = None) -> None:
    """Put the runs' names and parameters above a figure, and below it the lines of an axis that names them.

    Several runs are always named, by the lines of the last axis.
    """
    run = shown.only
    if run is not None:
        head(figure, run.name, run_parameters(run.scene))
        if named is None:
            return
    else:
        head(figure, ", ".join(run.name for run in shown.runs))
    _legend_below(figure, named or figure.axes[-1])


def _legend_below(figure: Figure, axis: Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    legend_below(figure, named.values(), named.keys())


def _motion(shown: Shown) -> Figure:
    """Draw the platform and the gap: the whole run on the left, the last turns on the right."""
    runs = shown.runs
    rows = ["y_m", *(c for c in ("x_m", "phi_rad") if matters(runs, c))]
    rows += ["gap_m"] if any("gap_m" in run.shown for run in runs) else []
    overview = not any(run.chosen for run in runs) and any(_is_long(run) for run in runs)
    size = (10.0 if overview else 8.0, 1.5 + 1.45 * len(rows))
    figure, axes = new_figure(len(rows), 1 + overview, size, sharex="col")
    for column, row in zip(rows, axes, strict=True):
        if overview:
            _overview(row[0], shown, column)
        _detail(row[-1], shown, column)
    if overview:
        axes[0, 0].set_title("whole run, range of values", loc="left")
        axes[0, 1].set_title("last turns, grey on the left" if shown.only else "last turns", loc="left")
        axes[-1, 0].set_xlabel("$t$ (s)")
    axes[-1, -1].set_xlabel(shown.detail)
    if shown.only is not None and "gap_m" in rows:
        axes[-1, -1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderpad=0.0)
    _measured_legend(axes[0, -1], shown)
    _head(figure, shown)
    return figure


def _is_long(run: Run) -> bool:
    """Whether a run is much longer than its part shown in detail."""
    return float(np.ptp(run.whole["t_s"])) > 1.5 * float(np.ptp(run.shown["t_s"]))


def _overview(axis: Axes, shown: Shown, column: str) -> None:
    """Draw the range of a coordinate over the whole run, and shade what is shown in detail."""
    for number, run in enumerate(shown.runs):
        if f"{column}:max" in run.envelope:
            look = shown.look(number, column)
            draw_envelope(axis, run.envelope, column, color=look["color"], filled=shown.only is not None)
            if shown.only is not None:
                axis.axvspan(run.shown["t_s"].iloc[0], run.shown["t_s"].iloc[-1], color=REFERENCE, alpha=0.25, lw=0)
    shown.measured(axis, column)


def _detail(axis: Axes, shown: Shown, column: str) -> None:
    """Draw a coordinate in detail, with contact shaded and impacts marked if there is one run."""
    for number, run in enumerate(shown.runs):
        if column not in run.shown:
            continue
        look = shown.look(number, column)
        if run.turns > MOST_TURNS:
            filled = shown.only is not None
            draw_envelope(axis, run.envelope, column, color=look["color"], label=look.get("label"), filled=filled)
            continue
        table = run.shown.assign(t_s=run.shown["t_s"] - shown.origin(run))
        draw_coordinate(axis, table[table["t_s"] >= 0.0] if shown.aligned else table, column, **look)
        if shown.only is not None and "gap_m" in run.shown:
            draw_contact(axis, run.shown)
            if column == "gap_m":
                draw_impacts(axis, run.events)
    shown.measured(axis, column)
    if column in ("x_m", "y_m"):
        _no_noise(axis, shown)


def _no_noise(axis: Axes, shown: Shown) -> None:
    """Widen an axis of x or y on which numerical noise would fill the panel."""
    ranges = [range_of(run.shown[c], run, c) for run in shown.runs for c in ("x_m", "y_m", "phi_rad") if c in run.shown]
    least, (low, high) = LEAST_RANGE * 1e3 * max(ranges), axis.get_ylim()
    if high - low < least:
        axis.set_ylim(0.5 * (low + high - least), 0.5 * (low + high + least))


def _measured_legend(axis: Axes, shown: Shown) -> None:
    if shown.data is not None and shown.only is not None:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0)


def _force(shown: Shown) -> Figure:
    """Draw the contact force, and below it the impulses of impacts as stems: they are no forces."""
    strikes = any((run.events["impulse_n_s"] > 0.0).any() for run in shown.runs)
    ratios = {"height_ratios": [2.0, 1.0]} if strikes else {}
    size = (8.0, 4.4 if strikes else 3.2)
    figure, axes = new_figure(1 + strikes, 1, size, sharex=True, gridspec_kw=ratios)
    force: Axes = axes[0, 0]
    _detail(force, shown, "contact_force_n")
    force.set_ylim(bottom=0.0)
    for number, run in enumerate(shown.runs if strikes else []):
        events = run.events.assign(t_s=run.events["t_s"] - shown.origin(run))
        colour = BLACK if shown.only is not None else shown.look(number, "")["color"]
        draw_impulses(axes[1, 0], events, colour, None if shown.only is not None else shown.names[number])
    if strikes and shown.only is not None and shown.only.turns <= MOST_TURNS:
        draw_contact(axes[1, 0], shown.only.shown)
    axes[-1, 0].set_xlabel(shown.detail)
    if any(patch.get_label() == "attached" for patch in force.patches) or shown.data is not None:
        force.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.0, ncols=2)
    _head(figure, shown)
    return figure


def _exciters(shown: Shown) -> Figure:
    """Draw the speeds of both exciters and their phase difference over the whole interval."""
    figure, axes = new_figure(2, 1, (8.0, 5.0), sharex=True)
    speeds, phases = axes[:, 0]
    for number, run in enumerate(shown.runs):
        several = shown.only is None
        colour = CURVES[number % len(CURVES)]
        draw_speeds(speeds, run.whole, (colour, colour if several else CURVES[1]))
        if run.scene is not None and not several:
            draw_synchronous_speed(speeds, run.scene, run.whole["t_s"])
        label = shown.names[number] if several else None
        draw_phase_difference(phases, run.whole, co_rotating=run.co_rotating, color=colour, label=label)
    if shown.only is None:
        for number, line in enumerate(speeds.lines[:2], 1):
            look: dict[str, Any] = {"ls": line.get_linestyle(), "lw": line.get_linewidth(), "color": REFERENCE}
            phases.plot([], [], label=f"exciter {number}", **look)
    if len({run.co_rotating for run in shown.runs}) > 1:
        phases.set_ylabel(PHASE)
    phases.set_xlabel("$t$ (s)")
    _head(figure, shown, speeds if shown.only is not None else phases)
    return figure


FIGURES: dict[str, Callable[[Shown], Figure]] = {"motion": _motion, "force": _force, "exciters": _exciters}
