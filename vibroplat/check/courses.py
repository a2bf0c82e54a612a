"""What is compared of a run, collected while it goes on: samples of its trajectory, and its events."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Final

import numpy as np
import pandas as pd

from vibroplat.config.coordinates import COORDINATES
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.motion.recorder import Sink
from vibroplat.motion.run import simulate
from vibroplat.observe.audit import INACCURATE
from vibroplat.observe.trajectory import Trajectory
from vibroplat.system.memory import Share

#: Most samples of a run that are compared; they are those of the trajectory table, or every second, third … of them.
MOST: Final = 100_000

_FORCE: Final = "contact_force_n"
_ADVICE: Final = "shorten run.duration_s, or leave out --check"

#: Called with the time reached (s) and the number of events.
Progress = Callable[[float, int], None]


class Course:
    """What is compared of a run: samples of its trajectory, and its events. It is collected while the run goes on.

    Parameters
    ----------
    scene
        What is run.
    also
        Is given all of both tables.

    Attributes
    ----------
    names
        The sampled quantities: coordinates and contact force.
    """

    def __init__(self, scene: Scene, also: Sink | None = None) -> None:
        self.scene = scene
        self._also = also
        self.names = tuple(COORDINATES[i] for i in scene.coordinates) + ((_FORCE,) if scene.has_contact else ())
        self._result: Trajectory | None = None
        samples = scene.run.duration_s * scene.output.sample_rate_hz
        self._every = max(1, math.ceil(samples / MOST))
        self._share = Share(_ADVICE)
        self._samples: list[pd.DataFrame] = []
        self._events: list[pd.DataFrame] = []

    def run(self, progress: Progress | None = None) -> Course:
        """Run the scene."""
        sink = Sink(self._take_trajectory, self._take_events)
        self._result = simulate(self.scene, keep="summary", sink=sink, progress=progress)
        return self

    def _take_trajectory(self, part: pd.DataFrame) -> None:
        """Keep the rows on the output grid, and the last one."""
        if self._also is not None:
            self._also.trajectory(part)
        rate, times = self.scene.output.sample_rate_hz, part["t_s"].to_numpy()
        numbers = np.rint(times * rate)
        wanted = (numbers / rate == times) & (numbers % self._every == 0)
        wanted[-1:] = True
        self._keep(self._samples, part.loc[wanted, ["t_s", "mode", *self.names]])

    def _take_events(self, part: pd.DataFrame) -> None:
        if self._also is not None:
            self._also.events(part)
        self._keep(self._events, part[["t_s", "kind", "gap_rate_before_m_per_s"]])

    def _keep(self, parts: list[pd.DataFrame], part: pd.DataFrame) -> None:
        self._share.take(int(part.memory_usage(index=False).sum()))
        parts.append(part)

    @cached_property
    def samples(self) -> pd.DataFrame:
        """Samples by time, one for each time, of quantities in their scales."""
        found = pd.concat(self._samples).drop_duplicates("t_s", keep="last").set_index("t_s")
        found[list(self.names)] /= [scales_of(self.scene)[name] for name in self.names]
        return found

    @cached_property
    def events(self) -> pd.DataFrame:
        """Liftoffs and impacts. A latch stands for impacts, whose number depends on when it was found to be one."""
        found = pd.concat(self._events)
        return found[found["kind"].isin(["liftoff", "impact"])].reset_index(drop=True)

    @property
    def result(self) -> Trajectory:
        """The run, when it has ended; its tables are not kept."""
        assert self._result is not None
        return self._result

    @property
    def outcome(self) -> str:
        """How the run ended; energy that was lost is not what is compared."""
        return "ok" if self.result.outcome == INACCURATE else self.result.outcome

    @property
    def engine(self) -> str:
        """Name of the engine that ran it."""
        return str(self.result.summary["engine"])

    @property
    def end(self) -> float:
        """When it ended (s); 0 if it has no sample, as it gave up at once."""
        return float(self.samples.index[-1]) if len(self.samples) else 0.0


def scales_of(scene: Scene) -> dict[str, float]:
    """Scales of coordinates, and of the contact force its change when the state changes by its scales."""
    scales = state_scales(scene)
    return {name: float(scales[i]) for i, name in enumerate(COORDINATES)} | {_FORCE: force_spread(scene)}


def differences(one: Course, two: Course, times: pd.Index) -> FloatArray:
    """Differences of two runs at times of the first, shape (times, quantities), in the scales of the scene.

    They are nan where the second has no sample, and those of the contact force where not both are in contact.
    """
    a, b = one.samples.reindex(times), two.samples.reindex(times)
    found: FloatArray = np.abs(a[list(one.names)].to_numpy() - b[list(one.names)].to_numpy())
    if _FORCE in one.names:
        apart = ~((a["mode"] == "attached") & (b["mode"] == "attached")).to_numpy()
        found[apart, one.names.index(_FORCE)] = math.nan
    return found
