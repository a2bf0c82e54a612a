"""The paper's claims, judged by sweeps.

A claim holds as the paper words it; frequencies may be off by EDGE, half the step of its own curves, which is
also how far the ends of its bands can be told. Scores between 0 and 1 tell calibration how near a claim is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.physics.parameters import FloatArray
from vibroplat.study.branches import SUPPLY
from vibroplat.study.evidence import REGIMES, Boundary, Evidence, F, Key, Row, runs

Claim = Mapping[str, Any]

#: Allowed error of a band's ends (Hz of excitation frequency): the paper's step is 0.5 Hz of supply frequency.
EDGE = 0.25
#: Spacing of frequencies (Hz) at which curves are compared.
SPACING = 0.25
#: Share of an interval in which there must be antiphase motion to compare.
COVERED = 0.9
#: Relative difference of amplitudes that is none.
SAME = 0.01
#: Least change of frequency (Hz) and share by which RMS y falls that make a jump.
LEAST_JUMP, LEAST_FALL = 0.1, 0.2
#: What the paper calls small: 5 %.
SMALL = 0.05


class Finding(NamedTuple):
    """What was measured for a claim, whether it holds, and how nearly."""

    measured: str
    holds: bool
    score: float


def judge(claim: Claim, evidence: Evidence) -> Finding:
    """Judge a claim; one whose branches are missing does not hold. Points that failed are told, not judged."""
    finding = _JUDGES[claim["id"]](claim, evidence)
    involved = [key for key in evidence.courses if key in _keys(claim) and evidence.courses[key].failed]
    if not involved:
        return finding
    failed = ", ".join(f"{evidence.courses[key].failed} at {_name(key)}" for key in involved)
    return finding._replace(measured=f"{finding.measured} (points that failed: {failed})")


def _listed(value: Any) -> list[float]:
    return list(value) if isinstance(value, Sequence) else [value]


def _keys(claim: Claim) -> list[Key]:
    return [Key(mu, r) for mu in _listed(claim.get("mu", 0.0)) for r in _listed(claim.get("R", 0.0))]


def _all(findings: Mapping[str, Finding]) -> Finding:
    """Join findings of several curves: all must hold."""
    if len(findings) == 1:
        return next(iter(findings.values()))
    text = "; ".join(f"{name}: {finding.measured}" for name, finding in findings.items())
    return Finding(text, all(f.holds for f in findings.values()), float(np.mean([f.score for f in findings.values()])))


def _name(key: Key) -> str:
    return f"μ {key.mass_ratio:g}" + (f", R {key.restitution:g}" if key.restitution else "")


# -- bands ------------------------------------------------------------------------------------------------


def _band(claim: Claim, evidence: Evidence) -> Finding:
    return _all({_name(key): _band_of(claim, evidence, key) for key in _keys(claim)})


def _band_of(claim: Claim, evidence: Evidence, key: Key) -> Finding:
    """Judge whether a regime holds at all points of a band, and whether the points reach its ends."""
    low, high = claim["f"]
    regime = claim["regime"]
    edge = 0.0 if low == high else EDGE
    reach = EDGE if low == high else 0.0
    rows = _with_boundary(evidence, key, regime, low - EDGE)
    inside = [row for row in rows if low + edge - reach <= row[F] <= high - edge + reach]
    near = [row for row in rows if low - 1.0 <= row[F] <= high + 1.0]
    told = ", ".join(_interval(*run) for run in runs(near, regime)) or "nowhere"
    if not inside:
        return Finding(f"{regime} {told}; no steady motion in the band", False, 0.0)
    share = float(np.mean([REGIMES[regime](row) for row in inside]))
    frequencies = [row[F] for row in rows if low - EDGE <= row[F] <= high + EDGE]
    reached = low == high or (min(frequencies) <= low + EDGE and max(frequencies) >= high - EDGE)
    short = "" if reached else f"; points only {_interval(min(frequencies), max(frequencies))}"
    text = f"{regime} {told}; {share:.0%} of {len(inside)} points in the band{short}"
    return Finding(text, share == 1.0 and reached, share * (1.0 if reached else 0.7))


def _with_boundary(evidence: Evidence, key: Key, regime: str, low: float) -> list[Row]:
    """Return the rows of a branch with those that narrow the end of a regime, by frequency."""
    rows = list(evidence.rows(key))
    end = evidence.end_of(key, regime, low)
    for row in end or ():
        if row not in rows:
            rows.append(row)
    return sorted(rows, key=lambda row: float(row[F]))


def _interval(low: float, high: float) -> str:
    return f"{low:.2f} … {high:.2f} Hz" if high > low else f"{low:.2f} Hz"


# -- boundaries -------------------------------------------------------------------------------------------


def _jump(evidence: Evidence, key: Key) -> Boundary | None:
    """Return where antiphase rotation below the second resonance ends."""
    return evidence.end_of(key, "antiphase", 20.0)


def _across(boundary: Boundary) -> str:
    return f"{boundary.before[F]:.2f} → {boundary.after[F]:.2f} Hz"


def _second_resonance(claim: Claim, evidence: Evidence) -> Finding:
    found = _jump(evidence, Key(claim["mu"]))
    if found is None:
        return Finding("antiphase is not left up to 40 Hz", False, 0.0)
    off = abs(found.before[F] - claim["f"])
    ratio = found.after["rms_y_m"] / found.before["rms_y_m"]
    jumps = found.after[F] - found.before[F] > LEAST_JUMP and ratio < 1.0 - LEAST_FALL
    supply = found.after[SUPPLY]
    text = f"{_across(found)} at supply {supply:.2f} Hz, RMS y × {ratio:.2g}, Δφ {_phases(found)}"
    return Finding(text, off <= claim["tol"] and jumps, _closeness(off, claim["tol"]) * (1.0 if jumps else 0.5))


def _phases(found: Boundary) -> str:
    return " → ".join(f"{abs(row['phase_difference_rad']):.2f}" for row in found)


def _closeness(off: float, tolerance: float) -> float:
    """Return 1 within a tolerance, falling to 0 at four times it."""
    return float(np.clip((4.0 - off / tolerance) / 3.0, 0.0, 1.0))


def _jump_over_mass(claim: Claim, evidence: Evidence) -> Finding:
    """Judge the jump's place against that without material: unchanged within EDGE, and not to the right."""
    bare = _jump(evidence, Key(0.0))
    found = {mu: _jump(evidence, Key(mu)) for mu in claim["mu"]}
    if bare is None or any(b is None for b in found.values()):
        return Finding("antiphase is not left for every μ", False, 0.0)
    supply = {mu: b.before[SUPPLY] - bare.before[SUPPLY] for mu, b in found.items() if b}
    shifts = {mu: b.before[F] - bare.before[F] for mu, b in found.items() if b}
    text = f"μ 0: {bare.before[F]:.2f} Hz; " + "; ".join(
        f"μ {mu:g}: {shift:+.2f} Hz (supply {supply[mu]:+.2f} Hz)" for mu, shift in shifts.items()
    )
    near = all(abs(shift) <= EDGE for shift in shifts.values())
    left = all(shift <= 0.05 for shift in supply.values())
    return Finding(text, near and left, (near + left) / 2.0)


