"""A run: build the automaton of a scene, let an engine drive it, keep what was asked for."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from typing import Literal

from vibroplat.flow.motion import Motion
from vibroplat.hybrid import loop as hy
from vibroplat.integrate import tape as tp
from vibroplat.integrate.choice import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import SYSTEMS
from vibroplat.observe.summary import measured
from vibroplat.observe.trajectory import Event, Segment, Trajectory
from vibroplat.scene import Mode, Scene

#: What a run keeps besides its summary.
Keep = Literal["segments", "events", "summary"]

#: The measured part is what follows this share of the duration, cut to whole turns of exciter 1.
SETTLE_SHARE = 0.5

_KINDS = ("liftoff", "impact", "latch")


def simulate(
    scene: Scene, *, keep: Keep = "segments", progress: Callable[[float, int], None] | None = None
) -> Trajectory:
    """Integrate a scene in time.

    Parameters
    ----------
    scene
        What to simulate, how long and how accurately.
    keep
        ``segments``: all that tables and dense output need; ``events``: the event table and the summary;
        ``summary``: the summary alone, in memory that does not grow with the length of the run.
    progress
        Called now and then with the time reached (s) and the number of events so far.

    Returns
    -------
    Trajectory
        With ``summary["outcome"]`` ``ok``, or the reason why the run ended early: ``solver-failure``
        (the integrator gave up), ``non-finite`` (a state or residual is not finite), ``event-storm``
        (more events within a turn of the synchronous speed than ``solver.max_events_per_period``),
        ``beyond-model`` (the platform has turned so far that the model, of first order in φ, breaks down).
        What was computed until then is kept; ``summary["detail"]`` has mode, time and state.
    """
    began = time.perf_counter()
    p = parameters(scene)
    segments: list[Segment] = []
    events: list[Event] = []

    def read(tape: tp.Tape, h: hy.Hybrid) -> None:
        if keep == "segments":
            segments.extend(_segments(tape))
        if keep != "summary":
            events.extend(_events(h))
        if progress is not None:
            progress(float(h.clock[hy.NOW]), int(h.measures.totals[:3].sum()))

    with closing(make_engine(scene, p)) as engine:
        motion = Motion(scene, p, engine)
        duration = scene.run.duration_s
        part = motion.go_on(duration, settle=SETTLE_SHARE * duration, read=read)
        run = Trajectory(scene, segments, events, motion.state, part.measures)
        run.summary = {
            "name": scene.name,
            "outcome": motion.outcome,
            "detail": motion.detail,
            "simulated_s": motion.now,
            **measured(part),
            "engine": engine.name,
            "tolerance": scene.solver.tolerance,
            **engine.work,
            "restarts": motion.restarts,
            "wall_s": time.perf_counter() - began,
        }
    return run


def _segments(tape: tp.Tape) -> list[Segment]:
    """Copy the closed pieces of a tape."""
    found = []
    for piece in tape.pieces[: tape.used[tp.PIECES]]:
        system = SYSTEMS[int(piece[tp.SYSTEM])]
        rows = slice(int(piece[tp.FIRST_ROW]), int(piece[tp.LAST_ROW]) + 1)
        offset = tape.t[rows.start]
        found.append(
            Segment(
                system=system,
                start=float(piece[tp.ORIGIN] + offset),
                end=float(piece[tp.END]),
                t=tape.t[rows] - offset,
                y=tape.y[rows, : system.size].copy(),
                yp=tape.yp[rows, : system.size].copy(),
                turns=piece[tp.TURNS_1 : tp.TURNS_2 + 1].copy(),
                joined=bool(piece[tp.JOINED]),
            )
        )
    return found


def _events(h: hy.Hybrid) -> list[Event]:
    """Read the list of events."""
    return [
        Event(
            t_s=float(row[hy.T]),
            kind=_KINDS[int(row[hy.KIND])],
            gap_rate_before_m_per_s=float(row[hy.RATE_BEFORE]),
            gap_rate_after_m_per_s=float(row[hy.RATE_AFTER]),
            impulse_n_s=float(row[hy.IMPULSE]),
            energy_loss_j=float(row[hy.LOSS]),
            contact_force_after_n=float(row[hy.FORCE_AFTER]),
            mode_after=Mode(int(row[hy.MODE_AFTER])).label,
            impacts=int(row[hy.IMPACTS]),
        )
        for row in h.events[: h.flags[hy.EVENTS]]
    ]
