"""The data sheet of a measured interval: loads, strokes and accelerations; of a run, its extremes and start as well."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import Column, Columns, split
from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.drive import SupplyInterval
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import natural_modes
from vibroplat.observe.conveying import CONVEYING, conveying
from vibroplat.observe.extremes import (
    ACCELERATION,
    HEIGHT,
    LIFT,
    MOMENT,
    POINT_ACCELERATIONS,
    POINTS,
    POWER_1,
    PULL_X,
    PULL_Y,
    SIDEWAYS,
    SPEED_1,
    TORQUE_1,
    merge_extremes,
)
from vibroplat.observe.measures import BINS, FASTEST, SUMS, TIME, WHOLE_RUN, Accumulators, require
from vibroplat.observe.section import section_rows

#: Part of its mean by which a speed may differ from it while the motion has its measured speed.
STEADY = 0.05
#: How far the speed of a captured motor may be above a natural frequency, as a part of it, and may change.
RESONANCE_WIDTH = 0.1

#: Columns whose largest value in the whole run has a time and a speed, by the beginnings of their names: loads on the
#: foundation, strokes, torques and powers, which are largest while a machine starts or stops.
TIMED = ("foundation_", "stroke_", "motor_")

#: Sums of coordinates, and of their squares.
_SQUARES = {"x": "xx", "y": "yy", "phi": "phi_phi"}

#: Axes of the suspension: their names in columns, places among extremes, sums of force and its square, and units.
_AXES = (
    ("force_x", PULL_X, "force_x", "n"),
    ("force_y", PULL_Y, "force_y", "n"),
    ("moment", MOMENT, "moment", "n_m"),
)
_FOUNDATION_RMS = [(f"foundation_{name}_rms_{unit}", key, f"{key}_{key}") for name, _, key, unit in _AXES]
_SUSPENSION = "springs and dampers; impulses of impacts act only through these"


def _motor_columns() -> Iterator[tuple[str, Column]]:
    """Yield the columns of both motors, equal quantities next to each other."""
    for what, unit, definition in (
        ("power", "w", "torque times speed"),
        ("torque", "n_m", "in the direction of the drive"),
    ):
        for i in (1, 2):
            yield f"motor_{what}_{i}_mean_{unit}", Column(f"mean {what} of motor {i}", definition)
            yield f"motor_{what}_{i}_max_{unit}", Column(f"maximum {what} of motor {i}", "magnitude")
    for i in (1, 2):
        yield f"torque_ratio_{i}", Column(f"mean torque of motor {i} / critical torque")
        yield (
            f"torque_ratio_{i}_max",
            Column(f"maximum torque of motor {i} / critical torque", "magnitude"),
        )
    for i in (1, 2):
        yield f"slip_{i}", Column(f"mean slip of motor {i}", "if its supply is constant")
    for i in (1, 2):
        yield f"speed_ripple_{i}_hz", Column(f"ripple of the speed of exciter {i}", "maximum minus minimum")
    for i in (1, 2):
        yield (
            f"bearing_force_{i}_max_n",
            Column(f"maximum centrifugal force of unbalance {i}", "m_i r_i times the square of the maximum speed"),
        )


#: Columns for the measuring interval.
SHEET: Columns = {
    **{
        f"foundation_{name}_{how}_{unit}": Column(f"{meaning} of the {what} into the foundation", told)
        for name, what, unit in (
            ("force_x", "force along x", "n"),
            ("force_y", "force along y", "n"),
            ("moment", "moment", "n_m"),
        )
        for how, meaning, told in (
            *((("mean", "mean", "static part: minus the weight on the springs"),) * (name == "force_y")),
            ("rms", "RMS", "about its mean"),
            ("amplitude", "dynamic amplitude", "half the difference of maximum and minimum; without the static part"),
            ("max", "maximum magnitude", _SUSPENSION + ("; with the static part" if name == "force_y" else "")),
        )
    },
    "stroke_x_m": Column("stroke along x", "maximum minus minimum"),
    "stroke_y_m": Column("stroke along y", "maximum minus minimum"),
    "acceleration_max_m_per_s2": Column(
        "maximum acceleration of the machine's centre of mass", "magnitude; impulses of impacts do not count"
    ),
    "gamma": Column(
        "maximum acceleration along y of the machine's centre of mass divided by gravity normal to the deck",
        "magnitude; impulses of impacts do not count; the throw index",
    ),
    **dict(_motor_columns()),
}


#: A name that stands for any, on pages on columns.
_ANY = ("NAME",)


def point_columns(points: Iterable[str] = _ANY, springs: Iterable[str] = _ANY, placed: bool = True) -> Columns:
    """Return the columns of named points of the platform, and of springs; ``placed`` ones push along x as well."""
    columns = {}
    for name in points:
        for axis in ("x", "y"):
            columns[f"stroke_{axis}_{name}_m"] = Column(f"stroke of point {name} along {axis}", "maximum minus minimum")
        columns[f"acceleration_max_{name}_m_per_s2"] = Column(
            f"maximum acceleration of point {name}",
            "magnitude; of first order in phi",
        )
    for name in springs:
        who = f"along y in each spring {name}"
        columns |= {
            f"spring_force_mean_{name}_n": Column(f"mean force {who}", "static part; negative: the spring is pressed"),
            f"spring_force_amplitude_{name}_n": Column(
                f"dynamic amplitude of the force {who}", "half the difference of maximum and minimum"
            ),
            f"spring_force_max_{name}_n": Column(
                f"maximum force {who}",
                "magnitude; its stiffness along y times the displacement of its place; without its damper",
            ),
        }
        across = {"amplitude": ("dynamic amplitude of the", "half the difference of maximum and minimum")}
        for how, (what, definition) in (across | {"max": ("maximum", "magnitude")}).items() if placed else ():
            meaning = f"{what} force along x in each spring {name}"
            columns[f"spring_force_x_{how}_{name}_n"] = Column(meaning, definition)
    return columns


def points_of(scene: Scene) -> Columns:
    """Return the columns of a scene's points and springs."""
    return point_columns(scene.output.points, scene.measured_springs, placed=scene.springs is not None)


