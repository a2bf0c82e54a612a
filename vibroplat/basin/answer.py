"""The answer of basins: attractors with their basin fractions, and how large a missed one may be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from vibroplat.basin.attractors import AttractorSet
from vibroplat.basin.fractions import clopper_pearson, fractions_over
from vibroplat.config.digits import number, percent
from vibroplat.config.plausibility import HINT
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import BasinsPlan
from vibroplat.results.answer import Answer, counted, in_columns
from vibroplat.study.branches import box_words, column_of, measures_text, place_words

#: Most attractors that have a line.
MAX_ATTRACTORS = 6
#: Motions that may be transients: of these, others may converge to orbits later.
CHAOTIC, TRANSIENT_MOTIONS = "chaotic", ("chaotic", "undecided")


def answer_of(
    scene: Scene, tables: Mapping[str, pd.DataFrame], key: str | None, sets: Sequence[AttractorSet]
) -> Answer:
    """Return the printed answer of basins."""
    plan, attractors = scene.plan_of("basins"), tables["attractors"]
    names = list(dict.fromkeys(attractors["attractor"]))
    values = len(sets)
    over = f" at each of {values} values of {plan.over.key}" if plan.over else ""
    starts = f"{plan.number} initial conditions{over}: {box_words(plan.initial_conditions)}"
    return Answer(
        lines=_lines(plan, tables, values),
        text=[*_text(attractors)] if key is None else (),
        notes=_notes(plan, attractors, sets),
        failures=[line for one in sets for line in _failures(one)],
        headline=f"{counted(len(names), 'attractor')} from {starts}",
        short=[*_fractions(attractors, key), *_neighbours(plan, tables["starts"])],
    )


def _fractions(table: pd.DataFrame, key: str | None) -> Iterator[str]:
    """Yield a line for each attractor, the largest first: its fraction with bounds, RMS, frequency and power.

    Over a key there are the smallest and the largest fraction instead, and where it was found.
    """
    rows, most = [], max(table["rms_x_m"].max(), table["rms_y_m"].max())
    largest = table.groupby("attractor", sort=False)["fraction"].max().sort_values(ascending=False, kind="stable")
    over = {} if key is None else fractions_over(table, column_of(key))
    for name in largest.index[:MAX_ATTRACTORS]:
        own = table[table["attractor"] == name]
        row = own.iloc[0]
        if key is None:
            bounds = f"({percent(row['fraction_low'])} to {percent(row['fraction_high'])})"
            rows.append([percent(row["fraction"]), bounds, name, measures_text(row, most)])
        else:
            values = own[column_of(key)]
            rows.append([over[name], name, f"at {place_words(column_of(key), values.min(), values.max())}"])
    yield from in_columns(rows) if rows else ()
    if largest.size > MAX_ATTRACTORS:
        yield f"and {counted(largest.size - MAX_ATTRACTORS, 'more attractor')}: -v"


def _neighbours(plan: BasinsPlan, starts: pd.DataFrame) -> Iterator[str]:
    """Yield how many neighbours on the grid of initial conditions converge to different attractors."""
    keys = list(plan.initial_conditions)
    counts = [len(np.unique(starts[key])) for key in keys]
    if plan.over is not None or plan.random or len(starts) != np.prod(counts) or len(set(starts["attractor"])) == 1:
        return
    names = starts.sort_values(keys)["attractor"].to_numpy(dtype=str).reshape(counts)
    pairs = [
        (np.diff(np.unique(names, return_inverse=True)[1].reshape(counts), axis=axis) != 0) for axis in range(len(keys))
    ]
    differ = sum(int(one.sum()) for one in pairs) / max(sum(one.size for one in pairs), 1)
    yield f"{percent(differ)} of the pairs of neighbouring initial conditions converge to different attractors"


def _lines(plan: BasinsPlan, tables: Mapping[str, pd.DataFrame], values: int) -> dict[str, str]:
    """Return the overview."""
    ways = [f"{plan.number}"] + ([f"at each of {values} values of {plan.over.key}"] if plan.over else [])
    turns = tables["starts"]["turns"]
    return {
        "initial conditions": f"{' '.join(ways)}, for at most {plan.max_turns} turns",
        "turns until assigned": f"median {turns.median():.0f}, maximum {turns.max():.0f}",
    }


def _text(table: pd.DataFrame) -> Iterator[str]:
    """Yield a line for each orbit: its leading multiplier."""
    width = table["attractor"].str.len().max()
    for _, row in table[table["multiplier_max"].notna()].iterrows():
        yield f"{row['attractor']:<{width}}  multiplier {number(row['multiplier_max'], 4)}"


def _turns(number: float) -> str:
    """Write a number of turns with two significant digits and a space between thousands."""
    return f"{float(f'{number:.2g}'):,.0f}".replace(",", " ")


def _notes(plan: BasinsPlan, table: pd.DataFrame, sets: Sequence[AttractorSet]) -> list[str]:
    """Return warnings."""
    least = clopper_pearson(0, plan.number)[1]
    notes = [f"{HINT}attractors that attract less than {percent(least)} of the initial conditions may have been missed"]
    if "conveying_speed_m_per_s" in table:
        hint = "with transport a motion is assigned once it has settled, by its measures: there are no orbits"
        notes.append(f"{HINT}{hint}")
    if table["motion"].isin(TRANSIENT_MOTIONS).any():
        notes.append(
            f"fractions are those within {plan.max_turns} turns and may change beyond them: motions that had not "
            "converged to an orbit were grouped by their last turns, and one of each group was classified"
        )
    for one in sets:
        chaos = [k for k, record in enumerate(one.attractors) if record["row"]["motion"] == CHAOTIC and one.counts[k]]
        if len(chaos) > 1:
            turns = one.count_seen_turns(plan.max_turns)
            notes.append(
                f"no change from one chaotic motion to another occurred in {_turns(turns)} turns: such changes "
                f"occur less often than once in {_turns(turns / 3.0)} turns (95 %)"
            )
            break
    escaped = sum(record.get("escaped", 0) for one in sets for record in one.attractors)
    if escaped:
        notes.append(
            f"{escaped} such motion{'s' * (escaped > 1)} converged to an orbit when continued: a larger "
            "basins.max_turns assigns more initial conditions to orbits"
        )
    return notes


def _failures(attractor_set: AttractorSet) -> Iterator[str]:
    """Yield a line for each failed simulation."""
    for start in attractor_set.starts:
        row = attractor_set.attractors[start["attractor"]]["row"]
        if row["outcome"] != "ok":
            yield f"{row['outcome']}: {(start.get('detail') or row['detail']).partition(', state [')[0]}"
