"""All numbers of a run in lines of a label and a text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.columns import split, unit_of
from vibroplat.config.digits import given, quantity, share
from vibroplat.config.scene import Scene
from vibroplat.observe.section import MAX_PERIOD
from vibroplat.observe.summary import synchronization
from vibroplat.results.answer import counted
from vibroplat.results.run_answer import peak_text, phase_text, speeds_of_both, sync_text


def main_results(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> dict[str, str]:
    """Return the most important results of the measured part of a run.

    ``origin`` is what provenance says of the run that it continues from, if any.
    """
    phases = "phi1-phi2" if scene.co_rotating else "phi1+phi2"
    counts, in_whole = (
        ", ".join(str(summary[f"{part}{kind}"]) for kind in ("liftoffs", "impacts", "chatters"))
        for part in ("measured_", "")
    )
    speeds = speeds_of_both(summary)
    flight = share(summary["flight_fraction"]) if scene.has_contact else None
    return _known(
        {
            "outcome": summary["outcome"],
            "start": _start(scene, summary, origin),
            "simulated": quantity(summary["simulated_s"], "s"),
            "measured": _window(scene, summary),
            "repeats after": _period(summary),
            "excitation frequency": _text(summary, "excitation_frequency_hz"),
            "speeds of the exciters": ", ".join(quantity(speed, "Hz") for speed in speeds) if speeds else None,
            f"phase difference {phases}": _phase(scene, summary),
            "RMS x, y": _strokes(summary),
            "RMS phi": _text(summary, "rms_phi_rad", _rotation(scene, summary)),
            "static sag": _text(summary, "static_sag_m"),
            "contact force, largest": _text(summary, "contact_force_max_n"),
            "gap, largest": _text(summary, "gap_max_m") if summary["gap_max_m"] else None,
            "impulse, largest": _text(summary, "impulse_max_n_s") if summary["impulse_max_n_s"] else None,
            "flight fraction": flight,
            **_conveying(summary),
            "liftoffs, impacts, chatters": f"{counts}; in the whole run {in_whole}",
        }
    )


def _conveying(summary: Mapping[str, Any]) -> dict[str, str | None]:
    """Return what a scene with transport tells of the material's motion along the deck."""
    if summary.get("conveying_speed_m_per_s") is None:
        return {}
    error, speed = summary["conveying_speed_error_m_per_s"], _text(summary, "conveying_speed_m_per_s")
    scatter = "" if error is None else f" ± {quantity(error, 'm/s', largest=abs(summary['conveying_speed_m_per_s']))}"
    slips = [share(summary[f"slip_{sense}_fraction"]) for sense in ("plus", "minus")]
    return {
        "conveying speed": f"{speed}{scatter}",
        "stick, slip towards +x, -x": f"{share(summary['stick_fraction'])}, {', '.join(slips)} of the time",
        "throughput": _text(summary, "throughput_kg_per_s"),
        "residence time": _text(summary, "residence_time_s"),
        "friction power": _text(summary, "friction_power_w"),
        "wear": _text(summary, "wear_power_w_per_m2"),
        "shear between the layers": None
        if summary["shear_ratio"] is None
        else f"{quantity(summary['shear_ratio'])} of their pressure",
    }


def data_sheet_lines(scene: Scene, summary: Mapping[str, Any]) -> dict[str, str]:
    """Return the data sheet of a run: of the measured part, then the largest values of the whole run.

    A summary from before there were data sheets has none.
    """
    if summary.get("foundation_force_y_rms_n") is None:
        return {}
    gravity, lines = scene.machine.gravity_m_per_s2, dict[str, str]()
    for name, unit, other in (("force_x", "n", "force_y"), ("force_y", "n", "force_x"), ("moment", "n_m", "moment")):
        columns = {how: f"foundation_{name}_{how}_{unit}" for how in ("max", "amplitude", "rms")}
        most = max(summary[columns["max"]], summary[f"foundation_{other}_max_{unit}"])
        parts = (
            [f"static {quantity(-summary['foundation_force_y_mean_n'], 'N')}"] if name == "force_y" and gravity else []
        )
        varies, rms = (_text(summary, columns[how], most) for how in ("amplitude", "rms"))
        parts += [*([f"dynamic ± {varies}"] if varies else []), f"RMS {rms}"]
        lines[f"{name.replace('_', ' ')} into foundation"] = _with_peak(summary, columns["max"], ", ".join(parts), most)
    named = {"": "", **{f" of {name}": f"_{name}" for name in scene.output.points}}
    for of, end in named.items():
        both = [f"stroke_{axis}{end}_m" for axis in ("x", "y")]
        most = max(summary[column] or 0.0 for column in both)
        lines |= {
            f"stroke {axis}{of}": _with_peak(summary, column, "", most) for axis, column in zip("xy", both, strict=True)
        }
    for of, end in named.items():
        column = f"acceleration_max{end}_m_per_s2"
        told = [f"{quantity(summary[column] / gravity)} g"] if gravity and summary[column] is not None else []
        told += [f"throw index gamma {quantity(summary['gamma'])}"] if gravity and not end else []
        lines[f"acceleration{of}"] = _with_peak(summary, column, ", ".join(told))
    for name in scene.output.springs:
        parts = [f"{what} {_text(summary, f'spring_force_{what}_{name}_n')}" for what in ("mean", "amplitude")]
        lines[f"force of a spring at {name}"] = _with_peak(summary, f"spring_force_max_{name}_n", ", ".join(parts))
    for n in (1, 2):
        lines |= _motor(summary, n)
    for n in (1, 2):
        lines[f"bearing of exciter {n}"] = _with_peak(summary, f"bearing_force_{n}_max_n", "centrifugal")
    if summary["synchronized_at_s"] is not None:
        work = f"after {quantity(summary['start_energy_j'], 'J')} of motor work"
        lines["synchronized"] = f"from {quantity(summary['synchronized_at_s'], 's')}, {work}"
    if summary["captured_by"]:
        lines["captured"] = f"by the resonance in {summary['captured_by']}"
    return lines


