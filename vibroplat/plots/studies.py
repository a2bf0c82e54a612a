"""Tables of sweeps and of branches of orbits, prepared for figures and the page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.columns import PHASE_COLUMN, QUANTITIES
from vibroplat.config.reader import flat
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.labels import compared, distinct, is_number, sweep_parameters, value_label
from vibroplat.plots.reading import Curve, Saved, curves_of, finite, has_table
from vibroplat.plots.style import CURVES
from vibroplat.plots.timelines import Measured
from vibroplat.results.files import SavedFiles
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of

#: Columns that figures of sweeps need besides the swept keys, and those they show if there are any.
_NUMBERS = (EXCITATION, "rms_x_m", "rms_y_m", "rms_phi_rad", PHASE_COLUMN, "period")
_OPTIONAL = tuple(column for column in QUANTITIES if column not in _NUMBERS)
#: The column that tells several results apart.
RESULT = "result"
#: Colour of what is behind the branches.
BEHIND = "#9a9a9a"
#: What boundaries are called whose orbits no motion comes to.
UNREACHED = "of unstable orbits"


@dataclass(frozen=True)
class Study:
    """Tables of a sweep, of several as one, or of branches of orbits.

    Attributes
    ----------
    results, names
        The results, none of tables in memory, and what they are called.
    points
        A row for each point; with the column ``result`` if there are several results.
    grid
        Columns that tell branches apart: ``result``, and keys of the grid.
    x
        The column of the horizontal axis; if there is no other choice, that of the key of branches, and for the supply
        the excitation frequency.
    data
        Measured data laid over the curves.
    labels
        What results are called in a legend, by their names.
    key, second
        Column of the key, and of the second key of boundaries, "" where there is none.
    measures
        Columns of a sweep that its response and maps show instead of the usual ones.
    special
        Special points of branches.
    swept
        Table of a sweep in the same directory as branches, or None.
    """

    results: list[Saved]
    names: list[str]
    points: pd.DataFrame
    grid: list[str]
    x: str = EXCITATION
    data: Measured | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    key: str = SUPPLY
    second: str = ""
    special: pd.DataFrame = field(default_factory=pd.DataFrame)
    swept: pd.DataFrame | None = None
    measures: Sequence[str] = ()

    @cached_property
    def varied(self) -> list[str]:
        """Columns of the grid that have several values."""
        return [key for key in self.grid if key == RESULT or len(self.points[key].unique()) > 1]

    def parameters(self, shown: Sequence[str]) -> str:
        """Return what a reader wants to know of the scene, without keys that axes and curves show."""
        return sweep_parameters(self.scene_of(self.points, [key for key in self.grid if key not in self.varied]), shown)

    @cached_property
    def rotation(self) -> str:
        """``counter-rotating`` or ``co-rotating``; "" if that varies or is not known."""
        if "rotation" in self.points:
            found = {*self.points["rotation"].dropna()}
        else:
            varies = any("rotation" in key for key in self.grid)
            found = {one.known_scene.rotation for one in self.results if one.known_scene is not None and not varies}
        return found.pop() if len(found) == 1 else ""

    def scene_of(self, rows: pd.DataFrame, keys: Sequence[str]) -> Scene | None:
        """Return the scene of a single result, if it is known, with the values of keys that some rows share."""
        scene = self.results[0].known_scene if len(self.results) == 1 else None
        return scene and scene.replace({key: rows[key].astype(object).iloc[0] for key in keys})

    @cached_property
    def curves(self) -> list[Curve]:
        """Each branch, in the order of the table."""
        return curves_of(self.points, [*self.grid, "branch"], self.label)

    def label(self, values: pd.Series) -> str:
        """Return what a combination of the grid's values is called in a legend; results differ by their labels."""
        return ", ".join(
            self.labels[values[key]] if key == RESULT else value_label(key, values[key]) for key in self.varied
        )

    @property
    def scale(self) -> str | None:
        """The key whose numbers colours can follow, if it alone varies."""
        return self.varied[0] if len(self.varied) == 1 and is_number(self.points[self.varied[0]]) else None

    def alike(self, table: pd.DataFrame, values: Any, keys: Sequence[str] | None = None) -> pd.DataFrame:
        """Return the rows of a table that belong to the branch of some values, or that share them in other keys."""
        for key in (*self.grid, "branch") if keys is None else keys:
            table = table[table[key] == values[key]]
        return table

    def sweeps(self) -> Iterator[tuple[str, pd.DataFrame]]:
        """Yield the colour and points of the sweep: of each combination, where the sweep has its keys."""
        if self.swept is None:
            return
        if not self.varied or any(key not in self.swept for key in self.varied):
            yield BEHIND, self.swept
            return
        for number, (_, values) in enumerate(self.points[self.varied].drop_duplicates().iterrows()):
            yield CURVES[number % len(CURVES)], self.alike(self.swept, values, self.varied)

    def boundaries(self) -> pd.DataFrame:
        """Read the table ``boundaries``; its keys must hold numbers."""
        (result,) = self.results
        table = result.columns("boundaries", ("kind",), ("curve", "n_unstable"))
        if not all(key in table and is_number(table[key]) for key in (self.key, self.second)):
            raise TableError(f"the boundaries table in {result.directory} has no numbers of two keys")
        return table


