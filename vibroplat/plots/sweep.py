"""Figures of a sweep, or of several laid over each other, drawn from their tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vibroplat.errors import TableError
from vibroplat.plots.bifurcation import bifurcation
from vibroplat.plots.data import Data
from vibroplat.plots.regimes import regimes
from vibroplat.plots.response import response_figure
from vibroplat.plots.style import Saving, save, styled
from vibroplat.plots.sweep_tables import Response, read_response
from vibroplat.results.files import Result
from vibroplat.study.branches import EXCITATION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        return [save(FIGURES[kind](response), directories[0], f"{kind}{compared}", saving) for kind in kinds]


FIGURES: dict[str, Callable[[Response], Figure]] = {
    "response": response_figure,
    "bifurcation": bifurcation,
    "map": regimes,
}
