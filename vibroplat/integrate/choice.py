"""Which engine runs a scene."""

from __future__ import annotations

import logging
import threading
from contextlib import closing
from functools import cache

from vibroplat.config.scene import Scene
from vibroplat.integrate.seam import Engine
from vibroplat.integrate.sundials import Library, UnavailableError, library
from vibroplat.model.parameters import Parameters, parameters

# Each engine's module is imported where it is asked for: its kernels are compiled or loaded then.

_FINDING = threading.Lock()
_LOG = logging.getLogger("vibroplat")


def make_engine(scene: Scene, p: Parameters) -> Engine:
    """Make the engine that ``solver.engine`` asks for, or ``sundae`` where ``native`` cannot be had."""
    if scene.solver.engine == "taylor":
        from vibroplat.integrate.taylor import TaylorEngine  # noqa: PLC0415

        return TaylorEngine(scene, p)
    found = None
    if scene.solver.engine != "sundae":
        with _FINDING:
            found = native_library()
    if found is not None:
        from vibroplat.integrate.native import NativeEngine  # noqa: PLC0415

        return NativeEngine(scene, p, found)
    from vibroplat.integrate.sundae import SundaeEngine  # noqa: PLC0415

    return SundaeEngine(p)


@cache
def native_library() -> Library | None:
    """Open and check the library of engine ``native``, once; None, with a notice, where it is not as expected."""
    from vibroplat.integrate.native import self_check  # noqa: PLC0415

    try:
        found = library()
        self_check(found)
    except (UnavailableError, MemoryError) as reason:
        _LOG.warning("engine native is not available: %s; engine sundae takes over, ten to twenty times slower", reason)
        return None
    return found


def engine_name(scene: Scene) -> str:
    """Name the engine that runs a scene."""
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        return engine.name


def other_engine(name: str) -> str:
    """Name the engine that checks another: that which shares least with it.

    Engines ``native`` and ``sundae`` are two ways to SUNDIALS, so ``taylor`` checks both, and SUNDIALS checks it.
    """
    return "auto" if name == "taylor" else "taylor"
