"""Pictures of basins of attraction: which attractor each start comes to, how long it takes, and shares over a key."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vibroplat.columns import PHASE_COLUMN, unit_of
from vibroplat.frames import pd
from vibroplat.results import picture
from vibroplat.results.labels import key_name, sweep_parameters, value_words
from vibroplat.results.result import Result
from vibroplat.study.branches import column_of

OPTIONS = ()
#: Attractors that the legend gives more of than their names, at most.
DESCRIBED = 6


def pictures(results: Sequence[Result], _: Sequence[str] = ()) -> list[picture.Picture]:
    """Return the pictures of each result: its starts, and over a key the shares of them."""
    return [picture for result in results for picture in _pictures(result)]


def _pictures(result: Result) -> list[picture.Picture]:
    plan = result.given("basins")
    keys = [column_of(plan["over"]["key"])] if plan.get("over") else []
    numbers = (*keys, "count", "fraction", "fraction_low", "fraction_high", "rms_x_m", "rms_y_m")
    attractors = result.columns("attractors", ("attractor", "motion", "outcome"), numbers)
    starts = result.columns("starts", ("attractor",), (*keys, *plan["initial_conditions"], "turns"))
    owned = dict(zip(_named(attractors, keys), range(len(attractors)), strict=True))
    orbits = picture.Orbits(attractors, owner=[owned.get(name) for name in _named(starts, keys)])
    shown = _starts(result, plan, keys, attractors, starts, orbits)
    return [_shares(result, plan, keys[0], attractors), shown] if keys else [shown]


def _named(table: pd.DataFrame, keys: Sequence[str]) -> list[tuple[Any, ...]]:
    """Return what tells an attractor, or that of a start, from all others: the value of the key and its name."""
    return list(zip(*(table[name] for name in (*keys, "attractor")), strict=True))


def _range(key: str, ends: Sequence[float]) -> str:
    """Say between which values starts have a key."""
    return f"{key_name(key)} {ends[0]:.4g} … {ends[1]:.4g} {unit_of(key)}".strip()


def _described(attractors: pd.DataFrame) -> dict[str, str]:
    """Return what attractors are called in a legend, by their names."""
    found = {}
    for _, row in attractors.iterrows():
        told = [f"{row['attractor']}: {row['fraction']:.3g}"]
        if len(attractors) <= DESCRIBED and pd.notna(row["rms_y_m"]):
            if pd.notna(row[PHASE_COLUMN]):
                told.append(f"Δφ {round(row[PHASE_COLUMN], 2) + 0.0:g} rad")
            told.append(f"RMS y {1e3 * row['rms_y_m']:.3g} mm")
        found[row["attractor"]] = ", ".join(told)
    return found


def _starts(
    result: Result,
    plan: Any,
    keys: Sequence[str],
    attractors: pd.DataFrame,
    starts: pd.DataFrame,
    orbits: picture.Orbits,
) -> picture.Picture:
    """Return the starts over the first key: the others, and the turns until they settle, in colours of attractors.

    Turns of motions that come to no orbit say nothing beside those of others.
    """
    colours, ranges = picture.attractor_colours(attractors["attractor"]), plan["initial_conditions"]
    names = dict.fromkeys(colours, "") | ({} if keys else _described(attractors))
    classes = {name: (colour, names[name] or name) for name, colour in colours.items()}
    _, *others = ranges
    settled = starts["attractor"].isin(attractors["attractor"][attractors["period"].gt(0)])
    kind: Any = "tiles" if len(ranges) == 2 and all(len(ends) == 3 for ends in ranges.values()) else "points"
    by: dict[str, Any] = {"by": "attractor", "classes": classes}
    panels = [picture.Panel(name, kind=kind if name == others[0] else "points", **by) for name in others]
    panels += [picture.Panel("turns", title="turns until settled", **by)]
    if others and settled.any():
        label = "turns until settled" + ("" if settled.all() else "; pale: not settled")
        panels.append(picture.Panel(others[0], kind=kind, by="settled_turns", label=label))
    groups = [*picture.in_groups(starts, keys)] if keys else [starts]
    facets = (
        [picture.Facet(value_words(keys[0], rows[keys[0]].iloc[0]), [n]) for n, rows in enumerate(groups)]
        if keys
        else []
    )
    hidden = not keys and starts.duplicated([*ranges][:2]).any()
    box = "" if keys else ", ".join(_range(key, ranges[key]) for key in list(ranges)[2:])
    told = (
        sweep_parameters(result.known_scene, keys),
        box and f"starts: {box}",
        f"starts followed for {plan['max_turns']} turns",
        "where several starts have one place, the last is seen" if hidden else "",
    )
    return picture.Picture(
        name="basins",
        heading="Basins",
        title=result.name,
        table=starts,
        table_name="starts",
        special=None if keys else attractors,
        special_name="attractors",
        drawn=starts.assign(settled_turns=starts["turns"].astype(float).where(settled)),
        axes=picture.axes_of(starts, ranges),
        panels=panels,
        series=[picture.Series("", rows.index.to_numpy(), mode="dots") for rows in groups],
        facets=facets,
        choice=keys[0] if keys else "",
        told="\n".join(filter(None, told)),
        meaning="Each dot is a start, in the colour of the attractor to which its motion converges within "
        f"{plan['max_turns']} turns. A key drawn over itself shows how many starts come to each attractor.",
        orbits=picture.Orbits(attractors, (), [*(orbits.owner or ()), *range(0 if keys else len(attractors))]),
        high=True,
        places=("page",) if keys else ("print", "page"),
    )


def _shares(result: Result, plan: Any, key: str, attractors: pd.DataFrame) -> picture.Picture:
    """Return the shares of attractors over a key, and their motions."""
    colours, turns = picture.attractor_colours(attractors["attractor"]), f"within {plan['max_turns']} turns"
    box = ", ".join([*(_range(*one) for one in plan["initial_conditions"].items()), turns])
    return picture.Picture(
        name="basins",
        heading="Shares",
        title=result.name,
        table=attractors,
        table_name="attractors",
        axes=picture.axes_of(attractors, [key]),
        panels=[
            picture.Panel("fraction", kind="stack", least=1.0, label="share of the starts"),
            *picture.measures(attractors),
        ],
        series=[
            picture.Series(name, picture.rows_of(attractors["attractor"] == name), colour=colours[name])
            for name in colours
        ],
        states=picture.motions_of(attractors),
        told="\n".join(filter(None, (sweep_parameters(result.known_scene, [key]), f"starts: {box}"))),
        meaning=f"The share of the starts that converges to each attractor {turns}, and below it the motion of each.",
        orbits=picture.Orbits(attractors),
    )