def _bands_over_restitution(claim: Claim, evidence: Evidence) -> Finding:
    """Judge both ends of antiphase rotation over R: equal within EDGE."""
    mu = claim["mu"]
    keys = _restitutions(evidence, mu)
    ends = {key.restitution: _jump(evidence, key) for key in keys}
    starts = {key.restitution: evidence.end_of(key, "in-phase", 31.0) for key in keys}
    if any(b is None for b in (*ends.values(), *starts.values())) or not keys:
        return Finding("antiphase is not left and entered again for every R", False, 0.0)
    below = {r: float(b.before[F]) for r, b in ends.items() if b}
    above = {r: float(b.after[F]) for r, b in starts.items() if b}
    text = "; ".join(f"R {r:g}: up to {below[r]:.2f}, again from {above[r]:.2f} Hz" for r in below)
    spread = max(np.ptp(list(below.values())), np.ptp(list(above.values())))
    return Finding(text, bool(spread <= EDGE), _closeness(float(spread), EDGE))


def _restitutions(evidence: Evidence, mu: float) -> list[Key]:
    return sorted(k for k in evidence.courses if k == Key(mu, k.restitution))


def _non_periodic_from(claim: Claim, evidence: Evidence) -> Finding:
    found = evidence.end_of(Key(claim["mu"], claim["R"]), "periodic", 20.0)
    if found is None:
        return Finding("periodic everywhere, or nowhere", False, 0.0)
    first = 0.5 * (found.before[F] + found.after[F])
    rows = evidence.rows(Key(claim["mu"], claim["R"]), first + EDGE, 31.0)
    share = float(np.mean([row["period"] == 0 for row in rows])) if rows else 0.0
    off = abs(first - claim["f"])
    text = f"periodic up to {_across(found)}, then non-periodic at {share:.0%} of points up to 31 Hz"
    return Finding(text, off <= claim["tol"] and share == 1.0, 0.5 * (_closeness(off, claim["tol"]) + share))


