"""One period of the orbit of a row of a table, for those who draw it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.continuation.orbit import OrbitError, accurate, at_row, has_state, orbit, run_from, state_of
from vibroplat.hybrid.state import state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.results.run import Trajectory

#: Samples of a turn: between two of them a line through a sine is beside it by 0.1 % of its amplitude.
SAMPLES = 64
#: Most events of a period that are sampled, the first ones: of impacts that accumulate, the strongest.
EVENTS = 100
#: Tolerance of orbits that are found and of the integration of those that are known.
TOLERANCE = 1e-8
#: How far a period may be from closing, in the scales of the scene: less than the width of a line.
OPEN = 1e-3
#: Largest difference of an orbit's RMS from that of its row, over the RMS of both directions.
OTHER = 0.01


class OrbitMotion(NamedTuple):
    """One period of an orbit.

    Attributes
    ----------
    scene
        At the keys of the row.
    trajectory, events
        As of a run from 0 to the period: some samples for each turn, two rows at each event.
    """

    scene: Scene
    trajectory: pd.DataFrame
    events: pd.DataFrame


def motion_of(scene: Scene, row: Mapping[str, Any]) -> OrbitMotion:
    """Compute one period of the orbit of a row.

    Parameters
    ----------
    scene
        Whose table it is.
    row
        Of ``branches`` or ``special``, from whose state it is simulated, or of ``sweep``: settled from the phase
        difference of the row, found by Newton's method and compared with the row.

    Raises
    ------
    VibroplatError
        There is no such orbit, or it cannot be computed; the message says why.
    """
    period = int(row["period"])
    if has_state(row):
        seconds = float(row["period_s"] if "period_s" in row else period / row["excitation_frequency_hz"])
        placed = accurate(at_row(scene, row), TOLERANCE)
        state = state_of(placed, row)
        run = run_from(placed, state, seconds)
        _require_closed(run, state, period)
    else:
        found = orbit(scene, row, period=period, tolerance=TOLERANCE)
        _require_same(found.measures, row)
        run = found.run
    events = run.events
    times = events["t_s"].to_numpy()[:EVENTS]
    last = run.segments[-1].end
    grid = [np.linspace(0.0, last, SAMPLES * period + 1), times, np.minimum(np.nextafter(times, np.inf), last)]
    return OrbitMotion(run.scene, run(np.unique(np.concatenate(grid))), events)


def _require_closed(run: Trajectory, start: FloatArray, period: int) -> None:
    """Refuse a period that does not end where it began."""
    if run.outcome != "ok":
        raise OrbitError(f"the motion of this row ended early: {run.outcome}: {run.summary['detail']}")
    change = (run.final_state - start) / state_scales(run.scene)
    change[3:5] = np.angle(np.exp(1j * change[3:5]))
    apart = float(np.abs(change).max())
    if apart > OPEN:
        raise OrbitError(f"the state of this row is not on an orbit of period {period}: it ends {apart:.2g} away")


def _require_same(measures: Mapping[str, Any], row: Mapping[str, Any]) -> None:
    """Refuse an orbit that is not the motion of a row of a sweep: several may exist side by side."""
    names = ("rms_x_m", "rms_y_m")
    size = np.hypot(*(row[name] for name in names))
    if max(abs(measures[name] - row[name]) for name in names) > OTHER * size:
        found = 1e3 * measures["rms_y_m"]
        raise OrbitError(f"from the phase difference of this row another motion settles, with RMS y {found:.4g} mm")
