"""Integrators behind one interface, :mod:`~vibroplat.integrate.interface`.

Which of them computes a scene is decided in :mod:`~vibroplat.config.engine_choice`.
``native`` drives IDA from compiled code, ``sundae`` through scikit-sundae; both use
:mod:`~vibroplat.integrate.multistep`. ``taylor`` is the Taylor series of the model.
"""

from __future__ import annotations

import logging
from functools import cache
from typing import TYPE_CHECKING

from vibroplat.config.engine_choice import chosen_engine
from vibroplat.config.engines import ENGINES, loop_of
from vibroplat.hybrid.loop import automaton
from vibroplat.hybrid.state import MARGIN, empty_steps
from vibroplat.integrate.sundials import Library, UnavailableError, library
from vibroplat.system import memory
from vibroplat.system.forks import lock

if TYPE_CHECKING:
    from vibroplat.config.scene import Scene
    from vibroplat.integrate.group import Group
    from vibroplat.integrate.interface import Engine
    from vibroplat.model.parameters import Parameters

# Each engine's module is imported where it is asked for: its kernels are compiled or loaded then.

_FINDING = lock()
_LOG = logging.getLogger("vibroplat")


def make_engine(scene: Scene, p: Parameters, name: str = "") -> Engine:
    """Make the engine of a name, or that for studies of a scene; ``sundae`` where ``native`` cannot be had.

    The first one whose kernels must be compiled says so, as that takes long.
    """
    name = name or chosen_engine(scene)
    announce_compilation(name)
    engine: Engine = ENGINES[_available(name)].factory(scene, p)
    return engine


def group_for(engine: Engine, scene: Scene, p: Parameters, width: int) -> Group | None:
    """Make room for so many motions of a scene side by side; None with an engine that carries one alone."""
    side_by_side = getattr(engine, "side_by_side", None)
    if side_by_side is None:
        return None
    rows = MARGIN + 2  # those of the last step of a segment
    one = automaton(scene, p, empty_steps(rows, engine.degree), engine.turns_per_segment, event_rows=rows)
    group: Group = side_by_side([one] * width)
    return group


@cache
def announce_compilation(engine: str) -> bool:
    """Return whether an engine's kernels must be compiled; say so in a line, once, as that takes long.

    Raises
    ------
    MemoryShortError
        There is too little memory for that.
    """
    from vibroplat.kernels.cache import is_compiled, notice  # noqa: PLC0415

    must = not is_compiled(loop_of(engine))
    if must:
        memory.require_memory(memory.MIN_COMPILING_ADDRESS_SPACE, "compiling the kernels for the first time")
        why = notice() or "this happens once for each engine and takes about half a minute"
        _LOG.warning("compiling the numerical kernels; %s", why)
    return must


def engine_name(scene: Scene, *, run: bool = False) -> str:
    """Name the engine that computes a ``run`` of a scene, or else its studies, orbits and derivatives."""
    return _available(chosen_engine(scene, run=run))


def _available(name: str) -> str:
    """Return the name of an engine, or ``sundae`` for ``native`` where that cannot be had."""
    if name != "native":
        return name
    with _FINDING:
        return "sundae" if native_library() is None else "native"


@cache
def native_library() -> Library | None:
    """Open and check the library of engine ``native``, once; None, with a notice, where it is not as expected."""
    from vibroplat.integrate.native import self_check  # noqa: PLC0415

    try:
        opened = library()
        self_check(opened)
    except (UnavailableError, MemoryError) as reason:
        _LOG.warning(
            "engine native is not available: %s; engine sundae is used instead and is ten to twenty times slower",
            reason,
        )
        return None
    return opened
