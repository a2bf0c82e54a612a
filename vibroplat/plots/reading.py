"""Reads results for figures and the page, and cuts and thins trajectories.

Trajectories are read in parts: those of long runs do not fit into memory.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, TableError
from vibroplat.hybrid.state import static_rest
from vibroplat.results.files import Command, Result
from vibroplat.results.picture import Picture, Shown, checked, finite

#: Of each command: what its result is called, and the table by which one recognizes it.
RESULTS: dict[Command, tuple[str, str]] = {
    "paper": ("a reproduction of the paper", "claims"),
    "sweep": ("a sweep", "sweep"),
    "orbits": ("branches of orbits", "branches"),
    "basins": ("basins of attraction", "attractors"),
    "find": ("thresholds", "thresholds"),
    "design": ("a design", "sensitivities"),
    "run": ("a run", "trajectory"),
}
#: Modules that make the pictures of a command's results, by the command: each has its kinds, its options and
#: ``pictures``.
PICTURES: dict[Command, str] = {
    "sweep": "vibroplat.study.picture",
    "orbits": "vibroplat.continuation.picture",
    "basins": "vibroplat.basin.picture",
    "find": "vibroplat.thresholds.picture",
    "design": "vibroplat.designs.picture",
}
#: Where points are kept until their table is written, and what is then told.
_UNFINISHED: dict[Command, tuple[str, str]] = {
    "sweep": ("points.sqlite", "an unfinished sweep; continue it"),
    "orbits": ("orbits.sqlite", "unfinished branches; continue them"),
    "basins": ("basins.sqlite", "unfinished basins; continue them"),
    "find": ("find.sqlite", "an unfinished search; continue it"),
    "design": ("design.sqlite", "an unfinished design; continue it"),
}


def has_table(directory: Path, name: str) -> bool:
    """Whether a directory holds a table, of whatever format."""
    return any(directory.glob(f"{name}.*"))


def has_result(directory: Path, command: Command) -> bool:
    """Whether a directory holds a result of a command."""
    return has_table(directory, RESULTS[command][1])


def rest_of(scene: Scene) -> float:
    """Return y at the static rest (m), from where figures count it."""
    return float(static_rest(scene)[1])


class Saved(Result):
    """The result of a command as figures and the page read it.

    Parameters
    ----------
    directory, command
        Where it is, and the command that wrote it.

    Attributes
    ----------
    label
        What the page calls it.

    Raises
    ------
    TableError
        It is unfinished, or as for :class:`vibroplat.results.files.Result`.
    """

    label: str = ""

    def __init__(self, directory: Path, command: Command) -> None:
        if not directory.is_dir():
            raise TableError(f"{directory} is not a directory; allowed: a result directory of vibroplat")
        study: Command = command if command in _UNFINISHED else "sweep"
        kept, what = _UNFINISHED[study]
        if (directory / kept).exists() and not has_result(directory, study):
            raise TableError(f"{directory} holds {what} with `vibroplat {study} --resume`")
        super().__init__(directory, command)
        self.command = command

    def given(self, *path: str) -> Any:
        """Return the configuration, or a section or value of it; raises TableError if it is not there."""
        found: Any = self.provenance.get("configuration")
        for name in path:
            found = found.get(name) if isinstance(found, dict) else None
        if found is None or not (path or isinstance(found, dict)):
            what, _ = RESULTS[self.command]
            raise TableError(f"{self.directory}/provenance.json is not the provenance of {what}")
        return found

    @cached_property
    def scene(self) -> Scene:
        """What was simulated; raises TableError if the configuration is lost or of another version."""
        try:
            return Scene.from_tree(self.given())
        except (TypeError, AttributeError, ConfigError) as error:
            raise TableError(f"the configuration in {self.directory}: {error}") from None

    @property
    def known_scene(self) -> Scene | None:
        """What was simulated, if that is known."""
        try:
            return self.scene
        except TableError:
            return None

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Summary of a run; empty for other commands."""
        found = self.document("summary") if self.command == "run" else {}
        if not isinstance(found, dict):
            raise TableError(f"{self.directory / 'summary.json'} is not the summary of a run")
        return found

    def columns(
        self, name: str, texts: Collection[str], numbers: Collection[str] = (), optional: Collection[str] = ()
    ) -> pd.DataFrame:
        """Read a table; it must have these columns of texts and of numbers, and numbers in optional ones it has."""
        return checked(self.table(name), f"the {name} table in {self.directory}", texts, numbers, optional)

    def column_parts(
        self, name: str, texts: Collection[str], numbers: Collection[str], optional: Collection[str] = ()
    ) -> Iterator[pd.DataFrame]:
        """Read these columns of a table in parts, which must be as in :meth:`columns`."""
        for part in self.parts(name, (*texts, *numbers, *optional)):
            yield checked(part, f"the {name} table in {self.directory}", texts, numbers, optional)

    @property
    def shown(self) -> Shown:
        """The result as pictures are made of it."""
        name = self.directory.resolve().name
        return Shown(self.command, name, self.known_scene, self.given(), _Tables(self), self.directory)


