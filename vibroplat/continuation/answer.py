"""The answer of orbits: where they are stable, special points and boundaries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import unit_of
from vibroplat.config.digits import MISSING, NEGLIGIBLE, given, interval, number, percent, quantity
from vibroplat.config.plans import OrbitsPlan
from vibroplat.continuation.special_points import SMOOTH_LOSSES
from vibroplat.kernels.compiled import FloatArray
from vibroplat.results.answer import Answer, counted, in_columns
from vibroplat.results.labels import value_words
from vibroplat.study.answer import axis_label, by_columns
from vibroplat.study.branches import EXCITATION, axis_name, column_of
from vibroplat.study.sweep import synchronizations

#: Maximum number of branches and special points that are printed with ``-v``.
MAX_PRINTED = 40
#: Most boundaries that have a line, kinds of synchronization that have a column, ranges of stability in a cell, and
#: kinds of special points.
MAX_CURVES, MAX_KINDS, MAX_RANGES, MAX_SPECIAL = 4, 2, 3, 5
#: How the reason of an end begins that is a limit of the plan.
LIMIT_REACHED = "max_points = "


def answer_of(
    plan: OrbitsPlan, tables: Mapping[str, pd.DataFrame], summary: Mapping[str, Any], rotation: str
) -> Answer:
    """Return what is printed of orbits; ``rotation`` is that of the exciters, "" if it varies."""
    branches = tables["branches"]
    return Answer(
        _overview(branches, summary, rotation),
        [*_text(plan, tables["special"], summary)],
        failures=_failures(summary),
        headline=_headline(plan, branches, summary),
        short=[
            *_cut_short(plan, summary),
            *_stable_lines(plan, tables),
            *_special_counts(tables["special"]),
            *_curves(plan, tables),
        ],
    )


def _headline(plan: OrbitsPlan, table: pd.DataFrame, summary: Mapping[str, Any]) -> str:
    """Return how many orbits were found, over which range, and how many of them are stable."""
    key, values = column_of(plan.key), table[column_of(plan.key)]
    unit, ends = unit_of(key), dict.fromkeys(number(end, 4) for end in (values.min(), values.max()))
    failed = [f"{summary['failed']} FAILED"] if summary["failed"] else []
    parts = [*failed, f"{counted(len(table), 'orbit')} over {axis_name(key)} {' … '.join(ends)} {unit}".rstrip()]
    count = len(summary["branches"])
    stable = f"{int(table['stable'].sum())} stable"
    return f"{count} branch{'es' * (count != 1)}, {', '.join(parts)}: {stable}"


def _cut_short(plan: OrbitsPlan, summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield what ended before its range did, because of a limit of the plan."""
    branches, (low, high) = summary["branches"], plan.range
    cut = [branch for branch in branches if branch["ended"].startswith(LIMIT_REACHED)]
    if cut:
        covered = max(branch["largest"] - branch["least"] for branch in cut) / (high - low)
        most = "at most " * (len(cut) > 1)
        who = f"{len(cut)} of {len(branches)} branches" if branches[1:] else "the branch"
        yield f"{who} ended early, after {most}{percent(covered)} of the range: {cut[0]['ended']}"
    if plan.boundaries is not None:
        ends = [[end for end in curve["ended"] if end.startswith(LIMIT_REACHED)] for curve in summary["boundaries"]]
        ended = [end for curve in ends for end in curve[:1]]
        if ended:
            yield f"{len(ended)} of {counted(len(ends), 'boundary curve')} ended early: boundaries.{ended[0]}"
    families = Counter(str(branch["grid"]) for branch in branches)
    if max(families.values()) >= plan.max_branches:
        yield f"there may be more branches: max_branches = {plan.max_branches} reached"


