"""What several commands do before they begin: load the kernels, look for a scheduler."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vibroplat.errors import ConfigError
from vibroplat.system.preflight import COMPILING, require_memory


@contextmanager
def about(config: Path) -> Iterator[None]:
    """Let errors of a configuration name its file, where they are found only after it was read."""
    try:
        yield
    except ConfigError as error:
        raise ConfigError(f"{config}: {error}") from None


def tell_of_compilation(engine: str | None = None) -> None:
    """Say why the first run on a machine takes long; some kernels are compiled as soon as they are imported."""
    import vibroplat.kernels.compiled  # noqa: F401  (refuses where compilation is switched off)
    from vibroplat.kernels.cache import is_compiled, notice

    if not is_compiled(engine or "auto"):
        told = notice() or "this happens once for each engine and takes about half a minute"
        require_memory(COMPILING, "compiling the kernels for the first time")
        print(f"vibroplat: compiling the numerical kernels; {told}", file=sys.stderr)


def load_kernels(*engines: str) -> None:
    """Compile or load what a motion needs by these engines, once, before workers would each do so."""
    from vibroplat.motion import run

    for engine in engines or ("auto",):
        run.load_kernels(engine)
    gc.freeze()  # what is loaded stays: the garbage collector need not look at it


def require_scheduler(address: str | None) -> None:
    """Refuse an address without a scheduler before the kernels are loaded, which may take long."""
    if address is not None:
        from vibroplat.study import cluster

        cluster.require_scheduler(address)
