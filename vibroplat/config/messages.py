"""One-line messages about configurations that are not accepted."""

from __future__ import annotations

import difflib
import types
import typing
from typing import Any

from pydantic import BaseModel, ValidationError

_PLAIN = {
    "missing": "a value is required",
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "model_type": "a section of keys and values",
    "model_attributes_type": "a section of keys and values",
    "dict_type": "a section of keys and values",
    "finite_number": "a finite number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "{expected}",
    "too_short": "a list of {min_length}",
    "too_long": "a list of {max_length}",
    "string_too_short": "at least {min_length} character",
    "string_too_long": "at most {max_length} characters",
    "string_pattern_mismatch": "letters, digits and . _ + -, starting with a letter or digit",
}


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Say in one line which key is wrong, what was given and what is allowed.

    Only the first error is described; the number of further errors is appended.
    """
    complaints = error.errors()
    line = _complaint(complaints[0], model)
    more = len(complaints) - 1
    return line if more == 0 else f"{line} (and {more} more)"


def _complaint(entry: Any, model: type[BaseModel]) -> str:
    path = [str(part) for part in entry["loc"]]
    key = ".".join(path)
    if entry["type"] == "extra_forbidden":
        return unknown_key(path, _keys_at(model, path[:-1]))
    if entry["type"] == "value_error":
        prefix = f"{key}: " if key else ""
        return f"{prefix}{entry['ctx']['error']}"
    template = _PLAIN.get(entry["type"])
    allowed = template.format(**entry.get("ctx", {})) if template else entry["msg"]
    return f"{key} = {short(entry['input'])}; allowed: {allowed}"


def unknown_key(path: list[str], known: list[str]) -> str:
    """Name an unknown key, the most similar known key, and all keys known there."""
    near = difflib.get_close_matches(path[-1], known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]}? " if near else ""
    return f"unknown key {'.'.join(path)}; {hint}allowed: {', '.join(known)}"


def _keys_at(model: type[BaseModel], path: list[str]) -> list[str]:
    """Return the keys of a section."""
    current: type[BaseModel] = model
    for part in path:
        if part.isdigit():
            continue
        current = _section_type(_field(current, part).annotation) or current
    return [field.alias or name for name, field in current.model_fields.items()]


def _field(model: type[BaseModel], key: str) -> Any:
    """Find a field by its key."""
    return next(field for name, field in model.model_fields.items() if key in (name, field.alias))


def _section_type(annotation: Any) -> type[BaseModel] | None:
    """Find the section model inside ``Section``, ``Section | None`` or ``list[Section]``."""
    if isinstance(annotation, type) and not isinstance(annotation, types.GenericAlias):
        return annotation if issubclass(annotation, BaseModel) else None
    for argument in typing.get_args(annotation):
        found = _section_type(argument)
        if found is not None:
            return found
    return None


def short(value: Any) -> str:
    """Format a value for a one-line message."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python refuses to print integers of more than 4300 digits
        text = "a number with thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."
