"""What figures and the page call keys, values and scenes, and how they tell several results apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibroplat.columns import AXIS_NAMES, PHASE, PHASE_COLUMN, indexed_name, unit_of
from vibroplat.config.drive import Drive, Entry
from vibroplat.config.kinds import unused_sections
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.reader import flat
from vibroplat.config.scene import Scene
from vibroplat.frames import pd

#: Columns of supply and excitation frequency.
SUPPLY, EXCITATION = "supply_frequency_hz", "excitation_frequency_hz"
#: What curves of a sweep are drawn over, by the names of option ``--x``.
ABSCISSAE = {"excitation": EXCITATION, "supply": SUPPLY}
#: Names and symbols of keys; others have no symbol and are called by the words of their last part.
_KEYS = {
    EXCITATION: ("excitation frequency", "$f$"),
    **dict.fromkeys((SUPPLY, FREQUENCY), ("supply frequency", "$f_e$")),
    "material.mass_ratio": ("mass ratio", r"$\mu_w$"),
    "material.mass_kg": ("mass of the material", "$m_w$"),
    "material.natural_frequency_hz": ("natural frequency of the layers", "$f_w$"),
    "material.damping_ratio": ("damping ratio of the layers", r"$\zeta_w$"),
    "contact.restitution": ("restitution", "$R$"),
    "machine.platform_mass_kg": ("platform mass", "$m_0$"),
    "machine.unbalance_mass_kg": ("unbalance mass", "$m_r$"),
    "machine.unbalance_radius_m": ("unbalance radius", "$r$"),
    "machine.stiffness_x_n_per_m": ("stiffness along x", "$c_x$"),
    "machine.stiffness_y_n_per_m": ("stiffness along y", "$c_y$"),
    "machine.damping_x_n_s_per_m": ("damping along x", "$b_x$"),
    "machine.damping_y_n_s_per_m": ("damping along y", "$b_y$"),
    "motor.critical_torque_n_m": ("critical torque", "$M_c$"),
    "motor.critical_slip": ("critical slip", "$s_c$"),
    "motor.friction_radius_m": ("bearing friction radius", "$k_R$"),
}
#: Kinds of special points of branches of orbits, and what happens at each.
LIFTOFF = "liftoff"
SPECIAL_POINTS = {
    "fold": "two orbits merge and vanish",
    "period-doubling": "an orbit of twice the period branches off",
    "neimark-sacker": "quasi-periodic motion branches off",
    "branch-point": "another branch crosses, as where symmetry breaks",
    LIFTOFF: "contact is lost for the first time",
    "end-of-sticking": "the material no longer stays on the platform after it lands",
    "grazing": "an impact appears or vanishes with zero speed",
}
#: What the axes and curves of a figure show themselves.
_SHOWN = ("sweep.supply_frequency_hz.", "sweep.over.", "sweep.grid.", "orbits.")
#: Least difference of ratios, over that from end to end; values in a table may be rounded.
RATIO = 1e-6
#: Most parameters of a result in a legend.
MOST = 4
#: The supply, constant or a program: one parameter.
DRIVE = "drive"


# -- keys and their values ---------------------------------------------------------------------------------------------


def plain(text: str) -> str:
    """Return a text of a user's to be drawn as it is: between two dollar signs, matplotlib would read mathematics."""
    return text.replace("$", r"\$")


def capital(text: str) -> str:
    """Return a sentence with a capital letter, unless it begins with a key or a column."""
    return text if {".", "_"} & {*text.partition(" ")[0].rstrip(".")} else text[:1].upper() + text[1:]


def is_number(value: Any) -> bool:
    """Whether a value, or a column, holds numbers that can be ordered."""
    types = pd.api.types
    if isinstance(value, pd.Series):
        return types.is_numeric_dtype(value) and not types.is_bool_dtype(value)
    return types.is_number(value) and not types.is_bool(value)


def in_ratios(values: Any) -> bool:
    """Whether different values, three or more, are in equal ratios, and so on a logarithmic axis."""
    numbers = np.unique(np.asarray(values, dtype=float))
    if not (len(numbers) > 2 and numbers[0] > 0.0 and np.isfinite(numbers[-1])):
        return False
    steps = np.diff(np.log(numbers))
    return bool(np.ptp(steps) < RATIO * steps.sum())


