"""What tables offer at a prompt: ``table.vibroplat.plot()``, for those of runs, sweeps and branches of orbits."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@pd.api.extensions.register_dataframe_accessor("vibroplat")
class TableAccessor:
    """Figures of a table that vibroplat has made.

    Parameters
    ----------
    table
        Of a trajectory, a sweep or branches of orbits, or rows of it.
    """

    def __init__(self, table: pd.DataFrame) -> None:
        self._table = table

    def plot(self, x: str | None = None) -> Figure:
        """Draw the figure of the table: a motion over time, the response of a sweep, or branches of orbits.

        Parameters
        ----------
        x
            Column of the horizontal axis of a sweep or of branches. Default: the excitation frequency; for branches
            over another key than the supply frequency, the key.

        Raises
        ------
        ValueError
            It is no such table, or has no such column.
        TableError
            There is nothing to draw.

        Examples
        --------
        >>> from vibroplat import Scene, simulate
        >>> run = simulate(Scene(run={"duration_s": 0.5}))
        >>> len(run.trajectory.vibroplat.plot().axes) > 1
        True
        """
        figure: Figure = import_module("vibroplat.plots.display").table_figure(self._table, x)
        return figure
