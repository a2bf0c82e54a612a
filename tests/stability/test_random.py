"""Scenes that Hypothesis draws, and shrinks where one is not sound."""

from __future__ import annotations

import pytest
from common.drawing import given
from common.random_scenes import STORM, TURNS, Draw, drawn

from stability.checks import NAMED, row, sound, with_engine
from stability.test_situations import ENGINES
from vibroplat import simulate
from vibroplat.integrate.native import MAX_STEPS


class Numbers:
    """Random numbers that Hypothesis chooses; the middle of a range is the simplest."""

    def __init__(self, data):
        from hypothesis import strategies

        self._draw, self._st = data.draw, strategies

    def uniform(self, low=0.0, high=1.0, size=None):
        if size is not None:
            return [self.uniform(low, high) for _ in range(size)]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return middle + half * self._draw(self._st.floats(-1.0, 1.0))

    def random(self):
        return self._draw(self._st.floats(0.0, 1.0, exclude_max=True))

    def integers(self, low, high=None):
        low, high = (0, low) if high is None else (low, high)
        return self._draw(self._st.integers(low, high - 1))

    def standard_normal(self, size):
        return [3.0 * self._draw(self._st.floats(-1.0, 1.0)) for _ in range(size)]


@pytest.mark.parametrize("engine", ENGINES)
@given(examples=15, data=lambda st: st.data())
def test_any_scene_ends_soundly_with_a_named_outcome(data, engine):
    scene = with_engine(drawn(Draw(Numbers(data)), "drawn"), engine)
    summary = simulate(scene, keep="summary").summary
    limits = sound(scene, summary) | {
        "steps": (summary["steps"], MAX_STEPS * (TURNS + 1.0)),
        "restarts": (summary["restarts"], STORM * (TURNS + 1.0)),
    }
    failed = row("drawn", summary["outcome"], limits, allowed=NAMED)["failed"]
    assert failed == "", scene.to_tree()
