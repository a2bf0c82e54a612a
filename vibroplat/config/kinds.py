"""The registry of kinds of studies, which commands, configuration, results, figures, page and dictionary read.

A kind names the module of its study, in a higher subpackage. Like an entry point, the module is imported at first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple


class Kind(NamedTuple):
    """A kind of study.

    Attributes
    ----------
    name
        Name of the command, of the section of a configuration and of the function in Python.
    noun
        Noun for its result.
    figures
        Names of its figures; the first is the default.
    study
        Module of the study; its pictures are in the module ``picture`` beside it.
    summary
        Help of the command in at most 60 characters.
    about
        Further help of the command.
    uses
        Further sections of a configuration on which only some results depend, this one among them.
    """

    name: str
    noun: str
    figures: str
    study: str
    summary: str
    about: str
    uses: tuple[str, ...] = ()

    def load(self) -> Any:
        """Return the class of its study, ``STUDY`` in its module."""
        return import_module(f"vibroplat.{self.study}").STUDY

    @property
    def pictures(self) -> Any:
        """The module of its pictures."""
        return import_module(f"vibroplat.{self.study.rpartition('.')[0]}.picture")


#: All kinds, in the order of commands, results and pages. Runs and the paper have commands of their own.
KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "sweep",
            "a sweep",
            "response bifurcation map",
            "study.sweep",
            "Sweep the supply frequency or another key, for a grid.",
            "Writes a table of points and a table of bands to OUT/NAME/sweep.",
        ),
        Kind(
            "orbits",
            "branches of orbits",
            "branches multipliers boundaries",
            "continuation.study",
            "Continue branches of periodic orbits over a key.",
            "Writes tables of points, of special points and of boundaries to OUT/NAME/orbits.",
            ("run",),
        ),
        Kind(
            "find",
            "thresholds",
            "thresholds",
            "thresholds.study",
            "Find the values of a key at which the motion changes.",
            "Writes the thresholds and all evaluated values to OUT/NAME/find. It is not an error if nothing changes.",
            ("run",),
        ),
        Kind(
            "basins",
            "basins of attraction",
            "basins",
            "basin.study",
            "Find the attractors of a scene and their basins.",
            "Writes tables of the attractors and of all initial conditions to OUT/NAME/basins.",
            ("run",),
        ),
        Kind(
            "design",
            "a design",
            "sensitivities samples evaluations",
            "designs.study",
            "Find sensitivities, effects of tolerances, best values.",
            "Writes tables of sensitivities, samples, fractions of the variance and evaluations to OUT/NAME/design, "
            "and the best design as best.yaml.",
            ("run", "sweep"),
        ),
        Kind(
            "fit",
            "a fit",
            "fit",
            "fitting.study",
            "Find the values of keys from measured data.",
            "Writes tables of keys, curves and searches to OUT/NAME/fit, and the machine as best.yaml.",
            ("run", "output"),
        ),
    )
}
#: Figures of a run.
RUN_FIGURES = "motion conveying force exciters loads acceleration spectrum measured"
#: What all other results are called.
OTHERS = {"run": "a run", "paper": "a reproduction of the paper"}
#: Sections that only some results depend on.
_OPTIONAL = (*KINDS, "run", "output")


def noun_of(command: str) -> str:
    """Return what the result of a command is called."""
    return OTHERS.get(command) or KINDS[command].noun


def unused_sections(command: str) -> set[str]:
    """Return the sections of a configuration that the result of a command does not depend on."""
    of_kind = (command, *KINDS[command].uses) if command in KINDS else _OPTIONAL
    used = ("run", "output") if command in ("run", "inspect") else of_kind
    return {*_OPTIONAL} - {*used}
