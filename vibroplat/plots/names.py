"""Names, symbols and units by which figures call columns and keys."""

from __future__ import annotations

from typing import Any, NamedTuple

import pandas as pd

from vibroplat.columns import split, unit_of
from vibroplat.config.drive import Entry
from vibroplat.config.scene import Scene
from vibroplat.plots.style import plain
from vibroplat.study.branches import EXCITATION, SUPPLY


class Quantity(NamedTuple):
    """What a column is called on an axis, its unit there, and the factor from SI units to it."""

    name: str
    unit: str = ""
    factor: float = 1.0

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


def _quantity(column: str, name: str, factor: float = 1.0) -> Quantity:
    """Return a column in its own unit, or in a thousandth of it."""
    return Quantity(name, {1.0: "", 1e3: "m"}[factor] + unit_of(column), factor)


#: Phase difference of the exciters, everywhere. Its ticks are parts of π, so it has no unit.
PHASE = r"$\Delta\varphi$"
PHASE_COLUMN = "phase_difference_rad"

#: Columns of a sweep, and of branches.
MEASURES = {
    "rms_y_m": _quantity("rms_y_m", "RMS $y$", 1e3),
    "rms_x_m": _quantity("rms_x_m", "RMS $x$", 1e3),
    "rms_phi_rad": _quantity("rms_phi_rad", r"RMS $\varphi$", 1e3),
    PHASE_COLUMN: Quantity(PHASE),
    "motor_power_w": _quantity("motor_power_w", "motor power"),
    "contact_force_max_n": _quantity("contact_force_max_n", "largest $F_c$"),
    "gap_max_m": _quantity("gap_max_m", "largest gap", 1e3),
    "flight_fraction": _quantity("flight_fraction", "flight fraction"),
    "amplitude_y_m": _quantity("amplitude_y_m", "amplitude of $y$", 1e3),
    "impulse_max_n_s": _quantity("impulse_max_n_s", "largest impulse"),
    "impacts_per_period": _quantity("impacts_per_period", "impacts per period"),
    "lyapunov_per_s": _quantity("lyapunov_per_s", "Lyapunov exponent"),
}
#: Columns of a trajectory.
COORDINATES = {
    "y_m": _quantity("y_m", "$y$", 1e3),
    "x_m": _quantity("x_m", "$x$", 1e3),
    "phi_rad": _quantity("phi_rad", r"$\varphi$", 1e3),
    "gap_m": _quantity("gap_m", "gap $y_{w1}$", 1e3),
    "contact_force_n": _quantity("contact_force_n", "contact force $F_c$"),
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


def key_label(key: str) -> str:
    """Return what a key, or the column of a frequency, is called on an axis."""
    if key in FREQUENCIES:
        return FREQUENCIES[key]
    last, unit = split(key)
    name, symbol = _KEYS.get(key, (last.replace("_", " "), ""))
    return " ".join(part for part in (plain(name), symbol, f"({unit})" if unit else "") if part)


def value_label(key: str, value: Any) -> str:
    """Return a value of a key in a legend, with its symbol and unit."""
    last, unit = split(key)
    words = last.replace("_", " ")
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
    return "" if scene is None else ", ".join([supply_label(scene), *_material(scene)])


def sweep_parameters(scene: Scene | None, varied: list[str]) -> str:
    """Return the parameters of a sweep that do not vary in it."""
    if scene is None:
        return ""
    return ", ".join(_material(scene, "material.mass_ratio" in varied, "contact.restitution" in varied))


def supply_label(scene: Scene) -> str:
    """Return the supply frequency, or a program's frequencies and switches."""
    if scene.drive.program is None:
        return f"$f_e$ = {scene.drive.largest_frequency:g} Hz"
    program = scene.drive.program
    frequencies = [e.supply_frequency_hz for e in program if e.supply_frequency_hz is not None]
    passed = frequencies[:1] if len(set(frequencies)) == 1 else frequencies
    text = f"$f_e$ = {' → '.join(f'{f:g}' for f in passed[:4])}{' …' if len(passed) > 4 else ''} Hz"
    switched = [f"{who} at {entry.t_s:g} s" for entry in program for who in _switched(entry)]
    return ", ".join([text, *switched[:2], *(["…"] if len(switched) > 2 else [])])


def _switched(entry: Entry) -> list[str]:
    """Say what an entry of a program switches."""
    whole = [] if entry.off is None else [f"motors {'off' if entry.off else 'on'}"]
    given = enumerate((entry.exciter_1, entry.exciter_2), 1)
    return whole + [f"motor {number} {state}" for number, state in given if state is not None]


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
