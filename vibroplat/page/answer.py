"""The answer of a result on the page: its headline, what is to be done, and what else was printed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from vibroplat.config.digits import quantity, share
from vibroplat.config.scene import Scene
from vibroplat.results.answer import Answer, first_failures
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult
from vibroplat.results.run_answer import headline, peak_text, static_and_dynamic, transient


def told_of(result: Result) -> Answer:
    """Return the answer of a result: of a run its headline and the numbers that it comes to."""
    if isinstance(result, RunResult):
        known = defaultdict(lambda: None, result.summary)  # results of former versions lack some
        told = headline(result.scene, known).removeprefix(f"{known['name']}: ")
        numbers, outcome = _numbers(result.scene, known), known["outcome"]
        failures = [f"{outcome}: {known['detail']}"] * (outcome not in ("ok", None))
        failures += ["engines disagree"] * ((known["check"] or {}).get("agrees") is False)
        short, notes = [numbers] * bool(numbers), known["notes"] or ()
        return Answer(notes=notes, failures=failures, headline=told[:1].upper() + told[1:], short=short)
    answer, check = result.answer, result.provenance.get("check") or {}
    failures = first_failures([*check.get("disagreements", ()), *answer.failures])
    return answer._replace(headline=answer.headline.removeprefix(f"{result.label}: "), failures=failures)


def _numbers(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Return the numbers that a run comes to: its motion, force into the foundation and power."""
    if summary["rms_y_m"] is None or summary["stroke_y_m"] is None:
        return ""
    axis = "x" if summary["rms_x_m"] > summary["rms_y_m"] else "y"
    now = transient(scene, summary)
    told = f"{now.capitalize()}: stroke" if now else "Stroke"
    told += f" {quantity(summary[f'stroke_{axis}_m'], 'm')} along {axis}"
    if (summary["rms_phi_rad"] or 0.0) * scene.body.distance > summary[f"rms_{axis}_m"]:
        told = f"Rotation {quantity(summary['rms_phi_rad'], 'rad')} RMS"
    if summary["flight_fraction"]:
        told += f", material in flight {share(summary['flight_fraction'])} of the time"
    sentences = [told]
    if force := static_and_dynamic(summary):
        peak = peak_text(summary, "foundation_force_y_max_n", "N")
        sentences.append(f"Force into the foundation {', '.join(filter(None, (force, peak)))}")
    if summary["motor_power_w"]:
        sentences.append(f"Motors {quantity(summary['motor_power_w'], 'W')}")
    return " ".join(f"{one}." for one in sentences)
