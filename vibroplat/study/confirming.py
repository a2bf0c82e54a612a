"""Columns of sweeps whose points are confirmed: orbits where the motion repeats, exponents elsewhere."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vibroplat.columns import Column, Columns

#: Multipliers and exponents that a sweep has, the largest ones.
LARGEST = 3


def multiplier_columns(multipliers: npt.NDArray[np.complex128], most: int) -> dict[str, float | None]:
    """Return the columns of so many of the largest multipliers; the last is left out if it is half of a pair."""
    whole = multipliers[:most]
    if multipliers.size > most and multipliers[most] == multipliers[most - 1].conjugate() != multipliers[most - 1]:
        whole = whole[:-1]
    columns: dict[str, float | None] = {}
    for i, found in enumerate([*whole.tolist(), *[None] * (most - whole.size)], 1):
        columns[f"multiplier_{i}_re"] = None if found is None else found.real
        columns[f"multiplier_{i}_im"] = None if found is None else found.imag
    return columns


def describe_multipliers(most: int) -> Columns:
    """Describe the columns of :func:`multiplier_columns`."""
    meanings = dict.fromkeys(range(1, most), "the largest is the first")
    meanings[most] = "empty where only half of a complex pair would have a place"
    return {
        f"multiplier_{i}_{part}": Column(f"{which} part of Floquet multiplier {i}", meaning)
        for i, meaning in meanings.items()
        for part, which in (("re", "real"), ("im", "imaginary"))
    }


#: Columns that a confirmed sweep has besides those of every sweep.
CONFIRMED: Columns = {
    "orbit_excitation_frequency_hz": Column("excitation frequency of the periodic orbit", "by Newton's method"),
    "orbit_rms_x_m": Column("RMS of x about its mean, of the orbit"),
    "orbit_rms_y_m": Column("RMS of y about its mean, of the orbit"),
    "orbit_distance": Column("distance of the settled motion from the orbit", "largest, in the scales of the scene"),
    "orbit_residual": Column("how far the orbit is from closing", "in the scales of the scene"),
    "orbit_unstable": Column("number of Floquet multipliers outside the unit circle"),
    **describe_multipliers(LARGEST),
    **{
        f"exponent_{i + 1}_per_s": Column(f"Lyapunov exponent {i + 1}", "of motion that does not repeat")
        for i in range(LARGEST)
    },
    "confirmation": Column("why there is no orbit, or are no exponents", "empty if they were found"),
}
