"""Segments of a run with dense output, and its tables: the trajectory, on the output grid and at events, and events.

Full states are named here as in the columns of the trajectory table.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroplat.columns import TEXT, Column, Columns
from vibroplat.config.coordinates import ALONG, COORDINATES, RATES, Mode
from vibroplat.config.scene import Scene
from vibroplat.config.sections import State
from vibroplat.errors import ConfigError
from vibroplat.frames import ArrayTable, CategoryColumn, pd
from vibroplat.hybrid.modes import KINDS
from vibroplat.hybrid.state import Automaton
from vibroplat.kernels.compiled import FloatArray, compiled, copy
from vibroplat.kernels.polynomial import values
from vibroplat.model.accelerations import platform_accelerations
from vibroplat.model.motor import motor_powers
from vibroplat.model.parameters import parameters, supply
from vibroplat.model.springs import foundation_forces
from vibroplat.model.systems import ALONG as ALONG_PLACE
from vibroplat.model.systems import FULL_SIZE, MOVING_SIZE, SYSTEMS, System, systems
from vibroplat.system.memory import available, free_memory, size_text

#: Rows that are made and written at a time.
BLOCK = 2**15
#: Memory that an array takes besides its numbers (bytes).
OVERHEAD = 150
#: Bytes of a number in memory, and about as many in files: exports are written in addition to Parquet.
NUMBER = 8
FILED = {"parquet": 8, "csv": 20}
#: Maximum number of copies of a table in memory, when its parts are put together.
COPIES = 2

#: Records, and fields of compiled records.
Records = npt.NDArray[np.void]

#: Columns of the trajectory table, the keys of a full state among them, and of the Poincaré section.
TRAJECTORY: Columns = {
    "t_s": Column("time"),
    "mode": Column(
        "mode: attached (in contact), flight (the material has lifted off) or bare (no contact in this scene); with "
        "transport stick, slip+ or slip- in contact",
    ),
    **{name: Column(field.description or "") for name, field in State.model_fields.items()},
    "contact_force_n": Column("force between lower layer and platform; impulses of impacts are in the events"),
    "friction_force_n": Column("force of friction on the material, towards +x"),
    "supply_frequency_hz": Column("supply frequency, if a program changes it"),
    **{f"motor_power_{n}_w": Column(f"mechanical power of motor {n}: torque times speed") for n in (1, 2)},
}


#: Columns of the forces into the foundation, positive along +x and +y; at rest that along y is minus the weight.
FOUNDATION_FORCES: Columns = {
    f"foundation_force_{axis}_n": Column(f"force into the foundation along {axis}", "springs and dampers")
    for axis in ("x", "y")
}


def acceleration_columns(points: Iterable[str] = ()) -> Columns:
    """Return the columns of accelerations of the trajectory table: of the machine's centre of mass and named points."""
    whose = {"": "the machine's centre of mass"}
    whose |= {f"{name}_": f"point {name}, of first order in phi" for name in points}
    return {
        f"acceleration_{axis}_{name}m_per_s2": Column(f"acceleration along {axis} of {meaning}")
        for name, meaning in whose.items()
        for axis in ("x", "y")
    }


