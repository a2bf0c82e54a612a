"""Judges of the paper's claims: by a regime in a band, by amplitudes of pairs of curves, or by measures with limits.

A comparison of amplitudes holds if it is wrong by more than SIGMAS standard errors at no frequency, right at a fraction
MIN_RIGHT of the frequencies, and right by more than its error at a fraction MIN_SURE of them. A measure holds if all of
its values lie between its limits, in the claim.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np

from vibroplat.columns import split, unit_of
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
from vibroplat.paper.root_finding import WIDTH
from vibroplat.study.branches import SUPPLY

#: Spacing of frequencies (Hz) at which curves are compared.
SPACING = 0.25
#: Fraction of an interval in which there must be antiphase motion to be compared.
MIN_COVERED = 0.9
#: Standard errors by which a comparison may be wrong; fractions at which it must be right, and surely so.
SIGMAS, MIN_RIGHT, MIN_SURE = 2.0, 0.9, 0.5

Claim = Mapping[str, Any]
#: Values of measures by name, with the unit at its end, and by where they are; or why there are none. Those of which a
#: claim has no limits are told.
Measures = Mapping[str, Mapping[str, float]] | str


class Finding(NamedTuple):
    """What was found for a claim.

    Attributes
    ----------
    measured
        In words.
    holds
        Whether it does.
    margin, unit
        How far it is from where the verdict changes: above 0 if the claim holds; nan if it fails by something else.
    judged
        False if it does not hold for the sole reason that points at R = 1 failed.
    """

    measured: str
    holds: bool = False
    margin: float = math.nan
    unit: str = "Hz"
    judged: bool = True


def as_list(value: Any) -> list[float]:
    """Return a value of a claim as a list."""
    return list(value) if isinstance(value, Sequence) else [value]


def find(claim: Claim, evidence: Evidence) -> Finding:
    """Judge a claim by its regime, its pairs of curves and its measures, as far as it has them; all must hold."""
    findings = []
    if "regime" in claim:
        curves = _curves_of(claim)
        findings += [(curve.text if curves[1:] else "", _band(claim, evidence, curve)) for curve in curves]
    if "pairs" in claim:
        findings += _compare_pairs(claim, evidence)
    if "measure" in claim:
        findings.append(("", _within_limits(claim, MEASURES[claim["measure"]](claim, evidence))))
    return _join_findings(findings)


def _join_findings(named: Iterable[tuple[str, Finding]]) -> Finding:
    """Join findings; all must hold, and the margin is the least one in the unit of the first."""
    names, findings = zip(*named, strict=True)
    text = "; ".join(f"{name and f'{name}: '}{finding.measured}" for name, finding in zip(names, findings, strict=True))
    margins = [f.margin for f in findings if f.unit == findings[0].unit and math.isfinite(f.margin)]
    return Finding(text, all(f.holds for f in findings), min(margins, default=math.nan), findings[0].unit)


def _curves_of(claim: Claim) -> list[PaperCurve]:
    """Return the curves of a claim, from its mass ratios and restitutions."""
    return [PaperCurve(mu, r) for mu in as_list(claim.get("mu", 0.0)) for r in as_list(claim.get("R", 0.0))]


# -- a regime in a band -----------------------------------------------------------------------------------


def _band(claim: Claim, evidence: Evidence, curve: PaperCurve) -> Finding:
    """Judge whether a regime holds at all points of a branch in a band, and whether these reach its ends."""
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
    return Finding(text, fraction == 1.0 and reached, min(off + ends, default=math.nan))


def regime_intervals(rows: Sequence[Row], regime: str) -> list[tuple[float, float]]:
    """Return the first and last excitation frequency (Hz) of each stretch of rows in a regime."""
    stretches = [[row[F] for row in rows] for holds, rows in groupby(rows, REGIMES[regime]) if holds]
    return [(frequencies[0], frequencies[-1]) for frequencies in stretches]


def _with_boundary(evidence: Evidence, curve: PaperCurve, regime: str, low: float) -> list[Row]:
    """Return the rows of a branch and those next to the end of a regime, in the order of frequency."""
    rows = evidence.rows(curve)
    rows += [row for row in evidence.end_of(curve, regime, low) or () if row not in rows]
    return sorted(rows, key=lambda row: float(row[F]))


# -- amplitudes of pairs of curves ------------------------------------------------------------------------


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


def _ratio(claim: Claim, evidence: Evidence, upper: PaperCurve, lower: PaperCurve) -> _Ratio:
    at = np.arange(claim["f"][0] + EDGE, claim["f"][1] - EDGE + 1e-9, SPACING)
    (x, dx), (y, dy) = evidence.amplitudes(upper, at), evidence.amplitudes(lower, at)
    values, known = x / y, np.isfinite(x / y)
    errors = np.abs(values) * np.hypot(dx / x, dy / y)
    return _Ratio(at[known], values[known], errors[known], float(known.mean()))


def _compare_pairs(claim: Claim, evidence: Evidence) -> list[tuple[str, Finding]]:
    """Judge whether the amplitudes of pairs of curves have ratios between limits, or above 1 without any.

    Pairs that have no branch at R = 1 are left out.
    """
    limits = claim.get("at_least", np.nextafter(1.0, 2.0)), claim.get("at_most", math.inf)
    pairs = [(PaperCurve(*upper), PaperCurve(*lower)) for upper, lower in claim["pairs"]]
    known = [(upper, lower) for upper, lower in pairs if upper.restitution < 1.0 or upper in evidence.branches]
    ratios = {f"{upper.text} over {lower.text}": _ratio(claim, evidence, upper, lower) for upper, lower in known}
    return [(name, _between(ratio, *limits)) for name, ratio in ratios.items()]


def _between(ratio: _Ratio, low: float, high: float) -> Finding:
    """Judge whether a ratio lies between two values at all frequencies at which it is known."""
    if not len(ratio.f):
        return Finding("no steady antiphase motion in the interval", unit="%")
    values, errors = ratio.values, SIGMAS * ratio.errors
    right = (low <= values) & (values <= high)
    violated = (values + errors < low) | (values - errors > high) | (~right & (errors == 0.0))
    undecided = ~violated & ((values - errors < low) | (values + errors > high))
    fraction = float(right.mean())
    measured = f"as claimed at {digits.percent(fraction)} of {len(values)} frequencies, ratio "
    measured += f"{interval(values.min(), values.max())}, mean {number(float(values.mean()))}"
    if violated.any():
        measured += f", not at {interval(ratio.f[violated].min(), ratio.f[violated].max(), 'Hz')}"
    if undecided.any():
        measured += f", {undecided.sum()} undecided by their error"
    if ratio.covered < MIN_COVERED:
        measured += f"; antiphase motion in {ratio.covered:.0%} of the interval only"
    sure = float((right & ~undecided).mean())
    holds = not violated.any() and fraction >= MIN_RIGHT and sure >= MIN_SURE and ratio.covered >= MIN_COVERED
    margin = 100.0 * float(np.minimum(values + errors - low, high - values + errors).min())
    return Finding(measured, bool(holds), margin, "%")


# -- measures with limits ---------------------------------------------------------------------------------


def _within_limits(claim: Claim, measures: Measures) -> Finding:
    """Judge whether all values of measures lie between a claim's limits; a measure without any is its f ± tol."""
    if isinstance(measures, str):
        return Finding(measures)
    text = "; ".join(_told(name, values) for name, values in measures.items())
    margins: dict[str, list[float]] = {}
    for name, limit in claim["limits"].items():
        ends = limit or {"at_least": claim["f"] - claim["tol"], "at_most": claim["f"] + claim["tol"]}
        margins[name] = [_margin(value, **ends) for value in measures[name].values()] or [-math.inf]
    first, every = next(iter(margins)), [margin for values in margins.values() for margin in values]
    own = [m for name in margins if name == first or unit_of(name) == unit_of(first) != "" for m in margins[name]]
    least = min(filter(math.isfinite, own), default=math.nan)
    return Finding(text, all(margin >= 0.0 for margin in every), least, unit_of(first))


