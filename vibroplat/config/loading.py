"""A scene from a configuration file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibroplat.config.arguments import FileName, validated
from vibroplat.config.reader import add_line, load_tree, merge, nest
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError


@validated(path=FileName)
def load_config(path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
    """Read a scene from a YAML 1.2 file.

    Parameters
    ----------
    path
        The file. Its ``extends`` may name another file, relative to this one, whose values it overrides.
    overrides
        Dotted keys and values that override those of the file, as given by ``--set``.

    Raises
    ------
    vibroplat.errors.ConfigError
        One line with the file, the key, the value and what is allowed.
    """
    file = Path(path)
    lower = load_tree(file)
    try:
        return Scene.from_tree({"name": file.stem} | merge(lower, nest(overrides or {})), overrides or ())
    except ConfigError as error:
        message = add_line(str(error), file.read_text(encoding="utf-8"))
        raise ConfigError(f"{file}: {message}") from None