#: Columns of the event table.
EVENTS: Columns = {
    "t_s": Column("time"),
    "kind": Column(
        "liftoff, impact, chatter or drive; with transport slip, stick or reversal",
        "drive: a corner of the supply program",
        kind=TEXT,
    ),
    "gap_rate_before_m_per_s": Column(
        "rate of change of the gap before the event", "for a chatter: before its first impact"
    ),
    "gap_rate_after_m_per_s": Column("rate of change of the gap after the event"),
    "impulse_n_s": Column("impulse between lower layer and platform", "for a chatter: sum over its impacts"),
    "energy_loss_j": Column("energy lost at the event", "for a chatter: sum over its impacts"),
    "contact_force_after_n": Column("contact force after the event", "0 in flight"),
    "mode_after": Column(
        "mode after the event", "attached, flight or bare; with transport stick, slip+, slip- or flight"
    ),
    "impacts": Column(
        "number of impacts",
        "1 for an impact, 0 for a liftoff; for a chatter, number of impacts until their speed is round-off",
    ),
    "along_rate_before_m_per_s": Column("velocity of the material along the deck before the event", "with transport"),
    "along_rate_after_m_per_s": Column("velocity of the material along the deck after the event", "with transport"),
    "friction_impulse_n_s": Column(
        "impulse of friction on the material", "towards +x; for a chatter: sum over its impacts; with transport"
    ),
    "friction_force_after_n": Column("force of friction after the event", "0 in flight; with transport"),
}
#: Fields of :data:`vibroplat.hybrid.state.EVENT` that these columns hold, in the same order.
_FIELDS = (
    *("t", "kind", "rate_before", "rate_after", "impulse", "loss", "force_after", "mode_after", "impacts"),
    *("slip_before", "slip_after", "friction_impulse", "friction_after"),
)
#: Those of motion along the deck.
_SLIDING = _FIELDS[-4:]


def mode_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the modes by their numbers, without those of transport unless a scene has it."""
    return tuple(mode.label for mode in Mode if scene.transport is not None or mode <= Mode.BARE)


#: A row of the trajectory table: time (s), numbers of the mode and of the drive's interval, full state, F_c (N).
ROW = np.dtype(
    [
        *(("t", float), ("mode", np.int64), ("interval", np.int64)),
        *(("state", float, MOVING_SIZE), ("force", float), ("friction", float)),
    ]
)


def state_places(scene: Scene) -> dict[str, int]:
    """Places in the full state of the coordinates of a scene, then of their rates, by their names."""
    places = {names[i]: half + i for half, names in ((0, COORDINATES), (7, RATES)) for i in scene.coordinates}
    return places if scene.transport is None else places | {name: ALONG_PLACE + i for i, name in enumerate(ALONG)}


def named_derivative(derivative: FloatArray, scene: Scene, keys: Sequence[str]) -> pd.DataFrame:
    """Name rows and columns of a full state's derivative by another and by keys, shape (14, 14 + keys)."""
    places = state_places(scene)
    rows = list(places.values())
    columns = [*rows, *range(FULL_SIZE, FULL_SIZE + len(keys))]
    return pd.DataFrame(derivative[rows][:, columns], index=list(places), columns=[*places, *keys])


