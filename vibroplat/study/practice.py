"""The band of conveying speeds by formulas of practice in pictures of sweeps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vibroplat.config.digits import share
from vibroplat.config.plans import FREQUENCY
from vibroplat.frames import pd
from vibroplat.inspection.material import ERROR, range_of_row
from vibroplat.results import picture
from vibroplat.study.branches import SUPPLY
from vibroplat.study.curves import MAX_COLOURS
from vibroplat.study.sweeps import Sweeps

#: Column with the quantity that the formulas give.
CONVEYING = "conveying_speed_m_per_s"
#: Label of a band.
NAME = f"formulas of practice (simulations: up to {share(ERROR)} off)"


def bands(sweeps: Sweeps, drawn: pd.DataFrame, colours: Mapping[str, str]) -> tuple[list[picture.Series], pd.DataFrame]:
    """Return the band of each combination, along its first branch, and the points with those of the bands behind.

    Its points are those of the branch with the upper ends of the ranges, and the lower ones in a column of their own.
    """
    series, parts, first = list[picture.Series](), [drawn], dict[str, pd.DataFrame]()
    for rows in sweeps.branches if CONVEYING in drawn and len(colours) <= MAX_COLOURS else ():
        first.setdefault(sweeps.label(rows.iloc[0]), rows)
    for label, rows in first.items():
        low, high = np.array([_range(sweeps, rows.loc[[index]]) for index in rows.index]).T
        if np.isfinite(low).any():
            places = sum(map(len, parts)) + np.arange(len(rows))
            name = ": ".join(filter(None, (label, NAME)))
            broken = np.where(np.isfinite(low), places, picture.BROKEN)
            series.append(picture.Series(name, broken, "", colours[label], "band", of=(CONVEYING,)))
            parts.append(drawn.loc[rows.index].assign(**{CONVEYING: high, f"{CONVEYING}{picture.LOW}": low}))
    return series, pd.concat(parts, ignore_index=True) if series else drawn


def _range(sweeps: Sweeps, row: pd.DataFrame) -> tuple[float, float]:
    """Return the range of a row, from its scene; NaN of several results."""
    scene = sweeps.scene_of(row, sweeps.grid)
    if scene is None or scene.transport is None:
        return np.nan, np.nan
    key = FREQUENCY if sweeps.key == SUPPLY else sweeps.key
    return range_of_row(scene.replace({key: row[sweeps.key].tolist()[0]}), row.iloc[0])
