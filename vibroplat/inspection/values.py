"""The numbers of an inspection: what follows from a configuration before any run, with unit, meaning and formula.

M is the platform with both unbalances, m_w the material, k_i static moments, ω the speed of the exciters, A amplitudes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from vibroplat.columns import TEXT, Column, Columns, sync_name
from vibroplat.config.digits import quantity
from vibroplat.config.plausibility import SWING_TORQUE_RATIO
from vibroplat.config.scene import Scene
from vibroplat.inspection import balance, linear
from vibroplat.inspection.balance import Balance, Supply, motor_torques
from vibroplat.inspection.lines import twelve_lines
from vibroplat.inspection.material import FOLLOWED, loaded_motion
from vibroplat.inspection.start import averaged_start, least_factor

#: Radians of a turn.
TURN = 2.0 * math.pi
#: Relative difference of both speeds up to which exciters that have started count as turning together.
TOGETHER = 0.05
#: Relative difference of speeds from which on two balances are two motions.
DISTINCT = 0.002


def _each(words: Mapping[str, str], described: Columns) -> dict[str, Column]:
    """Return descriptions for each part of a name that replaces {}, with the words of the part in their meanings."""
    return {
        name.format(part): about._replace(meaning=about.meaning.format(said))
        for name, about in described.items()
        for part, said in words.items()
    }


#: The numbers, and how each is found.
INSPECTION: Columns = {
    "supply_frequency_hz": Column("supply frequency at the end of the program, or before the motors go off"),
    "excitation_frequency_hz": Column("expected speed of the exciters", "balance of torques; or the mean of both"),
    "expected": Column("expected synchronization", "balance of torques after the averaged start; or none", kind=TEXT),
    "coexisting": Column("another stable synchronization, and its speed", "as after another start", kind=TEXT),
    "loaded_expected": Column("expected synchronization with the material", "empty if there is none", kind=TEXT),
    "phase_difference_rad": Column("expected phase difference of the exciters", "empty without synchronization"),
    "holding_torque_n_m": Column("difference of both torques that the platform holds", "half the range over phases"),
    "stroke_far_above_m": Column("stroke far above resonance", "2 (k_1 + k_2) / M, peak to peak"),
    "isolation": Column("transmissibility along y", "√(1 + (2Dr)²) / √((1 − r²)² + (2Dr)²), r = ω / ω_y"),
    "moving_fraction": Column("fraction of the material that moves along", "of its dynamic mass; below 0: it pushes"),
    "passage_axis": Column("axis of the resonance that takes the largest torque to pass", kind=TEXT),
    "passage_frequency_hz": Column("its natural frequency"),
    "passage_torque_n_m": Column("torque of both motors there that just passes it from rest", "averaged start"),
    "passage_steady_torque_n_m": Column("torque to pass it infinitely slowly", "Sommerfeld's limit K² ω_n³ / 2b"),
    "passage_available_n_m": Column("torque of both motors there", "Kloss, with the final supply"),
    "passage_ratio": Column("torque to pass divided by torque available", "from 1 on they are captured; 0: any passes"),
    **_each({"1": "1", "2": "2"}, {
        "synchronous_speed_{}_hz": Column("synchronous speed of motor {}", "f_e / P; empty if it is off"),
        "static_moment_{}_kg_m": Column("static moment of exciter {}", "k_i"),
        "centrifugal_force_{}_n": Column("centrifugal force of exciter {}", "k_i ω²"),
        "lifting_torque_{}_n_m": Column("torque to lift unbalance {}", f"k_i g; by a swing {SWING_TORQUE_RATIO} k_i g"),
        "starting_torque_{}_n_m": Column("torque of motor {} at rest", "Kloss, 2 M_c / (s_c + 1/s_c)"),
        "critical_torque_{}_n_m": Column("critical torque of motor {}", "breakdown, M_c"),
        "friction_torque_{}_n_m": Column("bearing friction of exciter {}", "k_R k_i ω²"),
        "motor_torque_{}_n_m": Column("mean torque of motor {}", "Kloss at the expected speed"),
        "natural_frequency_y_loaded_{}_hz": Column("natural frequency {} along y with material in contact"),
    }),
    **_each(dict(zip(linear.AXES, linear.AXES, strict=True)), {
        "natural_frequency_{}_hz": Column("natural frequency of {}", "√(c/M) / 2π; empty machine"),
        "damping_ratio_{}": Column("damping ratio of {}", "b / (2√(cM)); empty machine"),
    }),
    **_each({"": " without material", "loaded_": " with the material"}, {
        "{}mass_kg": Column("mass on the springs{}", "platform, unbalances and material"),
        "{}static_force_n": Column("weight on the springs{}"),
        "{}static_sag_m": Column("static sag{}", "weight / c_y"),
        "{}stroke_x_m": Column("stroke along x{}", "peak to peak"),
        "{}stroke_y_m": Column("stroke along y{}", "peak to peak"),
        "{}stroke_phi_rad": Column("rotation of the platform{}", "peak to peak"),
        "{}throw_index": Column("maximum acceleration along y{} divided by gravity", "A_y ω² / g; between impacts"),
        "{}dynamic_force_x_n": Column("amplitude of the force into the foundation along x{}"),
        "{}dynamic_force_y_n": Column("amplitude of the force into the foundation along y{}", "downward, less weight"),
        "{}motor_power_w": Column("mechanical power of both motors{}", "torque times speed"),
    }),
}  # fmt: skip


class Inspection(dict[str, float | str]):
    """What follows from a scene without a run: numbers by their names, in SI units; NaN for what does not exist.

    ``print(scene.inspect())`` prints twelve lines; :data:`INSPECTION` has meanings and formulas, the modules of
    :mod:`vibroplat.inspection` sources and ranges.

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

    def __str__(self) -> str:
        return "\n".join(twelve_lines(self.name, self))


