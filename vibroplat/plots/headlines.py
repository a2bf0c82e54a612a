"""What figures of runs show, in one sentence each, from the summaries of the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vibroplat.columns import split, unit_of
from vibroplat.config import digits
from vibroplat.observe.summary import synchronization
from vibroplat.plots.histories import Run
from vibroplat.results.labels import plain
from vibroplat.results.picture import sync_words
from vibroplat.results.run_answer import transient

#: How much larger the largest value of a whole run is than that in operation where it is told.
LARGER = 1.02


def headline(kind: str, runs: Sequence[Run]) -> str:
    """Return the title of a figure of runs: a sentence for one of them, the first number of each of several."""
    told = [_KINDS[kind](run) if kind in _KINDS else [] for run in runs]
    if len(runs) > 1:
        named = [f"{plain(run.name)}: {parts[0]}" for run, parts in zip(runs, told, strict=True) if parts]
        return "; ".join(dict.fromkeys(named)) or ", ".join(plain(run.name) for run in runs)
    sentence = "; ".join(told[0]) or plain(runs[0].name)
    return sentence[:1].upper() + sentence[1:]


def _number(summary: Mapping[str, Any], key: str) -> float | None:
    """Return a number of a summary, None if it has none."""
    value = summary.get(key)
    return float(value) if isinstance(value, int | float) and np.isfinite(value) else None


def _whole(run: Run, column: str, value: float) -> str:
    """Return the largest value of the whole run with its time, where it is larger than that in operation."""
    largest, time = (_number(run.summary, f"whole_{name}") for name in (column, f"{split(column)[0]}_at_s"))
    if largest is None or time is None or largest <= LARGER * value:
        return ""
    return f", {digits.quantity(largest, unit_of(column))} at {digits.quantity(time, 's')}"


def _stroke(run: Run) -> list[str]:
    """Say the stroke along the direction in which the platform moves farther, or how far it rocks if that is more."""
    sizes = {axis: _number(run.summary, f"rms_{axis}_m") or 0.0 for axis in "xy"}
    axis = max(sizes, key=lambda name: sizes[name])
    turn = _number(run.summary, "rms_phi_rad") or 0.0
    stroke = _number(run.summary, f"stroke_{axis}_m")
    if stroke is None or run.arm * turn > sizes[axis]:
        return [f"rocks, RMS φ {digits.quantity(turn, 'rad')}"] if turn else []
    return [f"stroke along {axis} {digits.quantity(stroke, 'm')}{_whole(run, f'stroke_{axis}_m', stroke)}"]


def _motion(run: Run) -> list[str]:
    flight = _number(run.summary, "flight_fraction")
    return [*_stroke(run), *([f"material flies {digits.share(flight)} of the time"] if flight else [])]


def _force(run: Run) -> list[str]:
    """Say the largest contact force and impulse in operation."""
    named = {"contact force": "contact_force_max_n", "impulses": "impulse_max_n_s"}
    known = {name: (_number(run.summary, column), unit_of(column)) for name, column in named.items()}
    return [f"{name} up to {digits.quantity(value, unit)}" for name, (value, unit) in known.items() if value]


def _loads(run: Run) -> list[str]:
    """Say the force into the foundation as static and dynamic, with its largest size, and the stroke."""
    mean, largest = (_number(run.summary, f"foundation_force_y_{end}_n") for end in ("mean", "max"))
    if mean is None or largest is None:
        return _stroke(run)
    told = digits.spread(abs(mean), largest - abs(mean), "N")
    return [f"foundation along y {told}{_whole(run, 'foundation_force_y_max_n', largest)}", *_stroke(run)]


def _exciters(run: Run) -> list[str]:
    """Say how exciters synchronize and since when, how fast they turn, and their slip."""
    frequency = _number(run.summary, "excitation_frequency_hz")
    if frequency is None:
        return []
    sync, since = sync_words(synchronization(run.summary)), _number(run.summary, "synchronized_at_s")
    when = f" from {digits.quantity(since, 's')} on" if since else ""
    now = transient(run.scene, run.summary) if run.scene is not None else ""
    known = [slip for n in (1, 2) if (slip := _number(run.summary, f"slip_{n}")) is not None]
    slips = [f"slip {digits.share(float(np.mean(known)))}"] if len(known) == 2 else []
    return [f"{sync}{when}", f"{digits.quantity(frequency, 'Hz')} {now or 'in operation'}", *slips]


def _acceleration(run: Run) -> list[str]:
    index, largest = (_number(run.summary, name) for name in ("gamma", "acceleration_max_m_per_s2"))
    told = [f"acceleration up to {digits.quantity(largest, 'm/s²')}"] if largest else []
    return told + ([] if index is None else [f"throw index {digits.number(index)}"])


_KINDS: Mapping[str, Callable[[Run], list[str]]] = {
    "acceleration": _acceleration,
    "spectrum": _acceleration,
    "motion": _motion,
    "force": _force,
    "loads": _loads,
    "exciters": _exciters,
}
