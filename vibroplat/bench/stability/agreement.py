"""Random scenes by two engines that share no numerics: each must find the events that the other finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Final

from vibroplat.bench.stability.campaign import random_scene
from vibroplat.bench.stability.checks import NAMED, row, with_engine
from vibroplat.scene import Scene
from vibroplat.study.checking.agreement import RunCheck
from vibroplat.study.checking.changes import Other, by_other_engine
from vibroplat.study.checking.runs import check_run

#: Tolerances with which an engine is compared again where it disagrees, over that of the scene, and the least of them.
FINER, FINEST = (1e-2, 1e-4, 1e-6), 1e-12
#: Share of a run that is compared where an integrator has failed in it.
BEFORE = 0.99

_TOLERANCE: Final = "solver.tolerance"


def agreement(count: int, engine: str) -> list[dict[str, Any]]:
    """Run random scenes with an engine and with the one that checks it."""
    return [agreed(with_engine(random_scene(number), engine)) for number in range(count)]


def agreed(scene: Scene) -> dict[str, Any]:
    """Compare two engines on a scene; where they disagree, the other one with finer runs of the first.

    IDA's error over its tolerance varies from scene to scene, and a tenth of the tolerance does not always show it.
    Finer runs of it that still disagree with the same run of the other engine would show an error of that one.
    ``at_first`` says in what they disagree at the tolerance of the scene.
    """
    found = first = _checked(scene)
    tried = iter(_finer(scene))
    while not found.agrees and (finer := next(tried, None)) is not None:
        found = _checked(scene.replace({_TOLERANCE: finer}), scene.solver.tolerance)
    figures = {
        "other": first.other,
        "other_outcome": first.outcomes[1],
        "tolerance": scene.solver.tolerance,
        "events": found.events,
        "compared_share": found.compared_until_s / scene.run.duration_s,
        "amplification": found.amplification,
        "at_first": first.disagreement,
        "at_last": found.disagreement,
    }
    limits = {"disagreements": (float(not found.agrees), 0.0)}
    return row(scene.name, first.outcomes[0], limits, allowed=NAMED) | figures


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
    failed = not found.agrees and "solver-failure" in found.outcomes and found.compared_until_s > 0.0
    return _before(scene, found, other) if failed else found


def _before(scene: Scene, found: RunCheck, other: Other) -> RunCheck:
    """Check the part before an end; the outcomes are still those of the whole."""
    sooner = scene.replace({"run.duration_s": BEFORE * found.compared_until_s})
    return replace(check_run(sooner, other=other), outcomes=found.outcomes)
