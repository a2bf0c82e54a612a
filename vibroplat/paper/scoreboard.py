"""The scoreboard: each claim of the paper with what was measured and a verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.paper.claims import judge
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.finding import Claim, Finding
from vibroplat.paper.trial import claims, former_claims

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

#: Evidence with other sets of numbers, and their changes of those of the machine.
Others = Sequence[tuple[Mapping[str, Any], Evidence]]

#: Name of the row that counts the claims in their former wording.
FORMER = "former-wording"


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

    Returns
    -------
    DataFrame
        Columns id, figure, quote, expected, measured (with the first seed), seeds (how many it holds with), verdict,
        why (it is not reproduced), note.
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
    return pd.DataFrame([*rows, _former(seeds)])


def _verdict(claim: Claim, found: Mapping[int, Finding], others: Others) -> tuple[str, str]:
    """Return the verdict of a claim, and why it is not reproduced."""
    failing = {seed: finding for seed, finding in found.items() if not finding.holds}
    if not failing:
        return "reproduced", ""
    if len(failing) < len(found):
        seed, finding = next(iter(failing.items()))
        return (
            "depends on the seed",
            f"holds with {len(found) - len(failing)} of {len(found)} seeds; seed {seed}: {finding.measured}",
        )
    verdict, why = _explain([(changes, judge(claim, other)) for changes, other in others])
    if verdict == "not reproduced" and not any(finding.judged for finding in found.values()):
        return "not judged at R = 1", why
    return verdict, why


def _explain(findings: Sequence[tuple[Mapping[str, Any], Finding]]) -> tuple[str, str]:
    """Return the verdict of a claim that fails with all seeds, and why it does."""
    if any(finding.holds for changes, finding in findings if not changes):
        return "not reproduced", "in coarser steps it holds with the same numbers, so other numbers cannot be tried"
    holding = [(changes, finding) for changes, finding in findings if finding.holds]
    if holding:
        changes, finding = holding[0]
        more = f" (and with {len(holding) - 1} of the other sets)" if len(holding) > 1 else ""
        return "depends on an unprinted number", f"holds with {_named(changes)}{more}: {finding.measured}"
    tried = [(changes, finding) for changes, finding in findings if changes]
    if not tried:
        return "not reproduced", ""
    changes, nearest = max(tried, key=lambda pair: pair[1].score)
    why = f"nor with any of {len(tried)} other sets of unprinted numbers; nearest {_named(changes)}: {nearest.measured}"
    return "not reproduced", why


def _former(seeds: Mapping[int, Evidence]) -> dict[str, Any]:
    """Count the claims that hold in their former wording, by seed, and name those that fail with the first."""
    wording = former_claims()
    holding = [[claim["id"] for claim in wording if judge(claim, evidence).holds] for evidence in seeds.values()]
    failing = [claim["id"] for claim in wording if claim["id"] not in holding[0]]
    return {
        "id": FORMER,
        "figure": "",
        "quote": "",
        "expected": f"the {len(wording)} claims as they were worded at first",
        "measured": f"{len(holding[0])} hold" + (f", not {', '.join(failing)}" if failing else ""),
        "seeds": ", ".join(str(len(ids)) for ids in holding),
        "verdict": f"{len(holding[0])} of {len(wording)}",
        "why": "",
        "note": "",
    }


def _named(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{key.split('.')[-1]} {value:g}" for key, value in changes.items())


def expected(claim: Claim) -> str:
    """Return a claim in words."""
    parts = [f"{symbol} {_range(claim[key])}" for symbol, key in (("μ", "mu"), ("R", "R")) if key in claim]
    if "f" in claim:
        parts.append(f"f {_range(claim['f'])} Hz" + (f" ± {claim['tol']:g}" if "tol" in claim else ""))
    return f"{', '.join(parts)}: {claim.get('regime') or claim['text']}"


def _range(value: Any) -> str:
    if not isinstance(value, Sequence):
        return f"{value:g}"
    return f"{value[0]:g}" if value[0] == value[-1] else " … ".join(f"{v:g}" for v in (value[0], value[-1]))
