"""The band of practice in pictures of sweeps: conveying speeds by formulas, beside those that were found."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vibroplat.config.digits import share
from vibroplat.config.plans import FREQUENCY
from vibroplat.frames import pd
from vibroplat.inspection.conveying import ERROR, range_of_row
from vibroplat.results import picture
from vibroplat.study.branches import SUPPLY
from vibroplat.study.curves import DISTINCT
from vibroplat.study.sweeps import RESULT, Sweeps

#: What formulas tell of.
CONVEYING = "conveying_speed_m_per_s"
#: What a band is called.
NAME = f"formula of practice, ± {share(ERROR)}"


def bands(sweeps: Sweeps, drawn: pd.DataFrame, colours: Mapping[str, str]) -> tuple[list[picture.Series], pd.DataFrame]:
    """Return the band of each combination, along its first branch, and the points with those of the bands behind.

    Its points are those of the branch with the upper ends of the ranges, and the lower ones in a column of their own.
    """
    series, parts, first = list[picture.Series](), [drawn], dict[str, pd.DataFrame]()
    for rows in sweeps.branches if CONVEYING in drawn and len(colours) <= DISTINCT else ():
        first.setdefault(sweeps.label(rows.iloc[0]), rows)
    for label, rows in first.items():
        ranges = np.array(_ranges(sweeps, rows))
        if np.isfinite(ranges).any():
            begin = sum(map(len, parts))
            places = np.arange(begin, begin + len(rows))
            broken = np.where(np.isfinite(ranges[:, 0]), places, picture.BROKEN)
            name = ": ".join(filter(None, (label, NAME)))
            series.append(picture.Series(name, broken, "", colours[label], "band", of=(CONVEYING,)))
            low, high = ranges.T
            parts.append(drawn.loc[rows.index].assign(**{CONVEYING: high, f"{CONVEYING}{picture.LOW}": low}))
    return series, pd.concat(parts, ignore_index=True) if series else drawn


def _ranges(sweeps: Sweeps, rows: pd.DataFrame) -> list[tuple[float, float]]:
    """Return the range of each row of a branch, from its scene."""
    first, key = rows.iloc[0], FREQUENCY if sweeps.key == SUPPLY else sweeps.key
    result = sweeps.results[list(sweeps.names).index(first[RESULT]) if RESULT in rows else 0]
    scene, grid = result.known_scene, [name for name in sweeps.grid if name != RESULT]
    if scene is None:
        return [(np.nan, np.nan)] * len(rows)
    scene = scene.replace({name: rows[name].astype(object).iloc[0] for name in grid})
    scenes = [scene.replace({key: value}) for value in rows[sweeps.key].tolist()]
    return [
        (np.nan, np.nan) if one.transport is None else range_of_row(one, row)
        for one, (_, row) in zip(scenes, rows.iterrows(), strict=True)
    ]
