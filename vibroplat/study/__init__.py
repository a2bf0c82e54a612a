"""Studies of many motions.

* A sweep (:mod:`~vibroplat.study.sweep`) has branches of points; a point settles, is measured and classified.
* Any study simulates by chains of tasks, which run in a :mod:`~vibroplat.study.pool` and keep their results in a
  :mod:`~vibroplat.study.store`.
"""

from importlib import import_module

from vibroplat.config.engines import loop_of


def load_study(study: str, engine: str) -> None:
    """Load the module of a study, and an engine's kernels where they are compiled already: in a worker, at first."""
    import_module(f"vibroplat.{study}")
    from vibroplat.kernels import cache  # noqa: PLC0415  (these take long)
    from vibroplat.motion import run  # noqa: PLC0415

    if cache.is_compiled(loop_of(engine)):
        run.load_kernels(engine)