def columns(scene: Scene) -> Columns:
    """Return the columns of a scene's data sheet."""
    return {**SHEET, **more_columns(scene)}


def more_columns(scene: Scene) -> Columns:
    """Return those that not every scene has."""
    return {**points_of(scene), **({} if scene.transport is None else CONVEYING)}


def _names_of_largest(names: Iterable[str]) -> list[str]:
    """Return those columns that are largest values."""
    return [name for name in names if "_max" in name or name.startswith("stroke_") or name == "gamma"]


def whole_columns(described: Columns) -> Columns:
    """Return the columns of the largest values in the whole run of a data sheet's columns."""
    columns_of_run: dict[str, Column] = {}
    for name in _names_of_largest(described):
        base = split(name)[0]
        column = described[name]
        columns_of_run[f"whole_{name}"] = column._replace(meaning=f"{column.meaning} in the whole run")
        if not name.startswith(TIMED):
            continue
        columns_of_run[f"whole_{base}_at_s"] = Column(
            f"time at which whole_{base} was first reached",
            "later values that exceed it by a relative 1e-11 or less are round-off",
        )
        columns_of_run[f"whole_{base}_at_hz"] = Column(
            "mean speed of both exciters at that time",
            "mean over a turn of the faster exciter; empty if both swing or stand still",
        )
    return columns_of_run


#: Columns for the whole run.
WHOLE: Columns = {
    **whole_columns(SHEET),
    "synchronized_at_s": Column(
        "time from which the exciters stay synchronized as in the measured part",
        "speeds within 5 % and phase difference within pi/3 of the measured means; empty if no motor is on, with fewer "
        "than 48 turns, or if the measured phase difference neither converges nor fluctuates without a trend",
    ),
    "start_energy_j": Column("work of both motors until synchronized_at_s"),
    "captured_by": Column(
        "resonance that captures a motor (Sommerfeld effect)",
        "x, y or phi, or a mode such as x with rotation: where most of the vibration is, if a motor slips by more than "
        "a third of its critical slip, the vibration takes most of the power, and a natural frequency there (y: with "
        "or without the material) is at most 10 % below the speed, and below the synchronous one; empty otherwise, or "
        "if speeds change by more than 10 %",
    ),
}


