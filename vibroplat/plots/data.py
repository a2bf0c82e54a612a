"""Measured data that are laid over a figure: a CSV file whose columns are named as those of the tables."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from vibroplat.errors import TableError
from vibroplat.plots.names import PHASE_COLUMN, Quantity, is_number
from vibroplat.plots.style import BLACK, plain
from vibroplat.plots.timelines import wrapped

_LOG = logging.getLogger("vibroplat")


@dataclass(frozen=True)
class Data:
    """Measured data: the file's name and its table."""

    name: str
    table: pd.DataFrame

    def draw(self, axis: Axes, x: str, column: str, quantity: Quantity) -> Axes:
        """Draw a column over another where the data have both, in black diamonds."""
        if {x, column} <= {*self.table.columns}:
            values = quantity.factor * self.table[column].to_numpy(dtype=float)
            values = wrapped(values) if column == PHASE_COLUMN else values
            look: dict[str, Any] = {"color": BLACK, "mfc": "white", "ms": 4.0, "mew": 1.0, "zorder": 5.0, "ls": ""}
            axis.plot(self.table[x], values, marker="D", label=f"measured: {plain(self.name)}", **look)
        return axis


def read_data(path: Path, x: str, columns: Mapping[str, Quantity], others: Collection[str] = ()) -> Data:
    """Read measured data of these columns over ``x``.

    Columns that no figure shows are named in a line, but for ``others``, which further figures would use.

    Raises
    ------
    TableError
        The file cannot be read, has no abscissa, nothing to draw, or no numbers there.
    """
    try:
        table = pd.read_csv(path)
    except FileNotFoundError:
        raise TableError(f"--data {path}: there is no such file") from None
    except Exception as error:  # pandas raises many kinds on damaged files
        raise TableError(f"--data {path} cannot be read: {' '.join(str(error).split())}") from None
    _require(path, table, [x], "no column of the horizontal axis")
    _require(path, table, columns, "no column that a figure shows")
    known = {x, *columns}
    for column in known & {*table.columns}:
        if not is_number(table[column]):
            raise TableError(f"--data {path}: column {column} holds text; allowed: numbers, empty where there is none")
    if left := [str(column) for column in table.columns if column not in known | {*others}]:
        _LOG.warning("--data %s: not drawn: %s", path, ", ".join(left))
    return Data(path.name, table)


def _require(path: Path, table: pd.DataFrame, wanted: Collection[str], what: str) -> None:
    if not {*wanted} & {*table.columns}:
        raise TableError(f"--data {path}: {what} in {', '.join(map(str, table.columns))}; allowed: {', '.join(wanted)}")
