"""Random scenes by two engines that share no numerics: each must find the events that the other finds."""

from dataclasses import replace

import numpy as np
from common.random_scenes import random_scene

from stability.checks import NAMED, row, with_engine
from vibroplat.check import by_other_engine
from vibroplat.check.events import Errors, paired
from vibroplat.check.runs import Course, check_run

#: Every THOROUGH-th scene is also compared in its coordinates, with repetitions that show what errors grow to.
THOROUGH = 10
#: Tolerances with which an engine is compared again where it disagrees, over that of the scene, and the least of them.
FINER, FINEST = (1e-2, 1e-4, 1e-6), 1e-12
#: Share of a run that is compared where an integrator has failed in it.
BEFORE = 0.99


def agreement(count, engine):
    """Run random scenes with an engine and with the one that checks it."""
    scenes = (with_engine(random_scene(number), engine) for number in range(count))
    return [agreed(scene, thorough=number % THOROUGH == 0) for number, scene in enumerate(scenes)]


def agreed(scene, *, thorough=False):
    """Compare two engines on a scene.

    Where all their events pair, they agree. Where they do not, errors may explain it, and repetitions tell. Where these
    do not, the same run of the other engine is compared with finer runs of the first: IDA's error over its tolerance
    varies from scene to scene, and a tenth of the tolerance does not always show it. What is then left would be an
    error of the other engine.
    """
    one, two = Course(scene), Course(by_other_engine(scene))
    pairs = paired(one.events, two.events, Errors(np.zeros(1), np.zeros(1)), scene, min(one.end, two.end))
    events, disagreements = len(pairs.rows), 0.0
    if thorough or one.outcome != two.outcome or np.isfinite(pairs.differ_s):
        found, tolerance = _checked(scene), scene.solver.tolerance
        finer = sorted({max(share * tolerance, FINEST) for share in FINER} - {tolerance}, reverse=True)
        while not found.agrees and finer and finer[0] < tolerance:
            found = _checked(scene.replace({"solver.tolerance": finer.pop(0)}), tolerance)
        events, disagreements = found.events, float(not found.agrees)
    limits = {"disagreements": (disagreements, 0.0)}
    return row(scene.name, one.outcome, limits, allowed=NAMED) | {"other": two.engine, "events": events}


def _checked(scene, tolerance=None):
    """Check a scene by the other engine with a tolerance, up to where an integrator fails in one of both."""

    def other(scene):
        changed = by_other_engine(scene)
        return changed if tolerance is None else changed.replace({"solver.tolerance": tolerance})

    found = check_run(scene, other=other)
    if found.agrees or "solver-failure" not in found.outcomes or not found.compared_until_s:
        return found
    sooner = scene.replace({"run.duration_s": BEFORE * found.compared_until_s})
    return replace(check_run(sooner, other=other), outcomes=found.outcomes)
