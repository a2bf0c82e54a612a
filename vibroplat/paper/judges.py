"""Judges of the paper's claims about regimes, boundaries between them, and amplitudes over frequency.

A comparison of amplitudes holds if it is wrong by more than SIGMAS standard errors at no frequency, right at a fraction
MIN_RIGHT of the frequencies, and right by more than its error at a fraction MIN_SURE of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config import digits
from vibroplat.config.digits import interval, number, quantity
from vibroplat.model.parameters import FloatArray
from vibroplat.paper.evidence import (
    EDGE,
    IMPACT_CURVE,
    MOTIONS,
    NON_IMPACT_CURVE,
    REGIMES,
    Evidence,
    F,
    PaperCurve,
    Row,
    error_of,
)
from vibroplat.paper.root_finding import JUMP_WIDTH, WIDTH
from vibroplat.study.branches import SUPPLY

#: Minimum change of frequency (Hz) at a jump, and smallest fraction by which RMS y falls there.
MIN_JUMP, MIN_FALL = 0.1, 0.2
#: Largest shift of the jump to the left (Hz) that counts as slight.
MAX_SLIGHT_SHIFT = 1.0
#: Spacing of frequencies (Hz) at which curves are compared.
SPACING = 0.25
#: Fraction of an interval in which there must be antiphase motion to be compared.
MIN_COVERED = 0.9
#: Standard errors by which a comparison may be wrong; fractions at which it must be right, and surely so.
SIGMAS, MIN_RIGHT, MIN_SURE = 2.0, 0.9, 0.5

Claim = Mapping[str, Any]


class Finding(NamedTuple):
    """What was found for a claim.

    Attributes
    ----------
    measured
        In words.
    holds, score
        Whether it holds, and how close it is, from 0 to 1.
    margin, unit
        How far it is from where the verdict changes: above 0 if the claim holds; nan if it fails by something else.
    judged
        False if it does not hold for the sole reason that points at R = 1 failed.
    """

    measured: str
    holds: bool = False
    score: float = 0.0
    margin: float = math.nan
    unit: str = "Hz"
    judged: bool = True


def as_list(value: Any) -> list[float]:
    """Return a value of a claim as a list."""
    return list(value) if isinstance(value, Sequence) else [value]


def _curves_of(claim: Claim) -> list[PaperCurve]:
    """Return the curves of a claim, from its mass ratios and restitutions."""
    return [PaperCurve(mu, r) for mu in as_list(claim.get("mu", 0.0)) for r in as_list(claim.get("R", 0.0))]


def _join_findings(findings: Mapping[str, Finding]) -> Finding:
    """Join the findings of several branches; all must hold."""
    if len(findings) == 1:
        return next(iter(findings.values()))
    text = "; ".join(f"{name}: {finding.measured}" for name, finding in findings.items())
    of = list(findings.values())
    least = min(of, key=lambda f: f.margin if math.isfinite(f.margin) else math.inf)
    return Finding(text, all(f.holds for f in of), float(np.mean([f.score for f in of])), least.margin, least.unit)


def _closeness(off: float, tolerance: float) -> float:
    """Return 1 up to a tolerance; the value falls to 0 at four times the tolerance."""
    return float(np.clip((4.0 - off / tolerance) / 3.0, 0.0, 1.0))


# -- regimes and their boundaries -------------------------------------------------------------------------


def band(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether a regime holds at all points in a band, and whether the points of all branches reach its ends."""
    return _join_findings({curve.text: _band_of(claim, evidence, curve) for curve in _curves_of(claim)})