def _periodic_from_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequency from which over-resonant motion is period-1 rises with R."""
    starts: dict[float, float] = {}
    for key in _restitutions(evidence, claim["mu"]):
        start = evidence.start_of_last(key, "period-1")
        starts[key.restitution] = float(start.after[F]) if start else np.inf
    text = "; ".join(
        f"R {r:g}: " + ("nowhere up to 40 Hz" if np.isinf(f) else f"{f:.2f} Hz") for r, f in starts.items()
    )
    values = list(starts.values())
    finite = [f for f in values if np.isfinite(f)]
    rises = len(values) > 1 and len(finite) > 1 and all(a < b or np.isinf(b) for a, b in pairwise(values))
    return Finding(f"period-1 from: {text}", rises, len(finite) / max(len(values), 1) * (1.0 if rises else 0.5))


# -- ratios and comparisons -------------------------------------------------------------------------------


def _frequencies(claim: Claim) -> FloatArray:
    low, high = claim["f"]
    return np.arange(low + EDGE, high - EDGE + 1e-9, SPACING)


def _amplitude(evidence: Evidence, key: Key, at: FloatArray) -> FloatArray:
    return evidence.curve(key, "rms_y_m", at)


def _ordered(claim: Claim, at: FloatArray, lower: FloatArray, upper: FloatArray, text: str) -> Finding:
    """Judge whether one curve lies below another at all frequencies where both are."""
    known = np.isfinite(lower) & np.isfinite(upper)
    if not known.any():
        return Finding("no steady antiphase motion in the interval", False, 0.0)
    below = lower[known] < upper[known]
    share, covered = float(below.mean()), float(known.mean())
    ratio = upper[known] / lower[known]
    told = f"{text} at {share:.0%} of {known.sum()} frequencies, ratio {ratio.min():.3f} … {ratio.max():.3f}"
    if not below.all():
        told += f", not at {_interval(at[known][~below].min(), at[known][~below].max())}"
    if covered < COVERED:
        told += f"; antiphase motion in {covered:.0%} of the interval only"
    return Finding(told, bool(below.all()) and covered >= COVERED, share * covered)


def _over_mass(sign: int) -> Callable[[Claim, Evidence], Finding]:
    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        curves = [_amplitude(evidence, Key(mu), at) for mu in (0.0, 0.1, 0.2)][::sign]
        names = ["μ 0 and 0.1", "μ 0.1 and 0.2"][::sign]
        word = "rises" if sign > 0 else "falls"
        return _all(
            {
                name: _ordered(claim, at, lower, upper, word)
                for name, (lower, upper) in zip(names, pairwise(curves), strict=True)
            }
        )

    return judged


def _deviation(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether Δφ leaves π, and x and φ begin to vibrate, as the jump is neared."""
    key = Key(claim["mu"])
    end = _jump(evidence, key)
    if end is None:
        return Finding("antiphase is not left", False, 0.0)
    rows = [r for r in _with_boundary(evidence, key, "antiphase", 20.0) if r[F] <= end.before[F]]
    far = [r for r in rows if 25.0 <= r[F] <= 29.0]
    near = [r for r in rows if r[F] >= end.before[F] - 0.5]
    if not far or not near:
        return Finding("no steady motion near 31 Hz", False, 0.0)
    away, close = (max(np.pi - abs(r["phase_difference_rad"]) for r in part) for part in (far, near))
    x, phi = (max(r[c] for r in near) / max(1e-15, *(r[c] for r in far)) for c in ("rms_x_m", "rms_phi_rad"))
    largest = max(r["rms_x_m"] for r in near)
    text = (
        f"|Δφ − π| {away:.2g} rad at 25 … 29 Hz, {close:.2g} rad within 0.5 Hz of the jump at {end.before[F]:.2f} Hz; "
        f"RMS x × {x:.2g} to {1e3 * largest:.2g} mm, RMS φ × {phi:.2g}"
    )
    holds = close > 0.02 and close > 5.0 * away and min(x, phi) > 5.0
    return Finding(text, bool(holds), float(np.clip(close / 0.02, 0.0, 1.0)))


