"""The changes of a scene under which it is repeated to be checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.integrate import other_engine

#: How many times the largest change under repetitions is allowed between engines. In runs of fourteen kinds (with and
#: without flights, impacts, a stall, a coast-down; tolerances 1e-8 … 1e-4), ``native`` and ``sundae`` differed by at
#: most 1.5 times that change and five tolerances: a third of what is allowed.
MULTIPLE: Final = 5.0
#: What is allowed in any case, over the tolerance, in the scales of the scene.
FLOOR: Final = 20.0

_TOLERANCE: Final = "solver.tolerance"

#: Returns what checks a scene: the same one with another engine.
Other = Callable[[Scene], Scene]


def by_other_engine(scene: Scene) -> Scene:
    """Return a scene with the engine that checks its own."""
    return scene.replace({"solver.engine": other_engine(scene.solver.engine)})


def with_other_tolerance(scene: Scene) -> Scene:
    """Return a scene with a tenth of its tolerance; with ten times as much where a tenth is not allowed."""
    try:
        return scene.replace({_TOLERANCE: 0.1 * scene.solver.tolerance})
    except ConfigError:
        return scene.replace({_TOLERANCE: 10.0 * scene.solver.tolerance})
