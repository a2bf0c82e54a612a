"""A run in a few lines: label and text of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vibroplat.columns import SHAKING, split
from vibroplat.config.scene import Scene
from vibroplat.observe.summary import COHERENCE, synchronization


def results(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> dict[str, str]:
    """Return the most important results of the measured part of a run.

    ``origin`` is what provenance says of the run that it goes on from, if any.
    """
    phases = "phi1-phi2" if scene.co_rotating else "phi1+phi2"
    counts, in_whole = (
        ", ".join(str(summary[f"{part}{kind}"]) for kind in ("liftoffs", "impacts", "latches"))
        for part in ("measured_", "")
    )
    return _lines(
        ("outcome", summary["outcome"], ""),
        ("start", _start(scene, summary, origin), ""),
        ("simulated", summary["simulated_s"], "s"),
        ("measured", _window(summary), ""),
        ("repeats after", _period(summary), ""),
        ("excitation frequency", summary["excitation_frequency_hz"], "Hz"),
        ("speeds of the exciters", _speeds(summary), "Hz"),
        (f"phase difference {phases}", *_phase(scene, summary)),
        ("RMS x, y", [_mm(summary["rms_x_m"]), _mm(summary["rms_y_m"])], "mm"),
        ("RMS phi", summary["rms_phi_rad"], "rad"),
        ("static sag", _mm(summary.get("static_sag_m")), "mm"),
        ("contact force, largest", summary["contact_force_max_n"], "N"),
        ("gap, largest", _mm(summary["gap_max_m"]) or None, "mm"),
        ("impulse, largest", summary["impulse_max_n_s"] or None, "N·s"),
        ("flight fraction", summary["flight_fraction"] if scene.has_contact else None, ""),
        ("liftoffs, impacts, latches", f"{counts}; in the whole run {in_whole}", ""),
    )


def sheet(scene: Scene, summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the data sheet of a run: in the measured part and, after "whole run", the largest values of all of it.

    A summary from before there were data sheets has none.
    """
    if summary.get("foundation_force_y_rms_n") is None:
        return {}
    gravity = scene.machine.gravity_m_per_s2 or math.nan
    force = {}
    for label, name, unit, written, mean in (
        ("force x into foundation", "force_x", "n", "N", ""),
        ("force y into foundation", "force_y", "n", "N", f"mean {_short(summary, 'foundation_force_y_mean_n')}, "),
        ("moment into foundation", "moment", "n_m", "N·m", ""),
    ):
        most, rms = f"foundation_{name}_max_{unit}", _short(summary, f"foundation_{name}_rms_{unit}")
        force[label] = f"{_short(summary, most)} {written}, {mean}RMS {rms}{_peak(summary, most, written)}"
    strokes = {"stroke x": "stroke_x_m", "stroke y": "stroke_y_m"}
    for name in scene.output.points:
        strokes |= {f"stroke {axis} of {name}": f"stroke_{axis}_{name}_m" for axis in ("x", "y")}
    lines = {
        label: f"{_short(summary, name, 1e3)} mm{_peak(summary, name, 'mm', 1e3)}" for label, name in strokes.items()
    }
    column = "acceleration_max_m_per_s2"
    throw = f" ({_short(summary, column, 1.0 / gravity)} g), gamma {_short(summary, 'gamma')}" if gravity > 0.0 else ""
    lines["acceleration"] = f"{_short(summary, column)} m/s²{throw}{_peak(summary, column, 'm/s²')}"
    for n in (1, 2):
        torque, power = f"motor_torque_{n}", f"motor_power_{n}"
        share = summary[f"torque_share_{n}"]
        critical = "" if share is None else f" ({100.0 * share:.3g} % of critical)"
        lines[f"torque of motor {n}"] = (
            f"mean {_short(summary, f'{torque}_mean_n_m')} N·m{critical}, "
            f"largest {_short(summary, f'{torque}_max_n_m')}{_peak(summary, f'{torque}_max_n_m', 'N·m')}"
        )
        slip = "" if summary[f"slip_{n}"] is None else f", slip {100.0 * summary[f'slip_{n}']:.3g} %"
        lines[f"power of motor {n}"] = (
            f"mean {_short(summary, f'{power}_mean_w')} W, largest {_short(summary, f'{power}_max_w')}{slip}, "
            f"ripple {_short(summary, f'speed_ripple_{n}_hz')} Hz{_peak(summary, f'{power}_max_w', 'W')}"
        )
    bearings = ", ".join(_short(summary, f"bearing_force_{n}_max_n") for n in (1, 2))
    lines["bearings, centrifugal"] = f"{bearings} N"
    at = summary["synchronized_at_s"]
    if at is not None:
        lines["in step"] = f"from {_number(at)} s on, after {_short(summary, 'start_energy_j')} J"
    if summary["captured_by"]:
        lines["captured"] = f"by the resonance in {summary['captured_by']}"
    return force | lines


