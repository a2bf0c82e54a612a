"""What kind of motion a row tells: sections with known answers first, then rows whose truth was measured."""

import math

import numpy as np
import pytest
from common.known import motion_of
from common.places import LOADED

from vibroplat.config.circular import shown_angle
from vibroplat.hybrid.modes import CHATTER, IMPACT
from vibroplat.observe import measures as m
from vibroplat.observe.section import latest_repetition, period
from vibroplat.report.summary import batch_means_error, block_errors, largest_values, measure
from vibroplat.study.classification import COMPARED_MEASURES, MotionClass, changed_measure, classify, rare_events
from vibroplat.study.lyapunov import Exponent, _estimate
from vibroplat.study.point import BLOCKS, ERRORS, LONGER, columns_of, row_of
from vibroplat.study.settling import EARLY_CHECKS, SettlingResult

from .helpers import CHAOTIC, DAMPED, MACHINE, planned, swept

TURN = 0.04
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)

POSITIVE, NEGATIVE = Exponent(2.0, 0.3, TURN), Exponent(-2.0, 0.3, TURN)
NONE, OPEN = Exponent(1e-4, 2e-3, TURN), Exponent(0.5, 0.4, TURN)
MISSING, MERGING = Exponent(math.nan, math.nan, math.nan), Exponent(-math.inf, 0.0, TURN)

TRANSPORT = {
    f"transport.{key}": value
    for key, value in {"friction": 0.4, "deck_height_m": 0.1, "deck_length_m": 0.6, "deck_width_m": 0.2}.items()
}
#: How a motion has settled.
MAXIMUM = SettlingResult("maximum", 150.0)


def settled(n, *, late=False):
    """Looked periodic with period n, early or late."""
    looks = 2 * EARLY_CHECKS if late else 4
    found = SettlingResult("periodic", looks * 16 * TURN, n, TURN)
    assert found.late == late
    return found


def section(heights):
    """A section of these heights in the scales of the scene, all other coordinates constant."""
    points = np.full((len(heights), 14), 0.3)
    points[:, 1] = heights
    return points


def repeating(n, turns=64):
    """Repeats after n turns; the heights in a period differ by 1/n at least."""
    return section((np.arange(turns) % n * 37 % n) / n)


def torus(turns=400, drift=0.0):
    """A closed curve, gone round by an irrational part each turn, that moves by ``drift`` over all turns."""
    k = np.arange(turns)
    return section(np.cos(2.0 * math.pi * GOLDEN * k) + drift * k / turns)


def spiral(turns=64, start=2e-2, angle=2.0 * math.pi / 14.0, rate=3e-3):
    """Closes in on period 1 slowly, and comes near itself every 14 turns."""
    k = np.arange(turns)
    return section(start * np.exp(-rate * k) * np.cos(angle * k))


def noise(turns=400):
    return section(np.random.default_rng(0).random(turns))


@pytest.fixture
def kind_of(monkeypatch):
    """Classify a section whose exponent is given; one that is not must not be asked for."""

    def told(points, settling=MAXIMUM, exponent=None, *, last=False, **plan):
        def largest_exponent(scene, state):
            assert exponent is not None, "no exponent is needed"
            return exponent

        monkeypatch.setattr("vibroplat.study.classification.largest_exponent", largest_exponent)
        scene = planned(LOADED, 50.0, **plan)
        return classify(scene, scene.sweep, settling, points, np.zeros(14), last=last)

    return told


# -- sections that repeat ---------------------------------------------------------------------------------


def periodic(n, exponent=None):
    return MotionClass("periodic", n, exponent)


def drifting():
    """Repeats after two turns but for what is left of its way, which is more than the tolerance."""
    points = repeating(2)
    points[:, 5] += 5e-3 * np.linspace(0.0, 1.0, 64)
    return points


def converging(turns=600, start=1.02e-2, end=3e-4):
    """Comes to period 6; what is left of its way turns round once in 30 turns, so that it is nearer after these."""
    k = np.arange(turns)
    points = repeating(6, turns)
    points[:, 1] += start * (end / start) ** (k / turns) * np.cos(2.0 * math.pi * k / 30)
    return points


