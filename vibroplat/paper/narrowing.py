"""Narrow the boundaries of regimes: the step of the sweep in which a regime ends or begins is halved repeatedly.

Each new point begins with the state of the point before the change.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from vibroplat.paper.evidence import MOTIONS, REGIMES, Boundary, Evidence, Step
from vibroplat.study.branches import FREQUENCY, SUPPLY
from vibroplat.study.point import point_task
from vibroplat.study.pool import Pool, StoredChain, Tasks, run_stored
from vibroplat.study.store import Store

#: Widths (Hz of supply frequency) to which boundaries are narrowed; in excitation frequency they are about half as
#: wide. The first is for jumps, as mass shifts them little (five points from the paper's step), the other for the rest
#: (three points).
JUMP_WIDTH, WIDTH = 0.02, 0.1

#: Evidence, a function that reads it, and where the points that narrow its boundaries are stored.
Reading = tuple[Evidence, Callable[[Evidence], object], Store]


def width(regime: str) -> float:
    """Return the width (Hz of supply frequency) to which boundaries of a regime are narrowed."""
    return JUMP_WIDTH if regime in ("antiphase", "in-phase") else WIDTH


def narrow(readings: Sequence[Reading], workers: Pool) -> None:
    """Narrow all boundaries that the functions read of their evidence, and add them to it."""
    found = [(evidence, step, records) for evidence, read, records in readings for step in steps_read(evidence, read)]
    chains = [StoredChain(halve(evidence, step), records, json.dumps(step)) for evidence, step, records in found]
    for (evidence, step, _), boundary in zip(found, run_stored(chains, workers), strict=True):
        evidence.boundaries[step] = boundary


def steps_read(evidence: Evidence, read: Callable[[Evidence], object]) -> list[Step]:
    """Return the steps whose boundaries a function reads and that have not been narrowed yet."""
    observed = _Observed(evidence.courses, evidence.beta, evidence.boundaries)
    read(observed)
    return [step for step in observed.steps if step not in evidence.boundaries]


@dataclass
class _Observed(Evidence):
    """Evidence that notes which boundaries are read."""

    steps: dict[Step, None] = field(default_factory=dict)

    def _narrowed(self, step: Step, boundary: Boundary) -> Boundary:
        self.steps[step] = None
        return super()._narrowed(step, boundary)


def halve(evidence: Evidence, step: Step) -> Tasks[Boundary]:
    """Halve a step until the change of regime in it is known to the width; a point that fails or is undecided ends it.

    The result is the boundary with the rows next to the change.
    """
    course = evidence.courses[step.key]
    before, after = (next(row for row in course.rows if row[SUPPLY] == supply) for supply in (step.before, step.after))
    state = course.states[step.before]
    exponents = course.plan.lyapunov and step.regime in MOTIONS
    plan = course.plan.model_copy(update={"lyapunov": exponents})
    while abs(after[SUPPLY] - before[SUPPLY]) > width(step.regime):
        middle = float(0.5 * (before[SUPPLY] + after[SUPPLY]))
        scene = course.branch.scene.replace({FREQUENCY: middle})
        record = yield point_task(scene, plan, state, course.branch.key(middle))
        row = record["row"] | {SUPPLY: middle}
        if record["state"] is None or (step.regime in MOTIONS and row["motion"] == "undecided"):
            break
        if REGIMES[step.regime](row) != step.begins:
            before, state = row, record["state"]
        else:
            after = row
    return Boundary(before, after)
