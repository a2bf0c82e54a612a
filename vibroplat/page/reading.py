"""Finds the results in directories: a run, a sweep, orbits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, TableError
from vibroplat.plots.reading import read_result
from vibroplat.results.files import Command, Result

#: The table by which the result of a command is found.
TABLES: dict[Command, str] = {"run": "trajectory", "sweep": "sweep", "orbits": "branches"}


@dataclass(frozen=True)
class Found:
    """A result of a command.

    Attributes
    ----------
    result, command
        Its files, and the command that wrote them.
    label
        Its name, with its directory where two have the same.
    configuration
        The full configuration.
    summary
        Of a run; empty for other commands.
    """

    result: Result
    command: Command
    label: str
    configuration: dict[str, Any]
    summary: dict[str, Any]

    @property
    def scene(self) -> Scene:
        """What was simulated."""
        try:
            return Scene.from_tree(self.configuration)
        except ConfigError as error:
            raise TableError(f"the configuration in {self.result.directory}: {error}") from None

    def has(self, name: str) -> bool:
        """Whether a table is there."""
        return any(self.result.directory.glob(f"{name}.*"))


def find_results(directories: Sequence[Path]) -> list[Found]:
    """Return all results in some directories, each with a label of its own.

    Raises
    ------
    TableError
        A directory holds none, or one that is damaged or of another version.
    """
    found = [result for directory in dict.fromkeys(directories) for result in _in(directory)]
    labels = [(one.label, one.command) for one in found]
    return [one if labels.count((one.label, one.command)) == 1 else _with_directory(one) for one in found]


def _in(directory: Path) -> Iterator[Found]:
    commands = [command for command, name in TABLES.items() if any(directory.glob(f"{name}.*"))]
    if not commands:
        raise TableError(f"{directory} holds no finished run, sweep or orbits; allowed: a directory with one of them")
    for command in commands:
        result = read_result(directory, command)
        configuration = result.provenance.get("configuration")
        if not isinstance(configuration, dict):
            raise TableError(f"the provenance in {directory} holds no configuration; repeat the command that wrote it")
        summary = result.document("summary") if command == "run" else {}
        if not isinstance(summary, dict):
            raise TableError(f"{directory / 'summary.json'} is not the summary of a run")
        name = str(summary.get("name") or configuration.get("name") or directory.name)
        yield Found(result, command, name, configuration, summary)


def _with_directory(one: Found) -> Found:
    label = f"{one.label} ({one.result.directory})"
    return Found(one.result, one.command, label, one.configuration, one.summary)
