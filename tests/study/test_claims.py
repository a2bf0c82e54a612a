from __future__ import annotations

import math

import numpy as np
import pytest

from vibroplat.config import configurations, load_list
from vibroplat.plan import Sweep
from vibroplat.scene import Scene
from vibroplat.study.branches import Branch
from vibroplat.study.claims import judge
from vibroplat.study.evidence import REGIMES, Course, Evidence, F, Key, runs
from vibroplat.study.paper import expected, scoreboard
from vibroplat.study.trial import claims

CLAIMS = {claim["id"]: claim for claim in claims()}
PLAN = Sweep(supply_frequency_hz={"start": 42.0, "stop": 81.0})
STEPS = np.arange(21.0, 40.01, 0.25)


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
        "flight_fraction": 0.0,
        "phase_difference_rad": 0.0 if in_phase else math.pi - 0.3 * near,
        "rms_x_m": 1e-3 * max(near, in_phase),
        "rms_phi_rad": 1e-3 * max(near, in_phase),
        "rms_y_m": 1e-6 if in_phase else 1e-3,
        "amplitude_y_m": math.sqrt(2.0) * 1e-3,
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
            period = 0 if (29.5 if r < 1.0 else 26.0) <= f < 31.3 or 34.8 < f < over else 1
        flies = mu > 0.0 and not viscous and f > 24.4
        if viscous:
            change = {True: 0.9, False: 1.2}[f < 26.0]
        place = row(float(f))
        found.append(
            row(
                float(f),
                rms_y_m=place["rms_y_m"] * change,
                amplitude_y_m=place["amplitude_y_m"] * change,
                period=period,
                flight_fraction=0.5 if flies else 0.0,
            )
        )
    return found


def evidence_of(rows_of):
    evidence = Evidence(narrowed=False)
    keys = [Key(0.0), Key(0.1), *(Key(0.2, r) for r in (0.0, 0.3, 0.5, 1.0)), Key(0.2, model="non-impact")]
    for key in keys:
        evidence.courses[key] = Course(Branch(0, "up", {}, Scene(), ()), PLAN, rows_of(key))
    return evidence


@pytest.fixture
def evidence():
    return evidence_of(as_in_the_paper)


def changed(change):
    """Evidence as in the paper with rows changed: ``change`` takes key and row."""
    return evidence_of(lambda key: [r | (change(key, r) or {}) for r in as_in_the_paper(key)])


def test_claims_are_those_of_the_paper():
    assert len(CLAIMS) == 24
    assert load_list(configurations() / "claims" / "claims.yaml") == list(CLAIMS.values())


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_holds_for_the_papers_own_curves(name, evidence):
    finding = judge(CLAIMS[name], evidence)
    assert finding.holds, finding.measured
    assert finding.score == pytest.approx(1.0)


SPOILT = {
    "sync-antiphase-inter": lambda k, r: {"sync": "none"} if 25.0 <= r[F] <= 25.5 else None,
    "sync-inphase": lambda k, r: {"sync": "intermediate"} if 33.0 <= r[F] <= 33.5 else None,
    "sync-antiphase-over": lambda k, r: {"sync": "in-phase"} if r[F] > 38.0 else None,
    "sync-deviation": lambda k, r: {"phase_difference_rad": math.pi} if r[F] < 31.3 else None,
    "jump-second-resonance": lambda k, r: {"sync": "in-phase", "rms_y_m": 1e-6} if 30.0 < r[F] < 32.0 else None,
    "band-vs-mass": lambda k, r: {"sync": "in-phase"} if k.mass_ratio == 0.2 and 30.0 < r[F] < 32.0 else None,
    "amp-rise": lambda k, r: {"rms_y_m": 1e-4} if k.mass_ratio == 0.2 and r[F] < 23.0 else None,
    "amp-fall-inter": lambda k, r: {"rms_y_m": 2e-3} if k.mass_ratio == 0.1 and r[F] > 30.0 else None,
    "amp-fall-over": lambda k, r: {"rms_y_m": 2e-3} if k.mass_ratio == 0.1 and r[F] > 39.0 else None,
    "attached-mu01": lambda k, r: {"flight_fraction": 0.01} if k.mass_ratio == 0.1 and r[F] == 22.0 else None,
    "attached-mu02": lambda k, r: {"flight_fraction": 0.01} if k.mass_ratio == 0.2 and r[F] == 22.0 else None,
    "flight-period1": lambda k, r: {"period": 2} if k.mass_ratio == 0.1 and r[F] == 28.0 else None,
    "nonperiodic": lambda k, r: {"period": 3} if k.mass_ratio == 0.2 and r[F] == 30.0 else None,
    "over-period1": lambda k, r: {"period": 0} if k.mass_ratio == 0.1 and r[F] == 38.75 else None,
    "R-amp-inter": lambda k, r: {"rms_y_m": 1.2e-3} if k.restitution == 0.3 and 29.0 < r[F] < 31.0 else None,
    "R-amp-over": lambda k, r: {"rms_y_m": 1.2e-3} if k.restitution == 0.3 and r[F] > 35.0 else None,
    "R-none": lambda k, r: {"rms_y_m": 0.95 * r["rms_y_m"]} if k.restitution == 1.0 and r[F] == 25.0 else None,
    "R1-nonperiodic": lambda k, r: {"period": 1} if k.restitution == 1.0 and r[F] < 28.0 else None,
    "R-bands": lambda k, r: {"sync": "in-phase"} if k.restitution == 0.5 and 30.0 < r[F] < 32.0 else None,
    "R-over-boundary": lambda k, r: {"period": 1} if k.restitution == 0.5 and r[F] > 34.8 else None,
    "NI-below": lambda k, r: {"rms_y_m": 2e-3} if k.model == "non-impact" and r[F] == 22.0 else None,
    "NI-mid": lambda k, r: {"rms_y_m": 1e-4} if k.model == "non-impact" and r[F] == 27.0 else None,
    "NI-over": lambda k, r: {"rms_y_m": 1e-4} if k.model == "non-impact" and r[F] == 37.0 else None,
    "NI-shape": lambda k, r: {"period": 1} if k.model == "impact" and 30.5 < r[F] < 31.0 else None,
}


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_fails_where_its_words_are_broken(name):
    finding = judge(CLAIMS[name], changed(SPOILT[name]))
    assert not finding.holds, finding.measured
    assert finding.score < 1.0


