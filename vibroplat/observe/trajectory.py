"""The result of a run: segments with dense output, events, summary."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.integrate.interpolation import sample
from vibroplat.model.parameters import FloatArray
from vibroplat.model.systems import FULL_SIZE, System
from vibroplat.observe import statistics as m
from vibroplat.observe.statistics import Measures, section_rows
from vibroplat.scene import COORDINATES, RATES, Mode, Scene

EVENT_COLUMNS = (
    "t_s",
    "kind",
    "gap_rate_before_m_per_s",
    "gap_rate_after_m_per_s",
    "impulse_n_s",
    "energy_loss_j",
    "contact_force_after_n",
    "mode_after",
    "impacts",
)


@dataclass(frozen=True)
class Event:
    """A transition, as a row of the event table.

    ``gap_rate_before`` of a latch is that of the first impact which was not followed; ``impacts`` is 1
    for an impact, 0 for a liftoff, and for a latch the number of impacts it stands for, counted until
    their speed is below round-off of the first.
    """

    t_s: float
    kind: str
    gap_rate_before_m_per_s: float
    gap_rate_after_m_per_s: float
    impulse_n_s: float
    energy_loss_j: float
    contact_force_after_n: float
    mode_after: str
    impacts: int


@dataclass(frozen=True)
class Segment:
    """A smooth stretch of one mode.

    Attributes
    ----------
    start, end
        When it began and ended (s).
    t
        Ends of the steps since ``start`` (s), shape (m,).
    y, yp
        Unknowns of ``system`` and derivatives there, shape (m, size).
    turns
        Angles taken off φ₁ and φ₂ before the segment (rad), shape (2,).
    joined
        Whether it goes on from the segment before without an event between them.
    """

    system: System
    start: float
    end: float
    t: FloatArray
    y: FloatArray
    yp: FloatArray
    turns: FloatArray
    joined: bool

    def __call__(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Full states (len(times), 14) and contact forces (len(times),) at absolute ascending times."""
        local = np.clip(times - self.start, self.t[0], self.t[-1])
        unknowns = sample(self.t, self.y, self.yp, local)
        return self.expand(unknowns)

    def expand(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Full states and contact forces of unknowns of shape (m, size)."""
        states = self.system.full(unknowns)
        states[:, 3:5] += self.turns
        force = unknowns[:, -1] if self.system.algebraic else np.zeros(len(unknowns))
        return states, force


@dataclass
class Trajectory:
    """A finished run.

    Attributes
    ----------
    scene
        What was simulated.
    segments
        Smooth stretches in order of time; empty if the run was asked not to keep them.
    event_rows
        One for each transition.
    final_state
        Full state at the end, shape (14,).
    measures
        Sums over the run, of which the summary is made.
    summary
        Outcome and measures; see :func:`vibroplat.observe.summary.summarize`.
    """

    scene: Scene
    segments: list[Segment]
    event_rows: list[Event]
    final_state: FloatArray
    measures: Measures
    summary: dict[str, Any] = field(default_factory=dict)

    @property
    def outcome(self) -> str:
        """``ok``, or why the run ended early."""
        return str(self.summary["outcome"])

    @cached_property
    def events(self) -> pd.DataFrame:
        """Event table."""
        rows = [[getattr(event, column) for column in EVENT_COLUMNS] for event in self.event_rows]
        table = pd.DataFrame(rows, columns=list(EVENT_COLUMNS))
        numbers = [c for c in EVENT_COLUMNS if c not in ("kind", "mode_after", "impacts")]
        return table.astype(dict.fromkeys(numbers, "float64") | {"impacts": "int64"})

    @cached_property
    def section(self) -> pd.DataFrame:
        """Poincaré section: motion at whole turns of exciter 1 in the measured part, the last 1024 of them.

        The columns are those of the trajectory table without the mode.
        """
        points = section_rows(self.measures)
        places = [m.SECTION_STATE + i + half for half in (0, 7) for i in self.scene.coordinates]
        names = [names[i] for names in (COORDINATES, RATES) for i in self.scene.coordinates]
        columns = {"t_s": points[:, m.SECTION_TIME]} | {n: points[:, i] for n, i in zip(names, places, strict=True)}
        if self.scene.has_contact:
            columns["contact_force_n"] = points[:, m.SECTION_FORCE]
        return pd.DataFrame(columns)

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table at ``output.sample_rate_hz``, with two rows at each event."""
        return self._table(list(self._sampled()))

    def __call__(self, times: npt.ArrayLike) -> pd.DataFrame:
        """Dense output at any times of the run, as rows of the trajectory table.

        Cubic Hermite interpolation between the integrator's steps, order 4. At an event the row is
        that before it.

        Raises
        ------
        ValueError
            Times lie outside the run or are not a list of numbers, or the segments were not kept.
        """
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        if wanted.ndim != 1 or not np.isfinite(wanted).all():
            raise ValueError("times must be a number or a one-dimensional list of finite numbers")
        if not self.segments:
            raise ValueError("this run kept no segments; simulate with keep='segments' for dense output")
        first, last = self.segments[0].start, self.segments[-1].end
        if wanted.size and (wanted.min() < first or wanted.max() > last):
            raise ValueError(f"times must lie in [{first}, {last}] s, got {wanted.min()} … {wanted.max()}")
        ends = np.array([segment.end for segment in self.segments])
        order = np.argsort(wanted, kind="stable")
        owner = np.searchsorted(ends, wanted[order], side="left")
        parts = [
            (self.segments[i], wanted[order][owner == i], self.segments[i](wanted[order][owner == i]))
            for i in np.unique(owner)
        ]
        return self._table(parts).iloc[np.argsort(order, kind="stable")].reset_index(drop=True)

    def _sampled(self) -> Iterable[tuple[Segment, FloatArray, tuple[FloatArray, FloatArray]]]:
        """Rows of each segment: its first end, the output grid strictly inside, its last end."""
        rate = self.scene.output.sample_rate_hz
        goes_on = False
        pieces = []
        for segment in reversed(self.segments):
            pieces.append((segment, goes_on))
            goes_on = segment.joined
        for segment, goes_on in reversed(pieces):
            grid = np.arange(np.floor(segment.start * rate), np.ceil(segment.end * rate) + 1.0) / rate
            inside = grid[(grid > segment.start) & (grid < segment.end)]
            first = [] if segment.joined else [segment.start]
            last = [] if goes_on else [segment.end]
            times = np.concatenate((first, inside, last))
            if times.size:
                yield segment, times, segment(times)

    def _table(self, parts: list[tuple[Segment, FloatArray, tuple[FloatArray, FloatArray]]]) -> pd.DataFrame:
        places = list(self.scene.coordinates)
        names = [COORDINATES[i] for i in places] + [RATES[i] for i in places]
        places += [7 + i for i in places]
        if parts:
            times = np.concatenate([part[1] for part in parts])
            states = np.concatenate([part[2][0] for part in parts])
            force = np.concatenate([part[2][1] for part in parts])
        else:
            times, states, force = np.empty(0), np.empty((0, FULL_SIZE)), np.empty(0)
        labels = [mode.label for mode in Mode]
        codes = [np.full(len(part[1]), int(part[0].system.mode)) for part in parts]
        table = pd.DataFrame(
            {
                "t_s": times,
                "mode": pd.Categorical.from_codes(
                    np.concatenate(codes) if codes else np.empty(0, dtype=int), categories=pd.Index(labels)
                ),
            }
        )
        for place, name in zip(places, names, strict=True):
            table[name] = states[:, place]
        if self.scene.has_contact:
            table["contact_force_n"] = force
        return table
