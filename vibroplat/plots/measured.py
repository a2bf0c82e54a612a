"""Measured data overlaid on figures: files as spreadsheets write them, mapped, shifted and compared.

A file is given as ``FILE`` or ``FILE:OURS=THEIRS,…``: columns of results and the names that they have in the file, with
a factor behind a star where units differ, as ``t=Zeit*0.001``. ``shift=S`` adds S seconds to the times in the file, and
``shift=fit`` finds the shift at which the data differ least from a run. Names that hold commas stand in quotation
marks.
"""

from __future__ import annotations

import csv
import io
import logging
import re
import stat
import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd

from vibroplat.columns import display_name, is_angle
from vibroplat.config.digits import NEGLIGIBLE, given, interval, percent
from vibroplat.config.schema import MAX_SIZE, did_you_mean
from vibroplat.errors import TableError
from vibroplat.results.labels import is_number, plain
from vibroplat.results.picture import BLACK, on_axis
from vibroplat.system.memory import size_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LOG = logging.getLogger("vibroplat")

FloatArray = np.ndarray[Any, np.dtype[np.float64]]
#: A curve: abscissae in ascending order, and values.
Curve = tuple[FloatArray, FloatArray]

#: Largest file that is read (bytes).
MAX_BYTES = 2**26
#: Most samples of measured data that are correlated.
MOST_SAMPLES = 2**24
#: Most measured points that are drawn large.
MOST_LARGE = 100
#: Short names of columns; ``ax`` and ``ay`` are accelerations, ``ay_inlet`` is that of the point ``inlet``.
SHORT = {"t": "t_s", "x": "x_m", "y": "y_m", "phi": "phi_rad", "gap": "gap_m"}
_ACCELERATION = re.compile(r"a([xy])(_\w+)?")
#: A correlation this much below the best one is nearly as good, as in periodic motion; maximum number of values that
#: are compared at all such shifts, and minimum number of these; and the unit of fitted shifts (s).
ALIKE, MOST_COMPARED, LEAST_TOPS, TICK = 2e-3, 10**7, 10, 1e-5


