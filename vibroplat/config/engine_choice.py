"""Which engine computes a scene: ``solver.engine`` = ``auto`` is decided here alone, for each purpose.

A run is integrated by IDA (``native``), as the model is posed. Studies of many motions, orbits and derivatives take the
Taylor series of the same DAE (``taylor``), unless the scene is stiff. Where one engine fails, ``auto`` tries the other.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from vibroplat.config.engines import uses_sundials
from vibroplat.config.scene import Scene

T = TypeVar("T")

#: Decay rate of a coordinate taken alone, over the synchronous speed, above which a scene is stiff. Of 400 random runs
#: with extreme springs and dampers (20 turns) 8 fail with engine ``taylor`` and 22 with ``native``. With this choice 1
#: fails; it takes 30 s, ``taylor`` alone 50 s, ``native`` alone 46 s. Twice or half as much changes little.
STIFF = 500.0
#: Outcomes for which an engine is to blame.
FAILED = frozenset({"solver-failure", "non-finite", "inaccurate"})
#: What the engines are.
METHODS = {
    "native": "SUNDIALS IDA",
    "sundae": "SUNDIALS IDA through Python",
    "taylor": "Taylor series of the DAE",
}


def is_stiff(scene: Scene) -> bool:
    """Return whether something in a scene decays so fast that an implicit engine is faster."""
    return scene.fastest_decay > STIFF * scene.speed_scale


def chosen_engine(scene: Scene, *, run: bool = False) -> str:
    """Name the engine for a ``run`` of a scene, or else for its studies, orbits and derivatives.

    It is ``native`` also where its library cannot be used; :func:`vibroplat.integrate.engine_name` finds that out.
    """
    asked: str = scene.solver.engine
    if asked != "auto":
        return asked
    return "native" if run or is_stiff(scene) else "taylor"


def engine_of_studies(asked: str | None) -> str:
    """Name the engine that studies most likely need, before their scene is known."""
    return "taylor" if asked in (None, "auto") else asked


def other_engine(name: str) -> str:
    """Name the engine that checks another, or takes its place: that which shares least with it.

    Engines ``native`` and ``sundae`` are two ways to SUNDIALS, so ``taylor`` checks both, and SUNDIALS checks it.
    """
    return "taylor" if uses_sundials(name) else "native"


def engines_to_try(scene: Scene, *, run: bool = False) -> list[str]:
    """Name the engines that compute a scene, the second one where the first one fails: both if the key is ``auto``."""
    first = chosen_engine(scene, run=run)
    return [first, other_engine(first)] if scene.solver.engine == "auto" else [first]


def with_second_engine(
    scene: Scene,
    compute: Callable[[Scene], T],
    failed: Callable[[T], bool] = lambda result: False,
    errors: tuple[type[Exception], ...] = (),
    reason: Callable[[T], tuple[dict[str, Any], str]] | None = None,
) -> T:
    """Compute something of a scene; where that fails and the key is ``auto``, compute it by the other engine.

    Parameters
    ----------
    scene, compute
        The scene, and what is computed of it: no run, which :func:`vibroplat.simulate` computes.
    failed, errors
        Whether a result is a failure, and exceptions that are failures. If both engines fail, the failure is that of
        the first one, with both reasons.
    reason
        The row of a result, and its column with the reason of a failure.
    """
    if scene.solver.engine != "auto":
        return compute(scene)
    second = scene.replace({"solver.engine": engines_to_try(scene)[-1]})
    try:
        result = compute(scene)
    except errors as error:
        try:
            return compute(second)
        except errors as other:
            raise type(error)(both_reasons(engines_to_try(scene), str(error), str(other))) from None
    if not failed(result):
        return result
    again = compute(second)
    if not failed(again):
        return again
    if reason is not None:
        row, column = reason(result)
        row[column] = both_reasons(engines_to_try(scene), row[column], reason(again)[0][column])
    return result


def both_reasons(engines: Sequence[str], first: str, second: str) -> str:
    """Say why two engines have failed, the first one without the state at which it did.

    They have one reason if they differ in numbers alone.
    """
    one, other = (re.sub(r"[-\d.e]+", "", text.partition(", state [")[0]) for text in (first, second))
    if one == other:
        return f"engines {' and '.join(engines)}: {first}"
    return f"engine {engines[0]}: {first.partition(', state [')[0]}; engine {engines[1]}: {second}"


#: How the note on the engine begins.
COMPUTED_BY = "computed by engine "


def engine_note(name: str) -> str:
    """Return the note of an answer on the engine that computed it, its first one."""
    method = METHODS.get(name, "an own one")
    return f"{COMPUTED_BY}{name} ({method}); --check compares it with {other_engine(name)}"


def may_succeed(scene: Scene) -> str:
    """Return the clause on the engine that may succeed where that of a scene failed; "" if ``auto`` tries it anyway."""
    engine = scene.solver.engine
    return "" if engine == "auto" else f"; solver.engine = {other_engine(engine)} may succeed"
