import math

import numpy as np
import pytest
from study.helpers import swept

from vibroplat.config.scene import Scene
from vibroplat.paper import judges
from vibroplat.paper.claims import cut, expected, judge, scoreboard
from vibroplat.paper.evidence import EDGE, NON_IMPACT_CURVE, BranchRecords, Evidence, F, PaperCurve
from vibroplat.paper.root_finding import JUMP_WIDTH, WIDTH
from vibroplat.paper.scenes import claims, machine_numbers, paper_scene
from vibroplat.study.branches import SweepBranch

CLAIMS = {claim["id"]: claim for claim in claims()}
STEPS = np.arange(21.0, 40.01, 0.25)
#: Where motion stops being periodic below the jump, by R.
NON_PERIODIC = {0.0: 29.5, 0.3: 29.0, 0.5: 28.0, 0.7: 27.0, 1.0: 26.0}
LAYERS = {"material.natural_frequency_hz": 30.0, "material.damping_ratio": 0.7}
PRINTED = paper_scene("fig2", machine_numbers("printed"))


def row(f, **changes):
    """A row as the paper has it without material: antiphase but between the second and third resonance."""
    in_phase = 31.3 < f < 34.8
    near = max(0.0, 1.0 - (31.0 - f) / 0.5) if f <= 31.0 else 0.0
    return {
        F: f,
        "supply_frequency_hz": 2.0 * f,
        "outcome": "ok",
        "sync": "in-phase" if in_phase else "antiphase",
        "period": 1,
        "motion": "periodic",
        "flight_fraction": 0.0,
        "phase_difference_rad": 0.0 if in_phase else math.pi - 0.3 * near,
        "rms_x_m": 1e-3 * max(near, in_phase),
        "rms_phi_rad": 1e-3 * max(near, in_phase),
        "rms_y_m": 1e-6 if in_phase else 1e-3,
        "amplitude_y_m": math.sqrt(2.0) * 1e-3,
        "rms_y_error_m": 0.0,
        "excitation_frequency_error_hz": 0.0,
        "state": None,
    } | changes


def as_in_the_paper(key):
    """Rows of a branch for which every claim holds."""
    mu, r = key.mass_ratio, key.restitution
    viscous = key.model == "non-impact"
    found = []
    for f in STEPS:
        below = f < 31.3
        change = 1.0 if 31.3 < f < 34.8 else 1.0 + mu * ((27.5 - f) / 27.5 if below else -0.1)
        if below and f > 29.0:
            change *= 1.0 + 0.1 * min(r, 0.5)
        elif not below:
            change *= 1.0 - 0.1 * min(r, 0.5)
        period = 1
        over = 36.0 + 2.0 * r
        if mu > 0.0 and not viscous:
            period = 0 if NON_PERIODIC[r] <= f < 31.3 or 34.8 < f < over else 1
        flies = mu > 0.0 and not viscous and f > (24.3 if mu == 0.1 else 24.0)
        if viscous:
            change = {True: 0.9, False: 1.2}[f < 26.0]
        shift = (0.2 if f < 30.9 else 0.5) * mu if 30.6 < f < 31.3 and not viscous else 0.0
        place = row(float(f))
        found.append(
            row(
                float(f),
                **{F: float(f) - shift},
                motion="periodic" if period else "chaotic",
                rms_y_m=place["rms_y_m"] * change,
                amplitude_y_m=place["amplitude_y_m"] * change,
                period=period,
                flight_fraction=0.5 if flies else 0.0,
            )
        )
    return found


def evidence_of(rows_of):
    evidence = Evidence()
    keys = [PaperCurve(0.0), PaperCurve(0.1), *(PaperCurve(0.2, r) for r in NON_PERIODIC), NON_IMPACT_CURVE]
    for key in keys:
        place = {"material.mass_ratio": key.mass_ratio, "contact.restitution": key.restitution}
        branch = SweepBranch(0, "up", {}, Scene().replace({**place, **LAYERS}), tuple(2.0 * STEPS))
        evidence.branches[key] = BranchRecords(branch, rows_of(key))
    return evidence


@pytest.fixture
def evidence():
    return evidence_of(as_in_the_paper)


def changed(change):
    """Evidence as in the paper with rows changed: ``change`` takes key and row."""
    return evidence_of(lambda key: [r | (change(key, r) or {}) for r in as_in_the_paper(key)])


def motion(period):
    """A period and the name of its motion."""
    return {"period": period, "motion": "periodic" if period else "chaotic"}


