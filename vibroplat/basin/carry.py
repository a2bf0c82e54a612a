"""Names of attractors; over a key, an attractor is the same where its orbit is continued from value to value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from vibroplat.config.scene import Scene
from vibroplat.study.pool import Pool
from vibroplat.study.store import Record, Store


def identities(
    scenes: Sequence[Scene], key: str | None, values: Sequence[float], found: Sequence[Any], store: Store, workers: Pool
) -> list[list[str]]:
    """Return the names of the attractors at each value of a key."""
    return [names([a["row"] for a in f.attractors]) for f in found]


def names(rows: Sequence[Record]) -> list[str]:
    """Name attractors as a reader would: by synchronization and period, and where these are alike by more."""
    found = [_name(row) for row in rows]
    for more in (_phase, _height):
        counts = Counter(found)
        found = [f"{name}{more(row)}" if counts[name] > 1 else name for name, row in zip(found, rows, strict=True)]
    counts, seen = Counter(found), Counter[str]()
    for place, name in enumerate(found):
        seen[name] += 1
        found[place] = f"{name} ({seen[name]})" if counts[name] > 1 else name
    return found


def _name(row: Record) -> str:
    if row.get("motion") is None:
        return str(row["outcome"])
    kind = f"period {row['period']}" if row["period"] else row["motion"]
    return f"{'not synchronized' if row['sync'] == 'none' else row['sync']}, {kind}"


def _phase(row: Record) -> str:
    phase = row.get("phase_difference_rad")
    return "" if phase is None else f", Δφ {phase:.2f}"


def _height(row: Record) -> str:
    height = row.get("rms_y_m")
    return "" if height is None else f", RMS y {1e3 * height:.3g} mm"
