"""Compiled code before it is needed."""

from __future__ import annotations

from contextlib import closing

from vibroplat.config.scene import Scene
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Motion


def load_kernels(engine: str = "auto") -> None:
    """Compile or load all that a motion needs, by the engine that ``solver.engine`` names."""
    scene = Scene().replace({"material": {"mass_ratio": 0.1, "layers": 1}, "solver.engine": engine})
    p = parameters(scene)
    with closing(make_engine(scene, p)) as made:
        Motion(scene, p, made).advance(1e-3)
