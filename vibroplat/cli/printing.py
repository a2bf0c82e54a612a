"""What commands print of their results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vibroplat.observe.trajectory import Trajectory

#: Width of the labels.
WIDTH = 28


def print_lines(lines: Mapping[str, str], width: int = WIDTH) -> None:
    """Print labels and texts in two columns."""
    for label, text in lines.items():
        print(f"{label:<{width}}{text}")


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]], most: int, more: str) -> None:
    """Print the first rows of a table of texts in columns; if they are not all, where the others are."""
    lines = [header, *rows]
    shown = lines[: most + 1]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for line in shown:
        print("  ".join(f"{text:<{width}}" for text, width in zip(line, widths, strict=True)).rstrip())
    if len(lines) > len(shown):
        print(f"… and {len(lines) - len(shown)} more: {more}")


def print_notes(notes: list[str]) -> None:
    """Print what is to be noted, a line each."""
    for note in notes:
        print(f"note: {note}")


def print_summary(result: Trajectory, directory: Path) -> None:
    """Print the most important results, first those of the measured part; summary.json holds all of them."""
    summary = result.summary
    kinds = ("liftoffs", "impacts", "latches")
    phases = "phi1-phi2" if result.scene.co_rotating else "phi1+phi2"
    rows = [
        ("outcome", summary["outcome"], ""),
        ("start", _start(result), ""),
        ("simulated", summary["simulated_s"], "s"),
        ("measured", _window(summary), ""),
        ("excitation frequency", summary["excitation_frequency_hz"], "Hz"),
        ("speeds of the exciters", _speeds(summary), "Hz"),
        (f"phase difference {phases}", *_phase(summary)),
        ("RMS x, y", [summary["rms_x_m"], summary["rms_y_m"]], "m"),
        ("RMS phi", summary["rms_phi_rad"], "rad"),
        ("contact force, largest", summary["contact_force_max_n"], "N"),
        ("gap, largest", summary["gap_max_m"] or None, "m"),
        ("impulse, largest", summary["impulse_max_n_s"] or None, "N s"),
        ("flight fraction", summary["flight_fraction"] if result.scene.has_contact else None, ""),
        ("liftoffs, impacts, latches", [summary[f"measured_{kind}"] for kind in kinds], ""),
        ("whole run: these counts", [summary[kind] for kind in kinds], ""),
        ("whole run: phi, largest", summary["phi_max_rad"], "rad"),
        ("whole run: energy residual", summary["energy_residual"], ""),
        *_work(summary),
        ("wall time", summary["wall_s"], "s"),
    ]
    for label, value, unit in rows:
        if value is not None:
            print(f"{label:<{WIDTH}}{_number(value)} {unit}".rstrip())
    print(f"{'tables':<{WIDTH}}{directory}")


def _work(summary: dict[str, Any]) -> list[tuple[str, Any, str]]:
    """Return the rows on the work done; engine ``taylor`` has no residual."""
    if summary["residual_calls"] is None:
        return [("steps", summary["steps"], "")]
    return [("steps, residual calls", [summary["steps"], summary["residual_calls"]], "")]


def _start(result: Trajectory) -> str:
    """Describe how a run began."""
    share, seed, origin = result.summary["perturbation"], result.scene.run.seed, result.origin
    changed = f"rates perturbed by {share:g} of their scales, seed {seed}" if share else "not perturbed"
    return changed if origin is None else f"where {origin['directory']} ended, {origin['t_s']:g} s; {changed}"


def _speeds(summary: dict[str, Any]) -> list[float] | None:
    """Return the mean speeds of both exciters (Hz) where they differ."""
    mean, split = summary["excitation_frequency_hz"], summary["frequency_split_hz"]
    return [mean + 0.5 * split, mean - 0.5 * split] if mean and abs(split) > 1e-3 * mean else None


def _phase(summary: dict[str, Any]) -> tuple[float | str | None, str]:
    """Return the mean phase difference with its unit, unless it drifts so much that it has no mean."""
    from vibroplat.observe.summary import COHERENCE

    drifts = summary["phase_coherence"] is not None and summary["phase_coherence"] < COHERENCE
    return ("drifts", "") if drifts else (summary["phase_difference_rad"], "rad")


def _window(summary: dict[str, Any]) -> str:
    """Describe the measured part of a run."""
    first, last, turns = (summary[f"measured_{key}"] for key in ("from_s", "to_s", "turns"))
    if last <= first:
        return f"nothing: the run ended before {_number(first)} s"
    return f"{_number(first)} … {_number(last)} s, {turns or 'no'} whole turn{'' if turns == 1 else 's'}"


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_number(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
