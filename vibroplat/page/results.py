"""Results on the page: where they are, what was run, and how it differs from the defaults."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroplat.columns import unit_of
from vibroplat.config.keys import Key, key_of
from vibroplat.config.kinds import KINDS, unused_sections
from vibroplat.errors import TableError
from vibroplat.results.files import commands_in
from vibroplat.results.labels import differing, leaves, values_text
from vibroplat.results.result import Result
from vibroplat.results.run import RunResult, load


def find_results(directories: Sequence[Path]) -> list[Result]:
    """Return all results in some directories, each with a label of its own: where two share a name, their directories.

    Raises
    ------
    TableError
        A directory holds none, or one that is damaged or of another version.
    """
    results = [result for directory in dict.fromkeys(directories) for result in _in(directory)]
    names = [(one.label, one.command) for one in results]
    alike = [one for one, name in zip(results, names, strict=True) if names.count(name) > 1]
    places = [Path(os.path.abspath(one.place)) for one in alike]
    for one, path in zip(alike, places, strict=True):
        one.label += f" ({path.relative_to(os.path.commonpath(places))})"
    return results


def _in(directory: Path) -> Iterator[Result]:
    commands = [command for command in commands_in(directory) if command != "paper"]
    if not commands:
        names = f"run, {', '.join(list(KINDS)[:-1])} or {list(KINDS)[-1]}"
        raise TableError(f"{directory} holds no finished {names}; allowed: a directory with one of them")
    for command in commands:
        result = load(directory, command)
        configuration = result.provenance.get("configuration")
        if not isinstance(configuration, dict):
            raise TableError(f"the provenance in {directory} holds no configuration; repeat the command that wrote it")
        summary = result.summary if isinstance(result, RunResult) else {}
        result.label = str(summary.get("name") or configuration.get("name") or directory.name)
        yield result


# -- what was run ------------------------------------------------------------------------------------------------------


def parameters(commands: Sequence[str], configurations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each parameter of some results: its key, unit, meaning, default and values."""
    used = [
        {section: value for section, value in tree.items() if section not in ("name", *unused_sections(command))}
        for command, tree in zip(commands, configurations, strict=True)
    ]
    sections = list(dict.fromkeys(section for tree in used for section in tree))
    # Empty sections say nothing.
    trees = [{key: value for key, value in leaves(tree).items() if value != {}} for tree in used]
    keys = dict.fromkeys(key for tree in trees for key in tree)
    ordered = sorted(keys, key=lambda key: sections.index(key.partition(".")[0]))
    return [_parameter(key, [tree.get(key) for tree in trees]) for key in ordered]


def _parameter(name: str, values: Sequence[Any]) -> dict[str, Any]:
    try:
        key: Key | None = key_of(name)
    except KeyError:  # of a grid, or of another version
        key = None
    default, meaning = (None, "") if key is None else (key.default, ": ".join(filter(None, (key.symbol, key.meaning))))
    # Places in lists begin with 0; exciters and entries of a program are counted from 1.
    return {
        "key": ".".join(str(int(part) + 1) if part.isdecimal() else part for part in name.split(".")),
        "unit": unit_of(name),
        "meaning": meaning,
        "default": default,
        "values": list(values),
        "changed": [value is not None and value != default for value in values],
        "differs": any(value != values[0] for value in values),
    }


def differences(commands: Sequence[str], configurations: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return for each result the values of parameters in which results of its command differ; "" for a single one."""
    texts = [""] * len(commands)
    for command in dict.fromkeys(commands):
        places = [index for index, one in enumerate(commands) if one == command]
        for index, keys in zip(places, differing(command, [configurations[index] for index in places]), strict=True):
            texts[index] = values_text(keys)
    return texts