def _band_of(claim: Claim, evidence: Evidence, curve: PaperCurve) -> Finding:
    (low, high), regime = claim["f"], claim["regime"]
    margin = EDGE if low < high else -EDGE  # a single frequency stands for those around it
    rows = _with_boundary(evidence, curve, regime, low - EDGE)
    inside = [row for row in rows if low + margin <= row[F] <= high - margin]
    stretches = regime_intervals([row for row in rows if low - 1.0 <= row[F] <= high + 1.0], regime)
    text = f"{regime} {', '.join(interval(*run, 'Hz') for run in stretches) or 'nowhere'}; "
    if not inside:
        return Finding(f"{text}no steady motion in the band")
    fraction = float(np.mean([REGIMES[regime](row) for row in inside]))
    text += f"{digits.percent(fraction)} of {len(inside)} points in the band"
    undecided = sum(row["motion"] == "undecided" for row in inside) if regime in MOTIONS else 0
    if undecided:
        text += f", {undecided} undecided"
    frequencies = [row[F] for row in rows if low - EDGE <= row[F] <= high + EDGE]
    reached = low == high or (min(frequencies) <= low + EDGE and max(frequencies) >= high - EDGE)
    if not reached:
        text += f"; points only {interval(min(frequencies), max(frequencies), 'Hz')}"
    off = [max(low + margin - row[F], row[F] - high + margin) for row in rows if not REGIMES[regime](row)]
    ends = [low + EDGE - min(frequencies), max(frequencies) - high + EDGE] if low < high else []
    holds = fraction == 1.0 and reached
    return Finding(text, holds, fraction * (1.0 if reached else 0.7), min(off + ends, default=math.nan))


def regime_intervals(rows: Sequence[Row], regime: str) -> list[tuple[float, float]]:
    """Return the first and last excitation frequency (Hz) of each stretch of rows in a regime."""
    stretches = [[row[F] for row in rows] for holds, rows in groupby(rows, REGIMES[regime]) if holds]
    return [(frequencies[0], frequencies[-1]) for frequencies in stretches]


def _with_boundary(evidence: Evidence, curve: PaperCurve, regime: str, low: float) -> list[Row]:
    """Return the rows of a branch and those next to the end of a regime, in the order of frequency."""
    rows = evidence.rows(curve)
    rows += [row for row in evidence.end_of(curve, regime, low) or () if row not in rows]
    return sorted(rows, key=lambda row: float(row[F]))