def _motor(summary: Mapping[str, Any], n: int) -> dict[str, str]:
    """Return what a data sheet says of a motor; shares are of its critical torque."""
    ratio, ratio_max = summary.get(f"torque_ratio_{n}"), summary.get(f"torque_ratio_{n}_max")
    of = [] if ratio is None else [f"{share(ratio)} of critical torque in the mean, {share(ratio_max)} at most"]
    means = [f"mean {_text(summary, f'motor_{name}')}" for name in (f"torque_{n}_mean_n_m", f"power_{n}_mean_w")]
    slip = [] if summary[f"slip_{n}"] is None else [f"slip {share(summary[f'slip_{n}'])}"]
    return {
        f"torque of motor {n}": _with_peak(summary, f"motor_torque_{n}_max_n_m", ", ".join([means[0], *of])),
        f"power of motor {n}": _with_peak(summary, f"motor_power_{n}_max_w", means[1]),
        f"speed of motor {n}": ", ".join([*slip, f"ripple {_text(summary, f'speed_ripple_{n}_hz')}"]),
    }


def whole_run_lines(summary: Mapping[str, Any]) -> dict[str, str]:
    """Return what is of the whole run, and the work done."""
    steps, calls = summary["steps"], summary["residual_calls"]  # engine taylor has no residual
    work = {"steps": str(steps)} if calls is None else {"steps, residual calls": f"{steps}, {calls}"}
    residual = summary["energy_residual"]
    return _known(
        {
            "phi, largest": f"{_text(summary, 'phi_max_rad')} in the whole run",
            "energy residual": None if residual is None else f"{residual:.1e} of the energy converted",
            **work,
            "wall time": quantity(summary["wall_s"], "s"),
        }
    )


def _with_peak(summary: Mapping[str, Any], column: str, more: str = "", largest: float | None = None) -> str:
    """Write the largest value of the measured part, what qualifies it, and the largest one of the whole run."""
    whole, at = peak_text(summary, column, unit_of(column)), summary.get(f"whole_{split(column)[0]}_at_s")
    inside = at is None or summary["measured_from_s"] <= at <= summary["measured_to_s"]
    if inside and summary[f"whole_{column}"] == summary[column]:
        told = whole.partition(" at ")[2] and f"that at {whole.partition(' at ')[2]}"
    else:
        told = whole and f"whole run: {whole.removeprefix('largest ')}"
    return "; ".join(filter(None, (", ".join(filter(None, (_text(summary, column, largest), more))), told)))


def _text(summary: Mapping[str, Any], column: str, largest: float | None = None) -> str | None:
    """Write a value of a summary with its unit, one next to nothing beside the largest as 0; None if it has none."""
    value = summary.get(column)
    return None if value is None else quantity(value, unit_of(column), largest=largest)


def _strokes(summary: Mapping[str, Any]) -> str | None:
    """Write the RMS along both axes."""
    found = [summary["rms_x_m"], summary["rms_y_m"]]
    return None if None in found else ", ".join(quantity(one, "m", largest=max(found)) for one in found)


def _rotation(scene: Scene, summary: Mapping[str, Any]) -> float:
    """Return the rotation (rad) that moves the exciters' axes as far as the RMS of the platform along x or y."""
    return max(summary["rms_x_m"] or 0.0, summary["rms_y_m"] or 0.0) / scene.body.distance


def _known(lines: Mapping[str, str | None]) -> dict[str, str]:
    """Leave out what is not known."""
    return {label: text for label, text in lines.items() if text is not None}


def _start(scene: Scene, summary: Mapping[str, Any], origin: Mapping[str, Any] | None) -> str:
    """Describe how a run began."""
    size, seed = summary["perturbation"], scene.run.seed
    changed = f"rates perturbed by {given(size)} of their scales, seed {seed}" if size else "not perturbed"
    return changed if origin is None else f"where {origin['directory']} ended, {given(origin['t_s'])} s; {changed}"


def _phase(scene: Scene, summary: Mapping[str, Any]) -> str | None:
    """Return the mean phase difference and its name, unless it drifts so much that it has no mean."""
    phase = phase_text(summary)
    if phase is None or phase == "drifts":
        return phase
    return phase if synchronization(summary) == "none" else f"{phase}, {sync_text(scene, summary)}"


def _window(scene: Scene, summary: Mapping[str, Any]) -> str:
    """Describe the measured part of a run."""
    first, last, turns = (summary[f"measured_{key}"] for key in ("from_s", "to_s", "turns"))
    if last <= first:
        return f"nothing: the run ended before {quantity(first, 's')}"
    coasting = "" if any(scene.driven(last, last)) else ", motors off"
    whole = counted(turns, "whole turn") if turns else "no whole turns"
    return f"{quantity(first, 's')} … {quantity(last, 's')}, {whole}{coasting}"


def _period(summary: Mapping[str, Any]) -> str | None:
    """Say after how many turns a motion repeats; a summary from before this was told has none."""
    turns = summary.get("period")
    if turns == 0:
        return f"not yet, or not within {MAX_PERIOD} turns"
    return counted(turns, "turn") if turns else None