def hardly_doubled():
    """Six points within 9e-3, each met again within 1e-4."""
    points = section(9e-3 * repeating(6)[:, 1])
    points[:, 2] += 1e-4 * (np.arange(64) % 64 == 63)
    return points


#: Closed curves that drift, shrink, or have stood still.
MOVING = (
    torus(drift=2.0),
    section(torus()[:, 1] * np.linspace(1.5, 1.0, 400)),
    section(torus()[:, 1] * (np.arange(400) >= 200)),
)
OPEN_SIGN = MotionClass("undecided", 0, OPEN, "exponent 0.5 ± 0.4 per s, sign unclear", True)
OF_NONE, FEW = "exponent 0.0001 ± 0.002 per s, ", "30 turns measured, at least 31 are needed"
DRIFTS = MotionClass("undecided", 0, NONE, f"{OF_NONE}the section still drifts", True)
TOO_FEW = MotionClass("undecided", None, None, "exciter 1 made fewer than two full turns while measured")
NO_PERIOD = MotionClass("undecided", 0, NEGATIVE, "exponent -2 ± 0.3 per s, no period found up to 64", True)
PERIOD_1_OR_6 = MotionClass("periodic", 1, note="period 1, or 6 within 1e-04 of scaled units")
LAST, NO_EXPONENTS = {"last": True}, {"lyapunov": False}

#: Sections, how they settled, their exponent where it is asked for, and options; the kind, None: must settle longer.
KINDS = {
    "repeats as it settled": [
        (repeating(1), settled(1), None, {}, periodic(1)),
        (repeating(3), settled(3, late=True), NEGATIVE, {}, periodic(3, NEGATIVE)),
        (repeating(16), settled(16), None, {}, periodic(16)),
    ],
    "repeats after another period than it settled with": [
        (repeating(3), settled(6), None, {}, periodic(3)),
        (repeating(3), settled(4), None, {}, None),
    ],
    "repeats without having settled": [(repeating(5, 400), MAXIMUM, None, {}, periodic(5))],
    "repeats after a divisor as well as after what is found": [
        (converging(), MAXIMUM, NEGATIVE, {}, periodic(6, NEGATIVE))
    ],
    "repeats far more closely after a multiple": [(hardly_doubled(), MAXIMUM, None, {}, PERIOD_1_OR_6)],
    "spiral that comes near itself every 14 turns": [
        (spiral(), settled(14), None, {}, None),
        (spiral(start=2e-4), settled(1), None, {}, periodic(1)),
    ],
    "looked settled and does not repeat": [
        (points, settled(1), None, last, None) for points in (noise(64), torus(64)) for last in ({}, LAST)
    ],
    "repeats but drifts": [(drifting(), settled(2), None, {}, None)],
    "late period unless neighbours part": [
        *((repeating(4), settled(4, late=True), e, {}, periodic(4, e)) for e in (NEGATIVE, NONE, MISSING)),
        (repeating(4), settled(4, late=True), POSITIVE, {}, None),  # chaos that passes by
        (repeating(4), settled(4, late=True), POSITIVE, NO_EXPONENTS, periodic(4)),  # not asked for
    ],
    "neighbours part": [
        (points, MAXIMUM, POSITIVE, {}, MotionClass("chaotic", 0, POSITIVE)) for points in (noise(), repeating(34, 400))
    ],
    "neighbours draw together without a period": [  # they will repeat; if not at the last time either, nobody knows
        *((noise(), MAXIMUM, exponent, {}, None) for exponent in (NEGATIVE, MERGING)),
        (noise(), MAXIMUM, NEGATIVE, LAST, NO_PERIOD),
        (repeating(65, 400), MAXIMUM, NEGATIVE, LAST, NO_PERIOD),
    ],
    "growth that may be slow": [  # with two errors it must stay below what doubles in 350 turns
        (
            torus(),
            MAXIMUM,
            Exponent(0.02, 0.012, TURN),
            {},
            MotionClass("quasi-periodic", 0, Exponent(0.02, 0.012, TURN)),
        ),
        *(
            (
                torus(),
                MAXIMUM,
                e,
                {},
                MotionClass("undecided", 0, e, f"exponent {e.value} ± 0.012 per s, sign unclear", True),
            )
            for e in (Exponent(0.03, 0.012, TURN), Exponent(-0.03, 0.012, TURN))
        ),
    ],
    "closed curve": [
        *(
            (points, MAXIMUM, NONE, {}, MotionClass("quasi-periodic", 0, NONE))
            for points in (torus(), repeating(34, 400))
        ),
        (torus(), MAXIMUM, OPEN, {}, OPEN_SIGN),
        (torus(), MAXIMUM, None, NO_EXPONENTS, MotionClass("non-periodic", 0)),
        *((points, MAXIMUM, NONE, {}, DRIFTS) for points in MOVING),
    ],
    "long period": [
        (repeating(17, 400), MAXIMUM, NEGATIVE, {}, periodic(17, NEGATIVE)),
        (repeating(64, 400), MAXIMUM, NEGATIVE, LAST, periodic(64, NEGATIVE)),
        (repeating(19, 400), MAXIMUM, OPEN, {}, periodic(19, OPEN)),
    ],
    "too few turns to be aperiodic": [
        (noise(31), MAXIMUM, None, NO_EXPONENTS, MotionClass("undecided", 0, None, FEW, True)),
        (noise(32), MAXIMUM, None, NO_EXPONENTS, MotionClass("non-periodic", 0)),
        (torus(31), MAXIMUM, NONE, {}, MotionClass("undecided", 0, NONE, f"{OF_NONE}{FEW}", True)),
        (noise(31), MAXIMUM, NEGATIVE, LAST, NO_PERIOD._replace(reason=NO_PERIOD.reason.replace("64", "15"))),
    ],
    "fewer than two turns": [
        (repeating(1, turns), how, None, {}, TOO_FEW) for turns, how in ((0, MAXIMUM), (1, settled(1)))
    ],
}


