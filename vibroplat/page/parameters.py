"""What was run: parameters with their units, and how they differ from the defaults and between results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from vibroplat.columns import unit_of
from vibroplat.page.labels import field, flat, words

#: Sections that a command does not use.
UNUSED = {"run": ("sweep", "orbits"), "sweep": ("run", "output", "orbits"), "orbits": ("sweep", "output")}


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


def _row(key: str, values: Sequence[Any]) -> dict[str, Any]:
    info = field(key)
    default = None if info is None or info.default is PydanticUndefined else info.default
    if isinstance(default, BaseModel):
        default = default.model_dump(exclude_none=True)
    return {
        "section": " ".join(_count(part) for part in key.split(".")[:-1]),
        "words": words(key) or key,
        "unit": unit_of(key),
        "meaning": meaning(info),
        "default": default,
        "values": list(values),
        "changed": [value is not None and value != default for value in values],
        "differs": any(value != values[0] for value in values),
    }


def meaning(info: FieldInfo | None) -> str:
    """Symbol of a key in the equations, and what it means."""
    if info is None:
        return ""
    extra = info.json_schema_extra
    symbol = str(extra.get("symbol", "")) if isinstance(extra, dict) else ""
    return ": ".join(text for text in (symbol, info.description or "") if text)


def _count(part: str) -> str:
    """Places in lists begin with 0; exciters and entries of a program are counted from 1."""
    return str(int(part) + 1) if part.isdecimal() else part
