"""The figure of a search for thresholds: measures of all values that were looked at, over the key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from vibroplat.columns import PHASE_COLUMN
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.labels import in_ratios, key_label, sweep_parameters, value_label
from vibroplat.plots.reading import Saved, finite
from vibroplat.plots.response import limit_size
from vibroplat.plots.style import FAILED, REFERENCE, entry, head, in_decades, legend_below, panel_grid
from vibroplat.plots.sweep import SYNC
from vibroplat.plots.timelines import in_units, name_axis, tell_shaking
from vibroplat.study.branches import column_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Measures that are shown if none is asked for, besides that of the expression.
MEASURES = ("rms_y_m", "rms_x_m", PHASE_COLUMN)
#: Opacity of mixed intervals.
SHADE = 0.15
#: Ends of mixed intervals in the table of thresholds.
MIXED = ("mixed_low", "mixed_high")


def threshold_figures(
    directories: Sequence[Path], kinds: Sequence[str] = (), *, measure: Sequence[str] = ()
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw the figure of each result of ``vibroplat find``, with these columns of its values instead of the usual ones.

    Raises
    ------
    TableError
        A table is missing or damaged, or has no such column of numbers.
    """
    for directory in directories:
        saved = Saved(directory, "find")
        key = saved.column("find", "key")
        values = saved.columns("scan", ("reason", "sync", "motion"), (key, *MEASURES, *measure))
        found = saved.columns("thresholds", ("kind",), ("value",), MIXED)
        name, plan = directory.resolve().name, saved.given("find")
        yield directory, "thresholds", threshold_figure(name, saved.known_scene, plan, values, found, measure)


def threshold_figure(
    name: str,
    scene: Scene | None,
    plan: Mapping[str, Any],
    values: pd.DataFrame,
    thresholds: pd.DataFrame,
    measures: Sequence[str] = (),
) -> Figure:
    """Draw measures over the key of a plan, in the colours of their synchronization.

    Thresholds are lines, mixed intervals are shaded.
    """
    if values.empty:
        raise TableError(f"{name} holds an empty table of values; there is nothing to plot")
    key, expression = column_of(plan["key"]), plan.get("expression") or ""
    level, _, number = expression.replace("=", "").replace("<", ">").partition(">")
    columns = [*measures] or [*([level.strip()] if level else []), *(c for c in MEASURES if c != level.strip())]
    mixed = thresholds.reindex(columns=MIXED).dropna().drop_duplicates().astype(float).itertuples(index=False)
    intervals = [(low, high) for low, high in mixed]
    figure, panels = panel_grid(len(columns), 1, (8.0, 1.7 + 1.9 * len(columns)), key_label(key))
    values = finite(values)
    for axis, column in zip(panels, columns, strict=True):
        name_axis(axis, column)
        _draw(axis, values, key, column)
        if column == level.strip():
            axis.axhline(float(in_units(float(number), column)), color=REFERENCE, lw=0.9, ls=":")
        if column == PHASE_COLUMN:
            tell_shaking(axis, scene.rotation if scene else "")
        elif column.startswith("rms_"):
            limit_size(axis, values)
        for value in thresholds["value"]:
            axis.axvline(value, color=REFERENCE, lw=0.9, ls="--", zorder=1.5)
        for low, high in intervals:
            axis.axvspan(low, high, color=REFERENCE, alpha=SHADE, lw=0.0, zorder=0.5)
    scan = values.loc[values["reason"] == "scan", key]
    if in_ratios(scan):
        in_decades(panels[0], "x")
    told = [f"{value_label(plan['key'], float(row['value']))}: {row['kind']}" for _, row in thresholds.iterrows()]
    told = [f"mixed from {value_label(plan['key'], low)} to {high:.6g}" for low, high in intervals] + told
    head(figure, name, "\n".join(filter(None, (sweep_parameters(scene, [key]), *(told or ["no threshold"])))))
    shaded = [entry("mixed", color=REFERENCE, alpha=SHADE, lw=5.0)] if intervals else []
    legend_below(figure, [*_entries(values, thresholds), *shaded])
    return figure


def _draw(axis: Axes, values: pd.DataFrame, key: str, column: str) -> None:
    """Draw a column: full where the motion repeats, open where it does not; failed values are crosses on the axis."""
    for sync, colour in SYNC.items():
        for repeats, filling in ((True, colour), (False, "white")):
            rows = values[(values["sync"] == sync) & ((values["motion"] == "periodic") == repeats)]
            shown = in_units(rows[column].to_numpy(dtype=float, na_value=math.nan), column)
            axis.plot(rows[key], shown, "o", color=colour, mfc=filling, ms=3.6, mew=0.8)
    failed = values.loc[values["sync"].isna(), key]
    across = axis.get_xaxis_transform()
    if len(failed):
        axis.plot(failed, [0.0] * len(failed), "x", color=FAILED, ms=5.0, mew=1.4, clip_on=False, transform=across)


def _entries(values: pd.DataFrame, thresholds: pd.DataFrame) -> Iterator[object]:
    """Yield the entries of the legend that the values need."""
    for sync in (name for name in SYNC if (values["sync"] == name).any()):
        yield entry("not synchronous" if sync == "none" else sync, marker="o", ls="", ms=4.0, color=SYNC[sync])
    if (values["motion"].dropna() != "periodic").any():
        yield entry("not periodic", marker="o", ls="", ms=4.0, color=REFERENCE, mfc="white")
    if values["sync"].isna().any():
        yield entry("failed", marker="x", ls="", ms=5.0, mew=1.4, color=FAILED)
    if len(thresholds):
        yield entry("threshold", color=REFERENCE, lw=0.9, ls="--")
