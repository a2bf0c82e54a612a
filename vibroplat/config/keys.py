"""The keys of a configuration as a list: symbol, unit, default, allowed values and meaning of each; and a template.

All of it is read from the models of the sections, where keys are defined.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import groupby, takewhile
from textwrap import wrap
from typing import Any, NamedTuple

from vibroplat.columns import unit_of
from vibroplat.config.consistency import given_elsewhere
from vibroplat.config.kinds import KINDS
from vibroplat.config.reader import configurations, load_tree
from vibroplat.config.scene import Scene
from vibroplat.config.schema import MAX_ANGLE, MAX_SIZE, MIN_SIZE, Node, in_lists, nodes

#: Limits that only keep products of numbers finite; they are not worth a word.
_TRIVIAL = {MIN_SIZE, MAX_SIZE, -MAX_SIZE, MAX_ANGLE, -MAX_ANGLE, 2**63 - 1}
#: The section whose keys are the swept frequencies; all of them are in Hz.
_FREQUENCIES = "sweep.supply_frequency_hz"

#: Column at which comments begin, if there is room.
_COMMENTS = 44
#: Most characters of a line.
_WIDTH = 120
#: What a template leaves out unless its file gives it: other ways to give the same, and what few ever need.
_LEFT_OUT = (
    "name",
    *(f"{kind}." for kind in KINDS if kind not in ("sweep", "design")),
    "drive.program.",
    "sweep.over.",
    "run.initial.state.",
)
_HEAD = "# Lines with # are alternatives or optional keys. Typical values: screens and feeders in industry.\n"
_COMMANDS = {
    "vibroplat run {file}": "simulates it, prints the answer, writes results/{name}/run",
    "vibroplat sweep {file}": "sweeps the supply frequency or another key (section sweep)",
    "vibroplat orbits {file}": "continues periodic orbits, stable and unstable (section orbits)",
    "vibroplat plot results/{name}": "draws its results",
    "vibroplat report results/{name}": "writes its results as an HTML page",
    "vibroplat schema --markdown": "lists all keys; `vibroplat new FILE --full` writes them with their meanings",
}
#: Stand after the supply frequency, and after those of a sweep.
_OVER = "  # over: {key: contact.restitution, start: 0, stop: 0.9, count: 10}  # instead: any other key"
_PROGRAM = """\
  # program:                                # instead: the supply over time, here a start in 3 s; starts from rest
  #   - {t_s: 0, supply_frequency_hz: 0}    # also need run.initial.speed_ratio: 0
  #   - {t_s: 3, supply_frequency_hz: %s}"""


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
        None if the key is required or its meaning says what holds without it.
    typical
        Its usual range in industry; "" where that says nothing.
    allowed
        What it may be.
    meaning
        What it is.
    """

    name: str
    symbol: str
    unit: str
    default: Any
    typical: str
    allowed: str
    meaning: str


@cache
def keys() -> dict[str, Key]:
    """Return all keys of a configuration by their names, in the order of the models; sections are not among them."""
    return {name: _key(name, node) for name, node in nodes(Scene).items() if not node.is_section}


def key_of(name: str) -> Key:
    """Return a key by its dotted name, which may have numbers as places in lists; KeyError for what is none."""
    general = in_lists(name.split("."))
    return keys().get(general) or keys()[general.removesuffix(".N")]


def number_of(name: str) -> type[int] | type[float] | None:
    """Return what numbers a key has, by its dotted name; None for texts, sections and what is no key."""
    general = in_lists(name.split("."))
    node = nodes(Scene).get(general) or nodes(Scene).get(general.removesuffix(".N"))
    types = {choice.get("items", choice).get("type") for choice in node.choices} if node else set()
    return float if "number" in types else int if "integer" in types else None


def configuration_schema() -> dict[str, Any]:
    """JSON schema of a configuration file."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | Scene.model_json_schema()
    schema["title"] = "vibroplat configuration"
    schema["properties"]["extends"] = {"type": "string", "description": "file whose values this one overrides"}
    for section in (schema, *schema["$defs"].values()):
        for key in section["properties"].values():
            for choice in key.get("anyOf", [key]):
                if "patternProperties" in choice:  # names that users give
                    choice["additionalProperties"] = False
    return schema


