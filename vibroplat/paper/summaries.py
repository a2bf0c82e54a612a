"""Tables over whole branches: synchronization, and the effect of the impact law."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import Column, Columns
from vibroplat.paper.evidence import Evidence, F
from vibroplat.paper.finding import EDGE
from vibroplat.study.branches import SUPPLY

#: The table ``sync-bands``, a row for each stretch of points with the same synchronization.
SYNC_BANDS: Columns = {
    "mass_ratio": Column("mass of the material over that of the machine"),
    "restitution": Column("coefficient of restitution"),
    "model": Column("contact model"),
    "law": Column("impact law"),
    "direction": Column("direction of the branch"),
    "sync": Column("synchronization of the exciters"),
    "points": Column("points of the stretch"),
    "first_hz": Column("excitation frequency of its first point"),
    "last_hz": Column("excitation frequency of its last point"),
    "first_supply_hz": Column("supply frequency of its first point"),
    "last_supply_hz": Column("supply frequency of its last point"),
    "rms_y_largest_m": Column("largest RMS of y"),
}
#: The table ``impact-laws``, a row for each law and restitution.
IMPACT_LAWS: Columns = {
    "impact_law": Column("impact law"),
    "restitution": Column("coefficient of restitution"),
    **{
        f"{side}_{kind}": Column(f"{kind} relative difference of RMS y {side} resonance", "from law conservative")
        for side in ("below", "above")
        for kind in ("largest", "mean")
    },
    "jump_hz": Column("excitation frequency where antiphase ends below the second resonance"),
    "jump_conservative_hz": Column("the same with law conservative"),
}


def sync_bands(evidence: Evidence) -> pd.DataFrame:
    """List the synchronization along each branch: a row for each stretch, with its first and last point.

    Upward and downward branches follow each other, so that their difference shows the hysteresis.
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
    """Compare the curves of each impact law with those of the conservative one, below and above resonance.

    The columns are the largest and the mean relative difference of RMS y at equal excitation frequencies, and jump_hz,
    where antiphase ends below the second resonance. The conservative law itself, computed again with another seed,
    shows how much of a difference is the scatter of non-periodic motion.

    Parameters
    ----------
    evidence
        Branches of the conservative law.
    laws
        Branches of all laws, with another seed.
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
