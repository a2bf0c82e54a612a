"""Lyapunov exponents against the bouncing ball's map, whose multipliers are known, and against sums over a motion."""

import itertools
import math

import numpy as np
import pytest
from common.divergence import integral_of_divergence
from common.known import GRAVITY, OMEGA, TURN, ball_on_table, motion_of
from common.shaken_table import jacobian

from vibroplat import load_config, lyapunov, simulate, variation
from vibroplat.errors import ConfigError, MotionError
from vibroplat.hybrid.modes import ATTACHED
from vibroplat.hybrid.state import initial_state
from vibroplat.observe.tables import state_places
from vibroplat.study.lyapunov import (
    ALL_EXPONENTS,
    BLOCKS,
    LARGEST_EXPONENT,
    MAX_ERROR_PER_TURN,
    MORE_MEASUREMENTS,
    Exponent,
    GrowthSettings,
    count_mixed,
    exponents,
    largest_exponent,
    whole_section,
)

from .helpers import CALIBRATED, CHAOTIC, MACHINE

#: Only gap and gap rate are changed: the table's own motion is undamped, its exponent 0.
OF_THE_BALL = np.zeros((14, 1))
OF_THE_BALL[[5, 12], 0] = 1.0, 0.3


def on_the_orbit(gamma_sine, restitution):
    """Scene and state right after an impact of the period-1 orbit, cos φ = π(1 − R)/((1 + R)Γ)."""
    gamma_cosine = math.pi * (1.0 - restitution) / (1.0 + restitution)
    gamma, phase = math.hypot(gamma_cosine, gamma_sine), math.atan2(gamma_sine, gamma_cosine)
    rebound = (math.pi - gamma_cosine) * GRAVITY / OMEGA
    scene = ball_on_table(gamma, restitution, phase=phase, gap_rate=rebound)
    return scene, initial_state(scene)


def measured_log(gamma_sine, restitution, turns):
    """Logarithm of the growth a period and its error, over so many periods that are counted."""
    scene, state = on_the_orbit(gamma_sine, restitution)
    return a_period(largest_exponent(scene, state, OF_THE_BALL, GrowthSettings(1, least=turns, most=turns)))


def a_period(exponent):
    """Exponent and error as logarithms of the growth a period."""
    assert exponent.turn == pytest.approx(TURN / OMEGA, rel=1e-6)
    return exponent.value * TURN / OMEGA, exponent.error * TURN / OMEGA


# Γ sin φ between ((1 − R)/(1 + R))² and 1 gives a complex pair of modulus R.
@pytest.mark.parametrize(("gamma_sine", "restitution"), [(0.5, 0.8), (0.7, 0.7)])
def test_exponent_of_a_complex_pair_is_half_the_logarithm_of_the_determinant(gamma_sine, restitution):
    """Differences turn while they shrink: counted over whole half turns they are as long as their modulus says, and
    over others within the error.
    """
    multiplier = np.linalg.eigvals(jacobian(gamma_sine, restitution))[0]
    assert abs(multiplier.imag) > 0.1
    assert abs(multiplier) == pytest.approx(restitution, rel=1e-12)
    halves = [n * abs(np.angle(multiplier)) / math.pi for n in range(16, 33)]
    turns = 16 + int(np.argmin([abs(h - round(h)) for h in halves]))
    value, _ = measured_log(gamma_sine, restitution, turns)
    assert value == pytest.approx(math.log(restitution), abs=0.02)
    value, error = measured_log(gamma_sine, restitution, turns + 2)
    assert abs(value - 0.5 * math.log(restitution**2)) <= 3.0 * error
    assert error < 0.3


# real and positive near the saddle-node, real and negative near and beyond the period doubling
@pytest.mark.parametrize(
    ("gamma_sine", "restitution", "sign", "stable"),
    [(0.05, 0.5, 1, True), (1.2, 0.5, -1, False)],
)
def test_exponent_of_real_multipliers_is_that_of_the_larger(gamma_sine, restitution, sign, stable):
    multipliers = np.linalg.eigvals(jacobian(gamma_sine, restitution))
    assert not np.imag(multipliers).any()
    largest = np.real(multipliers[np.abs(multipliers).argmax()])
    assert (np.sign(largest), abs(largest) < 1.0) == (sign, stable)
    value, error = measured_log(gamma_sine, restitution, 16)
    assert value == pytest.approx(math.log(abs(largest)), abs=5e-3)
    assert error < 5e-3  # all turns are alike


