"""Consistency of the sections of a scene with each other."""

from __future__ import annotations

import math
from typing import Any

from vibroplat.config.coordinates import ALONG, COORDINATES, RATES
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.sections import OF_EXCITERS, OF_SPRINGS

#: Most turns at the synchronous speed that a run may take: half a day of computing.
MAX_TURNS = 1e9
#: The same with engine ``sundae``, which is ten to twenty times slower.
MAX_TURNS_SUNDAE = 5e7


def require_consistent(scene: Any) -> None:
    """Refuse a scene whose sections do not go together (ValueError)."""
    _require_once(scene)
    _require_held(scene)
    _require_transportable(scene)
    _require_bounded(scene)
    _require_possible_state(scene)


def given_by_exciters(scene: Any) -> set[str]:
    """Return the keys of the machine that the exciters give instead, each for itself."""
    exciters = scene.exciters or ()
    keys = set(OF_EXCITERS) if exciters else set()
    if exciters and all(exciter.unbalance_mass_kg for exciter in exciters):
        keys.add("unbalance_mass_kg")
    if exciters and all(exciter.position_m for exciter in exciters):
        keys |= {"exciter_distance_m", "exciter_angle_deg"}
    return keys


def given_elsewhere(scene: Any) -> set[str]:
    """Return the keys of the machine that exciters or springs give instead."""
    return given_by_exciters(scene) | set(OF_SPRINGS if scene.springs is not None else ())


def _require_once(scene: Any) -> None:
    """Refuse numbers of exciters and springs that are given in two ways."""
    for section, names in {"exciters": OF_EXCITERS, "springs": OF_SPRINGS}.items():
        for name in names if getattr(scene, section) is not None else ():
            if name in scene.machine.model_fields_set:
                raise ValueError(f"{section} and machine.{name} are both given; allowed: one of the two")
    if scene.springs is not None and scene.output.springs:
        raise ValueError("springs and output.springs are both given; allowed: springs, whose forces are reported")


def _require_held(scene: Any) -> None:
    """Refuse springs on which the machine tips over: along y and in rotation they must hold it."""
    if scene.springs is None or scene.suspension.holds:
        return
    off = [f"springs.{name}.off" for name, spring in scene.springs.items() if spring.off]
    without = f" with {' and '.join(off)}" if off else ""
    raise ValueError(
        f"springs: the machine tips over{without}; allowed: springs at two places or more that differ in x, or all of "
        "them at the common centre of mass"
    )


def _require_transportable(scene: Any) -> None:
    """Refuse what does not go with transport."""
    if scene.transport is None:
        return
    wrong = {
        "material.mass_ratio": (scene.mass_ratio, scene.material.is_there, "more than 0"),
        "contact.model": (scene.contact.model, scene.contact.model == "impact", "impact"),
        "contact.impact_law": (
            *(scene.contact.impact_law, scene.contact.impact_law == "conservative"),
            "conservative",
        ),
    }
    for key, (value, fits, allowed) in wrong.items():
        if not fits:
            raise ValueError(f"{key} = {value} does not go with transport; allowed: {allowed}")
    steepest = math.degrees(math.atan(scene.transport.largest_friction))
    if abs(scene.transport.deck_angle_deg) > steepest:
        raise ValueError(
            f"transport.deck_angle_deg = {scene.transport.deck_angle_deg:g}: the material slides off a deck at "
            f"rest; allowed with this friction: up to {steepest:.4g}"
        )


def _require_bounded(scene: Any) -> None:
    """Refuse durations that no computer would ever finish."""
    durations = [("run.duration_s", scene.run.duration_s, scene.drive.largest_frequency)]
    if scene.sweep is not None:
        stop = max(scene.sweep.swept.ends) if scene.sweep.swept.key == FREQUENCY else scene.drive.largest_frequency
        times = {f"sweep.{key}": getattr(scene.sweep, key) for key in ("max_settle_s", "measure_s")}
        durations += [(key, seconds, stop) for key, seconds in times.items()]
    if scene.find is not None:
        times = {f"find.{key}": 2.0 * getattr(scene.find, key) for key in ("max_settle_s", "measure_s")}
        durations += [(key, seconds, scene.drive.largest_frequency) for key, seconds in times.items()]
    slow = scene.solver.engine == "sundae"
    most = MAX_TURNS_SUNDAE if slow else MAX_TURNS
    for key, seconds, supply in durations:
        turns = seconds * supply / min(exciter.pole_pairs for exciter in scene.exciter_pair)
        if turns > most:
            raise ValueError(
                f"{key} = {seconds} takes {turns:.3g} turns at the synchronous speed; "
                f"allowed{' with engine sundae' if slow else ''}: at most {most:.0e}"
            )


def _require_possible_state(scene: Any) -> None:
    """Refuse a state that the scene does not have."""
    state = scene.run.initial.state
    if state is None:
        return
    for index in range(len(scene.coordinates), len(COORDINATES)):
        for key in (COORDINATES[index], RATES[index]):
            if getattr(state, key):
                raise ValueError(
                    f"run.initial.state.{key} = {getattr(state, key)} but this scene has no such coordinate; "
                    "allowed: leave it out"
                )
    for key in ALONG if scene.transport is None else ():
        if getattr(state, key):
            raise ValueError(f"run.initial.state.{key} is given without transport; allowed: leave it out")
    if not state.gap_m and state.gap_rate_m_per_s < 0.0:
        raise ValueError(
            f"run.initial.state.gap_rate_m_per_s = {state.gap_rate_m_per_s} closes a gap that is 0; "
            "allowed: at least 0 while gap_m is 0"
        )
