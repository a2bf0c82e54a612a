"""Evidence by periodic orbits alone, for claims about motion of period 1: an orbit takes milliseconds.

Along the branches of the paper's sweeps the orbit of period 1 is found by Newton's method, from where the motion goes
that begins on the orbit before, as long as it is stable and in antiphase. From there on motion is taken for
non-periodic.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from vibroplat.config.plans import FREQUENCY
from vibroplat.config.scene import Scene
from vibroplat.continuation.newton import MissedError, NewtonResult, Problem, correct
from vibroplat.continuation.orbit import accurate, measures_of_orbit
from vibroplat.continuation.shooting import TURN, Shooter
from vibroplat.hybrid.state import initial_state
from vibroplat.kernels.compiled import FloatArray
from vibroplat.paper.claims import NARROW, judge
from vibroplat.paper.evidence import Evidence, F
from vibroplat.paper.judges import Finding
from vibroplat.paper.scenes import IMPACT, claims, coarse_scene
from vibroplat.study.branches import SUPPLY, branches
from vibroplat.study.pool import Task, Tasks
from vibroplat.study.store import Record

#: Supply frequencies (Hz) of the orbits, upward and, over resonance, downward: where claims look.
UPWARD = (
    *(42.4, 44.2, 46.0, 47.0, 47.5, 48.0, 48.5, 49.0, 49.5, 51.5, 53.0, 54.0, 55.0, 56.0, 57.5, 58.5, 59.5),
    *(60.0, 60.5, 62.0),
)
OVER = (79.4, 77.5, 75.6, 73.7, 71.8, 71.4)
#: Residual at which an orbit is found, in the scales of the scene.
TOLERANCE = 1e-6
#: Turns of exciter 1 after which the first orbit and each other one is looked for, and again if there is none; largest
#: number of iterations.
FIRST, SETTLING, MOST = (48, 96), (4, 8, 16, 32), 8
#: Margin of a claim, over that which counts as none, that is ample.
AMPLE = 10.0
#: The claims that orbits can judge, and what is changed of them as orbits do not reach further.
JUDGED: dict[str, dict[str, Any]] = {
    **{name: {} for name in ("amp-rise", "amp-fall-over", "attached-mu01", "attached-mu02", "flight-period1")},
    **{name: {} for name in ("flight-period1-implied", "nonperiodic", "over-period1", "layer-damping")},
    **{name: {} for name in ("R-none", "R1-nonperiodic", "R-nonperiodic-earlier")},
    "amp-fall-inter": {"f": [27.5, 29.5]},
    "R-same-to-29": {"f": [21.0, 28.0]},
    "R-amp-over": {"f": [37.0, 40.0]},
    "quoted-frequencies": {"quoted": [[25.75, 0.03], [28.75, 0.03], [38.75, 0.03]]},
}


def screening(numbers: Mapping[str, Any]) -> Tasks[Record]:
    """Judge a set of numbers by orbits; the result is the mean ``score`` of those claims, and the number ``held``."""
    findings = yield from judged_by_orbits(numbers)
    scores = [worth(finding) for finding in findings.values()]
    return {"score": float(np.mean(scores)), "held": sum(bool(finding.holds) for finding in findings.values())}


def worth(finding: Finding) -> float:
    """Return what a claim is worth for the search, from 0 to 1: half of it for holding, half for its margin.

    Whether a claim holds is a step, in which a search sees no direction, and a set that holds it narrowly loses it with
    finer steps or another seed.
    """
    close = finding.score
    if math.isfinite(finding.margin):
        close = float(np.clip(0.5 + 0.5 * finding.margin / (AMPLE * NARROW[finding.unit]), 0.0, 1.0))
    return 0.5 * bool(finding.holds) + 0.5 * close


def judged_by_orbits(numbers: Mapping[str, Any]) -> Tasks[dict[str, Finding]]:
    """Find the orbits of a machine, a task for each branch, and judge those claims that they can judge."""
    evidence = Evidence()
    for branch in (branch for name in IMPACT for branch in branches(coarse_scene(name, numbers))):
        found = yield Task(orbits_along, (branch.scene,))
        along = replace(branch, along=tuple(row[SUPPLY] for row in found["rows"]))
        evidence.add(along, [{"row": row, "state": None} for row in found["rows"]])
    return {claim["id"]: judge(claim | JUDGED[claim["id"]], evidence) for claim in claims() if claim["id"] in JUDGED}


def orbits_along(scene: Scene) -> Record:
    """Find the orbits of a branch; the result are its rows, in the order of frequency."""
    return {"rows": [*_rows(scene, UPWARD), *_rows(scene, OVER)[::-1]]}


def _rows(scene: Scene, frequencies: Sequence[float]) -> list[dict[str, Any]]:
    """Return a row for each supply frequency (Hz); all after the last stable orbit are of non-periodic motion."""
    scene = accurate(scene.replace({FREQUENCY: frequencies[0], "run.perturbation": 0.0}), TOLERANCE)
    rows: list[dict[str, Any]] = []
    state, turn = initial_state(scene), TURN / scene.speed_scale
    with closing(Shooter(scene, (FREQUENCY,))) as shooter, suppress(MissedError):
        for last, supply in pairwise((frequencies[0], *frequencies)):
            shooter.set([supply])
            problem, found = _orbit(shooter, state, turn * last / supply, supply, SETTLING if rows else FIRST)
            measures = measures_of_orbit(problem, found)
            if abs(found.multipliers[0]) >= 1.0 or measures["sync"] != "antiphase":
                break
            chart, u, _ = problem.far_from_events(found) or (found.chart, found.u, [])
            state, turn, _ = chart.unpack(u)
            rows.append({SUPPLY: supply, **measures, "period": 1, "motion": "periodic", "outcome": "ok"})
    slip = rows[-1][F] / rows[-1][SUPPLY] if rows else 1.0 / scene.exciter_pair[0].pole_pairs
    other = {"period": 0, "motion": "non-periodic", "sync": "none", "outcome": "ok", "flight_fraction": None}
    return rows + [{SUPPLY: supply, F: slip * supply, **other} for supply in frequencies[len(rows) :]]


def _orbit(
    shooter: Shooter, state: FloatArray, turn: float, supply: float, settling: Sequence[int]
) -> tuple[Problem, NewtonResult]:
    """Let a motion settle and find the orbit of period 1 near it; after some turns or, if there is none, after more."""
    motion = shooter.motion
    problem = Problem(shooter, [int(e.direction) for e in shooter.scene.exciter_pair], (1.0,), TOLERANCE)
    missed = MissedError("")
    for turns in settling:
        motion.reset(state)
        motion.to_time(motion.now + turns * turn)
        start = motion.state
        start[3:5] -= TURN * np.floor(start[3:5] / TURN)
        try:
            chart = problem.chart(start)
            u = chart.pack(start, turn, [supply])
            return problem, correct(problem, chart, u, np.eye(u.size)[-1:], most=MOST)
        except MissedError as error:
            missed = error
    raise missed
