"""Figures of a sweep, drawn from its tables: response curves, bifurcation diagram, regime map."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from vibroplat.errors import TableError
from vibroplat.plots.reading import read_columns, read_result
from vibroplat.plots.style import CURVES, plain, plt, save, styled
from vibroplat.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FREQUENCY = "supply_frequency_hz"
EXCITATION = "excitation_frequency_hz"
#: Smallest range of an axis, relative to the largest RMS of y.
LEAST_RANGE = 0.02
#: Kinds of synchronization and their colours in a map.
SYNC = {"antiphase": "#1f4e79", "in-phase": "#c05a1c", "intermediate": "#8a6d1d", "none": "#c8c8c8"}
#: Classes of periods in a map: upper limits and labels.
_PERIODS = ((0, "none"), (1, "1"), (2, "2"), (4, "3, 4"), (8, "5 … 8"), (64, "9 … 64"))
_PERIOD_COLOURS = ("#c8c8c8", "#1f4e79", "#5b8db8", "#2a7f4f", "#8a6d1d", "#c05a1c")

#: Columns that figures need in addition to the swept keys.
_NUMBERS = (EXCITATION, "rms_x_m", "rms_y_m", "rms_phi_rad", "phase_difference_rad", "period")


@dataclass(frozen=True)
class Response:
    """Table of a sweep, and the grid keys that have several values."""

    result: Result
    name: str
    table: pd.DataFrame
    keys: list[str]

    def curves(self) -> Iterator[tuple[str, int, str, pd.DataFrame]]:
        """Yield the label, the number of the grid combination, the direction and the rows of each branch."""
        numbers: dict[str, int] = {}
        for _, rows in self.table.groupby("branch", sort=True):
            label = ", ".join(
                f"{key.split('.')[-1]} {rows[key].iloc[0]:g}" for key in self.keys if _is_number(rows[key])
            )
            others = ", ".join(str(rows[key].iloc[0]) for key in self.keys if not _is_number(rows[key]))
            label = ", ".join(part for part in (label, others) if part)
            yield plain(label), numbers.setdefault(label, len(numbers)), str(rows["direction"].iloc[0]), rows


def _kind(result: Result) -> str:
    """Return the kind of a sweep."""
    try:
        return str(result.provenance["configuration"]["sweep"]["kind"])
    except (KeyError, TypeError):
        raise TableError(f"{result.directory}/provenance.json is not the provenance of a sweep") from None


def plot_sweep(directory: Path, kinds: Sequence[str]) -> list[Path]:
    """Draw figures of a sweep and save them in its directory.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat sweep``.
    kinds
        ``response`` (RMS, phase difference and flight over excitation frequency), ``bifurcation`` (points of
        the Poincaré section and impact speeds), ``map`` (synchronization and period over frequency and a key of
        the grid). Default: response and the kind of the sweep.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    response = read_response(directory)
    if not kinds:
        kinds = list(dict.fromkeys(["response", _kind(response.result)]))
    with styled():
        return [save(FIGURES[kind](response), directory / f"{kind}.png") for kind in kinds]


def read_response(directory: Path) -> Response:
    """Read the table of a sweep."""
    result = read_result(directory, "sweep")
    table = read_columns(result, "sweep", ("direction", "sync"), (FREQUENCY, "branch", *_NUMBERS), ("flight_fraction",))
    if table.empty:
        raise TableError(f"{directory} holds an empty sweep table; there is nothing to plot")
    grid = list(table.columns[1 : list(table.columns).index("direction")])
    return Response(result, directory.resolve().name, table, [key for key in grid if len(table[key].unique()) > 1])


def _is_number(column: pd.Series[Any]) -> bool:
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def draw_curves(axis: Axes, response: Response, column: str, factor: float = 1.0, *, wrap: bool = False) -> None:
    """Draw one quantity over excitation frequency: one colour per combination, up solid, down dashed with dots."""
    curves = list(response.curves())
    colours = curve_colours(1 + max(number for _, number, _, _ in curves))
    for label, number, direction, rows in curves:
        values = factor * rows[column].to_numpy(dtype=float)
        if wrap:
            values = np.mod(values + 0.5, 2.0 * np.pi) - 0.5
        up = direction == "up"
        axis.plot(
            rows[EXCITATION],
            values,
            "-" if up else "--",
            marker="o" if up else "s",
            ms=2.2,
            lw=1.0,
            alpha=1.0 if up else 0.6,
            color=colours[number],
            mfc=None if up else "white",
            label=f"{label} {'↑' if up else '↓'}".strip(),
        )


def curve_colours(count: int) -> Sequence[Any]:
    """Return a colour for each curve: distinct colours, or a colour scale if there are too many curves."""
    return CURVES if count <= len(CURVES) else list(plt.get_cmap("viridis")(np.linspace(0.0, 0.95, count)))


def phase_axis(axis: Axes) -> None:
    """Label an axis of phase differences."""
    axis.set_ylim(-0.6, 2.0 * np.pi - 0.4)
    axis.set_yticks([0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi], ["0", "π/2", "π", "3π/2"])
    axis.set_ylabel("Δφ")


