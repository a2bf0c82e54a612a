"""What pictures of sweeps show, in one sentence: each function computes it from the tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vibroplat.columns import PHASE_COLUMN, display_name, unit_of
from vibroplat.config import digits
from vibroplat.frames import pd
from vibroplat.results.labels import EXCITATION, SUPPLY, key_name
from vibroplat.results.picture import sync_words
from vibroplat.study.sweeps import Sweeps

#: Symbols of frequencies.
SYMBOLS = {EXCITATION: "$f$", SUPPLY: "$f_e$"}
#: Most numbers that are told one by one.
MOST = 3
#: Share of points at which two ways agree.
AGREE = 0.95


def place(column: str, values: Any) -> str:
    """Say a place on an axis, or from where to where places are: "$f$ = 30.9 Hz"."""
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    if not len(known):
        return ""
    name, told = SYMBOLS.get(column, ""), digits.interval(known.min(), known.max(), unit_of(column))
    return f"{name} = {told}" if name else f"{key_name(column)} {told}"


def _places(column: str, values: Sequence[float]) -> str:
    """Say a few places one by one, more of them from where to where."""
    if len(values) > MOST:
        return place(column, values)
    name = SYMBOLS.get(column, "")
    told = digits.together(values, unit_of(column), " and ")
    return f"{name} = {told}" if name else f"{key_name(column)} {told}"


def several(values: Sequence[float], unit: str) -> str:
    """Say a few numbers one by one, more of them as an interval, in one unit."""
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return digits.MISSING
    if len(known) > MOST or unit == "rad":
        return digits.interval(min(known), max(known), unit)
    return digits.together(known, unit)


def response(sweeps: Sweeps, columns: Sequence[str] = ()) -> str:
    """Say the largest value of the first measure, and from where on exciters synchronize otherwise."""
    table, column = sweeps.table, next(iter(columns), "rms_y_m")
    if column not in table or not table[column].notna().any():
        return "Every point failed" if len(table) else "No points"
    if column == PHASE_COLUMN:
        return sentence(_changes(sweeps)) or "Phase difference of the exciters"
    varied = [name for name in sweeps.varied if name in table]
    known = table.dropna(subset=[column])
    best = known.loc[known.groupby(varied or np.zeros(len(known)), sort=False)[column].idxmax()]
    largest, at = several(best[column].tolist(), unit_of(column)), _places(sweeps.x, best[sweeps.x].tolist())
    return sentence(f"{display_name(column)} at most {largest} at {at}", _changes(sweeps), _failed(table))


def sentence(*parts: str) -> str:
    """Join what is said, with a capital letter."""
    told = "; ".join(filter(None, parts))
    return told[:1].upper() + told[1:]


def _failed(table: pd.DataFrame) -> str:
    """Say how many points failed."""
    count = int((table["outcome"] != "ok").sum()) if "outcome" in table else 0
    return f"{count} of {len(table)} points failed" if count else ""


def _changes(sweeps: Sweeps) -> str:
    """Say from where on exciters synchronize otherwise than at the lowest values of the key, on each way."""
    first, found = set[str](), dict[str, list[float]]()
    others = set[str]()
    for rows in sweeps.branches:
        known = rows.dropna(subset=["sync", sweeps.x]).sort_values(sweeps.key, kind="stable")
        if known.empty:
            continue
        first.add(str(known["sync"].iloc[0]))
        after = known[known["sync"] != known["sync"].iloc[0]]
        if len(after):
            others.add(str(after["sync"].iloc[0]))
            found.setdefault(str(rows["direction"].iloc[0]), []).append(float(after[sweeps.x].iloc[0]))
    if len(first) != 1 or len(others) > 1:
        return ""
    if not others:
        return f"{sync_words(first.pop())} throughout"
    told = {way: place(sweeps.x, values) for way, values in found.items()}
    if len({*told.values()}) == 1:
        return f"{sync_words(others.pop())} from {next(iter(told.values()))} on"
    return f"{sync_words(others.pop())} from " + ", from ".join(f"{at} on the way {way}" for way, at in told.items())


def bifurcation(sweeps: Sweeps, kinds: Sequence[Sequence[str]]) -> str:
    """Say up to where the motion repeats each turn, and whether both ways agree; ``kinds`` are classes by branch."""
    table = pd.concat([rows.assign(kind=own) for rows, own in zip(sweeps.branches, kinds, strict=True)])
    known = table[table["kind"] != ""].dropna(subset=[sweeps.x]).sort_values(sweeps.key, kind="stable")
    if known.empty:
        return "Every point failed"
    names, firsts, where = {"1": "period 1", "n": "period of several turns"}, set[str](), list[float]()
    for _, rows in known.groupby("branch", sort=False):
        firsts.add(first := str(rows["kind"].iloc[0]))
        other = np.flatnonzero(rows["kind"] != first)
        where += [float(rows[sweeps.x].iloc[other[0] - 1])] if len(other) else []
    told = names.get(first := next(iter(firsts)), first) if len(firsts) == 1 else ""
    begin = (f"{told} up to {place(sweeps.x, where)}" if where else f"{told} throughout") if told else ""
    open_ = float((~known["kind"].isin([*names])).mean())
    chaos = f"not periodic at {digits.share(open_)} of the points" if open_ and (where or not told) else ""
    values = known.groupby(sweeps.key)["kind"]
    differ = float((values.nunique()[values.size() == 2] == 2).mean()) if len(kinds) == 2 else np.nan
    both = "up and down agree" if differ <= 1.0 - AGREE else f"up and down differ at {digits.share(differ)}"
    both = both if np.isfinite(differ) else ""
    return sentence(begin, chaos, both)


def regimes(sweeps: Sweeps) -> str:
    """Say at which share of its points a map has each synchronization, motion that does not repeat, and flight."""
    table = sweeps.table
    known = table[table["sync"].notna()]
    if known.empty:
        return "Every point failed"
    count = len(known)
    shares = known["sync"].value_counts() / count
    parts = [", ".join(f"{sync_words(str(sync))} at {digits.share(float(share))}" for sync, share in shares.items())]
    parts[0] += " of the points"
    if "motion" in known and (odd := float((known["motion"] != "periodic").mean())):
        parts.append(f"not periodic at {digits.share(odd)}")
    if "flight_fraction" in known and (flies := float((known["flight_fraction"] > 0.0).mean())):
        parts.append(f"material flies at {digits.share(flies)}")
    return sentence(*parts, _failed(table))