def _stable_lines(plan: OrbitsPlan, tables: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """Yield a table: for each combination of the grid's values where orbits of each synchronization are stable."""
    keys, key, special = [column_of(name) for name in _varied_keys(plan)], column_of(plan.key), tables["special"]
    branches = tables["branches"][[*keys, "branch", "point", key, "stable", "sync"]]
    stable = branches.loc[branches["stable"], "sync"]
    if stable.empty:
        yield "no orbit is stable"
        return
    counts = stable.value_counts()
    kinds = counts.index[:MAX_KINDS]
    groups = list(branches.groupby(keys, sort=False)) if keys else [((), branches)]
    columns = {f"stable at {axis_label(key)}": [", ".join(map(value_words, keys, at)) for at, _ in groups]}
    lost = special[special["kind"].isin(SMOOTH_LOSSES)]
    losses = [_within(lost, keys, at)[["branch", "point", key]].to_numpy(float) for at, _ in groups]
    for kind in map(str, kinds):
        columns[kind] = [_ranges(own, ends, key, kind) for (_, own), ends in zip(groups, losses, strict=True)]
    if (special["kind"] == "liftoff").any():
        columns["first liftoff"] = [_first_liftoff(special, keys, at, key) for at, _ in groups]
    yield from by_columns(columns, "-v")
    others = "".join(f"; {count} stable orbits are {kind}" for kind, count in counts[MAX_KINDS:].items())
    if len(kinds) > 1:
        yield f"where both hold a value, the start decides{others}"


def _ranges(table: pd.DataFrame, losses: FloatArray, key: str, sync: str) -> str:
    """Write in which ranges of the key orbits of a synchronization are stable, those of several branches united.

    They end where stability is lost, at these branches, points and values of the key, shape (n, 3). Ranges narrower
    than 1/1000 of the whole are left out if there are wider ones: they are orbits at the limit of stability.
    """
    holds = table["stable"].to_numpy(bool) & (table["sync"] == sync).to_numpy(bool)
    points = table[["branch", "point", key]].to_numpy(float)
    ends = 1 + np.flatnonzero((holds[1:] != holds[:-1]) | (points[1:, 0] != points[:-1, 0]))
    intervals: list[list[float]] = []
    for flags, piece in zip(np.split(holds, ends), np.split(points, ends), strict=True):
        if flags.any():
            branch, first, last = piece[0, 0], piece[0, 1] - 1, piece[-1, 1]
            around = (losses[:, 0] == branch) & ((losses[:, 1] == first) | (losses[:, 1] == last))
            values = np.append(piece[:, 2], losses[around, 2])
            intervals.append([float(values.min()), float(values.max())])
    united: list[list[float]] = []
    for low, high in sorted(intervals):
        if united and low <= united[-1][1]:
            united[-1][1] = max(united[-1][1], high)
        else:
            united.append([low, high])
    least = NEGLIGIBLE * float(np.ptp(table[key]))
    united = [ends for ends in united if ends[1] - ends[0] > least] or united
    widest = sorted(united, key=lambda ends: ends[0] - ends[1])[:MAX_RANGES]
    texts = [" … ".join(dict.fromkeys(number(end, 4) for end in ends)) for ends in sorted(widest)]
    left = len(united) - len(texts)
    return (", ".join(texts) + (f" and {left} more" if left else "")) or MISSING


def _first_liftoff(special: pd.DataFrame, keys: Sequence[str], at: Sequence[Any], key: str) -> str:
    """Write the smallest value of the key at which material lifts off, of a combination of the grid's values."""
    own = _within(special[special["kind"] == "liftoff"], keys, at)
    return number(own[key].min(), 4) if len(own) else MISSING


def _within(special: pd.DataFrame, keys: Sequence[str], at: Sequence[Any]) -> pd.DataFrame:
    """Return the special points of a combination of the grid's values."""
    for name, value in zip(keys, at, strict=True):
        special = special[special[name] == value]
    return special


def _special_counts(special: pd.DataFrame) -> Iterator[str]:
    if len(special):
        counts = [f"{count} {kind}" for kind, count in special["kind"].value_counts().items()]
        shown = ", ".join(counts[:MAX_SPECIAL])
        yield f"special points: {shown}{', …' if counts[MAX_SPECIAL:] else ''}"


def _curves(plan: OrbitsPlan, tables: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """Yield a line for each boundary: over which ranges of both keys it was followed."""
    if plan.boundaries is None:
        return
    keys, groups = [column_of(plan.key), column_of(plan.boundaries.key)], list(tables["boundaries"].groupby("curve"))
    rows = [
        [f"boundary of {own['kind'].iloc[0]}", counted(len(own), "point")]
        + [
            f"{axis_name(key)} {interval(own[key].min(), own[key].max(), digits=4)} {unit_of(key)}".rstrip()
            for key in keys
        ]
        for _, own in groups[:MAX_CURVES]
    ]
    yield from in_columns(rows) if rows else ["no boundary: no special point to start from"]
    if groups[MAX_CURVES:]:
        yield f"and {counted(len(groups) - MAX_CURVES, 'more curve')}: -v"


def _failures(summary: Mapping[str, Any]) -> list[str]:
    """Return a line for each branch that failed."""
    return [
        f"branch {branch['branch']}{''.join(f', {key} {value}' for key, value in branch['grid'].items())} failed "
        f"after {branch['points']} points: {branch['ended']}"
        for branch in summary["branches"]
        if branch["failed"]
    ]


def _overview(table: pd.DataFrame, summary: Mapping[str, Any], rotation: str) -> dict[str, str]:
    """Summarize branches in a few lines: label and text."""
    frequency, height = table["excitation_frequency_hz"], table["rms_y_m"]
    return {
        "synchronization": synchronizations(table[["sync"]].assign(relative_rotation=rotation)),
        "turns": f"{summary['turns']:.0f}, {summary['turns'] / max(len(table), 1):.1f} per point",
        "excitation frequency": interval(frequency.min(), frequency.max(), "Hz"),
        "RMS y": f"{quantity(height.min(), 'm', largest=height.max())} … {quantity(height.max(), 'm')}",
        "residual": f"at most {table['residual'].max():.1e} of scaled units",
    }


def _text(plan: OrbitsPlan, special: pd.DataFrame, summary: Mapping[str, Any]) -> Iterator[str]:
    """Yield tables of all boundaries, branches and special points."""
    keys, value = _varied_keys(plan), column_of(plan.key)
    boundaries, branches = (
        pd.DataFrame([one["grid"] | one for one in summary[name]], dtype=object) for name in ("boundaries", "branches")
    )
    if len(boundaries):
        yield from _lines_of(boundaries[[*keys, "kind", "points", "ended"]], "orbits.json")
    ends = ["origin", "parent", "least", "largest", "points", "stable", "ended"]
    yield from _lines_of(branches[[*keys, "branch", *ends]], "orbits.json")
    if len(special):
        shown = [*map(column_of, keys), "branch", "kind", value, EXCITATION, "period"]
        yield from _lines_of(special[shown].astype(object), "table special")


def _varied_keys(plan: OrbitsPlan) -> list[str]:
    """List the keys of the grid that have several values."""
    return [key for key, values in plan.grid.items() if len(values) > 1]


def _lines_of(table: pd.DataFrame, more: str) -> Iterator[str]:
    """Yield an empty line and the first rows of a table; if they are not all, where the others are."""
    yield ""
    rows = [[_cell(value) for value in row] for row in table.head(MAX_PRINTED).itertuples(index=False)]
    yield from in_columns([[str(name).rpartition(".")[2] for name in table], *rows])
    if len(table) > MAX_PRINTED:
        yield f"… and {len(table) - MAX_PRINTED} more: {more}"


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " and ".join(value)
    return MISSING if value is None else given(float(f"{value:.8g}")) if isinstance(value, float) else str(value)
