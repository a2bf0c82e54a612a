"""Tolerances: scenes within the spread of some keys, measured as orbits; where those are unstable, as they settle.

An orbit is followed from the scene as given, with its section moved away from events on the way: a section that stays
loses a fair part of the samples, and mostly unstable ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

import numpy as np
import pandas as pd

from vibroplat.columns import COUNT, FLAG, TEXT, Column, Columns, name_regime
from vibroplat.config.circular import on_line
from vibroplat.config.scene import Scene
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.designs.motions import brief_plan
from vibroplat.designs.sensitivities import local_orbit
from vibroplat.errors import errors_about
from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.branches import study_table
from vibroplat.study.point import measure_point
from vibroplat.study.store import Record

#: Samples in a task.
SAMPLES_PER_TASK = 100
#: Quantiles that are printed.
QUANTILES = (0.05, 0.5, 0.95)

SAMPLES: Columns = {
    "sample": Column("number of the sample", kind=COUNT),
    "stable": Column("whether the orbit, continued to the sample, is stable", "false if the orbit is lost", kind=FLAG),
    "regime": Column(
        "synchronization and kind of motion",
        "of the orbit if it is stable, otherwise of the attractor to which its motion converges",
        kind=TEXT,
    ),
    "stability_margin": Column(
        "1 minus the magnitude of the orbit's largest Floquet multiplier", "empty if the orbit is lost"
    ),
}
VARIANCE_CONTRIBUTIONS: Columns = {
    "measure": Column("name of the measure: a column of a sweep, or stability_margin", kind=TEXT),
    "key": Column("dotted key with a tolerance", kind=TEXT),
    "regression": Column(
        "fraction of the measure's variance due to the key",
        "by linear regression; of an angle, of its deviations from the circular mean, and empty if it has no mean",
    ),
    "explained": Column("fraction of the variance that linear regression explains", "equal for all keys of a measure"),
}


def sobol_points(seed: int, count: int, first: int, stop: int) -> FloatArray:
    """Return numbers from −1 to 1 for ``count`` keys, evenly distributed (Sobol 1967), shape (stop − first, count)."""
    from scipy.stats import qmc  # noqa: PLC0415  (a second to import)

    points = qmc.Sobol(count, seed=seed).random_base2(max(stop - 1, 1).bit_length())
    return np.asarray(2.0 * points[first:stop] - 1.0)


def measure_samples(
    scene: Scene, names: Sequence[str], known: Record, first: int, points: Sequence[Sequence[float]]
) -> Record:
    """Measure samples of a scene with a plan, from a number on, at places from −1 to 1; ``rows`` of the table."""
    plan = scene.design
    assert plan is not None
    spread, rows = np.array(list(plan.parameter_tolerances.values())), []
    with closing(local_orbit(scene, list(plan.parameter_tolerances), known)) as local:
        local.prepare()
        for number, point in enumerate(np.array(points), first):
            values = local.values * (1.0 + spread * point)
            row = {"sample": number, **dict(zip(local.keys, values.tolist(), strict=True))}
            state = local.state
            try:
                there = local.correct(values)
                measures, state = there.measured(names), there.state
                row["stability_margin"] = measures.get("stability_margin")
            except NoConvergenceError:
                there = None
            if there is not None and there.margin > 0.0:
                row |= {"stable": True, "regime": name_regime({**known, **measures})}
            else:
                with errors_about("design.parameter_tolerances"):  # which may be impossible together
                    other = scene.replace(dict(zip(local.keys, values.tolist(), strict=True)))
                measures = measure_point(other, brief_plan(other), state.tolist(), (number,)).row
                row |= {"stable": False, "regime": name_regime(measures)}
            rows.append(row | {name: measures.get(name) for name in names if name != "stability_margin"})
    return {"rows": rows}


def variance_contributions(table: pd.DataFrame, keys: Sequence[str], measures: Sequence[str]) -> pd.DataFrame:
    """Make the table of fractions of keys in the variance of measures; samples without a value do not count for it."""
    rows = []
    for name in measures:
        if not table[name].count():
            continue
        own, explained = _regression(table, keys, name)
        rows += [
            dict(zip(VARIANCE_CONTRIBUTIONS, (name, key, fraction, explained), strict=True))
            for key, fraction in zip(keys, own.tolist(), strict=True)
        ]
    return study_table(rows, list(VARIANCE_CONTRIBUTIONS), VARIANCE_CONTRIBUTIONS)


def _regression(table: pd.DataFrame, keys: Sequence[str], measure: str) -> tuple[FloatArray, float]:
    """Fraction of each key in the variance of a measure, by linear regression on standardized samples, and its R²."""
    own = table.dropna(subset=[measure])
    y, z = on_line(measure, own[measure]), own[list(keys)].to_numpy(float)
    if len(own) <= len(keys) + 1 or not y.std() > 0.0:
        return np.full(len(keys), np.nan), 0.0
    z, y = (z - z.mean(axis=0)) / z.std(axis=0), (y - y.mean()) / y.std()
    slopes = np.linalg.lstsq(z, y, rcond=None)[0]
    return slopes**2, 1.0 - float(np.var(y - z @ slopes))
