"""What the sections of a configuration are made of: types of values, a walk over all keys, messages about mistakes."""

from __future__ import annotations

import difflib
import math
import re
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple, Self, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from vibroplat.columns import unit_of

#: No physical quantity in SI units lies outside these limits; products of numbers inside them stay finite.
MIN_SIZE, MAX_SIZE = 1e-30, 1e30

#: Random change of the rates at the start of a run or of a sweep's point, in scaled units.
PERTURBATION = 0.01

#: Largest angle of an exciter (rad): more than the longest run turns by. Numbers there are 2e-6 apart; at 1e16 a turn
#: falls between two of them.
MAX_ANGLE = 1e10

#: What is allowed, by pydantic's types of errors.
_ALLOWED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "callable_type": "a function",
    "is_instance_of": "a {class}",
    "model_type": "a section of keys and values",
    "model_attributes_type": "a section of keys and values",
    "dict_type": "a section of keys and values",
    "finite_number": "a finite number",
    "greater_than": "more than {gt}",
    "greater_than_equal": "at least {ge}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "literal_error": "{expected}",
    "too_short": "entries, at least {min_length}",
    "too_long": "entries, at most {max_length}",
    "string_too_short": "at least {min_length} character",
    "string_too_long": "at most {max_length} characters",
}
#: Names of results, and of points of the platform, which become names of columns; what they may be.
#: Editors get a pattern of names without classes of letters, which not every validator knows: it refuses ASCII alone.
NAME, POINT_NAME = r"^[\p{L}\p{N}][\p{L}\p{M}\p{N}._+-]*$", r"^[A-Za-z][A-Za-z0-9_]{0,39}$"
_PUNCTUATION = r"\x00-*,/:-@[-^`{-\xa0"
PLAIN_NAME = rf"^[^{_PUNCTUATION}+._-][^{_PUNCTUATION}]*$"
#: Sections of a scene that hold sections with names by users, and what stands for these names.
NAMED, ANY = ("springs",), "NAME"
#: Letters that English lacks, as they are spelt there.
_SPELT = str.maketrans(
    {"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss", "ø": "o", "ł": "l"}
)
#: The minus sign of printed numbers, and the dash that word processors make of a hyphen.
MINUS, DASH = "−", "–"
#: A number as people write it, with a unit behind it; and one whose comma may separate thousands.
_WRITTEN = re.compile(
    r"\s*(?P<number>[-+−–]?\s?[\d.,\s'’_]*\d\.?(?:[eE][-+−–]?\d+)?)\s*(?P<unit>[^\W\d_].{0,11}|[%°])?\s*"
)
_THOUSANDS = re.compile(r"[-+−]?[1-9]\d{0,2},\d{3}")
_NAMES = {
    NAME: "letters, digits and . _ + -, starting with a letter or digit",
    POINT_NAME: "at most 40 letters of English, digits and _, starting with a letter",
}


def _not_minute(value: float) -> float:
    if value < MIN_SIZE:
        raise PydanticCustomError("greater_than_equal", "too small", {"ge": MIN_SIZE})
    return value


