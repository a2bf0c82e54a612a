"""Judges of claims about amplitudes, which compare curves over frequency with each other.

Measures of non-periodic motion have standard errors. A comparison is violated at a frequency if it is wrong by more
than SIGMAS standard errors. It holds if it is violated nowhere, is right at a share RIGHT of the frequencies, and right
by more than its error at a share SURE of them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vibroplat.model.parameters import FloatArray
from vibroplat.paper.evidence import REGIMES, Curve, Evidence, F, Key, Row
from vibroplat.paper.finding import EDGE, Claim, Finding, Judge, interval, joined, name_of, restitutions
from vibroplat.study.branches import SUPPLY

#: Spacing of frequencies (Hz) at which curves are compared.
SPACING = 0.25
#: Share of an interval in which there must be antiphase motion to be compared.
COVERED = 0.9
#: Standard errors by which a comparison may be wrong; shares of frequencies at which it must be right, and surely so.
SIGMAS, RIGHT, SURE = 2.0, 0.9, 0.5
#: Relative differences up to which amplitudes count as the same and as almost the same.
SAME, ALMOST = 0.01, 0.02
#: What the paper calls small: 5 %.
SMALL = 0.05


def _frequencies(claim: Claim) -> FloatArray:
    low, high = claim["f"]
    return np.arange(low + EDGE, high - EDGE + 1e-9, SPACING)


def _amplitude(evidence: Evidence, key: Key, at: FloatArray) -> Curve:
    return evidence.curve(key, "rms_y_m", at)


def _over(a: Curve, b: Curve) -> Curve:
    """Return the ratio of two independent curves."""
    ratio = a.values / b.values
    return Curve(ratio, np.abs(ratio) * np.hypot(a.errors / a.values, b.errors / b.values))


def _compared(ratio: Curve, at: FloatArray, low: float, high: float, text: str) -> Finding:
    """Judge whether a ratio lies between two values at all frequencies at which it is known."""
    known = np.isfinite(ratio.values)
    if not known.any():
        return Finding("no steady antiphase motion in the interval", False, 0.0)
    values, errors, f = ratio.values[known], SIGMAS * ratio.errors[known], at[known]
    right = (low <= values) & (values <= high)
    violated = (values + errors < low) | (values - errors > high) | (~right & (errors == 0.0))
    undecided = ~violated & ((values - errors < low) | (values + errors > high))
    share, covered = float(right.mean()), float(known.mean())
    measured = f"{text} at {share:.0%} of {known.sum()} frequencies, ratio {values.min():.3f} … {values.max():.3f}"
    if violated.any():
        measured += f", not at {interval(f[violated].min(), f[violated].max())}"
    if undecided.any():
        measured += f", {undecided.sum()} undecided by their error"
    if covered < COVERED:
        measured += f"; antiphase motion in {covered:.0%} of the interval only"
    sure = float((right & ~undecided).mean())
    holds = not violated.any() and share >= RIGHT and sure >= SURE and covered >= COVERED
    return Finding(measured, bool(holds), share * covered)


def _ordered(at: FloatArray, lower: Curve, upper: Curve, text: str) -> Finding:
    """Judge whether the second curve lies above the first."""
    return _compared(_over(upper, lower), at, np.nextafter(1.0, 2.0), np.inf, text)


def over_mass(sign: int) -> Judge:
    """Return a judge of whether amplitudes rise (+1) or fall (−1) with mass."""

    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        curves = [_amplitude(evidence, Key(mu), at) for mu in (0.0, 0.1, 0.2)][::sign]
        names = ["μ 0 and 0.1", "μ 0.1 and 0.2"][::sign]
        word = "rises" if sign > 0 else "falls"
        pairs = zip(names, pairwise(curves), strict=True)
        return joined({name: _ordered(at, lower, upper, word) for name, (lower, upper) in pairs})

    return judged


def ratio_to_inelastic(low: float, high: float, text: str) -> Judge:
    """Return a judge of whether amplitudes at R > 0 over those at R = 0, and their mean, lie between two ratios."""

    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        base = _amplitude(evidence, Key(claim["mu"]), at)
        findings = {}
        for key in restitutions(evidence, claim["mu"]):
            if 0.0 < key.restitution <= max(claim["R"]):
                ratio = _over(_amplitude(evidence, key, at), base)
                findings[name_of(key)] = _ratio(ratio, at, (low, high), text)
        return joined(findings) if findings else Finding("no branches with R > 0", False, 0.0)

    return judged


def _ratio(ratio: Curve, at: FloatArray, band: tuple[float, float], text: str) -> Finding:
    found = _compared(ratio, at, *band, text)
    if not np.isfinite(ratio.values).any():
        return found
    mean, error = _mean(ratio)
    holds = found.holds and band[0] - SIGMAS * error <= mean <= band[1] + SIGMAS * error
    return found._replace(measured=f"{found.measured}, mean {mean - 1.0:+.1%}", holds=holds)


def restitution_without_effect(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether amplitudes and periods are the same for all R; undecided points are left out."""
    amplitude = ratio_to_inelastic(1.0 - SAME, 1.0 + SAME, "amplitude within 1 %")(claim, evidence)
    low, high = claim["f"]
    characters = {
        key.restitution: {
            row[SUPPLY]: row["period"] for row in evidence.rows(key, low + EDGE, high - EDGE) if _decided(row)
        }
        for key in restitutions(evidence, claim["mu"])
    }
    reference = characters.pop(0.0, {})
    same = {
        r: float(np.mean([reference[s] == n for s, n in found.items() if s in reference] or [0.0]))
        for r, found in characters.items()
    }
    text = "; ".join(f"R {r:g}: {share:.0%}" for r, share in same.items())
    share = float(np.mean(list(same.values()))) if same else 0.0
    return Finding(
        f"{amplitude.measured}; period as at R = 0: {text}",
        amplitude.holds and share == 1.0,
        0.5 * (amplitude.score + share),
    )


