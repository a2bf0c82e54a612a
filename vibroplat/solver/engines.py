"""Which engine runs a scene."""

from __future__ import annotations

import os

from vibroplat.physics.parameters import FloatArray
from vibroplat.physics.systems import systems
from vibroplat.scene import Mode, Scene
from vibroplat.solver.engine import Engine


def make_engine(scene: Scene, p: FloatArray) -> Engine:
    """Make the engine that ``solver.engine`` asks for."""
    if os.environ.get("ENG") == "native":
        from vibroplat.solver.native import NativeEngine
        from vibroplat.solver.sundials import library
        adams = frozenset(Mode(int(c)) for c in os.environ.get("ADAMS", ""))
        return NativeEngine(p, systems(scene), adams & set(scene.modes), library())
    from vibroplat.solver.sundae import SundaeEngine  # noqa: PLC0415  (loads SUNDIALS)

    return SundaeEngine(p)