def inspect(scene: Scene) -> Inspection:
    """Find what follows from a scene without a run; its method :meth:`vibroplat.Scene.inspect` calls this."""
    supply = balance.final_supply(scene)
    found, speed, others = _expected(scene, supply)
    values: dict[str, float | str] = {
        "supply_frequency_hz": supply.frequency,
        "excitation_frequency_hz": speed / TURN,
        **_statics(scene),
        **_of_motors(scene, supply, speed),
        **_vibration(scene, speed, math.pi if found is None else found.lag),
        **_passage(scene, supply),
        "phase_difference_rad": math.nan if found is None else found.phase,
        "expected": "none" if found is None else sync_name(found.phase),
        "coexisting": ", ".join(f"{sync_name(one.phase)} at {quantity(one.speed / TURN, 'Hz')}" for one in others),
        "holding_torque_n_m": balance.holding_torque(scene, speed),
    }
    if scene.has_contact and scene.machine.gravity_m_per_s2:
        values |= _loaded(scene, supply, speed, found)
    return Inspection(scene.name, values)


def _expected(scene: Scene, supply: Supply) -> tuple[Balance | None, float, list[Balance]]:
    """Return the balance that a start comes to, if there is one, the speed of the exciters (rad/s), and another one.

    If the motors go off in the end, the balance before counts at the highest speed.
    """
    grid = balance.speed_grid(scene)
    known = [one for highest in (True, False) for one in balance.balances(scene, supply, grid, highest=highest)]
    synchronous = max(scene.synchronous_speeds_at(supply.frequency))
    first = second = synchronous
    if supply == balance.supply_at(scene, math.inf):
        first, second = averaged_start(scene, np.ones(1))[0].tolist()
    mean = 0.5 * (first + second)
    found = min(known, key=lambda one: abs(one.speed - mean), default=None)
    if found is None or abs(first - second) > TOGETHER * mean or abs(found.speed - mean) > 2.0 * TOGETHER * mean:
        return None, mean or synchronous, known[:1]
    sync = sync_name(found.phase)
    others = [o for o in known if abs(o.speed - found.speed) > DISTINCT * mean or sync_name(o.phase) != sync]
    return found, found.speed, others[:1]


def _statics(scene: Scene) -> dict[str, float]:
    """Find masses, natural frequencies, sag and weight."""
    mass, load, machine = scene.platform_mass, sum(scene.layer_masses), scene.machine
    found = {"stroke_far_above_m": 2.0 * sum(scene.unbalances) / mass}
    for prefix, total in {"": mass, **({"loaded_": mass + load} if load else {})}.items():
        weight = total * machine.gravity_m_per_s2
        found |= {f"{prefix}mass_kg": total, f"{prefix}static_force_n": weight}
        found[f"{prefix}static_sag_m"] = weight / machine.stiffness_y_n_per_m
    natural = linear.natural_speeds(scene)
    inertia, damping, _ = scene.oscillators
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 0.5 * damping / (inertia * natural)
    for axis, speed, ratio in zip(linear.AXES, natural.tolist(), ratios.tolist(), strict=True):
        found |= {f"natural_frequency_{axis}_hz": speed / TURN, f"damping_ratio_{axis}": ratio}
    for i, frequency in enumerate(linear.loaded_frequencies(scene), start=1):
        found[f"natural_frequency_y_loaded_{i}_hz"] = frequency
    return found