def _margin(value: float, at_least: float = -math.inf, at_most: float = math.inf) -> float:
    """Return how far a value is from the nearer limit: below 0 beyond it, −inf if it is not known."""
    above = value - at_least if at_least > -math.inf else math.inf
    below = at_most - value if at_most < math.inf else math.inf
    return -math.inf if math.isnan(value) else min(above, below)


def _told(name: str, values: Mapping[str, float]) -> str:
    """Return a measure in words."""
    words, unit = split(name)[0].replace("_", " "), unit_of(name)
    told = {where: quantity(value, unit) if unit else f"{value:.4g}" for where, value in values.items()}
    texts = [f"{where} {'nowhere' if math.isinf(values[where]) else text}".strip() for where, text in told.items()]
    return f"{words} {', '.join(texts) or 'nowhere'}"


def jump(claim: Claim, evidence: Evidence) -> Measures:
    """Measure where antiphase rotation ends, and how frequency, amplitude and phase difference jump there."""
    found = evidence.jump(PaperCurve(claim["mu"]))
    if found is None:
        return "antiphase does not end up to 40 Hz"
    before, after = found
    return {
        "jump_hz": {"": before[F]},
        "step_hz": {"": after[F] - before[F]},
        "rms_y_ratio": {"": after["rms_y_m"] / before["rms_y_m"]},
        "phase_difference_rad": {"before": before["phase_difference_rad"], "after": after["phase_difference_rad"]},
    }


