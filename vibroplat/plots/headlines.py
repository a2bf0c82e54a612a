"""What figures of runs show, in one sentence each: computed from the summaries of the runs and their tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from vibroplat.columns import split, unit_of
from vibroplat.config import digits
from vibroplat.plots.histories import Run
from vibroplat.plots.timelines import phase_of
from vibroplat.results.labels import plain

#: How much larger the largest value of a whole run is than that in operation where it is told.
LARGER = 1.02
#: Distance of a phase difference from 0 and from π up to which exciters are in phase, or in antiphase (rad).
IN_STEP = np.pi / 3.0
#: Turns at the end of a run by which synchronization is judged.
LAST = 10.0


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
    unit, names = unit_of(column), (column, f"{split(column)[0]}_at_s")
    largest, time = (_number(run.summary, f"whole_{name}") for name in names)
    if largest is None or time is None or largest <= LARGER * value:
        return ""
    return f", {digits.quantity(largest, unit)} at {digits.quantity(time, 's')}"


def _stroke(run: Run) -> list[str]:
    """Say the stroke along the direction in which the platform moves farther, or how far it rocks if that is more."""
    sizes = {axis: _number(run.summary, f"rms_{axis}_m") or 0.0 for axis in "xy"}
    axis = max(sizes, key=lambda name: sizes[name])
    turn = _number(run.summary, "rms_phi_rad") or 0.0
    arm = run.scene.body.distance if run.scene else 0.0
    if arm * turn > sizes[axis]:
        return [f"rocks, RMS φ {digits.quantity(turn, 'rad')}"]
    stroke = _number(run.summary, f"stroke_{axis}_m")
    if stroke is None:
        return [f"RMS {axis} {digits.quantity(sizes[axis], 'm')}"]
    return [f"stroke along {axis} {digits.quantity(stroke, 'm')}{_whole(run, f'stroke_{axis}_m', stroke)}"]


def _motion(run: Run) -> list[str]:
    flight = _number(run.summary, "flight_fraction")
    return [*_stroke(run), *([f"material flies {digits.share(flight)} of the time"] if flight else [])]


def _largest(named: Mapping[str, str], run: Run) -> list[str]:
    """Say the largest values of quantities in operation, by their names."""
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
    """Say how exciters synchronize at the end and since when, how fast they turn, and their slip."""
    told = synchronization(run)
    frequency = _number(run.summary, "excitation_frequency_hz")
    if frequency is not None:
        told.append(f"{digits.quantity(frequency, 'Hz')} in operation")
    known = [slip for n in (1, 2) if (slip := _number(run.summary, f"slip_{n}")) is not None]
    return told + ([f"slip {digits.share(float(np.mean(known)))}"] if len(known) == 2 else [])


def synchronization(run: Run) -> list[str]:
    """Say how exciters synchronize at the end of the interval, and since when; nothing where that is not known."""
    phase, times = phase_of(run.whole, co_rotating=run.co_rotating), run.whole["t_s"].to_numpy(dtype=float)
    turns = run.whole["phi1_rad"].to_numpy(dtype=float) / (2.0 * np.pi)
    last = np.abs(turns - turns[-1]) <= LAST
    if len(phase) < 3 or not np.isfinite(phase).all() or np.ptp(turns[last]) < 1.0:
        return []
    for name, centre in (("in-phase", 0.0), ("antiphase", np.pi)):
        away = np.abs(np.angle(np.exp(1j * (phase - centre)))) > IN_STEP
        if not away[last].any():
            before = np.flatnonzero(away)
            since = float(times[before[-1] + 1]) if len(before) else None
            return [f"{name} throughout" if since is None else f"{name} from {digits.quantity(since, 's')} on"]
    return ["neither in phase nor in antiphase at the end"]


def _acceleration(run: Run) -> list[str]:
    index = _number(run.summary, "gamma")
    largest = _largest({"acceleration": "acceleration_max_m_per_s2"}, run)
    return largest + ([] if index is None else [f"throw index {digits.number(index)}"])


_KINDS: Mapping[str, Callable[[Run], list[str]]] = {
    "acceleration": _acceleration,
    "spectrum": _acceleration,
    "motion": _motion,
    "force": partial(_largest, {"contact force": "contact_force_max_n", "impulses": "impulse_max_n_s"}),
    "loads": _loads,
    "exciters": _exciters,
}
