"""The answer of a result on the page: its headline, what is to be done, and what else was printed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vibroplat.config.digits import quantity, share, spread
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult
from vibroplat.results.run_answer import headline

#: Most failures of a result that are told.
MOST_FAILURES = 5


@dataclass(frozen=True)
class Told:
    """What a page tells of a result first.

    Attributes
    ----------
    headline, more
        The answer in a sentence, and the numbers of a run.
    short
        A few lines below it.
    lines, text
        Labels and texts of all that was printed, and lines below them.
    notes, failures
        What is to be noted, and what failed.
    """

    headline: str
    more: str = ""
    short: tuple[str, ...] = ()
    lines: Mapping[str, str] = field(default_factory=dict)
    text: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()


def told_of(result: Result) -> Told:
    """Return the answer of a result."""
    failures, name = _failures(result), f"{result.label}: "
    if isinstance(result, RunResult):
        known = defaultdict(lambda: None, result.summary)  # results of former versions lack some
        told = headline(result.scene, known).removeprefix(f"{known['name']}: ")
        notes = tuple(_texts(result.summary.get("notes")))
        return Told(told[:1].upper() + told[1:], _numbers(result), notes=notes, failures=failures)
    answer = result.answer
    told = answer.headline.removeprefix(name)
    return Told(told, "", tuple(answer.short), answer.lines, tuple(answer.text), tuple(answer.notes), failures)


def _texts(found: Any) -> list[str]:
    return [str(text) for text in found] if isinstance(found, list) else []


def _failures(result: Result) -> tuple[str, ...]:
    """Return what failed of a result, a few of many."""
    told: Mapping[str, Any] = result.summary if isinstance(result, RunResult) else result.answer.to_tree()
    check = result.summary.get("check") if isinstance(result, RunResult) else result.provenance.get("check")
    outcome = told.get("outcome")
    failed = [] if outcome in ("ok", None) else [f"{outcome}: {told.get('detail')}"]
    if isinstance(check, Mapping):
        failed += ["engines disagree"] if check.get("agrees") is False else _texts(check.get("disagreements"))
    failed += _texts(told.get("failures"))
    more = len(failed) - MOST_FAILURES
    return (*failed[:MOST_FAILURES], *([f"{more} more"] if more > 0 else []))


def _numbers(result: RunResult) -> str:
    """Return the numbers that a run comes to: its motion, force into the foundation and power."""
    s = result.summary
    if s.get("rms_y_m") is None:
        return ""
    axis = "x" if s["rms_x_m"] > s["rms_y_m"] else "y"
    stroke = s.get(f"stroke_{axis}_m")
    told = f"Stroke {quantity(stroke, 'm')}" if stroke is not None else f"RMS {quantity(s[f'rms_{axis}_m'], 'm')}"
    told += f" along {axis}"
    if (s.get("rms_phi_rad") or 0.0) * result.scene.body.distance > s[f"rms_{axis}_m"]:
        told = f"Rotation {quantity(s['rms_phi_rad'], 'rad')} RMS"
    flies = f", material in flight {share(s['flight_fraction'])} of the time" if s.get("flight_fraction") else ""
    power = [f"Motors {quantity(s['motor_power_w'], 'W')}."] if s.get("motor_power_w") else []
    return " ".join([f"{told}{flies}.", *_force(s), *power])


def _force(s: Mapping[str, Any]) -> list[str]:
    """Return the force into the foundation, static and dynamic, and the largest one with the start."""
    mean, most = s.get("foundation_force_y_mean_n"), s.get("foundation_force_y_max_n")
    if mean is None or most is None:
        return []
    around = s.get("foundation_force_y_amplitude_n")
    around = max(most - abs(mean), 0.0) if around is None else around
    whole, at = (s.get(f"whole_foundation_force_y_max_{end}") for end in ("n", "at_s"))
    peak = f", largest {quantity(whole, 'N')} at {quantity(at, 's')}" if whole and at is not None else ""
    return [f"Force into the foundation {spread(-mean, around, 'N')}{peak}."]