def event_table(events: Records, scene: Scene) -> ArrayTable:
    """Make an event table of records of :data:`vibroplat.hybrid.state.EVENT`."""
    names = {column: field for column, field in zip(EVENTS, _FIELDS, strict=True) if field not in _SLIDING}
    if scene.transport is not None:
        names |= {column: field for column, field in zip(EVENTS, _FIELDS, strict=True) if field in _SLIDING}
    columns: dict[str, Any] = {column: events[field] for column, field in names.items()}
    columns["kind"] = CategoryColumn(events["kind"], KINDS)
    columns["mode_after"] = CategoryColumn(events["mode_after"], mode_names(scene))
    return ArrayTable(columns, EVENTS)


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
        Whether it continues from the segment before without an event between them.
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

    def __call__(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Full states (len(times), 14 or 16), contact forces and friction (len(times),) at absolute ascending times."""
        elapsed = np.where(times >= self.end, np.inf, times - self.start)  # its end is that of its last step, exactly
        unknowns = sample(self.t, self.length, self.c, self.ends, elapsed)
        states = self.system.full(unknowns)
        states[:, 3:5] += self.turns
        forces = np.zeros((2, len(times)))
        forces[: self.system.size - self.system.differential] = unknowns[:, self.system.differential :].T
        return states, forces[0], forces[1]

    @property
    def nbytes(self) -> int:
        """Memory that it takes (bytes)."""
        return sum(array.nbytes + OVERHEAD for array in (self.t, self.length, self.c, self.ends, self.turns))


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


def closed(h: Automaton) -> Iterator[Segment]:
    """Copy the closed pieces of a motion."""
    steps = h.steps
    for piece in steps.pieces[: steps.used["pieces"]]:
        system = SYSTEMS[piece["system"]]
        rows = slice(int(piece["first"]), int(piece["end"]))
        offset = steps.start[rows.start]
        yield Segment(
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


class Sampler:
    """Evaluates segments of a scene, and makes trajectory tables of that."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._p = parameters(scene)
        self._intervals = scene.drive.intervals
        self._accelerations = acceleration_columns(scene.output.points) if scene.output.accelerations else {}
        self._corners = [interval.start for interval in self._intervals[1:]]

    def __call__(self, segment: Segment, times: FloatArray) -> Records:
        """Evaluate a segment at ascending times (s); returns records of ROW."""
        rows = np.empty(times.size, ROW)
        rows["t"], rows["mode"] = times, int(segment.system.mode)
        # no corner lies inside a segment
        rows["interval"] = np.searchsorted(self._corners, 0.5 * (segment.start + segment.end), side="right")
        states, rows["force"], rows["friction"] = segment(times)
        rows["state"][:, : states.shape[1]] = states
        return rows

    def table(self, rows: Records) -> ArrayTable:
        """Make a table of records of ROW."""
        columns: dict[str, Any] = {
            "t_s": rows["t"],
            "mode": CategoryColumn(rows["mode"], mode_names(self.scene), categorical=True),
        }
        columns |= {name: rows["state"][:, place] for name, place in state_places(self.scene).items()}
        if self.scene.has_contact:
            columns["contact_force_n"] = rows["force"]
        if self.scene.transport is not None:
            columns["friction_force_n"] = rows["friction"]
        columns |= self._supply(rows)
        if self._accelerations:
            state = rows["state"].T
            along_x, along_y, _ = foundation_forces(*state[:3], *state[7:10], self._p)
            columns |= dict(zip(FOUNDATION_FORCES, (along_x, along_y), strict=True))
        return ArrayTable(columns, {**TRAJECTORY, **self._accelerations, **FOUNDATION_FORCES})

    def _supply(self, rows: Records) -> dict[str, FloatArray]:
        """Return the columns that depend on the supply of each row.

        These are the power of both motors (W), the supply frequency (Hz) if a program changes it, and accelerations
        (m/s²) if the scene has them in its output.
        """
        program = self.scene.drive.program
        power, frequency, moved = np.empty((len(rows), 2)), np.empty(len(rows)), np.empty((len(rows), 3))
        for k in np.unique(rows["interval"]):
            interval, mine = self._intervals[k], rows["interval"] == k
            times, speeds = rows["t"][mine], rows["state"][:, 10:12][mine]
            supply(self._p, self.scene, interval)
            power[mine] = motor_powers(times, speeds, self._p)
            if program is not None:
                frequency[mine] = interval.frequency + interval.ramp * (times - interval.start)
            for mode, system in systems(self.scene).items() if self._accelerations else ():
                own = mine & (rows["mode"] == int(mode))
                moved[own] = platform_accelerations(system.index, rows["t"][own], rows["state"][own], self._p)
        columns = {} if program is None else {"supply_frequency_hz": frequency}
        columns |= {"motor_power_1_w": power[:, 0], "motor_power_2_w": power[:, 1]}
        if not self._accelerations:
            return columns
        spots = np.array([(0.0, 0.0), *self.scene.named_points.values()])
        along_x, along_y = moved[:, :1] - spots[:, 1] * moved[:, 2:], moved[:, 1:2] + spots[:, 0] * moved[:, 2:]
        values = np.stack([along_x, along_y], axis=2).reshape(len(rows), 2 * len(spots))
        return columns | {name: values[:, i] for i, name in enumerate(self._accelerations)}


class Blocks:
    """Collects records and hands them over in blocks of BLOCK, the last of which may be shorter.

    Parameters
    ----------
    dtype
        Of the records.
    take
        Is called with each block, which is overwritten afterwards; at least once, without records if there are none.
    """

    def __init__(self, dtype: npt.DTypeLike, take: Callable[[Records], object]) -> None:
        self._records = np.empty(BLOCK, dtype)
        self._take = take
        self._filled, self._handed_over = 0, False

    def put(self, records: Records) -> None:
        """Collect records."""
        while len(records):
            if self._filled == BLOCK:
                self._hand_over()
            added = records[: BLOCK - self._filled]
            self._records[self._filled : self._filled + len(added)] = added
            self._filled += len(added)
            records = records[len(added) :]

    def finish(self) -> None:
        """Hand over the rest."""
        if self._filled or not self._handed_over:
            self._hand_over()

    def _hand_over(self) -> None:
        self._take(self._records[: self._filled])
        self._filled, self._handed_over = 0, True


class TrajectoryRows:
    """Makes the trajectory table of a run, segment by segment.

    Parameters
    ----------
    scene
        What moves.
    take
        Is called with each part of the table.
    """

    def __init__(self, scene: Scene, take: Callable[[ArrayTable], object]) -> None:
        self._sample = Sampler(scene)
        self._blocks = Blocks(ROW, lambda rows: take(self._sample.table(rows)))
        self._end = np.empty(0, ROW)  # of the segment before: it is no row if the next one continues from it

    def add(self, segment: Segment) -> None:
        """Make the rows of the next segment: its beginning after an event, the output grid strictly inside, its end."""
        ended, self._end = self._end, self._end[:0]
        beginning: list[float] = []
        if not segment.joined:
            self._blocks.put(ended)
            beginning = [segment.start]
        rate = self._sample.scene.output.sample_rate_hz
        first, last = math.floor(segment.start * rate), math.ceil(segment.end * rate) + 1
        for number in range(first, last, BLOCK):
            grid = np.arange(float(number), float(min(number + BLOCK, last))) / rate
            inside = grid[(grid > segment.start) & (grid < segment.end)]
            end = [segment.end] if number + BLOCK >= last else []
            rows = self._sample(segment, np.concatenate((beginning, inside, end)))
            beginning = []
            self._blocks.put(rows[: len(rows) - len(end)])
            if end:
                self._end = rows[-1:]

    def finish(self) -> None:
        """Hand over the rest; a run without a step has one part without rows."""
        self._blocks.put(self._end)
        self._blocks.finish()


def require_room(scene: Scene, directory: Path | None = None, form: str = "parquet") -> None:
    """Refuse a trajectory table that does not fit on the disk, or without a directory into memory.

    Raises
    ------
    ConfigError
        Rows at ``output.sample_rate_hz`` alone, without those at events, need more than there is.
    """
    if directory is None:
        there = available()
        limit, number = free_memory(there), COPIES * NUMBER
        where = f"of memory, where {size_text(limit)} may be taken of {size_text(there)} available"
    else:
        limit, number = (
            float(shutil.disk_usage(directory).free),
            FILED.get(form, sum(FILED.values())),
        )
        where = f"on disk, where {size_text(limit)} are free"
    seconds, rate = scene.run.duration_s, scene.output.sample_rate_hz
    rows, columns = seconds * rate, len(Sampler(scene).table(np.empty(0, ROW)).columns)
    needed = rows * columns * number
    if needed > limit:
        raise ConfigError(
            f"output.sample_rate_hz = {rate:g} asks for {rows:.3g} rows of {columns} columns in {seconds:g} s: "
            f"{size_text(needed)} {where}; allowed: at most {rate * limit / needed:.2g} Hz, or a shorter run.duration_s"
        )
