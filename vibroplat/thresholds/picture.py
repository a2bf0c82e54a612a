"""The picture of a search for thresholds: measures of all values that were looked at, over the key."""

from __future__ import annotations

from collections.abc import Sequence

from vibroplat.columns import PHASE_COLUMN
from vibroplat.results import picture
from vibroplat.results.labels import sweep_parameters, value_label
from vibroplat.results.result import Result
from vibroplat.study.branches import column_of

OPTIONS = ("measure",)
#: Ends of mixed intervals in the table of thresholds.
_MIXED = ["mixed_low", "mixed_high"]


def pictures(results: Sequence[Result], _: Sequence[str] = (), *, measure: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the picture of each result, with these measures instead of the usual ones."""
    return [_picture(result, measure) for result in results]


def _picture(result: Result, measure: Sequence[str]) -> picture.Picture:
    plan = result.given("find")
    key, expression = column_of(plan["key"]), plan.get("expression") or ""
    level, _, number = (part.strip() for part in expression.replace("=", "").replace("<", ">").partition(">"))
    needed = (key, "rms_x_m", "rms_y_m", PHASE_COLUMN, *measure, *filter(None, [level]))
    table = picture.finite(picture.rows_in(result, "scan", ("reason", "sync", "motion", "outcome"), needed))
    found = result.columns("thresholds", ("kind",), ("value", "below"), _MIXED)
    mixed = found.reindex(columns=_MIXED).dropna().drop_duplicates().astype(float).itertuples(index=False)
    ranges = [picture.Range(key, low, high, "mixed") for low, high in mixed]
    lines = [
        picture.Line(key, found["value"].tolist(), "threshold"),
        *([picture.Line(level, [float(number)], dash=":")] if level else []),
    ]
    told = [f"mixed from {value_label(plan['key'], one.low)} to {one.high:.6g}" for one in ranges]
    told += [f"{value_label(plan['key'], float(row['value']))}: {row['kind']}" for _, row in found.iterrows()]
    names = {"none": picture.NOT_SYNCHRONOUS}
    sync = table["sync"].fillna("failed")
    series = [
        picture.Series(
            names.get(name, name),
            picture.rows_of(sync == name),
            colour=picture.SYNC.get(name, picture.FAILED),
            mode="markers",
        )
        for name in dict.fromkeys(sync)
    ]
    # Both sides of a threshold come first; a click on it shows what is below.
    good = table[table["outcome"] == "ok"]
    sides = [int((good[key] - value).abs().idxmin()) if len(good) else None for value in found["below"].fillna(0.0)]
    return picture.Picture(
        name="thresholds",
        heading="Thresholds",
        title=result.name,
        table=table,
        table_name="values",
        special=found,
        special_name="thresholds",
        axes=picture.axes_of(table, [key]),
        panels=picture.measures(table, filter(None, (level, *picture.DRAWN)), measure),
        series=series,
        lines=lines,
        ranges=ranges,
        states=picture.motions_of(table),
        rotation=result.known_scene.rotation if result.known_scene else "",
        told="\n".join(filter(None, (sweep_parameters(result.known_scene, [key]), *(told or ["no threshold"])))),
        meaning="Every value that was looked at. Filled: periodic, open: not periodic, ×: failed; dashed lines: "
        "thresholds.",
        orbits=picture.Orbits(
            table,
            [side for side in sides if side is not None],
            [*range(len(table)), *sides],
            "Orbit just below this threshold.",
        ),
    )
