"""The paper's claims judged by evidence alone, and the scoreboard: each claim with what was measured and a verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.paper.evidence import EDGE, Evidence, PaperCurve
from vibroplat.paper.judges import Claim, Finding, as_list, find
from vibroplat.paper.root_finding import WIDTH
from vibroplat.paper.scenes import claims
from vibroplat.study.branches import SUPPLY, SweepBranch

#: Largest difference (Hz) between synchronous and excitation frequency at a failed point, whose latter is not known.
MAX_LAG = 1.0

#: The table ``claims``, a row for each claim of the paper.
CLAIMS: Columns = {
    "id": Column("name of the claim"),
    "figure": Column("figure of the paper that shows it"),
    "quote": Column("the paper's words"),
    "expected": Column("the claim in numbers"),
    "measured": Column("value measured with the first seed"),
    "seeds": Column("number of seeds with which the claim holds"),
    "margin": Column(
        "distance of the measured value from the limit of the verdict, over the seeds", "below 0 if the claim fails"
    ),
    "verdict": Column("whether the claim is reproduced, and on what that depends"),
    "why": Column("reason of the verdict"),
    "note": Column("comment on the claim"),
}
#: A verdict without a margin rests on less than this: half of the width to which most boundaries are narrowed, and as
#: small a part of the tolerances of other claims.
MIN_MARGINS = {"Hz": 0.25 * WIDTH, "%": 0.25, "rad": 2e-3, "": 0.01}

#: Evidence with other sets of numbers, and their changes of those of the machine.
Others = Sequence[tuple[Mapping[str, Any], Evidence]]


def judge(claim: Claim, evidence: Evidence) -> Finding:
    """Judge a claim; without its branches it does not hold. Failed points are reported, not judged."""
    finding = find(claim, evidence)
    failed = _failed(claim, evidence)
    elastic = [curve for curve in failed if curve.restitution == 1.0]
    if elastic and min(as_list(claim["R"])) == 1.0:
        finding = finding._replace(holds=False, judged=False)
    elif elastic:
        others = {curve: records for curve, records in evidence.branches.items() if curve not in elastic}
        rest = find(claim, replace(evidence, branches=others))
        if rest.holds:
            finding = Finding(f"with R < 1: {rest.measured}; not judged at R = 1", judged=False)
        else:
            finding = finding._replace(measured=f"{finding.measured}; also fails without R = 1")
    if bool(finding.margin >= 0.0) is not bool(finding.holds):  # another condition decides
        finding = finding._replace(margin=math.nan)
    counts = ", ".join(f"{count} at {curve.text}" for curve, count in failed.items())
    return finding._replace(measured=f"{finding.measured} (points that failed: {counts})") if failed else finding


def _failed(claim: Claim, evidence: Evidence) -> dict[PaperCurve, int]:
    """Count the failed points of each branch that a claim is about, near the frequencies that it names, if any.

    It is about the branches whose mass ratios it names, and whose R is in its range.
    """
    mu, r = as_list(claim.get("mu", 0.0)), as_list(claim.get("R", 0.0))
    f = claim.get("within", claim.get("f"))
    low, high = (f[0] - EDGE, f[-1] + MAX_LAG) if isinstance(f, list) else (0.0, math.inf)
    failing = {}
    for curve, (branch, rows) in evidence.branches.items():
        own = curve == PaperCurve(curve.mass_ratio, curve.restitution) and curve.mass_ratio in mu
        if own and min(r) <= curve.restitution <= max(r):
            pairs = branch.scene.exciter_pair[0].pole_pairs  # f_e over these is the synchronous frequency
            failed = [row for row in rows if row["outcome"] != "ok" and low <= row[SUPPLY] / pairs <= high]
            failing[curve] = len(failed)
    return {curve: count for curve, count in failing.items() if count}


def cut(branch: SweepBranch, asked: Sequence[Claim]) -> SweepBranch:
    """Cut an upward branch where none of some claims looks any more; without points if none looks at it at all."""
    mu, r = branch.scene.material.mass_ratio, branch.scene.contact.restitution
    highest = 0.0
    for claim in asked:
        restitutions, f = as_list(claim.get("R", 0.0)), claim.get("f")
        among = "mu" not in claim or mu in (0.0, *as_list(claim["mu"]))
        if among and min(restitutions) <= r <= max(restitutions):
            near = isinstance(f, list) and not is_of_models(claim)  # models are matched at the jump
            highest = max(highest, as_list(f)[-1] + MAX_LAG if near else math.inf)
    pairs = branch.scene.exciter_pair[0].pole_pairs
    return replace(branch, key_values=tuple(supply for supply in branch.key_values if supply / pairs <= highest))


def is_of_models(claim: Claim) -> bool:
    """Whether a claim compares the contact models."""
    return str(claim["id"]).startswith("NI-")


def scoreboard(seeds: Mapping[int, Evidence], others: Others) -> pd.DataFrame:
    """Judge each claim with each seed.

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
        findings = {seed: judge(claim, evidence) for seed, evidence in seeds.items()}
        count = f"{sum(f.holds for f in findings.values())} of {len(findings)}"
        row = (claim["id"], claim["fig"], claim["quote"], expected(claim), next(iter(findings.values())).measured)
        margin, narrow = _margin(list(findings.values()))
        verdict, why = _verdict(claim, findings, others)
        verdict += ", without margin" if narrow else ""
        rows.append((*row, count, margin, verdict, why, claim.get("note", "")))
    return pd.DataFrame(rows, columns=list(CLAIMS))


