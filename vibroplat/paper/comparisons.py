"""Judges of claims about amplitudes, which compare curves over frequency with each other, and about quoted numbers.

Measures of non-periodic motion have standard errors. A comparison is violated at a frequency if it is wrong by more
than SIGMAS standard errors. It holds if it is violated nowhere, is right at a share RIGHT of the frequencies, and right
by more than its error at a share SURE of them.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from vibroplat.model.parameters import FloatArray
from vibroplat.paper.evidence import (
    EDGE,
    IMPACT_KEY,
    NON_IMPACT_KEY,
    REGIMES,
    Claim,
    Curve,
    Evidence,
    F,
    Finding,
    Judge,
    Key,
    error_of,
    interval,
    joined,
    name_of,
)
from vibroplat.study.branches import SUPPLY

#: Spacing of frequencies (Hz) at which curves are compared.
SPACING = 0.25
#: Share of an interval in which there must be antiphase motion to be compared.
COVERED = 0.9
#: Standard errors by which a comparison may be wrong; shares of frequencies at which it must be right, and surely so.
SIGMAS, RIGHT, SURE = 2.0, 0.9, 0.5


def ordered(text: str, *pairs: tuple[Key, Key]) -> Judge:
    """Return a judge of whether, in each pair of branches, the second has the larger amplitude."""

    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        findings = {}
        for lower, upper in pairs:
            masses = sorted({lower.mass_ratio, upper.mass_ratio})
            ratio = _over(evidence.curve(upper, at), evidence.curve(lower, at))
            findings[f"μ {' and '.join(f'{mass:g}' for mass in masses)}"] = _larger(ratio, at, text)
        return joined(findings)

    return judged


def ratio_to_inelastic(low: float, high: float, text: str) -> Judge:
    """Return a judge of whether amplitudes at R > 0 over those at R = 0, and their mean, lie between two ratios."""

    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        base = evidence.curve(Key(claim["mu"]), at)
        findings = {}
        for key in evidence.restitutions(claim["mu"]):
            if 0.0 < key.restitution <= max(claim["R"]):
                ratio = _over(evidence.curve(key, at), base)
                found = _between(ratio, at, low, high, text)
                if np.isfinite(ratio[0]).any():
                    mean, error = _mean(ratio)
                    holds = found.holds and low - SIGMAS * error <= mean <= high + SIGMAS * error
                    found = found._replace(measured=f"{found.measured}, mean {mean - 1.0:+.1%}", holds=holds)
                findings[name_of(key)] = found
        return joined(findings) if findings else Finding("no branches with R > 0", False, 0.0)

    return judged


def _frequencies(claim: Claim) -> FloatArray:
    low, high = claim["f"]
    return np.arange(low + EDGE, high - EDGE + 1e-9, SPACING)


def _over(a: Curve, b: Curve) -> Curve:
    """Return the ratio of two independent curves."""
    (x, dx), (y, dy) = a, b
    return x / y, np.abs(x / y) * np.hypot(dx / x, dy / y)


def _larger(ratio: Curve, at: FloatArray, text: str) -> Finding:
    return _between(ratio, at, np.nextafter(1.0, 2.0), np.inf, text)


def _between(ratio: Curve, at: FloatArray, low: float, high: float, text: str) -> Finding:
    """Judge whether a ratio lies between two values at all frequencies at which it is known."""
    known = np.isfinite(ratio[0])
    if not known.any():
        return Finding("no steady antiphase motion in the interval", False, 0.0)
    values, errors, f = ratio[0][known], SIGMAS * ratio[1][known], at[known]
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


def _mean(ratio: Curve) -> tuple[float, float]:
    """Return the mean of a ratio over the frequencies at which it is known, and its standard error."""
    values, errors = ratio
    known = np.isfinite(values)
    if not known.any():
        return np.nan, np.nan
    return float(values[known].mean()), float(np.linalg.norm(errors[known]) / known.sum())


def restitution_without_effect(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether amplitudes and periods are the same for all R; undecided points are left out."""
    amplitude = ratio_to_inelastic(0.99, 1.01, "amplitude within 1 %")(claim, evidence)
    low, high = claim["f"]
    periods = {}
    for key in evidence.restitutions(claim["mu"]):
        decided = [row for row in evidence.rows(key, low + EDGE, high - EDGE) if row["motion"] != "undecided"]
        periods[key.restitution] = {row[SUPPLY]: row["period"] for row in decided}
    reference = periods.pop(0.0, {})
    same = {
        r: float(np.mean([reference[supply] == n for supply, n in found.items() if supply in reference] or [0.0]))
        for r, found in periods.items()
    }
    share = float(np.mean(list(same.values()))) if same else 0.0
    text = f"{amplitude.measured}; period as at R = 0: " + "; ".join(f"R {r:g}: {part:.0%}" for r, part in same.items())
    return Finding(text, amplitude.holds and share == 1.0, 0.5 * (amplitude.score + share))


