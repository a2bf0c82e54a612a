"""The result of judging a claim, and what all judges share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.paper.evidence import Evidence, Key

Claim = Mapping[str, Any]

#: Allowed error of the ends of a band (Hz of excitation frequency): the paper's step is 0.5 Hz of supply frequency.
EDGE = 0.25


class Finding(NamedTuple):
    """What was found for a claim.

    Attributes
    ----------
    measured
        What was measured, in words.
    holds
        Whether the claim holds.
    score
        How close it is, from 0 to 1.
    judged
        False if it does not hold for the sole reason that points at R = 1 failed.
    """

    measured: str
    holds: bool
    score: float
    judged: bool = True


Judge = Callable[[Claim, Evidence], Finding]


def listed(value: Any) -> list[float]:
    """Return a value of a claim as a list."""
    return list(value) if isinstance(value, Sequence) else [value]


def keys_of(claim: Claim) -> list[Key]:
    """Return the keys of a claim's branches, from its mass ratios and restitutions."""
    return [Key(mu, r) for mu in listed(claim.get("mu", 0.0)) for r in listed(claim.get("R", 0.0))]


def restitutions(evidence: Evidence, mu: float) -> list[Key]:
    """Return the keys of the branches that exist for a mass ratio, in the order of R."""
    return sorted(k for k in evidence.courses if k == Key(mu, k.restitution))


def name_of(key: Key) -> str:
    """Name a branch."""
    return f"μ {key.mass_ratio:g}" + (f", R {key.restitution:g}" if key.restitution else "")


def joined(findings: Mapping[str, Finding]) -> Finding:
    """Join the findings of several branches; all must hold."""
    if len(findings) == 1:
        return next(iter(findings.values()))
    text = "; ".join(f"{name}: {finding.measured}" for name, finding in findings.items())
    return Finding(text, all(f.holds for f in findings.values()), float(np.mean([f.score for f in findings.values()])))


def interval(low: float, high: float) -> str:
    """Return an interval of frequencies (Hz) as text."""
    return f"{low:.2f} … {high:.2f} Hz" if high > low else f"{low:.2f} Hz"


def closeness(off: float, tolerance: float) -> float:
    """Return 1 up to a tolerance; the value falls to 0 at four times the tolerance."""
    return float(np.clip((4.0 - off / tolerance) / 3.0, 0.0, 1.0))
