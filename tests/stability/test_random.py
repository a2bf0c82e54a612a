"""Scenes that Hypothesis draws, and shrinks where one is not sound."""

from __future__ import annotations

import pytest
from common.random_scenes import STORM, TURNS, Draw, drawn
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stability.checks import NAMED, row, sound, with_engine
from stability.situations import ENGINES
from vibroplat import simulate
from vibroplat.integrate.native import MAX_STEPS


class Numbers:
    """Random numbers that Hypothesis chooses; the middle of a range is the simplest."""

    def __init__(self, data):
        self._data = data

    def uniform(self, low=0.0, high=1.0, size=None):
        if size is not None:
            return [self.uniform(low, high) for _ in range(size)]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return middle + half * self._data.draw(st.floats(-1.0, 1.0))

    def random(self):
        return self._data.draw(st.floats(0.0, 1.0, exclude_max=True))

    def integers(self, low, high=None):
        low, high = (0, low) if high is None else (low, high)
        return self._data.draw(st.integers(low, high - 1))

    def standard_normal(self, size):
        return [3.0 * self._data.draw(st.floats(-1.0, 1.0)) for _ in range(size)]


def held(data, engine):
    scene = with_engine(drawn(Draw(Numbers(data)), "drawn"), engine)
    summary = simulate(scene, keep="summary").summary
    limits = sound(scene, summary) | {
        "steps": (summary["steps"], MAX_STEPS * (TURNS + 1.0)),
        "restarts": (summary["restarts"], STORM * (TURNS + 1.0)),
    }
    failed = row("drawn", summary["outcome"], limits, allowed=NAMED)["failed"]
    assert failed == "", scene.to_tree()


@pytest.mark.parametrize("engine", ENGINES)
@settings(
    max_examples=100,
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(data=st.data())
def test_any_scene_ends_soundly_with_a_named_outcome(data, engine):
    held(data, engine)
