"""Words for keys and columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from vibroplat.columns import split

#: Words that are written otherwise.
_WORDS = {"rms": "RMS", "phi": "φ", "phi1": "φ₁", "phi2": "φ₂", "lyapunov": "Lyapunov", "re": "(real)", "im": "(imag.)"}

_EXTREMES = {"max": "largest", "min": "smallest"}


def words(key: str) -> str:
    """Return a key as a person says it, without its unit: ``gap_max_m`` is "largest gap"."""
    parts = split(key)[0].split("_")
    if len(parts) > 1 and parts[-1] in _EXTREMES:
        parts = [_EXTREMES[parts[-1]], *parts[:-1]]
    return " ".join(_WORDS.get(part, part) for part in parts)


def flat(tree: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted keys and values of nested sections and lists; places in lists are numbers."""
    inside = enumerate(tree) if isinstance(tree, list) else tree.items() if isinstance(tree, Mapping) else ()
    entries = [(f"{place}.{key}".strip("."), value) for key, value in inside]
    if not entries:
        yield place, tree
    for key, value in entries:
        yield from flat(value, key)