def halfway(values: Any) -> Any:
    """Return the edges of tiles around ascending values: midway (geometric midpoints if they are in equal ratios).

    Edges are clipped at 0 unless a value is negative.
    """
    if not len(values):
        return np.asarray(values, dtype=float)
    if in_ratios(values):
        return np.exp(halfway(np.log(values)))
    half = 0.5 * np.diff(values) if len(values) > 1 else 0.01 * np.abs(values) + 1e-9
    first = values[0] - half[0] if values[0] < 0.0 else max(values[0] - half[0], 0.0)
    return np.concatenate([[first], values[:-1] + half[: len(values) - 1], [values[-1] + half[-1]]])


def key_name(key: str) -> str:
    """Return what a key, or its column, is called beside values or directions, as plain text."""
    return plain(_KEYS.get(key, (indexed_name(key), ""))[0])


def symbol_of(key: str) -> str:
    """Return the symbol of a key or of a frequency, if it has one."""
    return _KEYS.get(key, ("", ""))[1]


def axis_label(column: str, unit: str, name: str = "") -> str:
    """Return what a key or a column is called on an axis, by its usual name and symbol or another one, and its unit."""
    name = name or AXIS_NAMES.get(column) or f"{key_name(column)} {symbol_of(column)}".strip()
    return f"{name} ({unit})" if unit and column != PHASE_COLUMN else name


def value_words(key: str, value: Any) -> str:
    """Return a value as plain text, with the words of its key and its unit."""
    if key == DRIVE:
        return supply_label(Drive.model_validate(value)).replace("$f_e$ =", "supply")
    number = f"{value:g}" if is_number(value) else str(value)
    return " ".join(part for part in (indexed_name(key), number, unit_of(key)) if part)


# -- scenes ------------------------------------------------------------------------------------------------------------


def phase_label(co_rotating: bool) -> str:
    """Return the phase difference with its definition."""
    return PHASE + (r" = $\varphi_1 - \varphi_2$" if co_rotating else r" = $\varphi_1 + \varphi_2$")


def run_parameters(scene: Scene | None, begin: float = 0.0) -> str:
    """Return the parameters of a run from a time on (s) that a reader of its figures wants to know."""
    return "" if scene is None else ", ".join([supply_label(scene.drive, begin), *_material(scene)])


def sweep_parameters(scene: Scene | None, varied: Sequence[str]) -> str:
    """Return the parameters of a sweep that do not vary in it."""
    if scene is None:
        return ""
    supply = [] if {SUPPLY, FREQUENCY} & {*varied} else [supply_label(scene.drive)]
    return ", ".join([*supply, *_material(scene, varied)])


def named(names: Sequence[str], *texts: str) -> str:
    """Return what stands below the title of a figure: names of results, and what is told of them."""
    parts = "; ".join(filter(None, texts))
    return ": ".join(filter(None, (plain(", ".join(names)), parts)))


def caption_of(names: Sequence[str], scene: Scene | None, varied: Sequence[str], *lines: str) -> str:
    """Return what stands below the title of a figure of a study, whose keys vary, and further lines."""
    return "\n".join(filter(None, (named(names, sweep_parameters(scene, varied)), *lines)))


def supply_label(drive: Drive, begin: float = 0.0) -> str:
    """Return the supply frequency, or a program's frequencies and switches; what it switches until a time has none."""
    program = drive.program
    if program is None:
        return f"$f_e$ = {drive.largest_frequency:g} Hz"
    frequencies = [e.supply_frequency_hz for e in program if e.supply_frequency_hz is not None]
    passed = frequencies[:1] if len(set(frequencies)) == 1 else frequencies
    text = f"$f_e$ = {' → '.join(f'{f:g}' for f in passed[:4])}{' …' if len(passed) > 4 else ''} Hz"
    switched = [
        f"{who} at {entry.t_s:g} s" if entry.t_s > begin else who for entry in program for who in _switched(entry)
    ]
    driven = any(any(one.driven) for one in drive.intervals if one.end > begin)
    return ", ".join([*([text] if driven else []), *switched[:2], *(["…"] if len(switched) > 2 else [])])


