"""A run in a few lines: label and text of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.columns import describe_sync, split
from vibroplat.config.plausibility import as_text
from vibroplat.config.scene import Scene
from vibroplat.observe.section import MAX_PERIOD
from vibroplat.observe.summary import COHERENCE, synchronization


def main_results(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> dict[str, str]:
    """Return the most important results of the measured part of a run.

    ``origin`` is what provenance says of the run that it continues from, if any.
    """
    phases = "phi1-phi2" if scene.co_rotating else "phi1+phi2"
    counts, in_whole = (
        ", ".join(str(summary[f"{part}{kind}"]) for kind in ("liftoffs", "impacts", "chatters"))
        for part in ("measured_", "")
    )
    return _lines(
        ("outcome", summary["outcome"], ""),
        ("start", _start(scene, summary, origin), ""),
        ("simulated", summary["simulated_s"], "s"),
        ("measured", _window(scene, summary), ""),
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
        ("liftoffs, impacts, chatters", f"{counts}; in the whole run {in_whole}", ""),
    )


def data_sheet_lines(scene: Scene, summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the data sheet of a run: of the measured part and, after "whole run", the largest values of all of it.

    A summary from before there were data sheets has none.
    """
    if summary.get("foundation_force_y_rms_n") is None:
        return {}
    gravity = scene.machine.gravity_m_per_s2
    lines = {}
    for name, unit, written in (("force_x", "n", "N"), ("force_y", "n", "N"), ("moment", "n_m", "N·m")):
        most, rms = f"foundation_{name}_max_{unit}", _short(summary, f"foundation_{name}_rms_{unit}")
        weighs = name == "force_y" and gravity > 0.0
        mean = _short(summary, "foundation_force_y_mean_n", -1.0)
        static, about = (f", static {mean} {written}", " about it") if weighs else ("", "")
        lines[f"{name.replace('_', ' ')} into foundation"] = (
            f"largest {_short(summary, most)} {written}{static}, RMS {rms}{about}{_peak(summary, most, written)}"
        )
    strokes = {"stroke x": "stroke_x_m", "stroke y": "stroke_y_m"}
    for name in scene.output.points:
        strokes |= {f"stroke {axis} of {name}": f"stroke_{axis}_{name}_m" for axis in ("x", "y")}
    lines |= {
        label: f"{_short(summary, name, 1e3)} mm{_peak(summary, name, 'mm', 1e3)}" for label, name in strokes.items()
    }
    for label, point in {
        "acceleration": "",
        **{f"acceleration of {name}": f"_{name}" for name in scene.output.points},
    }.items():
        column = f"acceleration_max{point}_m_per_s2"
        throw = f" ({_short(summary, column, 1.0 / gravity)} g)" if gravity > 0.0 else ""
        index = f", throw index gamma {_short(summary, 'gamma')}" if gravity > 0.0 and not point else ""
        lines[label] = f"largest {_short(summary, column)} m/s²{throw}{index}{_peak(summary, column, 'm/s²')}"
    for n in (1, 2):
        lines |= _motor(summary, n)
    for n in (1, 2):
        column = f"bearing_force_{n}_max_n"
        peak = _peak(summary, column, "N")
        lines[f"bearing of exciter {n}"] = f"largest centrifugal force {_short(summary, column)} N{peak}"
    at = summary["synchronized_at_s"]
    if at is not None:
        lines["in step"] = f"from {at:.4g} s, after {_short(summary, 'start_energy_j')} J of motor work"
    if summary["captured_by"]:
        lines["captured"] = f"by the resonance in {summary['captured_by']}"
    return lines


def _motor(summary: Mapping[str, Any], n: int) -> dict[str, str]:
    """Return what a data sheet says of a motor; shares are of its critical torque."""
    torque, power, share = f"motor_torque_{n}", f"motor_power_{n}", f"torque_ratio_{n}"
    shares = {name: summary.get(name) for name in (share, f"{share}_max", f"whole_{share}_max")}
    mean, most, whole = ("" if one is None else f" ({100.0 * one:.3g} %)" for one in shares.values())
    of = " of critical)" if mean else ""
    most_column, peak = f"{torque}_max_n_m", _peak(summary, f"{torque}_max_n_m", f"N·m{whole}")
    slip = "" if summary[f"slip_{n}"] is None else f"slip {100.0 * summary[f'slip_{n}']:.3g} %, "
    return {
        f"torque of motor {n}": f"mean {_short(summary, f'{torque}_mean_n_m')} N·m{mean.replace(')', of)}, "
        f"largest {_short(summary, most_column)} N·m{most}{peak}",
        f"power of motor {n}": f"mean {_short(summary, f'{power}_mean_w')} W, "
        f"largest {_short(summary, f'{power}_max_w')} W{_peak(summary, f'{power}_max_w', 'W')}",
        f"speed of motor {n}": f"{slip}ripple {_short(summary, f'speed_ripple_{n}_hz')} Hz",
    }


def _short(summary: Mapping[str, Any], column: str, factor: float = 1.0) -> str:
    """Write a value of a summary with three digits."""
    value = summary[column]
    return "none" if value is None else as_text(factor * value)


def _peak(summary: Mapping[str, Any], column: str, unit: str, factor: float = 1.0) -> str:
    """Write the largest value of the whole run, unless it is that of the measured part; its time and speed if known."""
    base, value = split(column)[0], summary[f"whole_{column}"]
    if not value:
        return ""
    whole = f"whole run: {as_text(factor * value)} {unit}"
    at, pace = (summary.get(f"whole_{base}_at_{end}") for end in ("s", "hz"))
    if at is None:
        return "" if value == summary[column] else f"; {whole}"
    same = value == summary[column] and summary["measured_from_s"] <= at <= summary["measured_to_s"]
    speed = "" if pace is None else f", {pace:.3g} Hz"
    return f"; {'that' if same else whole} at {at:.4g} s{speed}"


def whole_run_lines(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return what is of the whole run, and the work done."""
    steps, calls = summary["steps"], summary["residual_calls"]  # engine taylor has no residual
    return _lines(
        ("phi, largest", summary["phi_max_rad"], "rad in the whole run"),
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
    told = describe_sync(named, scene.rotation)
    if not scene.has_mirrored_exciters:
        told = told.replace(": ", ": mainly ")
    return summary["phase_difference_rad"], "rad" if named == "none" else f"rad, {told}"


def _window(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Describe the measured part of a run."""
    first, last, turns = (summary[f"measured_{key}"] for key in ("from_s", "to_s", "turns"))
    if last <= first:
        return f"nothing: the run ended before {_number(first)} s"
    coasting = "" if any(scene.driven(last, last)) else ", motors off"
    return f"{_number(first)} … {_number(last)} s, {turns or 'no'} whole turn{'' if turns == 1 else 's'}{coasting}"


def _period(summary: Mapping[str, Any]) -> str | None:
    """Say after how many turns a motion repeats; a summary from before this was told has none."""
    turns = summary.get("period")
    if turns == 0:
        return f"not yet, or not within {MAX_PERIOD} turns"
    return turns and f"{turns} turn{'' if turns == 1 else 's'}"


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_number(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
