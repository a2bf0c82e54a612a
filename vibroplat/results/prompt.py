"""What a run offers at a prompt and in a notebook, whether it was just simulated or read from its files."""

from __future__ import annotations

import base64
import html
import io
from abc import ABC, abstractmethod
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

import vibroplat
from vibroplat.columns import unit_of
from vibroplat.config.scene import Scene
from vibroplat.results.card import results
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import Format, replace_files, result_directory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: ``all``: two rows at each event, before and after it. ``unique``: the one after it only, so that times ascend.
Sample = Literal["all", "unique"]
#: Figures of a run.
Kind = Literal["motion", "force", "exciters"]


class AtPrompt(ABC):
    """A finished run: a card, figures and files of it.

    Attributes
    ----------
    scene
        What was simulated.
    summary
        Outcome, measures and notes.
    origin
        What provenance says of the run that it goes on from, if any.
    """

    scene: Scene
    summary: dict[str, Any]
    origin: dict[str, Any] | None

    @property
    @abstractmethod
    def trajectory(self) -> pd.DataFrame:
        """Trajectory table, with two rows at each event."""

    @property
    @abstractmethod
    def events(self) -> pd.DataFrame:
        """Event table."""

    @property
    @abstractmethod
    def notes(self) -> list[str]:
        """What deserves a second look."""

    @property
    def outcome(self) -> str:
        """``ok``, or why the run ended early."""
        return str(self.summary["outcome"])

    # -- to look at ---------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Return a card of a few lines."""
        lines = [f"{label:<28}{text}" for label, text in self._card().items()]
        return "\n".join([f"vibroplat run {self.scene.name}", *lines])

    def _repr_html_(self) -> str:
        """Return the card and the figure of the motion, for a notebook."""
        rows = "".join(
            f"<tr><td>{html.escape(label)}</td><td>{html.escape(text)}</td></tr>"
            for label, text in self._card().items()
        )
        picture = self._picture() if len(self.trajectory) > 1 else ""
        return f"<b>vibroplat run {html.escape(self.scene.name)}</b><table>{rows}</table>{picture}"

    def _picture(self) -> str:
        """Return the figure of the motion as an HTML image."""
        written = io.BytesIO()
        self.plot().savefig(written, format="png", dpi=90)
        return f'<img alt="motion" src="data:image/png;base64,{base64.b64encode(written.getvalue()).decode()}">'

    def _card(self) -> dict[str, str]:
        detail = {"detail": self.summary["detail"]} if self.summary["detail"] else {}
        notes = {"notes": f"{len(self.notes)}, see run.notes"} if self.summary["notes"] else {}
        return results(self.scene, self.summary, self.origin) | detail | notes

    def plot(self, kind: Kind = "motion", start: float | None = None, stop: float | None = None) -> Figure:
        """Draw a figure: ``motion`` (platform, gap), ``force`` (contact), ``exciters`` (speeds, phase difference).

        Parameters
        ----------
        kind
            Which one.
        start, stop
            Interval shown (s). Default: the whole run, and the last ten turns of the exciters in detail.
        """
        return vibroplat.figure_of(self, kind, start, stop)

    # -- to hand on ---------------------------------------------------------------------------------

    def rows(self, sample: Sample = "all") -> pd.DataFrame:
        """Return the trajectory table; with ``unique``, times ascend strictly, as interpolation elsewhere needs it."""
        if sample not in ("all", "unique"):
            raise ValueError(f"sample = {sample!r}; allowed: all, unique")
        table = self.trajectory
        return table if sample == "all" else table.drop_duplicates("t_s", keep="last", ignore_index=True)

    def save(self, directory: str | Path, form: Format = "parquet") -> Path:
        """Write the result into a directory, as ``vibroplat run`` does; :func:`vibroplat.load` reads it.

        Raises
        ------
        TableError
            A file cannot be written.
        """
        place = Path(directory)
        result_directory(place.parent, place.name)
        tables = {"trajectory": self.trajectory, "events": self.events}
        summary = self.summary | {"notes": self.notes}
        origin = provenance(self.scene, str(summary["engine"]), self.origin)
        write_result(place, "run", origin, tables, {"summary": summary}, form=form)
        return place

    def to_xarray(self, sample: Sample = "unique") -> Any:
        """Return the trajectory as a Dataset over ``t_s``, with units and meanings as attributes; needs xarray."""
        try:
            xarray = import_module("xarray")
        except ImportError:
            raise ImportError("to_xarray needs xarray; pip install 'vibroplat[xarray]'") from None
        table = self.rows(sample)
        found = xarray.Dataset({str(c): ("t_s", _plain(table[c])) for c in table if c != "t_s"}, {"t_s": table["t_s"]})
        for name in found.variables:
            found[name].attrs = {"units": unit_of(name), "long_name": table.attrs["meanings"].get(name, name)}
        return found.assign_attrs(name=self.scene.name, outcome=self.outcome)

    def save_mat(self, path: str | Path, sample: Sample = "unique") -> Path:
        """Write ``trajectory``, ``events``, ``summary`` and ``units`` as structures into a file for MATLAB or Octave.

        Numbers that are not known are NaN.

        Raises
        ------
        TableError
            It cannot be written.
        """
        savemat = import_module("scipy.io").savemat
        trajectory, place = self.rows(sample), Path(path)
        contents = {
            "trajectory": {str(c): _plain(trajectory[c]) for c in trajectory},
            "events": {str(c): _plain(self.events[c]) for c in self.events},
            "summary": {k: np.nan if v is None else v for k, v in self.summary.items() if k != "notes"},
            "units": {str(c): unit_of(str(c)) for c in trajectory},
        }

        def write(temporary: Path) -> None:
            savemat(temporary, contents, appendmat=False, long_field_names=True, oned_as="column")

        replace_files({place: write})
        return place


def _plain(column: pd.Series) -> Any:
    """Return a column as an array of numbers, or of texts."""
    return column.to_numpy() if pd.api.types.is_numeric_dtype(column) else column.astype(object).to_numpy()
