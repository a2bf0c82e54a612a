"""Axes of figures: units and names of columns, phase differences, and readable ranges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from vibroplat.columns import COORDINATES, FORCES, PHASE, PHASE_COLUMN, Quantity, describe_sync, quantity_of
from vibroplat.config.coordinates import TURN
from vibroplat.results.labels import EXCITATION, SUPPLY, key_label
from vibroplat.results.picture import REFERENCE, SYNC

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = np.ndarray[Any, np.dtype[np.float64]]

_SHOWN = COORDINATES | FORCES | {"t_s": Quantity("time", "s")}
#: Where phase differences begin, so that 0 and π, near which exciters synchronize, are well inside.
LOWEST_PHASE = -0.5 * np.pi
#: Distance from 0 and from π up to which phase differences are shaded as those of a synchronization (rad).
SYNC_DISTANCE = np.pi / 3.0
#: Margin of an axis beyond its data, relative to its range, so that markers are whole; and the smallest range, relative
#: to the largest number on it.
AXIS_MARGIN, MIN_RANGE_RATIO = 0.05, 1e-3
#: Ratio of the ends of a logarithmic axis up to which there are ticks between its powers of ten.
NEAR_DECADES = 300.0


def shown_quantity(column: str) -> Quantity:
    """Return the name and unit of a column on an axis."""
    return _SHOWN.get(column) or quantity_of(column)


def in_units(values: Any, column: str) -> FloatArray:
    """Return values of a column in the unit of its axis; phase differences lie on their axis."""
    numbers = np.asarray(values, dtype=float)
    if column == PHASE_COLUMN:
        return np.mod(numbers - LOWEST_PHASE, TURN) + LOWEST_PHASE
    return shown_quantity(column).factor * numbers


def label_of(column: str) -> str:
    """Return what a column is called on an axis, with its unit."""
    if column in (EXCITATION, SUPPLY) or "." in column:
        return key_label(column)
    return shown_quantity(column).label


def name_axis(axis: Axes, column: str, label: str = "", rotation: str = "") -> None:
    """Label the vertical axis of a column; on that of phase differences, also what the machine does in each class.

    Phase differences lie on a circle that is cut at −π/2.
    """
    axis.set_ylabel(label or (PHASE if column == PHASE_COLUMN else label_of(column)))
    if column != PHASE_COLUMN:
        return
    axis.set_ylim(LOWEST_PHASE - 0.1, LOWEST_PHASE + TURN + 0.1)
    ticks = {-0.5: "−90°", 0.0: "0°", 0.5: "90°", 1.0: "180°", 1.5: "−90°"}
    axis.set_yticks([np.pi * tick for tick in ticks], list(ticks.values()))
    for angle, name in ((0.0, "in-phase"), (np.pi, "antiphase")):
        axis.axhspan(angle - SYNC_DISTANCE, angle + SYNC_DISTANCE, color=SYNC[name], alpha=0.1, lw=0.0, zorder=0.4)
        axis.annotate(
            describe_sync(name, rotation), (1.0, angle + SYNC_DISTANCE), (-2.0, -2.0), axis.get_yaxis_transform(),
            "offset points", fontsize=7.5, color=REFERENCE, ha="right", va="top",
        )  # fmt: skip


def begin_at_zero(axis: Axes, end: float) -> None:
    """Begin a vertical axis at 0, with room for lines and markers at both ends; one below 0 stays as it is."""
    if end > 0.0:
        axis.set_ylim(-AXIS_MARGIN * end, (1.0 + AXIS_MARGIN) * end)


def widen_ticks(axis: Axes, which: Literal["x", "y"], least: float = 0.0) -> None:
    """Widen an axis to a range, and further if the numbers at its ticks would need too many digits to fit."""
    low, high = axis.get_xlim() if which == "x" else axis.get_ylim()
    missing = max(least, MIN_RANGE_RATIO * max(abs(low), abs(high))) - (high - low)
    if missing > 0.0:
        axis.set(**{f"{which}lim": (low - 0.5 * missing, high + 0.5 * missing)})


def in_decades(axis: Axes, which: Literal["x", "y"]) -> None:
    """Make an axis logarithmic once all is drawn, with plain numbers as its ticks."""
    from matplotlib.ticker import LogLocator  # noqa: PLC0415  (the page draws without it)

    axis.set(**{f"{which}scale": "log"})
    along = axis.xaxis if which == "x" else axis.yaxis
    low, high = along.get_view_interval()
    along.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < NEAR_DECADES * low else (1.0,)))
    along.set_major_formatter("{x:g}")
    along.set_minor_formatter("")
