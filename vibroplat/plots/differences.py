"""The parameters in which results laid over each other differ: their legend names them, not only the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroplat.config.overrides import flat
from vibroplat.config.scene import Scene
from vibroplat.plots.names import supply_label, value_label
from vibroplat.plots.style import plain
from vibroplat.study.branches import FREQUENCY

#: Sections that a command does not use.
UNUSED: dict[str, tuple[str, ...]] = {
    "run": ("sweep", "orbits"),
    "sweep": ("run", "output", "orbits"),
    "orbits": ("sweep", "output"),
}
#: What the axes and curves of a figure show themselves.
_SHOWN = ("sweep.supply_frequency_hz.", "sweep.grid.", "orbits.")
#: Most parameters of a result in a legend.
MOST = 4
#: The supply, constant or a program: one parameter.
SUPPLY = "drive"


def differing(command: str, configurations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return for each full configuration of a command the keys in which they differ, with its values.

    Keys that a configuration does not have, or that a study varies itself, are left out of its own. Lists count by
    their entries; the supply, which may be a number or a program, is the key ``drive``.
    """
    unused = ("name", *UNUSED[command])
    trees = []
    for tree in configurations:
        used = {key: value for key, value in tree.items() if key not in unused}
        supply = {SUPPLY: used.pop(SUPPLY)} if SUPPLY in used else {}
        own = _varied(command, tree)
        kept = supply | flat(_numbered(used))
        trees.append({key: value for key, value in kept.items() if key not in own})
    keys = [key for key in dict.fromkeys(key for tree in trees for key in tree) if not key.startswith(_SHOWN)]
    varied = [key for key in keys if any(tree.get(key) != trees[0].get(key) for tree in trees)]
    return [{key: tree[key] for key in varied if tree.get(key) not in (None, {})} for tree in trees]


def _varied(command: str, tree: Mapping[str, Any]) -> set[str]:
    """Return the keys that a study gives values of its own, as in the result of :func:`differing`."""
    study = tree.get(command, {})
    found = {*study.get("grid", {})}
    found |= {"orbits": {study.get("key", "")}, "sweep": {FREQUENCY}}.get(command, set())
    return found | {SUPPLY} if FREQUENCY in found else found


def distinct(names: Sequence[str], directories: Sequence[Path]) -> list[str]:
    """Return names of results, or their directories where two have the same name."""
    return [name if names.count(name) == 1 else str(place) for name, place in zip(names, directories, strict=True)]


def labels(names: Sequence[str], found: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return for each of several results its name, and how it differs from the others."""
    parts = [", ".join(difference_labels(one)) for one in found]
    return [f"{plain(name)} ({told})" if told else plain(name) for name, told in zip(names, parts, strict=True)]


def difference_labels(found: Mapping[str, Any]) -> list[str]:
    """Return the values of a result's differing keys as in a legend: the first ones, and how many more there are."""
    return shortened([_label(key, value) for key, value in found.items()])


def shortened(parts: Sequence[str]) -> list[str]:
    """Return the first parts of a legend, and how many more there are."""
    return [*parts] if len(parts) <= MOST else [*parts[: MOST - 1], f"{len(parts) - MOST + 1} more"]


def _label(key: str, value: Any) -> str:
    if key == SUPPLY:
        return supply_label(Scene.model_validate({SUPPLY: value}))
    place = next((int(part) + 1 for part in key.split(".") if part.isdecimal()), None)
    label = value_label(key, value)
    return label if place is None else f"{key.split('.', maxsplit=1)[0].removesuffix('s')} {place}: {label}"


def _numbered(tree: Any) -> Any:
    """Return nested sections with lists as sections whose keys are places."""
    if isinstance(tree, list):
        return {str(place): _numbered(value) for place, value in enumerate(tree)}
    return {key: _numbered(value) for key, value in tree.items()} if isinstance(tree, Mapping) else tree
