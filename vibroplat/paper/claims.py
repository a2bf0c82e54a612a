"""Judge the paper's claims by evidence alone.

A claim must hold as the paper words it. Frequencies may be off by EDGE, half the step of the paper's own curves: the
ends of its bands are known no better. Scores between 0 and 1 tell the calibration how close a claim is.
"""

from __future__ import annotations

from vibroplat.paper import boundaries, comparisons, quoted
from vibroplat.paper.comparisons import ALMOST, SMALL
from vibroplat.paper.evidence import Evidence, Key
from vibroplat.paper.finding import EDGE, Claim, Finding, Judge, listed, name_of

#: Largest difference (Hz) between synchronous and excitation frequency at a failed point, whose latter is not known.
LAG = 1.0

#: Judges by the names of claims; all bands have the same judge.
JUDGES: dict[str, Judge] = {
    "sync-deviation": boundaries.deviation,
    "jump-second-resonance": boundaries.second_resonance,
    "band-vs-mass": boundaries.jump_over_mass,
    "bands-unchanged": boundaries.bands_over_mass,
    "jump-left": boundaries.jump_left,
    "amp-rise": comparisons.over_mass(+1),
    "amp-fall-inter": comparisons.over_mass(-1),
    "amp-fall-over": comparisons.over_mass(-1),
    "attached-mu01": boundaries.attached_until,
    "attached-mu02": boundaries.attached_until,
    "R-amp-inter": comparisons.ratio_to_inelastic(1.0, 1.0 + SMALL, "rises by at most 5 %"),
    "R-amp-over": comparisons.ratio_to_inelastic(1.0 - SMALL, 1.0, "falls by at most 5 %"),
    "R-same-to-29": comparisons.ratio_to_inelastic(1.0 - ALMOST, 1.0 + ALMOST, "within 2 %"),
    "R-none": comparisons.restitution_without_effect,
    "R1-nonperiodic": boundaries.non_periodic_from,
    "R-nonperiodic-earlier": boundaries.non_periodic_earlier,
    "R-bands": boundaries.bands_over_restitution,
    "R-over-boundary": boundaries.periodic_from_over,
    "NI-below": comparisons.impact_above,
    "NI-mid": comparisons.non_impact_above,
    "NI-over": comparisons.non_impact_over,
    "NI-shape": comparisons.non_impact_shape,
    "quoted-frequencies": quoted.frequencies,
    "layer-damping": quoted.layer_damping,
}


def judge(claim: Claim, evidence: Evidence) -> Finding:
    """Judge a claim; without its branches it does not hold. Failed points are reported, not judged."""
    finding = _judged(claim, evidence)
    failed = _failed(claim, evidence)
    elastic = [key for key in failed if key.restitution == 1.0]
    if elastic:
        finding = _without_elastic(claim, evidence, finding, elastic)
    if not failed:
        return finding
    counts = ", ".join(f"{count} at {name_of(key)}" for key, count in failed.items())
    return finding._replace(measured=f"{finding.measured} (points that failed: {counts})")


def _judged(claim: Claim, evidence: Evidence) -> Finding:
    found = boundaries.band if claim["kind"] == "band" else JUDGES[claim["id"]]
    return found(claim, evidence)


def _without_elastic(claim: Claim, evidence: Evidence, finding: Finding, elastic: list[Key]) -> Finding:
    """Find out whether a claim also fails with R < 1; otherwise it is not judged at R = 1, where points failed."""
    if min(listed(claim["R"])) == 1.0:
        return finding._replace(holds=False, judged=False)
    rest = _judged(claim, evidence.without(elastic))
    if rest.holds:
        return rest._replace(measured=f"with R < 1: {rest.measured}; not judged at R = 1", holds=False, judged=False)
    return finding._replace(measured=f"{finding.measured}; also fails without R = 1")


def _failed(claim: Claim, evidence: Evidence) -> dict[Key, int]:
    """Count the failed points of each branch of a claim, near the frequencies that the claim names."""
    found = {}
    for key, course in evidence.courses.items():
        if _is_about(claim, key):
            pairs = course.branch.scene.exciter_pair[0].pole_pairs
            count = sum(_is_near(claim, supply / pairs) for supply in course.failed)
            if count:
                found[key] = count
    return found


def _is_about(claim: Claim, key: Key) -> bool:
    """Whether a claim is about a branch: it names the mass ratio, and R is in its range."""
    r = listed(claim.get("R", 0.0))
    named = key == Key(key.mass_ratio, key.restitution)
    return named and key.mass_ratio in listed(claim.get("mu", 0.0)) and min(r) <= key.restitution <= max(r)


def _is_near(claim: Claim, frequency: float) -> bool:
    """Whether a synchronous frequency (Hz) belongs to a claim; all do if it names no interval."""
    f = claim.get("within", claim.get("f"))
    return not isinstance(f, list) or f[0] - EDGE <= frequency <= f[-1] + LAG