def test_claims_are_those_of_the_paper():
    assert len(CLAIMS) == 30
    assert all(len(claim["quote"]) > 60 for claim in CLAIMS.values())
    assert "slight leftward shift" in CLAIMS["jump-left"]["quote"]
    assert "excludes amp-rise" in CLAIMS["NI-mid"]["note"]


def test_every_claim_holds_for_the_papers_own_curves(evidence):
    findings = {name: judge(claim, evidence) for name, claim in CLAIMS.items()}
    assert [finding.measured for finding in findings.values() if not finding.holds] == []


SPOILT = {
    "sync-antiphase-inter": lambda k, r: {"sync": "none"} if 25.0 <= r[F] <= 25.5 else None,
    "sync-inphase": lambda k, r: {"sync": "intermediate"} if 33.0 <= r[F] <= 33.5 else None,
    "sync-antiphase-over": lambda k, r: {"sync": "in-phase"} if r[F] > 38.0 else None,
    "sync-deviation": lambda k, r: {"phase_difference_rad": math.pi} if r[F] < 31.3 else None,
    "jump-second-resonance": lambda k, r: {"sync": "in-phase", "rms_y_m": 1e-6} if 30.0 < r[F] < 32.0 else None,
    "bands-unchanged": lambda k, r: {"sync": "in-phase"} if k.mass_ratio == 0.1 and 33.0 < r[F] < 36.0 else None,
    "jump-left": lambda k, r: {F: r["supply_frequency_hz"] / 2.0} if k.mass_ratio == 0.1 else None,
    "amp-rise": lambda k, r: {"rms_y_m": 1e-4} if k.mass_ratio == 0.2 and r[F] < 23.0 else None,
    "amp-fall-inter": lambda k, r: {"rms_y_m": 2e-3} if k.mass_ratio == 0.1 and r[F] > 30.0 else None,
    "amp-fall-over": lambda k, r: {"rms_y_m": 2e-3} if k.mass_ratio == 0.1 and r[F] > 39.0 else None,
    "attached-mu01": lambda k, r: {"flight_fraction": 0.01} if k.mass_ratio == 0.1 and r[F] == 22.0 else None,
    "attached-mu02": lambda k, r: {"flight_fraction": 0.01} if k.mass_ratio == 0.2 and r[F] == 22.0 else None,
    "flight-period1": lambda k, r: motion(2) if k.mass_ratio == 0.1 and r[F] == 26.0 else None,
    "nonperiodic": lambda k, r: motion(3) if k.mass_ratio == 0.2 and r[F] == 30.0 else None,
    "over-period1": lambda k, r: motion(0) if k.mass_ratio == 0.1 and r[F] == 38.75 else None,
    "flight-period1-implied": lambda k, r: motion(0) if k.mass_ratio == 0.1 and r[F] == 29.0 else None,
    "R-same-to-29": lambda k, r: {"rms_y_m": 1.1e-3} if k.restitution == 0.3 and r[F] < 27.0 else None,
    "R-nonperiodic-earlier": lambda k, r: motion(1) if k.restitution == 0.7 and r[F] < 28.0 else None,
    "quoted-frequencies": lambda k, r: {F: r[F] + 0.08},
    "R-amp-inter": lambda k, r: {"rms_y_m": 1.2e-3} if k.restitution == 0.3 and 29.0 < r[F] < 31.0 else None,
    "R-amp-over": lambda k, r: {"rms_y_m": 1.2e-3} if k.restitution == 0.3 and r[F] > 35.0 else None,
    "R-none": lambda k, r: {"rms_y_m": 0.95 * r["rms_y_m"]} if k.restitution == 1.0 and r[F] == 25.0 else None,
    "R1-nonperiodic": lambda k, r: motion(1) if k.restitution == 1.0 and r[F] < 28.0 else None,
    "R-bands": lambda k, r: {"sync": "in-phase"} if k.restitution == 0.5 and 30.0 < r[F] < 32.0 else None,
    "R-over-boundary": lambda k, r: motion(1) if k.restitution == 0.5 and r[F] > 34.8 else None,
    "NI-below": lambda k, r: {"rms_y_m": 2e-3} if k.model == "non-impact" and r[F] == 22.0 else None,
    "NI-mid": lambda k, r: {"rms_y_m": 1e-4} if k.model == "non-impact" and r[F] == 27.0 else None,
    "NI-over": lambda k, r: {"rms_y_m": 1e-4} if k.model == "non-impact" and r[F] == 37.0 else None,
    "NI-shape": lambda k, r: motion(1) if k.model == "impact" and 30.5 < r[F] < 31.0 else None,
}


