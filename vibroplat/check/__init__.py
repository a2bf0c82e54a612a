"""Two engines that share no numerics check each other.

The same motion is computed by another engine from the same start, and what both give is compared: motions of a study by
what they settle to (:mod:`~vibroplat.check.studies`), whole runs in time (:mod:`~vibroplat.check.runs`).

In time two engines never agree to the last digit, and a motion multiplies what they differ by. How much of a difference
this explains is estimated by repetitions, not guessed. Both engines repeat the motion with another tolerance, which
shows the errors that each of them makes; the first one also repeats it from starts that are off by the tolerance, which
shows what the motion makes of any error. The error of an engine is about what a tenth of the tolerance changes, so two
right engines differ by at most about twice the largest change; ``MAX_RATIO`` times that is allowed. A repetition may by
chance come close to what it repeats, so ``MIN_ALLOWED`` times the tolerance is always allowed.

A wrong term acts the same at every tolerance. Repetitions do not change it, so it is found unless it changes less than
errors of the tolerance do. A lower tolerance finds more. An engine that is right but less accurate
than its tolerance says is excused; the audit of energy and momentum is there for that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from vibroplat.config.engine_choice import chosen_engine, other_engine
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError

#: How many times the largest change under repetitions is allowed between engines. In runs of fourteen kinds (with and
#: without flights, impacts, a stall, a coast-down; tolerances 1e-8 … 1e-4), ``native`` and ``sundae`` differed by at
#: most 1.5 times that change and five tolerances: a third of what is allowed.
MAX_RATIO: Final = 5.0
#: What is allowed in any case, over the tolerance, in scaled units.
MIN_ALLOWED: Final = 20.0

#: Makes the scene that checks a given one.
Other = Callable[[Scene], Scene]


def with_other_engine(scene: Scene, *, run: bool = True) -> Scene:
    """Return a scene with the engine that checks that of its ``run``, or else of its studies."""
    return scene.replace({"solver.engine": other_engine(chosen_engine(scene, run=run))})


def with_other_tolerance(scene: Scene) -> Scene:
    """Return a scene with a tenth of its tolerance; with ten times as much where a tenth is not allowed."""
    tolerance = scene.solver.tolerance
    try:
        return scene.replace({"solver.tolerance": 0.1 * tolerance})
    except ConfigError:
        return scene.replace({"solver.tolerance": 10.0 * tolerance})
