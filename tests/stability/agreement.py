"""Random scenes by two engines that share no numerics: each must find the events that the other finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

import numpy as np
from common.random_scenes import random_scene

from stability.checks import NAMED, row, with_engine
from vibroplat.check import by_other_engine
from vibroplat.check.events import Errors, paired
from vibroplat.check.runs import Course, RunCheck, check_run
from vibroplat.config.scene import Scene

#: Every THOROUGH-th scene is also compared in its coordinates, with repetitions that show what errors grow to.
THOROUGH = 10
#: Tolerances with which an engine is compared again where it disagrees, over that of the scene, and the least of them.
FINER, FINEST = (1e-2, 1e-4, 1e-6), 1e-12
#: Share of a run that is compared where an integrator has failed in it.
BEFORE = 0.99

_TOLERANCE: Final = "solver.tolerance"
_NONE: Final = Errors(np.zeros(1), np.zeros(1))


def agreement(count: int, engine: str) -> list[dict[str, Any]]:
    """Run random scenes with an engine and with the one that checks it."""
    scenes = (with_engine(random_scene(number), engine) for number in range(count))
    return [agreed(scene, thorough=number % THOROUGH == 0) for number, scene in enumerate(scenes)]


def agreed(scene: Scene, *, thorough: bool = False) -> dict[str, Any]:
    """Compare two engines on a scene.

    Where all their events pair, they agree. Where they do not, errors may explain it, and repetitions tell. Where these
    do not, the same run of the other engine is compared with finer runs of the first: IDA's error over its tolerance
    varies from scene to scene, and a tenth of the tolerance does not always show it. What is then left would be an
    error of the other engine. ``at_first`` says in what they disagreed at the tolerance of the scene.
    """
    one, two = Course(scene), Course(by_other_engine(scene))
    end = min(one.end, two.end)
    pairs = paired(one.events, two.events, _NONE, scene, end)
    figures = {
        "other": two.engine,
        "other_outcome": two.outcome,
        "tolerance": scene.solver.tolerance,
        "events": len(pairs.rows),
        "compared_share": end / scene.run.duration_s,
    }
    disagreements = 0.0
    if thorough or one.outcome != two.outcome or np.isfinite(pairs.differ_s):
        found, at_first = explained(scene)
        disagreements = float(not found.agrees)
        figures |= {
            "events": found.events,
            "compared_share": found.compared_until_s / scene.run.duration_s,
            "amplification": found.amplification,
            "at_first": at_first,
            "at_last": found.disagreement,
        }
    return row(scene.name, one.outcome, {"disagreements": (disagreements, 0.0)}, allowed=NAMED) | figures


def explained(scene: Scene) -> tuple[RunCheck, str]:
    """Check a scene, where engines disagree with finer runs of the first; also say in what they did at first."""
    found = first = _checked(scene)
    tried = iter(_finer(scene))
    while not found.agrees and (finer := next(tried, None)) is not None:
        found = _checked(scene.replace({_TOLERANCE: finer}), scene.solver.tolerance)
    return found, first.disagreement


def _finer(scene: Scene) -> Iterator[float]:
    """Yield the finer tolerances of a scene, each once."""
    found = {max(share * scene.solver.tolerance, FINEST) for share in FINER}
    yield from sorted((t for t in found if t < scene.solver.tolerance), reverse=True)


def _checked(scene: Scene, tolerance: float | None = None) -> RunCheck:
    """Check a scene by the other engine with a tolerance, up to where an integrator fails in one of both."""

    def other(scene: Scene) -> Scene:
        changed = by_other_engine(scene)
        return changed if tolerance is None else changed.replace({_TOLERANCE: tolerance})

    found = check_run(scene, other=other)
    if found.agrees or "solver-failure" not in found.outcomes or not found.compared_until_s:
        return found
    sooner = scene.replace({"run.duration_s": BEFORE * found.compared_until_s})
    return replace(check_run(sooner, other=other), outcomes=found.outcomes)
