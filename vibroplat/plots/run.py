"""Pictures of a run, or of several: their points are rows of trajectories, ranges of turns and events, one table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import FORCES, PHASE, PHASE_COLUMN, display_name, split, unit_of
from vibroplat.config import digits
from vibroplat.config.plausibility import MIN_SAMPLES_OF_SPECTRUM
from vibroplat.errors import TableError
from vibroplat.measured.data import Measured
from vibroplat.plots.histories import (
    FEWEST,
    MATTERS,
    SPEEDS,
    RunTables,
    folded_size,
    lines_of,
    peaks_of,
    run_of,
    spectrum_of,
)
from vibroplat.plots.pictures import MOST_LARGE
from vibroplat.plots.run_picture import MOST_TURNS, RunPicture, beside, curve
from vibroplat.results import picture
from vibroplat.results.labels import compared, distinct, phase_label, plain
from vibroplat.results.picture import BLACK, CURVES, REFERENCE, Panel
from vibroplat.results.run import RunResult

OPTIONS = ("start", "stop", "data")
#: Minimum range of a coordinate, relative to the largest one, to have a panel.
MIN_RANGE = 0.05
#: Times at which the synchronous speed is known, and distance of speeds that coincide, over their size.
TIMES, SAME = 401, 0.015
#: Ratio of the largest to the smallest drawn line of a spectrum, orders of an exciter shown, and those with a name.
DEPTH, ORDERS, NAMED = 1e4, 20, 10
#: Shade of contact.
CONTACT = "#e3eaf0"
#: The platform's coordinates.
_MOVING = ("y_m", "x_m", "phi_rad")
#: Columns whose largest value of the whole run is marked, and what the summary calls it.
_PEAKS = {
    "force_y_n": "foundation_force_y_max_n",
    "force_x_n": "foundation_force_x_max_n",
    "y_m": "stroke_y_m",
    "x_m": "stroke_x_m",
}
#: The panel of the exciters' speeds.
_SPEEDS = Panel("speed_hz", label="speed")


# -- figures -----------------------------------------------------------------------------------------------------------


def pictures(
    results: Sequence[RunResult],
    kinds: Sequence[str] = (),
    *,
    start: float | None = None,
    stop: float | None = None,
    data: Measured | None = None,
) -> Iterator[picture.Picture]:
    """Yield the pictures of a run, or of several over each other.

    Parameters
    ----------
    results
        Runs.
    kinds
        ``motion`` (platform and gap: the whole run, and its last turns), ``conveying`` (place of the material along the
        deck, and its modes), ``force`` (contact force and impulses),
        ``exciters`` (speeds and phase difference), ``loads`` (force into the foundation, strokes and speeds),
        ``acceleration`` and ``spectrum``, ``measured`` (measured and computed curves). Default: all. Figures
        without their data (contact, accelerations, measurements) are left out, and refused if no other figure is
        named.
    start, stop
        Interval shown (s). Default: the whole run, and next to it the last turns of the exciters.
    data
        Measured data laid over the figures: y is counted from the static rest.

    Raises
    ------
    TableError
        Tables are missing or have another schema version, or the interval is empty.
    """
    runs = [run_of(one, start, stop) for one in results] if data is None else beside(data, results, start, stop)
    names = list[str]()
    if len(runs) > 1:
        labels = distinct([run.name for run in runs], [one.home or Path(one.place) for one in results])
        names = compared("run", labels, [run.scene for run in runs])
    shown = RunPicture(runs, data, names)
    drawn = [kind for kind in kinds or FIGURES if not missing(kind, shown)]
    if not drawn:
        able = ", ".join(kind for kind in FIGURES if not missing(kind, shown))
        raise TableError(f"figure {kinds[0]}: {results[0].place} {missing(kinds[0], shown)}; allowed: {able}")
    yield from (FIGURES[kind](shown.anew()) for kind in drawn)


def missing(kind: str, shown: RunPicture) -> str:
    """Say what runs do not have that a figure needs; "" if nothing."""
    columns = {str(column) for run in shown.runs for column in run.shown}
    if kind == "force" and "contact_force_n" not in columns:
        return "has no contact force, as its scene is bare or non-impact"
    if kind == "conveying" and "along_m" not in columns:
        return "has no motion along the deck, as its scene has no section transport"
    if kind in ("acceleration", "spectrum") and not any(column.startswith("acceleration_") for column in columns):
        return "has no accelerations; simulate it with --set output.accelerations=true"
    for run in shown.runs if kind == "spectrum" else ():
        if not run.shown.filter(like="acceleration_").any(axis=None):
            return "has no spectrum, as its machine rests in the interval shown"
        if run.too_coarse:
            return (
                f"has too few samples for a spectrum ({run.too_coarse} of run {run.name} are shown; needed: more than "
                f"{MIN_SAMPLES_OF_SPECTRUM:g} a turn, and {FEWEST}); choose a longer interval, or simulate it with a "
                "higher output.sample_rate_hz"
            )
    return "needs --data FILE" if kind == "measured" and shown.data is None else ""


def _coordinate(shown: RunPicture, column: str) -> None:
    """Draw a coordinate; if there is one run, contact is shaded and impacts are marked."""
    for run in (run for run in shown.runs if column in run.shown):
        curve(shown, run, column, label=shown.called(run))
        if shown.only and "gap_m" in run.shown and run.turns <= MOST_TURNS and column not in FORCES:
            _contact(shown, run, column)


def _contact(shown: RunPicture, run: RunTables, column: str) -> None:
    """Shade the times of contact, and mark impacts on the line of zero gap."""
    last = run.last
    attached = (~last["mode"].isin(["flight", "bare"])).to_numpy()
    shown.draw(
        last.loc[attached, ["t_s"]], "attached", np.flatnonzero(np.diff(np.flatnonzero(attached)) > 1) + 1,
        mode="shade", colour=CONTACT, of=(column,),
    )  # fmt: skip
    impacts = shown.during(run).query("kind == 'impact'")
    if column == "gap_m" and len(impacts):
        look: dict[str, Any] = {"mode": "markers", "symbol": "v", "colour": BLACK, "of": (column,)}
        shown.draw(impacts[["t_s"]].assign(gap_m=0.0), "impact", **look)


def _motion(shown: RunPicture) -> picture.Picture:
    """Show the coordinates of the platform that matter, and the gap."""
    largest = [max(run.range_of(c) for c in _MOVING) for run in shown.runs]
    pairs = [*zip(shown.runs, largest, strict=True)]
    columns = [c for c in _MOVING if c == "y_m" or any(run.range_of(c) > MIN_RANGE * most for run, most in pairs)]
    columns += ["gap_m"] if any("gap_m" in run.shown for run in shown.runs) else []
    for column in columns:
        _coordinate(shown, column)
    return shown.picture("motion", [shown.panel(column) for column in columns])


def _conveying(shown: RunPicture) -> picture.Picture:
    """Show the place of the material along the deck from the begin of the turns shown, and its modes in a few turns."""
    strips = []
    for run in (run for run in shown.runs if "along_m" in run.shown):
        last, colour, before = shown.last(run), shown.colour(run, "along_m"), sum(map(len, shown.parts))
        moved = last[["t_s"]].assign(along_m=last["along_m"] - last["along_m"].iloc[0])
        shown.draw(moved, shown.called(run), colour=colour, of=("along_m",))
        name, colour = (run.name, colour) if shown.names else ("", BLACK)
        places = range(before, before + len(moved))
        strips.append(picture.Strip(name, colour, places, last["mode"].tolist()))
    few = all(run.turns <= MOST_TURNS for run in shown.runs)
    modes = picture.Strips(strips, picture.MODES, label="modes") if few else None
    facets = int(shown.aligned and not shown.both)
    return shown.picture("conveying", [Panel("along_m")], facets=facets, strips=modes)


def _force(shown: RunPicture) -> picture.Picture:
    """Show the contact force, and below it the impulses of impacts as stems: they are no forces."""
    for run in shown.runs:
        strikes = shown.during(run).query("impulse_n_s > 0.0")
        look: dict[str, Any] = {"of": ("contact_force_n",), "colour": shown.colour(run, "contact_force_n")}
        shown.draw(shown.last(run).reindex(columns=["t_s", "contact_force_n"]), shown.called(run), **look)
        stems = BLACK if shown.only else look["colour"]
        shown.draw(strikes[["t_s", "impulse_n_s"]], shown.called(run), mode="stems", colour=stems, of=("impulse_n_s",))
        if shown.only:
            _contact(shown, run, "contact_force_n")
    struck = any("impulse_n_s" in part and len(part) for part in shown.parts)
    panels = [Panel("contact_force_n", least=0.0, height=1.3)]
    panels += [Panel("impulse_n_s", least=0.0, label="impulse $P$", height=0.7)] if struck else []
    return shown.picture("force", panels, facets=int(shown.aligned and not shown.both))


def _exciters(shown: RunPicture) -> picture.Picture:
    """Show the speeds of both exciters and their phase difference."""
    _speeds(shown)
    for run in shown.runs:
        if shown.only is not None and run.scene is not None:
            _synchronous_speed(shown, run)
        look: dict[str, Any] = {"colour": BLACK if shown.only else shown.colour(run, ""), "of": (PHASE_COLUMN,)}
        phase = run.whole["phi1_rad"] + (-1.0 if run.co_rotating else 1.0) * run.whole["phi2_rad"]
        rows = run.whole[["t_s"]].assign(**{PHASE_COLUMN: phase})
        shown.draw(rows, shown.called(run), whole=shown.both, **look)
    labels = {phase_label(run.co_rotating) for run in shown.runs}
    phases = Panel(PHASE_COLUMN, label=labels.pop() if len(labels) == 1 else PHASE)
    return shown.picture("exciters", [_SPEEDS, phases], facets=1)


def _speeds(shown: RunPicture) -> None:
    """Draw the speeds of both exciters."""
    of_both(shown, SPEEDS, "speed_hz", "exciter")


def of_both(shown: RunPicture, names: Sequence[str], panel: str, noun: str) -> None:
    """Draw columns of both exciters, of which the second is dashed; those that coincide are one line."""
    for run in (run for run in shown.runs if names[0] in run.shown):
        first, second = (run.envelope[[f"{name}:min", f"{name}:max"]].mean(axis=1) for name in names)
        apart = bool((first - second).abs().max() > SAME * max(first.abs().max(), second.abs().max()))
        for number, name in enumerate(names if apart else names[:1]):
            called = f"{noun} {number + 1}" if apart else f"{noun} 1 = 2"
            look = {"colour": CURVES[number] if shown.only else shown.colour(run, ""), "dash": "--" if number else "-"}
            look |= {"look": called} if shown.names else {}
            curve(shown, run, name, panel, shown.called(run, called), **look)


def _synchronous_speed(shown: RunPicture, run: RunTables) -> None:
    """Draw the synchronous speeds of both motors (Hz) over time, where they are on; where they agree, one line."""
    assert run.scene is not None
    times = np.linspace(float(run.whole["t_s"].iloc[0]), float(run.whole["t_s"].iloc[-1]), TIMES)
    now = [(time, run.scene.drive.at(time)) for time in times]
    speeds = [
        pd.Series([one.frequency_at(time) if one.driven[n] else np.nan for time, one in now]) / exciter.pole_pairs
        for n, exciter in enumerate(run.scene.exciter_pair)
    ]
    first, second = speeds[0].fillna(speeds[1]), speeds[1].fillna(speeds[0])
    same = first.equals(second)
    for number, speed in enumerate([first] if same else [speeds[0], speeds[1]], 1):
        label = "synchronous speed" if same else f"synchronous speed, motor {number}"
        look: dict[str, Any] = {"colour": REFERENCE, "dash": (":", "-.")[number - 1], "of": ("speed_hz",)}
        if speed.notna().any():
            shown.draw(pd.DataFrame({"t_s": times, "speed_hz": speed}), label, whole=shown.both, **look)


def _loads(shown: RunPicture) -> picture.Picture:
    """Show forces into the foundation and displacements with their peaks, and the speeds."""
    columns: list[str] = []
    for group in (FORCES, _MOVING[:2]):
        ranges = {c: max(run.range_of(c) for run in shown.runs) for c in group}
        columns += [c for c in group if ranges[c] > MIN_RANGE * max(ranges.values())]
    for column in columns:
        _coordinate(shown, column)
        if shown.only:
            _peak(shown, shown.only, column)
    _speeds(shown)
    falls = shown.only and (shown.only.scene is None or shown.only.scene.machine.gravity_m_per_s2)
    static = shown.only.summary.get("foundation_force_y_mean_n") if shown.only and falls else None
    lines = [picture.Line("force_y_n", [-static], "static force", ":")] if static else []
    return shown.picture("loads", [*(shown.panel(column) for column in columns), _SPEEDS], lines=lines)


def _peak(shown: RunPicture, run: RunTables, column: str) -> None:
    """Mark the largest size of a force, or where a stroke was complete, with its time and the speed then."""
    name, unit = _PEAKS[column], unit_of(_PEAKS[column])
    keys = (name, *(f"{split(name)[0]}_at_{end}" for end in ("s", "hz")))
    value, at, pace = (run.summary.get(f"whole_{key}") for key in keys)
    low, high = run.envelope[f"{column}:min"].min(), run.envelope[f"{column}:max"].max()
    if value is None or at is None or not run.whole["t_s"].iloc[0] <= at <= run.whole["t_s"].iloc[-1]:
        return
    size = value if column in FORCES else max(-low, high)
    height = -size if -low > high else size
    text = f"{'' if column in FORCES else 'stroke '}{digits.quantity(value, unit)} at {digits.quantity(at, 's')}"
    text += "" if pace is None else f", {digits.quantity(pace, 'Hz', digits=3)}"
    look: dict[str, Any] = {"mode": "markers", "size": 1.2, "colour": BLACK, "of": (column,)}
    shown.draw(pd.DataFrame({"t_s": [at], column: [height]}), whole=shown.both, **look)
    shown.words.append(picture.Word(text, column, at, height, beside=True))


def _accelerations(shown: RunPicture) -> picture.Picture:
    """Show accelerations in the rows shown: a panel for each axis, a line for each point."""
    panels = []
    for column, lines in lines_of(shown.runs, shown.names).items():
        for number, (run, name, label) in enumerate(lines):
            table = run.shown[["t_s"]].assign(**{column: run.shown[name]})
            shown.draw(table, label, colour=CURVES[number % len(CURVES)], of=(column,))
        largest = max(float(run.shown[name].abs().max()) for run, name, _ in lines)
        title, label = f"up to {digits.quantity(largest, 'm/s²')}", f"acceleration along {column.split('_')[1]}"
        panels.append(Panel(column, title=title, label=label))
    return shown.picture("acceleration", panels, facets=0, high=True)


def _spectra(shown: RunPicture) -> picture.Picture:
    """Show amplitude spectra of accelerations, with the orders of the exciters; of measured data there are none."""
    first, panels, turns = shown.runs[0], list[Panel](), int(shown.runs[0].turns * (1.0 + 1e-9))
    speed, end, folded, largest = first.speed, np.inf, list[tuple[float, RunTables]](), 0.0
    for column, lines in lines_of(shown.runs, shown.names).items():
        spectra = [spectrum_of(run, name) for run, name, _ in lines]
        end = min(spectra[0][0][-1], ORDERS * speed if turns and speed > 0.0 else np.inf)
        top = max(float(sizes.max()) for _, sizes in spectra) or 1.0
        folded += [(folded_size(*one, run.speed), run) for one, (run, _, _) in zip(spectra, lines, strict=True)]
        largest = max(largest, top)
        for number, ((frequencies, sizes), (_, _, label)) in enumerate(zip(spectra, lines, strict=True)):
            drawn = frequencies <= end
            table = {"frequency_hz": frequencies[drawn], column: np.maximum(sizes[drawn], top / DEPTH)}
            shown.draw(pd.DataFrame(table), label, colour=CURVES[number % len(CURVES)], of=(column,))
        if not panels:
            last = min(NAMED, int(end / speed)) if turns and speed > 0.0 else 0
            shown.words += [picture.Word(f"{n}×", column, n * speed, top, REFERENCE) for n in range(1, last + 1)]
        label = f"amplitude along {column.split('_')[1]}"
        panels.append(Panel(column, title=peaks_of(*spectra[0], speed), label=label, scale="log"))
    orders = picture.Line("frequency_hz", [n * speed for n in range(1, 2 * len(shown.words) + 1)], dash=":")
    over = f"Hann's window{f' over {turns} turns' if turns else ''}; n×: orders of exciter 1"
    size, coarsest = max(folded, key=lambda one: one[0])
    coarse = _folding(coarsest, size) if size > MATTERS * largest else ""
    return shown.picture("spectrum", panels, over, coarse, facets=0, high=True, axes=["frequency_hz"], lines=[orders])


def _folding(run: RunTables, size: float) -> str:
    """Say that lines of a spectrum of a run may be folded back up to an amplitude (m/s²)."""
    rate = run.sample_rate
    each = f"{digits.number(rate / run.speed, 2)} points a turn" if run.speed else digits.quantity(rate, "Hz")
    return (
        f"{each}: what is above {digits.quantity(0.5 * rate, 'Hz')} folds back, lines up to "
        f"{digits.quantity(size, 'm/s²', digits=2)} are uncertain: raise output.sample_rate_hz"
    )


def _measured(shown: RunPicture) -> picture.Picture:
    """Show each measured column with the computed one and their difference."""
    data = shown.data
    assert data is not None
    columns = [c for c in map(str, shown.runs[0].shown.select_dtypes("number")) if c != "t_s" and c in data.table]
    for column in columns:
        for number, run in enumerate(run for run in shown.runs if column in run.shown):
            look: dict[str, Any] = {"colour": CURVES[number % len(CURVES)], "of": (column,)}
            shown.draw(run.shown[["t_s", column]], shown.called(run, "computed"), **look)
        begin, end = shown.runs[0].shown["t_s"].iloc[[0, -1]]
        table = data.table[["t_s", column]]
        mode = "markers" if len(table) <= MOST_LARGE else "dots"
        look = {"mode": mode, "symbol": "D", "colour": BLACK, "of": (column,)}
        shown.draw(table[table["t_s"].between(begin, end)], f"measured: {plain(data.path.name)}", **look)
    shifted = f"measured data {data.shifted}" if data.shifted else ""
    titles = {column: f"{display_name(column)} {data.difference(column)}".strip() for column in columns}
    panels = [shown.panel(column, title=titles[column]) for column in columns]
    found = shown.picture("measured", panels, shifted, facets=0)
    return replace(found, title="; ".join(data.differences()) or found.title)


FIGURES: Mapping[str, Callable[[RunPicture], picture.Picture]] = {
    "motion": _motion,
    "conveying": _conveying,
    "force": _force,
    "exciters": _exciters,
    "loads": _loads,
    "acceleration": _accelerations,
    "spectrum": _spectra,
    "measured": _measured,
}
