"""Keys that a scene, a study or a command does not read, and why: one that is set and has no effect may be a slip."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pydantic import BaseModel

from vibroplat.config.digits import given
from vibroplat.config.kinds import KINDS, unused_sections
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.reader import ALTERNATIVES
from vibroplat.config.scene import Scene
from vibroplat.config.schema import in_lists
from vibroplat.config.sections import Contact, Material, Transport

#: Sections that count with material alone, and keys that count with two layers alone.
_OF_MATERIAL: dict[str, type[BaseModel]] = {"material": Material, "contact": Contact, "transport": Transport}
_OF_TWO_LAYERS = ("lower_share", "natural_frequency_hz", "stiffness_n_per_m", "damping_ratio", "damping_n_s_per_m")

#: Keys that count in motions alone, of which an inspection has none.
_OF_MOTIONS = ("run.seed", "run.perturbation", "solver.", "output.sample_rate_hz", "output.accelerations")
#: Keys that count in runs alone.
_OF_RUNS = ("run.duration_s", "output.sample_rate_hz", "output.accelerations")
#: Keys of a sweep that say what it varies, not how a motion is measured.
_OF_CURVES = ("sweep.supply_frequency_hz", "sweep.over", "sweep.grid", "sweep.kind")
#: Reasons why keys have no effect that may be slips.
BARE = "there is no material, as its mass is 0"
NOT_RANDOM = "nothing is random, as nothing disturbs the start"
#: One that is none, as templates give both keys.
INELASTIC = "contact.restitution is 0"


def unread_by_command(keys: Iterable[str], command: str, plan: BaseModel | None = None) -> Iterator[tuple[str, str]]:
    """Yield those of some keys on which the result of a command does not depend, or that its plan varies, and why."""
    others, of_runs = unused_sections(command) & KINDS.keys(), () if command in ("run", "inspect", "fit") else _OF_RUNS
    of_curves = {"design": _OF_CURVES, "inspect": _OF_MOTIONS}.get(command, ())
    varied = set(_varied_keys(plan)) if getattr(plan, "from_", "") != "previous" else set()
    for key in keys:
        if key.partition(".")[0] in others or key in of_runs or key.startswith(of_curves):
            yield key, ""
        elif {key, in_lists(key.split("."))} & varied:
            draws = command == "find" and key == FREQUENCY
            yield key, f", which gives it values of its own{'; starts only get other random numbers' * draws}"


def _varied_keys(plan: BaseModel | None) -> Iterator[str]:
    """Yield the keys to which a plan gives values of its own, and those that exclude them."""
    over = getattr(plan, "swept", None) or getattr(plan, "over", None) or plan
    names = (getattr(over, "key", None), *getattr(plan, "grid", ()), *getattr(plan, "initial_conditions", ()))
    for name in filter(None, names):
        section, _, last = name.rpartition(".")
        yield name
        for pair in ALTERNATIVES.get(in_lists(section.split(".")), ()):
            yield from (f"{section}.{other}" for other in pair if last in pair)


def unread_by_scene(scene: Scene) -> dict[str, str]:
    """Name the keys that a scene does not read, with the reason."""
    material, contact = scene.material, scene.contact
    unread = {}
    if not scene.start_perturbation:
        unread["run.seed"] = NOT_RANDOM
    of_layers = {f"material.{name}": "material.layers is 1" for name in _OF_TWO_LAYERS}
    if material.layers == 1:
        unread |= of_layers
    without_impacts = {"contact.viscous_per_mass_per_s", "contact.added_mass_share"}
    if contact.model == "impact":
        if not contact.restitution:
            unread["contact.restitution_threshold_m_per_s"] = INELASTIC
        unread |= dict.fromkeys(without_impacts, "contact.model is impact")
    else:
        read = {"contact.model", *without_impacts}
        every = {*of_layers, "material.layers", *(f"contact.{name}" for name in Contact.model_fields)}
        unread |= dict.fromkeys(sorted(every - read), "contact.model is non-impact")
    if not material.is_there:
        every = {f"{name}.{key}" for name in _OF_MATERIAL for key in _OF_MATERIAL[name].model_fields}
        unread |= dict.fromkeys(sorted(every - {"material.mass_ratio", "material.mass_kg"}), BARE)
    return unread


def unread_by_study(scene: Scene, kind: str) -> dict[str, str]:
    """Name the keys that a study does not read with these values of others, with the reason."""
    unread = {}
    if scene.orbits is not None and kind == "orbits":
        if scene.solver.tolerance > 0.1 * scene.orbits.tolerance:
            unread["solver.tolerance"] = f"orbits.tolerance = {given(scene.orbits.tolerance)} asks for less"
        if not scene.start_perturbation:
            unread["run.seed"] = NOT_RANDOM
    if scene.design is not None and kind == "design":
        unread["run.perturbation"] = "sweep.perturbation counts"
        if scene.sweep is not None and not scene.sweep.perturbation:
            unread["sweep.seed"] = "sweep.perturbation is 0, so nothing is random"
        if scene.design.minimize is None:
            unread["design.starts"] = "design.minimize is not given"
        if not scene.design.parameter_tolerances:
            unread["design.samples"] = "design.parameter_tolerances are not given"
    return unread
