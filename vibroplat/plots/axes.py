"""Axes of figures: units and names of columns, phase differences, and readable ranges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.ticker import Formatter, LogLocator

from vibroplat.columns import SYNCHRONOUS, describe_sync
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import tick_text
from vibroplat.results.labels import axis_label
from vibroplat.results.picture import LOWEST_PHASE, REFERENCE, SYNC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

#: Margin of an axis beyond its data, relative to its range, so that markers are whole; and the smallest range, relative
#: to the largest number on it.
AXIS_MARGIN, MIN_RANGE_RATIO = 0.05, 1e-3
#: Ratio of the ends of a logarithmic axis up to which there are ticks between its powers of ten.
NEAR_DECADES = 300.0


class InUnit(Formatter):
    """Writes ticks in SI units in another unit, evenly spaced ones with the decimals that their distance needs."""

    def __init__(self, factor: float, *, even: bool = True) -> None:
        self.factor, self.even = factor, even

    def __call__(self, value: float, pos: int | None = None) -> str:
        """Write a tick alone."""
        del pos
        return tick_text(self.factor * value, abs(self.factor * value))

    def format_ticks(self, values: Sequence[float]) -> list[str]:
        """Write ticks together."""
        if len(values) < 2 or not self.even:
            return [self(value) for value in values]
        step = float(self.factor * np.diff(values).min())
        return [tick_text(self.factor * value, step) for value in values]


def label_axis(along: Axis, column: str, unit: tuple[str, float], name: str = "") -> None:
    """Name the axis of a column, and write its ticks in a unit."""
    along.set_label_text(axis_label(column, unit[0], name))
    along.set_major_formatter(InUnit(unit[1]))


def write_each(along: Axis) -> None:
    """Write each tick of an axis that is not linear with its own decimals."""
    writes = along.get_major_formatter()
    factor = writes.factor if isinstance(writes, InUnit) else 1.0
    along.set_major_formatter(InUnit(factor, even=False))


def show_phases(axis: Axes, rotation: str) -> None:
    """Let a vertical axis go once around the circle, and say what the machine does in each synchronization."""
    axis.set_ylim(LOWEST_PHASE - 0.1, LOWEST_PHASE + TURN + 0.1)
    ticks = {-0.5: "−90°", 0.0: "0°", 0.5: "90°", 1.0: "180°", 1.5: "−90°"}
    axis.set_yticks([np.pi * tick for tick in ticks], list(ticks.values()))
    for angle, name in ((0.0, "in-phase"), (np.pi, "antiphase")):
        axis.axhspan(angle - SYNCHRONOUS, angle + SYNCHRONOUS, color=SYNC[name], alpha=0.1, lw=0.0, zorder=0.4)
        axis.annotate(
            describe_sync(name, rotation), (1.0, angle + SYNCHRONOUS), (-2.0, -2.0), axis.get_yaxis_transform(),
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
    axis.set(**{f"{which}scale": "log"})
    along = axis.xaxis if which == "x" else axis.yaxis
    low, high = along.get_view_interval()
    along.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < NEAR_DECADES * low else (1.0,)))
    write_each(along)
    along.set_minor_formatter("")