def _short(summary: Mapping[str, Any], column: str, factor: float = 1.0) -> str:
    """Write a value of a summary with three digits."""
    value = summary[column]
    return "none" if value is None else f"{factor * value:.3g}"


def _peak(summary: Mapping[str, Any], column: str, unit: str, factor: float = 1.0) -> str:
    """Write the largest value of the whole run, where it is not that of the measured part."""
    base, value = split(column)[0], summary[f"whole_{column}"]
    if value is None or value == summary[column]:
        return ""
    at, pace = summary[f"whole_{base}_at_s"], summary[f"whole_{base}_at_hz"]
    return f"; whole run {factor * value:.3g} {unit} at {at:.4g} s, {pace:.3g} Hz"


def whole(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return what is of the whole run, and the work done."""
    steps, calls = summary["steps"], summary["residual_calls"]  # engine taylor has no residual
    return _lines(
        ("phi, largest in whole run", summary["phi_max_rad"], "rad"),
        ("energy residual", summary["energy_residual"], ""),
        ("steps", steps, "") if calls is None else ("steps, residual calls", [steps, calls], ""),
        ("wall time", summary["wall_s"], "s"),
    )


def _lines(*rows: tuple[str, Any, str]) -> dict[str, str]:
    """Write values with their units; None is left out."""
    return {label: f"{_number(value)} {unit}".rstrip() for label, value, unit in rows if value is not None}


def _mm(metres: float | None) -> float | None:
    return None if metres is None else 1e3 * metres


def _start(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> str:
    """Describe how a run began."""
    share, seed = summary["perturbation"], scene.run.seed
    changed = f"rates perturbed by {share:g} of their scales, seed {seed}" if share else "not perturbed"
    return changed if origin is None else f"where {origin['directory']} ended, {origin['t_s']:g} s; {changed}"


def _speeds(summary: Mapping[str, Any]) -> list[float] | None:
    """Return the mean speeds of both exciters (Hz) where they differ."""
    mean, split = summary["excitation_frequency_hz"], summary["frequency_split_hz"]
    return [mean + 0.5 * split, mean - 0.5 * split] if mean and abs(split) > 1e-3 * mean else None


def _phase(scene: Scene, summary: Mapping[str, Any]) -> tuple[float | str | None, str]:
    """Return the mean phase difference with its unit, unless it drifts so much that it has no mean."""
    drifts = summary["phase_coherence"] is not None and summary["phase_coherence"] < COHERENCE
    if drifts or summary["phase_difference_rad"] is None:
        return ("drifts" if drifts else None), ""
    named = synchronization(summary)
    shakes = SHAKING.get((scene.rotation, named))
    mainly = "" if scene.has_mirrored_exciters else "mainly "
    return summary["phase_difference_rad"], "rad" if named == "none" else (
        f"rad, {named}" + (f": shakes {mainly}{shakes}" if shakes else "")
    )


def _window(summary: Mapping[str, Any]) -> str:
    """Describe the measured part of a run."""
    first, last, turns = (summary[f"measured_{key}"] for key in ("from_s", "to_s", "turns"))
    if last <= first:
        return f"nothing: the run ended before {_number(first)} s"
    return f"{_number(first)} … {_number(last)} s, {turns or 'no'} whole turn{'' if turns == 1 else 's'}"


def _period(summary: Mapping[str, Any]) -> str | None:
    """Say after how many turns a motion repeats; a summary from before this was told has none."""
    turns = summary.get("period")
    return turns and f"{turns} turn{'' if turns == 1 else 's'} of exciter 1"


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_number(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