def jump_shift(claim: Claim, evidence: Evidence) -> Measures:
    """Measure by how much material moves the frequency of the jump."""
    jumps = {mu: evidence.jump(PaperCurve(mu)) for mu in (0.0, *claim["mu"])}
    at = {f"μ {mu:g}": float(found.before[F]) for mu, found in jumps.items() if found}
    if len(at) < len(jumps):
        return "antiphase does not end for every μ"
    bare = at.pop("μ 0")
    return {"shift_hz": {name: f - bare for name, f in at.items()}, "bare_jump_hz": {"": bare}}


def antiphase_ends(claim: Claim, evidence: Evidence) -> Measures:
    """Measure by how much the frequencies differ at which antiphase rotation ends and begins again.

    Branches with several μ are compared with the one without material, those with several R with each other.
    """
    over_mass = isinstance(claim["mu"], Sequence)
    curves = [PaperCurve(0.0), *_curves_of(claim)] if over_mass else evidence.restitutions(claim["mu"])
    found = {curve: (evidence.jump(curve), evidence.end_of(curve, "in-phase", 31.0)) for curve in curves}
    ends = {c.text: (float(a.before[F]), float(b.after[F])) for c, (a, b) in found.items() if a and b}
    if len(ends) < max(len(curves), 2):
        missing = ", ".join(curve.text for curve in curves if curve.text not in ends) or "one branch or none"
        return f"antiphase does not end and begin again: {missing}"
    numbers = np.array(list(ends.values()))
    off = np.max(abs(numbers - numbers[0]) if over_mass else np.ptp(numbers, axis=0))
    until, again = ({name: both[k] for name, both in ends.items()} for k in (0, 1))
    return {"difference_hz": {"": float(off)}, "until_hz": until, "again_from_hz": again}


