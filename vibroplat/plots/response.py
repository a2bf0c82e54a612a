"""Response curves of a sweep: what is measured at each point, over frequency."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D

from vibroplat.plots.names import FREQUENCIES, MEASURES, PHASE_COLUMN, key_label
from vibroplat.plots.style import BLACK, CURVES, DIRECTIONS, FAILED, REFERENCE, head, legend_below, new_figure
from vibroplat.plots.timelines import phase_axis, wrapped
from vibroplat.study.bands import jumps
from vibroplat.study.branches import EXCITATION, SUPPLY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.plots.sweep_tables import Response

#: Least range of an axis of RMS, relative to the largest RMS of y.
LEAST_RANGE = 0.02
#: Most values of a key that have colours of their own; more of them follow a colour scale.
DISTINCT = 5
#: Fillings of the markers and what they say of the motion; others are not periodic.
FILLINGS = {"periodic": "full", "undecided": "bottom"}
_MEANING = {"full": "periodic", "none": "not periodic", "bottom": "undecided"}


def draw_response(
    axis: Axes,
    rows: pd.DataFrame,
    column: str,
    *,
    x: str = EXCITATION,
    color: Any = CURVES[0],
    label: str | None = None,
    size: float = 1.0,
) -> Axes:
    """Draw a quantity along one branch of a sweep.

    Jumps are left open. Markers point in the direction of the branch: full ones are periodic, open ones quasi-periodic
    or chaotic, half-full ones undecided. Points that failed are crosses on the horizontal axis.

    Parameters
    ----------
    axis
        Where to draw.
    rows
        The points of a branch, in their order.
    column
        A column of the sweep table, e.g. ``rms_y_m``.
    x
        Column of the horizontal axis.
    color, label
        Of the line and its markers.
    size
        Factor of the line's width and the markers' size.

    Returns
    -------
    Axes
        The same axis.
    """
    quantity = MEASURES[column]
    values = quantity.factor * rows[column].to_numpy(dtype=float, na_value=np.nan)
    values = wrapped(values) if column == PHASE_COLUMN else values
    places = rows[x].to_numpy(dtype=float, na_value=np.nan)
    up = rows["direction"].iloc[0] != "down"
    style: dict[str, Any] = {"color": color, "zorder": 2.5 if up else 2.4}
    axis.plot(*broken(places, values, rows), "-" if up else "--", lw=size * (0.9 if up else 0.7), label=label, **style)
    marker = DIRECTIONS["up" if up else "down"]
    for filling, chosen in fillings(rows):
        look = style | {"fillstyle": filling, "markerfacecoloralt": "white", "mew": 0.7, "ms": 3.2 * size}
        axis.plot(places[chosen], values[chosen], ls="", marker=marker, **look)
    failed = failed_places(rows, x)
    if len(failed):
        axis.plot(failed, np.zeros(len(failed)), "x", color=FAILED, ms=5.0, mew=1.4, clip_on=False, zorder=4.0,
                  transform=axis.get_xaxis_transform())  # fmt: skip
    if column == PHASE_COLUMN:
        phase_axis(axis)
    else:
        axis.set_ylabel(quantity.label)
    return axis


def broken(places: Any, values: Any, rows: pd.DataFrame) -> tuple[Any, Any]:
    """Return the points of a line that is broken at jumps."""
    at = np.flatnonzero(jumps(rows)) + 1
    return np.insert(places, at, np.nan), np.insert(values, at, np.nan)


def fillings(rows: pd.DataFrame) -> Iterator[tuple[str, Any]]:
    """Yield the fillings of markers and where they are: what is known of the motion."""
    motion = rows["motion"] if "motion" in rows else pd.Series("periodic", rows.index)
    found = motion.map(FILLINGS).fillna("none").where(rows[EXCITATION].notna(), "")
    for filling in _MEANING:
        if (found == filling).any():
            yield filling, (found == filling).to_numpy()


def failed_places(rows: pd.DataFrame, x: str) -> Any:
    """Return where points failed; excitation frequencies they do not have follow from those of their neighbours."""
    failed = _failed(rows).to_numpy(dtype=bool)
    supply = rows[SUPPLY].to_numpy(dtype=float)
    if x == SUPPLY or not failed.any():
        return supply[failed]
    ratio = rows[x].to_numpy(dtype=float, na_value=np.nan) / supply
    known = np.flatnonzero(np.isfinite(ratio))
    known = known[np.argsort(supply[known])]
    if not len(known):
        return np.zeros(0)
    return supply[failed] * np.interp(supply[failed], supply[known], ratio[known])


def _failed(rows: pd.DataFrame) -> pd.Series:
    return rows["outcome"] != "ok" if "outcome" in rows else rows[EXCITATION].isna()


def response_figure(response: Response) -> Figure:
    """Draw all measures of a response that say something, over frequency."""
    columns = _columns(response.table)
    two = len(columns) > 5
    rows = -(-len(columns) // 2) if two else len(columns)
    figure, axes = new_figure(rows, 1 + two, (11.0 if two else 8.0, 1.9 + 1.75 * rows), sharex=True)
    panels = axes.T.ravel()
    colours = list(curve_colours(response))
    count = 1 + max(number for _, number, _, _ in response.curves())
    for axis, column in zip(panels, columns, strict=False):
        for _, number, _, branch in response.curves():
            draw_response(axis, branch, column, x=response.x, color=colours[number], size=_size(number, count))
        _limit(axis, column, response.table)
        if response.data is not None:
            response.data.draw(axis, response.x, column, MEASURES[column])
    for axis in panels[len(columns) :]:
        axis.set_axis_off()
    for axis in axes[-1]:
        axis.set_xlabel(FREQUENCIES[response.x])
        axis.tick_params(labelbottom=True)
    if two and len(columns) % 2:
        axes[-2, 1].set_xlabel(FREQUENCIES[response.x])
        axes[-2, 1].tick_params(labelbottom=True)
    head(figure, ", ".join(response.names), response.parameters)
    _legend(figure, response, colours)
    return figure


def _size(number: int, count: int) -> float:
    """Return the size of a curve, from large to small: where curves lie on each other, the first ones stand out."""
    if count == 1:
        return 1.0
    largest = 1.6 if count <= DISTINCT else 1.1
    return largest - (largest - 0.7) * number / (count - 1)


def _columns(table: pd.DataFrame) -> list[str]:
    """Return the measures that a table has: power, force and flight only where there is any."""
    shown = ["rms_y_m", "rms_x_m", "rms_phi_rad", PHASE_COLUMN]
    for column in ("motor_power_w", "contact_force_max_n", "flight_fraction", "gap_max_m"):
        if column in table and (table[column] > 0.0).any():
            shown.append(column)
    return shown


def _limit(axis: Axes, column: str, table: pd.DataFrame) -> None:
    """Begin axes of what is never negative at 0; small RMS are drawn small, instead of magnified to noise."""
    if column in ("rms_y_m", "rms_x_m", "rms_phi_rad"):
        largest = table["rms_y_m"].max()
        least = LEAST_RANGE * 1e3 * largest if np.isfinite(largest) else 0.0
        axis.set_ylim(0.0, max(axis.get_ylim()[1], least))
    elif column == "flight_fraction":
        axis.set_ylim(0.0, 1.0)
    elif column in ("contact_force_max_n", "gap_max_m"):
        axis.set_ylim(bottom=0.0)


def curve_colours(response: Response) -> Sequence[Any]:
    """Return a colour for each grid combination: distinct ones, or along a scale if they are many."""
    labels = {curve.number: curve.rows for curve in response.curves()}
    if response.scale is not None and len(labels) > DISTINCT:
        norm, colours = _scale(response)
        return [colours(norm(float(rows[response.scale].iloc[0]))) for rows in labels.values()]
    return CURVES if len(labels) <= len(CURVES) else list(_many()(np.linspace(0.0, 1.0, len(labels))))


def _many() -> ListedColormap:
    """Return a scale of colours that differ in lightness as well, without its palest end."""
    return ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, 0.9, 256)))


def _scale(response: Response) -> tuple[Normalize, ListedColormap]:
    values = response.table[response.scale or ""]
    return Normalize(float(values.min()), float(values.max())), _many()


def _legend(figure: Figure, response: Response, colours: Sequence[Any]) -> None:
    """Name the colours, and below them what the markers say."""
    labels = list(dict.fromkeys(curve.label for curve in response.curves()))
    handles: list[Any] = []
    if response.scale is not None and len(labels) > DISTINCT:
        bar = figure.colorbar(ScalarMappable(*_scale(response)), ax=figure.axes, aspect=50, pad=0.01)
        bar.set_label(key_label(response.scale))
    elif len(labels) > 1 or response.keys:
        handles += [Line2D([], [], color=colours[i], lw=2.0, label=label) for i, label in enumerate(labels)]
    handles += list(marker_legend(response.table))
    if response.data is not None:
        known = [h for axis in figure.axes for h in axis.get_legend_handles_labels()[0]]
        handles += known[:1]
    legend_below(figure, handles, [handle.get_label() for handle in handles])


def marker_legend(table: pd.DataFrame) -> Iterator[Line2D]:
    """Yield the entries of a legend that say what markers mean, of those that a table needs."""
    for direction in dict.fromkeys(table["direction"]):
        up = direction != "down"
        look: dict[str, Any] = {"color": REFERENCE, "ls": "-" if up else "--", "lw": 0.9, "ms": 4.5}
        yield Line2D([], [], marker=DIRECTIONS["up" if up else "down"], label=f"supply frequency {direction}", **look)
    found = [filling for filling, _ in fillings(table)]
    if found != ["full"]:
        for filling in found:
            look = {"fillstyle": filling, "markerfacecoloralt": "white", "color": BLACK, "ls": "", "ms": 7.0}
            yield Line2D([], [], marker="^", mew=0.7, label=_MEANING[filling], **look)
    if _failed(table).any():
        yield Line2D([], [], ls="", marker="x", color=FAILED, ms=5.0, mew=1.4, label="failed")
