"""Answers on the page: thresholds, basins and designs, as figures of points like those of a sweep."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from vibroplat.columns import shown_in, words_in_place
from vibroplat.page.points import DRAWN, Motions, Series, axes, measures, plain_column, table_data, thinned
from vibroplat.plots.labels import is_number
from vibroplat.plots.reading import Saved, has_table
from vibroplat.plots.style import FAILED, SYMBOLS
from vibroplat.plots.sweep import SYNC, attractor_colours

#: Most starts on the page: more of them than rows of other tables, as they are dots that are drawn together.
MOST_STARTS = 10_000

Study = dict[str, Any]


def studies(number: int, one: Saved, motions: Motions) -> list[Study]:
    """Return the figures of points of the answer to a question."""
    make = {"find": _thresholds, "basins": _basins, "design": _design}[one.command]
    return [
        {"marks": [], "special": None, "shaking": "", "command": one.command, "result": number} | study
        for study in make(number, one, motions)
    ]


def _series(
    table: pd.DataFrame, by: str, mode: str, colours: Mapping[str, str] | None = None, **rows: pd.Series
) -> Series:
    """Return a series for each value of a column, in its colour if given; ``rows`` are those that have another look."""
    names = [] if table.empty else list(dict.fromkeys(table[by].fillna("failed")))
    found: Series = []
    for name in names:
        own = table[by].fillna("failed") == name
        looks = {look: [int(row) for row in table.index[own & is_so]] for look, is_so in rows.items()}
        look: dict[str, Any] = {
            "label": str(name),
            "colour": colours.get(name, FAILED) if colours else len(found),
            "symbol": SYMBOLS["o"],
            "dash": "solid",
            "mode": mode,
        }
        found.append({**look, "open": [], "failed": [], **looks, "rows": [int(row) for row in table.index[own]]})
    return found


def _none() -> dict[str, Any]:
    """Return what a figure without orbits has."""
    return {"rows": {}, "special": {}, "list": [], "machines": [], "asked": False}


# -- thresholds --------------------------------------------------------------------------------------------------------


def _thresholds(number: int, one: Saved, motions: Motions) -> list[Study]:
    key, level = one.column("find", "key"), one.given("find").get("expression") or ""
    scan = one.columns("scan", ("reason", "sync", "motion", "outcome"), (key, "rms_x_m", "rms_y_m"))
    found = one.columns("thresholds", ("kind",), ("value", "below"))
    table, compared = thinned(scan), level.replace("<", ">").partition(">")[0].strip()
    looks = {"open": table["motion"] != "periodic", "failed": table["outcome"] != "ok"}
    series = _series(table, "sync", "markers", SYNC, **looks)
    for one_series in series:
        one_series["label"] = {"none": "not synchronous"}.get(one_series["label"], one_series["label"])
    # Both sides of a threshold come first; a click on it shows what is below.
    good = table[table["outcome"] == "ok"]
    sides = [int((good[key] - value).abs().idxmin()) for value in found["below"].dropna() if len(good)]
    moved = motions.of(None, table, sides)
    moved["special"] = {row: moved["rows"][side] for row, side in enumerate(sides) if side in moved["rows"]}
    return [
        {
            "title": "Thresholds",
            "meaning": "Every value that was looked at. Filled: periodic, open: not periodic, ×: failed; dashed lines: "
            "thresholds.",
            "table": table_data("values", number, scan),
            "axes": axes(table, [key]),
            "measures": measures(table, dict.fromkeys((*([compared] if compared else []), *DRAWN))),
            "series": series,
            "lines": plain_column(found["value"]),
            "special": table_data("thresholds", number, found),
            "special_words": "Orbit just below this threshold.",
            "motions": moved,
        }
    ]


# -- basins ------------------------------------------------------------------------------------------------------------


def _basins(number: int, one: Saved, motions: Motions) -> list[Study]:
    plan = one.given("basins")
    keys = [one.column("basins", "over", "key")] if plan.get("over") else []
    numbers = (*keys, "count", "fraction", "fraction_low", "fraction_high", "rms_x_m", "rms_y_m")
    attractors = one.columns("attractors", ("attractor", "motion", "outcome"), numbers)
    whole = one.columns("starts", ("attractor",), (*keys, *plan["initial_conditions"], "turns"))
    shown, starts = thinned(attractors), thinned(whole, MOST_STARTS)
    moved = motions.of(None, shown, ())
    moved["special"] = moved["rows"]
    rows = dict(zip(_named(shown, keys), shown.index.tolist(), strict=True))
    colours = attractor_colours(shown["attractor"])
    series, order = _series(starts, "attractor", "dots", colours), list(colours)
    told = table_data("attractors", number, attractors)
    study: Study = {
        "title": "Basins",
        "meaning": "Each dot is a start, in the colour of the attractor to which its motion converges "
        f"within {plan['max_turns']} turns. "
        "A key drawn over itself shows how many starts come to each attractor.",
        "table": table_data("starts", number, whole, MOST_STARTS),
        "axes": axes(starts, plan["initial_conditions"]),
        "measures": [_measure(name) for name in (*list(plan["initial_conditions"])[1:], "turns")],
        "series": sorted(series, key=lambda one_series: order.index(one_series["label"])),
        "owner": [rows.get(name) for name in _named(starts, keys)],
        "high": True,
    }
    if not keys:
        return [study | {"special": told, "motions": moved}]
    shares = {
        "title": "Shares",
        "meaning": "The share of the starts that converges to each attractor "
        f"within {plan['max_turns']} turns, and below it the motion of each.",
        "table": told,
        "axes": axes(shown, keys),
        "measures": [_measure("fraction"), *measures(shown)],
        "stacked": "fraction",
        "series": _series(shown, "attractor", "lines+markers", colours, open=shown["motion"] != "periodic"),
        "motions": moved,
    }
    return [shares, study | {"at": keys[0], "motions": _none(), "borrows": True}]


def _named(table: pd.DataFrame, keys: Sequence[str]) -> list[tuple[Any, ...]]:
    """Return what tells an attractor, or that of a start, from all others: the value of the key and its name."""
    return list(zip(*(table[name] for name in (*keys, "attractor")), strict=True))


def _measure(name: str) -> dict[str, Any]:
    unit, factor = shown_in(name)
    return {"column": name, "words": words_in_place(name), "unit": unit, "factor": factor}


# -- designs -----------------------------------------------------------------------------------------------------------


def elasticities(number: int, one: Saved) -> list[dict[str, Any]]:
    """Return the table of sensitivities, with what its keys and measures are called."""
    if one.command != "design":
        return []
    table = one.columns("sensitivities", ("measure", "key"), ("elasticity",))
    names = {name: words_in_place(name) for name in dict.fromkeys((*table["measure"], *table["key"]))}
    return [{"table": table_data("sensitivities", number, table), "names": names}]


def _design(number: int, one: Saved, motions: Motions) -> list[Study]:
    found = []
    if has_table(one.directory, "samples"):
        whole = one.columns("samples", ("regime",))
        table = thinned(whole)
        found.append(_tolerances(number, whole, table, list(one.given("design", "parameter_tolerances"))))
    return found + [_search(number, one, name, motions) for name in _SEARCHES if has_table(one.directory, name)]


def _period(one: Saved) -> int:
    """Return the period of the orbit that a design is about, which its command has printed."""
    told = one.provenance.get("answer")
    motion = str(told.get("lines", {}).get("motion")) if isinstance(told, dict) else ""
    found = re.search(r"period (\d+)", motion)
    return int(found[1]) if found else 1


def _tolerances(number: int, whole: pd.DataFrame, table: pd.DataFrame, keys: Sequence[str]) -> Study:
    drawn = measures(table, _numbers(table, {"sample", *keys}))
    return {
        "title": "Tolerances",
        "meaning": "Each dot is a scene within the spread, in the colour of its regime. A measure drawn over "
        "itself shows how often its values occur.",
        "table": table_data("samples", number, whole),
        "axes": axes(table, (*keys, *(measure["column"] for measure in drawn))),
        "measures": drawn,
        "series": _series(table, "regime", "dots", attractor_colours(table["regime"])),
        "motions": _none(),
    }


#: Tables of designs: the title of their figure, how it is drawn, and the column that comes first.
_SEARCHES = {
    "evaluations": ("Searches", "markers", "start"),
    "pareto": ("Pareto front", "lines+markers", "bound"),
}


def _search(number: int, one: Saved, name: str, motions: Motions) -> Study:
    """Return the figure of all designs that were looked at, or of a Pareto front."""
    title, mode, first = _SEARCHES[name]
    plan, is_front = one.given("design"), name == "pareto"
    aims = [column for column in (plan.get("minimize"), *plan.get("constraints", {})) if column]
    whole = one.columns(name, (), (first, *aims))
    table = thinned(whole)
    feasible = table["feasible"].astype(bool)
    rows = table.assign(period=_period(one), outcome=feasible.map({True: "ok", False: "outside the bounds"}))
    best = whole.iloc[:0] if is_front else whole[whole["best"].astype(bool)].reset_index(drop=True)
    best = best.assign(period=_period(one), outcome="ok")
    shown = measures(table, dict.fromkeys((*aims, *_numbers(table, {first, "objective", "feasible", "best"}))))
    columns = [measure["column"] for measure in shown]
    at = {column: plain_column(best[column]) for column in columns}
    mark = {"kind": "best", "meaning": "the least that keeps all bounds", "symbol": SYMBOLS["*"], "rows": [0], "at": at}
    return {
        "title": title,
        "meaning": "Filled: all bounds are kept, open: they are not.",
        "table": table_data(name, number, whole),
        "axes": axes(table, (*([first] if is_front else []), *sorted(columns, key=aims.__contains__))),
        "measures": shown,
        "series": _series(
            table.assign(start="front" if is_front else "start " + table[first].astype(str)),
            "start",
            mode,
            open=~feasible,
        ),
        "marks": [] if best.empty else [mark],
        "special": None if is_front else table_data("best design", number, best[list(table)]),
        "special_words": "Orbit of the best design.",
        "motions": motions.of(best, rows if is_front else rows.assign(outcome="ok"), [0]),
    }


def _numbers(table: pd.DataFrame, without: set[str]) -> list[str]:
    """Return the columns of numbers that a table fills, without some."""
    return [str(name) for name in table if name not in without and is_number(table[name]) and table[name].notna().any()]
