"""Names, symbols and units by which figures call columns and keys."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd

from vibroplat.plots.style import plain
from vibroplat.scene import Scene
from vibroplat.study.branches import EXCITATION, SUPPLY


class Quantity(NamedTuple):
    """What a column is called on an axis, and the factor from SI units to those of the axis."""

    label: str
    factor: float = 1.0


#: Phase difference of the exciters, everywhere.
PHASE = r"$\Delta\varphi$"
PHASE_COLUMN = "phase_difference_rad"

#: Columns of a sweep.
MEASURES = {
    "rms_y_m": Quantity("RMS $y$ (mm)", 1e3),
    "rms_x_m": Quantity("RMS $x$ (mm)", 1e3),
    "rms_phi_rad": Quantity(r"RMS $\varphi$ (mrad)", 1e3),
    PHASE_COLUMN: Quantity(PHASE),
    "motor_power_w": Quantity("motor power (W)"),
    "contact_force_max_n": Quantity("largest $F_c$ (N)"),
    "gap_max_m": Quantity("largest gap (mm)", 1e3),
    "flight_fraction": Quantity("flight fraction"),
    "amplitude_y_m": Quantity("amplitude of $y$ (mm)", 1e3),
    "impulse_max_n_s": Quantity("largest impulse (N s)"),
    "impacts_per_period": Quantity("impacts per period"),
}
#: Columns of a trajectory.
COORDINATES = {
    "y_m": Quantity("$y$ (mm)", 1e3),
    "x_m": Quantity("$x$ (mm)", 1e3),
    "phi_rad": Quantity(r"$\varphi$ (mrad)", 1e3),
    "gap_m": Quantity("gap $y_{w1}$ (mm)", 1e3),
    "contact_force_n": Quantity("contact force $F_c$ (N)"),
}
#: What curves of a sweep are drawn over, by the names of option ``--x``.
ABSCISSAE = {"excitation": EXCITATION, "supply": SUPPLY}
FREQUENCIES = {EXCITATION: "excitation frequency $f$ (Hz)", SUPPLY: "supply frequency $f_e$ (Hz)"}

#: Names and symbols of keys; others are called by the last part of the key.
_KEYS = {
    "material.mass_ratio": ("mass ratio", r"$\mu_w$"),
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
#: Ends of names and the units they stand for, the longer ones first.
_UNITS = {
    "_n_m_s_per_rad": "N m s/rad",
    "_n_m_per_rad": "N m/rad",
    "_n_s_per_m": "N s/m",
    "_m_per_s2": "m/s²",
    "_m_per_s": "m/s",
    "_n_per_m": "N/m",
    "_kg_m2": "kg m²",
    "_per_s": "1/s",
    "_n_m": "N m",
    "_n_s": "N s",
    "_deg": "°",
    "_rad": "rad",
    "_kg": "kg",
    "_hz": "Hz",
    "_s": "s",
    "_m": "m",
    "_n": "N",
}


def _split(key: str) -> tuple[str, str]:
    """Return the last part of a key as words, and its unit."""
    last = key.rpartition(".")[2]
    end = next((end for end in _UNITS if last.endswith(end)), "")
    return last.removesuffix(end).replace("_", " "), _UNITS.get(end, "")


def key_label(key: str) -> str:
    """Return what a key of the grid is called on an axis."""
    words, unit = _split(key)
    name, symbol = _KEYS.get(key, (words, ""))
    return " ".join(part for part in (plain(name), symbol, f"({unit})" if unit else "") if part)


def value_label(key: str, value: Any) -> str:
    """Return a value of a key in a legend, with its symbol and unit."""
    words, unit = _split(key)
    if not is_number(value):
        return plain(str(value)) if isinstance(value, str) else f"{plain(words)}: {value}"
    symbol = _KEYS.get(key, ("", ""))[1]
    return f"{symbol or plain(words)}{' = ' if symbol else ' '}{value:g} {unit}".strip()


def is_number(value: Any) -> bool:
    """Whether a value, or a column, holds numbers that can be ordered."""
    types = pd.api.types
    if isinstance(value, pd.Series):
        return types.is_numeric_dtype(value) and not types.is_bool_dtype(value)
    return types.is_number(value) and not types.is_bool(value)


def phase_label(co_rotating: bool) -> str:
    """Return the phase difference with its definition."""
    return PHASE + (r" = $\varphi_1 - \varphi_2$" if co_rotating else r" = $\varphi_1 + \varphi_2$")


def scene_of(provenance: dict[str, Any]) -> Scene | None:
    """Return the scene of a result, or None if its configuration is lost or of another version."""
    from vibroplat.errors import ConfigError  # noqa: PLC0415

    try:
        return Scene.from_tree(provenance["configuration"])
    except (KeyError, TypeError, AttributeError, ConfigError):
        return None


def run_parameters(scene: Scene | None) -> str:
    """Return the parameters of a run that a reader of its figures wants to know."""
    return "" if scene is None else ", ".join([_supply(scene), *_material(scene)])


def sweep_parameters(scene: Scene | None, varied: list[str]) -> str:
    """Return the parameters of a sweep that do not vary in it."""
    if scene is None:
        return ""
    return ", ".join(_material(scene, "material.mass_ratio" in varied, "contact.restitution" in varied))


def _supply(scene: Scene) -> str:
    if scene.drive.program is None:
        return f"$f_e$ = {scene.drive.largest_frequency:g} Hz"
    frequencies = [e.supply_frequency_hz for e in scene.drive.program if e.supply_frequency_hz is not None]
    if len(set(frequencies)) == 1:
        return f"$f_e$ = {frequencies[0]:g} Hz"
    return f"$f_e$ = {' → '.join(f'{f:g}' for f in frequencies[:4])}{' …' if len(frequencies) > 4 else ''} Hz"


def _material(scene: Scene, mass_varies: bool = False, restitution_varies: bool = False) -> list[str]:
    """Return mass, layers and contact; what varies is left out."""
    ratio = scene.material.mass_ratio
    if ratio == 0.0 and not mass_varies:
        return ["no material"]
    parts = [] if mass_varies else [rf"$\mu_w$ = {ratio:g}"]
    if scene.contact.model == "non-impact":
        return [*parts, "non-impact model"]
    parts.append("one layer" if scene.material.layers == 1 else "two layers")
    return parts if restitution_varies else [*parts, f"$R$ = {scene.contact.restitution:g}"]
