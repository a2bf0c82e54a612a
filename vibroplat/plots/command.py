"""What ``vibroplat plot`` draws: the pictures of results, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroplat.columns import MEASURES
from vibroplat.config.kinds import KINDS, RUN_FIGURES, noun_of
from vibroplat.errors import VibroplatError
from vibroplat.measured.data import Measured, read_data
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.style import Saving, save, styled
from vibroplat.results.files import commands_in, directory_of
from vibroplat.results.labels import ABSCISSAE
from vibroplat.results.result import Result
from vibroplat.results.run import load
from vibroplat.results.tables import as_written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Names of figures by the command whose results they show, in the order of drawing.
FIGURE_NAMES = {"paper": "", **{name: kind.figures for name, kind in KINDS.items()}, "run": RUN_FIGURES}
#: Commands whose results can be laid over each other.
_COMPARED = ("sweep", "run")


def pictures_of(command: str) -> Any:
    """Return the module with the pictures of a command's results: ``pictures``, and ``OPTIONS`` that it takes."""
    return KINDS[command].pictures if command in KINDS else import_module(f"vibroplat.plots.{command}")


def draw_results(
    results: Sequence[Result], kinds: Sequence[str] = (), *, data: Measured | str | Path | None = None, **options: Any
) -> Iterator[tuple[str, Figure]]:
    """Draw the pictures of results of one command; yield the name and the figure of each."""
    command = results[0].command
    data = read_data(data) if isinstance(data, (str, Path)) else data
    if data is not None:
        options |= {"data": data} if command == "run" else {"kept": [*map(str, data.given)]}
    for picture in pictures_of(command).pictures(results, kinds, **options):
        if "print" in picture.places:
            x = picture.axes[0] if options.get("x") is None else ABSCISSAE[options["x"]]
            if data is not None and command != "run":
                others = [column for column in (*ABSCISSAE.values(), *picture.axes) if column != x]
                known = [*MEASURES, *(panel.column for panel in picture.panels if panel.column not in MEASURES)]
                data.select(x, known, others)
            yield picture.name, draw_picture(picture, x, data)


def plot_results(
    directories: Sequence[Path], kinds: Sequence[str] = (), *, saving: Saving | None = None, **options: Any
) -> list[Path]:
    """Draw the figures of one result, or lay several results over each other; return the files.

    Parameters
    ----------
    directories
        Result directories; figures are saved next to the tables of the first one, those of branches in each.
    kinds
        Figures; all that the results have if empty.
    saving
        Format, resolution and place of the files.
    options
        ``start`` and ``stop`` of the interval of a run (s), ``x``: horizontal axis of a sweep or of branches
        (``excitation`` or ``supply``), ``data``: file of measured data laid over the figures, as
        :func:`vibroplat.measured.data.read_data` takes it, ``measure``: columns that
        response and map of a sweep, and thresholds, show. None: not given.

    Raises
    ------
    VibroplatError
        The results lack a figure or do not understand an option, or are of different commands.
    TableError
        Their tables are missing or damaged.
    """
    stored = [commands_in(path) for path in directories]
    common = [command for command in FIGURE_NAMES if all(command in commands for commands in stored)]
    first, every = directories[0], ", ".join(map(str, directories))
    if not common and len(directories) > 1 and any(stored):
        raise VibroplatError(f"{every} hold no results of one command; allowed: several runs, or several sweeps")
    common = common or ["run"]
    allowed = [kind for command in common for kind in FIGURE_NAMES[command].split()]
    for kind in kinds:
        if kind not in allowed:
            other = next(noun_of(command) for command, names in FIGURE_NAMES.items() if kind in names.split())
            names = ", ".join(allowed) or "no --kind"
            raise VibroplatError(
                f"--kind {kind} shows {other}, but {first} holds {noun_of(common[0])}; allowed: {names}"
            )
    chosen = [command for command in common if not kinds or {*FIGURE_NAMES[command].split()} & {*kinds}]
    given = {option: value for option, value in options.items() if value is not None}
    for option, value in given.items():
        able = [command for command in FIGURE_NAMES if option in pictures_of(command).OPTIONS]
        if not {*able} & {*chosen}:
            nouns = " and ".join(map(noun_of, able))
            raise VibroplatError(f"--{option} {value}: no figure of {first} uses it; allowed: with {nouns}")
    written = []
    with styled(), as_written(*directories):
        for command in chosen:
            wanted = [kind for kind in kinds if kind in FIGURE_NAMES[command].split()]
            used = {option: value for option, value in given.items() if option in pictures_of(command).OPTIONS}
            compared = "-compared" if len(directories) > 1 and command in _COMPARED else ""
            for places in [directories] if command in _COMPARED else [[directory] for directory in directories]:
                results = [load(directory, command) for directory in places]
                for name, figure in draw_results(results, wanted, **used):
                    written.append(save(figure, directory_of(places[0], command), f"{name}{compared}", saving))
    return written