@dataclass
class Measured:
    """Measured data: their file, and a table whose columns are named as in results.

    ``given`` is the table of the file, ``table`` has the selected columns in SI units, by ``factors``. ``shift`` is
    added to their times (s); None until :meth:`fit` has found it, and ``alike`` are shifts that are as good.
    ``errors`` has the relative error of each column that was compared with a curve.
    """

    path: Path
    given: pd.DataFrame
    factors: Mapping[str, float] = field(default_factory=dict)
    shift: float | None = 0.0
    alike: FloatArray = field(default_factory=lambda: np.zeros(0))
    errors: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Show all columns until some are selected."""
        self.table = self.given

    def __str__(self) -> str:
        """Name the file."""
        return str(self.path)

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
                raise TableError(f"--data {self}: no column {what} in {', '.join(names)}; allowed: {allowed}")
        if self.shift != 0.0 and x != "t_s":
            raise TableError(f"--data {self}: shift is of data over time; allowed: with a run")
        curves = {}
        for column in [name for name in names if name in {x, *columns}]:
            given = self.given[column]
            numbers = pd.to_numeric(given, errors="coerce").astype(float)  # 1e19 in full digits is an object
            if wrong := given[~(numbers.abs() <= MAX_SIZE)].dropna().tolist():
                allowed = f"numbers such as 0.5 up to {MAX_SIZE:g}, or nothing"
                raise TableError(f"--data {self}: column {column} holds {wrong[0]!r}; allowed: {allowed}")
            curves[column] = numbers * self.factors.get(column, 1.0) + ((self.shift or 0.0) if column == "t_s" else 0.0)
        if left := [name for name in names if name not in {x, *columns, *others}]:
            _LOG.warning("--data %s: not drawn: %s", self, ", ".join(left))
        self.table = pd.DataFrame(curves)
        return self

    def fit(self, simulated: pd.DataFrame) -> None:
        """Find the shift in time, if it is not known, by the column with most values that a trajectory has as well."""
        if self.shift is None:
            columns = [column for column in map(str, self.table) if column in simulated and column != "t_s"]
            measured = [(curve_of(self.table, column), column) for column in columns]
            curve, column = max(measured, key=lambda of: len(of[0][0]))
            self.shift, self.alike = best_shift(curve, curve_of(simulated, column))
            self.table = self.table.assign(t_s=self.table["t_s"] + self.shift)

    def interval_in(self, whole: pd.DataFrame) -> tuple[float | None, float | None]:
        """Find the shift in a whole run if it is not known, and the interval that is covered; else (None, None)."""
        numbers = [column for column in map(str, whole.select_dtypes("number")) if column != "t_s"]
        if "t_s" not in self.given or not {*numbers} & {*map(str, self.given)}:
            return None, None
        selected = replace(self, errors={}).select("t_s", numbers, [*map(str, self.given)])
        selected.fit(whole)
        self.shift, self.alike = selected.shift, selected.alike
        inside = selected.table["t_s"][selected.table["t_s"].between(whole["t_s"].iloc[0], whole["t_s"].iloc[-1])]
        return (float(inside.min()), float(inside.max())) if inside.min() < inside.max() else (None, None)

    def compare(self, column: str, x: str, curves: Collection[Curve]) -> None:
        """Store the error of a column relative to the nearest of some curves over ``x``, unless it is known."""
        if {x, column} <= {*self.table.columns} and column not in (x, *self.errors):
            compared = () if is_angle(column) else curves
            errors = [relative_error(curve_of(self.table, column, x), curve) for curve in compared]
            self.errors[column] = min((error for error in errors if error is not None), default=np.nan)

    def difference(self, column: str) -> str:
        """Return the error of a column as text; "" if it was not compared with a computed curve."""
        return f"differs by {percent(error)}" if np.isfinite(error := self.errors.get(column, np.nan)) else ""

    def differences(self) -> list[str]:
        """Return the errors of all columns as text."""
        texts = {column: self.difference(column) for column in self.errors}
        return [f"{display_name(column)} {text}" for column, text in texts.items() if text]

    @property
    def shifted(self) -> str:
        """How far the data were shifted, as it can be given again, and which shifts are as good; "" if they are not."""
        if not self.shift:
            return ""
        text = f"shifted by {given(self.shift).replace('-', '−')} s"
        if len(self.alike) < 2:
            return text
        ends = interval(float(self.alike[0]), float(self.alike[-1]), "s")
        return f"{text}, of {len(self.alike)} shifts, {ends}, that differ as little"

    def lines(self) -> list[str]:
        """Say the errors of all columns, and how far the data were shifted."""
        shift = f"; {self.shifted}" if self.shifted else ""
        what = "(RMS of the difference / RMS of the measured values)"
        nothing = "is not compared: fewer than two of its values lie beside a curve, or all are 0"
        angle = "is not compared: it is an angle, whose zero is arbitrary, and has no relative error"
        reasons = {column: angle if is_angle(column) else nothing for column in self.errors}
        texts = {column: self.difference(column) for column in self.errors}
        lines = {column: f"{text} {what}" if text else reasons[column] for column, text in texts.items()}
        return [f"{self.path.name}: {display_name(column)} {line}{shift}" for column, line in lines.items()]

    def draw(self, axis: Axes, x: str, column: str) -> None:
        """Draw a column over another where the data have both, in black diamonds, smaller ones if they are many.

        Over time, data outside of the range of all drawn curves are left out.
        """
        if {x, column} <= {*self.table.columns}:
            low, high = axis.dataLim.intervalx if x == "t_s" else (-np.inf, np.inf)
            table = self.table[self.table[x].between(low, high)]
            size, edge = (4.0, 1.0) if len(table) <= MOST_LARGE else (2.0, 0.5)
            look: dict[str, Any] = {"color": BLACK, "mfc": "white", "ms": size, "mew": edge, "zorder": 5.0, "ls": ""}
            label = ", ".join([f"measured: {plain(self.path.name)}", *self.differences()])
            axis.plot(table[x], on_axis(column, table[column]), marker="D", label=label, **look)


def curve_of(table: pd.DataFrame, column: str, x: str = "t_s") -> Curve:
    """Return a column over another, where both are known, in ascending order."""
    known = table[[x, column]].dropna().sort_values(x, kind="stable").to_numpy(dtype=float)
    return known[:, 0], known[:, 1]


def relative_error(measured: Curve, computed: Curve) -> float | None:
    """Return the RMS of the difference of a curve and measured values divided by the RMS of these; None without two.

    The curve is interpolated linearly; measured values outside of its range do not count.
    """
    (x, values), (places, curve) = measured, computed
    inside = (x >= places[0]) & (x <= places[-1]) if len(places) else np.zeros(len(x), dtype=bool)
    square = float(np.square(values[inside]).sum())
    if inside.sum() < 2 or square == 0.0:
        return None
    return float(np.sqrt(np.square(np.interp(x[inside], places, curve) - values[inside]).sum() / square))


def best_shift(measured: Curve, computed: Curve) -> tuple[float, FloatArray]:
    """Find the shift in time (s) at which a measured curve differs least from a computed one.

    Both are sampled at the median interval of the computed samples. The shorter one slides along the longer one, and
    the correlation coefficient is computed where they overlap. Its maxima are refined by a parabola through three
    samples. Among those that are nearly the highest, the shift with the smallest error is chosen; among equal errors,
    the smallest shift. It is refined to the best correlation with the interpolated curve, in units of :data:`TICK`.

    Returns
    -------
    shift, alike
        The shift, and all shifts whose error has the same printed digits, in ascending order.

    Raises
    ------
    TableError
        Nothing to compare, or a curve of one value.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  (few figures need it)

    shifts, errors, step = _tops_of(measured, computed)
    equal = np.square(errors) <= np.square(errors.min()) + NEGLIGIBLE**2
    shift = float(shifts[equal][np.abs(shifts[equal]).argmin()])
    alike = shifts[equal | [percent(error) == percent(errors.min()) for error in errors.tolist()]]
    times, values = measured
    if np.ptp(values) > 0.0:

        def unlike(at: float) -> float:
            return -float(np.corrcoef(np.interp(times + at, *computed), values)[0, 1])

        shift = float(minimize_scalar(unlike, bounds=(shift - step, shift + step), options={"xatol": 0.1 * TICK}).x)
    return round(shift / TICK) * TICK, alike


