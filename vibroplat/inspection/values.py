"""The numbers of an inspection: what follows from a configuration before any run, with unit, meaning and formula.

M is the platform with both unbalances, m_w the material, k_i static moments, ω the speed of the exciters, A amplitudes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroplat.columns import TEXT, Column, Columns, sync_name, unit_of
from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import given, number, percent, quantity
from vibroplat.config.plausibility import SWING_TORQUE_RATIO, WARNING, by_severity, notes_on_input, set_in_vain
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import AXES, natural_modes, placed_springs
from vibroplat.hybrid.state import rest_under
from vibroplat.inspection import balance, linear
from vibroplat.inspection.balance import Balance, Supply, motor_torques
from vibroplat.inspection.linear import ComplexArray
from vibroplat.inspection.lines import answer, short_lines
from vibroplat.inspection.material import FOLLOWED, conveying_of, loaded_motion, unique_friction
from vibroplat.inspection.start import Starts, averaged_start, least_factor, starts_from_rest
from vibroplat.model.parameters import parameters
from vibroplat.report.notes import long_flight
from vibroplat.results.answer import Answer

#: Relative difference of both speeds up to which exciters that have started count as turning together.
TOGETHER = 0.05
#: Part of the largest velocity, in units of equal energy, from which on the platform moves along an axis.
MOVES = 0.2
#: Stroke over that far above resonance up to which exciters mainly rock the machine.
ROCKING = 0.5
#: Relative difference of speeds from which on two balances are two motions.
DISTINCT = 0.002
#: Torque to pass a resonance over what there is from which on a start is tight.
TIGHT = 0.6


def _each(words: Mapping[str, str], described: Columns) -> dict[str, Column]:
    """Return descriptions for each part of a name that replaces {}, with the words of the part in their meanings."""
    return {
        name.format(part): about._replace(meaning=about.meaning.format(said))
        for name, about in described.items()
        for part, said in words.items()
    }


#: How a conveying speed is found.
_CONVEYING = "k_v ω (A_x + A_y tan α), k_v 0.49 … 0.56 or 0.75 … 0.95 by the throw index; empty where neither holds"
#: The numbers, and how each is found.
INSPECTION: Columns = {
    "supply_frequency_hz": Column("supply frequency at the end of program or run, or before the motors go off"),
    "motors_off_s": Column("when the motors go off, or to 0 Hz, for good; all else is before", "empty if they do not"),
    "excitation_frequency_hz": Column("expected speed of the exciters", "balance of torques; empty if not together"),
    "expected": Column("expected synchronization", "balance of torques after the averaged start; or none", kind=TEXT),
    "coexisting": Column("another stable synchronization, and its speed", "as after another start", kind=TEXT),
    "loaded_expected": Column("expected synchronization with the material", "empty if there is none", kind=TEXT),
    "phase_difference_rad": Column("expected phase difference of the exciters", "empty without synchronization"),
    "holding_torque_n_m": Column("difference of both torques that the platform holds", "half the range over phases"),
    "stroke_far_above_m": Column("stroke far above resonance", "2 (k_1 + k_2) / M, peak to peak"),
    "isolation": Column("transmissibility along y", "√(1 + (2Dr)²) / √((1 − r²)² + (2Dr)²), r = ω / ω_y"),
    "loaded_change": Column("change of the ranges in 32 turns with material that jumps", "0 if it does not"),
    "spring_sags": Column("smallest and largest static sag of springs", "with the material; of placed ones", kind=TEXT),
    "material_mass_kg": Column("mass of the material", "m_w"),
    "throw_angle_rad": Column("angle of throw to the deck, with transport", "longer axis of the path; above 0: to +x"),
    "path_ratio": Column("ratio of the axes of the path of the deck", "0: a line, 1: a circle; with transport"),
    "conveying_speed_low_m_per_s": Column("conveying speed, lower end of the formula of practice", _CONVEYING),
    "conveying_speed_high_m_per_s": Column("conveying speed, upper end of the formula of practice", _CONVEYING),
    "unique_friction": Column("friction up to which there is no paradox of Painlevé", "first order in k² / J_e M"),
    "passage_axis": Column("axis of the resonance that takes the largest torque to pass", kind=TEXT),
    "passage_frequency_hz": Column("its natural frequency"),
    "passage_torque_n_m": Column("torque of both motors there that passes it from rest", "averaged starts, any lag"),
    "passage_available_n_m": Column("torque of both motors there", "Kloss, with the final supply"),
    "passage_ratio": Column("torque to pass divided by torque available", "from 1 on some are captured; 0: any passes"),
    "start": Column(
        "how a start from rest ends",
        f"averaged starts, lags all around: passes, barely passes (over {percent(TIGHT)} of the torque), may be or is "
        "likely captured; may not leave rest if a motor lifts its unbalance by no swing",
        kind=TEXT,
    ),
    "moving_axes": Column("axes along which the platform moves", "over a fifth of the largest velocity", kind=TEXT),
    "holding_axis": Column("axis whose vibration holds the phase difference most", "integral criterion", kind=TEXT),
    **_each({"1": "1", "2": "2"}, {
        "synchronous_speed_{}_hz": Column("synchronous speed of motor {}", "f_e / P; empty if it is off"),
        "static_moment_{}_kg_m": Column("static moment of exciter {}", "k_i"),
        "excitation_frequency_{}_hz": Column("expected speed of exciter {}", "0: it stops"),
        "centrifugal_force_{}_n": Column("centrifugal force of exciter {}", "k_i ω²"),
        "loaded_centrifugal_force_{}_n": Column("centrifugal force of exciter {} with the material", "k_i ω²"),
        "loaded_motor_torque_{}_n_m": Column("mean torque of motor {} with the material", "Kloss"),
        "loaded_excitation_frequency_{}_hz": Column("expected speed of exciter {} with the material"),
        "lifting_torque_{}_n_m": Column("torque to lift unbalance {}", f"k_i g; by a swing {SWING_TORQUE_RATIO} k_i g"),
        "starting_torque_{}_n_m": Column("torque of motor {} at rest", "Kloss, 2 M_c / (s_c + 1/s_c)"),
        "critical_torque_{}_n_m": Column("critical torque of motor {}", "breakdown, M_c"),
        "friction_torque_{}_n_m": Column("bearing friction of exciter {}", "k_R k_i ω²"),
        "motor_torque_{}_n_m": Column("mean torque of motor {}", "Kloss at the expected speed"),
        "natural_frequency_y_loaded_{}_hz": Column("natural frequency {} along y with material in contact"),
    }),
    **_each(dict(zip(AXES, AXES, strict=True)), {
        "natural_frequency_{}_hz": Column("natural frequency of {}", "√(c/M) / 2π; empty machine; of the mode near it"),
        "damping_ratio_{}": Column("damping ratio of {}", "b / (2√(cM)); empty machine; of the mode near it"),
        "mode_{}": Column("what moves in the mode near {}", "over 1 % of the kinetic energy", kind=TEXT),
    }),
    **_each({"": " without material", "loaded_": " with the material"}, {
        "{}mass_kg": Column("mass on the springs{}", "platform, unbalances and material"),
        "{}static_force_n": Column("weight on the springs{}"),
        "{}static_sag_m": Column("static sag{}", "weight / c_y; of the centre of mass"),
        "{}stroke_x_m": Column("stroke along x{}", "peak to peak"),
        "{}stroke_y_m": Column("stroke along y{}", "peak to peak"),
        "{}stroke_phi_rad": Column("rotation of the platform{}", "peak to peak"),
        "{}throw_index": Column("maximum acceleration along y{} divided by gravity", "A_y ω² / g_n; between impacts"),
        "{}dynamic_force_x_n": Column("amplitude of the force into the foundation along x{}", "half its range"),
        "{}dynamic_force_y_n": Column("amplitude of the force into the foundation along y{}", "half its range"),
        "{}motor_power_w": Column("mechanical power of both motors{}", "torque times speed"),
    }),
}  # fmt: skip


class Inspection(dict[str, float | str]):
    """What follows from a scene without a run: numbers by their names, in SI units; NaN for what does not exist.

    ``print(scene.inspect())`` prints at most twelve lines; :data:`INSPECTION` has meanings and formulas, the modules of
    :mod:`vibroplat.inspection` sources and ranges.

    Attributes
    ----------
    answer
        What is printed, with notes on the scene.

    Examples
    --------
    >>> from vibroplat import Scene
    >>> found = Scene().inspect()
    >>> found["expected"], round(found["natural_frequency_y_hz"], 2)
    ('antiphase', 30.85)
    """

    def __init__(self, name: str, values: dict[str, float | str], notes: Sequence[str] = ()) -> None:
        super().__init__({key: values.get(key, "" if INSPECTION[key].kind == TEXT else math.nan) for key in INSPECTION})
        self.answer = Answer(_texts(self), notes=notes, headline=answer(name, self), short=short_lines(self))

    def __str__(self) -> str:
        return str(self.answer)


def _texts(values: Mapping[str, Any]) -> dict[str, str]:
    """Write what there is by its meaning, but angles, which lines have; what is negligible for its unit is 0."""
    numbers = {
        key: value
        for key, value in values.items()
        if not (isinstance(value, str) or key.endswith(("difference_rad", "angle_rad"))) and math.isfinite(value)
    }
    largest = dict.fromkeys(map(unit_of, numbers), 0.0)
    for key, value in numbers.items():
        largest[unit_of(key)] = max(abs(value), largest[unit_of(key)])
    texts = {key: value for key, value in values.items() if isinstance(value, str) and value}
    largest.pop("", None)  # numbers without a unit are of different kinds
    texts |= {key: quantity(value, unit_of(key), largest=largest.get(unit_of(key))) for key, value in numbers.items()}
    return {about.meaning: texts[key] for key, about in INSPECTION.items() if key in texts}


class Turning(NamedTuple):
    """How the exciters turn in the end.

    Attributes
    ----------
    speeds
        Of both (rad/s).
    balance
        Of exciters that turn together; None if they do not.
    others
        Other balances.
    """

    speeds: tuple[float, float]
    balance: Balance | None
    others: list[Balance]


class Tone(NamedTuple):
    """A speed (rad/s) and the complex amplitudes of x, y, φ (m, m, rad) with which the empty machine vibrates at it."""

    speed: float
    amplitudes: ComplexArray


@np.errstate(all="ignore")
def inspect(scene: Scene) -> Inspection:
    """Find what follows from a scene without a run; its method :meth:`vibroplat.Scene.inspect` calls this.

    What overflows with extreme values is no number, and shown as such.
    """
    notes = [*set_in_vain(scene.set_keys, "inspect"), *notes_on_input(scene)]
    scene = balance.while_run(scene)
    supply = balance.final_supply(scene)
    starts = (
        starts_from_rest(balance.while_driven(scene)) if any(supply.driven) else (np.zeros((0, 2)), np.zeros(0, bool))
    )
    turning = _expected(scene, supply, starts)
    running, last = turning.balance, scene.drive.intervals[-1]
    values: dict[str, float | str] = {
        "supply_frequency_hz": supply.frequency,
        "motors_off_s": math.nan if any(last.driven) and last.frequency else max(last.start, 0.0),
        **_statics(scene),
        **_of_motors(scene, supply, turning.speeds),
        **_vibration(scene, _tones(scene, turning)),
        **_passage(scene, supply),
        **_deciding(scene, turning),
        "phase_difference_rad": math.nan if running is None else running.phase,
        "expected": "none" if running is None else sync_name(running.phase),
        "coexisting": ", ".join(f"{sync_name(o.phase)} at {quantity(o.speed / TURN, 'Hz')}" for o in turning.others),
        "holding_torque_n_m": balance.holding_torque(scene, max(turning.speeds)),
    }
    if scene.has_contact and scene.machine.gravity_m_per_s2:
        values |= _with_load(scene, supply, turning)
    if any(supply.driven):
        values["start"] = _start(values, starts[1])
    if scene.transport is not None:
        values["unique_friction"] = unique = unique_friction(scene)
        notes.insert(0, _paradox(scene.transport.largest_friction, unique))
    throw = values.get("loaded_throw_index", values["throw_index"])
    notes += [_rocking(scene, values), long_flight(scene, float(throw))]
    return Inspection(scene.name, values, by_severity(filter(None, notes)))


def _rocking(scene: Scene, values: Mapping[str, float | str]) -> str:
    """Return the note on co-rotating exciters whose forces cancel and only rock the machine, or an empty text.

    Far above resonances, equal forces at z₁ and z₂ from the centre of mass make 2/M + Re(z₁ z₂*)/J the coefficient of
    the cosine of their phase difference in the averaged Lagrangian, which is least (Blekhman 1988): where that is 0
    they are a quarter of a turn apart, and further apart on the same line the machine mainly moves along x and y.
    """
    stroke, most = max(float(values[f"stroke_{axis}_m"]) for axis in "xy"), float(values["stroke_far_above_m"])
    first, second = (complex(*axis) for axis in scene.body.axes)
    apart = abs(first - second)
    needed = math.hypot(abs(first + second), math.sqrt(8.0 * scene.body.inertia / scene.body.mass))
    if not scene.co_rotating or values["expected"] == "none" or stroke > ROCKING * most or not 0.0 < apart < needed:
        return ""
    return (
        f"the exciters rock the machine: their forces nearly cancel, and strokes are {percent(stroke / most)} of those "
        f"far above resonance. {number(needed)} m apart and more on the same line, instead of {number(apart)} m, they "
        "vibrate it along x and y"
    )


def _paradox(friction: float, unique: float) -> str:
    """Return the note on a coefficient of friction above the one up to which contact is unique, or an empty text."""
    if not friction > unique:
        return ""
    return (
        f"{WARNING}transport: friction {given(friction)} is above {number(unique)}: contact may have several motions "
        "or none (Painlevé's paradox), and a run is not reliable"
    )


def _expected(scene: Scene, supply: Supply, starts: Starts) -> Turning:
    """Return how the exciters turn after a start that passes, if any does; before the motors go off in the end.

    Exciters that do not turn together have each its own balance; one without a driving motor comes to rest.
    """
    if not any(supply.driven):
        return Turning((0.0, 0.0), None, [])
    known = balance.all_balances(scene, supply)
    ends = starts[0][starts[1].argmin()].tolist()
    if scene.run.initial.speed_ratio:
        ends = averaged_start(balance.while_driven(scene), np.ones(1))[0].tolist()
    mean = 0.5 * sum(ends)
    nearest = min(known, key=lambda one: abs(one.speed - mean), default=None)
    if nearest is None or abs(ends[0] - ends[1]) > TOGETHER * mean or abs(nearest.speed - mean) > 2.0 * TOGETHER * mean:
        alone = [balance.speed_alone(scene, supply, i, near) for i, near in enumerate(ends)]
        # exciters that keep each other's speed up, but not their phases, have no balance of their own
        first, second = (
            one if not one or abs(one - end) < TOGETHER * end else end for one, end in zip(alone, ends, strict=True)
        )
        return Turning((first, second), None, known[:1])
    sync = sync_name(nearest.phase)
    others = [o for o in known if abs(o.speed - nearest.speed) > DISTINCT * mean or sync_name(o.phase) != sync]
    return Turning((nearest.speed, nearest.speed), nearest, others[:1])


def _tones(scene: Scene, turning: Turning) -> list[Tone]:
    """Return the vibration of exciters that turn together, or of each one that turns."""
    if turning.balance is not None:
        speed, lag, _ = turning.balance
        return [Tone(speed, linear.amplitudes(scene, speed, np.array([lag]))[0])]
    speeds = enumerate(turning.speeds)
    return [Tone(speed, linear.amplitudes_alone(scene, i, speed)) for i, speed in speeds if speed]


def _statics(scene: Scene) -> dict[str, float | str]:
    """Find masses, natural frequencies and what moves there, sag and weight."""
    mass, load, p = scene.platform_mass, sum(scene.layer_masses), parameters(scene)
    values: dict[str, float | str] = {
        "stroke_far_above_m": 2.0 * sum(scene.unbalances) / mass,
        "material_mass_kg": scene.material_mass,
    }
    for prefix, total in {"": mass, **({"loaded_": mass + load} if load else {})}.items():
        weight = total * scene.gravity[1]
        values |= {f"{prefix}mass_kg": total, f"{prefix}static_force_n": weight}
        values[f"{prefix}static_sag_m"] = -rest_under((0.0, -weight, 0.0, 0.0, 0.0), p)[1]
    if scene.springs is not None:
        sags = sorted((sag, name) for name, sag in _sags(scene).items())
        ends = [f"{quantity(sag, 'm')} ({name})" for sag, name in (sags[0], sags[-1])]
        values["spring_sags"] = " … ".join(ends)
    modes = natural_modes(scene)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 0.5 * modes.damping / (modes.inertia * modes.speeds)
    for axis, name, speed, ratio in zip(AXES, modes.names, modes.speeds.tolist(), ratios.tolist(), strict=True):
        values |= {f"natural_frequency_{axis}_hz": speed / TURN, f"damping_ratio_{axis}": ratio, f"mode_{axis}": name}
    for i, frequency in enumerate(linear.loaded_frequencies(scene), start=1):
        values[f"natural_frequency_y_loaded_{i}_hz"] = frequency
    return values


def _sags(scene: Scene) -> dict[str, float]:
    """Find the static sag of each spring that is not off, with the material in contact (m)."""
    weight = (scene.platform_mass + sum(scene.layer_masses)) * scene.gravity[1]
    _, y, phi = np.linalg.lstsq(np.array(scene.suspension.stiffness), np.array([0.0, -weight, 0.0]))[0].tolist()
    springs = {name: spring for name, spring in placed_springs(scene).items() if spring.stiffness[1]}
    return {name: -(y + phi * spring.place[0]) for name, spring in springs.items()}


def _of_motors(scene: Scene, supply: Supply, speeds: tuple[float, float]) -> dict[str, float]:
    """Find what each motor gives at rest and at its speed (rad/s), and what its unbalance takes."""
    both = np.array(speeds)
    running, starting = motor_torques(scene, supply, np.array([both, [0.0, 0.0]]))
    moments, pair = np.array(scene.unbalances), scene.exciter_pair
    pairs = {
        "excitation_frequency_{}_hz": both / TURN,
        "static_moment_{}_kg_m": moments,
        "centrifugal_force_{}_n": moments * both**2,
        "lifting_torque_{}_n_m": moments * scene.machine.gravity_m_per_s2,
        "starting_torque_{}_n_m": starting,
        "critical_torque_{}_n_m": [exciter.critical_torque_n_m for exciter in pair],
        "friction_torque_{}_n_m": moments * both**2 * [exciter.friction_radius_m for exciter in pair],
        "motor_torque_{}_n_m": running,
        "synchronous_speed_{}_hz": np.where(supply.driven, scene.synchronous_speeds_at(supply.frequency), np.nan)
        / TURN,
    }
    values = {name.format(i): float(value) for name, two in pairs.items() for i, value in enumerate(two, start=1)}
    together = speeds[0] / TURN if speeds[0] == speeds[1] else math.nan
    return values | {"excitation_frequency_hz": together, "motor_power_w": float(running @ both)}


def _vibration(scene: Scene, tones: Sequence[Tone]) -> dict[str, float]:
    """Find strokes and forces; those of exciters that turn at different speeds where both vibrations add."""
    # what acts on material does not reach the foundation
    stiffness, damping = (np.array(matrix) for matrix in scene.suspension)
    gravity = scene.gravity[1]
    strokes, forces, throw, isolation = np.zeros(3), np.zeros(3), 0.0, math.nan
    for speed, amplitudes in tones:
        sizes, through = np.abs(amplitudes), stiffness + 1j * speed * damping
        strokes += 2.0 * sizes
        forces += np.abs(through @ amplitudes)
        throw += max(linear.ripple_factors(scene, speed, sizes[1])) * sizes[1] * speed**2
        isolation = float(np.abs(through @ linear.receptances(scene, np.array(speed)))[1, 1])
    return {
        **dict(zip(("stroke_x_m", "stroke_y_m", "stroke_phi_rad"), strokes.tolist(), strict=True)),
        **dict(zip(("dynamic_force_x_n", "dynamic_force_y_n"), forces[:2].tolist(), strict=True)),
        "throw_index": float(throw) / gravity if gravity else math.nan,
        "isolation": isolation if len(tones) == 1 else math.nan,
    }


def _with_load(scene: Scene, supply: Supply, turning: Turning) -> dict[str, float | str]:
    """Find the same of a machine with material that lifts off, about the speed of the empty one."""
    tones = _tones(scene, turning)
    if len(tones) != 1:
        return {"loaded_expected": "none"}
    speed = tones[0].speed
    if turning.balance is None:
        names, (driven,) = "none", [i for i in (0, 1) if turning.speeds[i]]
        for _ in range(2):
            steady = linear.amplitudes_alone(scene, driven, speed)
            motion = loaded_motion(scene, speed, steady[1:2])
            speed = balance.speed_alone(scene, supply, driven, speed, complex(motion["carried"][0]))
        speeds = (speed, 0.0) if driven == 0 else (0.0, speed)
        tone = Tone(speed, linear.amplitudes_alone(scene, driven, speed))
    else:
        known = _loaded_balances(scene, supply, turning.balance)
        names = " or ".join(dict.fromkeys(sync_name(one.phase) for one in known)) or "none"
        if not known:
            return {"loaded_expected": names}
        speed, lag, _ = known[0]
        speeds, tone = (speed, speed), Tone(speed, linear.amplitudes(scene, speed, np.array([lag]))[0])
    motion = loaded_motion(scene, speed, tone.amplitudes[1:2], settle=True)
    at = {name: part[0] for name, part in motion.items()}
    up, down = linear.ripple_factors(scene, speed, 0.5 * float(at["stroke"]))
    values = {**_vibration(scene, [tone]), **_of_motors(scene, supply, speeds)} | {
        "stroke_y_m": float(at["stroke"]),
        "throw_index": float(max(up * at["upward"], down * at["downward"])) / scene.gravity[1],
        "dynamic_force_y_n": float(at["force"]),
    }
    stroke, throw = values["stroke_y_m"], values["throw_index"]
    moves = {} if scene.transport is None else conveying_of(scene, tone.speed, tone.amplitudes, stroke, throw)
    return {
        **moves,
        **{f"loaded_{name}": value for name, value in values.items() if f"loaded_{name}" in INSPECTION},
        "loaded_expected": names,
        "loaded_change": float(at["change"]),
    }


def _loaded_balances(scene: Scene, supply: Supply, empty: Balance) -> list[Balance]:
    """Return the balances with the material, first the one whose lag is nearest to that of the empty machine."""
    motion = loaded_motion(scene, empty.speed, linear.amplitudes(scene, empty.speed, FOLLOWED)[:, 1])
    carried = np.interp(balance.LAG, FOLLOWED, motion["carried"], period=TURN)
    grid = np.linspace(0.8 * empty.speed, max(scene.synchronous_speeds_at(supply.frequency)), 200)
    known = balance.balances(scene, supply, grid, carried)
    return sorted(known, key=lambda one: abs(wrap(one.lag - empty.lag)))


def _deciding(scene: Scene, turning: Turning) -> dict[str, float | str]:
    """Find the axes along which the platform moves, and the one that holds the phase difference."""
    roots = np.sqrt(scene.oscillators[0])
    sizes = sum((tone.speed * roots * np.abs(tone.amplitudes) for tone in _tones(scene, turning)), np.zeros(3))
    moving = np.flatnonzero(sizes > MOVES * sizes.max())
    values: dict[str, float | str] = {"moving_axes": ", ".join(AXES[i] for i in moving)}
    if turning.balance is not None:
        x, y, phi = balance.holding_stiffness(scene, turning.balance).tolist()
        # far above their resonances x and y cancel but for a rest
        values["holding_axis"] = "phi" if phi > x + y else "x" if x > y else "y"
    return values


def _start(values: Mapping[str, float | str], captured: NDArray[np.bool_]) -> str:
    """Say how starts from rest end, of which a resonance captures some."""
    names = ("starting_torque_{}_n_m", "lifting_torque_{}_n_m", "passage_ratio")
    torques = [[float(values[name.format(i)]) for name in names] for i in (1, 2)]
    if any(0.0 < starting < SWING_TORQUE_RATIO * lifting for starting, lifting, _ in torques):
        return "may not leave rest"
    if captured.any():
        return "is likely captured" if captured.all() else "may be captured"
    return "passes" if torques[0][2] < TIGHT else "barely passes"


def _passage(scene: Scene, supply: Supply) -> dict[str, float | str]:
    """Find the torque to pass the resonance that takes most."""
    factor, stays = least_factor(balance.while_driven(scene))
    if not stays:
        return {"passage_torque_n_m": 0.0, "passage_ratio": factor}
    modes = natural_modes(scene)
    natural = modes.speeds
    below = (natural > 0.0) & (natural < scene.speed_scale)
    index = int(np.where(below, np.abs(natural - stays), math.inf).argmin())
    w = float(natural[index])
    available = float(motor_torques(scene, supply, np.array([w, w])).sum())
    return {
        "passage_axis": modes.names[index],
        "passage_frequency_hz": w / TURN,
        "passage_torque_n_m": factor * available,
        "passage_available_n_m": available,
        "passage_ratio": factor,
    }