@pytest.mark.parametrize("name", KINDS)
def test_kind_of_a_section(name, kind_of):
    for points, settling, exponent, options, expected in KINDS[name]:
        assert kind_of(points, settling, exponent, **options) == expected


def test_a_run_tells_periods_as_a_sweep_does():
    for points, turns in ((repeating(1), 1), (repeating(6), 6), (converging(), 6), (noise(), 0)):
        assert latest_repetition(points) == (turns, 0, 0.0)
    for turns, points in ((1, 4), (2, 4), (3, 6), (8, 17), (16, 32)):
        assert latest_repetition(repeating(turns, points)).turns == turns
        assert latest_repetition(repeating(turns, 2 * turns - 1)).turns == 0
    found = latest_repetition(hardly_doubled())
    assert (found.turns, found.note) == (1, PERIOD_1_OR_6.note)


NOT_SETTLED = MotionClass("undecided", 0, None, "not settled: the Poincaré section still drifts", True)


@pytest.mark.parametrize(
    ("points", "last", "expected"),
    [
        (repeating(24, 400), False, periodic(24)),
        (torus(), False, MotionClass("non-periodic", 0)),
        (noise(), False, MotionClass("non-periodic", 0)),
        (noise(31), False, MotionClass("undecided", 0, None, FEW, True)),
        (section(np.linspace(0.0, 1.2e-2, 400)), False, None),  # exciters that synchronize slowly
        (section(np.linspace(0.0, 1.2e-2, 400)), True, NOT_SETTLED),
        (section(0.5 * np.exp(-np.arange(400) / 300.0)), True, NOT_SETTLED),
    ],
    ids=["24 turns", "closed curve", "chaos", "few turns", "drift", "drift, last", "converges"],
)
def test_kind_of_a_section_with_transport(points, last, expected):
    """There are no exponents: long periods are tried, and a drift is no motion of its own."""
    scene = planned(LOADED, 50.0).replace(TRANSPORT)
    assert classify(scene, scene.sweep, MAXIMUM, points, np.zeros(14), last=last) == expected


def test_chance_decides_after_how_many_turns_motion_that_converges_repeats():
    assert period(converging(), 1e-2, last=64) == 30


