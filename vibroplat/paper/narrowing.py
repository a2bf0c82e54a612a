"""Boundaries of regimes narrowed: the step in which one ends is halved, each new point begun before the change."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from vibroplat.paper.evidence import MOTIONS, REGIMES, Boundary, Course, Evidence, Row, Step
from vibroplat.study.branches import FREQUENCY, SUPPLY
from vibroplat.study.execution import Pool, WorkerLostError, run_chains
from vibroplat.study.point import Point, measure_point
from vibroplat.study.store import Store

#: Widths of supply frequency (Hz) down to which boundaries are narrowed, about half as wide in excitation frequency:
#: of jumps, whose shifts over mass are small (five points from the paper's step), and of the others (three points).
JUMP_WIDTH, WIDTH = 0.02, 0.1


def width(regime: str) -> float:
    """Return the width of supply frequencies (Hz) down to which the end of a regime is narrowed."""
    return JUMP_WIDTH if regime in ("antiphase", "in-phase") else WIDTH


def narrow(evidences: Sequence[tuple[Evidence, Store]], workers: Pool) -> None:
    """Narrow all boundaries that were asked for and are not narrow yet; points are kept in the stores."""
    chains = [
        _Halving(evidence, number, step, store)
        for evidence, store in evidences
        for number, step in enumerate(evidence.asked)
        if step not in evidence.narrowed
    ]
    for _ in run_chains(chains, workers):
        pass
    for chain in chains:
        chain.evidence.narrowed[chain.step] = chain.boundary


class _Halving:
    """A chain of points, each in the middle of the step that is left."""

    def __init__(self, evidence: Evidence, number: int, step: Step, store: Store) -> None:
        self.evidence = evidence
        self.step = step
        self.boundary = evidence.asked[step]
        self._course: Course = evidence.courses[step.key]
        self._number = number
        self._store = store
        self._points = 0
        self._lost = False
        for _, record in store.read(number):
            if (
                record["step"] != json.loads(json.dumps(step)) or record["row"].get(SUPPLY) != self._middle
            ):  # of another boundary
                break
            self._passed(record["row"], record["state"])

    @property
    def _middle(self) -> float:
        return float(0.5 * (self.boundary.before[SUPPLY] + self.boundary.after[SUPPLY]))

    def task(self) -> tuple[Callable[..., Any], tuple[Any, ...]] | None:
        """Return the next point as a task."""
        left = abs(self.boundary.after[SUPPLY] - self.boundary.before[SUPPLY])
        if self._lost or left <= width(self.step.regime):
            return None
        branch = self._course.branch
        exponents = self._course.plan.lyapunov and self.step.regime in MOTIONS
        plan = self._course.plan.model_copy(update={"lyapunov": exponents})
        scene = branch.scene.replace({FREQUENCY: self._middle})
        return measure_point, (scene, plan, self.boundary.before["state"], branch.key(self._middle))

    def take(self, result: Point | WorkerLostError) -> None:
        """Keep a finished point."""
        if isinstance(result, WorkerLostError):
            self._lost = True
            return
        row = result.row | {SUPPLY: self._middle}
        step = json.loads(json.dumps(self.step))
        self._store.write(self._number, self._points, {"row": row, "state": result.state, "step": step})
        self._passed(row, result.state)

    def _passed(self, row: Row, state: list[float] | None) -> None:
        """Go on in the half in which the change is; a point that failed or is undecided ends the narrowing."""
        self._points += 1
        if state is None or (self.step.regime in MOTIONS and row["motion"] == "undecided"):
            self._lost = True
            return
        before, after = self.boundary
        found = row | {"state": state}
        same = REGIMES[self.step.regime](row) != self.step.begins
        self.boundary = Boundary(found, after) if same else Boundary(before, found)
