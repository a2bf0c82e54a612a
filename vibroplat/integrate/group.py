"""Motions side by side, as engine ``taylor`` carries them in compiled code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import Mode
from vibroplat.hybrid.state import Automaton
from vibroplat.integrate.step_end import statuses
from vibroplat.kernels.compiled import FloatArray, inlined
from vibroplat.kernels.lanes import lanes_record
from vibroplat.model.series import MOTION, MOTION_ALONG, parameter_rows, room

#: Motions side by side: their states, and what an engine knows of each. Flags are 1 or 0.
LANES = MOTION | {
    "y0": (8, 1),  # coordinates and rates where the last step began
    "v0": (8, 1),
    "a": (8, 1),  # accelerations at its end by its polynomial; F_c there is number 7 of the coordinates
    "weights": (8, 1),  # one over the tolerances of rates, then 0
    "force_weight": (1,),
    "noise": (1,),  # difference at the end of the step that may be round-off, in tolerances
    "noisy": (1,),  # flag: it is computed
    "length": (1,),  # duration of the step (s)
    "origin": (1,),  # beginning of the segment (s)
    "done": (1,),  # time in the segment, now and where the last step began (s)
    "done0": (1,),
    "until": (1,),  # longest that the segment may take (s)
    "cap": (1,),  # longest next step (s)
    "target": (1,),  # angle of exciter 1 at which the run ends, or nan (rad)
    "pending": (1,),  # flag: the step is to be confirmed
    "singly": (1,),  # flag: the end of the step needs the code for one motion; 2 if the step is too short
    "doubtful": (1,),  # flag: the step ends outside the model, or where it is not finite
    "idle": (1,),  # flag: there is no motion
    "stale": (1,),  # flag: the series is that of a state that was left again
    "safe_rotation": (1,),  # that of the parameters (rad)
    "period": (1,),  # turn of the synchronous speed (s)
    "counted": (1,),  # steps in this period
    "counted_from": (1,),  # beginning of the period (s)
    "steps": (1,),
    "rejected": (1,),
}
#: Numbers of coordinates and rates, also in sets of four columns side by side.
_WIDE = ("y", "v", "y0", "v0", "a", "weights")
_QUADS = {f"{name}4": (name, (2, 4)) for name in _WIDE}
#: The same with transport.
LANES_ALONG = LANES | MOTION_ALONG | dict.fromkeys(_WIDE, (12, 1))
_MOVING_QUADS = {f"{name}4": (name, (3, 4)) for name in _WIDE}

#: Segments of a motion that nobody reads after which the loop returns to Python; they take some 0.03 s.
UNREAD_SEGMENTS = 1000


class Group(NamedTuple):
    """Motions side by side, as compiled code knows them: what an automaton has, with an axis of lanes in front."""

    p: npt.NDArray[np.void]
    runs: npt.NDArray[np.void]
    recent: FloatArray
    events: npt.NDArray[np.void]
    begins: FloatArray  # of steps
    lengths: FloatArray
    c: FloatArray
    ends: FloatArray
    pieces: npt.NDArray[np.void]
    used: npt.NDArray[np.void]
    start: int
    parameters: int  # address of the first
    words: FloatArray  # the parameters as numbers
    status: npt.NDArray[np.void]
    lanes: Any  # records of lanes: LANES, and of the series
    room: Any
    rows: Any
    degree: int
    keep: bool  # whether steps are kept for observers
    max_steps: int
    moving: Any  # None without transport, which decides what is compiled


def group_of(automata: Sequence[Automaton], degree: int, max_steps: int, *, keep: bool) -> Group:
    """Make a group of automata; that of one shares its memory, of several each has a copy in the group."""
    width = len(automata)

    def joined(values: Sequence[Any]) -> Any:
        arrays = [np.asarray(value)[np.newaxis] for value in values]
        return arrays[0] if width == 1 else np.concatenate(arrays)

    names = ("p", "run", "recent", "events")
    p, runs, recent, events = (joined([getattr(h, name) for h in automata]) for name in names)
    steps = [joined(parts) for parts in zip(*(h.steps for h in automata), strict=True)]
    begins, lengths, c, ends, pieces, used = steps
    moves = bool(automata[0].run["systems"][Mode.STICK] >= 0)
    return Group(
        *(p, runs, recent, events),
        *(begins, lengths, c, ends, pieces, used),
        automata[0].start,
        p.ctypes.data,
        p.view(np.float64).reshape(width, -1),
        statuses(width),
        lanes_record(width, LANES_ALONG if moves else LANES, _MOVING_QUADS if moves else _QUADS),
        room(width, moving=moves),
        parameter_rows(width),
        degree,
        keep,
        max_steps,
        True if moves else None,
    )


@inlined
def keeps(h: Automaton, g: Group) -> bool:
    """Whether the steps of a motion are kept for observers."""
    return g.keep and h.run.unread == 0


@inlined
def is_due(run: Any) -> bool:
    """Count a segment of a motion that nobody reads; whether the loop must return, so that Python sees interrupts."""
    if run.unread > 0:
        run.unread = run.unread % UNREAD_SEGMENTS + 1
    return run.unread == 1
