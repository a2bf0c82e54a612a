"""What of a table has content for a figure: panels of measures, states of points, rows that belong together."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from vibroplat.columns import PHASE_COLUMN, display_name, unit_of
from vibroplat.config import digits
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results.files import SavedFiles, directory_of
from vibroplat.results.labels import EXCITATION, is_number
from vibroplat.results.picture import FULL, HALF, LOST, OPEN, Panel, Places
from vibroplat.results.result import Result

#: Measures that pictures show, one panel each, in this order.
DRAWN = (
    *("rms_y_m", PHASE_COLUMN, "gap_max_m", "contact_force_max_n", "motor_power_w", "flight_fraction"),
    *("conveying_speed_m_per_s", "impulse_max_n_s", "rms_x_m", "rms_phi_rad", "lyapunov_per_s"),
)
#: Least range of an axis of RMS, relative to the largest RMS: small quantities are drawn small.
LEAST_RANGE = 0.02
#: Range of a measure relative to its size up to which its value is written, not drawn.
STEADY = 2e-3
#: Distance of a phase difference from 0 and from π up to which strips of synchronization say it all (rad), and the
#: fraction of points that may lie farther away.
IN_STEP, APART = np.radians(10.0), 0.05


def fills(table: pd.DataFrame, column: str) -> bool:
    """Whether a table has numbers in a column."""
    return column in table and is_number(table[column]) and bool(table[column].notna().any())


def axes_of(table: pd.DataFrame, columns: Iterable[str]) -> list[str]:
    """Return those of some columns that points may be drawn over, numbers that vary, in their order."""
    given = [name for name in dict.fromkeys(columns) if name in table and is_number(table[name])]
    return [name for name in given if len(table[name].dropna().unique()) > 1] or given[:1]


def content_of(table: pd.DataFrame, columns: Iterable[str], *, stripped: bool = False) -> dict[str, str]:
    """Return for columns that a table fills what is told of each instead of a panel; "" for those that are drawn.

    Nothing is drawn of what is at most 1/1000 of the largest of its kind, or hardly varies. Where strips say how
    exciters synchronize (``stripped``), that holds for phase differences near 0 and π.
    """
    known = [name for name in dict.fromkeys(columns) if fills(table, name)]
    moved = _largest_rms(table)
    content = {}
    for name in known:
        values, words, unit = table[name].dropna().astype(float), display_name(name), unit_of(name)
        size, middle = float(values.abs().max()), float(values.mean())
        if name == PHASE_COLUMN:
            if "sync" in table:  # others have no phase difference
                values = values[table["sync"].loc[values.index] != "none"]
            near = float((np.abs(np.angle(np.exp(2j * values))) / 2.0 <= IN_STEP).mean()) if len(values) else 0.0
            words = f"Δφ (within 10° of 0° or 180° at {digits.percent(near)} of the synchronous points)"
            content[name] = words if stripped and near >= 1.0 - APART else ""
        elif size <= (digits.NEGLIGIBLE * moved if name.startswith("rms_") else 0.0):
            content[name] = f"{words} 0"
        elif len(values) > 1 and float(np.ptp(values)) < STEADY * abs(middle):
            content[name] = f"{words} {digits.quantity(middle, unit)}"
        elif len(values) == 1 < len(table):
            content[name] = f"{words} {digits.quantity(float(values.iloc[0]), unit)} at one point"
        else:
            content[name] = ""
    return content


def _largest_rms(table: pd.DataFrame) -> float:
    sizes = (float(table[name].abs().max()) for name in table if str(name).startswith("rms_"))
    return max((size for size in sizes if np.isfinite(size)), default=0.0)


def measures(
    table: pd.DataFrame,
    columns: Iterable[str] = DRAWN,
    asked: Sequence[str] = (),
    *,
    kept: Collection[str] = (),
    stripped: bool = False,
) -> tuple[list[Panel], str]:
    """Return the panels of columns that have content, at least one, or of those that are asked for, and what is left.

    Those that are ``kept`` have one in any case. What is small is drawn small.
    """
    columns = [*dict.fromkeys(asked or columns)]
    texts = content_of(table, columns, stripped=stripped)
    shown = [*asked] or [name for name, one in texts.items() if not one or name in kept] or [*texts][:1] or columns[:1]
    ends = dict.fromkeys(("gap_max_m", "contact_force_max_n"), 0.0) | {"flight_fraction": 1.0}
    ends |= {name: LEAST_RANGE * _largest_rms(table) for name in columns if name.startswith("rms")}
    left = ", ".join(text for name, text in texts.items() if name not in shown)
    return [Panel(name, least=ends.get(name)) for name in shown], left and f"not drawn: {left}"


def states_of(open_: Any, failed: Any = False, undecided: Any = False) -> Places:
    """Return the states of points from what is so of each."""
    states = np.where(np.asarray(undecided, dtype=bool), HALF, np.where(np.asarray(open_, dtype=bool), OPEN, FULL))
    return np.where(np.asarray(failed, dtype=bool), LOST, states)


def motions_of(table: pd.DataFrame) -> Places:
    """Return the states of points by what is known of their motion."""
    motion = table["motion"] if "motion" in table else pd.Series("periodic", table.index)
    failed = table["outcome"] != "ok" if "outcome" in table else table.get(EXCITATION, motion).isna()
    return states_of(motion != "periodic", failed, motion == "undecided")


def in_groups(table: pd.DataFrame, keys: Sequence[str]) -> Iterator[pd.DataFrame]:
    """Yield the rows of a table that share keys, in its order."""
    yield from (rows for _, rows in table.groupby([*keys], sort=False, dropna=False))


def rows_of(chosen: Any) -> Places:
    """Return the places at which something is so."""
    return np.flatnonzero(np.asarray(chosen, dtype=bool))


def rows_in(result: Result, name: str, *columns: Collection[str]) -> pd.DataFrame:
    """Return a table of a result, with these columns as :meth:`Result.columns` has them, and one row or more."""
    table = result.columns(name, *columns)
    if table.empty:
        where = result.directory or result.name
        raise TableError(f"{where} holds an empty {name} table; there is nothing to plot")
    return table


def beside(result: Result, command: str, name: str) -> pd.DataFrame | None:
    """Return a table of another command beside a result, None if there is none."""
    home = result.home and directory_of(result.home, command)
    return SavedFiles(home, command).table(name) if home and any(home.glob(f"{name}.*")) else None
