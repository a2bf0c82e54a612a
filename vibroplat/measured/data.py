"""Measured data laid over results: which columns they are, their shift in time, and how far they differ.

A file is given as ``FILE`` or ``FILE:OURS=THEIRS,…``: columns of results and the names that they have in the file, with
a factor behind a star where units differ, as ``t=Zeit*0.001``. Without a factor, a unit behind the name or in a row of
units counts. ``shift=S`` says that the first sample lies at S seconds of the run, and ``shift=fit`` finds the shift at
which the data differ least from it; ``offset=fit`` takes a constant difference away. Names that hold commas stand in
quotation marks.
"""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
import pandas as pd

from vibroplat.columns import display_name, is_angle, unit_of
from vibroplat.config.digits import given, interval, number, percent, quantity
from vibroplat.config.schema import MAX_SIZE, MINUS, did_you_mean
from vibroplat.errors import TableError
from vibroplat.measured.alignment import (
    FEW_A_TURN,
    Alignment,
    Curve,
    best_shift,
    correlation_of,
    error_of,
    interpolant,
    on_curve,
)
from vibroplat.measured.numbers import numbers_of, seconds_of
from vibroplat.measured.rows import read_rows
from vibroplat.measured.units import GRAVITY, factor_of, split_name, units_of

_LOG = logging.getLogger("vibroplat")

#: Short names of columns; ``ax`` and ``ay`` are accelerations, ``ay_inlet`` is that of the point ``inlet``.
SHORT = {"t": "t_s", "x": "x_m", "y": "y_m", "phi": "phi_rad", "gap": "gap_m"}
_ACCELERATION = re.compile(r"a([xy])(_\w+)?")
#: Times from which on they are those of Unix (s), and factors of the units in which these are large.
UNIX, UNIX_UNITS = 1e8, {1e17: (1e-9, "ns"), 1e14: (1e-6, "µs"), 1e11: (1e-3, "ms")}
#: Factors between measured and computed values that have a meaning, in which columns by the ends of their names, and
#: how near to them one is (relative), and how well the curves must correlate.
KNOWN_FACTORS = (
    (GRAVITY, "_m_per_s2", "is one in m/s² and the other in g?"),
    (np.pi / 30.0, "_rad_per_s", "is one in rad/s and the other in rpm?"),
    (60.0, "_hz", "is one in Hz and the other in rpm?"),
    (1e3, "", "do units differ by 1000?"),
    (-1.0, "", "does the sensor point the other way?"),
)
NEAR_FACTOR, CORRELATED = 0.05, 0.9
#: Constant difference, over the RMS of the measured values, from which on it is told.
TOLD_OFFSET = 0.05


class Comparison(NamedTuple):
    """A column beside a computed curve.

    ``error`` is the RMS of the differences over that of the measured values, ``offset`` the mean difference, ``factor``
    that by which the measured variation is multiplied to be the computed one, ``samples`` those compared and ``share``
    the part of the curve beside which they lie.
    """

    error: float
    offset: float
    factor: float
    correlation: float
    samples: int
    share: float


