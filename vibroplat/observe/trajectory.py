"""The result of a run: segments with dense output, events, summary."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.hybrid.modes import KINDS
from vibroplat.hybrid.state import EVENT, Automaton
from vibroplat.kernels.compiled import FloatArray, compiled, copy
from vibroplat.kernels.polynomial import values
from vibroplat.model.motor import motor_powers
from vibroplat.model.parameters import parameters, supply
from vibroplat.model.systems import FULL_SIZE, SYSTEMS, System
from vibroplat.observe.notes import notes_on_samples
from vibroplat.observe.statistics import Measures, section_rows
from vibroplat.scene import COORDINATES, RATES, Mode, Scene

#: Columns of the event table and the fields they hold. ``gap_rate_before`` of a latch is that of the first impact which
#: was not followed; ``impacts`` is 1 for an impact, 0 for a liftoff, and for a latch the number of impacts it stands
#: for, counted until their speed is below round-off of the first.
EVENT_COLUMNS = {
    "t_s": "t",
    "kind": "kind",
    "gap_rate_before_m_per_s": "rate_before",
    "gap_rate_after_m_per_s": "rate_after",
    "impulse_n_s": "impulse",
    "energy_loss_j": "loss",
    "contact_force_after_n": "force_after",
    "mode_after": "mode_after",
    "impacts": "impacts",
}


@dataclass(frozen=True)
class Segment:
    """A smooth stretch of one mode.

    Attributes
    ----------
    start, end
        When it began and ended (s).
    t, length
        Beginnings of its steps since ``start``, and their durations (s), shape (m,).
    c
        Coefficients of their polynomials in the fraction of the step, shape (m, degree + 1, size).
    ends
        Unknowns at the ends of the steps, shape (m, size).
    turns
        Angles taken off φ₁ and φ₂ before the segment (rad), shape (2,).
    joined
        Whether it goes on from the segment before without an event between them.
    """

    system: System
    start: float
    end: float
    t: FloatArray
    length: FloatArray
    c: FloatArray
    ends: FloatArray
    turns: FloatArray
    joined: bool

    def __call__(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Full states (len(times), 14) and contact forces (len(times),) at absolute ascending times."""
        elapsed = np.where(times >= self.end, np.inf, times - self.start)  # its end is that of its last step, exactly
        return self.expand(sample(self.t, self.length, self.c, self.ends, elapsed))

    def expand(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Full states and contact forces of unknowns of shape (m, size)."""
        states = self.system.full(unknowns)
        states[:, 3:5] += self.turns
        force = unknowns[:, -1] if self.system.algebraic else np.zeros(len(unknowns))
        return states, force


#: Rows of a table: a segment, times in it (s), full states and contact forces there.
Part = tuple[Segment, FloatArray, tuple[FloatArray, FloatArray]]


@compiled
def sample(start: FloatArray, length: FloatArray, c: FloatArray, ends: FloatArray, times: FloatArray) -> FloatArray:
    """Evaluate steps at ascending times; returns shape (len(times), unknowns)."""
    out = np.empty((times.size, ends.shape[1]))
    row, last = 0, start.size - 1
    for i in range(times.size):
        while row < last and times[i] > start[row] + length[row]:
            row += 1
        if times[i] >= start[row] + length[row]:
            copy(ends[row], out[i])
        else:
            s = max(times[i] - start[row], 0.0) / length[row]
            values(c[row], c.shape[1] - 1, s, out[i])
    return out


class Segments:
    """Observes a run: keeps its steps."""

    def __init__(self) -> None:
        self.kept: list[Segment] = []

    def read(self, h: Automaton) -> None:
        """Copy the closed pieces."""
        steps = h.steps
        for piece in steps.pieces[: steps.used["pieces"]]:
            system = SYSTEMS[piece["system"]]
            rows = slice(int(piece["first"]), int(piece["end"]))
            offset = steps.start[rows.start]
            self.kept.append(
                Segment(
                    system=system,
                    start=float(piece["origin"] + offset),
                    end=float(piece["until"]),
                    t=steps.start[rows] - offset,
                    length=steps.length[rows].copy(),
                    c=steps.c[rows, :, : system.size].copy(),
                    ends=steps.ends[rows, : system.size].copy(),
                    turns=piece["turns"].copy(),
                    joined=bool(piece["joined"]),
                )
            )


class Events:
    """Observes a run: keeps its events, records of :data:`vibroplat.hybrid.state.EVENT`."""

    def __init__(self) -> None:
        self._kept: list[npt.NDArray[np.void]] = [np.zeros(0, EVENT)]

    def read(self, h: Automaton) -> None:
        """Copy the list of events."""
        self._kept.append(h.events[: h.run["events"]].copy())

    @property
    def rows(self) -> npt.NDArray[np.void]:
        """All events so far."""
        return np.concatenate(self._kept)


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
        Events, records of :data:`vibroplat.hybrid.state.EVENT`.
    final_state
        Full state at the end, shape (14,).
    measures
        Sums over the run, of which the summary is made.
    origin
        What provenance says of the run that it goes on from, if any.
    summary
        Outcome, measures and notes; see :func:`vibroplat.observe.summary.measured`.
    """

    scene: Scene
    segments: list[Segment]
    event_rows: npt.NDArray[np.void]
    final_state: FloatArray
    measures: Measures
    origin: dict[str, Any] | None = None
    summary: dict[str, Any] = field(default_factory=dict)

    @property
    def outcome(self) -> str:
        """``ok``, or why the run ended early."""
        return str(self.summary["outcome"])

    @cached_property
    def events(self) -> pd.DataFrame:
        """Event table."""
        table = pd.DataFrame({column: self.event_rows[field] for column, field in EVENT_COLUMNS.items()})
        table["kind"] = np.array(KINDS, dtype=object)[self.event_rows["kind"]]
        table["mode_after"] = np.array([mode.label for mode in Mode], dtype=object)[self.event_rows["mode_after"]]
        return table

    @cached_property
    def section(self) -> pd.DataFrame:
        """Poincaré section: motion at whole turns of exciter 1 in the measured part, the last 1024 of them.

        The columns are those of the trajectory table without the mode.
        """
        points = section_rows(self.measures)
        places = [i + half for half in (0, 7) for i in self.scene.coordinates]
        names = [names[i] for names in (COORDINATES, RATES) for i in self.scene.coordinates]
        states = points["state"]
        columns = {"t_s": points["t"]} | {n: states[:, i] for n, i in zip(names, places, strict=True)}
        if self.scene.has_contact:
            columns["contact_force_n"] = points["force"]
        return pd.DataFrame(columns)

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table at ``output.sample_rate_hz``, with two rows at each event."""
        return self._table(list(self._sampled()))

    @cached_property
    def notes(self) -> list[str]:
        """Notes of the summary, and those on peaks that the trajectory table misses, for which it is sampled."""
        notes: list[str] = self.summary["notes"]
        return notes + notes_on_samples(self.trajectory, self.summary, self.scene.output.sample_rate_hz)

    def __call__(self, times: npt.ArrayLike) -> pd.DataFrame:
        """Dense output at any times of the run, as rows of the trajectory table.

        Between the ends of steps these are the steps' polynomials, as accurate as the ends. At an event the row is
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

    def _sampled(self) -> Iterable[Part]:
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

    def _table(self, parts: list[Part]) -> pd.DataFrame:
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
        for name, column in self._supply(parts, times, states[:, 10:12]).items():
            table[name] = column
        return table

    def _supply(self, parts: list[Part], times: FloatArray, speeds: FloatArray) -> dict[str, FloatArray]:
        """Power of both motors (W), and the supply frequency (Hz) where a program changes it, in all rows."""
        drive, p = self.scene.drive, parameters(self.scene)
        intervals, power, frequency = drive.intervals, np.empty(speeds.shape), np.empty(times.size)
        starts = [interval.start for interval in intervals[1:]]
        # no corner lies inside a segment
        owners = np.searchsorted(starts, [0.5 * (part[0].start + part[0].end) for part in parts], side="right")
        owner = np.repeat(owners, [len(part[1]) for part in parts])
        for k in np.unique(owners):
            interval, mine = intervals[k], owner == k
            supply(p, self.scene, interval)
            power[mine] = motor_powers(times[mine], speeds[mine], p)
            if drive.program is not None:
                frequency[mine] = interval.frequency + interval.ramp * (times[mine] - interval.start)
        columns = {} if drive.program is None else {"supply_frequency_hz": frequency}
        return columns | {"motor_power_1_w": power[:, 0], "motor_power_2_w": power[:, 1]}