def liftoff(claim: Claim, evidence: Evidence) -> Measures:
    """Measure up to where motion is attached that is so from a frequency on."""
    curve, begin = PaperCurve(claim["mu"], claim["R"]), claim["from"]
    rows = evidence.rows(curve, begin - EDGE)
    end = evidence.end_of(curve, "attached", begin - EDGE)
    if not rows or rows[0][F] > begin + EDGE or not REGIMES["attached"](rows[0]):
        return f"not attached at {begin:g} Hz"
    if end is None:
        return f"attached {interval(rows[0][F], rows[-1][F], 'Hz')}, never left"
    return {"attached_until_hz": {"": end.middle}}


def end_of_periodic(claim: Claim, evidence: Evidence) -> Measures:
    """Measure where motion stops being periodic, and the fraction of points up to the jump that are non-periodic."""
    curve = PaperCurve(claim["mu"], claim["R"])
    end = evidence.end_of(curve, "periodic", 20.0)
    if end is None:
        return "periodic everywhere, or nowhere"
    later = [REGIMES["non-periodic"](row) for row in evidence.rows(curve, end.middle + EDGE, 31.0)]
    return {"periodic_until_hz": {"": end.middle}, "then_non_periodic": {"": float(np.mean(later)) if later else 0.0}}


def falls_with_restitution(claim: Claim, evidence: Evidence) -> Measures:
    """Measure by how much earlier motion below the jump stops being periodic for each larger R, beyond the error."""
    ends = {c: evidence.end_of(c, "periodic", 20.0) for c in _curves_of(claim) if c in evidence.branches}
    starts = {f"R {c.restitution:g}": e.middle if e and e.before[F] <= 31.0 else math.inf for c, e in ends.items()}
    steps = pairwise(starts.items())
    falls = {name: a - b - 0.5 * WIDTH if math.isfinite(b) else -math.inf for (_, a), (name, b) in steps}
    return {"non_periodic_from_hz": starts, "fall_hz": falls}


def rises_with_restitution(claim: Claim, evidence: Evidence) -> Measures:
    """Measure by how much the frequency from which motion is period-1 rises for each larger R, beyond the error."""
    starts = {}
    for curve in evidence.restitutions(claim["mu"]):
        start, rows = evidence.start_of_last(curve, "period-1"), evidence.rows(curve)
        first = rows[0] if rows and REGIMES["period-1"](rows[-1]) else {F: math.inf}
        starts[f"R {curve.restitution:g}"] = float((start.after if start else first)[F])
    steps = pairwise(starts.items())
    rises = {name: b - a - 0.5 * WIDTH for (_, a), (name, b) in steps if math.isfinite(b)}
    return {"period_1_from_hz": starts, "rise_hz": rises if sum(map(math.isfinite, starts.values())) > 1 else {}}


def deviation(claim: Claim, evidence: Evidence) -> Measures:
    """Measure how far Δφ is from π close to the jump and elsewhere, and how much more x and φ vibrate there."""
    curve = PaperCurve(claim["mu"])
    end = evidence.jump(curve)
    if end is None:
        return "antiphase does not end"
    last, rows = end.before[F], _with_boundary(evidence, curve, "antiphase", 20.0)
    far, near = ([r for r in rows if a <= r[F] <= b] for a, b in ((25.0, min(29.0, last)), (last - 0.5, last)))
    if not far or not near:
        return "no steady motion near 31 Hz"
    away, close = (max(np.pi - abs(r["phase_difference_rad"]) for r in part) for part in (far, near))
    x, phi = (max(r[c] for r in near) / max(1e-15, *(r[c] for r in far)) for c in ("rms_x_m", "rms_phi_rad"))
    return {
        "deviation_rad": {"": close},
        "times_that_at_25_to_29_hz": {"Δφ": close / max(away, 1e-15), "x": x, "φ": phi},
        "at_jump_hz": {"": last},
    }