# -- chaos of the ball ------------------------------------------------------------------------------------


#: Γ and R of a ball that moves chaotically, and its exponent a period: found with the ball's map, iterated from 500
#: starts for 1000 periods, with a standard error below 3e-3.
CHAOTIC_BALL, EXPONENT = (6.0, 0.8), 0.445


def chaotic_balls(seed):
    """Scenes of the ball after an impact at random phases and speeds, without an end."""
    random = np.random.default_rng(seed)
    while True:
        phase, speed = random.uniform(0.0, TURN), random.uniform(1.0, 3.0) * CHAOTIC_BALL[0]
        yield ball_on_table(*CHAOTIC_BALL, phase=phase, gap_rate=speed * GRAVITY / OMEGA, tolerance=1e-8)


@pytest.mark.long
def test_exponents_of_chaos_are_those_of_the_map_within_honest_errors():
    found = []
    for scene in itertools.islice(chaotic_balls(2), 6):
        _, state = later_state(scene, initial_state(scene), 20)
        exponent = largest_exponent(scene, state, OF_THE_BALL, GrowthSettings(1, least=240, most=240))
        if exponent.value > 0.0:  # it has not come to rest on the table
            found.append(a_period(exponent))
    values, errors = np.array(found).T
    scores = (values - EXPONENT) / np.hypot(errors, 3e-3)
    assert len(scores) >= 5
    assert 0.5 < math.sqrt(np.mean(scores**2)) < 1.8
    assert errors.max() < 0.2


# -- the exponent as it is told ---------------------------------------------------------------------------


def test_sign_is_told_beyond_three_errors_and_beyond_what_is_no_growth():
    slow = MAX_ERROR_PER_TURN / 0.04
    signs = {
        1: [(1.0, 0.3), (1.01 * slow, 0.0)],
        -1: [(-1.0, 0.3), (-1.01 * slow, 0.0), (-math.inf, 0.0)],
        0: [(-1.0, 0.4), (1.0, 0.4), (0.99 * slow, 0.0), (math.nan, math.nan)],
    }
    for sign, values in signs.items():
        assert {Exponent(*value, 0.04).sign for value in values} == {sign}


class Growing:
    """In the place of what follows a motion: growth by numbers that are given, turns of 0.04 s, what is forgotten."""

    def __init__(self, growth, forgotten=lambda call: 0):
        self.growth, self.forgotten = growth, forgotten
        self.calls = 0

    def __call__(self, motion, variation, basis, scales, turns):
        self.calls += 1
        return 0.04 * turns, basis, np.array([self.growth(self.calls)]).ravel(), self.forgotten(self.calls)


@pytest.fixture
def measured(monkeypatch):
    """The exponent of such a growth, and how often it was measured; the first times are not counted."""

    def told(growth, **options):
        growing = Growing(growth)
        monkeypatch.setattr("vibroplat.study.lyapunov._grow", growing)
        scene = load_config(MACHINE)
        found = largest_exponent(scene, initial_state(scene), OF_THE_BALL, GrowthSettings(2, **options))
        return found, growing.calls - LARGEST_EXPONENT.skipped

    return told


def test_even_growth_is_measured_least_and_not_at_first(measured):
    found, count = measured(lambda call: 100.0 if call <= LARGEST_EXPONENT.skipped else 0.5)
    assert count == LARGEST_EXPONENT.least
    assert found.value == pytest.approx(0.5 / 0.08, rel=1e-12)
    assert (found.error, found.turn) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.04))


