"""What was run: parameters with their units, and how they differ from the defaults and between results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from vibroplat.columns import unit_of
from vibroplat.config.drive import Drive
from vibroplat.config.keys import Key, key_of
from vibroplat.page.labels import flat, words
from vibroplat.plots.differences import SUPPLY, UNUSED, differing, shortened


def parameters(commands: Sequence[str], configurations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each parameter of some results: its section, words, unit, meaning, default and values."""
    used = [
        {section: value for section, value in tree.items() if section not in ("name", *UNUSED.get(command, ()))}
        for command, tree in zip(commands, configurations, strict=True)
    ]
    sections = list(dict.fromkeys(section for tree in used for section in tree))
    trees = [{key: value for key, value in flat(tree) if value != {}} for tree in used]  # empty sections say nothing
    keys = dict.fromkeys(key for tree in trees for key in tree)
    ordered = sorted(keys, key=lambda key: sections.index(key.partition(".")[0]))
    return [_row(key, [tree.get(key) for tree in trees]) for key in ordered]


def differences(commands: Sequence[str], configurations: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return for each result the values of parameters in which results of its command differ; "" for a single one."""
    found = [""] * len(commands)
    for command in dict.fromkeys(commands):
        places = [place for place, one in enumerate(commands) if one == command]
        for place, keys in zip(places, differing(command, [configurations[place] for place in places]), strict=True):
            found[place] = ", ".join(shortened([_told(key, value) for key, value in keys.items()]))
    return found


def _told(key: str, value: Any) -> str:
    """Return a value with the words of its key and its unit; of a supply, that of its only or largest frequency."""
    if key == SUPPLY:
        drive = Drive.model_validate(value)
        return f"supply {'' if drive.program is None else 'program up to '}{drive.largest_frequency:g} Hz"
    place = next((f"{int(part) + 1} " for part in key.split(".") if part.isdecimal()), "")
    number = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
    return f"{words(key)} {place}{number} {unit_of(key)}".rstrip()


def _row(name: str, values: Sequence[Any]) -> dict[str, Any]:
    try:
        key: Key | None = key_of(name)
    except KeyError:  # of a grid, or of another version
        key = None
    default = None if key is None else key.default
    return {
        "section": " ".join(_count(part) for part in name.split(".")[:-1]),
        "words": words(name) or name,
        "unit": unit_of(name),
        "meaning": "" if key is None else ": ".join(text for text in (key.symbol, key.meaning) if text),
        "default": default,
        "values": list(values),
        "changed": [value is not None and value != default for value in values],
        "differs": any(value != values[0] for value in values),
    }


def _count(part: str) -> str:
    """Places in lists begin with 0; exciters and entries of a program are counted from 1."""
    return str(int(part) + 1) if part.isdecimal() else part
