"""The paper's claims judged by evidence alone, and the scoreboard: each claim with what was measured and a verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.paper import boundaries, comparisons
from vibroplat.paper.evidence import (
    EDGE,
    IMPACT_KEY,
    NON_IMPACT_KEY,
    Claim,
    Evidence,
    Finding,
    Judge,
    Key,
    listed,
    name_of,
)
from vibroplat.paper.scenes import claims
from vibroplat.study.branches import SUPPLY

_FALLS = comparisons.ordered("falls", (Key(0.2), Key(0.1)), (Key(0.1), Key(0.0)))

#: Judges by the names of claims; all bands have the same judge.
JUDGES: dict[str, Judge] = {
    "sync-deviation": boundaries.deviation,
    "jump-second-resonance": boundaries.second_resonance,
    "band-vs-mass": boundaries.jump_over_mass,
    "bands-unchanged": boundaries.same_bands,
    "jump-left": boundaries.jump_left,
    "amp-rise": comparisons.ordered("rises", (Key(0.0), Key(0.1)), (Key(0.1), Key(0.2))),
    "amp-fall-inter": _FALLS,
    "amp-fall-over": _FALLS,
    "attached-mu01": boundaries.attached_until,
    "attached-mu02": boundaries.attached_until,
    "R-amp-inter": comparisons.ratio_to_inelastic(1.0, 1.05, "rises by at most 5 %"),
    "R-amp-over": comparisons.ratio_to_inelastic(0.95, 1.0, "falls by at most 5 %"),
    "R-same-to-29": comparisons.ratio_to_inelastic(0.98, 1.02, "within 2 %"),
    "R-none": comparisons.restitution_without_effect,
    "R1-nonperiodic": boundaries.non_periodic_from,
    "R-nonperiodic-earlier": boundaries.non_periodic_earlier,
    "R-bands": boundaries.same_bands,
    "R-over-boundary": boundaries.periodic_from_over,
    "NI-below": comparisons.ordered("A_impact > A_nonimpact", (NON_IMPACT_KEY, IMPACT_KEY)),
    # This contradicts amp-rise from 26 to 27.5 Hz, where both are claimed. In steady antiphase the forces of both
    # exciters add along y. Without impacts y is then that of a linear oscillator of mass M:
    # A = 2 m_r r ω²/√((c_y − Mω²)² + ω²(b_y + βm_w)²). At a given ω this falls with β ≥ 0, so A_NI ≤ A(μ = 0), and
    # A_I < A_NI implies A_I(μ) < A(μ = 0). Only β < 0, or a share of m_w that moves with the platform, changes this.
    "NI-mid": comparisons.ordered("A_nonimpact > A_impact", (IMPACT_KEY, NON_IMPACT_KEY)),
    "NI-over": comparisons.non_impact_over,
    "NI-shape": comparisons.non_impact_shape,
    "quoted-frequencies": comparisons.quoted_frequencies,
    "layer-damping": comparisons.layer_damping,
}
#: Largest difference (Hz) between synchronous and excitation frequency at a failed point, whose latter is not known.
LAG = 1.0

#: The table ``claims``, a row for each claim of the paper.
CLAIMS: Columns = {
    "id": Column("name of the claim"),
    "figure": Column("figure of the paper it belongs to"),
    "quote": Column("the paper's words"),
    "expected": Column("what the claim says, in numbers"),
    "measured": Column("what was found with the first seed"),
    "seeds": Column("with how many seeds the claim holds"),
    "verdict": Column("whether the claim is reproduced, and what it depends on"),
    "why": Column("reason of the verdict"),
    "note": Column("comment on the claim"),
}
#: Name of the row that counts the claims in their former wording.
FORMER = "former-wording"

#: Evidence with other sets of numbers, and their changes of those of the machine.
Others = Sequence[tuple[Mapping[str, Any], Evidence]]


def judge(claim: Claim, evidence: Evidence) -> Finding:
    """Judge a claim; without its branches it does not hold. Failed points are reported, not judged."""
    judged = boundaries.band if claim["kind"] == "band" else JUDGES[claim["id"]]
    finding = judged(claim, evidence)
    failed = _failed(claim, evidence)
    elastic = [key for key in failed if key.restitution == 1.0]
    if elastic and min(listed(claim["R"])) == 1.0:
        finding = finding._replace(holds=False, judged=False)
    elif elastic:
        others = {key: course for key, course in evidence.courses.items() if key not in elastic}
        rest = judged(claim, replace(evidence, courses=others))
        if rest.holds:
            text = f"with R < 1: {rest.measured}; not judged at R = 1"
            finding = rest._replace(measured=text, holds=False, judged=False)
        else:
            finding = finding._replace(measured=f"{finding.measured}; also fails without R = 1")
    if not failed:
        return finding
    counts = ", ".join(f"{count} at {name_of(key)}" for key, count in failed.items())
    return finding._replace(measured=f"{finding.measured} (points that failed: {counts})")


def _failed(claim: Claim, evidence: Evidence) -> dict[Key, int]:
    """Count the failed points of each branch that a claim is about, near the frequencies that it names, if any.

    It is about the branches whose mass ratios it names, and whose R is in its range.
    """
    mu, r = listed(claim.get("mu", 0.0)), listed(claim.get("R", 0.0))
    f = claim.get("within", claim.get("f"))
    low, high = (f[0] - EDGE, f[-1] + LAG) if isinstance(f, list) else (0.0, math.inf)
    found = {}
    for key, course in evidence.courses.items():
        if key == Key(key.mass_ratio, key.restitution) and key.mass_ratio in mu and min(r) <= key.restitution <= max(r):
            pairs = course.branch.scene.exciter_pair[0].pole_pairs  # at the supply's share of them, f is synchronous
            supplies = [row[SUPPLY] for row in course.rows if row["outcome"] != "ok"]
            count = sum(low <= supply / pairs <= high for supply in supplies)
            if count:
                found[key] = count
    return found


def scoreboard(seeds: Mapping[int, Evidence], others: Others) -> pd.DataFrame:
    """Judge each claim with each seed; the last row counts the claims in their former wording.

    A claim is reproduced if it holds with all seeds, and depends on the seed if it holds with some. If it holds with
    none, but with other values of what the paper does not print, it depends on an unprinted number; the row says on
    which. Other values are judged by coarser sweeps. If the claim holds by these with the machine's own numbers as well
    (the set without changes), they say nothing about it.

    Parameters
    ----------
    seeds
        The machine's evidence by seed.
    others
        Evidence with other sets of numbers, and their changes of those of the machine.
    """
    rows = []
    for claim in claims():
        found = {seed: judge(claim, evidence) for seed, evidence in seeds.items()}
        verdict, why = _verdict(claim, found, others)
        rows.append(
            {
                "id": claim["id"],
                "figure": claim["fig"],
                "quote": claim["quote"],
                "expected": expected(claim),
                "measured": next(iter(found.values())).measured,
                "seeds": f"{sum(f.holds for f in found.values())} of {len(found)}",
                "verdict": verdict,
                "why": why,
                "note": claim.get("note", ""),
            }
        )
    former = claims("former")
    holding = [[claim["id"] for claim in former if judge(claim, evidence).holds] for evidence in seeds.values()]
    failing = [claim["id"] for claim in former if claim["id"] not in holding[0]]
    last = dict.fromkeys(CLAIMS, "") | {
        "id": FORMER,
        "expected": f"the {len(former)} claims as they were worded at first",
        "measured": f"{len(holding[0])} hold" + (f", not {', '.join(failing)}" if failing else ""),
        "seeds": ", ".join(str(len(ids)) for ids in holding),
        "verdict": f"{len(holding[0])} of {len(former)}",
    }
    return pd.DataFrame([*rows, last])


def _verdict(claim: Claim, found: Mapping[int, Finding], others: Others) -> tuple[str, str]:
    """Return the verdict of a claim, and why it is not reproduced."""
    failing = {seed: finding for seed, finding in found.items() if not finding.holds}
    if not failing:
        return "reproduced", ""
    if len(failing) < len(found):
        seed, finding = next(iter(failing.items()))
        held = f"holds with {len(found) - len(failing)} of {len(found)} seeds"
        return "depends on the seed", f"{held}; seed {seed}: {finding.measured}"
    verdict = "not reproduced" if any(finding.judged for finding in found.values()) else "not judged at R = 1"
    tried = [(changes, judge(claim, other)) for changes, other in others]
    if any(finding.holds for changes, finding in tried if not changes):
        return verdict, "in coarser steps it holds with the same numbers, so other numbers cannot be tried"
    tried = [(changes, finding) for changes, finding in tried if changes]
    holding = [(changes, finding) for changes, finding in tried if finding.holds]
    if holding:
        changes, finding = holding[0]
        more = f" (and with {len(holding) - 1} of the other sets)" if len(holding) > 1 else ""
        return "depends on an unprinted number", f"holds with {_named(changes)}{more}: {finding.measured}"
    if not tried:
        return verdict, ""
    changes, nearest = max(tried, key=lambda pair: pair[1].score)
    count = f"nor with any of {len(tried)} other sets of unprinted numbers"
    return verdict, f"{count}; nearest {_named(changes)}: {nearest.measured}"


def _named(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{key.split('.')[-1]} {value:g}" for key, value in changes.items())


def expected(claim: Claim) -> str:
    """Return a claim in words."""
    parts = [f"{symbol} {_range(claim[key])}" for symbol, key in (("μ", "mu"), ("R", "R")) if key in claim]
    if "f" in claim:
        parts.append(f"f {_range(claim['f'])} Hz" + (f" ± {claim['tol']:g}" if "tol" in claim else ""))
    return f"{', '.join(parts)}: {claim.get('regime') or claim['text']}"


def _range(value: Any) -> str:
    ends = listed(value)
    return f"{ends[0]:g}" if ends[0] == ends[-1] else f"{ends[0]:g} … {ends[-1]:g}"