def same_periods(claim: Claim, evidence: Evidence) -> Measures:
    """Measure the fraction of points with the period that they have at R = 0; undecided points are left out."""
    periods = {}
    for curve in evidence.restitutions(claim["mu"]):
        rows = evidence.rows(curve, claim["f"][0] + EDGE, claim["f"][1] - EDGE, decided="periodic")
        periods[f"R {curve.restitution:g}"] = {row[SUPPLY]: row["period"] for row in rows}
    first = periods.pop("R 0", {})
    same = {name: [first[f] == n for f, n in own.items() if f in first] for name, own in periods.items()}
    return {"period_as_at_r_0": {name: float(np.mean(of)) if of else 0.0 for name, of in same.items()}}


def shape(claim: Claim, evidence: Evidence) -> Measures:
    """Measure whether impact motion is non-periodic, and period and A/(√2 RMS) of non-impact motion."""
    nearest = []
    for curve in (IMPACT_CURVE, NON_IMPACT_CURVE):
        rows = [row for row in evidence.rows(curve) if row["sync"] == "antiphase"]
        nearest.append(min(rows, key=lambda row: abs(row[F] - claim["f"][0]), default={F: math.inf}))
    if max(abs(row[F] - claim["f"][0]) for row in nearest) > EDGE:
        return "30.7 Hz is not reached"
    impact, viscous = nearest
    return {
        "non_impact_crest": {"": viscous["amplitude_y_m"] / (math.sqrt(2.0) * viscous["rms_y_m"])},
        "non_impact_period": {"": viscous["period"]},
        "impact_is_non_periodic": {"": float(REGIMES["non-periodic"](impact))},
        "at_hz": {"impact": impact[F], "non-impact": viscous[F]},
    }


def quoted_frequencies(claim: Claim, evidence: Evidence) -> Measures:
    """Measure how far quoted frequencies are from points of the paper's own steps, beyond what a claim allows.

    The points are those of antiphase motion on the curve with R = 0. Allowed are the claim's tolerance and, if the
    motion is not periodic, two standard errors.
    """
    rows = [row for row in evidence.rows(PaperCurve(claim["mu"])) if row["sync"] == "antiphase"]
    points = [(float(row[F]), error_of(row, F)) for row in rows]
    near = {f: min(points, key=lambda point: abs(point[0] - f), default=(0.0, 0.0)) for f, _ in claim["quoted"]}
    beyond = {f"{f:g}": abs(near[f][0] - f) - allowed - 2.0 * near[f][1] for f, allowed in claim["quoted"]}
    return {"beyond_tolerance_hz": beyond, "nearest_point_hz": {f"{f:g}": point for f, (point, _) in near.items()}}


def layer_damping(claim: Claim, evidence: Evidence) -> Measures:
    """Measure the damping between the layers.

    The damping ratio is ζ = b_w/(2√(c_w m_w2)), that of the upper layer on a lower one in contact. If the lower layer
    moves harmonically, the upper one moves relative to it by at most 1/(2ζ√(1 − ζ²)) of its amplitude (ζ < 1/√2), which
    is 1.15 for ζ = 1/2. More counts as intensive; ζ < 1 is subcritical. In flight, with both layers free, the ratio is
    ζ√(1 + m_w2/m_w1); it is reported, not judged.
    """
    records = evidence.branches.get(PaperCurve(claim["mu"]))
    if records is None or records.branch.scene.layers < 2:
        return "no two layers"
    material, (stiffness, damping) = records.branch.scene.material, records.branch.scene.layer_spring
    ratio = material.damping_ratio or damping / (2.0 * math.sqrt(stiffness))
    return {"damping_ratio": {"": ratio}, "ratio_in_flight": {"": ratio / math.sqrt(material.lower_share)}}


#: Functions that measure, by the names in claims.
MEASURES: dict[str, Callable[[Claim, Evidence], Measures]] = {
    measure.__name__: measure
    for measure in (
        *(jump, jump_shift, antiphase_ends, liftoff, end_of_periodic, falls_with_restitution, rises_with_restitution),
        *(deviation, same_periods, shape, quoted_frequencies, layer_damping),
    )
}
