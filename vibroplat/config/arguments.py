"""Arguments of public functions are validated like the keys of a configuration."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import Annotated, Any, LiteralString, ParamSpec, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, create_model
from pydantic_core import PydanticCustomError

from vibroplat.config.schema import explain
from vibroplat.errors import ConfigError

P = ParamSpec("P")
T = TypeVar("T")


def instance_of(kind: Any, allowed: LiteralString) -> Any:
    """Return the type of an argument that must be an instance of a class; ``allowed`` says so."""

    def check(value: Any) -> Any:
        if not isinstance(value, kind):
            raise PydanticCustomError("instance", allowed)
        return value

    return Annotated[Any, AfterValidator(check)]


def _keys(value: Any) -> Any:
    listed = [value] if isinstance(value, str) else value
    if not isinstance(listed, Sequence) or not all(isinstance(key, str) for key in listed):
        raise PydanticCustomError("keys", "dotted keys, as drive.supply_frequency_hz")
    return value


def _true_or_keys(value: Any) -> Any:
    return value if isinstance(value, bool) else _keys(value)


#: A file or directory; dotted keys; dotted keys or whether there are any.
FileName = instance_of((str, os.PathLike), "the name of a file or directory")
Keys = Annotated[Any, AfterValidator(_keys)]
TrueOrKeys = Annotated[Any, AfterValidator(_true_or_keys)]

_STRICT = ConfigDict(strict=True, extra="forbid", arbitrary_types_allowed=True)


def validated(**types: Any) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator: these arguments of a function have these types, or :class:`ConfigError` says so in a line.

    A variadic argument, as ``options``, has fields of its own: a mapping of names to types.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)
        single = {key: of for key, of in types.items() if not isinstance(of, Mapping)}
        models = {"": _model(single)} | {key: _model(of) for key, of in types.items() if isinstance(of, Mapping)}

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> T:
            given = signature.bind(*args, **kwargs).arguments
            for key, model in models.items():
                part = given.get(key, {}) if key else {one: given[one] for one in single if one in given}
                given.get(key, given).update(_values(model, part))
            bound = inspect.BoundArguments(signature, given)
            return function(*bound.args, **bound.kwargs)

        return checked

    return decorate


def _model(types: Mapping[str, Any]) -> type[BaseModel]:
    """Return a model in which each argument may be left out."""
    fields: dict[str, Any] = {name: (kind, None) for name, kind in types.items()}
    return create_model("Arguments", __config__=_STRICT, **fields)


def _values(model: type[BaseModel], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments as their model has them; raises ConfigError."""
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in given.items()}
    try:
        values = model.model_validate(plain)
    except ValidationError as error:
        raise ConfigError(explain(error, model)) from None
    return {name: getattr(values, name) for name in given}