def _switched(entry: Entry) -> list[str]:
    """Say what an entry of a program switches."""
    whole = [] if entry.off is None else [f"motors {'off' if entry.off else 'on'}"]
    given = enumerate((entry.exciter_1, entry.exciter_2), 1)
    return whole + [f"motor {number} {state}" for number, state in given if state is not None]


def _material(scene: Scene, varied: Sequence[str] = ()) -> list[str]:
    """Return mass, layers and contact; what varies is left out."""
    mass_varies = not {"material.mass_ratio", "material.mass_kg"}.isdisjoint(varied)
    ratio = scene.mass_ratio
    if ratio == 0.0 and not mass_varies:
        return ["no material"]
    parts = [] if mass_varies else [rf"$\mu_w$ = {ratio:.4g}"]
    if scene.contact.model == "non-impact":
        return [*parts, "non-impact model"]
    if "material.layers" not in varied:
        parts.append("one layer" if scene.material.layers == 1 else "two layers")
    return parts if "contact.restitution" in varied else [*parts, f"$R$ = {scene.contact.restitution:g}"]


# -- differences between results ---------------------------------------------------------------------------------------


def differing(command: str, configurations: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return for each full configuration of a command the keys in which they differ, with its values.

    Keys that a configuration does not have, or that a study varies itself, are left out of its own. Lists count by
    their entries; the supply, which may be a number or a program, is the key ``drive``.
    """
    trees = []
    for tree in configurations:
        used = {key: value for key, value in tree.items() if key not in ("name", "output", *unused_sections(command))}
        supply = {DRIVE: used.pop(DRIVE)} if DRIVE in used else {}
        own = _varied(command, tree)
        trees.append({key: value for key, value in (supply | leaves(used)).items() if key not in own})
    keys = [key for key in dict.fromkeys(key for tree in trees for key in tree) if not key.startswith(_SHOWN)]
    differ = [key for key in keys if any(tree.get(key) != trees[0].get(key) for tree in trees)]
    return [{key: tree[key] for key in differ if tree.get(key) not in (None, {}, [])} for tree in trees]


def _varied(command: str, tree: Mapping[str, Any]) -> set[str]:
    """Return the keys that a study gives values of its own, as in the result of :func:`differing`."""
    study = tree.get(command, {})
    key = {"orbits": study.get("key", ""), "sweep": study.get("over", {}).get("key", FREQUENCY)}.get(command)
    varied = {*study.get("grid", {})} | ({str(key)} if key else set())
    return varied | {DRIVE} if FREQUENCY in varied else varied


def leaves(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of nested sections and lists by dotted keys; places in lists are numbers."""
    return flat(_number_lists(tree))


def _number_lists(tree: Any) -> Any:
    """Return nested sections with lists as sections whose keys are places."""
    if isinstance(tree, list) and tree:
        return {str(index): _number_lists(value) for index, value in enumerate(tree)}
    return {key: _number_lists(value) for key, value in tree.items()} if isinstance(tree, Mapping) else tree


def distinct(names: Sequence[str], directories: Sequence[Path]) -> list[str]:
    """Return names of results, or their directories where two have the same name."""
    return [name if names.count(name) == 1 else str(path) for name, path in zip(names, directories, strict=True)]


def compared(
    command: str, names: Sequence[str], scenes: Sequence[Scene | None], named: Sequence[str] = ()
) -> list[str]:
    """Return what several results are called in a legend, without keys that each curve names itself.

    Where a scene is lost, they have no more than their names.
    """
    trees = [scene.to_tree() for scene in scenes if scene is not None]
    differences = differing(command, trees) if len(trees) == len(scenes) else [{}] * len(scenes)
    return legend_names(names, [{key: value for key, value in one.items() if key not in named} for one in differences])


def legend_names(names: Sequence[str], differences: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return for each of several results its name, and how it differs from the others."""
    return [
        plain(f"{name} ({values_text(values)})" if values else name)
        for name, values in zip(names, differences, strict=True)
    ]


def values_text(values: Mapping[str, Any]) -> str:
    """Return the values of some keys in words, the first few of many."""
    return ", ".join(shortened([value_words(key, value) for key, value in values.items()]))


def shortened(parts: Sequence[str]) -> list[str]:
    """Return the first parts of a legend, and how many more there are."""
    return [*parts] if len(parts) <= MOST else [*parts[: MOST - 1], f"{len(parts) - MOST + 1} more"]
