"""The situations by name, and the number of scenes of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from vibroplat.bench.stability.accumulation import accumulation, elastic
from vibroplat.bench.stability.campaign import campaign
from vibroplat.bench.stability.endurance import endurance
from vibroplat.bench.stability.grazing import grazing
from vibroplat.bench.stability.invariance import invariance
from vibroplat.bench.stability.layers import layers
from vibroplat.bench.stability.release import release
from vibroplat.bench.stability.starting import starting
from vibroplat.bench.stability.units import units


class Situation(NamedTuple):
    """A situation, and its number of scenes (turns for ``endurance``) in the tests and in the report."""

    run: Callable[[int], list[dict[str, Any]]]
    few: int
    all: int


SITUATIONS: dict[str, Situation] = {
    "grazing": Situation(grazing, 40, 200),
    "release": Situation(release, 25, 500),
    "accumulation": Situation(accumulation, 16, 380),
    "elastic": Situation(elastic, 12, 80),
    "layers": Situation(layers, 60, 1500),
    "starting": Situation(starting, 7, 21),
    "endurance": Situation(endurance, 3_000, 3_000_000),
    "invariance": Situation(invariance, 14, 52),
    "units": Situation(units, 40, 198),
    "campaign": Situation(campaign, 200, 10_000),
}