def _tops_of(measured: Curve, computed: Curve) -> tuple[FloatArray, FloatArray, float]:
    """Return shifts at which a measured curve correlates nearly best with a computed one, their errors, and a step."""
    shifts, total = _correlation(measured, computed)
    padded = np.pad(total, 1, constant_values=-np.inf)
    tops = np.flatnonzero((total >= padded[:-2]) & (total >= padded[2:]) & (total >= total.max() - ALIKE))
    most = max(MOST_COMPARED // len(measured[0]), LEAST_TOPS)
    highest = np.sort(tops[(-total[tops]).argsort(kind="stable")[:most]])
    offsets = np.unique([_top(shifts, total, index) for index in highest.tolist()])
    errors = [relative_error((measured[0] + shift, measured[1]), computed) for shift in offsets.tolist()]
    step = float(np.abs(np.diff(shifts[:2])).sum())
    return offsets, np.array([np.inf if error is None else error for error in errors]), step


def _top(shifts: FloatArray, total: FloatArray, index: int) -> float:
    """Return where the parabola through a sample and its two neighbours is highest."""
    if not 0 < index < len(total) - 1:
        return float(shifts[index])
    before, here, after = total[index - 1 : index + 2]
    bend = before - 2.0 * here + after
    part = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(shifts[index] + part * (shifts[index + 1] - shifts[index]))


def _correlation(measured: Curve, computed: Curve) -> tuple[FloatArray, FloatArray]:
    """Return shifts of a measured curve, and the coefficient of correlation with a computed one at each."""
    from scipy.signal import correlate  # noqa: PLC0415  (takes half a second, and few figures need it)

    if not len(measured[0]) > 1:
        raise TableError("--data: shift=fit needs values over time; allowed: shift=S in seconds")
    step, span = float(np.median(np.diff(np.unique(computed[0])))), float(np.ptp(measured[0]))
    if span > MOST_SAMPLES * step:
        raise TableError(f"--data: times span {span:g} s; allowed with shift=fit: seconds, as by t=NAME*0.001")
    grids = [np.arange(times[0], times[-1] + 1e-9 * step, step) for times, _ in (measured, computed)]
    sampled = [np.interp(grid, *curve) for grid, curve in zip(grids, (measured, computed), strict=True)]
    longer_is_measured = len(grids[0]) > len(grids[1])
    (first, one), (second, other) = sorted(zip(grids, sampled, strict=True), key=lambda of: len(of[0]))
    start, count, one, other = second[0] - first[0], len(one), one - one.mean(), other - other.mean()
    products = correlate(other, one, "valid", "fft")
    sums, squares = (np.concatenate([[0.0], np.cumsum(values)]) for values in (other, other * other))
    spread = (squares[count:] - squares[:-count]) - (sums[count:] - sums[:-count]) ** 2 / count
    scale = np.sqrt(np.maximum(spread, 1e-12 * squares[-1]) * float(one @ one))
    total = np.divide(products, scale, out=np.zeros_like(scale), where=scale > 0.0)
    if not np.any(total):
        raise TableError("--data: shift=fit finds nothing to correlate; allowed: shift=S in seconds")
    return (start + step * np.arange(len(total))) * (-1.0 if longer_is_measured else 1.0), total


# -- files -------------------------------------------------------------------------------------------------------------


def read_data(given: str | Path) -> Measured:
    """Read a file of measured data, with its mapping if there is one.

    Raises
    ------
    TableError
        The file cannot be read, or the mapping is not one.
    """
    file, _, mapping = str(given).rpartition(":")
    if "=" not in mapping or Path(given).exists():
        file, mapping = str(given), ""
    path = Path(file)
    try:
        table = _read_csv(_text(path))
    except TableError:
        raise
    except FileNotFoundError:
        raise TableError(f"--data {path}: there is no such file") from None
    except pd.errors.ParserWarning:
        allowed = "names of all columns first, and decimal points, or ; between columns"
        raise TableError(f"--data {path}: rows have more values than the first line; allowed: {allowed}") from None
    except Exception as error:  # pandas raises many kinds on damaged files
        raise TableError(f"--data {path} cannot be read: {' '.join(str(error).split())}") from None
    table.columns = table.columns.map(lambda name: str(name).strip())
    return _mapped(path, mapping, table) if mapping else Measured(path, table)


def _mapped(path: Path, mapping: str, table: pd.DataFrame) -> Measured:
    """Return the columns of a file that a mapping names, as it names and scales them; raises TableError."""
    columns, known = dict[str, Any](), [*map(str, table)]
    factors: dict[str, float] = {}
    shift: float | None = 0.0
    for entry in next(csv.reader([mapping])):
        ours, _, theirs = (part.strip() for part in entry.partition("="))
        scaled = "*" in theirs and theirs not in known
        name, _, factor = theirs.rpartition("*") if scaled else (theirs, "", "1")
        try:
            if ours == "shift":
                shift = None if theirs == "fit" else _number(theirs)
                continue
            name, scale = name.strip(), _number(factor)
        except ValueError:
            allowed = "COLUMN=NAME, COLUMN=NAME*FACTOR, shift=SECONDS, shift=fit"
            raise TableError(f"--data {path}: {entry!r} in the mapping; allowed: {allowed}") from None
        if name not in known:
            allowed = f"{did_you_mean(name, known)}allowed: {', '.join(known)}"
            raise TableError(f"--data {path}: {ours}={name}: no such column in the file; {allowed}")
        if match := _ACCELERATION.fullmatch(ours):
            ours = f"acceleration_{match[1]}{match[2] or ''}_m_per_s2"
        column = SHORT.get(ours, ours)
        columns[column], factors[column] = table[name], scale
    return Measured(path, pd.DataFrame(columns), factors, shift)


def _number(text: str) -> float:
    """Return a finite number, which may have a minus sign as lines have it; raises ValueError."""
    if not abs(value := float(text.replace("−", "-"))) <= MAX_SIZE:
        raise ValueError
    return value


def _text(path: Path) -> str:
    """Read the text of a regular file: UTF-8 or UTF-16 with a mark at its beginning, UTF-8, or else Windows' 1252."""
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        raise TableError(f"--data {path} is no regular file; allowed: a CSV file")
    if state.st_size > MAX_BYTES:
        raise TableError(f"--data {path} has {size_text(state.st_size)}; allowed: at most {size_text(MAX_BYTES)}")
    data = path.read_bytes()
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    if "\0" in text:
        raise TableError(f"--data {path} is no text; allowed: a CSV file, as spreadsheets save it")
    return text


def _read_csv(text: str) -> pd.DataFrame:
    """Read CSV: columns between commas, or as the first two lines have them ; or tabs, and then also decimal commas.

    A first line ``sep=;`` says so alone. A row with too many values is a ParserWarning: it has decimal commas, or lines
    are not what they seem.
    """
    text = re.sub(r"\Asep=.\r?\n", "", text)
    lines = text.splitlines()[:2]
    separator = next((sign for sign in (";", "\t") if all(sign in line for line in lines)), ",")
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        look: dict[str, Any] = {"index_col": False, "skipinitialspace": True}
        signs = ".," if separator != "," else "."
        tables: list[pd.DataFrame] = [
            pd.read_csv(io.StringIO(text), sep=separator, decimal=sign, **look) for sign in signs
        ]
    return max(tables, key=lambda table: sum(is_number(table[column]) for column in table))
