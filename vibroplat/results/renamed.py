"""Results of former versions under the present names of columns, values, tables and keys.

What was printed stays as it was.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vibroplat.config.schema import REMOVED_KEYS, RENAMED_KEYS, RENAMED_VALUES

if TYPE_CHECKING:
    import pandas as pd

#: Measures and other columns, and their names now.
COLUMNS = {
    "latches": "chatters",
    "measured_latches": "measured_chatters",
    "unstable": "n_unstable",
    "coexists": "coexisting",
    "margin": "stability_margin",
    "stage": "reason",
    "rotation": "relative_rotation",
    **{
        f"{part}torque_share_{n}{end}": f"{part}torque_ratio_{n}{end}"
        for part in ("", "whole_")
        for n in (1, 2)
        for end in ("", "_max")
    },
}
_OUTCOMES = {"event-storm": "too-many-events", "beyond-model": "outside-model-validity"}
#: Values of columns, and what they are now.
_VALUES = {
    **dict.fromkeys(("outcome", "name", "attractor"), _OUTCOMES),
    "regime": {f"none, {old}": f"none, {new}" for old, new in _OUTCOMES.items()},
    "kind": {
        "latch": "chatter",
        "level crossing": "level-crossing",
        "depends on how long": "unresolved-transient",
    },
    "reason": {"twice as long": "extended"},
    "measure": COLUMNS,
}
#: Sections that name keys, and keys of plans that name measures.
_PLANS = ("sweep", "orbits", "find", "basins", "design")
_OF_MEASURES = ("expression", "constraints", "pareto", "minimize", "measures")
#: Present names of tables, and what they were.
TABLES = {"variance_contributions": "shares"}


def rename_table(table: pd.DataFrame, command: str) -> pd.DataFrame:
    """Return a table with present columns and values; the margins of the paper's claims are called so still."""
    table = table.rename(columns=COLUMNS if command != "paper" else {**COLUMNS, "margin": "margin"})
    texts = {name: values for name, values in _VALUES.items() if name in table}
    return table.assign(**{name: table[name].replace(values) for name, values in texts.items()})


def rename_keys_of(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with present keys as names of columns, and as values of the column ``key``."""
    table = table.rename(columns=RENAMED_KEYS)
    if "key" in table and table["key"].isin([*RENAMED_KEYS]).any():
        table = table.assign(key=table["key"].replace(RENAMED_KEYS))
    return table


def rename_summary(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the summary of a run with present names."""
    return {
        COLUMNS.get(name, name): _OUTCOMES.get(value, value) if name == "outcome" else value
        for name, value in summary.items()
    }


def rename_keys(configuration: dict[str, Any]) -> None:
    """Give the keys of a configuration their present names, and the measures that its sections name; drop old keys."""
    for old in REMOVED_KEYS:
        section, key = _section_of(configuration, old)
        section.pop(key, None)
    for old, new in RENAMED_KEYS.items():
        section, key = _section_of(configuration, old)
        if key in section:
            section[new.rpartition(".")[2]] = section.pop(key)
    for name, values in RENAMED_VALUES.items():
        section, key = _section_of(configuration, name)
        if isinstance(section.get(key), str):
            section[key] = values.get(section[key], section[key])
    for name in _PLANS:
        plan, _ = _section_of(configuration, f"{name}.")
        plan |= {key: _rename(value, _present_key) for key, value in plan.items()}
        if name in ("find", "design"):
            plan |= {key: _rename(plan[key], _present_measures) for key in _OF_MEASURES if key in plan}


def _section_of(configuration: Any, name: str) -> tuple[dict[str, Any], str]:
    """Return the section of a dotted key, an empty one if a configuration has none, and the key's last part."""
    *sections, key = name.split(".")
    for section in sections:
        configuration = configuration.get(section) if isinstance(configuration, dict) else None
    return (configuration if isinstance(configuration, dict) else {}), key


def _rename(value: Any, present: Callable[[str], str]) -> Any:
    """Apply a renaming to a text, or to the texts in a list or in the keys and values of a dictionary."""
    if isinstance(value, dict):
        return {present(name): _rename(part, present) for name, part in value.items()}
    if isinstance(value, list):
        return [_rename(part, present) for part in value]
    return present(value) if isinstance(value, str) else value


def _present_key(name: str) -> str:
    return RENAMED_KEYS.get(name, name)


def _present_measures(expression: str) -> str:
    return re.sub(r"\w+", lambda word: COLUMNS.get(word[0], word[0]), expression)
