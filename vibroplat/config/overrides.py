"""Merges nested plain values: files that extend files, ``--set``, ``Scene.replace``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from vibroplat.config.drive import Drive
from vibroplat.config.sections import OF_EXCITERS, Initial, Material
from vibroplat.errors import ConfigError

#: Pairs of keys that exclude each other, by section: if an upper layer gives one, the lower layer's other is dropped.
ALTERNATIVES = {
    "": (("motor", "motors"),),
    "material": Material.alternatives,
    "drive": Drive.alternatives,
    "run.initial": Initial.alternatives,
}

#: Sections with free keys: they are replaced as a whole, because merging could never remove a key.
REPLACED = frozenset({"sweep.grid"})


def merge(lower: Mapping[str, Any], upper: Mapping[str, Any], section: str = "") -> dict[str, Any]:
    """Override ``lower`` with ``upper``: merge sections key by key, replace other values and :data:`REPLACED`.

    Exciters are merged one by one, also with a lower layer that gives their numbers in ``motor`` and ``machine``. An
    entry of any list is overridden by its place, as in ``exciters.1.critical_slip``.

    Raises
    ------
    ConfigError
        A list has no such place.
    """
    merged = dict(lower)
    if not section and upper.get("exciters") is not None and merged.get("exciters") is None:
        merged = _with_exciters(merged)
    if not section and isinstance(upper.get("motors"), Mapping) and merged.get("motors") is None:
        merged["motors"] = [dict(merged.get("motor") or {}) for _ in range(2)]
    for pair in ALTERNATIVES.get(section, ()):
        for given, other in (pair, reversed(pair)):
            if upper.get(given) is not None and upper.get(other) is None:
                merged.pop(other, None)
    for key, value in upper.items():
        below = merged.get(key)
        inner = f"{section}.{key}".strip(".")
        if isinstance(below, list) and isinstance(value, Mapping):
            merged[key] = _merge_places(below, value, inner)
        elif inner == "exciters" and isinstance(below, list) and isinstance(value, list) and len(value) == len(below):
            merged[key] = _merge_places(below, {str(place): of for place, of in enumerate(value)}, inner)
        elif isinstance(value, Mapping) and inner not in REPLACED:
            merged[key] = merge(below if isinstance(below, Mapping) else {}, value, inner)
        else:
            merged[key] = value
    return merged


def _merge_places(below: list[Any], places: Mapping[str, Any], section: str) -> list[Any]:
    """Override entries of a list by their places."""
    merged = list(below)
    for place, value in places.items():
        if not (place.isdecimal() and int(place) < len(below)):
            known = [f"{section}.{number}" for number in sorted({0, len(below) - 1})] if below else ["none"]
            raise ConfigError(f"unknown key {section}.{place}; allowed: {' to '.join(known)}")
        old = merged[int(place)]
        inner = f"{section}.{place}"
        both = isinstance(value, Mapping) and isinstance(old, Mapping)
        merged[int(place)] = merge(old, value, inner) if both else value
    return merged


def _with_exciters(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Move the numbers of the exciters from ``motor``, ``motors`` and ``machine`` to ``exciters``."""
    moved = {key: value for key, value in tree.items() if key not in ("motor", "motors")}
    motors = tree.get("motors") or [tree.get("motor") or {}] * 2
    machine = tree.get("machine") or {}
    if not (isinstance(machine, Mapping) and all(isinstance(motor, Mapping) for motor in motors)):
        return dict(tree)  # to be refused when the scene is built
    own = {key: machine[key] for key in OF_EXCITERS if key in machine}
    moved["exciters"] = [{**motor, **own} for motor in motors]
    if own:
        moved["machine"] = {key: value for key, value in machine.items() if key not in own}
    return moved


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