def means(ms: Accumulators) -> dict[str, float]:
    """Means over the whole turns of exciter 1, or without any over the whole measured part; empty if that is nothing.

    What is called ``time`` is how long that is (s).
    """
    sums = ms.whole if ms.whole[TIME] > 0.0 else ms.plain + ms.open_turn
    if sums[TIME] <= 0.0:
        return {}
    mean = dict(zip(SUMS, (sums / sums[TIME]).tolist(), strict=True))
    mean["time"] = float(sums[TIME])
    return mean


def rms_about_mean(mean: Mapping[str, float], first: str, square: str) -> float:
    """RMS about its mean of what has a mean and a mean square of these names; see :data:`SUMS`."""
    return math.sqrt(max(mean[square] - mean[first] ** 2, 0.0))


def steady_supply(scene: Scene, begin: float, end: float) -> SupplyInterval | None:
    """Return the supply between two times (s), None if it changes in between."""
    return None if scene.drive.last_change(end) > begin else scene.drive.at(begin)


def data_sheet(ms: Accumulators, extremes: Any, scene: Scene) -> dict[str, float | None]:
    """Return the data sheet of a measured interval with its extremes.

    It has None where there is nothing, or nothing constant, to measure.
    """
    mean = means(ms)
    sheet: dict[str, float | None] = dict.fromkeys(columns(scene))
    if not mean:
        return sheet
    for name, key, square in _FOUNDATION_RMS:
        sheet[name] = rms_about_mean(mean, key, square)
    sheet["foundation_force_y_mean_n"] = mean["force_y"]
    window = float(ms.marks["window"]), float(ms.marks["until"])
    supply, driven = steady_supply(scene, *window), scene.driven(*window)
    speeds = None if supply is None else scene.synchronous_speeds_at(supply.frequency)
    for i, exciter in enumerate(scene.exciter_pair):
        n, critical, torque = i + 1, exciter.critical_torque_n_m, mean[f"torque_{i + 1}"]
        sheet[f"motor_power_{n}_mean_w"], sheet[f"motor_torque_{n}_mean_n_m"] = mean[f"power_{n}"], torque
        sheet[f"torque_ratio_{n}"] = torque / critical if critical > 0.0 else None
        if speeds is not None and driven[i]:
            sheet[f"slip_{n}"] = 1.0 - exciter.direction * mean[f"speed_{n}"] / speeds[i]
        ripple = float(extremes["largest"][SPEED_1 + i] - extremes["least"][SPEED_1 + i])
        sheet[f"speed_ripple_{n}_hz"] = ripple / TURN
    for name, (_, spring) in scene.measured_springs.items():
        sheet[f"spring_force_mean_{name}_n"] = spring.stiffness[1] * (mean["y"] + spring.place[0] * mean["phi"])
    if scene.transport is not None:
        sheet |= conveying(ms, mean, scene)
    return sheet | _largest(extremes, _from_extremes(scene))


class Extreme(NamedTuple):
    """How a column follows from extremes: of which quantity, times what, and whether it is their difference.

    If not, it is the larger size of both, or if ``squared`` the square of it.
    """

    quantity: int
    factor: float = 1.0
    difference: bool = False
    squared: bool = False