def _ratio_to_inelastic(low: float, high: float, text: str, share: float = 0.9) -> Callable[[Claim, Evidence], Finding]:
    """Judge whether amplitudes at R > 0 over those at R = 0 lie between two ratios: their mean, and a share of them.

    Where the motion is not periodic the ratio scatters, so not all of them can.
    """

    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        base = _amplitude(evidence, Key(claim["mu"]), at)
        findings = {}
        for key in _restitutions(evidence, claim["mu"]):
            if 0.0 < key.restitution <= max(claim["R"]):
                findings[_name(key)] = _ratio(_amplitude(evidence, key, at) / base, (low, high), text, share)
        return _all(findings) if findings else Finding("no branches with R > 0", False, 0.0)

    return judged


def _ratio(ratio: FloatArray, band: tuple[float, float], text: str, share: float) -> Finding:
    """Judge whether a ratio over frequency lies in a band: its mean, and a share of its points."""
    known = ratio[np.isfinite(ratio)]
    covered = known.size / ratio.size
    if not known.size:
        return Finding("no steady antiphase motion in the interval", False, 0.0)
    inside = float(((band[0] <= known) & (known <= band[1])).mean())
    told = f"{text} {known.min() - 1.0:+.1%} … {known.max() - 1.0:+.1%}, mean {known.mean() - 1.0:+.1%}"
    if covered < COVERED:
        told += f"; antiphase motion in {covered:.0%} of the interval only"
    holds = inside >= share and band[0] <= known.mean() <= band[1] and covered >= COVERED
    return Finding(told, bool(holds), inside * covered)


