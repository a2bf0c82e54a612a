"""What a worker process loads before its first task."""

from __future__ import annotations

from importlib import import_module


def load_study(study: str, engine: str) -> None:
    """Load the module of a study, and an engine's kernels where they are compiled already."""
    import_module(f"vibroplat.{study}")
    from vibroplat.kernels import cache  # noqa: PLC0415  (these take long)
    from vibroplat.motion import run  # noqa: PLC0415

    if cache.is_compiled(engine):
        run.load_kernels(engine)
