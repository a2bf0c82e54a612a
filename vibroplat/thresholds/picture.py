"""The picture of a search for thresholds: measures of all values that were looked at, over the key."""

from __future__ import annotations

from collections.abc import Sequence

from vibroplat.columns import PHASE_COLUMN, name_sync
from vibroplat.config.study_plans import FindPlan
from vibroplat.results import content, picture
from vibroplat.results.labels import caption_of, key_name
from vibroplat.results.result import Result
from vibroplat.study import titles
from vibroplat.study.branches import column_of

OPTIONS = ("measure",)
#: Ends of mixed intervals in the table of thresholds.
_MIXED = ["mixed_low", "mixed_high"]


def pictures(results: Sequence[Result], _: Sequence[str] = (), *, measure: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the picture of each result, with these measures instead of the usual ones."""
    return [_picture(result, measure) for result in results]


def _picture(result: Result, measure: Sequence[str]) -> picture.Picture:
    plan = FindPlan.model_validate(result.given("find"))
    key, (level, _, number) = column_of(plan.key), plan.compared or ("", "", 0.0)
    needed = (key, "rms_x_m", "rms_y_m", PHASE_COLUMN, *measure, *filter(None, [level]))
    table = picture.finite(content.rows_in(result, "scan", ("reason", "sync", "motion", "outcome"), needed))
    changes = picture.finite(result.columns("thresholds", ("kind",), ("value", "below"), _MIXED))
    changes = changes.reindex(columns=[*changes, *(name for name in _MIXED if name not in changes)])
    mixed = changes[_MIXED].dropna().drop_duplicates().astype(float)
    ranges = [picture.Range(key, low, high, "mixed") for low, high in mixed.itertuples(index=False)]
    sharp, title = changes.loc[changes[_MIXED[0]].isna(), "value"].tolist(), result.answer.headline
    lines = [
        *([picture.Line(key, sharp, "threshold")] if sharp else []),
        *([picture.Line(level, [number], dash=":", label=plan.expression or "")] if level else []),
    ]
    panels, omitted = content.measures(table, filter(None, (level, *content.DRAWN)), measure, stripped=True)
    sync = table["sync"].fillna("failed")
    series = [
        picture.Series(
            name_sync(name),
            content.rows_of(sync == name),
            colour=picture.SYNC.get(name, picture.FAILED),
            mode="markers",
            size=0.8,
        )
        for name in dict.fromkeys(sync)
    ]
    # Both sides of a threshold come first; a click on it shows what is below.
    good = table[table["outcome"] == "ok"].dropna(subset=[key])
    sides = [int((good[key] - value).abs().idxmin()) if len(good) else None for value in changes["below"].fillna(0.0)]
    return picture.Picture(
        name="thresholds",
        heading="Thresholds",
        title=titles.sentence(title.replace(plan.key, key_name(plan.key))),
        table=table,
        table_name="values",
        special=changes,
        special_name="thresholds",
        axes=content.axes_of(table, [key]),
        panels=panels,
        series=series,
        lines=lines,
        ranges=ranges,
        states=content.motions_of(table),
        rotation=result.known_scene.rotation if result.known_scene else "",
        caption=caption_of([result.name], result.known_scene, [key], omitted),
        meaning="All evaluated values. Filled: periodic; open: non-periodic, ×: failed; dashed lines: thresholds.",
        orbits=picture.Orbits(
            table,
            [side for side in sides if side is not None],
            [*range(len(table)), *sides],
            "Orbit just below this threshold.",
        ),
    )
