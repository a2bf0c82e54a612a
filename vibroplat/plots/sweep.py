"""Figures of a sweep, or of several laid over each other: reads their tables and draws what is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from vibroplat.errors import TableError
from vibroplat.plots.data import Data
from vibroplat.plots.names import EXCITATION, MEASURES, SUPPLY, is_number, plain, scene_of, sweep_parameters, value_label
from vibroplat.plots.reading import read_columns, read_result
from vibroplat.plots.style import Saving, save, styled
from vibroplat.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Columns that figures need in addition to the swept keys, and those they show if there are any.
_NUMBERS = (EXCITATION, "rms_x_m", "rms_y_m", "rms_phi_rad", "phase_difference_rad", "period")
_OPTIONAL = tuple(column for column in MEASURES if column not in _NUMBERS)
#: The column that tells several results apart.
RESULT = "result"


class Curve(NamedTuple):
    """A branch: the label and the number of its grid combination, its direction and its rows."""

    label: str
    number: int
    direction: str
    rows: pd.DataFrame


@dataclass(frozen=True)
class Response:
    """Tables of one or several sweeps as one, and the grid keys that have several values.

    Attributes
    ----------
    results, names
        The results and what they are called.
    table
        Their rows, with the column ``result`` if there are several.
    keys
        What varies: keys of the grid, and ``result``.
    x
        The column of the horizontal axis.
    data
        Measured data laid over the curves.
    """

    results: list[Result]
    names: list[str]
    table: pd.DataFrame
    keys: list[str]
    x: str = EXCITATION
    data: Data | None = field(default=None)

    @property
    def result(self) -> Result:
        """The first of the results."""
        return self.results[0]

    @property
    def parameters(self) -> str:
        """What does not vary, for a title."""
        return sweep_parameters(scene_of(self.result.provenance), self.keys) if len(self.results) == 1 else ""

    def curves(self) -> Iterator[Curve]:
        """Yield each branch, in the order of the table."""
        numbers: dict[str, int] = {}
        parts = [RESULT, "branch"] if RESULT in self.table else ["branch"]
        for _, rows in self.table.groupby(parts, sort=False):
            label = ", ".join(
                plain(str(rows[key].iloc[0])) if key == RESULT else value_label(key, rows[key].iloc[0])
                for key in self.keys
            )
            yield Curve(label, numbers.setdefault(label, len(numbers)), str(rows["direction"].iloc[0]), rows)

    @property
    def scale(self) -> str | None:
        """The key whose numbers colours can follow, if it alone varies."""
        return self.keys[0] if len(self.keys) == 1 and is_number(self.table[self.keys[0]]) else None


def _kind(result: Result) -> str:
    """Return the kind of a sweep."""
    try:
        return str(result.provenance["configuration"]["sweep"]["kind"])
    except (KeyError, TypeError):
        raise TableError(f"{result.directory}/provenance.json is not the provenance of a sweep") from None


def plot_sweep(
    directory: Path | Sequence[Path],
    kinds: Sequence[str],
    *,
    x: str = EXCITATION,
    data: Data | None = None,
    saving: Saving | None = None,
) -> list[Path]:
    """Draw figures of a sweep, or of several over each other, and save them in the directory of the first.

    Parameters
    ----------
    directory
        Result directories of ``vibroplat sweep``.
    kinds
        ``response`` (RMS, phase difference, power, force and flight over frequency), ``bifurcation`` (points of the
        Poincaré section and impact speeds), ``map`` (synchronization, period and flight over supply frequency and a key
        of the grid). Default: response and the kind of the sweep.
    x
        Column of the horizontal axis: excitation or supply frequency.
    data
        Measured data laid over the response, see :func:`vibroplat.plots.data.read_data`.
    saving
        Format, resolution and place of the files.

    Raises
    ------
    TableError
        Tables are missing, have another schema version, or lack data that a figure needs.
    """
    directories = [directory] if isinstance(directory, Path) else list(directory)
    response = read_response(directories, x=x, data=data)
    if not kinds:
        own = [_kind(response.result)] if len(directories) == 1 else []
        kinds = list(dict.fromkeys(["response", *own]))
    if len(directories) > 1 and {*kinds} != {"response"}:
        other = next(kind for kind in kinds if kind != "response")
        raise TableError(f"--kind {other} shows one sweep; allowed with {len(directories)} of them: response")
    compared = "" if len(directories) == 1 else "-compared"
    with styled():
        return [save(figures()[kind](response), directories[0], f"{kind}{compared}", saving) for kind in kinds]


def read_response(directory: Path | Sequence[Path], *, x: str = EXCITATION, data: Data | None = None) -> Response:
    """Read the table of a sweep, or those of several as one."""
    directories = [directory] if isinstance(directory, Path) else list(directory)
    results, tables = [], []
    for place in directories:
        result = read_result(place, "sweep")
        table = read_columns(result, "sweep", ("direction", "sync"), (SUPPLY, "branch", *_NUMBERS), _OPTIONAL)
        if table.empty:
            raise TableError(f"{place} holds an empty sweep table; there is nothing to plot")
        results.append(result)
        tables.append(table)
    grid = list(dict.fromkeys(key for table in tables for key in table.columns[1 : list(table.columns).index("direction")]))
    names = _names(directories)
    if len(tables) > 1:
        tables = [table.assign(**{RESULT: name}) for name, table in zip(names, tables, strict=True)]
    joined = pd.concat(tables, ignore_index=True)
    keys = [key for key in grid if len(joined[key].unique()) > 1]
    return Response(results, names, joined, ([RESULT] if len(tables) > 1 else []) + keys, x, data)


def _names(directories: Sequence[Path]) -> list[str]:
    """Return the names of directories, or their paths if two have the same name."""
    names = [directory.resolve().name for directory in directories]
    return names if len({*names}) == len(names) else [str(directory) for directory in directories]


def figures() -> dict[str, Callable[[Response], Figure]]:
    """Return the functions that draw figures, by kind."""
    from vibroplat.plots.bifurcation import bifurcation  # noqa: PLC0415  (they draw what is defined here)
    from vibroplat.plots.regimes import regimes  # noqa: PLC0415
    from vibroplat.plots.response import response_figure  # noqa: PLC0415

    found: dict[str, Any] = {"response": response_figure, "bifurcation": bifurcation, "map": regimes}
    return found
