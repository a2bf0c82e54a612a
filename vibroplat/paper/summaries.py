"""Tables of what branches show as a whole: how the exciters turn, and what the impact law changes."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.paper.evidence import Evidence, F
from vibroplat.paper.finding import EDGE
from vibroplat.study.branches import SUPPLY


def sync_bands(evidence: Evidence) -> pd.DataFrame:
    """List how the exciters turn along each branch: a row for each stretch, with its first and last point.

    Branches upward and downward stand one after the other, so their difference is the hysteresis.
    """
    rows = []
    for key, course in sorted(evidence.courses.items()):
        for sync, stretch in groupby(course.rows, key=lambda row: str(row["sync"])):
            points = list(stretch)
            first, last = points[0], points[-1]
            rows.append(
                key._asdict()
                | {
                    "sync": sync,
                    "points": len(points),
                    "first_hz": first[F],
                    "last_hz": last[F],
                    "first_supply_hz": first[SUPPLY],
                    "last_supply_hz": last[SUPPLY],
                    "rms_y_largest_m": max(row["rms_y_m"] for row in points),
                }
            )
    return pd.DataFrame(rows)


def impact_laws(evidence: Evidence, laws: Evidence) -> pd.DataFrame:
    """Compare the curves of each impact law with that of `conservative`, below and above resonance.

    The differences are those of RMS y over that of `conservative` at equal excitation frequencies, largest and
    mean; jump_hz is where antiphase ends below the second resonance. `conservative` itself, computed once more with
    another seed, tells how much of a difference is the scatter of motions that are not periodic.
    """
    rows = []
    for key in sorted(laws.courses):
        reference = key._replace(law="conservative")
        row: dict[str, Any] = {"impact_law": key.law, "restitution": key.restitution}
        for name, low, high in (("below", 21.0, 31.0), ("above", 35.5, 40.0)):
            at = np.arange(low, high + 1e-9, EDGE)
            other, _ = laws.curve(key, "rms_y_m", at)
            curve, _ = evidence.curve(reference, "rms_y_m", at)
            change = np.abs(other / curve - 1.0)
            known = change[np.isfinite(change)]
            row[f"{name}_largest"] = known.max() if known.size else np.nan
            row[f"{name}_mean"] = known.mean() if known.size else np.nan
        for label, source, which in (("jump_hz", laws, key), ("jump_conservative_hz", evidence, reference)):
            jump = source.end_of(which, "antiphase", 20.0)
            row[label] = jump.before[F] if jump else np.nan
        rows.append(row)
    return pd.DataFrame(rows)
