"""Nested plain values: YAML files, which may extend other files, settings, and how these lie over each other."""

from __future__ import annotations

import copy
import os
import re
import warnings
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning
from ruamel.yaml.nodes import MappingNode, ScalarNode

from vibroplat.config.drive import Drive
from vibroplat.config.schema import MINUS, in_lists, or_thousands, sections, short
from vibroplat.config.sections import OF_EXCITERS, OF_SPRINGS, Exciter, Initial, Material, Motor
from vibroplat.config.study_plans import PLANS
from vibroplat.config.suspension import Spring
from vibroplat.errors import ConfigError

#: Key that ``--engine`` is short for.
ENGINE = "solver.engine"

#: A configuration has about sixty keys; anything much larger is something else.
MAX_BYTES = 25_000
MAX_VALUES = 5_000
#: Path beyond which it is shortened: systems allow some thousand characters, and long ones take long.
MAX_PATH = 500
#: Beginnings of messages about a key that is not known, and about a section without keys.
_ABOUT_A_KEY = re.compile(r"unknown key (?:[\w.]+\.)?(?P<last>\w+)(?=;)|(?:[\w.]+\.)?(?P<empty>\w+) = None(?=;)")
#: What a key looks like. Messages quote keys; a file that is no configuration, such as one with passwords, has others.
KEY = re.compile(r"[^\W\d][\w .-]{0,79}")
#: A number that YAML reads as text.
DECIMAL_COMMA = re.compile(r"[-+−]?\d+,\d+")
#: A number as in YAML 1.2, of which the parser reads some as text.
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

#: The sections of studies, and those in them.
_STUDIES = [section for name, plan in PLANS.items() for section in sections(plan, name)]
#: Pairs of keys that exclude each other, by section: if an upper layer gives one, the lower layer's other is dropped.
ALTERNATIVES: dict[str, tuple[tuple[str, str], ...]] = {
    "": (("motor", "motors"),),
    "motor": Motor.alternatives,
    "motors.N": Motor.alternatives,
    "exciters.N": Exciter.alternatives,
    "springs.NAME": Spring.alternatives,
    "material": Material.alternatives,
    "drive": Drive.alternatives,
    "run.initial": Initial.alternatives,
    **{place: model.alternatives for place, model in _STUDIES if model is not None},
}

#: Sections with free keys: they are replaced as a whole, because merging could never remove a key.
REPLACED = frozenset(place for place, model in _STUDIES if model is None)

#: Quotations in messages of the parser: single characters and the parser's own words, or anything else.
_QUOTED = re.compile(r"""(["'])(?:(?P<harmless>.|\\.|<[a-z ]+>)|.*)\1""", re.DOTALL)