def test_uneven_growth_is_measured_until_its_error_is_small_enough(measured):
    random = np.random.default_rng(0)
    found, count = measured(lambda _: random.normal(0.1, 0.2))
    assert LARGEST_EXPONENT.least < count < LARGEST_EXPONENT.most
    assert (count - LARGEST_EXPONENT.least) % MORE_MEASUREMENTS == 0
    assert found.error <= found.value / 6.0
    assert abs(found.value - 0.1 / 0.08) <= 3.0 * found.error


def test_measurements_end_at_the_most_that_are_allowed(measured):
    random = np.random.default_rng(0)
    found, count = measured(lambda _: random.normal(0.0, 1.0), least=32, most=128)
    assert (count, found.sign) == (128, 0)
    assert found.error * found.turn > MAX_ERROR_PER_TURN


def test_error_is_the_largest_of_those_of_few_and_many_blocks(measured):
    """Growth that is alike within each of so many blocks: what remembers for longer has fewer that are independent."""
    for count in BLOCKS:
        levels = 0.3 + 0.1 * np.cos(math.pi * np.arange(count) * (1.0 if count > 4 else 0.5))
        found, _ = measured(
            lambda call, n=count, of=levels: of[max(call - LARGEST_EXPONENT.skipped - 1, 0) * n // 80], least=80
        )
        assert found.value == pytest.approx(levels.mean() / 0.08, rel=1e-12)
        assert found.error == pytest.approx(levels.std(ddof=1) / math.sqrt(count) / 0.08, rel=1e-12)


def test_growth_that_beats_as_on_a_torus_is_known_far_better_than_its_blocks_say(measured):
    steady, beats = 2e-4, np.array([1.1, 1.7, 2.3])
    found, _ = measured(lambda call: steady + 0.3 * (np.sin(beats * call) - np.sin(beats * (call - 1))).sum())
    assert abs(found.value - steady / 0.08) < found.error <= MAX_ERROR_PER_TURN / found.turn
    random = np.random.default_rng(0)
    assert measured(lambda _: random.normal(steady, 0.3))[0].error > 10.0 * MAX_ERROR_PER_TURN / 0.04


def test_motions_that_merge_have_an_exponent_below_all_numbers(measured):
    found, _ = measured(lambda call: -math.inf if call == 20 else -0.5)
    assert (found.value, found.error, found.sign) == (-math.inf, 0.0, -1)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_one_event_among_many_turns_says_how_many_directions_are_forgotten(monkeypatch, count):
    """Whatever numbers round-off leaves; a single turn in which a growth is lost says nothing."""
    scene = load_config(MACHINE)
    section = whole_section(scene)
    numbers = -1.0 - np.arange(section.shape[1])

    def growth(call):
        return np.append(numbers[:-1], -math.inf if call == ALL_EXPONENTS.skipped + 7 else numbers[-1])

    growing = Growing(growth, lambda call: count if call == ALL_EXPONENTS.skipped + 100 else 2 * (call == 3))
    monkeypatch.setattr("vibroplat.study.lyapunov._grow", growing)
    found, _ = spectrum(scene, initial_state(scene))
    values = np.array([exponent.value for exponent in found])
    assert np.isneginf(values).sum() == np.isneginf(values[len(values) - count :]).sum() == count
    kept = np.arange(len(numbers) - max(count, 1))
    assert values[kept] == pytest.approx(numbers[kept] / 0.04, rel=1e-12)
    with motion_of(scene) as motion:
        few = exponents(motion, section[:, :3], ALL_EXPONENTS)
    assert np.isfinite([exponent.value for exponent in few]).all()  # what is forgotten may lie outside of these


# -- scenes -----------------------------------------------------------------------------------------------


def later_state(scene, state, turns):
    """Time passed and state some turns later."""
    with motion_of(scene, state) as motion:
        assert motion.to_section(turns, 10.0 * turns * TURN / scene.speed_scale)
        return motion.now, motion.state


def settled(config, frequency, changes=None, turns=None):
    """A scene and its state after so many turns, those of thirty seconds if they are not told."""
    scene = load_config(config, {**(changes or {}), "drive.supply_frequency_hz": frequency})
    return scene, later_state(scene, initial_state(scene), turns or int(15 * frequency))[1]


def test_no_exponent_where_the_exciter_stands_still():
    scene = load_config(MACHINE, {"run.initial.speed_ratio": 0.0, "motor.critical_torque_n_m": 0.0})
    assert np.isnan(largest_exponent(scene, initial_state(scene))[:3]).all()
    with pytest.raises(MotionError, match="no Lyapunov exponents: exciter 1 stopped turning before"):
        lyapunov(scene)


def test_no_exponent_where_the_motion_ends_early():
    scene, state = settled(MACHINE, 62.5, CHAOTIC, 20)
    scene = scene.replace({"solver.max_events_per_period": 1})
    assert np.isnan(largest_exponent(scene, state)[:3]).all()
    with pytest.raises(MotionError, match=r"the motion ended early \(too-many-events\)"):
        lyapunov(scene, state)


# -- all of them ------------------------------------------------------------------------------------------


def spectrum(scene, state, effort=ALL_EXPONENTS):
    """All exponents but that along the motion, and the motion at the end."""
    with motion_of(scene, state) as motion:
        return exponents(motion, whole_section(scene), effort), motion


def run_from(scene, state, seconds):
    """The motion from a state on."""
    at = {"state": {name: state[place] for name, place in state_places(scene).items()}}
    return simulate(scene.replace({"run.duration_s": seconds}, run={"initial": at}))


def test_exponents_are_logarithms_of_multipliers():
    """Of the motion with period 1 at which a bare machine settles, whose sum is its mean divergence."""
    scene, state = settled(MACHINE, 66.0, {"run.initial.phase_difference_rad": 0.3})
    found, motion = spectrum(scene, state)
    turn = found[0].turn
    multipliers = np.linalg.eigvals(variation(scene, motion.state, turn).derivative.to_numpy())
    logarithms = np.sort(np.log(np.abs(multipliers)) / turn)[::-1]
    assert logarithms[0] == pytest.approx(0.0, abs=1e-3)
    values, errors = (np.array(column) for column in zip(*((e.value, e.error) for e in found), strict=True))
    order = np.argsort(-values)
    assert (np.abs(values[order] - logarithms[1:]) <= 3.0 * errors[order] + 1e-3 * np.abs(logarithms[1:])).all()
    change = integral_of_divergence(run_from(scene, motion.state, turn))
    assert values.sum() == pytest.approx(change / turn, rel=1e-4)


@pytest.mark.parametrize("frequency", [55.0, 70.0])
def test_directions_of_the_section_keep_to_no_symmetry(frequency):
    """Otherwise the second one shrank for 150 turns as the fourth one should, and the block of these decided all."""
    scene, state = settled(CALIBRATED, frequency, {"material.mass_ratio": 0.2, "solver.engine": "taylor"})
    found, motion = spectrum(scene, state, ALL_EXPONENTS._replace(most=ALL_EXPONENTS.least))
    multipliers = np.linalg.eigvals(variation(scene, motion.state, found[0].turn).derivative.to_numpy())
    logarithms = np.log(np.sort(np.abs(multipliers))[-8:-1][::-1]) / found[0].turn  # the largest is 1, along the motion
    values, errors = np.array([(e.value, e.error) for e in found[:7]]).T
    assert values == pytest.approx(logarithms, abs=0.1)
    assert (np.abs(values - logarithms) <= 3.0 * errors + 1e-3 * np.abs(values)).all()


def test_what_directions_had_of_their_neighbours_is_not_counted(monkeypatch):
    """It decays by the difference of their growths; of nearly equal ones a third of the measurements is counted."""
    first, gap = 0.5, 0.1

    def growth(call):
        rest = first * math.exp(-gap * call)
        return np.array([-1.0 - rest, -1.0 - gap + rest])

    monkeypatch.setattr("vibroplat.study.lyapunov._grow", Growing(growth))
    scene = load_config(MACHINE)
    with motion_of(scene) as motion:
        found = exponents(motion, whole_section(scene)[:, :2], ALL_EXPONENTS)
    assert [e.value * 0.04 for e in found] == pytest.approx([-1.0, -1.0 - gap], abs=3e-4)
    turns = np.arange(1, 313)[:, np.newaxis]
    for near, skipped in ((gap, 47), (0.05, 93), (0.04, 0), (0.0, 0)):
        assert count_mixed(np.tile([-1.0 - near, -1.0], (312, 1))) == skipped
    assert count_mixed(np.where(turns < 5, -math.inf, [-1.0, -3.0])) == 3
    assert count_mixed(np.ones((20, 2)) * [-1.0, -1.0 - 1.0]) == 0  # as many as blocks are left


def test_sum_over_flights_is_that_of_divergence_and_impacts():
    """Each impact takes R² of the volume of all states; on the section the exciter's speed counts too."""
    scene, state = settled(MACHINE, 52.0, {**CHAOTIC, "contact.restitution": 0.9, "solver.tolerance": 1e-9}, 400)
    found, motion = spectrum(scene, state, GrowthSettings(1, 0, 16, 16))
    begun, seconds = later_state(scene, state, 1)[1], 16 * found[0].turn
    run = run_from(scene, begun, seconds)
    assert len(run.events) > 3
    change = integral_of_divergence(run) + 2.0 * math.log(0.9) * len(run.events)
    total = sum(e.value for e in found) * seconds
    assert total == pytest.approx(change + math.log(begun[10] / motion.state[10]), rel=1e-4)


def test_sum_with_latches_is_that_of_the_part_that_is_kept():
    """In contact that part is the whole state without gap and gap rate; here each section is in contact."""
    scene, state = settled(MACHINE, 50.0, {**CHAOTIC, "contact.restitution": 0.3})
    found, motion = spectrum(scene, state, GrowthSettings(1, 4, 16, 16))
    assert motion.automaton.run["mode"] == ATTACHED
    assert motion.events > 8 * 16  # a chatter takes many impacts
    turn, values = found[0].turn, np.array([exponent.value for exponent in found])
    places = [place for name, place in state_places(scene).items() if not name.startswith("gap_")]
    whole = variation(scene, motion.state, turn).derivative.to_numpy()[np.ix_(places, places)]
    assert np.isneginf(values).sum() == 2
    assert values[:-2].sum() == pytest.approx(np.linalg.slogdet(whole)[1] / turn, rel=1e-4)


def test_table_of_exponents_has_a_neutral_one_and_those_that_contact_loses(monkeypatch):
    monkeypatch.setattr("vibroplat.study.lyapunov.ALL_EXPONENTS", GrowthSettings(1, 24, 288, 288))
    scene, state = settled(MACHINE, 62.5, CHAOTIC)
    table = lyapunov(scene, state)
    values = table["exponent_per_s"]
    assert 1.0 < values[1] < 30.0
    assert list(table.columns) == ["exponent_per_s", "error_per_s", "growth_per_turn"]
    assert list(table.index) == list(range(1, 15))
    assert values.is_monotonic_decreasing
    assert (values == 0.0).sum() == 1
    assert np.isneginf(values).sum() == 2
    assert (table["growth_per_turn"].iloc[-2:] == 0.0).all()
    largest = largest_exponent(scene, state)
    assert abs(values[1] - largest.value) <= 3.0 * math.hypot(table["error_per_s"][1], largest.error)


TAYLOR = {"solver.engine": "taylor"}


def test_exponents_begin_where_a_run_ends(monkeypatch):
    monkeypatch.setattr("vibroplat.study.lyapunov.ALL_EXPONENTS", GrowthSettings(1, 4, 16, 16))
    scene = load_config(MACHINE, {"drive.supply_frequency_hz": 63.0, "run.duration_s": 3.0, **TAYLOR})
    run = simulate(scene, keep="summary")
    assert lyapunov(scene).to_numpy() == pytest.approx(lyapunov(scene, run.final_state).to_numpy(), rel=1e-6)


def test_no_exponents_under_a_drive_program():
    scene = load_config(MACHINE).replace(drive={"program": [{"t_s": 0.0, "supply_frequency_hz": 50.0}]})
    with pytest.raises(ConfigError, match=r"^drive.program is given; allowed for Lyapunov exponents: "):
        lyapunov(scene)
