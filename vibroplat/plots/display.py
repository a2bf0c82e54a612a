"""Figures at a prompt and in a notebook, from results and orbits; ``vibroplat plot`` does not load orbits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from vibroplat.config.coordinates import TURN
from vibroplat.continuation.orbit import Orbit
from vibroplat.errors import ConfigError, TableError
from vibroplat.plots.command import FIGURE_NAMES, draw_results, pictures_of
from vibroplat.plots.pictures import draw_picture
from vibroplat.plots.reading import rest_of
from vibroplat.plots.style import styled
from vibroplat.results.labels import run_parameters
from vibroplat.results.picture import CURVES, Panel, Picture, Series, finite
from vibroplat.results.result import Result

#: Points of an orbit that are drawn.
DRAWN = 2000


def figure_of(shown: Result | Orbit, kind: str | None = None, **options: Any) -> Figure:
    """Draw a figure of a result or of an orbit.

    Raises
    ------
    ConfigError
        There is no such figure.
    TableError
        There is nothing to draw.
    """
    with styled():
        return orbit_figure(shown) if isinstance(shown, Orbit) else _result_figure(shown, kind, options)


def _result_figure(result: Result, kind: str | None, options: Mapping[str, Any]) -> Figure:
    """Draw a figure of a result, the first one if none is named."""
    names, allowed = FIGURE_NAMES[result.command].split(), pictures_of(result.command).OPTIONS
    if not names:
        raise ConfigError("the figures of the paper are many; allowed: vibroplat plot DIR")
    if kind is not None and kind not in names:
        raise ConfigError(f"kind = {kind!r}; allowed: {', '.join(names)}")
    if wrong := [name for name in options if name not in allowed]:
        raise ConfigError(f"option {wrong[0]} is unknown; allowed: {', '.join(allowed) or 'none'}")
    for _, figure in draw_results([result], [] if kind is None else [kind], **options):
        return figure
    raise TableError(f"{result.place} holds nothing to draw")


def orbit_figure(orbit: Orbit) -> Figure:
    """Draw an orbit: its speed over its height, and the gap over turns of exciter 1 where there is material."""
    table = orbit.run(np.linspace(0.0, orbit.run.segments[-1].end, DRAWN))
    turns = (table["phi1_rad"] - table["phi1_rad"].iloc[0]).abs() / TURN
    title = f"period {orbit.period}, {'stable' if orbit.stable else 'unstable'}, {orbit.sequence}"
    panels = [Panel("y_rate_m_per_s", "y_from_rest_m", label=r"$\dot y$", title=title)]
    panels += [Panel("gap_m", "turns_of_exciter_1", least=0.0)] if orbit.scene.has_contact else []
    places = range(len(table))
    look: dict[str, Any] = {"name": "orbit", "heading": "Orbit", "table_name": "orbit", "high": True}
    picture = Picture(
        title=orbit.scene.name,
        table=finite(table.assign(y_from_rest_m=table["y_m"] - rest_of(orbit.scene), turns_of_exciter_1=turns)),
        axes=["y_from_rest_m"],
        panels=panels,
        series=[Series("", places, "", CURVES[n], "lines", of=(one.column,)) for n, one in enumerate(panels)],
        caption=run_parameters(orbit.scene),
        **look,
    )
    return draw_picture(picture)
