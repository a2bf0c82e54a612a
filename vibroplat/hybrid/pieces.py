"""Pieces of a run: steps of one mode without an event between them."""

from __future__ import annotations

from vibroplat.hybrid.starts import move_to
from vibroplat.hybrid.state import Automaton
from vibroplat.hybrid.steps import AFTER_EVENT, CUT
from vibroplat.kernels.compiled import compiled, inlined


@inlined
def last_end(h: Automaton) -> float:
    """When the last step ends (s), in the time of the run."""
    row = h.steps.used.steps - 1
    return h.run.origin + (h.steps.start[row] + h.steps.length[row])


@compiled
def close_piece(h: Automaton, end: float) -> None:
    """Add the open piece to the list of pieces, and move to its end, a time of the run (s)."""
    run, used = h.run, h.steps.used
    system = run.systems[run.mode]
    piece = h.steps.pieces[used.pieces]
    piece.first, piece.end, piece.system = used.first, used.steps, system
    piece.origin, piece.until = run.origin, end
    piece.turns[0], piece.turns[1] = run.turns[0], run.turns[1]
    piece.joined, piece.events = run.joined, run.events
    used.pieces += 1
    used.first = used.steps
    run.joined, run.zeros = AFTER_EVENT, 0
    run.now = end
    if piece.end > piece.first:
        move_to(h, system, h.steps.ends[used.steps - 1])


@compiled
def cut_piece(h: Automaton) -> None:
    """Close the open piece because there is no room for more steps; the next one goes on from its end."""
    if h.steps.used.steps > h.steps.used.first:
        close_piece(h, last_end(h))
        h.run.joined = CUT
