"""Functions that lower subpackages call and higher ones provide: figures, orbit detection, sensitivities.

A subpackage refers to such a function by name. The top-level package registers the module that provides it, which is
imported at the first call, like an entry point.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Modules of these functions by their names, filled by the package's entry.
PROVIDERS: dict[str, str] = {}


def load_provided(name: str) -> Callable[..., Any]:
    """Return a function that a higher subpackage provides."""
    found: Callable[..., Any] = getattr(import_module(PROVIDERS[name]), name)
    return found


def figure_of(shown: object, kind: str | None = None, **options: object) -> Figure:
    """Draw a figure of a result or of an orbit."""
    figure: Figure = load_provided("figure_of")(shown, kind, **options)
    return figure
