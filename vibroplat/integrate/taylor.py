"""Engine ``taylor``: the Taylor series of the index-reduced DAE itself, in compiled code.

A one-step method of high order: it has its full order at once after an impact, its steps are polynomials without
further work, and it takes four to six of them a turn where IDA, of order 5, takes hundreds. It is explicit: a layer or
motor that is stiff against the excitation makes its steps short even where it does not move, which the run then says.
"""

from __future__ import annotations

import math

from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import Automaton
from vibroplat.integrate.expansion import STATUS, Expansion, drive
from vibroplat.kernels.lanes import in_lines
from vibroplat.model.parameters import Parameters
from vibroplat.model.series import HIGHEST, room

#: Degree of the series at tolerance 1e-6, and degrees more for each power of ten below it. At equal errors degrees from
#: 14 to 22 take equal times within a tenth at this tolerance, and higher ones at tighter tolerances.
DEGREE, MORE = 17, 1.5
LEAST = 10

#: Steps within a period after which the integrator is taken to be stuck, and those for each event that a scene allows
#: within a period, where that is more.
MAX_STEPS, STEPS_PER_EVENT = 300_000, 60


def degree_of(tolerance: float) -> int:
    """Choose the degree of the series for a tolerance."""
    return min(max(round(DEGREE - MORE * (math.log10(tolerance) + 6.0)), LEAST), HIGHEST)


class TaylorEngine:
    """Taylor series of high order, driven in compiled code.

    Parameters
    ----------
    scene
        Its tolerance.
    p
        Parameters of the scene.
    """

    name = "taylor"
    #: Few enough to stay in the processor's cache until they are read.
    rows = 512
    #: A restart costs nothing, and angles lose digits as they grow.
    turns_per_segment: float = 10

    def __init__(self, scene: Scene, p: Parameters) -> None:
        self.degree = degree_of(scene.solver.tolerance)
        self._p = p  # not a copy: a drive's program changes it in place
        self._status = in_lines((STATUS.itemsize // 8,)).view(STATUS)
        self._status["degree"] = self.degree
        self._status["most"] = max(MAX_STEPS, STEPS_PER_EVENT * scene.solver.max_events_per_period)
        self._e = Expansion(room(), self._status[0])

    @property
    def work(self) -> dict[str, int | None]:
        """How much was done so far."""
        status = self._status[0]
        return {
            "steps": int(status["steps"]),
            "residual_calls": None,
            "jacobian_calls": None,
            "error_test_failures": int(status["rejected"]),
            "newton_failures": None,
        }

    @property
    def detail(self) -> str:
        """Why the integrator failed."""
        status = self._status[0]
        if status["counted"] > status["most"]:
            return f"taylor: more than {int(status['most'])} steps within a period"
        return "taylor: no step is short enough" if status["short"] else "the series is not finite"

    def advance(self, h: Automaton) -> None:
        """Go on with a run; see :class:`vibroplat.integrate.seam.Engine`."""
        drive(h, self._e)

    def close(self) -> None:
        """Do nothing: Python frees what the engine holds."""
