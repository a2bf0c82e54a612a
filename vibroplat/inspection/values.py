"""The numbers of an inspection: what follows from a configuration before any run, with unit, meaning and formula.

M is the platform with both unbalances, m_w the material, k_i static moments, ω the speed of the exciters, A amplitudes.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vibroplat.columns import TEXT, Column, Columns, sync_name, unit_of
from vibroplat.config.digits import quantity
from vibroplat.config.plausibility import SWING_TORQUE_RATIO
from vibroplat.config.scene import Scene
from vibroplat.frames import pd
from vibroplat.inspection.balance import (
    LAG,
    Balance,
    Supply,
    balances,
    final_supply,
    holding_torque,
    motor_torques,
    phase_of,
    speed_grid,
    supply_at,
)
from vibroplat.inspection.linear import (
    AXES,
    amplitudes,
    couplings,
    damping_ratios,
    loaded_frequencies,
    natural_frequencies,
    oscillators,
    ripple_factors,
)
from vibroplat.inspection.lines import twelve_lines
from vibroplat.inspection.material import FOLLOWED, loaded_motion
from vibroplat.inspection.start import averaged_start, least_factor

if TYPE_CHECKING:
    import pandas

#: Relative difference of both speeds up to which exciters that have started count as turning together.
TOGETHER = 0.05
#: Relative difference of speeds from which on two balances are two motions.
DISTINCT = 0.002
#: Numbers of both exciters, of each axis, and of the machine without and with material, by parts of their names.
_OF_EXCITERS = {
    "synchronous_speed_{}_hz": Column("synchronous speed of motor {}", "f_e / P; empty if it is off"),
    "static_moment_{}_kg_m": Column("static moment of exciter {}", "k_i"),
    "centrifugal_force_{}_n": Column("centrifugal force of exciter {}", "k_i ω²"),
    "lifting_torque_{}_n_m": Column(
        "torque to lift unbalance {}", f"k_i g; {SWING_TORQUE_RATIO} of it carries it over the top in one swing"
    ),
    "starting_torque_{}_n_m": Column("torque of motor {} at rest", "Kloss, 2 M_c / (s_c + 1/s_c)"),
    "critical_torque_{}_n_m": Column("critical torque of motor {}", "breakdown, M_c"),
    "friction_torque_{}_n_m": Column("bearing friction of exciter {}", "k_R k_i ω²"),
    "motor_torque_{}_n_m": Column("mean torque of motor {}", "Kloss at the expected speed"),
    "natural_frequency_y_loaded_{}_hz": Column(
        "natural frequency {} along y with the material in contact", "two layers make two coupled oscillators"
    ),
}
_OF_AXES = {
    "natural_frequency_{}_hz": Column("natural frequency of {}", "√(c/M) / 2π; empty machine"),
    "damping_ratio_{}": Column("damping ratio of {}", "b / (2√(cM)); empty machine"),
}
_LOADED = {
    "{}mass_kg": Column("mass on the springs{}", "platform, unbalances and material"),
    "{}static_force_n": Column("weight on the springs{}"),
    "{}static_sag_m": Column("static sag{}", "weight / c_y"),
    "{}stroke_x_m": Column("stroke along x{}", "peak to peak"),
    "{}stroke_y_m": Column("stroke along y{}", "peak to peak"),
    "{}stroke_phi_rad": Column("rotation of the platform{}", "peak to peak"),
    "{}throw_index": Column(
        "maximum acceleration along y{} divided by gravity", "A_y ω² / g, with the ripple of the speed; between impacts"
    ),
    "{}dynamic_force_x_n": Column("amplitude of the force into the foundation along x{}"),
    "{}dynamic_force_y_n": Column(
        "amplitude of the force into the foundation along y{}", "downward, beyond the weight"
    ),
    "{}motor_power_w": Column("mechanical power of both motors{}", "torque times speed"),
}
#: The numbers, and how each is found.
INSPECTION: Columns = {
    "supply_frequency_hz": Column("supply frequency at the end of the program, or before the motors go off"),
    "excitation_frequency_hz": Column(
        "expected speed of the exciters", "balance of torques; without synchronization the mean of both"
    ),
    "expected": Column(
        "expected synchronization",
        "stable balance of torques to which the averaged start converges; or none",
        kind=TEXT,
    ),
    "coexisting": Column("another stable synchronization, and its speed", "as after another start", kind=TEXT),
    "loaded_expected": Column("expected synchronization with the material", "empty if there is none", kind=TEXT),
    "phase_difference_rad": Column("expected phase difference of the exciters", "empty without synchronization"),
    "holding_torque_n_m": Column(
        "difference of both torques that the platform holds together", "half the range over all phase differences"
    ),
    "stroke_far_above_m": Column("stroke far above resonance", "2 (k_1 + k_2) / M, peak to peak"),
    "isolation": Column("transmissibility along y", "√(1 + (2Dr)²) / √((1 − r²)² + (2Dr)²), r = ω / ω_y"),
    "moving_fraction": Column(
        "fraction of the material that moves with the platform", "real part of its dynamic mass; below 0: it pushes"
    ),
    "passage_axis": Column("axis of the resonance that takes the largest torque to pass", kind=TEXT),
    "passage_frequency_hz": Column("its natural frequency"),
    "passage_torque_n_m": Column(
        "torque of both motors there with which they just pass it from rest", "averaged start"
    ),
    "passage_steady_torque_n_m": Column("torque to pass it infinitely slowly", "Sommerfeld's limit K² ω_n³ / 2b"),
    "passage_available_n_m": Column("torque of both motors there", "Kloss, with the final supply"),
    "passage_ratio": Column("torque to pass divided by torque available", "from 1 on they are captured; 0: any passes"),
    **{
        name.format(i): about._replace(meaning=about.meaning.format(i))
        for name, about in _OF_EXCITERS.items()
        for i in (1, 2)
    },
    **{
        name.format(axis): about._replace(meaning=about.meaning.format(axis))
        for name, about in _OF_AXES.items()
        for axis in AXES
    },
    **{
        name.format(load): about._replace(meaning=about.meaning.format(more))
        for name, about in _LOADED.items()
        for load, more in (("", " without material"), ("loaded_", " with the material"))
    },
}


class Inspection(dict[str, float | str]):
    """What follows from a scene without a run: numbers by their names, in SI units; NaN for what does not exist.

    ``print(scene.inspect())`` prints twelve lines; ``table`` and :data:`INSPECTION` have meanings and formulas, the
    modules of :mod:`vibroplat.inspection` sources and ranges.

    Examples
    --------
    >>> from vibroplat import Scene
    >>> found = Scene().inspect()
    >>> found["expected"], round(found["natural_frequency_y_hz"], 2)
    ('antiphase', 30.85)
    """

    def __init__(self, name: str, values: dict[str, float | str]) -> None:
        super().__init__({key: values.get(key, "" if INSPECTION[key].kind == TEXT else math.nan) for key in INSPECTION})
        self.name = name

    @cached_property
    def table(self) -> pandas.DataFrame:
        """All numbers with unit and meaning."""
        rows = [(key, value, unit_of(key), INSPECTION[key].text) for key, value in self.items()]
        return pd.DataFrame(rows, columns=["name", "value", "unit", "meaning"])

    @property
    def lines(self) -> list[str]:
        """The twelve lines that ``vibroplat inspect`` prints."""
        return twelve_lines(self.name, self)

    def __str__(self) -> str:
        return "\n".join(self.lines)


def inspect(scene: Scene) -> Inspection:
    """Find what follows from a scene without a run; its method :meth:`vibroplat.Scene.inspect` calls this."""
    supply = final_supply(scene)
    found, speed, others = _expected(scene, supply)
    values: dict[str, float | str] = {
        "supply_frequency_hz": supply.frequency,
        "excitation_frequency_hz": _hertz(speed),
        **_statics(scene),
        **_of_motors(scene, supply, speed),
        **_vibration(scene, speed, found, ""),
        **_passage(scene, supply),
        "expected": "none" if found is None else _sync(scene, found),
        "coexisting": ", ".join(f"{_sync(scene, one)} at {quantity(_hertz(one.speed), 'Hz')}" for one in others),
        "holding_torque_n_m": holding_torque(scene, speed),
    }
    if found is not None:
        values["phase_difference_rad"] = phase_of(scene, found.lag)
    if scene.has_contact and scene.machine.gravity_m_per_s2:
        values |= _loaded(scene, supply, speed, found)
    return Inspection(scene.name, values)


def _hertz(speed: float) -> float:
    return speed / (2.0 * math.pi)


def _sync(scene: Scene, found: Balance) -> str:
    return sync_name(phase_of(scene, found.lag))


def _expected(scene: Scene, supply: Supply) -> tuple[Balance | None, float, list[Balance]]:
    """Return the balance that a start comes to, if there is one, the speed of the exciters (rad/s), and other balances.

    If the motors go off in the end, the balance before counts at the highest speed.
    """
    grid = speed_grid(scene, scene.speed_scale)
    known = [one for highest in (True, False) for one in balances(scene, supply, grid, highest=highest)]
    synchronous = max(scene.synchronous_speeds_at(supply.frequency))
    first = second = synchronous
    if supply == supply_at(scene, math.inf):
        first, second = averaged_start(scene, np.ones(1)).speeds[0].tolist()
    mean = 0.5 * (first + second)
    found = min(known, key=lambda one: abs(one.speed - mean), default=None)
    if found is None or abs(first - second) > TOGETHER * mean or abs(found.speed - mean) > 2.0 * TOGETHER * mean:
        return None, mean or synchronous, known[:1]
    others = [
        one
        for one in known
        if abs(one.speed - found.speed) > DISTINCT * mean or _sync(scene, one) != _sync(scene, found)
    ]
    return found, found.speed, others[:1]


def _statics(scene: Scene) -> dict[str, float | str]:
    """Find masses, static moments, natural frequencies, sag and weight."""
    mass, load, machine = scene.platform_mass, sum(scene.layer_masses), scene.machine
    found: dict[str, float | str] = {"mass_kg": mass, "stroke_far_above_m": 2.0 * sum(scene.unbalances) / mass}
    for prefix, total in (("", mass), *((("loaded_", mass + load),) if load else ())):
        weight = total * machine.gravity_m_per_s2
        found |= {f"{prefix}mass_kg": total, f"{prefix}static_force_n": weight}
        found[f"{prefix}static_sag_m"] = weight / machine.stiffness_y_n_per_m
    ratios = damping_ratios(scene)
    for axis, frequency in natural_frequencies(scene).items():
        found[f"natural_frequency_{axis}_hz"] = frequency
        found[f"damping_ratio_{axis}"] = ratios[axis]
    for i, frequency in enumerate(loaded_frequencies(scene), start=1):
        found[f"natural_frequency_y_loaded_{i}_hz"] = frequency
    return found


def _of_motors(scene: Scene, supply: Supply, speed: float) -> dict[str, float | str]:
    """Find what each motor gives at rest and at a speed (rad/s), and what its unbalance takes."""
    found: dict[str, float | str] = {}
    running, starting = motor_torques(scene, supply, np.array([[speed, speed], [0.0, 0.0]])).tolist()
    for i, (exciter, moment) in enumerate(zip(scene.exciter_pair, scene.unbalances, strict=True)):
        numbers = {
            "static_moment_{}_kg_m": moment,
            "centrifugal_force_{}_n": moment * speed**2,
            "lifting_torque_{}_n_m": moment * scene.machine.gravity_m_per_s2,
            "starting_torque_{}_n_m": starting[i],
            "critical_torque_{}_n_m": exciter.critical_torque_n_m,
            "friction_torque_{}_n_m": exciter.friction_radius_m * moment * speed**2,
            "motor_torque_{}_n_m": running[i],
            "synchronous_speed_{}_hz": supply.frequency / exciter.pole_pairs if supply.driven[i] else math.nan,
        }
        found |= {name.format(i + 1): value for name, value in numbers.items()}
    return found | {"motor_power_w": sum(running) * speed}


def _vibration(
    scene: Scene, speed: float, found: Balance | None, prefix: str, carried: complex = 0.0
) -> dict[str, float | str]:
    """Find strokes and forces at a speed (rad/s); without synchronization with forces that add along y."""
    lag = np.array([math.pi if found is None else found.lag])
    amplitude = np.abs(amplitudes(scene, speed, lag, np.array([carried]))[0])
    _, damping, stiffness = oscillators(scene).T
    forces = np.abs(stiffness + 1j * speed * damping) * amplitude
    gravity = scene.machine.gravity_m_per_s2
    values = {
        f"{prefix}stroke_{axis}": 2.0 * size
        for axis, size in zip(("x_m", "y_m", "phi_rad"), amplitude.tolist(), strict=True)
    }
    values |= {f"{prefix}dynamic_force_x_n": float(forces[0]), f"{prefix}dynamic_force_y_n": float(forces[1])}
    uneven = max(ripple_factors(scene, speed, float(amplitude[1])))
    values[f"{prefix}throw_index"] = uneven * float(amplitude[1]) * speed**2 / gravity if gravity else math.inf
    if not prefix:
        mass, damping_y, stiff = oscillators(scene)[1]
        through = stiff + 1j * speed * damping_y
        values["isolation"] = abs(through) / abs(through - mass * speed**2)
    return {name: float(value) for name, value in values.items()}


def _loaded(scene: Scene, supply: Supply, speed: float, bare: Balance | None) -> dict[str, float | str]:
    """Find the same of a machine with material that lifts off, about the speed of the empty one (rad/s)."""
    motion = loaded_motion(scene, speed)
    carried = np.interp(LAG, FOLLOWED, motion.carried, period=2.0 * math.pi)
    grid = np.linspace(0.8 * speed, max(scene.synchronous_speeds_at(supply.frequency)), 200)
    known = balances(scene, supply, grid, carried)
    lag = math.pi if bare is None else bare.lag
    near = min(known, key=lambda one: abs(math.remainder(one.lag - lag, 2.0 * math.pi)), default=None)
    if near is not None:
        speed, lag = near.speed, near.lag
        motion = loaded_motion(scene, speed)
    at = {name: np.interp(lag, FOLLOWED, part, period=2.0 * math.pi) for name, part in motion._asdict().items()}
    up, down = ripple_factors(scene, speed, 0.5 * float(at["stroke"]))
    names = dict.fromkeys(_sync(scene, one) for one in known)
    values = _vibration(scene, speed, near or bare, "loaded_", complex(at["carried"]))
    values |= {
        "loaded_stroke_y_m": float(at["stroke"]),
        "loaded_throw_index": max(up * at["upward"], down * at["downward"]) / scene.machine.gravity_m_per_s2,
        "loaded_dynamic_force_y_n": float(at["force"]),
        "loaded_expected": " or ".join(names) or "none",
        "moving_fraction": float(at["carried"].real) / sum(scene.layer_masses),
    }
    return values if near is None else values | {"loaded_motor_power_w": sum(near.torques) * near.speed}


def _passage(scene: Scene, supply: Supply) -> dict[str, float | str]:
    """Find the torque to pass the resonance that takes most."""
    factor, stays = least_factor(scene)
    if not stays:
        return {"passage_torque_n_m": 0.0, "passage_ratio": factor}
    frequencies = natural_frequencies(scene)
    below = {a: f for a, f in frequencies.items() if 0.0 < 2.0 * math.pi * f < scene.speed_scale}
    axis = min(below, key=lambda one: abs(2.0 * math.pi * below[one] - stays))
    w, place = 2.0 * math.pi * below[axis], AXES.index(axis)
    moment, damping = float(np.abs(couplings(scene)[:, place]).sum()), float(oscillators(scene)[place, 1])
    available = float(motor_torques(scene, supply, np.array([w, w])).sum())
    return {
        "passage_axis": axis,
        "passage_frequency_hz": below[axis],
        "passage_steady_torque_n_m": moment**2 * w**3 / (2.0 * damping) if damping else math.inf,
        "passage_torque_n_m": factor * available,
        "passage_available_n_m": available,
        "passage_ratio": factor,
    }
