"""Arguments of public functions are validated like the keys of a configuration."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Annotated, Any, LiteralString, ParamSpec, TypeVar

import numpy as np
from pydantic import AfterValidator, ConfigDict, ValidationError, create_model
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

    Further keyword arguments, as ``options``, must be among the types.
    """
    fields: dict[str, Any] = {name: (kind, None) for name, kind in types.items()}
    model = create_model("Arguments", __config__=_STRICT, **fields)

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> T:
            bound = signature.bind(*args, **kwargs)
            options = bound.arguments.get("options", {})
            given = {name: value for name, value in bound.arguments.items() if name in types} | options
            plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in given.items()}
            try:
                values = vars(model.model_validate(plain))
            except ValidationError as error:
                raise ConfigError(explain(error, model)) from None
            for part in (bound.arguments, options):
                part.update({name: values[name] for name in part if name in given})
            return function(*bound.args, **bound.kwargs)

        return checked

    return decorate
