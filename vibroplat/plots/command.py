"""What ``vibroplat plot`` draws: the figures of result directories, by the command that wrote them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from vibroplat.errors import VibroplatError
from vibroplat.plots.data import read_data
from vibroplat.plots.names import ABSCISSAE, COORDINATES, MEASURES
from vibroplat.plots.orbits import FIGURES as ORBIT_FIGURES
from vibroplat.plots.orbits import plot_orbits
from vibroplat.plots.paper import plot_paper
from vibroplat.plots.run import FIGURES, plot_run
from vibroplat.plots.style import Saving
from vibroplat.plots.sweep import plot_sweep


@dataclass(frozen=True)
class Wanted:
    """What a user asks of figures.

    Attributes
    ----------
    kinds
        Figures; all that the results have if empty.
    start, stop
        Interval of a run (s).
    x
        Horizontal axis of a sweep: ``excitation`` or ``supply``.
    data
        Measured data laid over them.
    saving
        Format, resolution and place of the files.
    """

    kinds: Sequence[str] = ()
    start: float | None = None
    stop: float | None = None
    x: str | None = None
    data: Path | None = None
    saving: Saving = Saving()  # noqa: RUF009  (it is frozen)


class Family(NamedTuple):
    """The figures of the results of one command.

    Attributes
    ----------
    name
        What such a result is called in a message.
    table
        The table by which one recognizes it.
    kinds
        Its figures that can be asked for by name.
    options
        Attributes of ``Wanted`` that it understands, besides kinds and saving.
    draw
        Draws the figures of these kinds, all by default, of directories; returns the files.
    """

    name: str
    table: str
    kinds: Collection[str]
    options: Collection[str]
    draw: Callable[[Sequence[Path], Sequence[str], Wanted], list[Path]]

    @property
    def one(self) -> str:
        """Its name with an article."""
        return self.name if self.name.startswith("branches") else f"a {self.name}"

    def is_in(self, directory: Path) -> bool:
        """Whether a directory holds such a result."""
        return any(directory.glob(f"{self.table}.*"))


def _paper(directories: Sequence[Path], kinds: Sequence[str], wanted: Wanted) -> list[Path]:
    return [path for directory in directories for path in plot_paper(directory, wanted.saving)]


def _sweep(directories: Sequence[Path], kinds: Sequence[str], wanted: Wanted) -> list[Path]:
    x = ABSCISSAE[wanted.x or "excitation"]
    data = None if wanted.data is None else read_data(wanted.data, x, MEASURES, ABSCISSAE.values())
    return plot_sweep(directories, kinds, x=x, data=data, saving=wanted.saving)


def _run(directories: Sequence[Path], kinds: Sequence[str], wanted: Wanted) -> list[Path]:
    data = None if wanted.data is None else read_data(wanted.data, "t_s", COORDINATES)
    interval = (wanted.start, wanted.stop)
    return plot_run(directories, kinds or list(FIGURES), *interval, data=data, saving=wanted.saving)


def _orbits(directories: Sequence[Path], kinds: Sequence[str], wanted: Wanted) -> list[Path]:
    x = None if wanted.x is None else ABSCISSAE[wanted.x]
    return [path for d in directories for path in plot_orbits(d, kinds, x=x, saving=wanted.saving)]


#: In the order of drawing. The last one is tried if no table is found, and its reader says what is missing.
FAMILIES = (
    Family("reproduction of the paper", "claims", (), (), _paper),
    Family("sweep", "sweep", ("response", "bifurcation", "map"), ("x", "data"), _sweep),
    Family("branches of orbits", "branches", tuple(ORBIT_FIGURES), ("x",), _orbits),
    Family("run", "trajectory", tuple(FIGURES), ("start", "stop", "data"), _run),
)


def plot_results(directories: Sequence[Path], wanted: Wanted) -> list[Path]:
    """Draw the figures of one result, or lay several results over each other; return the files.

    Raises
    ------
    VibroplatError
        The results lack a figure or do not understand an option, or are of different commands.
    TableError
        Their tables are missing or damaged.
    """
    found = [family for family in FAMILIES if all(family.is_in(directory) for directory in directories)]
    if not found and len(directories) > 1 and any(f.is_in(d) for f in FAMILIES for d in directories):
        held = ", ".join(map(str, directories))
        raise VibroplatError(f"{held} hold no results of one command; allowed: several runs, or several sweeps")
    found = found or [FAMILIES[-1]]
    _require_kinds(directories[0], found, wanted)
    chosen = [f for f in found if not wanted.kinds or {*f.kinds} & {*wanted.kinds}]
    _require_options(directories[0], chosen, wanted)
    return [
        path
        for family in chosen
        for path in family.draw(directories, [kind for kind in wanted.kinds if kind in family.kinds], wanted)
    ]


def _require_kinds(directory: Path, found: Sequence[Family], wanted: Wanted) -> None:
    """Refuse figures that the results do not have."""
    allowed = [kind for family in found for kind in family.kinds]
    for family in FAMILIES:
        for kind in wanted.kinds:
            if kind in family.kinds and kind not in allowed:
                names = ", ".join(allowed) or "no --kind"
                raise VibroplatError(f"--kind {kind}: {directory} holds no {family.name}; allowed: {names}")


def _require_options(directory: Path, chosen: Sequence[Family], wanted: Wanted) -> None:
    """Refuse options that no figure would heed."""
    for option in ("start", "stop", "x", "data"):
        value = getattr(wanted, option)
        if value is not None and not any(option in family.options for family in chosen):
            able = " and ".join(family.one for family in FAMILIES if option in family.options)
            raise VibroplatError(f"--{option} {value}: no figure of {directory} heeds it; allowed: with {able}")