def _key(name: str, node: Node) -> Key:
    section, _, last = name.rpartition(".")
    unit = "Hz" if section == _FREQUENCIES and last != "direction" else unit_of(last)
    allowed = " or ".join(map(_allowed, node.choices)) + ("; required" if node.required else "")
    schema = node.schema
    symbol, typical = schema.get("symbol", ""), schema.get("typical", "")
    return Key(name, symbol, unit, schema.get("default"), typical, allowed, schema["description"])


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
    """Write a plain value as in YAML; "" for None, as of a default that is not there."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.15g}"
        return text if float(text) == value else repr(value)
    if isinstance(value, list):
        return f"[{', '.join(map(yaml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {yaml(entry)}' for key, entry in value.items())}}}"
    return str(value)


def template(machine: str, file: str, name: str, *, full: bool = False) -> str:
    """Return the text of a configuration of a machine of ``configs/templates``; its head names file and scene.

    It has the keys that one sets, or with ``full`` all keys.
    """
    source = configurations() / "templates" / f"{machine}.yaml"
    given = load_tree(source)
    head = _head(file, name, given)
    text = source.read_text(encoding="utf-8").splitlines()
    about = list(takewhile(lambda line: line.startswith("#"), text))
    if not full:
        return "\n".join([*about, head, *text[len(about) :]]) + "\n"
    scene = Scene.from_tree(given)
    elsewhere = {f"machine.{key}" for key in given_elsewhere(scene)}
    lines: list[str] = [*about, _HEAD + head]
    above: list[str] = []
    values = scene.to_tree()
    for prefix, key in _in_places(given):
        if prefix in elsewhere or (prefix.startswith(_LEFT_OUT) and value_at(given, prefix) is None):
            continue
        *sections, last = prefix.split(".")
        for depth, section in enumerate(sections):
            if sections[: depth + 1] != above[: depth + 1]:
                lines.append(f"{'  ' * depth}{f'- # {int(section) + 1}' if section.isdigit() else f'{section}:'}")
        above = sections
        lines += _lines(last, "  " * len(sections), key, yaml(value_at(values, prefix)), beside="1" not in sections)
        if prefix == "drive.supply_frequency_hz":
            lines.append(_PROGRAM % yaml(value_at(values, prefix)))
        if prefix == "sweep.supply_frequency_hz.direction":
            lines.append(_OVER)
    return "\n".join(lines) + "\n"


def _in_places(given: Mapping[str, Any]) -> Iterator[tuple[str, Key]]:
    """Yield all keys with their names, those in lists for each item that a configuration has, but no absent motors."""
    for section, group in groupby(keys().values(), key=lambda key: key.name.partition(".")[0]):
        inside = list(group)
        if section not in given and section in ("motor", "motors", "exciters", "springs"):
            continue
        for index in range(len(given[section]) if isinstance(given.get(section), list) else 1):
            yield from ((key.name.replace(f"{section}.N.", f"{section}.{index}."), key) for key in inside)


def value_at(tree: Any, name: str) -> Any:
    """Return the value of a dotted name, which may have numbers as places in lists; None if there is none."""
    for part in name.split("."):
        tree = tree[int(part)] if isinstance(tree, list) else tree.get(part) if isinstance(tree, Mapping) else None
    return tree


def _head(file: str, name: str, given: Mapping[str, Any]) -> str:
    """Say what can be done with the file, by the sections that it has."""
    known = {command: does for command, does in _COMMANDS.items() if " orbits " not in command or "orbits" in given}
    rows = [(command.format(file=file, name=name), does.format(name=name)) for command, does in known.items()]
    width = max(len(command) for command, _ in rows)
    return "".join(f"#   {command:<{width}}  {does}\n" for command, does in rows)


def _lines(last: str, indent: str, key: Key, value: str, *, beside: bool) -> list[str]:
    """Write a key with its value and its meaning; one without a value is a comment, and long meanings stand above.

    Without ``beside`` the meaning stands elsewhere already.
    """
    text = f"{indent}{'' if value else '# '}{last}:{f' {value}' if value else ''}"
    if not beside:
        return [text] if value else []
    parts = (key.symbol, key.meaning)
    about = "; ".join(
        part for part in (", ".join(filter(None, parts)), key.typical and f"typical: {key.typical}") if part
    )
    line = f"{text:<{_COMMENTS - 2}}  # {about}"
    if len(line) <= _WIDTH:
        return [line]
    return [f"{indent}# {line}" for line in wrap(about, _WIDTH - len(indent) - 2)] + [text]
