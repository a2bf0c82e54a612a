"""Measured curves beside runs: what is left of them, and how it changes with keys, shifts, offsets and factors.

A residual is (factor · m − c(t + shift) − offset) / w for measured values m at times t, with the computed curve c and a
weight w of each curve: first the RMS of its values, in the end that of what remains of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vibroplat.config.coordinates import TURN
from vibroplat.config.fit_plan import FitData, FitPlan
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.measured.alignment import Curve, FloatArray, best_shift, interpolant, main_frequency
from vibroplat.measured.data import Measured, curve_of, read_data
from vibroplat.motion.run import simulate

#: Rows of runs in an oscillation, and at most for each sample of the data; and by how much runs are longer than data
#: that begin with them, over their length and at least in oscillations: any phase may be the first.
ROWS, ROWS_A_SAMPLE, LONGER, TURNS = 100.0, 2.0, 0.1, 1.2
#: Step of keys in differences, over their ranges, and step of a shift (s).
STEP, SHIFT_STEP = 1e-4, 1e-6
#: Fewest samples of a curve.
FEWEST = 8


class Computed(NamedTuple):
    """A computed curve, and the function that goes through its rows."""

    curve: Curve
    through: Callable[[FloatArray], FloatArray]

    def at(self, times: FloatArray) -> FloatArray:
        """Evaluate it at times, and beyond its ends as there."""
        return self.through(np.clip(times, self.curve[0][0], self.curve[0][-1]))


class Part(NamedTuple):
    """A measured curve: the place of its file among the data, its column, times from the first sample, and values."""

    file: int
    column: str
    times: FloatArray
    values: FloatArray


def read_files(plan: FitPlan) -> list[Measured]:
    """Read the files of a plan; raises ConfigError."""
    found = []
    for entry in plan.data:
        pairs = [f"{ours}={theirs}" for ours, theirs in entry.columns.items()]
        quoted = ",".join(f'"{pair}"' if "," in pair else pair for pair in pairs)
        try:
            data = read_data(f"{entry.file}:{quoted},shift=0" if pairs else entry.file)
        except TableError as error:
            raise ConfigError(str(error).replace("--data", "fit.data:", 1)) from None
        found.append(data)
    return found


@dataclass
class Misfit:
    """The difference between data and runs of a scene with some values of keys.

    Attributes
    ----------
    scene, plan
        The scene and its section ``fit``.
    parts
        The measured curves.
    simulations
        How many runs there have been.
    """

    scene: Scene
    plan: FitPlan
    parts: list[Part] = field(default_factory=list)
    simulations: int = 0
    known: tuple[bytes, list[Computed]] = (b"", [])

    def __post_init__(self) -> None:
        for number, data in enumerate(read_files(self.plan)):
            columns = [name for name in map(str, data.given) if name != "t_s"]
            if "t_s" not in data.given or not columns:
                raise ConfigError(f"fit.data: {data} needs a column t and one more; allowed: columns: {{t: NAME, …}}")
            data.select("t_s", columns)
            for column in columns:
                times, values = curve_of(data.table, column)
                if len(times) < FEWEST or not np.ptp(values) > 0.0:
                    raise ConfigError(
                        f"fit.data: {data}: {column} has {len(times)} values; allowed: {FEWEST} that vary"
                    )
                self.parts.append(Part(number, column, times, values))
        self.keys = [*self.plan.keys]
        self.low, self.high = np.array([*self.plan.keys.values()], dtype=float).T
        self.fits_shift = self.plan.shift == "fit"
        self.scenes = [self._scene_of(number, entry) for number, entry in enumerate(self.plan.data)]

    # -- runs ---------------------------------------------------------------------------------------

    def _scene_of(self, number: int, entry: FitData) -> Scene:
        """Return the scene of a file, with the values of keys that it has."""
        own = [part for part in self.parts if part.file == number]
        length = max(float(part.times[-1]) for part in own)
        changes = {f"output.{name}": value for name, value in self._output(own).items()}
        if "perturbation" not in self.scene.run.model_fields_set:
            changes["run.perturbation"] = 0.0
        scene = self.scene.replace(changes | dict(entry.run))
        turn = 1.0 / min(main_frequency((part.times, part.values)) for part in own)
        room = max(LONGER * length, TURNS * turn) if self.fits_shift else float(self.plan.shift)
        least = length + room
        return scene.replace({"run.duration_s": max(scene.run.duration_s, least) if self.fits_shift else least})

    def _output(self, own: Sequence[Part]) -> dict[str, float | bool]:
        """Return which rows of a run are compared with some curves."""
        fastest = max(main_frequency((part.times, part.values)) for part in own)
        if any(self.scene.driven(0.0, self.scene.run.duration_s)):
            fastest = max(fastest, self.scene.speed_scale / TURN)
        finest = max(ROWS_A_SAMPLE / float(np.median(np.diff(part.times))) for part in own)
        output: dict[str, float | bool] = {"sample_rate_hz": min(ROWS * fastest, finest)}
        if any(part.column.startswith("acceleration") for part in own):
            output["accelerations"] = True
        return output

    def shift_bounds(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and largest shift of each file, between which nearly all data lie in the run."""
        count = len(self.plan.data) * self.fits_shift
        lengths = [max(float(p.times[-1]) for p in self.parts if p.file == number) for number in range(count)]
        room = [scene.run.duration_s - length for scene, length in zip(self.scenes, lengths, strict=False)]
        return -LONGER * np.array(lengths), np.array(room)

    def curves(self, places: FloatArray) -> list[Computed]:
        """Return the computed curve of each part, with keys at places between the ends of their ranges, 0 and 1.

        Raises
        ------
        ConfigError
            Runs do not have its column.
        ArithmeticError
            A run does not come to its end.
        """
        if self.known[0] == places.tobytes():
            return self.known[1]
        tables, values = [], dict(zip(self.keys, (self.low + places * (self.high - self.low)).tolist(), strict=True))
        for scene in (one.replace(values) for one in self.scenes):
            run = simulate(scene)
            self.simulations += 1
            if run.outcome != "ok":
                raise ArithmeticError(f"{run.outcome} at {run.end_time} s")
            table = run.trajectory
            tables.append(table.assign(y_m=table["y_m"] - float(static_rest(scene)[1])))
        found = []
        for part in self.parts:
            if part.column not in tables[part.file]:
                known = ", ".join(name for name in map(str, tables[part.file]) if name != "t_s")
                raise ConfigError(f"fit.data: runs have no column {part.column}; allowed: {known}")
            curve = curve_of(tables[part.file], part.column)
            found.append(Computed(curve, interpolant(curve)))
        self.known = places.tobytes(), found
        return found

    # -- what is left -------------------------------------------------------------------------------

    def begin(self, places: FloatArray) -> FloatArray:
        """Return unknowns: keys at some places, shifts of the smallest differences, no offsets, and factors of 1."""
        shifts: list[float] = []
        curves = self.curves(places) if self.fits_shift else []
        for number in range(len(self.plan.data)) if self.fits_shift else ():
            own = [(p, c) for p, c in zip(self.parts, curves, strict=True) if p.file == number]
            part, computed = max(own, key=lambda of: len(of[0].times))
            shifts.append(
                best_shift((part.times, part.values), computed.curve, offset=self.fits_offset, overlap=1.0).shift
            )
        return np.concatenate([places, shifts, *self.others])

    @property
    def fits_offset(self) -> bool:
        """Whether offsets are unknown."""
        return self.plan.offset == "fit"

    @property
    def others(self) -> tuple[FloatArray, FloatArray]:
        """The first offsets and factors, as many as are unknown."""
        count = len(self.parts)
        return np.zeros(count * self.fits_offset), np.ones(count * (self.plan.scale == "fit"))

    def unpack(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return places of keys, shift of each file, offset and factor of each part."""
        count = len(self.parts)
        sizes = len(self.keys), len(self.plan.data) * self.fits_shift, *(len(of) for of in self.others)
        places, shifts, offsets, factors = np.split(u, np.cumsum(sizes)[:-1])
        shifts = shifts if self.fits_shift else np.full(len(self.plan.data), float(self.plan.shift))
        return places, shifts, offsets if len(offsets) else np.zeros(count), factors if len(factors) else np.ones(count)

    def residuals(self, u: FloatArray, weights: FloatArray, until: float = 1.0) -> FloatArray:
        """Return what is left of all parts, up to a part of their lengths, over weights."""
        places, shifts, offsets, factors = self.unpack(u)
        found = []
        for k, (part, curve) in enumerate(zip(self.parts, self.curves(places), strict=True)):
            times, values = _up_to(part, until)
            computed = curve.at(times + shifts[part.file])
            found.append((factors[k] * values - computed - offsets[k]) / weights[k])
        return np.concatenate(found)

    def slopes(self, u: FloatArray, weights: FloatArray, until: float = 1.0, *, both: bool = False) -> FloatArray:
        """Return the derivative of residuals by unknowns, by keys as differences to one side or to ``both``."""
        places, shifts, _, _ = self.unpack(u)
        columns = []
        middle = self.residuals(u, weights, until)
        for number in range(len(places)):
            ends = []
            for side in (1.0, -1.0) if both else (1.0 if places[number] < 0.5 else -1.0,):
                moved = u.copy()
                moved[number] += side * STEP
                ends.append((side, self.residuals(moved, weights, until)))
            other = ends[1] if both else (0.0, middle)
            columns.append((ends[0][1] - other[1]) / ((ends[0][0] - other[0]) * STEP))
        curves = self.curves(places)
        sizes = [len(_up_to(part, until)[0]) for part in self.parts]
        begins = np.cumsum([0, *sizes])
        extra = np.zeros((begins[-1], len(u) - len(places)))
        count = len(self.plan.data) * self.fits_shift
        for k, (part, curve) in enumerate(zip(self.parts, curves, strict=True)):
            rows = slice(begins[k], begins[k + 1])
            times, values = _up_to(part, until)
            if self.fits_shift:
                at = times + shifts[part.file]
                rise = (curve.at(at + SHIFT_STEP) - curve.at(at - SHIFT_STEP)) / (2.0 * SHIFT_STEP)
                extra[rows, part.file] = -rise / weights[k]
            if self.fits_offset:
                extra[rows, count + k] = -1.0 / weights[k]
            if self.plan.scale == "fit":
                extra[rows, count + len(self.others[0]) + k] = values / weights[k]
        return np.column_stack([*columns, extra])


def _up_to(part: Part, until: float) -> tuple[FloatArray, FloatArray]:
    """Return times and values of a part up to a part of its length."""
    own = part.times <= part.times[0] + until * (part.times[-1] - part.times[0])
    return part.times[own], part.values[own]
