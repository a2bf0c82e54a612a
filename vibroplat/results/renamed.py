"""Results of former versions under the present names of columns, values, tables and keys."""

from __future__ import annotations

import re
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
    **{
        f"{part}torque_share_{n}{end}": f"{part}torque_ratio_{n}{end}"
        for part in ("", "whole_")
        for n in (1, 2)
        for end in ("", "_max")
    },
}
#: Values of columns, and what they are now.
_VALUES = {
    "kind": {
        "latch": "chatter",
        "level crossing": "level-crossing",
        "depends on how long": "unresolved-transient",
    },
    "reason": {"twice as long": "extended"},
    "measure": COLUMNS,
}
#: Keys of plans that name measures.
_OF_MEASURES = ("expression", "constraints", "pareto", "minimize", "measures")
#: Present names of tables, and what they were.
TABLES = {"variance_contributions": "shares"}


def rename_table(table: pd.DataFrame, command: str) -> pd.DataFrame:
    """Return a table with present columns and values; the margins of the paper's claims are called so still."""
    table = table.rename(columns=COLUMNS if command != "paper" else {**COLUMNS, "margin": "margin"})
    texts = {name: values for name, values in _VALUES.items() if name in table}
    return table.assign(**{name: table[name].replace(values) for name, values in texts.items()})


def rename_summary(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the summary of a run with present names."""
    return {COLUMNS.get(name, name): value for name, value in summary.items()}


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
    for name in ("find", "design"):
        plan, _ = _section_of(configuration, f"{name}.")
        plan |= {key: _rename_measures(plan[key]) for key in _OF_MEASURES if key in plan}


def _section_of(configuration: Any, name: str) -> tuple[dict[str, Any], str]:
    """Return the section of a dotted key, an empty one if a configuration has none, and the key's last part."""
    *sections, key = name.split(".")
    for section in sections:
        configuration = configuration.get(section) if isinstance(configuration, dict) else None
    return (configuration if isinstance(configuration, dict) else {}), key


def _rename_measures(value: Any) -> Any:
    """Return a name, an expression, or names as keys or in a list with present names."""
    if isinstance(value, dict):
        return {_rename_measures(name): bound for name, bound in value.items()}
    if isinstance(value, list):
        return [_rename_measures(name) for name in value]
    return re.sub(r"\w+", lambda word: COLUMNS.get(word[0], word[0]), value) if isinstance(value, str) else value