def _from_extremes(scene: Scene) -> Mapping[str, Extreme]:
    """Return the columns of a scene's data sheet that follow from extremes."""
    torques = tuple(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    springs = tuple((name, at, *spring.stiffness) for name, (at, spring) in scene.measured_springs.items())
    named = tuple(scene.output.points), springs, scene.springs is not None
    return _columns_of_extremes(scene.gravity[1], scene.unbalances, torques, *named)


@lru_cache
def _columns_of_extremes(
    gravity: float,
    unbalances: tuple[float, float],
    torques: tuple[float, ...],
    points: tuple[str, ...],
    springs: tuple[tuple[str, int, float, float], ...],
    placed: bool,
) -> Mapping[str, Extreme]:
    """Return them for the numbers of a scene on which they depend: points of a sweep share most of them."""
    columns = {f"foundation_{name}_max_{unit}": Extreme(k) for name, k, _, unit in _AXES}
    columns |= {f"foundation_{name}_amplitude_{unit}": Extreme(k, 0.5, difference=True) for name, k, _, unit in _AXES}
    columns |= {
        "stroke_x_m": Extreme(SIDEWAYS, difference=True),
        "stroke_y_m": Extreme(HEIGHT, difference=True),
        "acceleration_max_m_per_s2": Extreme(ACCELERATION),
        "gamma": Extreme(LIFT, 1.0 / gravity if gravity > 0.0 else math.inf),
    }
    for i, k in enumerate(unbalances):
        columns[f"motor_power_{i + 1}_max_w"] = Extreme(POWER_1 + i)
        columns[f"motor_torque_{i + 1}_max_n_m"] = Extreme(TORQUE_1 + i)
        critical = torques[i]
        columns[f"torque_ratio_{i + 1}_max"] = Extreme(TORQUE_1 + i, 1.0 / critical if critical > 0.0 else math.nan)
        columns[f"bearing_force_{i + 1}_max_n"] = Extreme(SPEED_1 + i, k, squared=True)
    for i, name in enumerate(points):
        first = POINTS + 2 * i
        columns |= {f"stroke_{axis}_{name}_m": Extreme(first + j, difference=True) for j, axis in enumerate("xy")}
        columns[f"acceleration_max_{name}_m_per_s2"] = Extreme(POINT_ACCELERATIONS + i)
    for name, at, *stiffnesses in springs:
        for axis, part in ((1, ""), (0, "x_"))[: 1 + placed]:
            place, stiffness = POINTS + 2 * at + axis, stiffnesses[axis]
            columns[f"spring_force_{part}amplitude_{name}_n"] = Extreme(place, 0.5 * stiffness, difference=True)
            columns[f"spring_force_{part}max_{name}_n"] = Extreme(place, stiffness)
    return {name: extreme._replace(quantity=int(extreme.quantity)) for name, extreme in columns.items()}


def _largest(extremes: Any, columns: Mapping[str, Extreme]) -> dict[str, float | None]:
    """Return the values of columns that follow from extremes; None if a value is not finite."""
    least, largest = extremes["least"].tolist(), extremes["largest"].tolist()
    values: dict[str, float | None] = {}
    for name, (k, factor, difference, squared) in columns.items():
        high, low = largest[k], least[k]
        size = high - low if difference else abs(max(high, -low))
        value = factor * (size * size if squared else size)
        values[name] = value if math.isfinite(value) else None
    return values


def _when(extremes: Mapping[str, Any], column: Extreme, turn: Sequence[Any]) -> tuple[float, float | None]:
    """Return when the value of a column was complete (s), and the pace around then (rad/s).

    Extremes are the fields of their record. The last turn, with its marks as in
    :data:`vibroplat.observe.measures.MARKS`, is not complete. Its pace is that since the turn before began; none if it
    takes longer than two of these, as where the unbalances swing.
    """
    k = column.quantity
    ends = [(float(extremes[f"at_{end}"][k]), float(extremes[f"pace_{end}"][k])) for end in ("least", "largest")]
    end = ends[0] if -extremes["least"][k] > extremes["largest"][k] else ends[1]
    at, speed = max(ends[::-1], key=lambda end: end[0]) if column.difference else end
    (before, *angles), (turn_start, *_), (now, *angles_now) = turn
    if at <= turn_start:
        return at, speed
    # as pace() in extremes.py, which is for kernels: a call from here would compile it by itself
    mean = 0.5 * sum(abs(b - a) for a, b in zip(angles, angles_now, strict=True)) / (now - before)
    return at, mean if now - turn_start <= 2.0 * (turn_start - before) else None


def whole_run(ms: Accumulators, scene: Scene, start: float, slow: Sequence[Any], locked: bool) -> dict[str, Any]:
    """Return the part of a data sheet that concerns a whole run.

    Parameters
    ----------
    start
        When it began (s).
    slow
        Motors that slip as captured ones do, each with its ``speed`` and the ``synchronous`` one (Hz); see
        :func:`vibroplat.report.notes.slow_motors`.
    locked
        Whether the exciters are synchronized in the measured part.
    """
    require(ms, WHOLE_RUN)
    numbers: dict[str, Any] = {}
    extremes, columns, turn = merge_extremes(ms.extremes), _from_extremes(scene), ms.marks["turn"].tolist()
    columns = {name: columns[name] for name in _names_of_largest(columns)}
    fields = dict(zip(extremes.dtype.names, extremes.tolist(), strict=True))
    for name, value in _largest(extremes, columns).items():
        numbers[f"whole_{name}"] = value
        if not name.startswith(TIMED):
            continue
        base, (at, speed) = split(name)[0], _when(fields, columns[name], turn)
        numbers[f"whole_{base}_at_s"] = None if value is None else at
        numbers[f"whole_{base}_at_hz"] = None if value is None or speed is None else speed / TURN
    driven = any(scene.driven(float(ms.marks["window"]), float(ms.marks["until"])))
    numbers["synchronized_at_s"], numbers["start_energy_j"] = (
        synchronization_time(ms, scene, start) if locked and driven else (None, None)
    )
    slowest = min(((motor.speed, motor.synchronous) for motor in slow), default=None)
    return numbers | {"captured_by": _capturing_axis(ms, scene, slowest) if slowest else ""}


def synchronization_time(ms: Accumulators, scene: Scene, start: float) -> tuple[float | None, float | None]:
    """Return the time from which the exciters stay synchronized (s), and the work of the motors until then (J).

    Both are None if the phase difference or a speed left its range during the measured part.
    """
    mean, begin = means(ms), ms.marks["first"][0]
    width, fastest = 1.0 / BINS, FASTEST * scene.speed_scale
    middle = (np.arange(BINS) + 0.5) * width
    away = np.abs(wrap(TURN * middle - math.atan2(mean["sine"], mean["cosine"])))
    outside = [away > math.pi / 3.0]
    for i in (1, 2):
        speed = abs(mean[f"speed_{i}"]) / fastest
        outside.append(np.abs(middle - speed) > STEADY * speed + 0.5 * width)
    met = np.concatenate([seen[there] for seen, there in zip(ms.seen, outside, strict=True)])
    last, work = met[met[:, 0].argmax()]
    if last > begin:
        return None, None
    return (float(last), float(work)) if math.isfinite(last) else (start, 0.0)


def _capturing_axis(ms: Accumulators, scene: Scene, slowest: tuple[float, float]) -> str:
    """Name the axis whose resonance takes the power of motors that turn too slowly, if that is what happens; or "".

    ``slowest`` are the speed of the slowest motor and its synchronous one (Hz).
    """
    mean, rows = means(ms), section_rows(ms)
    quarter, pair = len(rows) // 4, scene.exciter_pair
    if not quarter:
        return ""
    turned = np.diff(rows["state"][[0, quarter, -1 - quarter, -1], 3], axis=0)[[0, 2]]
    paces = np.abs(turned / np.diff(rows["t"][[0, quarter, -1 - quarter, -1]])[[0, 2]])
    speeds = [abs(mean[f"speed_{i}"]) for i in (1, 2)]
    friction = sum(e.friction_radius_m * k * w**3 for e, k, w in zip(pair, scene.unbalances, speeds, strict=True))
    if np.ptp(paces) > RESONANCE_WIDTH * paces.max() or friction > 0.5 * (mean["power_1"] + mean["power_2"]):
        return ""
    modes, low, high = natural_modes(scene), slowest[0] / (1.0 + RESONANCE_WIDTH), slowest[1]
    loaded = modes.inertia + modes.shapes[1] ** 2 * sum(scene.layer_masses)
    near = [
        (low <= np.sqrt(modes.stiffness / one) / TURN) & (np.sqrt(modes.stiffness / one) / TURN < high)
        for one in (modes.inertia, loaded)
    ]
    squares = [mean[square] - mean[axis] ** 2 for axis, square in _SQUARES.items()]
    sizes = np.where(near[0] | near[1], (scene.oscillators[0] * squares) @ modes.fractions, -math.inf)
    return modes.names[int(sizes.argmax())] if sizes.max() > -math.inf else ""