def _margin(findings: Sequence[Finding]) -> tuple[str, bool]:
    """Return the margins of a claim with several seeds in words, and whether any of them is none to speak of."""
    known = [finding for finding in findings if math.isfinite(finding.margin)]
    if not known:
        return "", False
    margins = sorted(finding.margin for finding in known)
    ends = dict.fromkeys(f"{margin:+.2g}" for margin in (margins[0], margins[-1]))
    return f"{' … '.join(ends)} {known[0].unit}".strip(), min(map(abs, margins)) < MIN_MARGINS[known[0].unit]


def _verdict(claim: Claim, findings: Mapping[int, Finding], others: Others) -> tuple[str, str]:
    """Return the verdict of a claim, and why it is not reproduced."""
    failing = {seed: finding for seed, finding in findings.items() if not finding.holds}
    if not failing:
        return "reproduced", ""
    if len(failing) < len(findings):
        seed, finding = next(iter(failing.items()))
        text = f"holds with {len(findings) - len(failing)} of {len(findings)} seeds"
        return "depends on the seed", f"{text}; seed {seed}: {finding.measured}"
    verdict = "not reproduced" if any(finding.judged for finding in findings.values()) else "not judged at R = 1"
    tried = [(changes, judge(claim, other)) for changes, other in others]
    if any(finding.holds for changes, finding in tried if not changes):
        return verdict, "in coarser steps it holds with the same numbers, so other numbers cannot be tried"
    tried = [(changes, finding) for changes, finding in tried if changes]
    if not tried:
        return verdict, ""
    holding = [pair for pair in tried if pair[1].holds]
    if not holding:
        return verdict, f"nor with any of {len(tried)} other sets of unprinted numbers"
    changes, first = holding[0]
    named = ", ".join(f"{key.split('.')[-1]} {value:g}" for key, value in changes.items())
    more = f" (and with {len(holding) - 1} of the other sets)" if len(holding) > 1 else ""
    return "depends on an unprinted number", f"holds with {named}{more}: {first.measured}"


def expected(claim: Claim) -> str:
    """Return a claim in words."""

    def ends(key: str) -> str:
        values = as_list(claim[key])
        return f"{values[0]:g}" if values[0] == values[-1] else f"{values[0]:g} … {values[-1]:g}"

    parts = [f"{symbol} {ends(key)}" for symbol, key in (("μ", "mu"), ("R", "R")) if key in claim]
    if "f" in claim:
        parts.append(f"f {ends('f')} Hz" + (f" ± {claim['tol']:g}" if "tol" in claim else ""))
    return f"{', '.join(parts)}: {claim.get('regime') or claim['text']}"
