"""What ``vibroplat plot`` draws: the figures of result directories, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vibroplat.columns import QUANTITIES
from vibroplat.errors import VibroplatError
from vibroplat.plots import run
from vibroplat.plots.paper import paper_figures
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.reading import PICTURES, RESULTS, Saved, has_result, pictures_of
from vibroplat.plots.style import Saving, save, styled
from vibroplat.plots.timelines import read_measured
from vibroplat.results.files import Command
from vibroplat.results.labels import ABSCISSAE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Family(NamedTuple):
    """The figures of the results of one command.

    Attributes
    ----------
    command
        The command.
    kinds
        Its figures that can be asked for by name.
    options
        Options that it understands, besides kinds and saving.
    draw
        Draws the figures of directories that are asked for by name, all by default, with these options; yields the
        directory and the name of each.
    """

    command: Command
    kinds: Collection[str]
    options: Collection[str]
    draw: Callable[..., Iterator[tuple[Path, str, Figure]]]


def _family(command: Command) -> Family:
    """Return the family of a command whose figures are pictures."""
    module = import_module(PICTURES[command])

    def draw(
        directories: Sequence[Path], kinds: Sequence[str] = (), *, data: Path | None = None, **options: Any
    ) -> Iterator[tuple[Path, str, Figure]]:
        shown = [Saved(directory, command).shown for directory in directories]
        for group in [shown] if command in _COMPARED else [[one] for one in shown]:
            for picture in (one for one in pictures_of(command, group, kinds, **options) if "print" in one.places):
                x = picture.axes[0] if options.get("x") is None else ABSCISSAE[options["x"]]
                others = [column for column in (*ABSCISSAE.values(), *picture.axes) if column != x]
                measured = None if data is None else read_measured(data, x, QUANTITIES, others)
                yield group[0].directory or Path(), picture.name, draw_picture(picture, x, measured)

    return Family(command, module.KINDS, module.OPTIONS, draw)


#: Families whose results can be laid over each other.
_COMPARED = ("sweep", "run")
#: In the order of drawing. The last one is tried if no table is found, and its reader says what is missing.
FAMILIES = (
    Family("paper", (), (), paper_figures),
    *map(_family, PICTURES),
    Family("run", run.FIGURES, ("start", "stop", "data"), run.run_figures),
)


def plot_results(
    directories: Sequence[Path], kinds: Collection[str] = (), *, saving: Saving | None = None, **options: Any
) -> list[Path]:
    """Draw the figures of one result, or lay several results over each other; return the files.

    Parameters
    ----------
    directories
        Result directories; figures are saved in the first one, those of branches in each.
    kinds
        Figures; all that the results have if empty.
    saving
        Format, resolution and place of the files.
    options
        ``start`` and ``stop`` of the interval of a run (s), ``x``: horizontal axis of a sweep or of branches
        (``excitation`` or ``supply``), ``data``: file of measured data laid over the figures, ``measure``: columns that
        response and map of a sweep, and thresholds, show. None: not given.

    Raises
    ------
    VibroplatError
        The results lack a figure or do not understand an option, or are of different commands.
    TableError
        Their tables are missing or damaged.
    """
    found = [family for family in FAMILIES if all(has_result(place, family.command) for place in directories)]
    first, every = directories[0], ", ".join(map(str, directories))
    if not found and len(directories) > 1 and any(has_result(d, f.command) for f in FAMILIES for d in directories):
        raise VibroplatError(f"{every} hold no results of one command; allowed: several runs, or several sweeps")
    found = found or [FAMILIES[-1]]
    allowed = [kind for family in found for kind in family.kinds]
    for family in FAMILIES:
        for kind in kinds:
            if kind in family.kinds and kind not in allowed:
                names = ", ".join(allowed) or "no --kind"
                held, other = (RESULTS[one.command][0] for one in (found[0], family))
                raise VibroplatError(f"--kind {kind} shows {other}, but {first} holds {held}; allowed: {names}")
    chosen = [family for family in found if not kinds or {*family.kinds} & {*kinds}]
    given = {option: value for option, value in options.items() if value is not None}
    for option, value in given.items():
        if not any(option in family.options for family in chosen):
            able = " and ".join(RESULTS[family.command][0] for family in FAMILIES if option in family.options)
            raise VibroplatError(f"--{option} {value}: no figure of {first} uses it; allowed: with {able}")
    written = []
    with styled():
        for family in chosen:
            wanted = [kind for kind in kinds if kind in family.kinds]
            own = {option: value for option, value in given.items() if option in family.options}
            compared = "-compared" if len(directories) > 1 and family.command in _COMPARED else ""
            for directory, name, figure in family.draw(directories, wanted, **own):
                written.append(save(figure, directory, f"{name}{compared}", saving))
    return written
