"""The sequence of events of a periodic orbit, as a word of one letter an event."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import Mode
from vibroplat.hybrid.modes import IMPACT, LATCH, LIFTOFF

#: What the letters stand for in tables: S is an impact, or impacts that accumulate, after which contact holds.
NAMES = {"L": "liftoff", "I": "impact", "S": "stick"}

#: The word of an orbit without events, in tables.
NONE = "none"


def word_of(events: npt.NDArray[np.void], restitution: float) -> str:
    """Spell the events of a period, records of :data:`vibroplat.hybrid.state.EVENT`.

    How many of the impacts that accumulate are followed one by one depends on the tolerance, and they are infinitely
    many: with restitution, impacts before one that sticks belong to it.
    """
    letters = ""
    for kind, mode in zip(events["kind"].tolist(), events["mode_after"].tolist(), strict=True):
        if kind == LIFTOFF:
            letters += "L"
        elif kind in (IMPACT, LATCH):
            letters += "S" if mode == Mode.ATTACHED else "I"
    return _shortened(letters, restitution)


def whole(word: str, restitution: float) -> str:
    """Turn the word of a period that may begin between impacts that accumulate, as :func:`turned` does."""
    begin = word.rfind("S") + 1
    return turned(_shortened(word[begin:] + word[:begin], restitution))


def _shortened(word: str, restitution: float) -> str:
    return re.sub("I+S", "S", word) if restitution > 0.0 else word


def turned(word: str) -> str:
    """Turn a word so that it does not depend on where the period begins: the first of its rotations in the alphabet."""
    return min((word[k:] + word[:k] for k in range(len(word))), default="")


def spelled(word: str) -> str:
    """Write a word out for a table."""
    return " ".join(NAMES[letter] for letter in word) or NONE
