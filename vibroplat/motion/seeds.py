"""Largest values of a start or a stop with further seeds: they depend on unknown phases and disturbances.

Times at which motors are switched are shifted by parts of a turn, too.
"""

from __future__ import annotations

from typing import Any

from vibroplat.columns import split
from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.motion.initial_condition import initial_condition
from vibroplat.motion.run import simulate
from vibroplat.results.run import RunResult

#: How many runs with further seeds there are.
MORE_SEEDS = 19
#: Ratio of the largest value to that in steady operation above which it belongs to the start.
START_PEAK = 1.05
#: Relative differences up to which peaks are equal, and strokes settled.
MAX_SPREAD = 0.02
#: Their duration: a multiple of the time of the last peak, plus some turns.
LONGER, MORE_TURNS = 1.5, 80.0


def peaks_of_seeds(run: RunResult) -> dict[str, Any]:
    """Return the smallest and largest peaks of a run and of shorter ones with the next seeds.

    Parameters
    ----------
    run
        A run that was just simulated. One without a disturbance, as ``run.perturbation`` is 0, has no further ones. By
        default it is 0 in a run that continues another: there only times of switching, if there are some, may differ.

    Returns
    -------
    dict
        ``seeds``: how many runs there are, of which each has the largest value with the same probability;
        ``captured``: how many a resonance captures meanwhile; two numbers for each ``whole_…`` column of the summary
        whose largest value belongs to a start, a stop, a failure or a motion that still changes, and depends on the
        seed. Empty if all belong to steady operation.
    """
    scene, summary, times = run.scene, run.summary, {}
    begin, since, until = (summary[name] for name in ("begins_s", "measured_from_s", "measured_to_s"))
    if run.outcome != "ok" or summary["rms_y_m"] is None:
        return {}
    changes = summary["stroke_change"]
    steady = (
        changes is not None
        and changes < MAX_SPREAD
        and scene.drive.last_change(until) <= since
        and all(scene.driven(since, until))
    )
    for column, value in summary.items():
        at = summary.get(f"{split(column)[0]}_at_s") if column.startswith("whole_") else None
        if at is not None and not (steady and value <= START_PEAK * summary[column.removeprefix("whole_")]):
            times[column] = at
    if not times:
        return {}
    seconds = LONGER * (max(times.values()) - begin) + MORE_TURNS * TURN / scene.speed_scale
    count = MORE_SEEDS if _may_differ(scene, begin) else 0
    runs = [summary]
    for k in range(1, count + 1):
        another = _with_seed(scene, k, k / (count + 1), begin)
        another = another.replace({"run.duration_s": min(seconds, scene.run.duration_s)})
        other = simulate(another, keep="summary", start=initial_condition(another))
        if other.outcome == "ok":
            runs.append(other.summary)
    ends = {column: [choose(one[column] for one in runs) for choose in (min, max)] for column in times}
    differ = {column: pair for column, pair in ends.items() if pair[1] - pair[0] > MAX_SPREAD * pair[1]}
    captured = sum(bool(one["captured_by"]) for one in runs)
    return {"seeds": len(runs), "captured": captured, **differ}


def _may_differ(scene: Scene, begin: float) -> bool:
    """Whether runs with other seeds that begin at a time (s) differ from each other."""
    end = begin + scene.run.duration_s
    switches = any(begin < entry.t_s < end for entry in scene.drive.program or ())
    return scene.start_perturbation > 0.0 or (switches and scene.run.perturbation is None)


def _with_seed(scene: Scene, k: int, part: float, begin: float) -> Scene:
    """Return a scene with the k-th next seed, and with what is switched after a time (s) later by a part of a turn."""
    changes: dict[str, Any] = {"run.seed": scene.run.seed + k, "run.perturbation": scene.start_perturbation}
    later = part * TURN / scene.speed_scale
    if scene.drive.program is not None:
        entries = [entry.model_dump(exclude_none=True) for entry in scene.drive.program]
        shifted = [entry | {"t_s": entry["t_s"] + later * (entry["t_s"] > begin)} for entry in entries]
        return scene.replace({**changes, "drive.program": shifted})
    return scene.replace(changes)