def test_claim_fails_where_its_words_are_broken():
    findings = {name: judge(claim, changed(SPOILT[name])) for name, claim in CLAIMS.items() if name in SPOILT}
    assert len(findings) >= 24
    assert [name for name, finding in findings.items() if finding.holds] == []
    nothing = [judge(claim, Evidence()) for claim in CLAIMS.values()]
    assert not any(finding.holds for finding in nothing)


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_is_judged_as_well_without_what_it_does_not_look_at(name):
    """Of branches as in the paper, and of others with which it fails."""
    for own in (evidence_of(as_in_the_paper), changed(lambda key, r: {"rms_y_m": r["rms_y_m"] ** (1.0 + key[1])})):
        part = Evidence()
        for key, (branch, rows) in own.branches.items():
            left = cut(branch, [CLAIMS[name]]).key_values
            assert left == branch.key_values[: len(left)]
            if left:
                part.branches[key] = BranchRecords(branch, rows[: len(left)])
        assert judge(CLAIMS[name], part) == judge(CLAIMS[name], own)


def test_damping_of_the_layers_is_subcritical_and_strong(evidence):
    branch, rows = evidence.branches[PaperCurve(0.2)]
    for material, holds in (
        ({"damping_ratio": 0.49}, False),
        ({"damping_ratio": 0.99}, True),
        ({"damping_ratio": 1.0}, False),
        ({"damping_ratio": None}, False),
        ({"damping_ratio": None, "damping_n_s_per_m": 150.0}, True),  # critical is 235.8
        ({"damping_ratio": None, "damping_n_s_per_m": 100.0}, False),
        ({"layers": 1}, False),
    ):
        scene = branch.scene.replace({f"material.{key}": value for key, value in material.items()})
        evidence.branches[PaperCurve(0.2)] = BranchRecords(SweepBranch(0, "up", {}, scene, ()), rows)
        assert judge(CLAIMS["layer-damping"], evidence).holds is holds, material


def test_limits_are_wider_than_boundaries_are_known():
    tolerances = [claim["tol"] for claim in CLAIMS.values() if "tol" in claim]
    assert max(WIDTH, JUMP_WIDTH) / 2.0 < min(EDGE, *tolerances)
    shift, step = CLAIMS["jump-left"]["limits"]["shift_hz"], CLAIMS["jump-second-resonance"]["limits"]["step_hz"]
    assert shift["at_most"] == pytest.approx(-JUMP_WIDTH / 2.0)
    assert min(-shift["at_least"], step["at_least"]) > JUMP_WIDTH / 2.0


def test_claims_are_judged_by_measures_that_have_their_limits(evidence):
    """A measure with a wrong name would be a KeyError; one without a limit is only told."""
    for claim in CLAIMS.values():
        assert {"regime", "pairs", "measure"} & {*claim}, claim["id"]
        assert ("measure" in claim) == ("limits" in claim)
        if "measure" in claim:
            assert {*claim["limits"]} <= {*judges.MEASURES[claim["measure"]](claim, evidence)}


# -- margins ----------------------------------------------------------------------------------------------


def test_margins_tell_how_far_a_verdict_is_from_changing(evidence):
    margins = {name: judge(claim, evidence) for name, claim in CLAIMS.items()}
    assert all(finding.margin >= 0.0 for finding in margins.values())
    told = {name: (round(finding.margin, 3), finding.unit) for name, finding in margins.items()}
    expected_margins = {
        "attached-mu01": (0.125, "Hz"),  # liftoff between 24.25 and 24.5 Hz
        "nonperiodic": (0.4, "Hz"),
        "jump-left": (0.04, "Hz"),  # 0.05 Hz at μ 0.1
        "R-same-to-29": (2.0, "%"),
        "sync-deviation": (0.28, "rad"),
        "quoted-frequencies": (0.03, "Hz"),
        "layer-damping": (0.2, ""),
    }
    assert {name: told[name] for name in expected_margins} == expected_margins
    late = changed(lambda k, r: {"flight_fraction": 0.0} if k.mass_ratio == 0.1 and r[F] < 25.5 else None)
    finding = judge(CLAIMS["attached-mu01"], late)
    assert (finding.holds, finding.margin) == (False, pytest.approx(-0.625))
    assert finding.measured == "attached until 25.38 Hz"
    # nor is a jump far to the left a slight shift
    far = changed(lambda k, r: {"sync": "in-phase"} if k.mass_ratio == 0.2 and 29.5 < r[F] < 31.3 else None)
    assert not judge(CLAIMS["jump-left"], far).holds
    # frequencies may be uncertain
    spoilt = changed(lambda k, r: {F: r[F] + 0.08, "excitation_frequency_error_hz": 0.03})
    assert judge(CLAIMS["quoted-frequencies"], spoilt).holds
    # nothing is near where another condition decides
    assert math.isnan(judge(CLAIMS["NI-shape"], changed(SPOILT["NI-shape"])).margin)


