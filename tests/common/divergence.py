"""How fast the volume of states changes along a run, by the model alone."""

import numpy as np

from vibroplat.model.accelerations import accelerations, linearize
from vibroplat.model.parameters import parameters

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


def divergence(system, t, y, p):
    """Divergence of the flow of a system's unknowns (1/s)."""
    n, yp = system.differential // 2, np.empty(system.size)
    assert accelerations(system.index, t, y, yp, p)
    jac, mass = np.empty((system.size, system.size)), np.empty((n, n))
    linearize(system.index, t, y, yp, jac, mass, p)
    return -np.trace(np.linalg.solve(mass, jac[n : 2 * n, n : 2 * n]))


def integral_of_divergence(run):
    """Integrate the divergence over a run under a constant supply, between its events."""
    p, total = parameters(run.scene), 0.0
    for segment in run.segments:
        for start, length in zip(segment.t, segment.length, strict=True):
            times = segment.start + start + length * 0.5 * (NODES + 1.0)
            states, *_ = segment(times)
            values = [
                divergence(segment.system, t, segment.system.unknowns(s), p) for t, s in zip(times, states, strict=True)
            ]
            total += 0.5 * length * float(WEIGHTS @ values)
    return total