def test_chaos_whose_section_moves_drifts(kind_of):
    points = noise()
    assert not kind_of(points, exponent=POSITIVE).drifts
    points[len(points) // 2 :] += np.ptp(points)
    assert kind_of(points, exponent=POSITIVE)[::4] == ("chaotic", True)


def test_missing_exponent_is_undecided_and_no_number(kind_of):
    found = kind_of(torus(), exponent=MISSING)
    assert found.reason == "no exponent: the motion ended early or exciter 1 stopped turning"
    assert columns_of(found) == {"motion": "undecided", "period": 0, "detail": found.reason}


# -- rows whose truth is known ----------------------------------------------------------------------------

MASS_1, MASS_2 = {"material.mass_ratio": 0.1}, {"material.mass_ratio": 0.2}


def agrees_with_itself(row):
    """Whether kind, period, exponent, errors and impacts of a row that went well do not contradict each other."""
    exponent, error = row["lyapunov_per_s"], row["lyapunov_error_per_s"]
    repeats = row["motion"] == "periodic"
    assert (row["period"] > 0) == repeats
    assert (row["detail"] != "") == (row["motion"] == "undecided")
    assert row[list(ERRORS.values())].isna().all() if repeats else row[list(ERRORS.values())].notna().all()
    if row["motion"] == "chaotic":
        assert exponent > 3.0 * error
    if row["motion"] == "quasi-periodic":
        assert abs(exponent) <= max(3.0 * error, 0.02)
    if repeats:
        assert math.isnan(exponent) or exponent <= 3.0 * error
        impacts = row["impacts_per_period"] * row["period"]
        assert impacts == pytest.approx(round(impacts), abs=0.02)
    return True


def test_periodic_motion_is_found_after_chaos_of_a_minute():
    """How long chaos lasts is chance, and changes with the last bit: the plan waits ten times as long as was seen."""
    row = swept(DAMPED, 62.5, changes=MASS_2, max_settle_s=1000.0).iloc[0]
    assert (row["motion"], row["period"]) == ("periodic", 3)
    assert row["impacts_per_period"] == pytest.approx(2.0 / 3.0, abs=1e-9)
    assert agrees_with_itself(row)


@pytest.mark.long
def test_torus_is_quasi_periodic():
    row = swept(DAMPED, 55.5, changes=MASS_1, max_settle_s=20.0).iloc[0]
    assert (row["motion"], row["period"]) == ("quasi-periodic", 0)
    assert abs(row["lyapunov_per_s"]) < 0.005
    assert row["lyapunov_error_per_s"] < 0.005
    assert row["impacts_per_period"] == pytest.approx(1.0, abs=1e-9)
    assert agrees_with_itself(row)


@pytest.fixture(scope="module")
def chaos():
    """Rows of a chaotic scene."""
    tables = [swept(MACHINE, 62.5, changes=CHAOTIC, seed=s, max_settle_s=5.0, measure_s=1.5) for s in range(2)]
    return [table.iloc[0] for table in tables]


def test_chaos_is_told_from_any_seed_with_exponents_that_differ_by_their_errors(chaos):
    for row in chaos:
        assert (row["motion"], row["period"], row["detail"]) == ("chaotic", 0, "")
        assert 0.0 < row["lyapunov_error_per_s"] <= row["lyapunov_per_s"] / 6.0
        assert agrees_with_itself(row)
    values, errors = np.array([[row["lyapunov_per_s"], row["lyapunov_error_per_s"]] for row in chaos]).T
    assert (np.abs(values - values.mean()) <= 3.0 * errors).all()


# -- standard errors of measures --------------------------------------------------------------------------


def test_errors_are_told_where_the_motion_does_not_repeat(chaos):
    for row in chaos:
        assert (row[list(ERRORS.values())] > 0.0).all()
        assert row["rms_y_error_m"] < 0.05 * row["rms_y_m"]
    assert agrees_with_itself(swept(LOADED, 51.0, changes={"contact.restitution": 0.3}).iloc[0])


def test_blocks_add_up_to_the_whole():
    scene = planned(MACHINE, 62.5, changes=CHAOTIC).replace(CHAOTIC)
    with motion_of(scene) as motion:
        part = motion.advance(2.0, blocks=BLOCKS)
    assert len(part.blocks) == BLOCKS
    differences = [m.block_difference(*pair) for pair in zip(part.blocks[:-1], part.blocks[1:], strict=True)]
    total = part.blocks[0].whole + sum(block.whole for block in differences)
    assert total == pytest.approx(part.measures.whole, rel=1e-12, abs=1e-15)
    turns = part.blocks[0].marks["turns"] + sum(block.marks["turns"] - 1.0 for block in differences)
    assert turns == part.measures.marks["turns"]
    blocks = [part.blocks[0], *differences]
    events = [(block.marks["last"] - block.marks["first"])[3:] for block in blocks]
    assert (sum(events) == (part.measures.marks["last"] - part.measures.marks["first"])[3:]).all()
    *of_blocks, whole = (largest_values(m.measured_extremes(block)) for block in [*blocks, part.measures])
    for name, largest in whole.items():
        found = [block[name] for block in of_blocks]
        assert min(found) < max(found) <= largest
    errors = block_errors(part.blocks, ["gap_max_m"])
    assert errors["gap_max_m"] == pytest.approx(np.std([found["gap_max_m"] for found in of_blocks], ddof=1))


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.6])
def test_error_of_a_mean_counts_what_goes_on_from_block_to_block(kept):
    """The scatter of 24 blocks alone would give a variance of the mean that is up to four times too small."""
    random, means, errors = np.random.default_rng(1), [], []
    for _ in range(400):
        bursts = np.zeros(64)
        for k in range(1, bursts.size):
            bursts[k] = kept * bursts[k - 1] + random.exponential()
        means.append(bursts[-24:].mean())
        errors.append(batch_means_error(bursts[-24:]))
    assert 0.8 < np.mean(np.square(errors)) / np.var(means) < 1.45