def test_verdict_without_margin_says_so():
    narrow = changed(lambda k, r: {F: r[F] + 0.027})
    board = scoreboard({0: narrow, 1: changed(lambda k, r: {F: r[F] + 0.02})}, []).set_index("id")
    row = board.loc["quoted-frequencies"]
    assert (row["verdict"], row["margin"]) == ("reproduced, without margin", "+0.003 … +0.01 Hz")
    assert board.loc["R-same-to-29", ["verdict", "margin"]].tolist() == ["reproduced", "+2 %"]


# -- errors -----------------------------------------------------------------------------------------------


def noisy(name, key, low, high, factor, error):
    """Judge a claim with the amplitudes of a branch changed between two frequencies, and uncertain there."""

    def change(k, r):
        if k != key or not low < r[F] < high:
            return None
        return {"rms_y_m": factor * r["rms_y_m"], "rms_y_error_m": error * r["rms_y_m"]}

    return judge(CLAIMS[name], changed(change))


def test_comparison_is_violated_only_beyond_two_standard_errors():
    order = ("amp-fall-inter", PaperCurve(0.1), 29.2, 29.4, 1.02)
    ratio = ("R-same-to-29", PaperCurve(0.2, 0.3), 24.9, 25.1, 1.03)
    for wrong, enough in ((order, 0.02), (ratio, 0.01)):
        assert not noisy(*wrong, 0.0).holds
        assert not noisy(*wrong, 0.004).holds
        finding = noisy(*wrong, enough)
        assert finding.holds, finding.measured
        assert "1 undecided by their error" in finding.measured
        assert "not at" not in finding.measured
    # and must be right at nine of ten frequencies
    finding = noisy("amp-fall-inter", PaperCurve(0.1), 28.9, 29.6, 1.02, 0.02)
    assert not finding.holds
    assert "3 undecided by their error" in finding.measured


def test_motion_that_is_undecided_is_neither():
    undecided = {"period": 0, "motion": "undecided"}
    spoilt = changed(lambda k, r: undecided if k.mass_ratio == 0.1 and r[F] in (26.0, 30.0) else None)
    for name in ("flight-period1", "nonperiodic"):
        finding = judge(CLAIMS[name], spoilt)
        assert not finding.holds
        assert "1 undecided" in finding.measured
    spoilt = changed(lambda k, r: undecided if k.restitution == 1.0 and r[F] == 25.0 else None)
    assert judge(CLAIMS["R1-nonperiodic"], spoilt).measured.startswith("periodic until 25.88 Hz")
    assert judge(CLAIMS["R-none"], spoilt).holds


# -- R = 1 ------------------------------------------------------------------------------------------------


def failed_at_one(change):
    """Evidence in which points at R = 1 failed, and other rows are changed."""
    spoilt = changed(change)
    fail(spoilt, PaperCurve(0.2, 1.0), lambda f: 25.0 < f < 31.0)
    return spoilt


def fail(evidence, key, where):
    """Let points of a branch fail: of them nothing is known but their supply frequency."""
    rows = evidence.branches[key].rows
    lost = {"outcome": "too-many-events", "state": None}
    rows[:] = [{"supply_frequency_hz": r["supply_frequency_hz"], **lost} if where(r[F]) else r for r in rows]


def test_claim_that_fails_by_failed_points_is_not_judged_at_one():
    spoilt = failed_at_one(lambda k, r: {"sync": "none"} if k.restitution == 1.0 else None)
    board = scoreboard({0: spoilt, 1: spoilt}, []).set_index("id")
    for name in ("R-none", "R1-nonperiodic", "R-bands"):
        finding = judge(CLAIMS[name], spoilt)
        assert (finding.holds, finding.judged) == (False, False)
        assert "at μ 0.2, R 1)" in finding.measured
        assert board["verdict"][name] == "not judged at R = 1"


def test_claim_that_fails_with_less_restitution_is_not_reproduced():
    spoilt = failed_at_one(SPOILT["R-bands"])
    finding = judge(CLAIMS["R-bands"], spoilt)
    assert (finding.holds, finding.judged) == (False, True)
    assert "; also fails without R = 1" in finding.measured
    assert scoreboard({0: spoilt}, []).set_index("id")["verdict"]["R-bands"] == "not reproduced"


