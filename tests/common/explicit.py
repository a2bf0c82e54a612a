"""The equations as solvers of ordinary differential equations ask for them."""

import numpy as np

from vibroplat.kernels.compiled import compiled
from vibroplat.model.accelerations import accelerations
from vibroplat.model.systems import ALGEBRAIC, SIZES


@compiled
def explicit(system, t, y, p):
    """Return y′ of the differential unknowns and, attached, F_c behind it; nan where there are none."""
    size = y.size + 1 if ALGEBRAIC[system] else y.size
    unknowns, rates = np.empty(SIZES[system]), np.empty(SIZES[system])
    for i in range(y.size):
        unknowns[i] = y[i]
    if not accelerations(system, t, unknowns, rates, p):
        rates[:] = np.nan
    elif ALGEBRAIC[system]:
        rates[y.size] = unknowns[y.size]
    return rates[:size]
