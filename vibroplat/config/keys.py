"""The keys of a configuration as a list: symbol, unit, default, allowed values and meaning of each.

All of it is read from the models in :mod:`vibroplat.config.scene`, where keys are defined.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple

from vibroplat.columns import unit_of
from vibroplat.config.fields import LARGEST, LARGEST_ANGLE, LEAST
from vibroplat.config.scene import Scene

#: Limits that only keep products of numbers finite; they are not worth a word.
_TRIVIAL = {LEAST, LARGEST, -LARGEST, LARGEST_ANGLE, -LARGEST_ANGLE, 2**63 - 1}
#: The section whose keys are the swept frequencies; all of them are in Hz.
_FREQUENCIES = "sweep.supply_frequency_hz"


class Key(NamedTuple):
    """A key of a configuration.

    Attributes
    ----------
    name
        Dotted name. ``N`` is a place in a list.
    symbol
        In the equations; "" for none.
    unit
        "" for none.
    default
        As it is written in YAML; "" if the key is required or its meaning says what holds without it.
    allowed
        What it may be.
    meaning
        What it is.
    """

    name: str
    symbol: str
    unit: str
    default: str
    allowed: str
    meaning: str


@cache
def keys() -> dict[str, Key]:
    """Return all keys of a configuration by their names, in the order of the models; sections are not among them."""
    schema = Scene.model_json_schema()
    return {key.name: key for key in _keys(schema, schema["$defs"], "")}


def key_of(name: str) -> Key:
    """Return a key by its dotted name, which may have numbers as places in lists; KeyError for what is none."""
    return keys()[".".join("N" if part.isdigit() else part for part in name.split("."))]


def _keys(model: Mapping[str, Any], models: Mapping[str, Any], prefix: str) -> Iterator[Key]:
    """Yield the keys of a section and of the sections in it."""
    required = model.get("required", ())
    for name, field in model["properties"].items():
        dotted = f"{prefix}{name}"
        choices = [choice for choice in field.get("anyOf", [field]) if choice.get("type") != "null"]
        inside = [c.get("$ref") or c.get("items", {}).get("$ref") for c in choices]
        if inside[0]:
            below = models[inside[0].rpartition("/")[2]]
            yield from _keys(below, models, f"{dotted}.N." if "items" in choices[0] else f"{dotted}.")
            continue
        unit = "Hz" if prefix == f"{_FREQUENCIES}." and name != "direction" else unit_of(name)
        default = "" if name in required or field.get("default") is None else yaml(field["default"])
        allowed = " or ".join(_allowed(choice) for choice in choices) + ("; required" if name in required else "")
        yield Key(dotted, field.get("symbol", ""), unit, default, allowed, field["description"])


def _allowed(field: Mapping[str, Any]) -> str:
    """Say what a field may be, by its JSON schema."""
    if "enum" in field or "const" in field:
        return ", ".join(yaml(value) for value in field.get("enum", [field.get("const")]))
    if field["type"] not in ("number", "integer"):
        names = {"string": "text", "boolean": "true, false", "array": "a list", "object": "keys and lists"}
        return names[field["type"]]
    words = (("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"))
    limits = [f"{sign} {field[name]:.15g}" for name, sign in words if name in field and field[name] not in _TRIVIAL]
    return ", ".join(["whole number" if field["type"] == "integer" else "number", *limits])


def yaml(value: Any) -> str:
    """Write a plain value as in YAML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.15g}"
        return text if float(text) == value else repr(value)
    if isinstance(value, list):
        return f"[{', '.join(map(yaml, value))}]"
    return str(value)
