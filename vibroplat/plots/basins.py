"""Figures of basins of attraction: which attractor each start comes to and how long it takes, and shares over a key."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from vibroplat.columns import PHASE_COLUMN, unit_of
from vibroplat.config.scene import Scene
from vibroplat.plots.labels import in_ratios, key_label, key_name, sweep_parameters
from vibroplat.plots.reading import Saved
from vibroplat.plots.style import entry, head, in_decades, legend_below, new_figure
from vibroplat.plots.sweep import attractor_colours
from vibroplat.study.branches import column_of

#: Figures by their names.
FIGURES = ("basins",)
#: Attractors that the legend gives more of than their names, at most.
DESCRIBED = 6
#: Colour of starts that come to no orbit, where turns are drawn.
NEVER = "0.85"


def basin_figures(directories: Sequence[Path], kinds: Collection[str] = ()) -> Iterator[tuple[Path, str, Figure]]:
    """Yield the figure of the basins in each directory."""
    for directory in directories:
        result = Saved(directory, "basins")
        plan, tables = result.given("basins"), (result.table("attractors"), result.table("starts"))
        yield directory, "basins", basins_figure(directory.resolve().name, result.known_scene, plan, *tables)


def basins_figure(
    name: str, scene: Scene | None, plan: Mapping[str, Any], attractors: pd.DataFrame, starts: pd.DataFrame
) -> Figure:
    """Draw the basins of a scene, which has this section ``basins``: starts, or over a key shares of them."""
    ranges, key = plan["initial_conditions"], column_of(plan["over"]["key"]) if plan.get("over") else ""
    figure = _shares(attractors, key, plan["max_turns"]) if key else _places(attractors, starts, ranges)
    box = ", ".join(_range(start, ranges[start]) for start in (ranges if key else list(ranges)[2:]))
    crowded = not key and starts.duplicated(list(ranges)[:2]).any()
    hidden = "where several starts have one place, the last is seen" if crowded else ""
    within = "" if key else f"starts followed for {plan['max_turns']} turns"
    told = (sweep_parameters(scene, [key]), box and f"starts: {box}", within, hidden)
    head(figure, name, "\n".join(filter(None, told)))
    return figure


def _range(key: str, ends: Sequence[float]) -> str:
    """Say between which values starts have a key."""
    return f"{key_name(key)} {ends[0]:.4g} … {ends[1]:.4g} {unit_of(key)}".strip()


def _legend(attractors: pd.DataFrame, *, shares: bool) -> dict[str, str]:
    """Return what attractors are called in a legend, by their names."""
    found = {}
    rows = attractors.drop_duplicates("attractor")
    for _, row in rows.iterrows():
        told = [f"{row['attractor']}" + (f": {row['fraction']:.3g}" if shares else "")]
        if len(rows) <= DESCRIBED and shares and pd.notna(row["rms_y_m"]):
            if pd.notna(row[PHASE_COLUMN]):
                told.append(rf"$\Delta\varphi$ {round(row[PHASE_COLUMN], 2) + 0.0:g} rad")
            told.append(f"RMS y {1e3 * row['rms_y_m']:.3g} mm")
        found[row["attractor"]] = ", ".join(told)
    return found


def _places(attractors: pd.DataFrame, starts: pd.DataFrame, ranges: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the attractor and the turns of each start over the first two keys; over a single one turns alone.

    Turns of motions that come to no orbit say nothing beside those of others.
    """
    colours, names = attractor_colours(attractors["attractor"]), _legend(attractors, shares=True)
    first, *others = ranges
    settled = starts["attractor"].isin(attractors["attractor"][attractors["period"].gt(0)])
    timed = bool(others) and settled.any()
    figure, axes = new_figure(1, 2 if timed else 1, (9.0 if timed else 6.0, 4.6), sharex=True, sharey=True)
    numbers = starts["attractor"].map({name: number for number, name in enumerate(colours)}).to_numpy(float)
    turns = starts["turns"].to_numpy(float)
    left: Axes = axes[0, 0]
    left.set_xlabel(key_label(first))
    gridded = len(ranges) == 2 and all(len(ends) == 3 for ends in ranges.values())
    if not gridded:
        left.set_xlim(ranges[first][0], ranges[first][1])
    shown = ListedColormap(list(colours.values()))
    bounds: dict[str, Any] = {"cmap": shown, "vmin": -0.5, "vmax": len(colours) - 0.5}
    if not others:
        left.scatter(starts[first], turns, c=numbers, s=9.0, linewidths=0.0, **bounds)
        left.set_ylabel("turns until settled")
    else:
        left.set_ylabel(key_label(others[0]))
        _fill(left, starts, ranges, numbers, gridded=gridded, **bounds)
        if not gridded:
            left.set_ylim(ranges[others[0]][0], ranges[others[0]][1])
        if timed:
            right: Axes = axes[0, 1]
            right.set_xlabel(key_label(first))
            shades = colormaps["viridis"].with_extremes(bad=NEVER)
            image = _fill(right, starts, ranges, np.where(settled, turns, np.nan), gridded=gridded, cmap=shades)
            figure.colorbar(
                image, ax=right, label="turns until settled" + ("" if settled.all() else "; grey: not settled")
            )
        for axis in axes.flat:
            axis.grid(visible=False)
    legend_below(figure, [entry(names[name], color=colours[name], marker="s", linestyle="") for name in colours])
    return figure