class _Tables(Mapping[str, pd.DataFrame]):
    """The tables of a result, each read when it is asked for."""

    def __init__(self, result: Result) -> None:
        self._result = result

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self._result.table(name)

    def __contains__(self, name: object) -> bool:
        return has_table(self._result.directory, str(name))

    def __iter__(self) -> Iterator[str]:
        return iter({path.stem for path in self._result.directory.iterdir()})

    def __len__(self) -> int:
        return len([*self])


def pictures_of(command: Command, results: Sequence[Shown], kinds: Sequence[str] = (), **options: Any) -> list[Picture]:
    """Return the pictures of results of a command: all that they have, or these kinds."""
    made: list[Picture] = import_module(PICTURES[command]).pictures(results, kinds, **options)
    return made


class Ends(NamedTuple):
    """How many rows a trajectory has, and its first and last one."""

    rows: int
    first: pd.Series
    last: pd.Series


def ends_of(parts: Iterable[pd.DataFrame]) -> Ends | None:
    """Return the ends of a trajectory; None if it has no rows."""
    found: Ends | None = None
    for part in parts:
        if len(part):
            rows, first = (0, part.iloc[0]) if found is None else found[:2]
            found = Ends(rows + len(part), first, part.iloc[-1])
    return found


class Cut:
    """What is shown of a trajectory: all rows of one interval, some of another one, and the extremes in its bins.

    Parameters
    ----------
    parts
        Parts of the trajectory in their order; they are read once.
    shown
        Interval of which all rows are kept (s).
    whole
        Interval that is thinned (s), and in how many bins of equal length extremes are looked for.
    columns
        Columns of which the extremes are kept.
    every
        In the thinned interval one of so many rows of the trajectory is kept; 0: none.
    most
        Most rows that are kept of the interval shown: the first ones, or with a negative number the last ones.

    Attributes
    ----------
    shown, thinned
        The rows.
    """

    def __init__(
        self,
        parts: Iterable[pd.DataFrame],
        shown: tuple[float, float],
        whole: tuple[float, float, int],
        columns: Collection[str],
        *,
        every: int = 0,
        most: int | None = None,
    ) -> None:
        self._begin, self._end, self._bins = whole
        self._samples: dict[str, list[pd.DataFrame]] = {}
        kept, thinned, count = [], [], 0
        for part in parts:
            kept.append(part[part["t_s"].between(*shown)])
            if most is not None:
                rows = pd.concat(kept)
                kept = [rows.head(most) if most > 0 else rows.tail(-most)]
            inside = part["t_s"].between(self._begin, self._end)
            if every:
                thinned.append(part[inside & ((count + np.arange(len(part))) % every == 0)])
            for column in columns:
                if column in part:
                    self._samples.setdefault(column, []).append(self._of_bins(part[inside], column))
            count += len(part)
        self.shown = finite(pd.concat(kept, ignore_index=True))
        self.thinned = finite(pd.concat(thinned, ignore_index=True)) if thinned else self.shown.iloc[:0]

    def _bins_of(self, table: pd.DataFrame) -> Any:
        width = (self._end - self._begin) / self._bins or 1.0
        return ((table["t_s"] - self._begin) / width).clip(0, self._bins - 1).astype(int).to_numpy()

    def _of_bins(self, part: pd.DataFrame, column: str) -> pd.DataFrame:
        """Return the samples with the smallest and the largest value of each bin, in order of time."""
        known = finite(part[["t_s", column]]).dropna().reset_index(drop=True)
        values = known[column].groupby(self._bins_of(known))
        return known.iloc[np.unique(np.concatenate([values.idxmin(), values.idxmax()]))]

    def extremes(self) -> dict[str, pd.DataFrame]:
        """Return by column the samples with its smallest and largest value in each bin, with their times ``t_s``."""
        return {column: pd.concat(samples, ignore_index=True) for column, samples in self._samples.items()}

    def envelope(self) -> pd.DataFrame:
        """Return the extremes in each bin (columns ``y_m:min``, ``y_m:max`` …) and the time in its middle (``t_s``)."""
        found: dict[str, pd.Series] = {}
        for column, samples in self.extremes().items():
            values = samples[column].groupby(self._bins_of(samples))
            found |= {f"{column}:min": values.min(), f"{column}:max": values.max()}
        table = pd.DataFrame(found)
        middle = self._begin + (table.index.to_numpy() + 0.5) * (self._end - self._begin) / self._bins
        return table.assign(t_s=middle).reset_index(drop=True)
