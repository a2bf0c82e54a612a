"""Pictures of basins: the attractor of each initial condition, the turns until then, and fractions over a key."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vibroplat.columns import display_name, unit_of
from vibroplat.config import digits
from vibroplat.frames import pd
from vibroplat.results import content, picture
from vibroplat.results.labels import caption_of, value_words
from vibroplat.results.result import Result
from vibroplat.study.branches import box_words, column_of
from vibroplat.study.titles import sentence

OPTIONS = ()
#: Basin fraction that counts as 0.
MIN_FRACTION = 1e-9


def pictures(results: Sequence[Result], _: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the pictures of each result: its initial conditions, and over a key the basin fractions."""
    return [picture for result in results for picture in _pictures(result)]


def _pictures(result: Result) -> list[picture.Picture]:
    plan = result.given("basins")
    keys = [column_of(plan["over"]["key"])] if plan.get("over") else []
    numbers = (*keys, "count", "fraction", "fraction_low", "fraction_high", "rms_x_m", "rms_y_m")
    attractors = picture.finite(result.columns("attractors", ("attractor", "motion", "outcome"), numbers))
    starts = result.columns("starts", ("attractor",), (*keys, *plan["initial_conditions"], "turns"))
    owned = dict(zip(_names_of(attractors, keys), range(len(attractors)), strict=True))
    orbits = picture.Orbits(attractors, owner=[owned.get(name) for name in _names_of(starts, keys)])
    shown = _starts(result, plan, keys, attractors, starts, orbits)
    return [_fractions(result, plan, keys[0], attractors), shown] if keys else [shown]


def _names_of(table: pd.DataFrame, keys: Sequence[str]) -> list[tuple[Any, ...]]:
    """Identify the attractor of each row by the value of the key and its name."""
    return list(zip(*(table[name] for name in (*keys, "attractor")), strict=True))


def _motion(row: pd.Series) -> str:
    """Say which fraction of initial conditions an attractor has, and how far it moves in its main direction."""
    size, name = max((row[name], name) for name in ("rms_x_m", "rms_y_m"))
    moves = f"{display_name(name)} {digits.quantity(size, unit_of(name))}" if pd.notna(size) else ""
    return ", ".join(filter(None, (digits.percent(row["fraction"]), moves)))


def _starts(
    result: Result,
    plan: Any,
    keys: Sequence[str],
    attractors: pd.DataFrame,
    starts: pd.DataFrame,
    orbits: picture.Orbits,
) -> picture.Picture:
    """Return the initial conditions in colours of their attractors: the other keys, or the turns, over the first."""
    colours, ranges = picture.attractor_colours(attractors["attractor"]), plan["initial_conditions"]
    motions = {} if keys else {row["attractor"]: _motion(row) for _, row in attractors.iterrows()}
    classes = {name: (colour, ": ".join(filter(None, (name, motions.get(name))))) for name, colour in colours.items()}
    axes = content.axes_of(starts, ranges)
    others = [name for name in ranges if name not in axes[:1]]
    kind: Any = "tiles" if len(ranges) == 2 and all(len(ends) == 3 for ends in ranges.values()) else "points"
    by: dict[str, Any] = {"by": "attractor", "classes": classes}
    panels = [picture.Panel(name, kind=kind if name == others[0] else "points", **by) for name in others]
    panels = panels or [picture.Panel("turns", title="turns until settled", **by)]
    groups = [*content.in_groups(starts, keys)] if keys else [starts]
    facets = [picture.Facet(value_words(key, rows[key].iloc[0]), [n]) for key in keys for n, rows in enumerate(groups)]
    hidden = not keys and starts.duplicated([*ranges][:2]).any()
    box = "" if keys else box_words(dict([*ranges.items()][2:]))
    lines = (
        box and f"initial conditions: {box}",
        f"at most {plan['max_turns']} turns",
        "of overlapping points, only the last is visible" if hidden else "",
    )
    return picture.Picture(
        name="basins",
        heading="Basins",
        title=sentence(result.answer.headline),
        table=starts,
        table_name="starts",
        special=None if keys else attractors,
        special_name="attractors",
        axes=axes,
        panels=panels,
        series=[picture.Series("", rows.index.to_numpy(), mode="dots") for rows in groups],
        facets=facets,
        caption=caption_of([result.name], result.known_scene, keys, *lines),
        meaning="Each dot is an initial condition, in the colour of the attractor to which it converges within "
        f"{plan['max_turns']} turns. Choose the same key for both axes to see how many converge to each.",
        orbits=picture.Orbits(attractors, (), [*(orbits.owner or ()), *range(0 if keys else len(attractors))]),
        high=True,
        places=("page",) if keys else ("print", "page"),
    )


def _fractions(result: Result, plan: Any, key: str, attractors: pd.DataFrame) -> picture.Picture:
    """Return the basin fractions over a key, and the motion of each attractor."""
    colours, turns = picture.attractor_colours(attractors["attractor"]), f"within {plan['max_turns']} turns"
    several = attractors["attractor"][attractors["fraction"] > MIN_FRACTION].nunique() > 1
    panels, omitted = content.measures(attractors, stripped=not several)
    box = f"{box_words(plan['initial_conditions'])}, {turns}"
    return picture.Picture(
        name="basins",
        heading="Basin fractions",
        title=sentence(result.answer.headline),
        table=attractors,
        table_name="attractors",
        axes=content.axes_of(attractors, [key]),
        panels=[
            *([picture.Panel("fraction", kind="stack", least=1.0, label="basin fraction")] if several else []),
            *panels,
        ],
        series=[
            picture.Series(name, content.rows_of(attractors["attractor"] == name), colour=colours[name], mode="lines")
            for name in colours
        ],
        states=content.motions_of(attractors),
        caption=caption_of([result.name], result.known_scene, [key], f"initial conditions: {box}", omitted),
        meaning=f"The fraction of initial conditions that converges to each attractor {turns}, and its motion.",
        orbits=picture.Orbits(attractors),
    )
