"""Response curves of a sweep, or of several laid over each other: what is measured at each point, over frequency."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.lines import Line2D

from vibroplat.columns import PHASE_COLUMN
from vibroplat.plots.labels import in_ratios, key_label, key_name
from vibroplat.plots.studies import Study, key_of
from vibroplat.plots.style import (
    BLACK,
    CURVES,
    DIRECTIONS,
    FAILED,
    REFERENCE,
    begin_at_zero,
    entry,
    few,
    head,
    in_decades,
    legend_below,
    panel_grid,
)
from vibroplat.plots.timelines import in_units, name_axis, tell_shaking
from vibroplat.study.bands import jumps
from vibroplat.study.branches import EXCITATION, SUPPLY

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vibroplat.kernels.compiled import FloatArray

_SIZES = ("rms_y_m", "rms_x_m", "rms_phi_rad")
#: Least range of an axis of RMS, relative to the largest RMS of x and y: small quantities are drawn small.
LEAST_RANGE = 0.02
#: Most values of a key that have colours of their own; more of them follow a colour scale.
DISTINCT = 5
#: Looks of the ways up and down, and the widths of their lines and sizes of their markers.
_LOOKS: dict[bool, dict[str, Any]] = {True: {"zorder": 2.5}, False: {"zorder": 2.4, "alpha": 0.5}}
_SIZES_OF = {True: (0.9, 3.2), False: (2.2, 4.6)}
#: Fillings of the markers and what they say of the motion; others are not periodic.
FILLINGS = {"periodic": "full", "undecided": "bottom"}
_MEANING = {"full": "periodic", "none": "not periodic", "bottom": "undecided"}

# -- one branch --------------------------------------------------------------------------------------------------------


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

    The way down is wide and pale below the way up, so that both are seen where they coincide. Jumps are left open.
    Markers point in the direction of the branch: full ones are periodic, open ones quasi-periodic
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
    _draw(axis, _course(rows, x), _numbers(rows[column]), column, color, label, size)
    axis.autoscale_view()
    return name_axis(axis, column)


class _Course(NamedTuple):
    """What all quantities along a branch share, found once for a figure.

    Attributes
    ----------
    places, up
        Places of the points on the horizontal axis, and whether the sweep went up.
    behind
        Numbers of the points behind a jump: the line is broken before each of them.
    fillings
        How markers are filled, each with the points that have it.
    failed
        Places of the points that failed.
    """

    places: FloatArray
    up: bool
    behind: Any
    fillings: list[tuple[str, Any]]
    failed: Any


def _course(rows: pd.DataFrame, x: str) -> _Course:
    places = _numbers(rows[x])
    up = bool(rows["direction"].iloc[0] != "down")
    return _Course(places, up, np.flatnonzero(jumps(rows)) + 1, list(_fillings(rows)), failed_places(rows, x))


def _numbers(column: pd.Series) -> FloatArray:
    return np.asarray(column.to_numpy(dtype=float, na_value=np.nan))


def _draw(
    axis: Axes, course: _Course, found: FloatArray, column: str, color: Any, label: str | None, size: float
) -> None:
    """Draw a quantity along a branch; its axis is scaled once, after the last branch.

    Lines are added as such, which takes half as long as ``plot``: there may be thousands.
    """
    values, up = in_units(found, column), course.up
    # lines are clipped and take no room beside the axes; to ask each of them takes a tenth of the time
    style: dict[str, Any] = {"color": color, "in_layout": False, **_LOOKS[up]}
    width, marker_size = (size * number for number in _SIZES_OF[up])
    x, y = course.places, values
    if len(course.behind):
        x, y = (np.insert(numbers, course.behind, np.nan) for numbers in (x, y))
    looks: list[dict[str, Any]] = [
        {"fillstyle": filling, "marker": DIRECTIONS["up" if up else "down"], "ms": marker_size, "mew": 0.7}
        for filling, _ in course.fillings
    ]
    whole = len(looks) == 1 and np.isfinite(course.places).sum() == course.fillings[0][1].sum()  # a single artist
    axis.add_line(Line2D(x, y, ls="-" if up else "--", lw=width, label=label, **style, **(looks[0] if whole else {})))
    for look, (_, chosen) in zip(looks, [] if whole else course.fillings, strict=False):
        some = Line2D(course.places[chosen], values[chosen], ls="", markerfacecoloralt="white", **style, **look)
        axis.add_line(some)
    if len(course.failed):
        axis.plot(course.failed, np.zeros(len(course.failed)), "x", color=FAILED, ms=5.0, mew=1.4, clip_on=False,
                  zorder=4.0, transform=axis.get_xaxis_transform())  # fmt: skip


def _fillings(rows: pd.DataFrame) -> Iterator[tuple[str, Any]]:
    """Yield the fillings of markers and where they are: what is known of the motion."""
    motions = rows["motion"].to_numpy(dtype=object) if "motion" in rows else ["periodic"] * len(rows)
    found = np.array([FILLINGS.get(motion, "none") for motion in motions], dtype=object)
    found[rows[EXCITATION].isna().to_numpy()] = ""
    for filling in _MEANING:
        if (found == filling).any():
            yield filling, found == filling


def failed_places(rows: pd.DataFrame, x: str) -> Any:
    """Return where points failed; excitation frequencies they do not have follow from those of their neighbours."""
    failed, key = _failed(rows).to_numpy(dtype=bool), key_of(rows)
    over = rows[key].to_numpy(dtype=float)
    if x == key or not failed.any():
        return over[failed]
    expected = over if key == SUPPLY else np.ones(len(over))
    ratio = rows[x].to_numpy(dtype=float, na_value=np.nan) / expected
    known = np.flatnonzero(np.isfinite(ratio))
    known = known[np.argsort(over[known])]
    if not len(known):
        return np.zeros(0)
    return expected[failed] * np.interp(over[failed], over[known], ratio[known])


def _failed(rows: pd.DataFrame) -> pd.Series:
    return rows["outcome"] != "ok" if "outcome" in rows else rows[EXCITATION].isna()


def marker_legend(table: pd.DataFrame) -> Iterator[Line2D]:
    """Yield the entries of a legend that say what markers mean, of those that a table needs."""
    for direction in dict.fromkeys(table["direction"]):
        up = direction != "down"
        width, size = _SIZES_OF[up]
        look = {"color": REFERENCE, "ls": "-" if up else "--", "lw": width, "ms": 1.4 * size, **_LOOKS[up]}
        yield entry(f"{key_name(key_of(table))} {direction}", marker=DIRECTIONS["up" if up else "down"], **look)
    found = [filling for filling, _ in _fillings(table)]
    if found != ["full"]:
        for filling in found:
            look = {"fillstyle": filling, "markerfacecoloralt": "white", "color": BLACK, "ls": "", "ms": 7.0}
            yield entry(_MEANING[filling], marker="^", mew=0.7, **look)
    if _failed(table).any():
        yield entry("failed", ls="", marker="x", color=FAILED, ms=5.0, mew=1.4)


# -- the figure --------------------------------------------------------------------------------------------------------


def response_figure(response: Study) -> Figure:
    """Draw all measures of a response that say something, over frequency.

    Where all points failed none has an excitation frequency, and the values of the key show where they are.
    """
    if response.points[response.x].isna().all():
        response = replace(response, x=response.key)
    columns = [*response.measures] or _columns(response.points)
    two = len(columns) > 5
    size = (11.0 if two else 8.0, 1.9 + 1.75 * -(-len(columns) // (1 + two)))
    figure, panels = panel_grid(len(columns), 1 + two, size, key_label(response.x))
    labels = list(dict.fromkeys(curve.label for curve in response.curves))
    colours, scale = _colours(response, len(labels))
    courses = [(_course(c.rows, response.x), c.number, _size(c.number, len(labels))) for c in response.curves]
    found = [c.rows[columns].to_numpy(dtype=float, na_value=np.nan).T for c in response.curves]
    for i, (axis, column) in enumerate(zip(panels, columns, strict=False)):
        name_axis(axis, column)
        for (course, number, width), values in zip(courses, found, strict=True):
            _draw(axis, course, values[i], column, colours[number], None, width)
        axis.autoscale_view()
        if response.data is not None:
            response.data.draw(axis, response.x, column)
        _limit(axis, column, response.points)
        if column == PHASE_COLUMN:
            tell_shaking(axis, response.rotation)
    if in_ratios(response.points[response.x]):
        in_decades(panels[0], "x")  # that all share
    head(figure, ", ".join(response.names), response.parameters([response.key, *response.varied]))
    handles: list[Any] = []
    if scale is not None:
        bar = figure.colorbar(scale, ax=figure.axes, aspect=50, pad=0.01)
        bar.set_label(key_label(response.varied[0]))
    elif len(labels) > 1 or response.varied:
        handles += few([entry(label, color=colours[i], lw=2.0) for i, label in enumerate(labels)])
    handles += marker_legend(response.points)
    handles += [line for axis in figure.axes for line in axis.get_legend_handles_labels()[0]][:1]  # measured data
    legend_below(figure, handles)
    return figure


def _size(number: int, count: int) -> float:
    """Return the size of a curve, from large to small: where curves lie on each other, the first ones stand out."""
    if count == 1:
        return 1.0
    largest = 1.6 if count <= DISTINCT else 1.1
    return largest - (largest - 0.7) * number / (count - 1)


def _columns(table: pd.DataFrame) -> list[str]:
    """Return the measures that a table has: power, force and flight only where there is any."""
    more = ("motor_power_w", "contact_force_max_n", "flight_fraction", "gap_max_m")
    return [*_SIZES, PHASE_COLUMN, *(column for column in more if column in table and (table[column] > 0.0).any())]


def limit_size(axis: Axes, table: pd.DataFrame) -> None:
    """Begin the axis of an RMS at 0, and draw small ones small, instead of magnified to noise."""
    largest = float(table[["rms_x_m", "rms_y_m"]].max().max())
    begin_at_zero(axis, max(axis.get_ylim()[1], LEAST_RANGE * 1e3 * largest if np.isfinite(largest) else 0.0))


def _limit(axis: Axes, column: str, table: pd.DataFrame) -> None:
    """Begin axes of what is never negative at 0."""
    if column in _SIZES:
        limit_size(axis, table)
    elif column == "flight_fraction":
        begin_at_zero(axis, 1.0)
    elif column in ("contact_force_max_n", "gap_max_m"):
        begin_at_zero(axis)


def _colours(response: Study, count: int) -> tuple[Sequence[Any], ScalarMappable | None]:
    """Return a colour for each grid combination: distinct ones, or along a scale, which is returned, if they are many.

    The scale differs in lightness as well, and is without its palest end.
    """
    many = ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, 0.9, 256)))
    if response.scale is not None and count > DISTINCT:
        values = response.points[response.scale]
        norm = Normalize(float(values.min()), float(values.max()))
        numbers = {curve.number: float(curve.rows[response.scale].iloc[0]) for curve in response.curves}
        return [many(norm(number)) for number in numbers.values()], ScalarMappable(norm, many)
    return CURVES if count <= len(CURVES) else list(many(np.linspace(0.0, 1.0, count))), None
