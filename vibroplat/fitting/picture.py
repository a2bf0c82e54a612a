"""Pictures of fits: measured and computed curves, and what remains."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vibroplat.columns import display_name
from vibroplat.frames import pd
from vibroplat.results import picture
from vibroplat.results.labels import named, plain
from vibroplat.results.result import Result

#: What ``plot`` may be told.
OPTIONS = ()


def pictures(results: Sequence[Result], kinds: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the picture of each curve of each result."""
    return [made for result in results for made in _pictures(result)]


def _pictures(result: Result) -> list[picture.Picture]:
    table = result.columns("curves", ("file", "column"), ("t_s", "measured", "computed"))
    made = []
    for number, (place, own) in enumerate(table.groupby(["file", "column"], sort=False), 1):
        file, name = map(str, place)
        curve = own[["t_s"]].assign(**{name: own["computed"]})
        points = own[["t_s"]].assign(**{name: own["measured"]})
        left = own[["t_s"]].assign(remains=own["measured"] - own["computed"])
        whole = pd.concat([curve, points, left], ignore_index=True)
        count, label = len(own), f"measured: {plain(Path(file).name)}"
        series = [
            picture.Series("computed", range(count), mode="lines", of=(name,)),
            picture.Series(label, range(count, 2 * count), mode="dots", colour=picture.BLACK, of=(name,)),
            picture.Series("", range(2 * count, 3 * count), mode="lines", colour=picture.REFERENCE, of=("remains",)),
        ]
        made.append(
            picture.Picture(
                name="fit" if number == 1 else f"fit-{number}",
                heading="Fit",
                title=result.answer.headline,
                table=whole,
                table_name="curves",
                axes=["t_s"],
                panels=[picture.Panel(name), picture.Panel("remains", label=f"remains of {display_name(name)}")],
                series=series,
                caption=named([result.name]),
            )
        )
    return made
