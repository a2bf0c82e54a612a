"""The motion of the orbit of a row of a table, for those who draw it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.circular import wrap
from vibroplat.config.digits import quantity
from vibroplat.config.scene import Scene
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.orbit import TOLERANCE, orbit_near, read_guess, run_from, with_orbit_tolerance
from vibroplat.hybrid.state import state_scales

#: Samples of a turn for those who draw it: between two a line through a sine is beside it by 0.1 % of its amplitude.
#: Most events of a period that are sampled, the first ones: of impacts that accumulate, the strongest.
SAMPLES_PER_TURN, MAX_EVENTS = 64, 100
#: How far a drawn period may be from closing, in scaled units: less than the width of a line. Largest
#: difference of an orbit's RMS from that of its row, over the RMS of both directions.
MAX_CLOSING_ERROR, MAX_RMS_DIFFERENCE = 1e-3, 0.01


class OrbitMotion(NamedTuple):
    """One period of an orbit: its scene, and the tables of a run over it, with some samples for each turn."""

    scene: Scene
    trajectory: pd.DataFrame
    events: pd.DataFrame


def orbit_motion(scene: Scene, row: Mapping[str, Any]) -> OrbitMotion:
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
    scene.require_orbits("a periodic orbit")
    period = int(row["period"])
    placed, state = read_guess(scene, row)
    if state is not None:
        seconds = float(row["period_s"] if "period_s" in row else period / row["excitation_frequency_hz"])
        run = run_from(with_orbit_tolerance(placed, TOLERANCE), state, seconds)
        if run.outcome != "ok":
            raise OrbitError(f"the motion of this row ended early: {run.outcome}: {run.summary['detail']}")
        change = (run.final_state - state) / state_scales(run.scene)
        change[3:5] = wrap(change[3:5])
        apart = float(np.abs(change).max())
        if apart > MAX_CLOSING_ERROR:
            raise OrbitError(
                f"the state of this row is not on an orbit of period {period}: its end is {apart:.2g} away"
            )
    else:  # another motion may exist beside that of the row
        orbit = orbit_near(scene, row, period, TOLERANCE)
        own, other = (np.array([of["rms_x_m"], of["rms_y_m"]]) for of in (row, orbit.measures))
        if np.abs(other - own).max() > MAX_RMS_DIFFERENCE * np.hypot(*own):
            height = quantity(other[1], "m")
            raise OrbitError(f"from the phase difference of this row another motion settles, with RMS y {height}")
        run = orbit.run
    times, last = run.events["t_s"].to_numpy()[:MAX_EVENTS], run.segments[-1].end
    grid = [np.linspace(0.0, last, SAMPLES_PER_TURN * period + 1), times, np.minimum(np.nextafter(times, np.inf), last)]
    return OrbitMotion(run.scene, run(np.unique(np.concatenate(grid))), run.events)