def test_failed_points_are_told_where_a_claim_is_about_them(evidence):
    fail(evidence, PaperCurve(0.2, 1.0), lambda f: f in (22.0, 35.0))
    assert judge(CLAIMS["R-none"], evidence).measured.endswith("(points that failed: 1 at μ 0.2, R 1)")
    assert judge(CLAIMS["R-bands"], evidence).measured.endswith("(points that failed: 2 at μ 0.2, R 1)")
    assert "failed" not in judge(CLAIMS["R-amp-inter"], evidence).measured


def test_captured_machine_holds_no_band_beyond_its_capture():
    captured = evidence_of(lambda key: [r for r in as_in_the_paper(key) if r[F] <= 30.5])
    finding = judge(CLAIMS["sync-antiphase-inter"], captured)
    assert not finding.holds
    assert "points only 21.00 … 30.50 Hz" in finding.measured
    assert judge(CLAIMS["sync-inphase"], captured).measured == "in-phase nowhere; no steady motion in the band"


# -- scoreboard -------------------------------------------------------------------------------------------


def test_scoreboard_tells_what_depends_on_a_number(evidence):
    spoilt = changed(SPOILT["flight-period1"])
    others = [({"material.damping_ratio": 0.3}, spoilt), ({"material.damping_ratio": 0.4}, evidence)]
    board = scoreboard({0: spoilt}, others).set_index("id")
    assert board["verdict"]["flight-period1"] == "depends on an unprinted number"
    assert "damping_ratio 0.4" in board["why"]["flight-period1"]
    assert board["verdict"].drop("flight-period1").str.startswith("reproduced").all()
    board = scoreboard({0: spoilt}, others[:1])
    assert board.set_index("id")["verdict"]["flight-period1"] == "not reproduced"
    assert list(board["id"]) == [*CLAIMS]


def test_scoreboard_tells_what_depends_on_the_seed(evidence):
    spoilt = changed(SPOILT["NI-shape"])
    board = scoreboard({3: evidence, 4: spoilt, 5: evidence, 6: evidence}, [({}, spoilt)]).set_index("id")
    row = board.loc["NI-shape"]
    assert (row["verdict"], row["seeds"]) == ("depends on the seed", "3 of 4")
    assert row["why"].startswith(
        "holds with 3 of 4 seeds; seed 4: non impact crest 1; non impact period 1; impact is non"
    )
    assert board["seeds"]["amp-rise"] == "4 of 4"
    board = scoreboard({3: spoilt, 4: spoilt}, [({}, spoilt)]).set_index("id")
    assert board["verdict"]["NI-shape"] == "not reproduced"


def test_claims_are_told_in_words():
    assert expected(CLAIMS["attached-mu02"]) == "μ 0.2, R 0, f 24 Hz ± 0.25: attached from 21 Hz up to here"
    assert expected(CLAIMS["R1-nonperiodic"]) == "μ 0.2, R 1, f 26 Hz ± 0.5: non-periodic above"
    assert expected(CLAIMS["sync-inphase"]) == "μ 0, f 31.5 … 34.5 Hz: in-phase"
    assert expected(CLAIMS["amp-rise"]) == "R 0, f 21 … 27.5 Hz: A_y grows with mu"


def acceleration(scene, mass_ratio, frequency):
    """Amplitude of the platform's vertical acceleration (m/s²) at a frequency (Hz), with a stiff layer on it."""
    machine, omega = scene.machine, 2.0 * math.pi * frequency
    stiffness = machine.stiffness_y_n_per_m - (1.0 + mass_ratio) * scene.body.mass * omega**2
    return sum(scene.unbalances) * omega**4 / abs(stiffness + 1j * omega * machine.damping_y_n_s_per_m)


def test_stiff_layer_leaves_the_platform_where_the_formula_says(tmp_path):
    """A layer of 1 kHz is nearly stiff: attached just below, in flight just above."""
    frequency, radius = 24.674, 0.0263
    lighter = PRINTED.replace({"machine.unbalance_radius_m": radius})
    assert acceleration(lighter, 0.1, frequency) == pytest.approx(9.81, rel=1e-3)
    machine = tmp_path / "stiff.yaml"
    machine.write_text(
        f"machine: {{unbalance_radius_m: {radius}, damping_y_n_s_per_m: 40.0}}\n"
        "material: {mass_ratio: 0.1, natural_frequency_hz: 1000.0, damping_ratio: 0.5}\n"
    )
    rows = [swept(machine, 2.0 * (frequency + off), perturbation=0.0).iloc[0] for off in (-0.1, 0.1)]
    assert rows[0]["excitation_frequency_hz"] < frequency < rows[1]["excitation_frequency_hz"]
    assert rows[0]["flight_fraction"] == 0.0 < rows[1]["flight_fraction"]