def _response(response: Response) -> Figure:
    """Draw the RMS of y, x and φ, the phase difference, and the flight fraction if there is material."""
    flies = bool((response.table.get("flight_fraction", pd.Series(dtype=float)) > 0.0).any())
    figure, axes = plt.subplots(4 + flies, 1, figsize=(8.5, 8.5 + 1.8 * flies), sharex=True)
    shown = [("rms_y_m", 1e3, "RMS y (mm)"), ("rms_x_m", 1e3, "RMS x (mm)"), ("rms_phi_rad", 1e3, "RMS φ (mrad)")]
    for axis, (column, factor, label) in zip(axes, shown, strict=False):
        draw_curves(axis, response, column, factor)
        axis.set_ylabel(label)
        # small quantities are drawn small, instead of magnified to noise
        axis.set_ylim(0.0, max(axis.get_ylim()[1], LEAST_RANGE * 1e3 * response.table["rms_y_m"].max()))
    draw_curves(axes[3], response, "phase_difference_rad", wrap=True)
    phase_axis(axes[3])
    if flies:
        draw_curves(axes[4], response, "flight_fraction")
        axes[4].set_ylabel("flight fraction")
        axes[4].set_ylim(-0.05, 1.05)
    axes[-1].set_xlabel("excitation frequency f (Hz)")
    axes[0].set_title(plain(response.name), loc="left")
    handles, labels = axes[0].get_legend_handles_labels()
    if len(handles) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(handles), 4), fontsize=8)
    return figure


def _bifurcation(response: Response) -> Figure:
    """Draw points of the Poincaré section and impact speeds over frequency, one column per grid combination."""
    section = read_columns(response.result, "section", "direction", (EXCITATION, "branch", "y_m"))
    impacts = read_columns(response.result, "impacts", "direction", (EXCITATION, "branch", "impact_speed_m_per_s"))
    curves = list(response.curves())
    columns = 1 + max(number for _, number, _, _ in curves)
    figure, axes = plt.subplots(
        2, columns, figsize=(max(8.5, 5.0 * columns), 6.5), sharex=True, sharey="row", squeeze=False
    )
    for label, number, direction, rows in curves:
        branch = rows["branch"].iloc[0]
        style: Any = {"ms": 3.4 if direction == "up" else 2.2, "mew": 0, "alpha": 0.7}
        style["color"] = CURVES[0] if direction == "up" else CURVES[1]
        for axis, table, column, factor in (
            (axes[0, number], section, "y_m", 1e3),
            (axes[1, number], impacts, "impact_speed_m_per_s", 1.0),
        ):
            points = table[table["branch"] == branch]
            axis.plot(points[EXCITATION], factor * points[column], ".", **style)
        axes[0, number].set_title(label or plain(response.name), loc="left")
        axes[1, number].set_xlabel("excitation frequency f (Hz)")
    axes[0, 0].set_ylabel("y at whole turns of exciter 1 (mm)")
    axes[1, 0].set_ylabel("impact speed (m/s)")
    directions = list(dict.fromkeys(direction for _, _, direction, _ in curves))
    handles = [
        Line2D([], [], ls="", marker="o", ms=4, color=CURVES[0] if d == "up" else CURVES[1], label=d)
        for d in directions
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def _map_key(response: Response) -> str | None:
    """Return the grid key with several numbers, or None if there is not exactly one."""
    keys = [key for key in response.keys if _is_number(response.table[key])]
    return keys[0] if len(keys) == len(response.keys) == 1 else None


def _map(response: Response) -> Figure:
    """Draw maps of synchronization and period over supply frequency and a grid key."""
    key = _map_key(response)
    if key is None:
        raise TableError(
            f"{response.result.directory} varies {response.keys}; a map needs one grid key with several numbers"
        )
    directions = list(dict.fromkeys(response.table["direction"]))
    figure, axes = plt.subplots(
        len(directions), 2, figsize=(11, 0.8 + 3.2 * len(directions)), sharex=True, sharey=True, squeeze=False
    )
    sync = ListedColormap(list(SYNC.values()))
    periods = ListedColormap(list(_PERIOD_COLOURS))
    for row, direction in zip(axes, directions, strict=True):
        table = response.table[response.table["direction"] == direction]
        ended = table["period"].notna().to_numpy(dtype=bool)
        classes = np.searchsorted([end for end, _ in _PERIODS], table["period"].fillna(0).astype(int))
        # failed points stay white
        _tiles(row[0], table.assign(value=table["sync"].map({name: i for i, name in enumerate(SYNC)})), key, sync)
        _tiles(row[1], table.assign(value=np.where(ended, classes, np.nan)), key, periods)
        row[0].set_title(f"synchronization, {direction}", loc="left")
        row[1].set_title(f"period, {direction}", loc="left")
        row[0].set_ylabel(plain(key))
        row[0].set_yticks(sorted(table[key].unique())[:: max(1, len(table[key].unique()) // 8)])
    labels = ([*SYNC.items()], [(name, c) for c, (_, name) in zip(_PERIOD_COLOURS, _PERIODS, strict=True)])
    for axis, entries in zip(axes[-1], labels, strict=True):
        axis.set_xlabel("supply frequency (Hz)")
        patches = [Patch(color=colour, label=name) for name, colour in entries]
        axis.legend(handles=patches, loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=6, fontsize=7.5)
    return figure


def _tiles(axis: Axes, table: pd.DataFrame, key: str, colours: ListedColormap) -> None:
    """Draw one coloured tile per point."""
    grid = table.pivot_table(index=key, columns=FREQUENCY, values="value", aggfunc="first")
    norm = BoundaryNorm(np.arange(colours.N + 1) - 0.5, colours.N)
    axis.set_facecolor("white")
    axis.pcolormesh(grid.columns, grid.index, grid.to_numpy(dtype=float), cmap=colours, norm=norm, shading="nearest")
    axis.grid(visible=False)


FIGURES: dict[str, Callable[[Response], Figure]] = {"response": _response, "bifurcation": _bifurcation, "map": _map}
