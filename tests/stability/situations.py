"""The situations by name, the engines that go through them, and the number of scenes of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pandas as pd

from stability.accumulation import accumulation, elastic
from stability.agreement import agreement
from stability.campaign import campaign
from stability.endurance import endurance
from stability.grazing import grazing
from stability.invariance import invariance
from stability.layers import layers
from stability.release import release
from stability.starting import starting
from stability.units import units

#: Engines whose figures stand side by side.
ENGINES = ("native", "taylor")


class Situation(NamedTuple):
    """A situation, and its number of scenes (turns for ``endurance``) in the tests and in the report.

    Its function is given the number of scenes and the engine. Where that compares engines, one is enough.
    """

    run: Callable[[int, str], list[dict[str, Any]]]
    few: int
    all: int
    engines: tuple[str, ...] = ENGINES

    def table(self, engine: str, count: int) -> pd.DataFrame:
        """Run scenes with an engine, and make a table of their rows."""
        return pd.DataFrame([{"engine": engine} | row for row in self.run(count, engine)])


SITUATIONS: dict[str, Situation] = {
    "grazing": Situation(grazing, 40, 200),
    "release": Situation(release, 25, 500),
    "accumulation": Situation(accumulation, 16, 380),
    "elastic": Situation(elastic, 12, 80),
    "layers": Situation(layers, 60, 1500),
    "starting": Situation(starting, 7, 21),
    "endurance": Situation(endurance, 3_000, 3_000_000),
    "invariance": Situation(invariance, 14, 56),
    "units": Situation(units, 40, 198),
    "campaign": Situation(campaign, 200, 10_000),
    "agreement": Situation(agreement, 80, 10_000, ("native",)),
}