def _restitution_without_effect(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether amplitudes, periods and contact are the same for all R."""
    amplitude = _ratio_to_inelastic(1.0 - SAME, 1.0 + SAME, "amplitude", 1.0)(claim, evidence)
    low, high = claim["f"]
    characters = {}
    for key in _restitutions(evidence, claim["mu"]):
        rows = evidence.rows(key, low + EDGE, high - EDGE)
        characters[key.restitution] = [(row[SUPPLY], row["period"]) for row in rows]
    reference = dict(characters.get(0.0, []))
    same = {
        r: np.mean([reference.get(s) == n for s, n in rows]) if rows else 0.0 for r, rows in characters.items() if r
    }
    text = "; ".join(f"R {r:g}: {share:.0%}" for r, share in same.items())
    share = float(np.mean(list(same.values()))) if same else 0.0
    return Finding(
        f"{amplitude.measured}; period as at R = 0: {text}",
        amplitude.holds and share == 1.0,
        0.5 * (amplitude.score + share),
    )


def _against_non_impact(impact_larger: bool) -> Callable[[Claim, Evidence], Finding]:
    def judged(claim: Claim, evidence: Evidence) -> Finding:
        at = _frequencies(claim)
        viscous = _amplitude(evidence, Key(claim["mu"], model="non-impact"), at)
        impact = _amplitude(evidence, Key(claim["mu"]), at)
        if impact_larger:
            return _ordered(claim, at, viscous, impact, "A_impact > A_nonimpact")
        return _ordered(claim, at, impact, viscous, "A_nonimpact > A_impact")

    return judged


def _non_impact_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the non-impact amplitude is larger over resonance, and the ratio grows with R."""
    at = _frequencies(claim)
    viscous = _amplitude(evidence, Key(claim["mu"], model="non-impact"), at)
    impact = {r: _amplitude(evidence, Key(claim["mu"], r), at) for r in claim["R"]}
    larger = _all({f"R {r:g}": _ordered(claim, at, a, viscous, "A_nonimpact > A_impact") for r, a in impact.items()})
    with np.errstate(invalid="ignore"):
        means = [float(np.nanmean(viscous / a)) if np.isfinite(viscous / a).any() else np.nan for a in impact.values()]
    grows = bool(np.all(np.diff(means) > 0.0))
    text = f"{larger.measured}; mean ratio " + " → ".join(f"{v:.3f}" for v in means)
    return Finding(text, larger.holds and grows, 0.7 * larger.score + 0.3 * grows)


def _non_impact_shape(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the impact motion is non-periodic and the non-impact one harmonic: A = √2 RMS within 2 %."""
    f = claim["f"][0]
    mu = claim["mu"]
    impact = _nearest(evidence.rows(Key(mu)), f)
    viscous = _nearest(evidence.rows(Key(mu, model="non-impact")), f)
    if impact is None or viscous is None:
        return Finding("30.7 Hz is not reached", False, 0.0)
    crest = viscous["amplitude_y_m"] / (np.sqrt(2.0) * viscous["rms_y_m"])
    harmonic = bool(viscous["period"] == 1 and abs(crest - 1.0) < 0.02)
    text = f"impact at {impact[F]:.2f} Hz: {_period(impact)}; non-impact at {viscous[F]:.2f} Hz: {_period(viscous)}, "
    text += f"A/(√2 RMS) = {crest:.4f}"
    return Finding(text, harmonic and impact["period"] == 0, 0.5 * (harmonic + (impact["period"] == 0)))


def _nearest(rows: list[Row], f: float) -> Row | None:
    near = [row for row in rows if abs(row[F] - f) <= EDGE and row["sync"] == "antiphase"]
    return min(near, key=lambda row: abs(row[F] - f)) if near else None


def _period(row: Row) -> str:
    return f"period {row['period']}" if row["period"] else "non-periodic"


_JUDGES: dict[str, Callable[[Claim, Evidence], Finding]] = {
    "sync-antiphase-inter": _band,
    "sync-inphase": _band,
    "sync-antiphase-over": _band,
    "sync-deviation": _deviation,
    "jump-second-resonance": _second_resonance,
    "band-vs-mass": _jump_over_mass,
    "amp-rise": _over_mass(+1),
    "amp-fall-inter": _over_mass(-1),
    "amp-fall-over": _over_mass(-1),
    "attached-mu01": _band,
    "attached-mu02": _band,
    "flight-period1": _band,
    "nonperiodic": _band,
    "over-period1": _band,
    "R-amp-inter": _ratio_to_inelastic(1.0, 1.0 + SMALL, "changes by"),
    "R-amp-over": _ratio_to_inelastic(1.0 - SMALL, 1.0, "changes by"),
    "R-none": _restitution_without_effect,
    "R1-nonperiodic": _non_periodic_from,
    "R-bands": _bands_over_restitution,
    "R-over-boundary": _periodic_from_over,
    "NI-below": _against_non_impact(impact_larger=True),
    "NI-mid": _against_non_impact(impact_larger=False),
    "NI-over": _non_impact_over,
    "NI-shape": _non_impact_shape,
}
