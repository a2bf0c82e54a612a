"""A finished run, just simulated or read from its files: tables, dense output, card, figures, files."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from vibroplat.columns import split, unit_of
from vibroplat.config.arguments import FileName, validated
from vibroplat.config.engine_choice import engine_note
from vibroplat.config.plausibility import by_severity
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, TableError
from vibroplat.frames import ArrayTable, pd
from vibroplat.hybrid.state import EVENT
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.systems import FULL_SIZE, MOVING_SIZE
from vibroplat.observe.measures import Accumulators
from vibroplat.observe.section import section_rows, section_states
from vibroplat.observe.tables import (
    ROW,
    TRAJECTORY,
    Records,
    Sampler,
    Segment,
    TrajectoryRows,
    event_table,
    require_room,
    state_places,
)
from vibroplat.report.data_sheet import columns
from vibroplat.report.summary import INACCURATE
from vibroplat.results.answer import Answer
from vibroplat.results.exports import plain_array, write_mat
from vibroplat.results.files import commands_in
from vibroplat.results.provenance import provenance
from vibroplat.results.result import Result, Tables
from vibroplat.results.run_answer import headline
from vibroplat.results.sheet import Sheet, all_lines, short_lines
from vibroplat.results.tables import as_written, replace_file, require_replaceable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: ``all``: two rows at each event, before and after it. ``unique``: the one after it only, so that times ascend.
Sample = Literal["all", "unique"]


class RunResult(Result):
    """The result of a run, with trajectory, events and dense output.

    A run that was read from files has scene, summary and tables, but no dense output and no Poincaré section.

    Parameters
    ----------
    scene
        What was simulated.
    summary
        Outcome and measures; see :func:`vibroplat.report.summary.measure`.
    remarks
        Returns warnings; called when somebody asks for them.
    origin
        What provenance says of the run that it continues from, if any.
    segments
        Smooth stretches in order of time; empty if the run was asked not to keep them.
    event_rows
        Events, records of :data:`vibroplat.hybrid.state.EVENT`.
    end
        Full state at the end, shape (14,).
    measures
        Sums over the run, of which the summary is made.
    table
        Its trajectory table, if that was made while the run went on.
    derivative
        Of the state at the end by that at the beginning and by keys, if it was asked for and the run did not end early.
    """

    command = "run"
    segments: Sequence[Segment] = ()
    measures: Accumulators | None = None
    derivative: pd.DataFrame | None = None
    _end: FloatArray | None = None

    def __init__(
        self,
        scene: Scene,
        summary: dict[str, Any],
        *,
        remarks: Callable[[], list[str]] = list,
        origin: dict[str, Any] | None = None,
        segments: Sequence[Segment] = (),
        event_rows: Records | None = None,
        end: FloatArray | None = None,
        measures: Accumulators | None = None,
        table: pd.DataFrame | None = None,
        derivative: pd.DataFrame | None = None,
    ) -> None:
        self.__dict__ |= {"scene": scene, "summary": summary, "origin": origin, "configurations": {}}
        self.segments, self.measures, self.derivative, self._end = segments, measures, derivative, end
        self.event_rows = np.zeros(0, EVENT) if event_rows is None else event_rows
        self._table, self._remarks = table, remarks

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Outcome and measures; in the files also :attr:`notes`."""
        path, summary = self._read.directory / "summary.json", self._read.document("summary")
        if not isinstance(summary, dict):
            raise TableError(f"{path} is not the summary of a run")
        if self.known_scene is not None:
            with as_written(path):
                _tell(self.known_scene, summary, self.origin)
        return summary

    @cached_property
    def origin(self) -> dict[str, Any] | None:
        """What provenance says of the run that it continues from, if any."""
        return self._read.provenance.get("begins_from")

    # -- tables -------------------------------------------------------------------------------------

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table at ``output.sample_rate_hz``, with two rows at each event.

        Raises
        ------
        ConfigError
            It was not made while the run went on, and does not fit into memory.
        """
        if self.saved is not None:
            return self.table("trajectory")
        if self._table is not None:
            return self._table
        if self.segments:
            require_room(self.scene)
        parts: list[pd.DataFrame] = []
        rows = TrajectoryRows(self.scene, lambda part: parts.append(part.frame))
        for segment in self.segments:
            rows.add(segment)
        rows.finish()
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def events(self) -> pd.DataFrame:
        """Event table."""
        return event_table(self.event_rows, self.scene).frame if self.saved is None else self.table("events")

    @property
    def tables(self) -> Tables:
        """Trajectory and events by name."""
        if self.saved is not None:
            return super().tables
        return Tables({"trajectory": lambda: [self.trajectory], "events": lambda: [self.events]})

    @property
    def documents(self) -> Mapping[str, Any]:
        """The summary, as its file holds it."""
        return {"summary": self.summary | {"notes": self.notes}}

    @cached_property
    def section(self) -> pd.DataFrame:
        """Poincaré section: motion at whole turns of exciter 1 in the measured part, the last 1024 of them.

        The columns are those of the trajectory table without the mode.

        Raises
        ------
        ConfigError
            The run was read from its files, which do not hold it.
        """
        if self.measures is None:
            raise ConfigError("this run was read from files, which contain no Poincaré section; simulate it again")
        points = section_rows(self.measures)
        states = section_states(self.measures, self.scene)
        columns = {"t_s": points["t"]} | {name: states[:, i] for name, i in state_places(self.scene).items()}
        if self.scene.has_contact:
            columns["contact_force_n"] = points["force"]
        return ArrayTable(columns, TRAJECTORY).frame

    @property
    def data_sheet(self) -> pd.DataFrame:
        """Loads, strokes, accelerations and motors, a row for each column of the summary that holds one.

        Columns: ``value`` in the measured part, ``unit``, ``whole_run`` (largest value of all of it), ``at_s`` and
        ``at_hz`` (when that was, and how fast the exciters turned then: of loads on the foundation, strokes, torques
        and powers), ``meaning``.
        """
        known = columns(self.scene)
        rows = []
        for name in (name for name in known if name in self.summary):
            base = split(name)[0]
            peak = (self.summary.get(f"whole_{column}") for column in (name, f"{base}_at_s", f"{base}_at_hz"))
            rows.append([self.summary[name], unit_of(name), *peak, known[name].text])
        names = ["value", "unit", "whole_run", "at_s", "at_hz", "meaning"]
        table = pd.DataFrame(rows, [name for name in known if name in self.summary], names)
        with self._as_written():
            return table.astype(dict.fromkeys(("value", "whole_run", "at_s", "at_hz"), float))

    @property
    def final_state(self) -> FloatArray:
        """Full state at the end, shape (14,), its exciter angles with all their turns."""
        if self._end is None:
            self._end = np.zeros(FULL_SIZE if self.scene.transport is None else MOVING_SIZE)
            with self._as_written():
                for name, index in state_places(self.scene).items():
                    self._end[index] = self.trajectory[name].iloc[-1]
        return self._end

    def __call__(self, times: npt.ArrayLike) -> pd.DataFrame:
        """Dense output at any times of the run, as rows of the trajectory table.

        Between the ends of steps these are the steps' polynomials, as accurate as the ends. At an event the row is
        that before it.

        Raises
        ------
        ConfigError
            Times lie outside the run or are not a list of numbers, or the segments were not kept.
        """
        try:
            wanted = np.atleast_1d(np.asarray(times, dtype=float))
        except (TypeError, ValueError):
            wanted = np.full(1, np.nan)
        if wanted.ndim != 1 or not np.isfinite(wanted).all():
            raise ConfigError("times must be a number or a one-dimensional list of finite numbers")
        if self.saved is not None:
            raise ConfigError("this run was read from files, which contain no dense output; simulate it again")
        if not self.segments:
            raise ConfigError("this run kept no segments; simulate with keep='segments' for dense output")
        first, last = self.segments[0].start, self.segments[-1].end
        if wanted.size and (wanted.min() < first or wanted.max() > last):
            raise ConfigError(f"times must lie in [{first}, {last}] s, got {wanted.min()} … {wanted.max()}")
        order = np.argsort(wanted, kind="stable")
        owner = np.searchsorted([segment.end for segment in self.segments], wanted[order], side="left")
        sampler, rows = Sampler(self.scene), np.empty(wanted.size, ROW)
        for i in np.unique(owner):
            mine = order[owner == i]
            rows[mine] = sampler(self.segments[i], wanted[mine])
        return sampler.table(rows).frame

    def rows(self, sample: Sample = "all") -> pd.DataFrame:
        """Return the trajectory table; with ``unique``, times ascend strictly, as interpolation elsewhere needs it."""
        if sample not in ("all", "unique"):
            raise ConfigError(f"sample = {sample!r}; allowed: all, unique")
        table = self.trajectory
        return table if sample == "all" else table.drop_duplicates("t_s", keep="last", ignore_index=True)

    @property
    def variation(self) -> pd.DataFrame:
        """Derivative of the state at the end by that at the beginning and by keys, as they were asked for.

        Raises
        ------
        ConfigError
            The run was not asked for it, or ended early.
        """
        if self.derivative is not None:
            return self.derivative
        if self.outcome not in ("ok", INACCURATE):
            raise ConfigError(f"this run ended early ({self.outcome}); the derivative of its end is not known")
        raise ConfigError("this run carried no derivative; simulate with variation=True, or with keys to vary")

    @property
    def monodromy(self) -> pd.DataFrame:
        """Derivative of the state at the end by that at the beginning; of a period, its eigenvalues are multipliers.

        Raises
        ------
        ConfigError
            As :attr:`variation`.
        """
        variation = self.variation
        return variation[variation.index]

    # -- to look at ---------------------------------------------------------------------------------

    @property
    def outcome(self) -> str:
        """``ok``, or why the run ended early or is inaccurate; ``summary["detail"]`` has mode, time and state.

        ``solver-failure``: the integrator gave up. ``non-finite``: a state or residual is not finite.
        ``too-many-events``: more events within a turn of the synchronous speed than ``solver.max_events_per_period``.
        ``outside-model-validity``: the platform has turned so far that the model, of first order in φ, breaks down.
        ``out-of-memory``: what is kept would take more than half of the memory available, or there is none left.
        ``inaccurate``: the run ended on time, but its energy or momentum residual is beyond its limit, and the detail
        says by how much.
        """
        return str(self.summary["outcome"])

    @property
    def name(self) -> str:
        """Name of the scene."""
        return str(self.summary["name"])

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made."""
        if self.saved is not None:
            return self.saved.provenance
        return provenance(self.scene, str(self.summary["engine"]), self.origin)

    @property
    def answer(self) -> Answer:
        """What ``vibroplat run`` prints."""
        return _tell(self.scene, self.summary | {"notes": self.notes}, self.origin)

    @cached_property
    def notes(self) -> list[str]:
        """Warnings."""
        return self._remarks() if self.saved is None else list(self.summary["notes"])

    def _repr_html_(self) -> str:
        """Return what the command prints and the figure of the motion, for a notebook."""
        picture = ""
        if len(self.trajectory) > 1:
            written = io.BytesIO()
            self.plot().savefig(written, format="png", dpi=90)
            data = base64.b64encode(written.getvalue()).decode()
            picture = f'<img alt="motion" src="data:image/png;base64,{data}">'
        return f"{super()._repr_html_()}{picture}"

    def plot(self, kind: str | None = None, **options: Any) -> Figure:
        """Draw a figure: ``motion`` (platform, gap), ``force`` (contact), ``exciters`` (speeds, phase difference).

        Parameters
        ----------
        kind
            Which one. Default: ``motion``.
        options
            ``start`` and ``stop`` of the interval shown (s). Default: the whole run, and the last ten turns of the
            exciters in detail.
        """
        return super().plot(kind, **options)

    # -- to hand on ---------------------------------------------------------------------------------

    def to_xarray(self, sample: Sample = "unique") -> Any:
        """Return the trajectory as a Dataset over ``t_s``, with units and meanings as attributes; needs xarray."""
        try:
            xarray = import_module("xarray")
        except ImportError:
            raise ImportError("to_xarray needs xarray; pip install 'vibroplat[xarray]'") from None
        table = self.rows(sample)
        dataset = xarray.Dataset(
            {str(c): ("t_s", plain_array(table[c])) for c in table if c != "t_s"}, {"t_s": table["t_s"]}
        )
        for name in dataset.variables:
            dataset[name].attrs = {"units": unit_of(name), "long_name": table.attrs["meanings"].get(name, name)}
        return dataset.assign_attrs(name=self.scene.name, outcome=self.outcome)

    def save_mat(self, path: str | Path, sample: Sample = "unique", *, overwrite: bool = False) -> Path:
        """Write ``trajectory``, ``events``, ``summary`` and ``units`` as structures into a file for MATLAB or Octave.

        Numbers that are not known are NaN. A file of another kind is replaced only with ``overwrite``.

        Raises
        ------
        TableError
            It cannot be written, or there is something else already.
        """
        trajectory, file = self.rows(sample), Path(path)
        require_replaceable(file, b"MATLAB", overwrite=overwrite)
        tables = {"trajectory": trajectory, "events": self.events}
        replace_file(file, lambda path: write_mat(path, tables, self.documents))
        return file


