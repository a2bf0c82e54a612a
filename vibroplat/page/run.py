"""A run on the page: its curves, its events and the machine that moves; and how numbers are packed as text."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.columns import display_unit
from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.errors import TableError
from vibroplat.plots.reading import Cut, Ends, rest_of
from vibroplat.plots.timelines import wrapped
from vibroplat.results.picture import finite
from vibroplat.results.run import RunResult

#: Most rows of all runs together that are kept as they are, each of 80 bytes: 25 s at 2000 Hz with their events.
ROWS = 52_000
#: Most impacts of a run, which are drawn one by one.
IMPACTS = 5000
#: Intervals over the whole run, of which the smallest and the largest value are kept where it has more rows.
INTERVALS = 1000
#: Turns of the exciters that are shown first.
SHOWN_TURNS = 10
#: Change of an exciter's speed over a run, as a share of its largest speed, from which on the run is a start or a stop.
CHANGE = 0.1
#: Largest of the whole numbers that curves of orbits are packed as.
STEPS = 65534

SPEEDS = ("phi1_rate_rad_per_s", "phi2_rate_rad_per_s")
_NEEDED = ("t_s", "x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", *SPEEDS)
_OPTIONAL = ("gap_m", "upper_m", "contact_force_n", "motor_power_1_w", "motor_power_2_w", "supply_frequency_hz")

#: Panels: title, unit, and the columns of its curves with their labels.
PANELS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("platform y from rest", "mm", {"y_m": ""}),
    ("gap", "mm", {"gap_m": ""}),
    ("contact force", "N", {"contact_force_n": ""}),
    ("impulse", "N·s", {}),  # stems, of the events
    ("platform x", "mm", {"x_m": ""}),
    ("rotation φ", "mrad", {"phi_rad": ""}),
    ("upper layer against lower one", "mm", {"upper_m": ""}),
    ("speed", "Hz", {"speed_1": "exciter 1", "speed_2": "exciter 2", "synchronous": "synchronous"}),
    ("phase difference", "rad", {"phase": ""}),
    ("motor power", "W", {"motor_power_1_w": "exciter 1", "motor_power_2_w": "exciter 2"}),
)
#: Most decimals of a value at the cursor.
DECIMALS = 6


def packed(values: npt.ArrayLike) -> str:
    """Return numbers as base64 of 32-bit floats, whose 7 digits are more than a screen shows."""
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def packed_coarsely(values: npt.ArrayLike) -> tuple[float, float, str]:
    """Return the smallest and the largest number, and all as base64 of 16-bit parts of their range; 65535 is missing.

    That is 1.5e-5 of the range: far less than a pixel.
    """
    numbers = np.asarray(values, dtype=float)
    known = numbers[np.isfinite(numbers)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    parts = np.nan_to_num(
        (numbers - low) / (high - low or 1.0) * STEPS, nan=STEPS + 1, posinf=STEPS + 1, neginf=STEPS + 1
    )
    return low, high, base64.b64encode(parts.round().astype("<u2").tobytes()).decode("ascii")


def is_transient(ends: Ends, scene: Scene) -> bool:
    """Whether the supply has a corner or a speed changes during a run: it is looked at from its beginning."""
    first, last = float(ends.first["t_s"]), float(ends.last["t_s"])
    before, after = (row[list(SPEEDS)].to_numpy(dtype=float) for row in (ends.first, ends.last))
    changes = np.abs(after - before) > CHANGE * max(np.abs(before).max(), np.abs(after).max())
    supply = scene.drive.intervals
    ramps = any(one.ramp and one.start < last and one.end > first for one in supply)
    switches = any(first < one.start < last for one in supply)
    return bool(changes.any()) or ramps or switches


def run_data(
    found: RunResult,
    events: pd.DataFrame,
    ends: Ends,
    most: int,
    start: float | None,
    stop: float | None,
    *,
    from_beginning: bool = False,
    from_mean: bool = False,
) -> dict[str, Any]:
    """Return what the page shows of a run with two rows or more.

    Parameters
    ----------
    found, events, ends
        The result of the run, its events, and the ends of its trajectory.
    most
        Most rows that are kept as they are: the last ones of the interval.
    start, stop
        The interval of these rows (s). Default: the whole run.
    from_beginning
        The first rows are kept instead of the last ones.
    from_mean
        Speeds are counted from the mean of the run.

    Raises
    ------
    TableError
        A table is missing or of another run, or the interval is empty.
    """
    first, last = float(ends.first["t_s"]), float(ends.last["t_s"])
    begin, end = first if start is None else start, last if stop is None else stop
    curves = [name for _, _, labels in PANELS for name in labels]
    frequency = found.summary.get("excitation_frequency_hz")
    parts = _parts(found, (frequency or 0.0) if from_mean else 0.0)
    cut = Cut(parts, (begin, end), (first, last, INTERVALS), curves, most=most if from_beginning else -most)
    if cut.shown["t_s"].nunique() < 2:
        allowed = f"allowed: an interval within {first:g} … {last:g} s"
        raise TableError(f"no data between {begin:g} and {end:g} s in {found.directory}; {allowed}")
    t, numbers = cut.shown["t_s"].to_numpy(), cut.shown.drop(columns="mode")
    coarse = {
        name: {"t": packed(samples["t_s"] - first), "values": packed(samples[name])}
        for name, samples in cut.extremes().items()
    }
    return {
        "first": first,
        "last": last,
        "origin": t[0],
        "end": t[-1],
        "rows": len(t),
        "of": ends.rows,
        "turns": frequency if isinstance(frequency, int | float) and frequency * (last - first) >= 1.0 else None,
        "columns": {name: packed(values) for name, values in numbers.assign(t_s=t - t[0]).items()},
        "largest": numbers.abs().max().fillna(0.0).to_dict(),
        "modes": "".join(cut.shown["mode"].map(initial)),
        "coarse": None if len(t) == ends.rows else coarse,
        "impacts": impacts_of(events, t[0], t[-1]),
        "machine": machine_of(found.scene),
    }


def _parts(found: RunResult, mean: float) -> Iterator[pd.DataFrame]:
    """Read the trajectory in parts, with what follows from its columns; speeds (Hz) are counted from a mean."""
    sign, rest = -1.0 if found.scene.co_rotating else 1.0, rest_of(found.scene)
    forward = [exciter.direction / (2.0 * np.pi) for exciter in found.scene.exciter_pair]
    for part in map(finite, found.column_parts("trajectory", ("mode",), _NEEDED, _OPTIONAL)):
        table = part.assign(
            y_m=part["y_m"] - rest,
            phase=wrapped((part["phi1_rad"] + sign * part["phi2_rad"]).to_numpy(dtype=float)),
            speed_1=forward[0] * part[SPEEDS[0]] - mean,
            speed_2=forward[1] * part[SPEEDS[1]] - mean,
            phi1_rad=np.mod(part["phi1_rad"], 2.0 * np.pi),
            phi2_rad=np.mod(part["phi2_rad"], 2.0 * np.pi),
        )
        if "supply_frequency_hz" in part:
            table["synchronous"] = part["supply_frequency_hz"] / found.scene.exciter_pair[0].pole_pairs - mean
        yield table.drop(columns=[*SPEEDS, "supply_frequency_hz"], errors="ignore")


def impacts_of(events: pd.DataFrame, start: float, end: float) -> list[list[float]]:
    """Return times (s) and impulses (N·s) of the last impacts of an interval."""
    struck = events[(events["impulse_n_s"] > 0.0) & events["t_s"].between(start, end)]
    return struck[["t_s", "impulse_n_s"]].tail(IMPACTS).to_numpy(dtype=float).tolist()


def panels(runs: Sequence[Mapping[str, Any]], *, from_mean: bool = False) -> list[dict[str, Any]]:
    """Return the panels of curves that the columns of some runs fill, with as many decimals as their sizes need."""
    largest: dict[str, float] = {}
    for shown in runs:
        for name, size in shown["largest"].items():
            largest[name] = max(size, largest.get(name, 0.0))
    found = []
    for title, unit, labels in PANELS:
        curves = {name: label for name, label in labels.items() if name in largest}
        if not curves and not (title == "impulse" and any(shown["impacts"] for shown in runs)):
            continue
        drawn = [{"column": name, "factor": display_unit(name)[1], "label": label} for name, label in curves.items()]
        most = max((largest[name] * display_unit(name)[1] for name in curves), default=1.0)
        decimals = 3 - math.floor(math.log10(most)) if 0.0 < most < math.inf else 3
        name = "speed from its mean" if title == "speed" and from_mean else title
        found.append({"title": name, "unit": unit, "curves": drawn, "decimals": min(max(decimals, 0), DECIMALS)})
    return found


def initial(mode: object) -> str:
    """Return the letter of a mode."""
    return str(mode)[:1]


def machine_of(scene: Scene) -> dict[str, Any]:
    """Return what the drawing of the machine needs; lengths in m."""
    return {
        "axes": scene.body.axes,
        "radii": [exciter.unbalance_radius_m for exciter in scene.exciter_pair],
        "directions": [exciter.direction for exciter in scene.exciter_pair],
        "layers": scene.layers,
        "lower_share": scene.material.lower_share if scene.layers == 2 else 1.0,
        "contact_initial": initial(Mode.ATTACHED.label),
    }
