"""What ``vibroplat plot`` draws: the figures of result directories, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vibroplat.columns import QUANTITIES
from vibroplat.config.kinds import KINDS, noun_of
from vibroplat.errors import VibroplatError
from vibroplat.plots import run
from vibroplat.plots.measured import Measured, read_data
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.style import Saving, save, styled
from vibroplat.results.files import commands_in, directory_of
from vibroplat.results.labels import ABSCISSAE
from vibroplat.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Family(NamedTuple):
    """The figures of the results of one command.

    Attributes
    ----------
    command
        The command.
    kinds
        Names of its figures.
    draw
        Draws the named figures of directories, by default all, with these options; yields the directory and the name
        of each.
    """

    command: str
    kinds: Collection[str]
    draw: Callable[..., Iterator[tuple[Path, str, Figure]]]

    @property
    def options(self) -> Collection[str]:
        """Options that it accepts, besides kinds and saving."""
        own = {"paper": (), "run": ("start", "stop", "data")}
        return own[self.command] if self.command in own else KINDS[self.command].pictures.OPTIONS


#: Commands whose results can be laid over each other.
_COMPARED = ("sweep", "run")


def families() -> list[Family]:
    """Return all families in the order of drawing; the last one is tried if there is no result of any."""
    return [
        Family("paper", (), _draw_paper),
        *(Family(name, kind.figures.split(), partial(_draw, name)) for name, kind in KINDS.items()),
        Family("run", run.FIGURES, run.run_figures),
    ]


def _draw_paper(directories: Sequence[Path], kinds: Sequence[str] = ()) -> Iterator[tuple[Path, str, Figure]]:
    """Draw the figures of the paper, whose module other results do not need."""
    from vibroplat.plots.paper import paper_figures  # noqa: PLC0415

    yield from paper_figures(directories, kinds)


def _draw(
    command: str, directories: Sequence[Path], kinds: Sequence[str] = (), **options: Any
) -> Iterator[tuple[Path, str, Figure]]:
    """Draw the pictures of results of studies, those that can be laid over each other at once."""
    for places in [directories] if command in _COMPARED else [[directory] for directory in directories]:
        results = [Result.read(directory, command) for directory in places]
        yield from (
            (directory_of(places[0], command), *drawn) for drawn in draw_study(command, results, kinds, **options)
        )


def draw_study(
    command: str, results: Sequence[Result], kinds: Sequence[str] = (), *, data: Measured | None = None, **options: Any
) -> Iterator[tuple[str, Figure]]:
    """Draw the pictures of results of one kind of study; yield the name and the figure of each."""
    if data is not None:
        options |= {"kept": [*map(str, data.given)]}
    for picture in KINDS[command].pictures.pictures(results, kinds, **options):
        if "print" in picture.places:
            x = picture.axes[0] if options.get("x") is None else ABSCISSAE[options["x"]]
            others = [column for column in (*ABSCISSAE.values(), *picture.axes) if column != x]
            known = [*QUANTITIES, *(panel.column for panel in picture.panels if panel.column not in QUANTITIES)]
            yield picture.name, draw_picture(picture, x, data and data.select(x, known, others))


def plot_results(
    directories: Sequence[Path], kinds: Collection[str] = (), *, saving: Saving | None = None, **options: Any
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
        :func:`vibroplat.plots.measured.read_data` takes it, ``measure``: columns that
        response and map of a sweep, and thresholds, show. None: not given.

    Raises
    ------
    VibroplatError
        The results lack a figure or do not understand an option, or are of different commands.
    TableError
        Their tables are missing or damaged.
    """
    every_family = families()
    stored = [commands_in(path) for path in directories]
    common = [family for family in every_family if all(family.command in commands for commands in stored)]
    first, every = directories[0], ", ".join(map(str, directories))
    if not common and len(directories) > 1 and any(stored):
        raise VibroplatError(f"{every} hold no results of one command; allowed: several runs, or several sweeps")
    common = common or [every_family[-1]]
    allowed = [kind for family in common for kind in family.kinds]
    for family in every_family:
        for kind in kinds:
            if kind in family.kinds and kind not in allowed:
                names = ", ".join(allowed) or "no --kind"
                own, other = (noun_of(one.command) for one in (common[0], family))
                raise VibroplatError(f"--kind {kind} shows {other}, but {first} holds {own}; allowed: {names}")
    chosen = [family for family in common if not kinds or {*family.kinds} & {*kinds}]
    given = {option: value for option, value in options.items() if value is not None}
    if isinstance(data := given.get("data"), (str, Path)):
        given["data"] = read_data(data)
    for option, value in given.items():
        if not any(option in family.options for family in chosen):
            able = " and ".join(noun_of(family.command) for family in every_family if option in family.options)
            raise VibroplatError(f"--{option} {value}: no figure of {first} uses it; allowed: with {able}")
    written = []
    with styled():
        for family in chosen:
            wanted = [kind for kind in kinds if kind in family.kinds]
            used = {option: value for option, value in given.items() if option in family.options}
            compared = "-compared" if len(directories) > 1 and family.command in _COMPARED else ""
            for directory, name, figure in family.draw(directories, wanted, **used):
                written.append(save(figure, directory, f"{name}{compared}", saving))
    return written
