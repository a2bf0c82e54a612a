"""Reads results back into Python."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.results.files import Result
from vibroplat.results.prompt import AtPrompt


class SavedRun(AtPrompt):
    """A run that was read from its files. It has no dense output and no Poincaré section.

    Parameters
    ----------
    directory
        Where it is.

    Raises
    ------
    TableError
        There is no run, or a file is missing, damaged or of another result.
    """

    def __init__(self, directory: Path) -> None:
        self._result = Result(directory, "run")
        self.scene = Scene.from_tree(self.provenance["configuration"])
        self.summary: dict[str, Any] = self._result.document("summary")
        self.origin = self.provenance.get("begins_from")

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made."""
        return self._result.provenance

    @cached_property
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table, with two rows at each event."""
        return self._result.table("trajectory")

    @cached_property
    def events(self) -> pd.DataFrame:
        """Event table."""
        return self._result.table("events")

    @property
    def notes(self) -> list[str]:
        """What deserves a second look."""
        found: list[str] = self.summary["notes"]
        return found


def load(directory: str | Path) -> SavedRun | pd.DataFrame:
    """Read the result of ``vibroplat run`` or :meth:`run.save`, or the table of ``vibroplat sweep``.

    Where a directory holds both, the run is read; ``pandas.read_parquet`` reads any table.

    Raises
    ------
    TableError
        There is neither, or a file is missing, damaged or of another result.
    """
    place = Path(directory)
    if any(place.glob("trajectory.*")):
        return SavedRun(place)
    if any(place.glob("sweep.*")):
        return Result(place, "sweep").table("sweep")
    raise TableError(f"{place} holds neither a run nor a sweep; allowed: a result directory of vibroplat")
