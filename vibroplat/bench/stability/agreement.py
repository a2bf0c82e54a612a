"""Random scenes by two engines that share no numerics: every difference must be one that errors explain."""

from __future__ import annotations

from typing import Any

from vibroplat.bench.stability.campaign import random_scene
from vibroplat.bench.stability.checks import NAMED, row, with_engine
from vibroplat.scene import Scene
from vibroplat.study.checking.agreement import RunCheck
from vibroplat.study.checking.courses import Course
from vibroplat.study.checking.runs import compared

#: Tolerance of the repetition that decides where engines disagree: an error of a method vanishes there, a wrong term,
#: a lost event or one too many does not.
FINE = 1e-12
#: Share of a run that is compared again where an engine has given up in it.
BEFORE = 0.99


def agreement(count: int, engine: str) -> list[dict[str, Any]]:
    """Run random scenes with an engine and with the one that checks it."""
    return [agreed(with_engine(random_scene(number), engine)) for number in range(count)]


def agreed(scene: Scene) -> dict[str, Any]:
    """Compare the engines on a scene; where they disagree, again with a fine tolerance.

    ``scene_disagreement`` says where they disagree at the tolerance of the scene. That is no failure if they agree at
    the fine one: one of them makes larger errors than its repetition shows.
    """
    outcome, found = _checked(scene)
    told = found.disagreement
    if not found.agrees:
        outcome, found = _checked(scene.replace({"solver.tolerance": FINE}))
    figures = {
        "other": found.other,
        "tolerance": scene.solver.tolerance,
        "events": found.events,
        "compared_share": found.compared_until_s / scene.run.duration_s,
        "amplification": found.amplification,
        "scene_disagreement": told,
        "disagreement": found.disagreement,
    }
    return row(scene.name, outcome, {"disagreements": (float(not found.agrees), 0.0)}, allowed=NAMED) | figures


def _checked(scene: Scene) -> tuple[str, RunCheck]:
    """Return how a run ends, and its check, which leaves out the end where its integrator has failed."""
    first = Course(scene).run()
    outcome = first.outcome
    if outcome == "solver-failure" and first.end > 0.0:
        first = Course(scene.replace({"run.duration_s": BEFORE * first.end})).run()
    return outcome, compared(first)
