"""Judges of claims about regimes: the bands in which they hold, and the boundaries where they end."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise

import numpy as np

from vibroplat.paper.evidence import (
    EDGE,
    MOTIONS,
    REGIMES,
    Boundary,
    Claim,
    Evidence,
    F,
    Finding,
    Key,
    Row,
    closeness,
    interval,
    joined,
    keys_of,
    name_of,
)
from vibroplat.paper.root_finding import JUMP_WIDTH, WIDTH
from vibroplat.study.branches import SUPPLY

#: Least change of frequency (Hz) at a jump, and least share by which RMS y falls there.
LEAST_JUMP, LEAST_FALL = 0.1, 0.2
#: Largest shift of the jump to the left (Hz) that counts as slight, and largest rise of its supply frequency (Hz) that
#: counts as none.
SLIGHT, NO_RISE = 1.0, 0.05


def band(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether a regime holds at all points in a band, and whether the points of all branches reach its ends."""
    return joined({name_of(key): _band_of(claim, evidence, key) for key in keys_of(claim)})


def _band_of(claim: Claim, evidence: Evidence, key: Key) -> Finding:
    (low, high), regime = claim["f"], claim["regime"]
    holds = REGIMES[regime]
    margin = EDGE if low < high else -EDGE  # a single frequency stands for those around it
    rows = _with_boundary(evidence, key, regime, low - EDGE)
    inside = [row for row in rows if low + margin <= row[F] <= high - margin]
    near = [row for row in rows if low - 1.0 <= row[F] <= high + 1.0]
    where = ", ".join(interval(*run) for run in runs(near, regime)) or "nowhere"
    if not inside:
        return Finding(f"{regime} {where}; no steady motion in the band", False, 0.0)
    share = float(np.mean([holds(row) for row in inside]))
    text = f"{regime} {where}; {share:.0%} of {len(inside)} points in the band"
    undecided = sum(row["motion"] == "undecided" for row in inside) if regime in MOTIONS else 0
    if undecided:
        text += f", {undecided} undecided"
    frequencies = [row[F] for row in rows if low - EDGE <= row[F] <= high + EDGE]
    reached = low == high or (min(frequencies) <= low + EDGE and max(frequencies) >= high - EDGE)
    if not reached:
        text += f"; points only {interval(min(frequencies), max(frequencies))}"
    return Finding(text, share == 1.0 and reached, share * (1.0 if reached else 0.7))


def runs(rows: Sequence[Row], regime: str) -> list[tuple[float, float]]:
    """Return the first and last excitation frequency (Hz) of each stretch of rows in a regime."""
    stretches = [[row[F] for row in rows] for holds, rows in groupby(rows, REGIMES[regime]) if holds]
    return [(frequencies[0], frequencies[-1]) for frequencies in stretches]


def _with_boundary(evidence: Evidence, key: Key, regime: str, low: float) -> list[Row]:
    """Return the rows of a branch and those next to the end of a regime, in the order of frequency."""
    rows = list(evidence.rows(key))
    rows += [row for row in evidence.end_of(key, regime, low) or () if row not in rows]
    return sorted(rows, key=lambda row: float(row[F]))


def _across(boundary: Boundary) -> str:
    return f"{boundary.before[F]:.2f} → {boundary.after[F]:.2f} Hz"


def _middle(boundary: Boundary) -> float:
    return float(0.5 * (boundary.before[F] + boundary.after[F]))