def _decided(row: Row) -> bool:
    return bool(row["motion"] != "undecided")


def impact_above(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the amplitude of the impact model is larger than that of the non-impact model."""
    at = _frequencies(claim)
    impact, viscous = _both_models(claim, evidence, at)
    return _ordered(at, viscous, impact, "A_impact > A_nonimpact")


def non_impact_above(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the amplitude of the non-impact model is larger than that of the impact model.

    This contradicts growth of amplitudes with mass (``amp-rise``) from 26 to 27.5 Hz, where both are claimed. In steady
    antiphase the forces of both exciters add along y. Without impacts y is then that of a linear oscillator of mass M:
    A = 2 m_r r ω²/√((c_y − Mω²)² + ω²(b_y + βm_w)²). At a given ω this falls with β ≥ 0, so A_NI ≤ A(μ = 0), and
    A_I < A_NI implies A_I(μ) < A(μ = 0). Only β < 0, or a share of m_w that moves with the platform, would change this.
    """
    at = _frequencies(claim)
    impact, viscous = _both_models(claim, evidence, at)
    return _ordered(at, impact, viscous, "A_nonimpact > A_impact")


def _both_models(claim: Claim, evidence: Evidence, at: FloatArray) -> tuple[Curve, Curve]:
    mu = claim["mu"]
    return _amplitude(evidence, Key(mu), at), _amplitude(evidence, Key(mu, model="non-impact"), at)


def non_impact_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the non-impact amplitude is larger above resonance, and the ratio grows with R."""
    at = _frequencies(claim)
    viscous = _amplitude(evidence, Key(claim["mu"], model="non-impact"), at)
    impact = {r: _amplitude(evidence, Key(claim["mu"], r), at) for r in claim["R"]}
    larger = joined({f"R {r:g}": _ordered(at, a, viscous, "A_nonimpact > A_impact") for r, a in impact.items()})
    means = [_mean(_over(viscous, a)) for a in impact.values()]
    grows = all(b - a > SIGMAS * float(np.hypot(i, j)) for (a, i), (b, j) in pairwise(means))
    text = f"{larger.measured}; mean ratio " + " → ".join(
        f"{mean:.3f}" + (f" ± {error:.1g}" if error else "") for mean, error in means
    )
    return Finding(text, larger.holds and grows, 0.7 * larger.score + 0.3 * grows)


def _mean(ratio: Curve) -> tuple[float, float]:
    """Return the mean of a ratio over the frequencies at which it is known, and its standard error."""
    known = np.isfinite(ratio.values)
    if not known.any():
        return np.nan, np.nan
    return float(ratio.values[known].mean()), float(np.linalg.norm(ratio.errors[known]) / known.sum())


def non_impact_shape(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether impact motion is non-periodic and non-impact motion harmonic: A = √2 RMS within 2 %."""
    f = claim["f"][0]
    mu = claim["mu"]
    impact = _nearest(evidence.rows(Key(mu)), f)
    viscous = _nearest(evidence.rows(Key(mu, model="non-impact")), f)
    if impact is None or viscous is None:
        return Finding("30.7 Hz is not reached", False, 0.0)
    crest = viscous["amplitude_y_m"] / (np.sqrt(2.0) * viscous["rms_y_m"])
    harmonic = bool(viscous["period"] == 1 and abs(crest - 1.0) < 0.02)
    irregular = REGIMES["non-periodic"](impact)
    text = f"impact at {impact[F]:.2f} Hz: {_period(impact)}; non-impact at {viscous[F]:.2f} Hz: {_period(viscous)}, "
    text += f"A/(√2 RMS) = {crest:.4f}"
    return Finding(text, harmonic and irregular, 0.5 * (harmonic + irregular))


def _nearest(rows: list[Row], f: float) -> Row | None:
    near = [row for row in rows if abs(row[F] - f) <= EDGE and row["sync"] == "antiphase"]
    return min(near, key=lambda row: abs(row[F] - f)) if near else None


def _period(row: Row) -> str:
    return f"period {row['period']}" if row["period"] else str(row["motion"])