@dataclass
class Measured:
    """Measured data: their file, and a table whose columns are named as in results.

    ``given`` is the table of the file, indexed by its lines, ``table`` has the selected columns in SI units, by
    ``factors``. ``shift`` is added to their times (s), which then count from the first sample; None until :meth:`fit`
    has found it. ``level`` says that a constant difference does not count. ``compared`` has what was found of each
    column. ``mapped`` says whether the file's columns were named.
    """

    path: Path
    given: pd.DataFrame
    factors: Mapping[str, float] = field(default_factory=dict)
    shift: float | None = 0.0
    level: bool = False
    mapped: bool = False
    notes: list[str] = field(default_factory=list)
    alignment: Alignment | None = None
    compared: dict[str, Comparison | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Show all columns until some are selected."""
        self.table = self.given

    def __str__(self) -> str:
        """Name the file."""
        return str(self.path)

    @property
    def errors(self) -> dict[str, float]:
        """The relative error of each compared column, nan where there is none."""
        return {column: np.nan if found is None else found.error for column, found in self.compared.items()}

    @property
    def is_trajectory(self) -> bool:
        """Whether the file is the trajectory of a run, as it is saved or exported."""
        return not self.mapped and {"t_s", "y_m", "phi1_rad"} <= {*self.given}

    def select(self, x: str, columns: Collection[str], others: Collection[str] = ()) -> Self:
        """Show these columns over ``x``.

        Columns that no figure shows are named in a line, but for ``others``, which further figures would use.

        Raises
        ------
        TableError
            There is no abscissa, nothing to draw, or there are no numbers.
        """
        names = [*map(str, self.given)]
        for wanted, what in (([x], "of the horizontal axis"), (columns, "that a figure shows")):
            if not {*wanted} & {*names}:
                allowed = ", ".join(wanted)
                way = "" if self.mapped else f", or {self.path.name}:NAME=COLUMN with the names of the file"
                raise TableError(f"--data {self}: no column {what} in {', '.join(names)}; allowed: {allowed}{way}")
        if self.shift != 0.0 and x != "t_s":
            raise TableError(f"--data {self}: shift is of data over time; allowed: with a run")
        curves = {}
        for column in [name for name in names if name in {x, *columns}]:
            numbers = pd.to_numeric(self.given[column], errors="coerce").astype(float)
            if len(wrong := self.given[column][~(numbers.abs() <= MAX_SIZE)].dropna()):
                allowed = f"numbers such as 0.5 up to {MAX_SIZE:g}, or nothing"
                first = wrong.iloc[0]
                where = f"{repr(first) if isinstance(first, str) else f'{first:g}'} in line {wrong.index[0]}"
                raise TableError(f"--data {self}: column {column} holds {where}; allowed: {allowed}")
            curves[column] = numbers * self.factors.get(column, 1.0) + ((self.shift or 0.0) if column == "t_s" else 0.0)
        if left := [name for name in names if name not in {x, *columns, *others}]:
            _LOG.warning("--data %s: not drawn: %s", self, ", ".join(left))
        self.table = pd.DataFrame(curves)
        return self

    def from_rest(self, rest: float) -> None:
        """Count the heights of a trajectory from the static rest, as measured ones are."""
        self.given = self.given.assign(y_m=self.given["y_m"].map(lambda y: y if isinstance(y, str) else y - rest))

    def fit(self, simulated: pd.DataFrame) -> None:
        """Find the shift in time, if it is not known, by the column with most values that a trajectory has as well."""
        if self.shift is None:
            columns = [column for column in map(str, self.table) if column in simulated and column != "t_s"]
            measured = [(curve_of(self.table, column), column) for column in columns]
            curve, column = max(measured, key=lambda of: len(of[0][0]))
            try:
                self.alignment = best_shift(curve, curve_of(simulated, column), offset=self.level)
            except TableError as error:
                raise TableError(f"--data {self}: column {column}: {error}") from None
            self.shift = self.alignment.shift
            self.table = self.table.assign(t_s=self.table["t_s"] + self.shift)

    def interval_in(self, whole: pd.DataFrame) -> tuple[float | None, float | None]:
        """Find the shift in a whole run if it is not known, and the interval that is covered; else (None, None)."""
        numbers = [column for column in map(str, whole.select_dtypes("number")) if column != "t_s"]
        if "t_s" not in self.given or not {*numbers} & {*map(str, self.given)}:
            return None, None
        selected = replace(self, compared={}).select("t_s", numbers, [*map(str, self.given)])
        selected.fit(whole)
        self.shift, self.alignment = selected.shift, selected.alignment
        inside = selected.table["t_s"][selected.table["t_s"].between(whole["t_s"].iloc[0], whole["t_s"].iloc[-1])]
        return (float(inside.min()), float(inside.max())) if inside.min() < inside.max() else (None, None)

    def compare(self, column: str, x: str, curves: Collection[Curve]) -> None:
        """Store how a column differs from the nearest of some curves over ``x``, unless that is known."""
        if {x, column} <= {*self.table.columns} and column not in (x, *self.compared):
            compared = () if is_angle(column) else curves
            measured = curve_of(self.table, column, x)
            found = [comparison_of(measured, curve, level=self.level, smooth=x == "t_s") for curve in compared]
            known = [one for one in found if one is not None]
            nearest = min(known, key=lambda one: one.error, default=None)
            self.compared[column] = nearest
            if self.level and nearest is not None:
                self.table = self.table.assign(**{column: self.table[column] - nearest.offset})

    def difference(self, column: str) -> str:
        """Return the error of a column as text; "" if it was not compared with a computed curve."""
        found = self.compared.get(column)
        return "" if found is None else f"differs by {percent(found.error)}"

    def differences(self) -> list[str]:
        """Return the errors of all columns as text."""
        texts = {column: self.difference(column) for column in self.compared}
        return [f"{display_name(column)} {text}" for column, text in texts.items() if text]

    @property
    def shifted(self) -> str:
        """How far the data were shifted, as it can be given again, and which shifts are as good; "" if they are not."""
        if not self.shift:
            return ""
        text = f"shifted by {given(self.shift).replace('-', '−')} s"
        found = self.alignment
        if found is None or len(found.alike) < 2:
            return text
        ends, more = interval(float(found.alike[0]), float(found.alike[-1]), "s"), " or more" * found.more
        return f"{text}, of {len(found.alike)}{more} shifts, {ends}, that differ as little"

    def lines(self) -> list[str]:
        """Say how all columns differ, how far the data were shifted, and what may be wrong with them."""
        lines = [f"{display_name(column)} {self._line(column)}" for column in self.compared]
        lines += self.notes
        if self.alignment is not None and (each := self.alignment.samples_a_turn) < FEW_A_TURN:
            lines.append(f"{number(each, 2)} samples a turn are too few to tell one shift from others for sure")
        for column, found in self.compared.items():
            if found is not None:
                lines += self._doubts(column, found)
        return [f"{self.path.name}: {line}" for line in lines]

    def _line(self, column: str) -> str:
        """Say how a column differs, or why it is not compared."""
        found = self.compared[column]
        if found is None and is_angle(column):
            return "is not compared: it is an angle, whose zero is arbitrary, and has no relative error"
        if found is None:
            return "is not compared: fewer than two of its values lie beside a curve, or all are 0"
        count = int(self.table[column].notna().sum())
        where = f"{found.samples} of {count} samples, {percent(found.share)} of the curve"
        shift = f"; {self.shifted}" if self.shifted else ""
        return f"{self.difference(column)} (RMS of the difference / RMS of the measured values) in {where}{shift}"

    def _doubts(self, column: str, found: Comparison) -> Iterator[str]:
        """Say which factor or constant difference there is between measured and computed values."""
        name = display_name(column)
        for factor, end, question in KNOWN_FACTORS if abs(found.correlation) > CORRELATED else ():
            ratios = found.factor / factor, found.factor * factor
            if column.endswith(end) and any(abs(ratio - 1.0) < NEAR_FACTOR for ratio in ratios):
                yield f"{name} is {number(1.0 / found.factor, 3)} times the computed one: {question}"
                return
        if abs(found.offset) > TOLD_OFFSET * (abs(found.offset) + float(self.table[column].std())):
            near = column.startswith("acceleration") and abs(abs(found.offset) / GRAVITY - 1.0) < NEAR_FACTOR
            away = quantity(found.offset, unit_of(column))
            way = "was taken away" if self.level else "offset=fit takes it away"
            yield f"{name} has a constant difference of {away}{': gravity in the sensor?' * near}; {way}"


def curve_of(table: pd.DataFrame, column: str, x: str = "t_s") -> Curve:
    """Return a column over another, where both are known, in ascending order.

    Both rows of an event have its time; the second one comes behind the first by the smallest number there is.
    """
    known = table[[x, column]].dropna().sort_values(x, kind="stable").to_numpy(dtype=float)
    places, values = known[:, 0].copy(), known[:, 1]
    for row in np.flatnonzero(np.diff(places) == 0.0) + 1 if x == "t_s" else ():
        places[row] = np.nextafter(places[row - 1], np.inf)
    return places, values


def comparison_of(measured: Curve, computed: Curve, *, level: bool = False, smooth: bool = False) -> Comparison | None:
    """Compare measured values with a curve, where they lie beside it; None if fewer than two do, or all are 0."""
    inside = on_curve(measured, computed)
    x, values, places = measured[0][inside], measured[1][inside], computed[0]
    if len(x) < 2:
        return None
    curve = interpolant(computed)(x) if smooth else np.interp(x, *computed)
    offset = float((values - curve).mean())
    error = error_of(values - offset * level, curve)
    if error is None:
        return None
    correlation = correlation_of(values, curve)
    factor = correlation * float(curve.std() / values.std()) if correlation else 1.0
    share = float(np.ptp(x)) / (float(np.ptp(places)) or 1.0)
    return Comparison(error, offset, factor, correlation, len(x), min(share, 1.0))


# -- files -------------------------------------------------------------------------------------------------------------


def read_data(given: str | Path) -> Measured:
    """Read a file of measured data, with its mapping if there is one.

    Raises
    ------
    TableError
        The file cannot be read, or the mapping is not one.
    """
    path, mapping = _split(str(given))
    try:
        names, units, rows = read_rows(path)
        columns = numbers_of([[row.texts[k] if k < len(row.texts) else "" for row in rows] for k in range(len(names))])
    except TableError as error:
        raise TableError(f"--data {path}: {error}") from None
    except FileNotFoundError:
        raise TableError(f"--data {path}: there is no such file") from None
    except Exception as error:  # damaged workbooks raise many kinds
        raise TableError(f"--data {path} cannot be read: {' '.join(str(error).split())}") from None
    lines = [row.line for row in rows]
    table = pd.DataFrame({name: pd.Series(of, lines, object) for name, of in zip(names, columns, strict=True)})
    return _mapped(path, mapping, table.infer_objects(), dict(zip(names, units, strict=True)))


def _split(given: str) -> tuple[Path, str]:
    """Split a file from its mapping: at the first colon behind the name of a file that there is, else at the last."""
    if Path(given).exists():
        return Path(given), ""
    for match in re.finditer(":", given):
        file, mapping = given[: match.start()], given[match.end() :]
        if "=" in mapping and Path(file).exists():
            return Path(file), mapping
    file, _, mapping = given.rpartition(":")
    return (Path(file), mapping) if "=" in mapping else (Path(given), "")


def _mapped(path: Path, mapping: str, table: pd.DataFrame, units: Mapping[str, str]) -> Measured:
    """Return the columns of a file that a mapping names, as it names and scales them; raises TableError."""
    known = [*map(str, table)]
    bare = {split_name(name)[0]: name for name in known} | {name: name for name in known}
    data = Measured(path, pd.DataFrame(index=table.index), mapped=bool(mapping))
    columns: dict[str, tuple[str, float | None]] = {} if mapping else {name: (name, None) for name in known}
    counted = False
    for entry in next(csv.reader([mapping])) if mapping else ():
        ours, _, theirs = (part.strip() for part in entry.partition("="))
        scaled = "*" in theirs and theirs not in bare
        name, _, factor = theirs.rpartition("*") if scaled else (theirs, "", "")
        try:
            if ours == "shift":
                data.shift, counted = None if theirs == "fit" else _number(theirs), True
                continue
            if ours == "offset" and theirs == "fit":
                data.level = True
                continue
            name, scale = name.strip(), _number(factor) if scaled else None
        except ValueError:
            allowed = "COLUMN=NAME, COLUMN=NAME*FACTOR, shift=SECONDS, shift=fit, offset=fit"
            raise TableError(f"--data {path}: {entry!r} in the mapping; allowed: {allowed}") from None
        if name not in bare:
            allowed = f"{did_you_mean(name, [*bare])}allowed: {', '.join(known)}"
            raise TableError(f"--data {path}: {ours}={name}: no such column in the file; {allowed}")
        if match := _ACCELERATION.fullmatch(ours):
            ours = f"acceleration_{match[1]}{match[2] or ''}_m_per_s2"
        columns[SHORT.get(ours, ours)] = bare[name], scale
    factors = {}
    for column, (name, scale) in columns.items():
        factors[column] = _of_unit(data, column, name, units[name]) if scale is None else scale
        data.given[column] = table[name]
    if "t_s" in data.given and data.given["t_s"].notna().any():
        data.given["t_s"] = _times(data, data.given["t_s"], factors.pop("t_s"), counted=counted)
    data.factors, data.table = factors, data.given
    return data


def _of_unit(data: Measured, column: str, name: str, unit: str) -> float:
    """Return the factor of the unit of a column of a file: of a row of units, or behind its name."""
    unit = unit or split_name(name)[1]
    if unit in ("", "-", "1"):
        return 1.0
    factor = factor_of(column, unit)
    if factor is None and (units := units_of(column)):
        raise TableError(
            f"--data {data}: {column}={name} is in {unit}; allowed: {', '.join(units)}, or another with a factor, "
            f"as {name}*0.001"
        )
    if factor not in (None, 1.0):
        data.notes.append(f"{name} is in {unit}: multiplied by {given(factor)}")
    return factor or 1.0


def _times(data: Measured, column: pd.Series, factor: float, *, counted: bool) -> pd.Series:
    """Return times (s), from the first sample if they are dates or ``counted`` from there; raises TableError."""
    texts = [text if isinstance(text, str) else "" for text in column]
    dates = seconds_of(texts) if any(texts) else None
    if dates is None and any(texts):
        return column  # which is told where it is selected
    times = pd.Series(column.to_numpy(dtype=float) if dates is None else dates, column.index)
    first = float(times.dropna().iloc[0])
    unix = dates is None and abs(first) * factor > UNIX
    if unix and factor == 1.0:
        factor, unit = next((of for size, of in UNIX_UNITS.items() if abs(first) > size), (1.0, "s"))
        data.notes.append(f"times are taken as {unit} since 1970")
    if dates is not None or unix or counted:
        times = times - first
    if (dates is not None or unix) and not counted:
        data.notes.append("time counts from the first sample; shift=fit finds where it lies in the run")
    return _spread(data, times * factor if dates is None else times)


def _spread(data: Measured, times: pd.Series) -> pd.Series:
    """Spread samples of packets, which have one time, up to the next time; raises TableError where times go back."""
    known = times.dropna()
    steps = np.diff(known)
    if len(steps) and (steps <= 0.0).all():
        return times  # the newest first
    if (back := np.flatnonzero(steps < 0.0)).size:
        line = known.index[back[0] + 1]
        raise TableError(f"--data {data}: time goes back in line {line}; allowed: one record, in ascending order")
    stamps, begins, counts = np.unique(known, return_index=True, return_counts=True)
    if len(stamps) < 2 or np.median(counts) == 1.0:  # two rows of one time are an event
        return times
    lengths = np.append(np.diff(stamps), 0.0)
    lengths[-1] = lengths[-2] / counts[-2] * counts[-1]
    within = np.arange(len(known)) - np.repeat(begins, counts)
    data.notes.append(f"up to {counts.max()} samples have one time: they are spread evenly up to the next one")
    return (known + within * np.repeat(lengths / counts, counts)).reindex(times.index)


def _number(text: str) -> float:
    """Return a finite number, which may have a minus sign as lines have it; raises ValueError."""
    if not abs(value := float(text.replace(MINUS, "-"))) <= MAX_SIZE:
        raise ValueError
    return value