def second_resonance(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where antiphase rotation ends, and whether frequency and amplitude jump there."""
    found = evidence.jump(Key(claim["mu"]))
    if found is None:
        return Finding("antiphase does not end up to 40 Hz", False, 0.0)
    before, after = found
    off = abs(before[F] - claim["f"])
    ratio = after["rms_y_m"] / before["rms_y_m"]
    jumps = after[F] - before[F] > LEAST_JUMP and ratio < 1.0 - LEAST_FALL
    phases = " → ".join(f"{abs(row['phase_difference_rad']):.2f}" for row in found)
    text = f"{_across(found)} at supply {after[SUPPLY]:.2f} Hz, RMS y × {ratio:.2g}, Δφ {phases}"
    return Finding(text, off <= claim["tol"] and jumps, closeness(off, claim["tol"]) * (1.0 if jumps else 0.5))


def jump_over_mass(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether material leaves the frequency of the jump within EDGE and does not raise its supply frequency.

    This is the former reading of what :func:`same_bands` and :func:`jump_left` judge.
    """
    jumps = _jumps(claim, evidence)
    if jumps is None:
        return _NO_JUMP
    bare, *others = jumps
    shifts = [(jump[F] - bare[F], jump[SUPPLY] - bare[SUPPLY]) for jump in others]
    texts = (
        f"μ {mu:g}: {f:+.2f} Hz (supply {supply:+.2f} Hz)" for mu, (f, supply) in zip(claim["mu"], shifts, strict=True)
    )
    near = all(abs(f) <= EDGE for f, _ in shifts)
    left = all(supply <= NO_RISE for _, supply in shifts)
    return Finding(f"μ 0: {bare[F]:.2f} Hz; {'; '.join(texts)}", near and left, (near + left) / 2.0)


def jump_left(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether material lowers the frequency of the jump slightly, but by more than its error."""
    jumps = _jumps(claim, evidence)
    if jumps is None:
        return _NO_JUMP
    bare, *others = (float(jump[F]) for jump in jumps)
    shifts = "; ".join(f"μ {mu:g}: {f - bare:+.3f} Hz" for mu, f in zip(claim["mu"], others, strict=True))
    left = [-SLIGHT <= f - bare < -0.5 * JUMP_WIDTH for f in others]
    return Finding(f"μ 0: {bare:.2f} Hz; {shifts}", all(left), float(np.mean(left)))


_NO_JUMP = Finding("antiphase does not end for every μ", False, 0.0)


def _jumps(claim: Claim, evidence: Evidence) -> list[Row] | None:
    """Return the rows before the jump without material and at a claim's mass ratios; None if one is missing."""
    jumps = [evidence.jump(Key(mu)) for mu in (0.0, *claim["mu"])]
    found = [jump.before for jump in jumps if jump is not None]
    return found if len(found) == len(jumps) else None


def same_bands(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether antiphase rotation ends and begins again at the same frequencies, within EDGE.

    Branches with several μ are compared with the one without material, those with several R with each other.
    """
    over_mass = isinstance(claim["mu"], Sequence)
    keys = [Key(0.0), *keys_of(claim)] if over_mass else evidence.restitutions(claim["mu"])
    found = {}
    for key in keys:
        end, start = evidence.jump(key), evidence.end_of(key, "in-phase", 31.0)
        if end is not None and start is not None:
            found[key] = (float(end.before[F]), float(start.after[F]))
    if len(found) < max(len(keys), 2):
        missing = ", ".join(name_of(key) for key in keys if key not in found) or "one branch or none"
        return Finding(f"antiphase does not end and begin again: {missing}", False, 0.0)
    ends = np.array(list(found.values()))
    off = float(np.max(abs(ends - ends[0]) if over_mass else np.ptp(ends, axis=0)))
    text = "; ".join(f"{name_of(key)}: up to {a:.2f}, again from {b:.2f} Hz" for key, (a, b) in found.items())
    return Finding(text, off <= EDGE, closeness(off, EDGE))


def attached_until(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion is attached from one frequency up to another, and liftoff is neither earlier nor later."""
    key, begin = Key(claim["mu"], claim["R"]), claim["from"]
    rows = evidence.rows(key, begin - EDGE)
    end = evidence.end_of(key, "attached", begin - EDGE)
    if not rows or rows[0][F] > begin + EDGE or not REGIMES["attached"](rows[0]):
        return Finding(f"not attached at {begin:g} Hz", False, 0.0)
    if end is None:
        return Finding(f"attached {interval(rows[0][F], rows[-1][F])}, never left", False, 0.0)
    off = abs(_middle(end) - claim["f"])
    return Finding(f"attached up to {_across(end)}", off <= claim["tol"], closeness(off, claim["tol"]))


def non_periodic_from(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where motion stops being periodic, and whether it stays non-periodic up to the jump."""
    key = Key(claim["mu"], claim["R"])
    found = evidence.end_of(key, "periodic", 20.0)
    if found is None:
        return Finding("periodic everywhere, or nowhere", False, 0.0)
    rows = evidence.rows(key, _middle(found) + EDGE, 31.0)
    share = float(np.mean([REGIMES["non-periodic"](row) for row in rows])) if rows else 0.0
    off = abs(_middle(found) - claim["f"])
    text = f"periodic up to {_across(found)}, then non-periodic at {share:.0%} of points up to 31 Hz"
    return Finding(text, off <= claim["tol"] and share == 1.0, 0.5 * (closeness(off, claim["tol"]) + share))


def non_periodic_earlier(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion below the jump stops being periodic at a lower frequency for each larger R.

    Frequencies must differ by more than their error, half of WIDTH.
    """
    starts = {}
    for key in keys_of(claim):
        if key in evidence.courses:
            found = evidence.end_of(key, "periodic", 20.0)
            starts[key.restitution] = _middle(found) if found and found.before[F] <= 31.0 else math.inf
    falls = [a - b > 0.5 * WIDTH for a, b in pairwise(starts.values()) if math.isfinite(b)]
    share = sum(falls) / max(len(starts) - 1, 1)
    return Finding(f"non-periodic from: {_by_restitution(starts) or 'no branches'}", share == 1.0, share)


def periodic_from_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequency from which over-resonant motion is period-1 up to its end rises with R."""
    starts = {}
    for key in evidence.restitutions(claim["mu"]):
        start, rows = evidence.start_of_last(key, "period-1"), evidence.rows(key)
        first = rows[0] if rows and REGIMES["period-1"](rows[-1]) else {F: math.inf}
        starts[key.restitution] = float((start.after if start else first)[F])
    values = list(starts.values())
    finite = sum(map(math.isfinite, values))
    rises = finite > 1 and all(b - a > 0.5 * WIDTH or math.isinf(b) for a, b in pairwise(values))
    text = f"period-1 from: {_by_restitution(starts, 'nowhere up to 40 Hz')}"
    return Finding(text, rises, finite / max(len(values), 1) * (1.0 if rises else 0.5))


def _by_restitution(starts: Mapping[float, float], nowhere: str = "nowhere") -> str:
    return "; ".join(f"R {r:g}: " + (nowhere if math.isinf(f) else f"{f:.2f} Hz") for r, f in starts.items())


def deviation(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether Δφ departs from π, and x and φ begin to vibrate, close to the jump."""
    key = Key(claim["mu"])
    end = evidence.jump(key)
    if end is None:
        return Finding("antiphase does not end", False, 0.0)
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