@pytest.mark.parametrize("name", CLAIMS)
def test_claim_fails_without_its_branches(name):
    finding = judge(CLAIMS[name], Evidence())
    assert not finding.holds
    assert 0.0 <= finding.score <= 0.5


def test_captured_machine_holds_no_band_beyond_its_capture():
    captured = evidence_of(lambda key: [r for r in as_in_the_paper(key) if r[F] <= 30.5])
    finding = judge(CLAIMS["sync-antiphase-inter"], captured)
    assert not finding.holds
    assert "points only 21.00 … 30.50 Hz" in finding.measured
    assert judge(CLAIMS["sync-inphase"], captured).measured == "in-phase nowhere; no steady motion in the band"


def test_runs_are_the_stretches_of_a_regime(evidence):
    assert runs(evidence.rows(Key(0.0)), "antiphase") == [(21.0, 31.25), (35.0, 40.0)]
    assert runs(evidence.rows(Key(0.0)), "in-phase") == [(31.5, 34.75)]
    assert runs([], "antiphase") == []


def test_curves_are_not_drawn_across_jumps(evidence):
    evidence.courses[Key(0.0)].rows[:] = [r for r in evidence.rows(Key(0.0)) if not 24.0 < r[F] < 26.0]
    found = evidence.curve(Key(0.0), "rms_y_m", np.array([20.0, 22.1, 25.0, 33.0, 38.1]))
    assert np.isnan(found).tolist() == [True, False, True, True, False]
    assert found[1] == pytest.approx(1e-3)


def test_every_regime_of_the_claims_is_known():
    assert {claim["regime"] for claim in CLAIMS.values() if "regime" in claim} <= REGIMES.keys()


def test_scoreboard_tells_what_depends_on_a_number(evidence):
    spoilt = changed(SPOILT["flight-period1"])
    board = scoreboard(spoilt, [({"material.damping_ratio": 0.3}, spoilt), ({"material.damping_ratio": 0.4}, evidence)])
    verdicts = board.set_index("id")["verdict"]
    assert verdicts["flight-period1"] == "depends on an unprinted number"
    assert "damping_ratio 0.4" in board.set_index("id")["why"]["flight-period1"]
    assert (verdicts.drop("flight-period1") == "reproduced").all()
    board = scoreboard(spoilt, [({"material.damping_ratio": 0.3}, spoilt)])
    assert board.set_index("id")["verdict"]["flight-period1"] == "not reproduced"
    assert list(board["id"]) == list(CLAIMS)


def test_claims_are_told_in_words():
    assert expected(CLAIMS["attached-mu02"]) == "μ 0.2, R 0, f 21 … 24 Hz: attached"
    assert expected(CLAIMS["R1-nonperiodic"]) == "μ 0.2, R 1, f 26 Hz ± 0.5: non-periodic above"
    assert expected(CLAIMS["amp-rise"]) == "R 0, f 21 … 27.5 Hz: A_y grows with mu"
