"""Merges nested plain values: files that extend files, ``--set``, ``Scene.replace``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.errors import ConfigError

#: Keys that exclude each other: if an upper layer gives one, the lower layer's other is dropped.
ALTERNATIVES: tuple[tuple[str, frozenset[str]], ...] = (
    ("", frozenset({"motor", "motors"})),
    ("material", frozenset({"natural_frequency_hz", "stiffness_n_per_m"})),
    ("material", frozenset({"damping_ratio", "damping_n_s_per_m"})),
    ("run.initial", frozenset({"state", "phase_sum_rad"})),
    ("run.initial", frozenset({"state", "phi1_rad"})),
    ("run.initial", frozenset({"state", "speed_ratio"})),
)


#: Sections with free keys: they are replaced as a whole, because merging could never remove a key.
REPLACED = frozenset({"sweep.grid"})


def merge(lower: Mapping[str, Any], upper: Mapping[str, Any], section: str = "") -> dict[str, Any]:
    """Override ``lower`` with ``upper``: merge sections key by key, replace other values and :data:`REPLACED`."""
    merged = dict(lower)
    for place, group in ALTERNATIVES:
        given = {key for key in group & upper.keys() if upper[key] is not None} if place == section else set()
        for key in (group - given) if given else ():
            merged.pop(key, None)
    for key, value in upper.items():
        below = merged.get(key)
        inner = f"{section}.{key}".strip(".")
        if isinstance(value, Mapping) and inner not in REPLACED:
            merged[key] = merge(below if isinstance(below, Mapping) else {}, value, inner)
        else:
            merged[key] = value
    return merged


def nest(dotted: Mapping[str, Any]) -> dict[str, Any]:
    """Turn dotted keys into nested sections: ``{"a.b": 1}`` becomes ``{"a": {"b": 1}}``."""
    tree: dict[str, Any] = {}
    for path, value in dotted.items():
        if not isinstance(path, str):
            raise ConfigError(f"key {path!r} is not text; allowed: key.sub")
        *sections, key = path.split(".")
        node = tree
        for name in sections:
            node = node.setdefault(name, {})
            if not isinstance(node, dict):
                raise ConfigError(f"{path} lies inside {name}, which already has a value")
        node[key] = value
    return tree


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn nested sections into dotted keys; the inverse of :func:`nest`."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = value
    return found
