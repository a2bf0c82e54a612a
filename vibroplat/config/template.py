"""A configuration to start from: all keys of the quickstart with its values, each with what it means."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import wrap
from typing import Any

from vibroplat.config.keys import Key, keys, yaml
from vibroplat.config.overrides import flat
from vibroplat.config.reader import configurations, load_tree

#: Column at which comments begin, if there is room.
_COMMENTS = 44
#: Most characters of a line.
_WIDTH = 110
#: What the template leaves out: other ways to give the same, and what few ever need.
_LEFT_OUT = (
    "name",
    "orbits.",
    "motors.",
    "exciters.",
    "drive.program.",
    "run.initial.state.",
    "run.initial.phase_sum_rad",
)
_HEAD = """\
# A configuration to start from. Lines that begin with # are other ways to give something, or keys that are not needed.
"""
_COMMANDS = {
    "vibroplat run {file}": "simulates it, prints a summary, writes results/{name}",
    "vibroplat sweep {file}": "sweeps over supply frequencies, as section sweep says",
    "vibroplat orbits {file}": "follows periodic orbits, unstable ones as well, as section orbits says",
    "vibroplat plot results/{name}": "draws what is in results/{name}",
    "vibroplat report results/{name}": "writes it into an HTML page",
    "vibroplat schema --markdown": "lists all keys, also of two unequal motors or exciters",
}
_SWEEP = {"sweep.grid": "{material.mass_ratio: [0, 0.1, 0.2]}"}
#: Stands after the supply frequency.
_PROGRAM = """\
  # program:                                # instead: the supply over time, here a start in 3 s; starts from rest
  #   - {t_s: 0, supply_frequency_hz: 0}    # also need run.initial.speed_ratio: 0
  #   - {t_s: 3, supply_frequency_hz: 51.5}"""
_ORBITS = """\
orbits:
  key: drive.supply_frequency_hz            # dotted key that varies along a branch
  start: 42                                 # one end of its range
  stop: 80                                  # the other end
  grid: {material.mass_ratio: [0, 0.1, 0.2]}  # branches for each value"""


def template(file: str, name: str) -> str:
    """Return the text of a configuration; its head names the file and the scene."""
    given = flat(load_tree(configurations() / "quickstart.yaml"))
    wanted = [key for key in keys().values() if not key.name.startswith(_LEFT_OUT)]
    lines: list[str] = [_head(file, name)]
    above: list[str] = []
    for key in wanted:
        *sections, last = key.name.split(".")
        for depth, section in enumerate(sections):
            if sections[: depth + 1] != above[: depth + 1]:
                lines.append(f"{'  ' * depth}{section}:")
        above = sections
        lines += _lines(last, "  " * len(sections), key, given)
        if key.name == "drive.supply_frequency_hz":
            lines.append(_PROGRAM)
    return "\n".join([*lines, _ORBITS]) + "\n"


def _head(file: str, name: str) -> str:
    """Say what can be done with the file."""
    rows = [(command.format(file=file, name=name), does.format(name=name)) for command, does in _COMMANDS.items()]
    width = max(len(command) for command, _ in rows)
    return _HEAD + "".join(f"#   {command:<{width}}  {does}\n" for command, does in rows)


def _lines(last: str, indent: str, key: Key, given: Mapping[str, Any]) -> list[str]:
    """Write a key with its value and its meaning; one without a value is a comment, and long meanings stand above."""
    value = _SWEEP.get(key.name) or (yaml(given[key.name]) if key.name in given else key.default)
    text = f"{indent}{'' if value else '# '}{last}:{f' {value}' if value else ''}"
    about = ", ".join(part for part in (key.symbol, key.meaning) if part)
    beside = f"{text:<{_COMMENTS - 2}}  # {about}"
    if len(beside) <= _WIDTH:
        return [beside]
    return [f"{indent}# {line}" for line in wrap(about, _WIDTH - len(indent) - 2)] + [text]
