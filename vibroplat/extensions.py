"""What rooms call and rooms above them provide: figures, and the orbits that the motions of a sweep come to.

A room knows such a function by its name alone. Where it is, the package's entry says, which knows all rooms; it is
loaded when it is first called, as entry points are between packages.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Modules of these functions by their names, filled by the package's entry.
PROVIDERS: dict[str, str] = {}


def provided(name: str) -> Callable[..., Any]:
    """Return a function that a room above provides."""
    found: Callable[..., Any] = getattr(import_module(PROVIDERS[name]), name)
    return found


def figure_of(shown: object, kind: str | None = None, **options: object) -> Figure:
    """Draw a figure of a result or of an orbit."""
    figure: Figure = provided("figure_of")(shown, kind, **options)
    return figure