def second_resonance(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where antiphase rotation ends, and whether frequency and amplitude jump there."""
    jump = evidence.jump(PaperCurve(claim["mu"]))
    if jump is None:
        return Finding("antiphase does not end up to 40 Hz")
    before, after = jump
    off = abs(before[F] - claim["f"])
    ratio = after["rms_y_m"] / before["rms_y_m"]
    jumps = after[F] - before[F] > MIN_JUMP and ratio < 1.0 - MIN_FALL
    phases = " → ".join(number(abs(row["phase_difference_rad"])) for row in jump)
    text = f"{jump.text} at supply {quantity(after[SUPPLY], 'Hz')}, RMS y × {number(ratio, 2)}, Δφ {phases}"
    score = _closeness(off, claim["tol"]) * (1.0 if jumps else 0.5)
    margin = min(claim["tol"] - off, after[F] - before[F] - MIN_JUMP)
    return Finding(text, off <= claim["tol"] and jumps, score, margin)


def jump_left(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether material lowers the frequency of the jump slightly, but by more than its error."""
    jumps = {mu: evidence.jump(PaperCurve(mu)) for mu in (0.0, *claim["mu"])}
    rows = {mu: jump.before for mu, jump in jumps.items() if jump}
    if len(rows) < len(jumps):
        return Finding("antiphase does not end for every μ")
    bare = rows.pop(0.0)
    shifts = {mu: row[F] - bare[F] for mu, row in rows.items()}
    margin = min(min(-0.5 * JUMP_WIDTH - f, f + MAX_SLIGHT_SHIFT) for f in shifts.values())
    holds = [-MAX_SLIGHT_SHIFT <= f < -0.5 * JUMP_WIDTH for f in shifts.values()]
    texts = [f"μ {mu:g}: {f:+.3f} Hz" for mu, f in shifts.items()]
    return Finding("; ".join([f"μ 0: {quantity(bare[F], 'Hz')}", *texts]), all(holds), float(np.mean(holds)), margin)


def same_bands(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether antiphase rotation ends and begins again at the same frequencies, within EDGE.

    Branches with several μ are compared with the one without material, those with several R with each other.
    """
    over_mass = isinstance(claim["mu"], Sequence)
    curves = [PaperCurve(0.0), *_curves_of(claim)] if over_mass else evidence.restitutions(claim["mu"])
    bands = {}
    for curve in curves:
        end, start = evidence.jump(curve), evidence.end_of(curve, "in-phase", 31.0)
        if end is not None and start is not None:
            bands[curve] = (float(end.before[F]), float(start.after[F]))
    if len(bands) < max(len(curves), 2):
        missing = ", ".join(curve.text for curve in curves if curve not in bands) or "one branch or none"
        return Finding(f"antiphase does not end and begin again: {missing}")
    ends = np.array(list(bands.values()))
    off = float(np.max(abs(ends - ends[0]) if over_mass else np.ptp(ends, axis=0)))
    texts = {curve.text: [quantity(f, "Hz") for f in ends] for curve, ends in bands.items()}
    text = "; ".join(f"{name}: up to {a}, again from {b}" for name, (a, b) in texts.items())
    return Finding(text, off <= EDGE, _closeness(off, EDGE), EDGE - off)


def attached_until(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion is attached from one frequency up to another, and liftoff is neither earlier nor later."""
    curve, begin = PaperCurve(claim["mu"], claim["R"]), claim["from"]
    rows = evidence.rows(curve, begin - EDGE)
    end = evidence.end_of(curve, "attached", begin - EDGE)
    if not rows or rows[0][F] > begin + EDGE or not REGIMES["attached"](rows[0]):
        return Finding(f"not attached at {begin:g} Hz")
    if end is None:
        return Finding(f"attached {interval(rows[0][F], rows[-1][F], 'Hz')}, never left")
    off = abs(end.middle - claim["f"])
    tolerance = claim["tol"]
    return Finding(f"attached up to {end.text}", off <= tolerance, _closeness(off, tolerance), tolerance - off)


def non_periodic_from(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where motion stops being periodic, and whether it stays non-periodic up to the jump."""
    curve = PaperCurve(claim["mu"], claim["R"])
    end = evidence.end_of(curve, "periodic", 20.0)
    if end is None:
        return Finding("periodic everywhere, or nowhere")
    rows = evidence.rows(curve, end.middle + EDGE, 31.0)
    fraction = float(np.mean([REGIMES["non-periodic"](row) for row in rows])) if rows else 0.0
    off = abs(end.middle - claim["f"])
    text = f"periodic up to {end.text}, then non-periodic at {digits.percent(fraction)} of points up to 31 Hz"
    score = 0.5 * (_closeness(off, claim["tol"]) + fraction)
    return Finding(text, off <= claim["tol"] and fraction == 1.0, score, claim["tol"] - off)


def non_periodic_earlier(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion below the jump stops being periodic at a lower frequency for each larger R.

    Frequencies must differ by more than their error, half of WIDTH.
    """
    starts = {}
    for curve in _curves_of(claim):
        if curve in evidence.branches:
            end = evidence.end_of(curve, "periodic", 20.0)
            starts[curve.restitution] = end.middle if end and end.before[F] <= 31.0 else math.inf
    falls = [a - b - 0.5 * WIDTH for a, b in pairwise(starts.values()) if math.isfinite(b)]
    fraction = sum(fall > 0.0 for fall in falls) / max(len(starts) - 1, 1)
    text = f"non-periodic from: {_by_restitution(starts, 'nowhere') or 'no branches'}"
    return Finding(text, fraction == 1.0, fraction, min(falls, default=math.nan))


def periodic_from_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequency from which over-resonant motion is period-1 up to its end rises with R."""
    starts = {}
    for curve in evidence.restitutions(claim["mu"]):
        start, rows = evidence.start_of_last(curve, "period-1"), evidence.rows(curve)
        first = rows[0] if rows and REGIMES["period-1"](rows[-1]) else {F: math.inf}
        starts[curve.restitution] = float((start.after if start else first)[F])
    values = list(starts.values())
    finite = sum(map(math.isfinite, values))
    rises = [b - a - 0.5 * WIDTH for a, b in pairwise(values) if math.isfinite(b)]
    holds = finite > 1 and all(rise > 0.0 for rise in rises)
    text = f"period-1 from: {_by_restitution(starts, 'nowhere up to 40 Hz')}"
    score = finite / max(len(values), 1) * (1.0 if holds else 0.5)
    return Finding(text, holds, score, min(rises, default=math.nan))


def _by_restitution(starts: Mapping[float, float], nowhere: str) -> str:
    return "; ".join(f"R {r:g}: " + (nowhere if math.isinf(f) else quantity(f, "Hz")) for r, f in starts.items())


def deviation(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether Δφ departs from π, and x and φ begin to vibrate, close to the jump."""
    curve = PaperCurve(claim["mu"])
    end = evidence.jump(curve)
    if end is None:
        return Finding("antiphase does not end")
    last = end.before[F]
    rows = _with_boundary(evidence, curve, "antiphase", 20.0)
    far, near = ([r for r in rows if a <= r[F] <= b] for a, b in ((25.0, min(29.0, last)), (last - 0.5, last)))
    if not far or not near:
        return Finding("no steady motion near 31 Hz")
    away, close = (max(np.pi - abs(r["phase_difference_rad"]) for r in part) for part in (far, near))
    x, phi = (max(r[c] for r in near) / max(1e-15, *(r[c] for r in far)) for c in ("rms_x_m", "rms_phi_rad"))
    text = (
        f"|Δφ − π| {quantity(away, 'rad', digits=2)} at 25 … 29 Hz, {quantity(close, 'rad', digits=2)} within 0.5 Hz "
        f"of the jump at {quantity(last, 'Hz')}; RMS x × {number(x, 2)} to "
        f"{quantity(max(r['rms_x_m'] for r in near), 'm', digits=2)}, RMS φ × {number(phi, 2)}"
    )
    holds = close > 0.02 and close > 5.0 * away and min(x, phi) > 5.0
    margin = min(close - 0.02, close - 5.0 * away)
    return Finding(text, bool(holds), float(np.clip(close / 0.02, 0.0, 1.0)), margin, "rad")


# -- amplitudes -------------------------------------------------------------------------------------------


class _Ratio(NamedTuple):
    """The ratio of two independent curves in a claim's interval, where both are known.

    Attributes
    ----------
    f, values, errors
        Frequencies (Hz), ratios and their standard errors, shape (n,).
    covered
        Fraction of the interval in which both are known.
    """

    f: FloatArray
    values: FloatArray
    errors: FloatArray
    covered: float

    @property
    def mean(self) -> tuple[float, float]:
        """The mean and its standard error."""
        if not len(self.f):
            return math.nan, math.nan
        return float(self.values.mean()), float(np.linalg.norm(self.errors) / len(self.f))


def _ratio(claim: Claim, evidence: Evidence, upper: PaperCurve, lower: PaperCurve) -> _Ratio:
    at = np.arange(claim["f"][0] + EDGE, claim["f"][1] - EDGE + 1e-9, SPACING)
    (x, dx), (y, dy) = evidence.amplitudes(upper, at), evidence.amplitudes(lower, at)
    values, known = x / y, np.isfinite(x / y)
    errors = np.abs(values) * np.hypot(dx / x, dy / y)
    return _Ratio(at[known], values[known], errors[known], float(known.mean()))


def _between(ratio: _Ratio, text: str, low: float = np.nextafter(1.0, 2.0), high: float = np.inf) -> Finding:
    """Judge whether a ratio lies between two values, or is larger than 1, at all frequencies at which it is known."""
    if not len(ratio.f):
        return Finding("no steady antiphase motion in the interval")
    values, errors = ratio.values, SIGMAS * ratio.errors
    right = (low <= values) & (values <= high)
    violated = (values + errors < low) | (values - errors > high) | (~right & (errors == 0.0))
    undecided = ~violated & ((values - errors < low) | (values + errors > high))
    fraction = float(right.mean())
    measured = f"{text} at {digits.percent(fraction)} of {len(values)} frequencies, ratio "
    measured += interval(values.min(), values.max())
    if violated.any():
        measured += f", not at {interval(ratio.f[violated].min(), ratio.f[violated].max(), 'Hz')}"
    if undecided.any():
        measured += f", {undecided.sum()} undecided by their error"
    if ratio.covered < MIN_COVERED:
        measured += f"; antiphase motion in {ratio.covered:.0%} of the interval only"
    sure = float((right & ~undecided).mean())
    holds = not violated.any() and fraction >= MIN_RIGHT and sure >= MIN_SURE and ratio.covered >= MIN_COVERED
    margin = 100.0 * float(np.minimum(values + errors - low, high - values + errors).min())
    return Finding(measured, bool(holds), fraction * ratio.covered, margin, "%")


def in_order(text: str, pairs: Sequence[tuple[PaperCurve, PaperCurve]], claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether, in each pair of branches, the second has the larger amplitude."""
    findings = {}
    for pair in pairs:
        masses = sorted({curve.mass_ratio for curve in pair})
        name = f"μ {' and '.join(f'{mass:g}' for mass in masses)}"
        findings[name] = _between(_ratio(claim, evidence, pair[1], pair[0]), text)
    return _join_findings(findings)


def ratio_to_inelastic(text: str, low: float, high: float, claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether amplitudes at R > 0 over those at R = 0, and their mean, lie between two ratios."""
    findings = {}
    for curve in evidence.restitutions(claim["mu"]):
        if 0.0 < curve.restitution <= max(claim["R"]):
            ratio = _ratio(claim, evidence, curve, PaperCurve(claim["mu"]))
            finding, (mean, error) = _between(ratio, text, low, high), ratio.mean
            if math.isfinite(mean):
                holds = finding.holds and low - SIGMAS * error <= mean <= high + SIGMAS * error
                finding = finding._replace(measured=f"{finding.measured}, mean {mean - 1.0:+.1%}", holds=holds)
            findings[curve.text] = finding
    return _join_findings(findings) if findings else Finding("no branches with R > 0")


def restitution_without_effect(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether amplitudes and periods are the same for all R; undecided points are left out."""
    amplitude = ratio_to_inelastic("amplitude within 1 %", 0.99, 1.01, claim, evidence)
    low, high = claim["f"]
    periods = {}
    for curve in evidence.restitutions(claim["mu"]):
        rows = evidence.rows(curve, low + EDGE, high - EDGE, decided="periodic")
        periods[curve.restitution] = {row[SUPPLY]: row["period"] for row in rows}
    reference = periods.pop(0.0, {})
    same = {}
    for r, counts in periods.items():
        same[r] = float(
            np.mean([reference[supply] == n for supply, n in counts.items() if supply in reference] or [0.0])
        )
    fraction = float(np.mean(list(same.values()))) if same else 0.0
    alike = "; ".join(f"R {r:g}: {digits.percent(part)}" for r, part in same.items())
    text = f"{amplitude.measured}; period as at R = 0: {alike}"
    score = 0.5 * (amplitude.score + fraction)
    return Finding(text, amplitude.holds and fraction == 1.0, score, amplitude.margin, "%")


def non_impact_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the non-impact amplitude is larger above resonance, and the ratio grows with R."""
    ratios = {r: _ratio(claim, evidence, NON_IMPACT_CURVE, PaperCurve(claim["mu"], r)) for r in claim["R"]}
    larger = _join_findings({f"R {r:g}": _between(ratio, "A_nonimpact > A_impact") for r, ratio in ratios.items()})
    means = [ratio.mean for ratio in ratios.values()]
    growth = [b - a - SIGMAS * float(np.hypot(i, j)) for (a, i), (b, j) in pairwise(means)]
    grows = all(part > 0.0 for part in growth)
    text = " → ".join((digits.spread(mean, error, "") if error else number(mean)) for mean, error in means)
    score = 0.7 * larger.score + 0.3 * grows
    margin = min(larger.margin, *(100.0 * part for part in growth))
    return Finding(f"{larger.measured}; mean ratio {text}", larger.holds and grows, score, margin, "%")


def non_impact_shape(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether impact motion is non-periodic and non-impact motion harmonic: A = √2 RMS within 2 %."""
    nearest = []
    for curve in (IMPACT_CURVE, NON_IMPACT_CURVE):
        rows = [row for row in evidence.rows(curve) if row["sync"] == "antiphase"]
        row = min(rows, key=lambda row: abs(row[F] - claim["f"][0]), default=None)
        if row is None or abs(row[F] - claim["f"][0]) > EDGE:
            return Finding("30.7 Hz is not reached")
        period = f"period {row['period']}" if row["period"] else row["motion"]
        nearest.append((row, f"{quantity(row[F], 'Hz')}: {period}"))
    (impact, its), (viscous, other) = nearest
    crest = viscous["amplitude_y_m"] / (np.sqrt(2.0) * viscous["rms_y_m"])
    harmonic = bool(viscous["period"] == 1 and abs(crest - 1.0) < 0.02)
    irregular = REGIMES["non-periodic"](impact)
    text = f"impact at {its}; non-impact at {other}, A/(√2 RMS) = {number(crest, 4)}"
    return Finding(text, harmonic and irregular, 0.5 * (harmonic + irregular), 2.0 - 100.0 * abs(crest - 1.0), "%")


# -- numbers in the paper's text --------------------------------------------------------------------------


def quoted_frequencies(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequencies that the paper quotes are points of its own steps of supply frequency.

    Each must be that of a point of antiphase motion on the curve with R = 0, within the tolerance of the claim and, if
    the motion is not periodic, two standard errors.
    """
    rows = [row for row in evidence.rows(PaperCurve(claim["mu"])) if row["sync"] == "antiphase"]
    points = [(float(row[F]), error_of(row, F)) for row in rows]
    nearby, margins = [], []
    for f, tolerance in claim["quoted"]:
        nearest, error = min(points, key=lambda point: abs(point[0] - f), default=(0.0, 0.0))
        margins.append(tolerance + 2.0 * error - abs(nearest - f))
        nearby.append(f"{f:g}: {quantity(nearest, 'Hz')}")
    hits = [margin >= 0.0 for margin in margins]
    return Finding(f"nearest points {', '.join(nearby)}", all(hits), float(np.mean(hits)), min(margins))


def layer_damping(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the damping between the layers is subcritical, but excludes intensive relative vibration.

    The damping ratio is ζ = b_w/(2√(c_w m_w2)), that of the upper layer on a lower one in contact. If the lower layer
    moves harmonically, the upper one moves relative to it by at most 1/(2ζ√(1 − ζ²)) of its amplitude (ζ < 1/√2), which
    is 1.15 for ζ = 1/2. More counts as intensive; ζ < 1 is subcritical. In flight, with both layers free, the ratio is
    ζ√(1 + m_w2/m_w1); it is reported, not judged.
    """
    records = evidence.branches.get(PaperCurve(claim["mu"]))
    if records is None or records.branch.scene.layers < 2:
        return Finding("no two layers")
    material, (stiffness, damping) = records.branch.scene.material, records.branch.scene.layer_spring
    ratio = material.damping_ratio or damping / (2.0 * math.sqrt(stiffness))
    low, high = claim["ratio"]
    text = f"damping ratio {number(ratio)}, {number(ratio / math.sqrt(material.lower_share))} in flight"
    score = min(ratio / low, high / ratio, 1.0) if ratio > 0.0 else 0.0
    return Finding(text, low <= ratio < high, score, min(ratio - low, high - ratio), "")