@pytest.mark.parametrize(("decay", "share"), [(0.0, 0.0), (5.0, 1.0)])
def test_error_of_a_remainder_that_decays_reaches_down_to_0(decay, share):
    blocks = [m.empty_accumulators(0.0) for _ in range(BLOCKS)]
    for place, block in enumerate(blocks):
        squares = np.exp(-2.0 * decay * np.arange(place + 1))
        block.whole[[m.TIME, m.XX]] = len(squares), squares.sum()
        block.marks["turns"], block.marks["last"][0] = place + 2, place + 1.0
    rms = math.sqrt(blocks[-1].whole[m.XX] / BLOCKS)
    assert block_errors(blocks, ["rms_x_m"])["rms_x_m"] == pytest.approx(share * rms, rel=0.01, abs=1e-12)


@pytest.mark.parametrize(("away", "has_error"), [(0.05, True), (1.0, False)])
def test_phases_of_blocks_scatter_about_their_circular_mean_if_they_have_one(away, has_error):
    """The first block is at 0 and all others near pi, or all are spread around the circle."""
    phases = math.pi + away * np.linspace(-math.pi, math.pi, BLOCKS)
    phases[0] = 0.1
    blocks = [m.empty_accumulators(0.0) for _ in range(BLOCKS)]
    for place, block in enumerate(blocks, 1):
        turned = phases[:place]
        block.whole[[m.TIME, m.COSINE, m.SINE]] = place, np.cos(turned).sum(), np.sin(turned).sum()
        block.marks["turns"], block.marks["last"][0] = place + 1, place
    found = block_errors(blocks, ["phase_difference_rad"])["phase_difference_rad"]
    assert found == (pytest.approx(batch_means_error(phases), rel=1e-9) if has_error else None)


@pytest.mark.parametrize("latched", [False, True])
def test_impacts_per_period_have_no_error_where_latches_end_them(latched):
    """The tolerance decides how many impacts come before a chatter; a single chatter in the measured part is enough."""
    blocks = [m.empty_accumulators(0.0) for _ in range(BLOCKS)]
    for place, block in enumerate(blocks, 1):
        block.whole[m.TIME] = place
        block.marks["turns"], block.marks["last"][0] = 10 * place + 1, place
        block.marks["last"][3 + IMPACT] = 5 * place + place % 2
        block.marks["last"][3 + CHATTER] = float(latched and place > 7)
    errors = block_errors(blocks, ["impacts_per_period", "flight_fraction"])
    assert (errors["impacts_per_period"] is None) == latched
    assert errors["flight_fraction"] == 0.0


