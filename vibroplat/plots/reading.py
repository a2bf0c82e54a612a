"""Reads results for figures and the page, and cuts and thins trajectories.

Trajectories are read in parts: those of long runs do not fit into memory.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import COORDINATES, RATES, TURN
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import static_rest
from vibroplat.model.parameters import parameters
from vibroplat.model.springs import foundation_forces
from vibroplat.results.picture import finite

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Number of rows from which the turns of exciters are counted, and maximum length of a part without a whole turn (s).
EVENLY, SLOW = 100_000, 0.5


def rest_of(scene: Scene, axis: int = 1) -> float:
    """Return y at the static rest (m), from where figures count it, or x or φ by their places in the state."""
    return float(static_rest(scene)[axis])


def with_forces(part: pd.DataFrame, scene: Scene) -> pd.DataFrame:
    """Add the forces of springs and dampers on the foundation (N), downwards and along x, if a part has the rates.

    Its y is as in a trajectory, from where springs are unloaded.
    """
    needed = [*COORDINATES[:3], *RATES[:3]]
    if not {*needed} <= {*part.columns}:
        return part
    along_x, along_y, _ = foundation_forces(*(part[name] for name in needed), parameters(scene))
    return part.assign(force_x_n=along_x, force_y_n=-along_y)


class Ends(NamedTuple):
    """How many rows a trajectory has, its first and last one, and rows evenly over it, at most twice ``EVENLY``."""

    rows: int
    first: pd.Series
    last: pd.Series
    evenly: pd.DataFrame


def ends_of(parts: Iterable[pd.DataFrame]) -> Ends | None:
    """Return the ends of a trajectory; None if it has no rows."""
    thin, rows, every = [], 0, 1
    for part in (part for part in parts if len(part)):
        last = part.iloc[-1]
        thin.append(part.iloc[-rows % every :: every])
        rows += len(part)
        while sum(map(len, thin)) > 2 * EVENLY:
            thin, every = [pd.concat(thin, ignore_index=True).iloc[::2]], 2 * every
    return Ends(rows, thin[0].iloc[0], last, finite(pd.concat(thin, ignore_index=True)).dropna()) if thin else None


def count_turns(rows: pd.DataFrame) -> Floats:
    """Return how often both exciters have turned since the first one of some rows: the slower one, then the faster."""
    angles = rows[["phi1_rad", "phi2_rad"]].to_numpy(dtype=float) / TURN
    grown = np.maximum.accumulate(np.abs(angles - angles[:1]), axis=0)
    return np.asarray(np.sort(grown, axis=1))


def turn_edges(evenly: pd.DataFrame, begin: float, end: float, most: int) -> Floats:
    """Return the ends (s) of about so many parts of an interval, in each of which the slower exciter turns whole times.

    The last part has what is left of a turn. Where turns take longer than ``SLOW`` seconds, parts are about that long:
    vibration by an exciter that turns or swings alone has no range in turns of the other one.
    """
    rows = evenly[evenly["t_s"].between(begin, end)]
    turns, first = np.unique(count_turns(rows)[:, 0], return_index=True)
    count = int(turns.max(initial=0.0) + 1e-6)
    every = max(1, -(-count // most))
    wholes = float(every) * np.arange(1, count // every + 1)
    ends = np.interp(wholes, turns, rows["t_s"].to_numpy()[first]) if count else []
    edges = np.concatenate([[begin], ends, [end]])
    if len(edges) > 2 and edges[-1] - edges[-2] < edges[-2] - edges[-3]:
        edges = np.delete(edges, -2)
    longest = max(SLOW, (end - begin) / most)
    split = [np.linspace(a, b, max(1, int((b - a) / longest)), endpoint=False) for a, b in itertools.pairwise(edges)]
    return np.append(np.concatenate(split), end)


class Cut:
    """Rows of a trajectory for curves: all of one interval, some of another one, and the extremes in its parts.

    Parameters
    ----------
    parts
        Parts of the trajectory in their order; they are read once.
    shown
        Interval of which all rows are kept (s).
    edges
        Ends of the parts of the interval that is thinned in which minima and maxima are computed (s).
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
        edges: Floats,
        columns: Collection[str],
        *,
        every: int = 0,
    ) -> None:
        self._edges = edges
        self._ranges: list[pd.DataFrame] = []
        detail, thinned, count = [], [], 0
        for part in parts:
            detail.append(part[part["t_s"].between(*shown)])
            inside = part["t_s"].between(edges[0], edges[-1])
            if every:
                thinned.append(part[inside & ((count + np.arange(len(part))) % every == 0)])
            known = finite(part.loc[inside, [column for column in columns if column in part]])
            places = np.searchsorted(edges[1:-1], part.loc[inside, "t_s"], side="right")
            ranges = known.groupby(places).agg(["min", "max"])
            self._ranges.append(ranges.set_axis(ranges.columns.map(":".join), axis=1))
            count += len(part)
        self.shown = finite(pd.concat(detail, ignore_index=True))
        self.thinned = finite(pd.concat(thinned, ignore_index=True)) if thinned else self.shown.iloc[:0]

    def envelope(self) -> pd.DataFrame:
        """Return the extremes in each part (columns ``y_m:min``, ``y_m:max`` …) and the time in its middle."""
        ranges = pd.concat(self._ranges)
        table = ranges.groupby(level=0).agg({name: str(name)[-3:] for name in ranges}).dropna(how="all")
        middles = 0.5 * (self._edges[1:] + self._edges[:-1])
        return table.assign(t_s=middles[table.index]).reset_index(drop=True)
