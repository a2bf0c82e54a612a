"""Judges of claims about numbers in the paper: the frequencies that it quotes, and the damping of the layers."""

from __future__ import annotations

import math

import numpy as np

from vibroplat.config.sections import Material
from vibroplat.paper.evidence import Evidence, F, Key, error_of
from vibroplat.paper.finding import Claim, Finding


def frequencies(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the frequencies that the paper quotes are points of its own steps of supply frequency.

    Each must be that of a point of antiphase motion on the curve with R = 0, within the tolerance of the claim and, if
    the motion is not periodic, two standard errors.
    """
    rows = [row for row in evidence.rows(Key(claim["mu"])) if row["sync"] == "antiphase"]
    points = [(float(row[F]), error_of(row, F)) for row in rows]
    nearby, hits = [], []
    for f, tolerance in claim["quoted"]:
        nearest = min(points, key=lambda point: abs(point[0] - f), default=(0.0, 0.0))
        hits.append(abs(nearest[0] - f) <= tolerance + 2.0 * nearest[1])
        nearby.append(f"{f:g}: {nearest[0]:.2f} Hz")
    return Finding(f"nearest points {', '.join(nearby)}", all(hits), float(np.mean(hits)))


def layer_damping(claim: Claim, evidence: Evidence) -> Finding:
    """Judge whether the damping between the layers is subcritical, but excludes intensive relative vibration.

    The damping ratio is ζ = b_w/(2√(c_w m_w2)), that of the upper layer on a lower one in contact. If the lower layer
    moves harmonically, the upper one moves relative to it by at most 1/(2ζ√(1 − ζ²)) of its amplitude (ζ < 1/√2), which
    is 1.15 for ζ = 1/2. More counts as intensive; ζ < 1 is subcritical. In flight, with both layers free, the ratio is
    ζ√(1 + m_w2/m_w1); it is reported, not judged.
    """
    course = evidence.courses.get(Key(claim["mu"]))
    material = course.branch.scene.material if course else None
    if course is None or material is None or material.layers == 1:
        return Finding("no two layers", False, 0.0)
    low, high = claim["ratio"]
    upper = (1.0 - material.lower_share) * material.mass_ratio * course.branch.scene.machine.total_mass
    ratio = _damping_ratio(material, upper)
    flying = ratio / math.sqrt(material.lower_share)
    text = f"damping ratio {ratio:.3g}, {flying:.3g} in flight"
    return Finding(text, low <= ratio < high, min(ratio / low, high / ratio, 1.0) if ratio > 0.0 else 0.0)


def _damping_ratio(material: Material, mass: float) -> float:
    if material.damping_ratio is not None:
        return material.damping_ratio
    if material.natural_frequency_hz is not None:
        critical = 4.0 * math.pi * material.natural_frequency_hz * mass
    else:
        critical = 2.0 * math.sqrt((material.stiffness_n_per_m or math.inf) * mass)
    return (material.damping_n_s_per_m or 0.0) / critical