def _fill(
    axis: Axes, starts: pd.DataFrame, ranges: Mapping[str, Sequence[float]], values: Any, *, gridded: bool, **look: Any
) -> Any:
    """Colour the starts by values: places of a grid, or dots."""
    first, second = list(ranges)[:2]
    if not gridded:
        size = float(np.clip(4e4 / len(starts), 3.0, 40.0))
        return axis.scatter(starts[first], starts[second], c=values, s=size, linewidths=0.0, plotnonfinite=True, **look)
    shape = int(ranges[first][2]), int(ranges[second][2])
    places = [
        np.linspace(ranges[key][0], ranges[key][1], count) for key, count in zip((first, second), shape, strict=True)
    ]
    order = np.lexsort((starts[first], starts[second]))
    return axis.pcolormesh(*places, values[order].reshape(shape[::-1]), shading="nearest", rasterized=True, **look)


def _shares(attractors: pd.DataFrame, key: str, turns: int) -> Figure:
    """Stack the shares of attractors over a key; bars say how well each is known from so many starts."""
    names, colours = _legend(attractors, shares=False), attractor_colours(attractors["attractor"])
    figure, axes = new_figure(1, 1, (6.4, 4.2))
    axis: Axes = axes[0, 0]
    parts = {name: attractors.pivot_table(index=key, columns="attractor", values=name) for name in _BOUNDS}
    values, below = parts["fraction"].index.to_numpy(float), np.zeros(len(parts["fraction"]))
    for name, colour in colours.items():
        share, low, high = (parts[bound][name].to_numpy(float) for bound in _BOUNDS)
        top = below + np.nan_to_num(share)
        if len(values) > 1:
            axis.fill_between(values, below, top, color=colour, alpha=0.55, linewidth=0.0)
        else:
            axis.bar(values, top - below, bottom=below, width=0.1, color=colour, alpha=0.55)
        known = top < 1.0 - 1e-9  # the uppermost is what the others leave
        bars = np.array([share - low, high - share])[:, known]
        axis.errorbar(
            values[known], top[known], bars, color=colour, fmt=".", markersize=3.0, linewidth=0.8, capsize=1.5
        )
        below = top
    axis.set(xlabel=key_label(key), ylabel=f"share of the starts within {turns} turns", ylim=(0.0, 1.0))
    if len(values) > 1:
        axis.set_xlim(values.min(), values.max())
    if in_ratios(values):
        in_decades(axis, "x")
    legend_below(figure, [entry(names[name], color=colours[name], marker="s", linestyle="") for name in colours])
    return figure


_BOUNDS = ("fraction", "fraction_low", "fraction_high")