def _of_motors(scene: Scene, supply: Supply, speed: float) -> dict[str, float]:
    """Find what each motor gives at rest and at a speed (rad/s), and what its unbalance takes."""
    running, starting = motor_torques(scene, supply, np.array([[speed, speed], [0.0, 0.0]]))
    moments, pair = np.array(scene.unbalances), scene.exciter_pair
    found = {
        "static_moment_{}_kg_m": moments,
        "centrifugal_force_{}_n": moments * speed**2,
        "lifting_torque_{}_n_m": moments * scene.machine.gravity_m_per_s2,
        "starting_torque_{}_n_m": starting,
        "critical_torque_{}_n_m": [exciter.critical_torque_n_m for exciter in pair],
        "friction_torque_{}_n_m": moments * speed**2 * [exciter.friction_radius_m for exciter in pair],
        "motor_torque_{}_n_m": running,
        "synchronous_speed_{}_hz": np.where(supply.driven, scene.synchronous_speeds_at(supply.frequency), np.nan)
        / TURN,
    }
    values = {name.format(i): float(value) for name, both in found.items() for i, value in enumerate(both, start=1)}
    return values | {"motor_power_w": float(running.sum()) * speed}


def _vibration(scene: Scene, speed: float, lag: float) -> dict[str, float]:
    """Find strokes and forces at a speed (rad/s) and a lag (rad)."""
    _, damping, stiffness = scene.oscillators
    through = np.abs(stiffness + 1j * speed * damping)
    amplitudes = np.abs(linear.amplitudes(scene, speed, np.array([lag]))[0])
    y, gravity = float(amplitudes[1]), scene.machine.gravity_m_per_s2
    uneven = max(linear.ripple_factors(scene, speed, y))
    return {
        **dict(zip(("stroke_x_m", "stroke_y_m", "stroke_phi_rad"), (2.0 * amplitudes).tolist(), strict=True)),
        **dict(zip(("dynamic_force_x_n", "dynamic_force_y_n"), (through * amplitudes)[:2].tolist(), strict=True)),
        "throw_index": uneven * y * speed**2 / gravity if gravity else math.inf,
        "isolation": float((through * np.abs(linear.receptances(scene, np.array([speed]))))[0, 1]),
    }


def _loaded(scene: Scene, supply: Supply, speed: float, empty: Balance | None) -> dict[str, float | str]:
    """Find the same of a machine with material that lifts off, about the speed of the empty one (rad/s)."""
    motion = loaded_motion(scene, speed)
    carried = np.interp(balance.LAG, FOLLOWED, motion["carried"], period=TURN)
    grid = np.linspace(0.8 * speed, max(scene.synchronous_speeds_at(supply.frequency)), 200)
    known = balance.balances(scene, supply, grid, carried)
    lag, power = math.pi if empty is None else empty.lag, math.nan
    near = min(known, key=lambda one: abs(math.remainder(one.lag - lag, TURN)), default=None)
    if near is not None:
        speed, lag = near.speed, near.lag
        motion = loaded_motion(scene, speed)
        power = float(motor_torques(scene, supply, np.array([speed, speed])).sum()) * speed
    at = {name: np.interp(lag, FOLLOWED, part, period=TURN) for name, part in motion.items()}
    up, down = linear.ripple_factors(scene, speed, 0.5 * float(at["stroke"]))
    bare = _vibration(scene, speed, lag)
    return {
        **{f"loaded_{name}": bare[name] for name in ("stroke_x_m", "stroke_phi_rad", "dynamic_force_x_n")},
        "loaded_stroke_y_m": float(at["stroke"]),
        "loaded_throw_index": max(up * at["upward"], down * at["downward"]) / scene.machine.gravity_m_per_s2,
        "loaded_dynamic_force_y_n": float(at["force"]),
        "loaded_expected": " or ".join(dict.fromkeys(sync_name(one.phase) for one in known)) or "none",
        "loaded_motor_power_w": power,
        "moving_fraction": float(at["carried"].real) / sum(scene.layer_masses),
    }


def _passage(scene: Scene, supply: Supply) -> dict[str, float | str]:
    """Find the torque to pass the resonance that takes most."""
    factor, stays = least_factor(scene)
    if not stays:
        return {"passage_torque_n_m": 0.0, "passage_ratio": factor}
    natural = linear.natural_speeds(scene)
    below = (natural > 0.0) & (natural < scene.speed_scale)
    place = int(np.where(below, np.abs(natural - stays), math.inf).argmin())
    w, damping = float(natural[place]), float(scene.oscillators[1, place])
    moment = float(np.abs(linear.couplings(scene)[:, place]).sum())
    available = float(motor_torques(scene, supply, np.array([w, w])).sum())
    return {
        "passage_axis": linear.AXES[place],
        "passage_frequency_hz": w / TURN,
        "passage_steady_torque_n_m": moment**2 * w**3 / (2.0 * damping) if damping else math.inf,
        "passage_torque_n_m": factor * available,
        "passage_available_n_m": available,
        "passage_ratio": factor,
    }