Positive = Annotated[float, Field(gt=0.0, le=MAX_SIZE, allow_inf_nan=False), AfterValidator(_not_minute)]
NonNegative = Annotated[float, Field(ge=0.0, le=MAX_SIZE, allow_inf_nan=False)]
Real = Annotated[float, Field(ge=-MAX_SIZE, le=MAX_SIZE, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-MAX_ANGLE, le=MAX_ANGLE, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]


def described(default: Any, symbol: str, meaning: str, typical: str = "") -> Any:
    """Make a field of a section: default (``...`` if it must be given), symbol in the equations, meaning.

    ``typical`` is the range of screens and feeders in industry, for keys that differ from one machine to another.
    """
    more: dict[str, Any] = {name: text for name, text in (("symbol", symbol), ("typical", typical)) if text}
    return Field(default, description=meaning, json_schema_extra=more or None)


class Section(BaseModel):
    """A section of a configuration: immutable, with strict types and no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    #: Pairs of keys that say the same and exclude each other.
    alternatives: ClassVar[tuple[tuple[str, str], ...]] = ()

    @model_validator(mode="after")
    def _one_of_each_pair(self) -> Self:
        given = self._given() if self.alternatives else set()
        for first, second in self.alternatives:
            if given >= {first, second}:
                raise ValueError(f"{first} and {second} are both given; allowed: one of the two")
        return self

    def _given(self) -> set[str]:
        fields = type(self).model_fields
        return {fields[name].alias or name for name in self.model_fields_set if getattr(self, name) is not None}

    def replaced(self) -> set[str]:
        """Return the keys whose alternatives are given: their defaults do not hold."""
        given, pairs = self._given(), self.alternatives
        return {other for pair in pairs for name, other in (pair, reversed(pair)) if name in given}

    def leave_out_replaced(self, tree: dict[str, Any]) -> None:
        """Remove keys that are replaced from the tree of this section and of those in it."""
        for name in self.replaced():
            tree.pop(name, None)
        for name, value in self:
            inner = tree.get(name)
            for section, part in zip(value, inner or (), strict=True) if isinstance(value, list) else [(value, inner)]:
                if isinstance(section, Section) and part is not None:
                    section.leave_out_replaced(part)


def sections(model: type[Section], prefix: str) -> Iterator[tuple[str, type[Section] | None]]:
    """Yield a section and those in it by dotted names, with their models; None for sections with free keys."""
    yield prefix, model
    for name, field in model.model_fields.items():
        for choice in (field.annotation, *get_args(field.annotation)):
            if get_origin(choice) is dict:
                yield f"{prefix}.{name}", None
            elif isinstance(choice, type) and issubclass(choice, Section):
                yield from sections(choice, f"{prefix}.{name}")


class Node(NamedTuple):
    """A key of a section, or a section in it.

    Attributes
    ----------
    schema
        Its JSON schema.
    choices
        JSON schemas of its alternatives other than null.
    required
        Whether it must be given.
    is_section
        Whether it has keys of its own, or is a list of such sections.
    """

    schema: Mapping[str, Any]
    choices: Sequence[Mapping[str, Any]]
    required: bool
    is_section: bool


@cache
def nodes(model: type[BaseModel]) -> dict[str, Node]:
    """Return all keys and sections of a model by their dotted names, each section before its keys.

    ``N`` in a name is a place in a list, as in ``motors.N.pole_pairs``, and ``NAME`` one that users give. All that is
    said of keys comes from here: the messages about mistakes, the list of keys, the template and the pages.
    """
    schema = model.model_json_schema()
    return dict(_walk(schema, schema.get("$defs", {}), ""))


def _walk(section: Mapping[str, Any], sections: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Node]]:
    for name, schema in section["properties"].items():
        choices = [choice for choice in schema.get("anyOf", [schema]) if choice.get("type") != "null"]
        named: Mapping[str, Any] = next(iter(choices[0].get("patternProperties", {}).values()), {})
        inside = choices[0].get("$ref") or choices[0].get("items", {}).get("$ref") or named.get("$ref")
        yield f"{prefix}{name}", Node(schema, choices, name in section.get("required", ()), inside is not None)
        if inside:
            item = "N." if "items" in choices[0] else f"{ANY}." if named else ""
            yield from _walk(sections[inside.rpartition("/")[2]], sections, f"{prefix}{name}.{item}")


def in_lists(path: Sequence[str]) -> str:
    """Join the parts of a dotted name, with ``N`` for each place in a list and ``NAME`` for a name by a user."""
    own = 1 if path and path[0] in NAMED else None
    return ".".join(ANY if i == own else "N" if part.isdigit() else part for i, part in enumerate(path))


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """Say in one line which key is wrong, what was given and what is allowed.

    Only one error is described; the number of further errors is appended.
    """
    first, *more = error.errors()
    path = [str(part) for part in first["loc"]]
    key = ".".join(path) or model.__name__.lower()
    if first["type"] == "extra_forbidden":
        *section, wrong = path
        names = [name.rpartition(".") for name in (nodes(model) if issubclass(model, Section) else model.model_fields)]
        known = [last for above, _, last in names if above == in_lists(section)]
        elsewhere = [".".join((above, last)) for above, _, last in names if last == wrong]  # its section is missing
        hint = f"did you mean {elsewhere[0]}? " if elsewhere else did_you_mean(wrong, known)
        line = f"unknown key {key}; {hint}allowed: {', '.join(known)}"
    elif first["type"] == "value_error":
        line = f"{key}: {first['ctx']['error']}" if path else str(first["ctx"]["error"])
    elif first["type"] == "missing":
        line = f"{key} is missing; allowed: a value"
    else:
        line = f"{key} = {short(first['input'])}; allowed: {_allowed(first)}"
    return f"{line} (and {len(more)} more)" if more else line


def _allowed(error: ErrorDetails) -> str:
    """Say what is allowed instead of a value, and what was probably meant."""
    given, limits = error["input"], error.get("ctx", {})
    if error["type"] == "string_pattern_mismatch":
        like = _name_like(given, limits["pattern"])
        example = f"name: {like}" if limits["pattern"] == NAME else like
        return f"{_NAMES[limits['pattern']]}{like and f', as {example}'}"
    is_fraction = error["loc"][:2] == ("design", "parameter_tolerances")
    if error["type"] in ("float_type", "int_type"):
        names = [] if is_fraction else [part for part in error["loc"] if isinstance(part, str)]
        return number_instead(given, names, _ALLOWED[error["type"]])
    if error["type"] == "string_type" and isinstance(given, int | float):
        return f'text, as "{short(given)}" in quotation marks'
    template = _ALLOWED.get(error["type"])
    allowed = template.format(**limits) if template else error["msg"]
    is_percentage = is_fraction and isinstance(given, float | int) and 1.0 < given <= 100.0
    return f"{allowed}; {given:g} % is {given / 100.0:g}" if is_percentage else allowed


def _name_like(given: str, pattern: str) -> str:
    """Return a name like a refused one that is allowed; "" if it would have no letter."""
    if pattern == NAME:
        return re.sub(r"[^\w.+-]+", "-", given).strip("-_.+")
    spelt = unicodedata.normalize("NFKD", given.translate(_SPELT))
    plain = "".join(letter for letter in spelt if not unicodedata.combining(letter))
    return re.sub(r"[^A-Za-z0-9]+", "_", plain).lstrip("_0123456789")[:40].rstrip("_")


def number_instead(given: Any, names: Sequence[str], kind: str = "a number") -> str:
    """Say which number is allowed instead of a text, of which kind, and in the unit that the last of some names has."""
    match = _WRITTEN.fullmatch(given) if isinstance(given, str) else None
    number, unit = (_plain_number(match["number"]), match["unit"] or "") if match else ("", "")
    own = next(filter(None, map(unit_of, reversed(names))), "")
    if not number or (kind == _ALLOWED["int_type"] and not float(number).is_integer()):
        return kind
    if unit == "%" and not own:
        return f"{kind}, as {float(number) / 100.0:g}"
    if unit and own and _same_letters(unit) != _same_letters(own):
        return f"{kind} in {own}, not in {unit}"
    text = f"{number}{or_thousands(match['number'].strip())}" if match else number
    if not unit:
        return f"{kind}, as {text}"
    return f"{kind} without its unit, as {text}" + (f"; that of the key is {own}" if own else "")


def _same_letters(unit: str) -> str:
    """Return a unit without signs of products and powers, superscripts as digits: N·m, Nm and N m are the same."""
    return re.sub(r"[\W_]", "", unicodedata.normalize("NFKC", unit)).casefold()


def _plain_number(text: str) -> str:
    """Return a number as Python reads it: without another minus, decimal comma or separators; "" if it is none."""
    text = re.sub(r"[\s'’_]", "", text.replace(MINUS, "-").replace(DASH, "-"))
    if text.count(",") == 1 and text.rfind(".") < text.find(","):
        text = text.replace(".", "").replace(",", ".")
    text = text.replace(",", "")
    try:
        return text if math.isfinite(float(text)) else ""
    except ValueError:
        return ""


def or_thousands(text: str) -> str:
    """Say what a number is without a separator of thousands, if its comma may be one; "" otherwise."""
    whole = text.replace(",", "")
    return f", or {whole} without a separator of thousands" if _THOUSANDS.fullmatch(text) else ""


def did_you_mean(wrong: str, known: Collection[str], most: int = 1) -> str:
    """Ask whether a known name was meant that looks much like a wrong one, or one of several; "" if there is none."""
    near = difflib.get_close_matches(wrong, known, n=most, cutoff=0.5)
    return f"did you mean {' or '.join(near)}? " if near else ""


def short(value: Any) -> str:
    """Format a value for a one-line message."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python refuses to print integers of more than 4300 digits
        text = "a number with thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."
