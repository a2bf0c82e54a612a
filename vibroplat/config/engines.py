"""The engines, said once: keys of ``solver.engine``, what makes each, and the kernel that calls most of its others."""

from __future__ import annotations

from importlib import import_module
from typing import Any, NamedTuple


class EngineKind(NamedTuple):
    """An engine.

    Attributes
    ----------
    make
        Function of scene and parameters, below the package.
    loop
        Its compiled loop; "" for none.
    is_sundials
        Whether SUNDIALS integrates: its least tolerance holds then, and an engine of another kind checks it.
    """

    make: str
    loop: str = ""
    is_sundials: bool = False

    @property
    def factory(self) -> Any:
        """The function that makes it; its module compiles or loads kernels when it is imported."""
        place, _, name = self.make.rpartition(".")
        return getattr(import_module(f"vibroplat.{place}"), name)


ENGINES = {
    "native": EngineKind("integrate.native.make_native", "integrate.ida.run_loop", is_sundials=True),
    "sundae": EngineKind("integrate.sundae.make_sundae", is_sundials=True),
    "taylor": EngineKind("integrate.taylor.TaylorEngine", "integrate.taylor.carry"),
}


def loop_of(engine: str) -> str:
    """Return the compiled loop of an engine, or that of ``native``."""
    return ENGINES[engine].loop or ENGINES["native"].loop


def uses_sundials(engine: str) -> bool:
    """Whether a value of ``solver.engine`` asks for SUNDIALS, as ``auto`` does."""
    return engine == "auto" or ENGINES[engine].is_sundials
