"""Tables of one sweep or more as one, for their pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from vibroplat.columns import MEASURES, PHASE_COLUMN, describe_sync
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.reader import flat
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results import content, picture
from vibroplat.results.labels import caption_of, compared, distinct, is_number, value_words
from vibroplat.results.result import Result
from vibroplat.study.branches import EXCITATION, SUPPLY, column_of

#: Most values of a key that have colours of their own; more of them follow a colour scale.
MAX_COLOURS = 5
#: The column that tells several results apart.
RESULT = "result"
#: Columns of texts and of numbers that a table of a sweep needs.
_TEXTS = ("direction", "sync")
_NUMBERS = (EXCITATION, "rms_x_m", "rms_y_m", PHASE_COLUMN, "period")


@dataclass(frozen=True)
class Sweeps:
    """Tables of one sweep or more as one: a column ``result`` tells several apart.

    Attributes
    ----------
    results, names, labels
        The results, what they are called, and what they are called in a legend.
    table, key, grid
        All points, the column of the key along branches, and columns that tell branches apart.
    x
        The horizontal axis in print.
    kept
        Columns that have a panel whatever they say.
    """

    results: Sequence[Result]
    names: Sequence[str]
    table: pd.DataFrame
    key: str
    grid: Sequence[str]
    x: str
    labels: Mapping[str, str] = field(default_factory=dict)
    kept: Sequence[str] = ()

    @cached_property
    def varied(self) -> list[str]:
        """Columns of the grid that have several values."""
        return [key for key in self.grid if key == RESULT or len(self.table[key].unique()) > 1]

    @property
    def scale(self) -> str:
        """The key whose numbers colours can follow, if it alone varies."""
        return self.varied[0] if len(self.varied) == 1 and is_number(self.table[self.varied[0]]) else ""

    @cached_property
    def rotation(self) -> str:
        """How the exciters rotate; "" if that varies or is not known."""
        if "relative_rotation" in self.table:
            rotations = {*self.table["relative_rotation"].dropna()}
        else:
            scenes = [] if any("rotation" in key for key in self.grid) else [one.known_scene for one in self.results]
            rotations = {scene.rotation for scene in scenes if scene is not None}
        return str(rotations.pop()) if len(rotations) == 1 else ""

    @cached_property
    def branches(self) -> list[pd.DataFrame]:
        """The rows of each branch, in the order of the table."""
        return [*content.in_groups(self.table, [*self.grid, "branch"])]

    def curve(self, rows: pd.DataFrame) -> str:
        """Return what the curve of a branch is called."""
        return self.label(rows.iloc[0])

    @property
    def shown_scale(self) -> str:
        """The grid key whose numbers the colours of curves follow, as these are too many for colours of their own."""
        return self.scale if self.scale and self.table[self.scale].nunique() > MAX_COLOURS else ""

    @cached_property
    def colours(self) -> dict[str, str]:
        """Colours of curves by their names."""
        first: dict[str, pd.Series] = {}
        for rows in self.branches:
            first.setdefault(self.curve(rows), rows.iloc[0])
        scale, count = self.shown_scale, len(first)
        shades = picture.shades([float(row[scale]) for row in first.values()]) if scale else picture.palette(count)
        return dict(zip(first, shades, strict=True))

    def label(self, row: pd.Series) -> str:
        """Return what a combination of the grid's values is called in a legend; results differ by their labels."""
        return ", ".join(self.labels[row[key]] if key == RESULT else value_words(key, row[key]) for key in self.varied)

    def scene_of(self, rows: pd.DataFrame, keys: Sequence[str]) -> Scene | None:
        """Return the scene of a single result, if it is known, with the values of keys that some rows share."""
        scene = self.results[0].known_scene if len(self.results) == 1 else None
        return scene and scene.replace({key: rows[key].astype(object).iloc[0] for key in keys})

    def caption(self, *lines: str, beside: str = "") -> str:
        """Return names, what a reader wants to know of the scene, without keys that axes and curves show, and lines."""
        scene = self.scene_of(self.table, [key for key in self.grid if key not in self.varied])
        return caption_of(self.names, scene, [self.key, *self.varied, beside], *lines)

    @property
    def meaning(self) -> str:
        """A sentence on what the machine does in each synchronization, or ""."""
        texts = [
            describe_sync(str(sync), self.rotation)
            for sync in self.table.get("sync", pd.Series(dtype=str)).dropna().unique()
        ]
        joined = "; ".join(text for text in texts if ": " in text)
        return joined and f" {joined[0].upper()}{joined[1:]}."


def read(
    results: Sequence[Result], *, x: str | None = None, columns: Sequence[str] = (), kept: Sequence[str] = ()
) -> Sweeps:
    """Read the table of a sweep, or those of several as one."""
    tables: list[pd.DataFrame] = []
    keys = [swept(result) for result in results]
    for key, result in zip(keys, results, strict=True):
        if key != keys[0]:
            raise TableError(f"{result.place} is over {key}, not {keys[0]}; allowed: several sweeps over one key")
        numbers = (key, "branch", *_NUMBERS, *columns, *([x] if x else []))
        tables.append(content.rows_in(result, "sweep", _TEXTS, numbers, list(MEASURES)))
    grid = list(dict.fromkeys(key for table in tables for key in grid_of(table)))
    made = [flat(result.given()) for result in results]
    tables = [
        table.assign(**{key: own[key] for key in grid if key not in table and key in own})
        for table, own in zip(tables, made, strict=True)
    ]
    names = distinct([result.name for result in results], [result.directory or Path() for result in results])
    if len(tables) > 1:
        tables = [table.assign(**{RESULT: name}) for name, table in zip(names, tables, strict=True)]
    table = picture.finite(pd.concat(tables, ignore_index=True))
    sweeps = Sweeps(
        results, names, table, keys[0], [RESULT, *grid][len(tables) == 1 :], x or abscissa(keys[0]), kept=kept
    )
    labels = compared("sweep", names, [result.known_scene for result in results], sweeps.varied)
    return replace(sweeps, labels=dict(zip(names, labels, strict=True)))


def swept(result: Result) -> str:
    """Return the column of the key along the branches of a sweep."""
    return column_of(str(flat(result.given()).get("sweep.over.key", FREQUENCY)))


def key_of(table: pd.DataFrame) -> str:
    """Return the column of the key along the branches of a sweep: of the supply, or the first one."""
    return SUPPLY if SUPPLY in table else str(table.columns[0])


def grid_of(table: pd.DataFrame) -> list[str]:
    """Return the keys of the grid of a sweep."""
    key = key_of(table)
    return [str(column) for column in table.columns[: list(table.columns).index("direction")] if column != key]


def abscissa(key: str) -> str:
    """Return the column that pictures of points over a key have on their horizontal axis."""
    return EXCITATION if key == SUPPLY else key
