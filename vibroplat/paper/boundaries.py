"""Judges of claims about regimes: the bands in which they hold, and the boundaries where they end."""

from __future__ import annotations

from collections.abc import Collection
from itertools import pairwise

import numpy as np

from vibroplat.paper.evidence import MOTIONS, REGIMES, Boundary, Evidence, F, Key, Row, runs
from vibroplat.paper.finding import EDGE, Claim, Finding, closeness, interval, joined, keys_of, name_of, restitutions
from vibroplat.paper.narrowing import JUMP_WIDTH, WIDTH
from vibroplat.study.branches import SUPPLY

#: Least change of frequency (Hz) at a jump, and least share by which RMS y falls there.
LEAST_JUMP, LEAST_FALL = 0.1, 0.2
#: Largest shift of the jump (Hz) that counts as slight.
SLIGHT = 1.0


def band(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether a regime holds in a band, on all branches of the claim."""
    return joined({name_of(key): _band_of(claim, evidence, key) for key in keys_of(claim)})


def _band_of(claim: Claim, evidence: Evidence, key: Key) -> Finding:
    """Judge whether a regime holds at all points in a band, and whether the points reach both ends of the band."""
    low, high = claim["f"]
    regime = claim["regime"]
    edge = 0.0 if low == high else EDGE
    reach = EDGE if low == high else 0.0
    rows = _with_boundary(evidence, key, regime, low - EDGE)
    inside = [row for row in rows if low + edge - reach <= row[F] <= high - edge + reach]
    near = [row for row in rows if low - 1.0 <= row[F] <= high + 1.0]
    where = ", ".join(interval(*run) for run in runs(near, regime)) or "nowhere"
    undecided = sum(row["motion"] == "undecided" for row in inside) if regime in MOTIONS else 0
    if not inside:
        return Finding(f"{regime} {where}; no steady motion in the band", False, 0.0)
    share = float(np.mean([REGIMES[regime](row) for row in inside]))
    frequencies = [row[F] for row in rows if low - EDGE <= row[F] <= high + EDGE]
    reached = low == high or (min(frequencies) <= low + EDGE and max(frequencies) >= high - EDGE)
    short = "" if reached else f"; points only {interval(min(frequencies), max(frequencies))}"
    open_ = f", {undecided} undecided" if undecided else ""
    text = f"{regime} {where}; {share:.0%} of {len(inside)} points in the band{open_}{short}"
    return Finding(text, share == 1.0 and reached, share * (1.0 if reached else 0.7))


def _with_boundary(evidence: Evidence, key: Key, regime: str, low: float) -> list[Row]:
    """Return the rows of a branch and those next to the end of a regime, in the order of frequency."""
    rows = list(evidence.rows(key))
    end = evidence.end_of(key, regime, low)
    for row in end or ():
        if row not in rows:
            rows.append(row)
    return sorted(rows, key=lambda row: float(row[F]))


# -- boundaries -------------------------------------------------------------------------------------------


def _jump(evidence: Evidence, key: Key) -> Boundary | None:
    """Find where antiphase rotation below the second resonance ends."""
    return evidence.end_of(key, "antiphase", 20.0)


def _across(boundary: Boundary) -> str:
    return f"{boundary.before[F]:.2f} → {boundary.after[F]:.2f} Hz"


def second_resonance(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where antiphase rotation ends, and whether frequency and amplitude jump there."""
    found = _jump(evidence, Key(claim["mu"]))
    if found is None:
        return Finding("antiphase does not end up to 40 Hz", False, 0.0)
    off = abs(found.before[F] - claim["f"])
    ratio = found.after["rms_y_m"] / found.before["rms_y_m"]
    jumps = found.after[F] - found.before[F] > LEAST_JUMP and ratio < 1.0 - LEAST_FALL
    supply = found.after[SUPPLY]
    text = f"{_across(found)} at supply {supply:.2f} Hz, RMS y × {ratio:.2g}, Δφ {_phases(found)}"
    return Finding(text, off <= claim["tol"] and jumps, closeness(off, claim["tol"]) * (1.0 if jumps else 0.5))


def _phases(found: Boundary) -> str:
    return " → ".join(f"{abs(row['phase_difference_rad']):.2f}" for row in found)


def jump_over_mass(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether material leaves the frequency of the jump within EDGE and does not raise its supply frequency.

    This is the former reading of what :func:`bands_over_mass` and :func:`jump_left` judge.
    """
    jumps = _jumps(claim, evidence)
    if jumps is None:
        return _NO_JUMP
    bare, *others = jumps.values()
    shifts = [(jump.before[F] - bare.before[F], jump.before[SUPPLY] - bare.before[SUPPLY]) for jump in others]
    text = f"μ 0: {bare.before[F]:.2f} Hz; " + "; ".join(
        f"μ {mu:g}: {shift:+.2f} Hz (supply {supply:+.2f} Hz)"
        for mu, (shift, supply) in zip(claim["mu"], shifts, strict=True)
    )
    near = all(abs(shift) <= EDGE for shift, _ in shifts)
    left = all(supply <= 0.05 for _, supply in shifts)
    return Finding(text, near and left, (near + left) / 2.0)


def jump_left(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether material lowers the frequency of the jump slightly, but by more than its error."""
    jumps = _jumps(claim, evidence)
    if jumps is None:
        return _NO_JUMP
    bare, *others = (float(jump.before[F]) for jump in jumps.values())
    shifts = "; ".join(f"μ {mu:g}: {f - bare:+.3f} Hz" for mu, f in zip(claim["mu"], others, strict=True))
    left = [-SLIGHT <= f - bare < -0.5 * JUMP_WIDTH for f in others]
    return Finding(f"μ 0: {bare:.2f} Hz; {shifts}", all(left), float(np.mean(left)))


_NO_JUMP = Finding("antiphase does not end for every μ", False, 0.0)


def _jumps(claim: Claim, evidence: Evidence) -> dict[float, Boundary] | None:
    """Return the jumps without material and at a claim's mass ratios; None if one of them is missing."""
    found = {mu: _jump(evidence, Key(mu)) for mu in (0.0, *claim["mu"])}
    jumps = {mu: jump for mu, jump in found.items() if jump is not None}
    return jumps if len(jumps) == len(found) else None


def bands_over_mass(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether antiphase rotation ends and begins again at the same frequencies for all μ, within EDGE."""
    keys = [Key(0.0), *keys_of(claim)]
    found = _antiphase_ends(keys, evidence)
    if len(found) < len(keys):
        return _not_left(found, keys)
    bare = found[keys[0]]
    off = max(abs(end - end_bare) for ends in found.values() for end, end_bare in zip(ends, bare, strict=True))
    return Finding(_ends_text(found), off <= EDGE, closeness(off, EDGE))


def bands_over_restitution(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether antiphase rotation ends and begins again at the same frequencies for all R, within EDGE."""
    keys = restitutions(evidence, claim["mu"])
    found = _antiphase_ends(keys, evidence)
    if len(found) < max(len(keys), 2):
        return _not_left(found, keys)
    spread = float(np.ptp(list(found.values()), axis=0).max())
    return Finding(_ends_text(found), spread <= EDGE, closeness(spread, EDGE))


def _not_left(found: Collection[Key], keys: list[Key]) -> Finding:
    missing = ", ".join(name_of(key) for key in keys if key not in found) or "one branch or none"
    return Finding(f"antiphase does not end and begin again: {missing}", False, 0.0)


def _antiphase_ends(keys: list[Key], evidence: Evidence) -> dict[Key, tuple[float, float]]:
    """Find where antiphase rotation ends and where it begins again (Hz), for the branches that do both."""
    found = {}
    for key in keys:
        end, start = _jump(evidence, key), evidence.end_of(key, "in-phase", 31.0)
        if end is not None and start is not None:
            found[key] = (float(end.before[F]), float(start.after[F]))
    return found


def _ends_text(found: dict[Key, tuple[float, float]]) -> str:
    return "; ".join(f"{name_of(key)}: up to {a:.2f}, again from {b:.2f} Hz" for key, (a, b) in found.items())


def attached_until(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion is attached from one frequency up to another, and liftoff is neither earlier nor later."""
    key = Key(claim["mu"], claim["R"])
    begin = claim["from"]
    rows = evidence.rows(key, begin - EDGE)
    end = evidence.end_of(key, "attached", begin - EDGE)
    if not rows or rows[0][F] > begin + EDGE or not REGIMES["attached"](rows[0]):
        return Finding(f"not attached at {begin:g} Hz", False, 0.0)
    if end is None:
        return Finding(f"attached {interval(rows[0][F], rows[-1][F])}, never left", False, 0.0)
    off = abs(_place(end) - claim["f"])
    return Finding(f"attached up to {_across(end)}", off <= claim["tol"], closeness(off, claim["tol"]))


def _place(found: Boundary) -> float:
    return float(0.5 * (found.before[F] + found.after[F]))


def non_periodic_from(claim: Claim, evidence: Evidence) -> Finding:
    """Judge where motion stops being periodic, and whether it stays non-periodic up to the jump."""
    key = Key(claim["mu"], claim["R"])
    found = evidence.end_of(key, "periodic", 20.0)
    if found is None:
        return Finding("periodic everywhere, or nowhere", False, 0.0)
    first = _place(found)
    rows = evidence.rows(key, first + EDGE, 31.0)
    share = float(np.mean([REGIMES["non-periodic"](row) for row in rows])) if rows else 0.0
    off = abs(first - claim["f"])
    text = f"periodic up to {_across(found)}, then non-periodic at {share:.0%} of points up to 31 Hz"
    return Finding(text, off <= claim["tol"] and share == 1.0, 0.5 * (closeness(off, claim["tol"]) + share))


def non_periodic_earlier(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether motion below the jump stops being periodic at a lower frequency for each larger R.

    Frequencies must differ by more than their error, half of WIDTH.
    """
    keys = [key for key in keys_of(claim) if key in evidence.courses]
    starts = {key.restitution: _non_periodic_start(key, evidence) for key in keys}
    where = (f"R {r:g}: " + ("nowhere" if np.isinf(f) else f"{f:.2f} Hz") for r, f in starts.items())
    falls = [a - b > 0.5 * WIDTH for a, b in pairwise(starts.values()) if np.isfinite(b)]
    share = sum(falls) / max(len(starts) - 1, 1)
    return Finding(f"non-periodic from: {'; '.join(where) or 'no branches'}", share == 1.0, share)


def _non_periodic_start(key: Key, evidence: Evidence) -> float:
    found = evidence.end_of(key, "periodic", 20.0)
    return _place(found) if found and found.before[F] <= 31.0 else np.inf


def periodic_from_over(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequency from which over-resonant motion is period-1 rises with R."""
    starts = {key.restitution: _last_period_1(key, evidence) for key in restitutions(evidence, claim["mu"])}
    text = "; ".join(
        f"R {r:g}: " + ("nowhere up to 40 Hz" if np.isinf(f) else f"{f:.2f} Hz") for r, f in starts.items()
    )
    values = list(starts.values())
    finite = [f for f in values if np.isfinite(f)]
    rises = len(finite) > 1 and all(b - a > 0.5 * WIDTH or np.isinf(b) for a, b in pairwise(values))
    return Finding(f"period-1 from: {text}", rises, len(finite) / max(len(values), 1) * (1.0 if rises else 0.5))


def _last_period_1(key: Key, evidence: Evidence) -> float:
    """Return the frequency (Hz) from which a branch has period 1 up to its end; inf if it does not end so."""
    start = evidence.start_of_last(key, "period-1")
    if start is not None:
        return float(start.after[F])
    rows = evidence.rows(key)
    return float(rows[0][F]) if rows and REGIMES["period-1"](rows[-1]) else np.inf


def deviation(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether Δφ departs from π, and x and φ begin to vibrate, close to the jump."""
    key = Key(claim["mu"])
    end = _jump(evidence, key)
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
