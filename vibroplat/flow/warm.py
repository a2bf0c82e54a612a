"""Compiled code before it is needed."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from vibroplat.flow.motion import Motion
from vibroplat.integrate.choice import make_engine
from vibroplat.integrate.drive import drive
from vibroplat.model.parameters import parameters
from vibroplat.scene import Scene


def load_kernels(engine: str = "auto") -> None:
    """Compile or load all that a motion needs, by the engine that ``solver.engine`` names."""
    scene = Scene().replace({"material": {"mass_ratio": 0.1, "layers": 1}, "solver.engine": engine})
    p = parameters(scene)
    with closing(make_engine(scene, p)) as made:
        Motion(scene, p, made).go_on(1e-3)


def is_compiled() -> bool:
    """Whether compiled kernels are kept on disk, so that a run need not wait for them."""
    folder = drive.stats.cache_path  # type: ignore[attr-defined]
    return folder is not None and any(Path(folder).glob("drive.drive-*.nbi"))