def reached(boundaries: pd.DataFrame) -> pd.Series:
    """Tell of each point of boundaries whether motion converges to an orbit beside a point of its curve."""
    return (boundaries.groupby("curve")["n_unstable"].transform("min") == 0).astype(bool)


# -- sweeps ------------------------------------------------------------------------------------------------------------


def read_sweeps(directories: Sequence[Path], *, x: str | None = None, measures: Sequence[str] = ()) -> Study:
    """Read the table of a sweep, or those of several as one."""
    results: list[Saved] = []
    tables: list[pd.DataFrame] = []
    for place in directories:
        result = Saved(place, "sweep")
        key = result.swept
        if results and key != results[0].swept:
            raise TableError(f"{place} is over {key}, not {results[0].swept}; allowed: several sweeps over one key")
        numbers = (key, "branch", *_NUMBERS, *measures, *([x] if x else []))
        table = result.columns("sweep", ("direction", "sync"), numbers, _OPTIONAL)
        if table.empty:
            raise TableError(f"{place} holds an empty sweep table; there is nothing to plot")
        results.append(result)
        tables.append(table)
    grid = list(dict.fromkeys(key for table in tables for key in grid_of(table)))
    tables = [_completed(table, result, grid) for table, result in zip(tables, results, strict=True)]
    names = distinct([directory.resolve().name for directory in directories], directories)
    if len(tables) > 1:
        tables = [table.assign(**{RESULT: name}) for name, table in zip(names, tables, strict=True)]
    points, grid = finite(pd.concat(tables, ignore_index=True)), [RESULT, *grid][len(tables) == 1 :]
    study = Study(results, names, points, grid, x or abscissa(key), key=key, measures=measures)
    labels = compared("sweep", names, [result.known_scene for result in results], study.varied)
    return replace(study, labels=dict(zip(names, labels, strict=True)))


def sweep_of(table: pd.DataFrame, x: str | None = None) -> Study:
    """Prepare the table of a sweep in memory."""
    key = key_of(table)
    return Study([], ["sweep"], finite(table), grid_of(table), x or abscissa(key), key=key)


def key_of(table: pd.DataFrame) -> str:
    """Return the column of the key along the branches of a sweep: of the supply, or the first one."""
    return SUPPLY if SUPPLY in table else str(table.columns[0])


def grid_of(table: pd.DataFrame) -> list[str]:
    """Return the keys of the grid of a sweep."""
    key = key_of(table)
    return [str(column) for column in table.columns[: list(table.columns).index("direction")] if column != key]


def abscissa(key: str) -> str:
    """Return the column that figures of points over a key have on their horizontal axis."""
    return EXCITATION if key == SUPPLY else key


def _completed(table: pd.DataFrame, result: Saved, keys: Iterable[str]) -> pd.DataFrame:
    """Add the keys that only other sweeps vary, with the value that this one was made with."""
    made = flat(result.given())
    return table.assign(**{key: made[key] for key in keys if key not in table and key in made})


# -- branches of orbits ------------------------------------------------------------------------------------------------


def read_branches(directory: Path) -> Study:
    """Read the tables of branches, and that of a sweep if it lies in the same directory."""
    result = Saved(directory, "orbits")
    named = [str(result.given("orbits", "key")), ""]
    if result.given("orbits").get("boundaries"):
        named[1] = str(result.given("orbits", "boundaries", "key"))
    key, second = map(column_of, named)
    numbers = (key, EXCITATION, "branch", "rms_x_m", "rms_y_m", PHASE_COLUMN, "motor_power_w", "multiplier_1_re")
    points = result.columns("branches", ("sequence",), numbers, ("contact_force_max_n",))
    if "stable" not in points:
        raise TableError(f"the branches table in {directory} has no column stable")
    special = result.columns("special", ("kind",), (key, EXCITATION, "branch", "point"))
    if points.empty:
        raise TableError(f"{directory} holds an empty table of branches; there is nothing to plot")
    swept = SavedFiles(directory, "sweep").table("sweep") if has_table(directory, "sweep") else None
    return _branches([result], directory.resolve().name, points, key, second=second, special=special, swept=swept)


def branches_of(points: pd.DataFrame, special: pd.DataFrame | None = None) -> Study:
    """Prepare tables in memory, those of special points if there are any; the key stands before ``branch``."""
    *grid, key = (str(column) for column in points.columns[: list(points.columns).index("branch")])
    if special is None:
        special = pd.DataFrame({name: [] for name in (*grid, "branch", "kind", "point", EXCITATION)})
    return _branches([], "orbits", points, key, special=special)


def _branches(results: list[Saved], name: str, points: pd.DataFrame, key: str, **more: Any) -> Study:
    """Prepare branches over a key; the columns of the grid stand before it."""
    grid = list(points.columns[: list(points.columns).index(key)])
    return Study(results, [name], finite(points), grid, abscissa(key), key=key, **more)
