"""The result of a run: its tables, dense output, summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.columns import labelled
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray
from vibroplat.observe.audit import INACCURATE
from vibroplat.observe.events import event_table
from vibroplat.observe.names import state_places
from vibroplat.observe.notes import Peaks, notes_on_samples
from vibroplat.observe.segments import Segment
from vibroplat.observe.statistics import Measures, section_rows
from vibroplat.observe.table import TRAJECTORY, TableMaker, TableParts, together
from vibroplat.results.prompt import AtPrompt


@dataclass(repr=False)
class Trajectory(AtPrompt):
    """A finished run. :class:`~vibroplat.results.prompt.AtPrompt` has its card, figures and files.

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
    table
        Its trajectory table, if that was made while the run went on.
    peaks
        Largest values in the measured part of the trajectory table, by column, if that was made and not kept.
    derivative
        Of the state at the end by that at the beginning and by keys, if it was asked for and the run did not end early.
    """

    scene: Scene
    segments: list[Segment]
    event_rows: npt.NDArray[np.void]
    final_state: FloatArray
    measures: Measures
    origin: dict[str, Any] | None = None
    summary: dict[str, Any] = field(default_factory=dict)
    table: pd.DataFrame | None = None
    peaks: Mapping[str, float] | None = None
    derivative: pd.DataFrame | None = None

    @cached_property
    def events(self) -> pd.DataFrame:
        """Event table."""
        return event_table(self.event_rows)

    @cached_property
    def section(self) -> pd.DataFrame:
        """Poincaré section: motion at whole turns of exciter 1 in the measured part, the last 1024 of them.

        The columns are those of the trajectory table without the mode.
        """
        points = section_rows(self.measures)
        states = points["state"]
        columns = {"t_s": points["t"]} | {name: states[:, i] for name, i in state_places(self.scene).items()}
        if self.scene.has_contact:
            columns["contact_force_n"] = points["force"]
        return labelled(pd.DataFrame(columns), TRAJECTORY)

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table at ``output.sample_rate_hz``, with two rows at each event."""
        if self.table is not None:
            return self.table
        parts: list[pd.DataFrame] = []
        rows = TableParts(self.scene, parts.append)
        for segment in self.segments:
            rows.add(segment)
        rows.finish()
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def notes(self) -> list[str]:
        """Notes of the summary, and those on peaks that the trajectory table misses, for which it is made."""
        notes: list[str] = self.summary["notes"]
        peaks = self.peaks
        if peaks is None:
            found = Peaks(self.summary["measured_from_s"])
            found.add(self.trajectory)
            peaks = found.largest
        return notes + notes_on_samples(peaks, self.summary, self.scene.output.sample_rate_hz)

    @property
    def variation(self) -> pd.DataFrame:
        """Derivative of the state at the end by that at the beginning and by keys, as they were asked for.

        Raises
        ------
        ValueError
            The run was not asked for it, or ended early.
        """
        if self.derivative is not None:
            return self.derivative
        if self.outcome not in ("ok", INACCURATE):
            raise ValueError(f"this run ended early ({self.outcome}); the derivative of its end is not known")
        raise ValueError("this run carried no derivative; simulate with variation=True, or with keys to vary")

    @property
    def monodromy(self) -> pd.DataFrame:
        """Derivative of the state at the end by that at the beginning; of a period, its eigenvalues are multipliers.

        Raises
        ------
        ValueError
            As :attr:`variation`.
        """
        found = self.variation
        return found[found.index]

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
        maker = TableMaker(self.scene)
        parts = [maker.rows(self.segments[i], wanted[order][owner == i]) for i in np.unique(owner)]
        found = pd.DataFrame(maker.columns(together(parts)))
        return labelled(found.iloc[np.argsort(order, kind="stable")].reset_index(drop=True), TRAJECTORY)
