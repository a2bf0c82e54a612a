"""The search for attractors that coexist with an aperiodic motion of a sweep.

It depends on the motion's section, class and end alone, and nothing in a sweep depends on it: searches are tasks of
their own beside those of points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np

from vibroplat.config.digits import quantity
from vibroplat.config.plans import SweepPlan
from vibroplat.config.scene import Scene
from vibroplat.extensions import load_provided
from vibroplat.hybrid.state import initial_state, perturb_state
from vibroplat.study.classification import AttractorClass, SearchBeginning, compare
from vibroplat.study.point import on_orbit, settle_and_measure
from vibroplat.study.settling import NearReturn, OrbitDetector
from vibroplat.study.store import Record
from vibroplat.system.memory import NO_MORE

#: Longest settling of motion from other initial conditions (s). In 161 rows of Figs. 3 and 6, what converges to an
#: orbit does so within 1.2 s; what has not settled is followed until it has a block in the known class, and no longer.
MAX_OTHER_SETTLE_S = 5.0


def search_coexisting(scene: Scene, plan: SweepPlan, beginning: SearchBeginning) -> Record:
    """Search for other attractors than that of a motion that does not repeat.

    Searched are stable orbits near its section, and what ``run.initial``, and the same with exciter 2 half a turn
    ahead, lead to. Only what has settled is an attractor.

    Returns
    -------
    record
        ``coexisting``: a description of what was found, or how far the search went.
    """
    try:
        with closing(load_provided("NewtonOrbitDetector")(scene)) as detector:
            return {"coexisting": _search(scene, plan, beginning, detector)}
    except MemoryError:
        return failed_search(NO_MORE)


def failed_search(reason: str) -> Record:
    """Return the record of a search that did not end."""
    return {"coexisting": f"not searched: {reason}"}


def _search(scene: Scene, plan: SweepPlan, beginning: SearchBeginning, detector: OrbitDetector) -> str:
    """Describe other attractors, or how far the search for them went."""
    near, class_of, end = beginning
    returns, known = [NearReturn(*one) for one in near], AttractorClass(*class_of)
    brief = plan.model_copy(update={"max_settle_s": min(MAX_OTHER_SETTLE_S, plan.max_settle_s), "lyapunov": False})
    turned = initial_state(scene)
    turned[4] += math.pi
    starts = [initial_state(scene), turned]
    hunt = detector.search_near_returns(returns)
    orbits = [] if hunt.orbit is None else [hunt.orbit]
    texts = set[str]()
    for number, start in enumerate(starts):
        perturbed = perturb_state(start, scene, plan.perturbation, (plan.seed, number))
        other = settle_and_measure(scene, brief, perturbed, detector, known.met)
        if other.state is None or other.row["period"] is None:
            continue
        if other.row["period"]:
            if other.row.get("multiplier_max") is not None or other.row["settle_s"] < brief.max_settle_s:
                texts.add(_attractor_text(other.row))
        else:
            comparison = compare(scene, plan, (np.array(end), np.array(other.state)), known, detector)
            if comparison.orbit is not None:
                orbits.append(comparison.orbit)
            elif comparison.apart_s:
                texts.add(f"{_attractor_text(other.row)}, apart for {quantity(comparison.apart_s, 's')}")
    texts |= {_attractor_text(on_orbit(scene, orbit, 0.0, detector.work).row) for orbit in orbits}
    if texts:
        return "; ".join(sorted(texts))
    return f"not found: {hunt.trials} returns, {hunt.left} unstable orbits, {len(starts)} initial conditions tried"


def _attractor_text(row: Mapping[str, Any]) -> str:
    """Say in a few words what an attractor is."""
    kind = f"period {row['period']}" if row["period"] else "chaotic"
    return f"{kind}, {row['sync']}, RMS y {quantity(row['rms_y_m'], 'm')}"
