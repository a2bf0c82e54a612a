"""Reads results for figures and the page, and cuts and thins trajectories.

Trajectories are read in parts: those of long runs do not fit into memory.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import static_rest
from vibroplat.results.picture import finite


def rest_of(scene: Scene, place: int = 1) -> float:
    """Return y at the static rest (m), from where figures count it, or x or φ by their places in the state."""
    return float(static_rest(scene)[place])


class Ends(NamedTuple):
    """How many rows a trajectory has, and its first and last one."""

    rows: int
    first: pd.Series
    last: pd.Series


def ends_of(parts: Iterable[pd.DataFrame]) -> Ends | None:
    """Return the ends of a trajectory; None if it has no rows."""
    found: Ends | None = None
    for part in parts:
        if len(part):
            rows, first = (0, part.iloc[0]) if found is None else found[:2]
            found = Ends(rows + len(part), first, part.iloc[-1])
    return found


class Cut:
    """What is shown of a trajectory: all rows of one interval, some of another one, and the extremes in its bins.

    Parameters
    ----------
    parts
        Parts of the trajectory in their order; they are read once.
    shown
        Interval of which all rows are kept (s).
    whole
        Interval that is thinned (s), and number of bins of equal length for which extremes are kept.
    columns
        Columns of which the extremes are kept.
    every
        In the thinned interval every n-th row of the trajectory is kept; 0: none.

    Attributes
    ----------
    shown, thinned
        The rows.
    """

    def __init__(
        self,
        parts: Iterable[pd.DataFrame],
        shown: tuple[float, float],
        whole: tuple[float, float, int],
        columns: Collection[str],
        *,
        every: int = 0,
    ) -> None:
        self._begin, self._end, self._bins = whole
        self._ranges: list[pd.DataFrame] = []
        kept, thinned, count = [], [], 0
        for part in parts:
            kept.append(part[part["t_s"].between(*shown)])
            inside = part["t_s"].between(self._begin, self._end)
            if every:
                thinned.append(part[inside & ((count + np.arange(len(part))) % every == 0)])
            known = finite(part.loc[inside, [column for column in columns if column in part]])
            ranges = known.groupby(self._bins_of(part.loc[inside, "t_s"])).agg(["min", "max"])
            self._ranges.append(ranges.set_axis(ranges.columns.map(":".join), axis=1))
            count += len(part)
        self.shown = finite(pd.concat(kept, ignore_index=True))
        self.thinned = finite(pd.concat(thinned, ignore_index=True)) if thinned else self.shown.iloc[:0]

    def _bins_of(self, times: pd.Series) -> Any:
        width = (self._end - self._begin) / self._bins or 1.0
        return ((times - self._begin) / width).clip(0, self._bins - 1).astype(int).to_numpy()

    def envelope(self) -> pd.DataFrame:
        """Return the extremes in each bin (columns ``y_m:min``, ``y_m:max`` …) and the time in its middle (``t_s``)."""
        ranges = pd.concat(self._ranges)
        table = ranges.groupby(level=0).agg({name: str(name)[-3:] for name in ranges}).dropna(how="all")
        middle = self._begin + (table.index.to_numpy() + 0.5) * (self._end - self._begin) / self._bins
        return table.assign(t_s=middle).reset_index(drop=True)
