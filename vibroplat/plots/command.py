"""What ``vibroplat plot`` draws: the figures of result directories, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vibroplat.config.kinds import noun_of
from vibroplat.errors import VibroplatError
from vibroplat.plots import basins, designs, orbits, run, sweep
from vibroplat.plots.paper import paper_figures
from vibroplat.plots.style import Saving, save, styled
from vibroplat.plots.thresholds import threshold_figures
from vibroplat.results.files import commands_in

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

    command: str
    kinds: Collection[str]
    options: Collection[str]
    draw: Callable[..., Iterator[tuple[Path, str, Figure]]]


#: In the order of drawing. The last one is tried if no table is found, and its reader says what is missing.
FAMILIES = (
    Family("paper", (), (), paper_figures),
    Family("sweep", sweep.FIGURES, ("x", "data", "measure"), sweep.sweep_figures),
    Family("orbits", orbits.FIGURES, ("x",), orbits.orbit_figures),
    Family("basins", basins.FIGURES, (), basins.basin_figures),
    Family("find", (), ("measure",), threshold_figures),
    Family("design", designs.FIGURES, (), designs.design_figures),
    Family("run", run.FIGURES, ("start", "stop", "data"), run.run_figures),
)
#: Families whose results can be laid over each other.
_COMPARED = ("sweep", "run")


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
    found = [family for family in FAMILIES if all(family.command in commands_in(place) for place in directories)]
    first, every = directories[0], ", ".join(map(str, directories))
    if not found and len(directories) > 1 and any(f.command in commands_in(d) for f in FAMILIES for d in directories):
        raise VibroplatError(f"{every} hold no results of one command; allowed: several runs, or several sweeps")
    found = found or [FAMILIES[-1]]
    allowed = [kind for family in found for kind in family.kinds]
    for family in FAMILIES:
        for kind in kinds:
            if kind in family.kinds and kind not in allowed:
                names = ", ".join(allowed) or "no --kind"
                held, other = (noun_of(one.command) for one in (found[0], family))
                raise VibroplatError(f"--kind {kind} shows {other}, but {first} holds {held}; allowed: {names}")
    chosen = [family for family in found if not kinds or {*family.kinds} & {*kinds}]
    given = {option: value for option, value in options.items() if value is not None}
    for option, value in given.items():
        if not any(option in family.options for family in chosen):
            able = " and ".join(noun_of(family.command) for family in FAMILIES if option in family.options)
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