def load_tree(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the keys and values of a YAML file and of those it extends.

    Raises
    ------
    vibroplat.errors.ConfigError
        The file or one that it extends cannot be read.
    """
    file, label = Path(path), str(path)
    trees: dict[Path, dict[str, Any]] = {}  # by place, the uppermost first
    while True:
        text = _text(file, label)
        resolved = file.resolve()
        if resolved in trees:
            raise ConfigError(f"{file}: extends itself through {list(trees)[-1].name}")
        tree = _parse(text, str(file))
        if not isinstance(tree, dict | None):
            raise ConfigError(f"{file}: holds {_kind_of(tree)}; allowed: keys and values")
        trees[resolved] = tree or {}
        base = trees[resolved].pop("extends", None)
        if base is None:
            break
        if not isinstance(base, str) or not base:
            raise ConfigError(f"{file}: extends is not text; allowed: a file name")
        label, file = f"{file}: extends = {short(base)}", file.parent / base
        if len(str(file)) > MAX_PATH:  # as ../ makes them grow from file to file
            file = file.parent.resolve() / file.name
    upwards = reversed(trees.values())
    merged = next(upwards)
    for upper in upwards:
        merged.pop("name", None)  # a file that extends another describes another scene
        merged = merge(merged, upper)
    return merged


def load_list(path: str | os.PathLike[str]) -> list[Any]:
    """Read a YAML file that holds a list.

    Raises
    ------
    vibroplat.errors.ConfigError
        It cannot be read or holds something else.
    """
    items = _parse(_text(Path(path), str(path)), str(path))
    if not isinstance(items, list):
        raise ConfigError(f"{path}: holds {_kind_of(items)}; allowed: a list")
    return items


def _kind_of(value: Any) -> str:
    """Say what a YAML file holds that should hold something else."""
    kinds = {str: "text", list: "a list", dict: "keys and values", bool: "true or false", type(None): "nothing"}
    return kinds.get(type(value), "a number")


def configurations() -> Path:
    """Return the directory of the configurations that come with vibroplat."""
    package = Path(__file__).parents[1]
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def parse_overrides(settings: Iterable[str], engine: str | None = None) -> dict[str, Any]:
    """Parse ``key.sub=value`` into dotted keys and values, typed as in YAML.

    ``engine`` is that of ``--engine``, short for ``solver.engine=…``.

    Raises
    ------
    vibroplat.errors.ConfigError
        A setting has no ``=``, its value is not YAML, or two engines are given.
    """
    overrides: dict[str, Any] = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not equals or not all(key.strip().split(".")):
            raise ConfigError(f"--set {setting!r}; allowed: key.sub=value")
        overrides[key.strip()] = _parse(text, f"--set {key.strip()}")
    if engine is not None:
        named, given = _parse(engine, "--engine"), flat(overrides)
        if given.get(ENGINE, named) != named:
            raise ConfigError(f"--engine {engine} and --set {ENGINE}={given[ENGINE]} differ; allowed: one of the two")
        overrides[ENGINE] = named
    return overrides


def _text(file: Path, label: str) -> str:
    try:
        if not (file.is_file() or file.is_dir()) and file.exists():  # a device or a pipe may never end
            raise ConfigError(f"{label}: not a file")
        with file.open("rb") as opened:  # files in /proc report a size of 0
            content = opened.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise ConfigError(f"{label}: larger than {MAX_BYTES} bytes; not a configuration")
        return content.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except FileNotFoundError:
        raise ConfigError(f"{label}: no such file") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{label}: not UTF-8 text") from None
    except (OSError, ValueError) as error:
        raise ConfigError(f"{label}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def _parse(text: str, source: str) -> Any:
    """Load YAML without building objects; every error becomes one line."""
    return copy.deepcopy(_parse_once(text, source))


@lru_cache(maxsize=64)
def _parse_once(text: str, source: str) -> Any:
    """Parse a text once: a study builds hundreds of scenes from a few files, and parsing takes longer than a run."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReusedAnchorWarning)
            yaml = YAML(typ="safe", pure=True)
            node = yaml.compose(text)
            if _values(node, {}) > MAX_VALUES:
                raise ConfigError(f"{source}: more than {MAX_VALUES} values; not a configuration")
            _require_number(node, source)
            _require_names(node, source)
            _retag(node)
            return None if node is None else yaml.constructor.construct_document(node)
    except ConfigError:
        raise
    except DuplicateKeyError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        problem = str(error.problem).split("with value")[0].removeprefix("found ").strip()
        raise ConfigError(f"{source}: {problem} in line {line}; allowed: each key once") from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" in line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigError(f"{source}: not valid YAML{where}: {_without_quotations(error.problem)}") from None
    except RecursionError:
        raise ConfigError(f"{source}: nested too deeply") from None
    except Exception as error:  # on invalid YAML the parser may raise anything: IndexError, AssertionError …
        raise ConfigError(f"{source}: not valid YAML: {_without_quotations(error) or type(error).__name__}") from None


def _values(node: Any, known: dict[int, int]) -> int:
    """Count the values of a composed document with all aliases and merges expanded."""
    if node is None:
        return 0
    if id(node) not in known:
        known[id(node)] = MAX_VALUES + 1  # a node that contains itself never ends
        inside = [n for entry in node.value for n in (entry if isinstance(entry, tuple) else (entry,))]
        known[id(node)] = 1 + sum(_values(n, known) for n in inside if not isinstance(n, str))
    return known[id(node)]


def _require_names(node: Any, source: str) -> None:
    """Refuse decimal commas, keys that are not text, and without quoting them those that do not look like keys."""
    for entry in getattr(node, "value", ()) if not isinstance(node, ScalarNode) else ():
        key, value = entry if isinstance(node, MappingNode) else (None, entry)
        # {mass: 51,5} is read as {mass: 51, 5: }
        if key is not None and str(key.tag).endswith(":int") and not value.value:
            raise _decimal_comma(value, source)
        _require_number(value, source)
        if key is not None and not (isinstance(key, ScalarNode) and str(key.tag).endswith((":str", ":merge"))):
            raise ConfigError(f"{source}: not valid YAML: a key is not text")
        if key is not None and str(key.tag).endswith(":str") and not KEY.fullmatch(key.value):
            line = key.start_mark.line + 1
            raise ConfigError(f"{source}: the key in line {line} is no name; allowed: letters, digits and _ . -")
        _require_names(value, source)


def _retag(node: Any) -> None:
    """Read plain scalars as YAML 1.2 does: dates are text, .5e3 is a number, and so is one with the printed minus."""
    if not isinstance(node, ScalarNode):
        for entry in getattr(node, "value", ()):
            for inside in entry if isinstance(entry, tuple) else (entry,):
                _retag(inside)
        return
    tag, number = str(node.tag), node.value.replace(MINUS, "-") if node.style is None else ""
    if tag.endswith(":timestamp"):
        node.tag = tag.replace("timestamp", "str")
    elif tag.endswith(":str") and NUMBER.fullmatch(number):
        kind = "int" if number.lstrip("+-").isdigit() else "float"
        node.tag, node.value = tag.replace(":str", f":{kind}"), number


def _require_number(node: Any, source: str) -> None:
    """Refuse what looks like a number, and is none or another one: decimal commas, and underscores between digits."""
    plain = node.value if isinstance(node, ScalarNode) and node.style is None else ""
    if DECIMAL_COMMA.fullmatch(plain):
        raise _decimal_comma(node, source, plain)
    if "_" in plain and str(node.tag).endswith((":int", ":float")):
        number = plain.replace("_", "")
        raise ConfigError(f"{source}: {plain} in line {node.start_mark.line + 1}; allowed: {number}")


def _decimal_comma(node: Any, source: str, text: str = "51,5") -> ConfigError:
    meant = f"{text.replace(',', '.')}{or_thousands(text)}"
    return ConfigError(f"{source}: a decimal comma in line {node.start_mark.line + 1}; allowed: a point, as in {meant}")


def add_line(message: str, text: str) -> str:
    """Say in a message about an unknown key or an empty section the line of a text, where that can only be one."""
    match = _ABOUT_A_KEY.match(message)
    if not match:
        return message
    pattern = re.compile(rf"(?<![\w.]){re.escape(match['last'] or match['empty'])}\s*:")
    lines = [number for number, line in enumerate(text.splitlines(), start=1) if pattern.search(line.partition("#")[0])]
    return message.replace(match[0], f"{match[0]} in line {lines[0]}", 1) if len(lines) == 1 else message


def _without_quotations(problem: object) -> str:
    """Return a message of the parser without what it quotes: the file may be one that nobody should see."""
    return _QUOTED.sub(lambda match: match[0] if match["harmless"] else "…", " ".join(str(problem).split())[:200])


# -- how values lie over each other ----------------------------------------------------------------------


def merge(lower: Mapping[str, Any], upper: Mapping[str, Any], section: str = "") -> dict[str, Any]:
    """Override ``lower`` with ``upper``: merge sections key by key, replace other values and :data:`REPLACED`.

    Exciters are merged one by one, also with a lower layer that gives their numbers in ``motor`` and ``machine``, and
    springs by their names; they replace those that ``machine`` gives in a lower layer. An
    entry of any list is overridden by its place, as in ``exciters.1.critical_slip``, and all by N in its stead.

    Raises
    ------
    vibroplat.errors.ConfigError
        A list has no such place.
    """
    merged = dict(lower)
    if not section and isinstance(upper.get("motor"), Mapping) and merged.get("exciters") and not upper.get("exciters"):
        given = next(iter(upper["motor"]), "critical_slip")
        key = given if given in Exciter.model_fields else "critical_slip"
        raise ConfigError(
            f"motor.{given} is given, but each exciter has a motor of its own; allowed: exciters.N.{key}, for both"
        )
    if not section and upper.get("exciters") is not None and merged.get("exciters") is None:
        merged = _move_to_exciters(merged)
    if not section and upper.get("springs") is not None and isinstance(merged.get("machine"), Mapping):
        merged["machine"] = {key: value for key, value in merged["machine"].items() if key not in OF_SPRINGS}
    if not section and isinstance(upper.get("motors"), Mapping) and merged.get("motors") is None:
        merged["motors"] = [merged.get("motor") or {}] * 2
    for pair in ALTERNATIVES.get(in_lists(section.split(".")), ()):
        for given, other in (pair, reversed(pair)):
            if upper.get(given) is not None and upper.get(other) is None:
                merged.pop(other, None)
    for key, value in upper.items():
        below = merged.get(key)
        inner = f"{section}.{key}".strip(".")
        if isinstance(below, list) and isinstance(value, Mapping):
            merged[key] = _merge_places(below, value, inner)
        elif inner == "exciters" and isinstance(below, list) and isinstance(value, list) and len(value) == len(below):
            merged[key] = _merge_places(below, {str(index): of for index, of in enumerate(value)}, inner)
        elif isinstance(value, Mapping) and inner not in REPLACED:
            merged[key] = merge(below if isinstance(below, Mapping) else {}, value, inner)
        else:
            merged[key] = value
    return merged


def _merge_places(below: list[Any], places: Mapping[str, Any], section: str) -> list[Any]:
    """Override entries of a list by their places."""
    merged = list(below)
    for index, value in places.items():
        chosen = [number for number in range(len(below)) if index in (str(number), "N")]
        if not chosen:
            known = " to ".join(f"{section}.{number}" for number in sorted({0, len(below) - 1})) if below else "none"
            counted = f": {section}.0 is motor 1" if section in ("exciters", "motors") else ""
            raise ConfigError(f"unknown key {section}.{index}; allowed: {known}{counted}")
        for number in chosen:
            old = merged[number]
            both = isinstance(value, Mapping) and isinstance(old, Mapping)
            merged[number] = merge(old, value, f"{section}.{number}") if both else value
    return merged


def _move_to_exciters(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Move the numbers of the exciters from ``motor``, ``motors`` and ``machine`` to ``exciters``."""
    moved = {key: value for key, value in tree.items() if key not in ("motor", "motors")}
    motors = tree.get("motors") or [tree.get("motor") or {}] * 2
    machine = tree.get("machine") or {}
    if not (isinstance(machine, Mapping) and all(isinstance(motor, Mapping) for motor in motors)):
        return dict(tree)  # to be refused when the scene is built
    own = {key: machine[key] for key in OF_EXCITERS if key in machine}
    moved["exciters"] = [{**motor, **own} for motor in motors]
    if own:
        moved["machine"] = {key: value for key, value in machine.items() if key not in own}
    return moved


def nest(dotted: Mapping[str, Any]) -> dict[str, Any]:
    """Turn dotted keys into nested sections: ``{"a.b": 1}`` becomes ``{"a": {"b": 1}}``."""
    if not isinstance(dotted, Mapping):
        raise ConfigError(f"{short(dotted)} is no mapping; allowed: dotted keys and their values")
    tree: dict[str, Any] = {}
    for path, value in dotted.items():
        if not isinstance(path, str):
            raise ConfigError(f"key {path!r} is not text; allowed: key.sub")
        *sections, key = path.split(".")
        node = tree
        for name in sections:
            node = node.setdefault(name, {})
            if not isinstance(node, dict):
                raise ConfigError(f"{path} lies inside {name}, which already has a value")
        node[key] = _copied(value)
    return tree


def _copied(value: Any) -> Any:
    """Copy sections and lists, into which other keys may be written."""
    if isinstance(value, dict):
        return {key: _copied(entry) for key, entry in value.items()}
    return [_copied(entry) for entry in value] if isinstance(value, list) else value


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn nested sections into dotted keys; the inverse of :func:`nest`."""
    leaves: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            leaves |= flat(value, f"{prefix}{key}.")
        else:
            leaves[f"{prefix}{key}"] = value
    return leaves
