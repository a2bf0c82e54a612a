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

#: Keys without which a machine of one's own would be a test rig of 12 kg; the section ``springs`` has those of springs.
_OWN = ("platform_mass_kg", "platform_inertia_kg_m2")
_SPRINGS = ("stiffness_x_n_per_m", "stiffness_y_n_per_m", "stiffness_phi_n_m_per_rad")
#: Ways to give the static moment of an exciter.
_MOMENTS = (("static_moment_kg_m",), ("unbalance_mass_kg", "unbalance_radius_m"))


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
        tree = merge(lower, nest(overrides or {}))
        scene = Scene.from_tree({"name": file.stem} | tree, overrides or ())
    except ConfigError as error:
        message = str(error)
        if not any(message.startswith(key) for key in overrides or ()):  # which no line of the file has
            message = add_line(message, file.read_text(encoding="utf-8"))
        raise ConfigError(f"{file}: {message}") from None
    _require_whole_machine(file, lower, tree)
    return scene


def _require_whole_machine(file: Path, own: Mapping[str, Any], tree: Mapping[str, Any]) -> None:
    """Refuse a file with motors, exciters or a mass of its own that leaves other numbers of its machine to defaults."""
    begun = [name for name in ("exciters", "motors") if own.get(name)]
    begun += ["machine.platform_mass_kg"] if "platform_mass_kg" in (own.get("machine") or {}) else []
    known = {key for key, value in (tree.get("machine") or {}).items() if value is not None}
    missing = [f"machine.{key}" for key in (*_OWN, *(() if tree.get("springs") else _SPRINGS)) if key not in known]
    exciters = tree.get("exciters")
    for number, exciter in enumerate(exciters or ({},)):
        if not any(known | {*exciter} >= {*way} for way in _MOMENTS):
            missing.append(f"exciters.{number}.static_moment_kg_m" if exciters else "machine.unbalance_mass_kg")
    if begun and missing:
        raise ConfigError(
            f"{file}: {begun[0]} is given without {', '.join(missing)}; allowed: all of a machine of one's own, or "
            "extends with the file of one"
        )