def non_impact_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the non-impact amplitude is larger above resonance, and the ratio grows with R."""
    at = _frequencies(claim)
    viscous = evidence.curve(NON_IMPACT_KEY, at)
    ratios = {r: _over(viscous, evidence.curve(Key(claim["mu"], r), at)) for r in claim["R"]}
    larger = joined({f"R {r:g}": _larger(ratio, at, "A_nonimpact > A_impact") for r, ratio in ratios.items()})
    means = [_mean(ratio) for ratio in ratios.values()]
    grows = all(b - a > SIGMAS * float(np.hypot(i, j)) for (a, i), (b, j) in pairwise(means))
    texts = (f"{mean:.3f}" + (f" ± {error:.1g}" if error else "") for mean, error in means)
    return Finding(
        f"{larger.measured}; mean ratio {' → '.join(texts)}", larger.holds and grows, 0.7 * larger.score + 0.3 * grows
    )


def non_impact_shape(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether impact motion is non-periodic and non-impact motion harmonic: A = √2 RMS within 2 %."""
    nearest = []
    for key in (IMPACT_KEY, NON_IMPACT_KEY):
        rows = [row for row in evidence.rows(key) if row["sync"] == "antiphase"]
        row = min(rows, key=lambda row: abs(row[F] - claim["f"][0]), default=None)
        if row is None or abs(row[F] - claim["f"][0]) > EDGE:
            return Finding("30.7 Hz is not reached", False, 0.0)
        nearest.append(row)
    impact, viscous = nearest
    crest = viscous["amplitude_y_m"] / (np.sqrt(2.0) * viscous["rms_y_m"])
    harmonic = bool(viscous["period"] == 1 and abs(crest - 1.0) < 0.02)
    irregular = REGIMES["non-periodic"](impact)
    periods = [f"period {row['period']}" if row["period"] else str(row["motion"]) for row in nearest]
    text = f"impact at {impact[F]:.2f} Hz: {periods[0]}; non-impact at {viscous[F]:.2f} Hz: {periods[1]}, "
    text += f"A/(√2 RMS) = {crest:.4f}"
    return Finding(text, harmonic and irregular, 0.5 * (harmonic + irregular))


# -- numbers in the paper's text --------------------------------------------------------------------------


def quoted_frequencies(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequencies that the paper quotes are points of its own steps of supply frequency.

    Each must be that of a point of antiphase motion on the curve with R = 0, within the tolerance of the claim and, if
    the motion is not periodic, two standard errors.
    """
    rows = [row for row in evidence.rows(Key(claim["mu"])) if row["sync"] == "antiphase"]
    points = [(float(row[F]), error_of(row, F)) for row in rows]
    nearby, hits = [], []
    for f, tolerance in claim["quoted"]:
        nearest, error = min(points, key=lambda point: abs(point[0] - f), default=(0.0, 0.0))
        hits.append(abs(nearest - f) <= tolerance + 2.0 * error)
        nearby.append(f"{f:g}: {nearest:.2f} Hz")
    return Finding(f"nearest points {', '.join(nearby)}", all(hits), float(np.mean(hits)))


def layer_damping(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the damping between the layers is subcritical, but excludes intensive relative vibration.

    The damping ratio is ζ = b_w/(2√(c_w m_w2)), that of the upper layer on a lower one in contact. If the lower layer
    moves harmonically, the upper one moves relative to it by at most 1/(2ζ√(1 − ζ²)) of its amplitude (ζ < 1/√2), which
    is 1.15 for ζ = 1/2. More counts as intensive; ζ < 1 is subcritical. In flight, with both layers free, the ratio is
    ζ√(1 + m_w2/m_w1); it is reported, not judged.
    """
    course = evidence.courses.get(Key(claim["mu"]))
    if course is None or course.branch.scene.layers < 2:
        return Finding("no two layers", False, 0.0)
    material, (stiffness, damping) = course.branch.scene.material, course.branch.scene.layer_spring
    ratio = material.damping_ratio or damping / (2.0 * math.sqrt(stiffness))
    low, high = claim["ratio"]
    text = f"damping ratio {ratio:.3g}, {ratio / math.sqrt(material.lower_share):.3g} in flight"
    return Finding(text, low <= ratio < high, min(ratio / low, high / ratio, 1.0) if ratio > 0.0 else 0.0)
