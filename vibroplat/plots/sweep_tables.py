"""Reads what figures of sweeps need of their tables, those of several sweeps as one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from vibroplat.config.overrides import flat
from vibroplat.errors import TableError
from vibroplat.plots.data import Data
from vibroplat.plots.differences import differing, distinct, labels
from vibroplat.plots.names import MEASURES, is_number, scene_of, sweep_parameters, value_label
from vibroplat.plots.reading import read_columns, read_result
from vibroplat.plots.style import plain
from vibroplat.results.files import Result
from vibroplat.study.branches import EXCITATION, SUPPLY

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
        The results, none of a table in memory, and what they are called.
    table
        Their rows, with the column ``result`` if there are several.
    keys
        What varies: keys of the grid, and ``result``.
    x
        The column of the horizontal axis.
    data
        Measured data laid over the curves.
    labels
        What several results are called in a legend, by their names.
    """

    results: list[Result]
    names: list[str]
    table: pd.DataFrame
    keys: list[str]
    x: str = EXCITATION
    data: Data | None = field(default=None)
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def result(self) -> Result:
        """The first of the results."""
        return self.results[0]

    @property
    def parameters(self) -> str:
        """What does not vary, for a title."""
        return sweep_parameters(scene_of(self.result.provenance), self.keys) if len(self.results) == 1 else ""

    def called(self, name: str) -> str:
        """Return what one of several results is called in a legend: its name, and how it differs otherwise."""
        return self.labels.get(name, plain(name))

    def curves(self) -> Iterator[Curve]:
        """Yield each branch, in the order of the table."""
        numbers: dict[str, int] = {}
        parts = [RESULT, "branch"] if RESULT in self.table else ["branch"]
        for _, rows in self.table.groupby(parts, sort=False):
            label = ", ".join(
                self.called(str(rows[key].iloc[0])) if key == RESULT else value_label(key, rows[key].iloc[0])
                for key in self.keys
            )
            yield Curve(label, numbers.setdefault(label, len(numbers)), str(rows["direction"].iloc[0]), rows)

    @property
    def scale(self) -> str | None:
        """The key whose numbers colours can follow, if it alone varies."""
        return self.keys[0] if len(self.keys) == 1 and is_number(self.table[self.keys[0]]) else None


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
    grid = list(dict.fromkeys(key for table in tables for key in _grid(table)))
    tables = [_completed(table, result, grid) for table, result in zip(tables, results, strict=True)]
    names = _names(directories)
    if len(tables) > 1:
        tables = [table.assign(**{RESULT: name}) for name, table in zip(names, tables, strict=True)]
    joined = pd.concat(tables, ignore_index=True)
    keys = _varied(joined, grid)
    return Response(
        results, names, joined, ([RESULT] if len(tables) > 1 else []) + keys, x, data, _labels(names, results, keys)
    )


def response_of(table: pd.DataFrame, x: str = EXCITATION) -> Response:
    """Prepare the table of a sweep in memory."""
    return Response([], ["sweep"], table, _varied(table, _grid(table)), x)


def _grid(table: pd.DataFrame) -> list[str]:
    """Return the keys of the grid of a sweep."""
    return [str(key) for key in table.columns[1 : list(table.columns).index("direction")]]


def _completed(table: pd.DataFrame, result: Result, keys: Iterable[str]) -> pd.DataFrame:
    """Add the keys that only other sweeps vary, with the value that this one was made with."""
    try:
        made = flat(result.provenance["configuration"])
    except (KeyError, TypeError, AttributeError):
        raise TableError(f"{result.directory}/provenance.json is not the provenance of a sweep") from None
    return table.assign(**{key: made[key] for key in keys if key not in table and key in made})


def _varied(table: pd.DataFrame, keys: Iterable[str]) -> list[str]:
    """Return the keys that have several values."""
    return [key for key in keys if len(table[key].unique()) > 1]


def _names(directories: Sequence[Path]) -> list[str]:
    """Return the names of directories, or their paths where two have the same name."""
    return distinct([directory.resolve().name for directory in directories], directories)


def _labels(names: Sequence[str], results: Sequence[Result], keys: Sequence[str]) -> dict[str, str]:
    """Return what several results are called: their names, and how they differ but for keys that each curve names."""
    scenes = [scene_of(result.provenance) for result in results]
    trees = [scene.to_tree() for scene in scenes if scene is not None]
    if len(trees) < len(results):
        return {}
    found = [{key: value for key, value in one.items() if key not in keys} for one in differing("sweep", trees)]
    return dict(zip(names, labels(names, found), strict=True))
