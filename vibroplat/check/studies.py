"""The result of a study is checked: another engine repeats some of the motions that it comes from.

Which these are, and what each must give, the study itself says. Motions that repeat are compared by their measures too,
others by their class alone: of those two engines have no more in common.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import pandas as pd

from vibroplat.check import Other, with_other_engine
from vibroplat.columns import PHASE_COLUMN, unit_of
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import pair, percent
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import force_spread, state_scales
from vibroplat.integrate import engine_name
from vibroplat.model.systems import GAP, GAP_RATE
from vibroplat.results.result import Result
from vibroplat.study.classification import same_phase
from vibroplat.study.pool import Pool, run_tasks
from vibroplat.study.store import Store
from vibroplat.study.study import Progress, Study


class CrossCheck(NamedTuple):
    """What the check of a result has found.

    Attributes
    ----------
    other
        Name of the engine that checked it.
    checked
        How many motions were repeated.
    largest
        The largest difference of motions that agree, over the larger of the measure and its scale.
    disagreements
        A line for each motion that differs.
    """

    other: str
    checked: int
    largest: float
    disagreements: list[str]

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield lines that summarize it: label and text."""
        agreeing = self.checked - len(self.disagreements)
        text = f"{agreeing} of {self.checked} motions agree" if self.checked else "no motion can be repeated"
        text += f", measures within {percent(self.largest)}" if agreeing else ""
        yield "checked by" if self.checked else "not checked by", f"engine {self.other}, {text}"

    def to_tree(self) -> dict[str, Any]:
        """Return it as plain values."""
        return self._asdict()


_OTHER: Other = partial(with_other_engine, run=False)


def cross_check(
    study: Study,
    result: Result,
    store: Store,
    workers: Pool,
    progress: Progress = lambda done, known: None,
    *,
    other: Other = _OTHER,
) -> CrossCheck:
    """Repeat motions of a study with another engine.

    Parameters
    ----------
    study, result
        The study, and its result.
    store, workers
        As the study had them; repetitions are stored in a part of their own.
    progress
        Called with the numbers of motions that are done, and of all.
    other
        Makes the scene that checks a scene; by default the same one with another engine.
    """
    wanted, scene = study.cross_check_cases(result, store, other), study.scene
    tasks = [case.task for case in wanted]
    records = run_tasks(tasks, store.namespace("check"), workers, lambda done: progress(done, len(wanted)))
    engines, scales = (engine_name(scene), engine_name(other(scene))), scales_of(scene)
    largest, disagreements = 0.0, list[str]()
    for case, record in zip(wanted, records, strict=True):
        known = {name: None if pd.isna(value) else value for name, value in case.row.items()}
        # A motion and its mirror image have opposite phase differences; same_phase and sync say what they need to.
        names = [name for name in known if name != PHASE_COLUMN]
        if not known.get("period", 1):
            names = ["period"] if same_phase(known, record["row"]) else ["period", "sync"]
        apart = {name: _distance(known[name], record["row"].get(name), scales.get(name, 0.0)) for name in names}
        worst = max((size, name) for name, size in apart.items())
        if worst[0] <= case.allowed:
            largest = max(largest, worst[0])
            continue
        first, second = known.get(worst[1]), record["row"].get(worst[1])
        one, two = str(first), str(second)
        if isinstance(first, float) and isinstance(second, float):
            one, two = pair(first, second, unit_of(worst[1]))
        disagreements.append(
            f"engines disagree {case.place}: {worst[1]} = {one} ({engines[0]}) and {two} ({engines[1]})"
        )
    return CrossCheck(engines[1], len(wanted), largest, disagreements)


def _distance(one: Any, two: Any, scale: float) -> float:
    """Return how far two values are apart, over the larger of the first and its scale; 1 if they are no numbers."""
    if isinstance(one, float) and isinstance(two, float):
        return abs(one - two) / (max(abs(one), scale) or 1.0)
    return float(one != two)


def scales_of(scene: Scene) -> dict[str, float]:
    """Return the scales of the columns that are compared, in their units."""
    scales, speed = state_scales(scene), scene.speed_scale
    torque = sum(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    frequency = speed / TURN
    return {
        "excitation_frequency_hz": frequency,
        "frequency_split_hz": frequency,
        "rms_x_m": float(scales[0]),
        "rms_y_m": float(scales[1]),
        "rms_phi_rad": float(scales[2]),
        "amplitude_y_m": float(scales[1]),
        PHASE_COLUMN: 1.0,
        "phase_coherence": 1.0,
        "flight_fraction": 1.0,
        "impacts_per_period": 1.0,
        "gap_max_m": float(scales[GAP]),
        "contact_force_max_n": force_spread(scene),
        "impulse_max_n_s": scene.material_mass * float(scales[GAP_RATE]),
        "motor_power_w": torque * speed,
    }
