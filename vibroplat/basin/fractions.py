"""Basin fractions: their confidence bounds, and their range over a key."""

from __future__ import annotations

from vibroplat.config.digits import percent
from vibroplat.frames import pd

#: Error of bounds: they hold the fraction in 95 of 100 samples.
ALPHA = 0.05


def clopper_pearson(count: int, number: int) -> tuple[float, float]:
    """Return confidence bounds of a fraction, from ``count`` of ``number`` samples; one-sided for none or all.

    Clopper and Pearson (1934), Biometrika 26, 404.
    """
    from scipy.special import betaincinv  # noqa: PLC0415  (half a second)

    tail = ALPHA / 2.0 if 0 < count < number else ALPHA
    low = float(betaincinv(count, number - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, number - count, 1.0 - tail)) if count < number else 1.0
    return low, high


def fractions_over(attractors: pd.DataFrame, key: str) -> dict[str, str]:
    """Return the range of the basin fraction of each attractor over a key, in words; 0 where it is not found."""
    fractions = attractors.pivot_table("fraction", key, "attractor", fill_value=0.0, sort=False)
    ends = {str(name): dict.fromkeys((percent(one.min()), percent(one.max()))) for name, one in fractions.items()}
    return {name: " … ".join(both) for name, both in ends.items()}