def _tell(scene: Scene, summary: Mapping[str, Any], origin: dict[str, Any] | None) -> Answer:
    """Return what ``vibroplat run`` prints of a summary with notes."""
    sheet, outcome = Sheet(scene, summary), summary["outcome"]
    detail = str(summary["detail"]).partition(", state [")[0]
    return Answer(
        all_lines(sheet, origin),
        notes=[engine_note(str(summary["engine"])), *by_severity([str(note) for note in summary["notes"]])],
        failures=[] if outcome == "ok" else [f"{outcome}: {detail}"],
        headline=headline(scene, sheet.numbers),
        short=short_lines(sheet),
    )


@validated(directory=FileName, command=str | None)
def load(directory: str | Path, command: str | None = None) -> Result:
    """Read a result from its directory: a :class:`RunResult` for a run, a :class:`Result` for any other command.

    Parameters
    ----------
    directory
        Directory of the result.
    command
        Command that wrote it. Default: the first of run, sweep, orbits, … that has a result in the directory.

    Raises
    ------
    TableError
        The directory has no such result, or a file is missing, damaged or part of another result.
    """
    path = Path(directory)
    written = commands_in(path)
    if command is None and not written:
        raise TableError(f"{path} holds no finished result; allowed: a result directory of vibroplat")
    chosen = command or written[0]
    return RunResult.read(path, chosen) if chosen == "run" else Result.read(path, chosen)
