"""The summary of runs: the numbers that a person asks for first, then all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vibroplat.columns import unit_of
from vibroplat.page.labels import words

#: Keys shown first. Lengths are shown in mm.
FIRST = (
    "outcome",
    "simulated_s",
    "excitation_frequency_hz",
    "frequency_split_hz",
    "phase_difference_rad",
    "rms_x_m",
    "rms_y_m",
    "rms_phi_rad",
    "gap_max_m",
    "contact_force_max_n",
    "impulse_max_n_s",
    "flight_fraction",
    "impacts_per_period",
    "motor_power_w",
    "energy_residual",
)
#: Keys that are told elsewhere on the page.
_ELSEWHERE = ("name", "detail", "notes", "check")


def summary_rows(summaries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each key of some summaries: its words, its unit, its values and whether it is shown first."""
    keys = [key for key in FIRST if any(key in summary for summary in summaries)]
    keys += [key for key in dict.fromkeys(k for s in summaries for k in s) if key not in (*FIRST, *_ELSEWHERE)]
    return [_row(key, [summary.get(key) for summary in summaries]) for key in keys]


def _row(key: str, values: list[Any]) -> dict[str, Any]:
    in_mm = key.endswith("_m") and unit_of(key) == "m"
    shown = [1e3 * v if in_mm and isinstance(v, int | float) else v for v in values]
    return {"words": words(key), "unit": "mm" if in_mm else unit_of(key), "values": shown, "first": key in FIRST}


def remarks(label: str, summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what is to be noted of a run: how it failed, if it did, and its notes."""
    outcome, detail, notes = (summary.get(key) for key in ("outcome", "detail", "notes"))
    failed = [] if outcome in ("ok", None) else [f"{outcome}: {detail}"]
    told = [str(note) for note in notes] if isinstance(notes, list) else []
    check = summary.get("check")
    if isinstance(check, Mapping) and check.get("agrees") is False:
        failed.append("engines disagree")
    return [{"result": label, "text": text, "failed": text in failed} for text in (*failed, *told)]