# -- what may be a transient ------------------------------------------------------------------------------

HALF = np.random.default_rng(2).standard_normal((2, BLOCKS // 2, len(COMPARED_MEASURES))) + 10.0


def changed(name, other):
    """Name what changes where one measure has other values in the second half."""
    one, second = HALF.copy()
    place = COMPARED_MEASURES.index(name)
    second[:, place] = other(second[:, place])
    return changed_measure(one, second, np.full(3, 1e-3))


@pytest.mark.parametrize("name", COMPARED_MEASURES)
def test_a_measure_changes_where_means_of_both_halves_are_apart(name):
    assert changed(name, lambda values: values) == ""
    assert changed(name, lambda values: values + 3.0) == name


def test_scatter_changes_unless_it_is_that_of_rare_events():
    calm = {name: changed(name, lambda values: 10.0 + 0.1 * (values - 10.0)) for name in COMPARED_MEASURES}
    assert calm["rms_y_m"] == "rms_y_m"
    assert calm["flight_fraction"] == calm["impacts_per_period"] == ""


def test_what_is_left_of_settling_does_not_change():
    small = HALF * 1e-5
    small[1] *= 2.0
    places = [COMPARED_MEASURES.index(name) for name in ("rms_x_m", "rms_y_m", "rms_phi_rad")]
    assert changed_measure(*(np.where(np.isin(np.arange(HALF.shape[2]), places), small, HALF)), np.full(3, 1e-3)) == ""


def test_events_that_a_half_has_none_of_are_rare():
    values = HALF.reshape(BLOCKS, -1).copy()
    assert rare_events(values) == []
    values[BLOCKS // 2 :, COMPARED_MEASURES.index("flight_fraction")] = 1.0
    assert rare_events(values) == ["flight_fraction"]


def test_an_exponent_is_steady_where_both_halves_of_the_growth_have_it():
    growth, seconds = np.random.default_rng(3).normal(1.0, 0.5, 64), np.full(64, 0.3)
    assert _estimate(growth, seconds, 8).steady
    assert not _estimate(growth - 3.0 * (np.arange(64) >= 32), seconds, 8).steady


@pytest.mark.parametrize("still", [True, False])
def test_motion_that_changes_within_its_interval_is_measured_longer_and_has_no_errors_if_it_still_does(
    still, monkeypatch
):
    answers = iter(["rms_y_m", "rms_y_m" if still else ""])
    monkeypatch.setattr("vibroplat.study.point.transience", lambda *_: next(answers))
    row = swept(MACHINE, 62.5, changes=CHAOTIC, max_settle_s=2.0, measure_s=0.2).iloc[0]
    assert row["simulated_s"] == pytest.approx(2.0 + (1 + LONGER) * BLOCKS * 0.2)
    assert row[list(ERRORS.values())].isna().all() == still
    assert ("may be a transient: rms_y_m changes as it is measured" in row["notes"]) == still


# -- phase difference -------------------------------------------------------------------------------------


def test_angles_near_minus_pi_are_pi():
    pi = math.pi
    told = {-pi: pi, -pi + 0.9e-3: pi, -pi + 1.1e-3: -pi + 1.1e-3, -pi - 0.1: pi - 0.1, pi: pi, 0.0: 0.0}
    assert {angle: shown_angle(angle, 1e-3) for angle in told} == pytest.approx(told, abs=1e-12)


def test_a_phase_difference_with_an_error_is_pi_only_within_it():
    """Unequal exciters keep a small difference from antiphase, also in chaos."""
    scene = planned(LOADED, 50.0)
    with motion_of(scene) as motion:
        measures = measure(motion.advance(0.5), scene) | {"phase_difference_rad": -3.1368}
    told = {
        error: row_of(measures, scene, errors)["phase_difference_rad"]
        for error, errors in (
            (None, {}),
            (2e-7, {ERRORS["phase_difference_rad"]: 2e-7}),
            (4e-3, {ERRORS["phase_difference_rad"]: 4e-3}),
        )
    }
    assert told == {None: math.pi, 2e-7: -3.1368, 4e-3: math.pi}
