"""Sines and cosines of several angles at once."""

from __future__ import annotations

from vibroplat.kernels.compiled import fused_inline
from vibroplat.kernels.lanes import Lanes, join, nearest, part, select, size


@fused_inline
def sine_cosine(x: Lanes) -> tuple[Lanes, Lanes]:
    """Sine and cosine, to round-off below 1e5 rad.

    π/2 has three parts, the first ones with so many zeros at their ends that their products with a number of quarter
    turns are exact; coefficients on [−π/4, π/4] are those of Moshier, Cephes, 1989.
    """
    n = nearest(x * 0.63661977236758134308)
    r = ((x - n * 1.57079625129699707031) - n * 7.54978941586159635335e-8) - n * 5.39030285815811905290e-15
    z = r * r
    s = (z * 1.58962301576546568060e-10 - 2.50507477628578072866e-8) * z + 2.75573136213857245213e-6
    s = ((s * z - 1.98412698295895385996e-4) * z + 8.33333333332211858878e-3) * z - 1.66666666666666307295e-1
    c = (z * -1.13585365213876817300e-11 + 2.08757008419747316778e-9) * z - 2.75573141792967388112e-7
    c = ((c * z + 2.48015872888517045348e-5) * z - 1.38888888888730564116e-3) * z + 4.16666666666665929218e-2
    s, c = r + r * z * s, 1.0 - 0.5 * z + z * z * c
    quarter = n - 4.0 * nearest(0.25 * n)  # quarter turns, −2 to 2
    quarter = select(quarter < 0.0, quarter + 4.0, quarter)
    odd = size(quarter - 2.0) == 1.0
    a, b = select(odd, c, s), select(odd, s, c)
    lower_half = quarter > 1.5
    # the cosine is the sine a quarter turn later
    behind = (quarter > 0.5) & (quarter < 2.5)
    return select(lower_half, -a, a), select(behind, -b, b)


@fused_inline
def sincos_pair(first: Lanes, second: Lanes) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """Sine and cosine of an angle, then of another, in the time of one of them."""
    sine, cosine = sine_cosine(join(first, second))
    (s1, s2), (c1, c2) = part(sine), part(cosine)
    return s1, c1, s2, c2
