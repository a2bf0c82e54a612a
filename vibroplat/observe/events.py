"""The events of a run and their table."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.columns import Column, Columns, labelled
from vibroplat.config.coordinates import Mode
from vibroplat.hybrid.modes import KINDS
from vibroplat.hybrid.state import EVENT, Automaton
from vibroplat.system.memory import Share

#: Columns of the event table.
EVENTS: Columns = {
    "t_s": Column("time"),
    "kind": Column("liftoff, impact, latch or drive", "drive: a corner of the supply's program"),
    "gap_rate_before_m_per_s": Column(
        "rate of the gap before the event", "of a latch: before the first of the impacts it stands for"
    ),
    "gap_rate_after_m_per_s": Column("rate of the gap after the event"),
    "impulse_n_s": Column("impulse between lower layer and platform", "of a latch: the sum over its impacts"),
    "energy_loss_j": Column("energy lost at the event", "of a latch: the sum over its impacts"),
    "contact_force_after_n": Column("contact force after the event", "0 in flight"),
    "mode_after": Column("mode after the event", "attached, flight or bare"),
    "impacts": Column(
        "number of impacts", "1 for an impact, 0 for a liftoff; for a latch counted until round-off of the first speed"
    ),
}
#: Fields of :data:`vibroplat.hybrid.state.EVENT` that these columns hold, in the same order.
FIELDS = ("t", "kind", "rate_before", "rate_after", "impulse", "loss", "force_after", "mode_after", "impacts")

#: Events that are written at a time.
BLOCK = 2**15

#: No events.
NONE = np.zeros(0, EVENT)


def event_table(rows: npt.NDArray[np.void]) -> pd.DataFrame:
    """Make an event table of records of :data:`vibroplat.hybrid.state.EVENT`."""
    table = pd.DataFrame({column: rows[field] for column, field in zip(EVENTS, FIELDS, strict=True)})
    table["kind"] = np.array(KINDS, dtype=object)[rows["kind"]]
    table["mode_after"] = np.array([mode.label for mode in Mode], dtype=object)[rows["mode_after"]]
    return labelled(table, EVENTS)


class Events:
    """Observes a run: keeps its events, records of :data:`vibroplat.hybrid.state.EVENT`.

    Parameters
    ----------
    share
        Bounds the memory that they take.
    """

    def __init__(self, share: Share | None = None) -> None:
        self._kept: list[npt.NDArray[np.void]] = []
        self._share = Share() if share is None else share

    def read(self, h: Automaton) -> None:
        """Copy the list of events; MemoryError if they would take too much memory."""
        if h.run["events"]:
            found = h.events[: h.run["events"]].copy()
            self._share.take(found.nbytes)
            self._kept.append(found)

    @property
    def rows(self) -> npt.NDArray[np.void]:
        """All events so far."""
        if len(self._kept) > 1:
            self._kept = [np.concatenate(self._kept)]
        return self._kept[0] if self._kept else NONE


class EventParts:
    """Observes a run: hands over its event table in parts, and keeps none of them.

    Parameters
    ----------
    take
        Called with each part, the last of which may be shorter.
    """

    def __init__(self, take: Callable[[pd.DataFrame], object]) -> None:
        self._take = take
        self._block = np.zeros(BLOCK, EVENT)
        self._filled = 0
        self._handed_over = False

    def read(self, h: Automaton) -> None:
        """Copy the list of events."""
        found = h.events[: h.run["events"]]
        while found.size:
            added = found[: BLOCK - self._filled]
            self._block[self._filled : self._filled + added.size] = added
            self._filled += added.size
            found = found[added.size :]
            if self._filled == BLOCK:
                self._hand_over()

    def finish(self) -> None:
        """Hand over the rest; a run without events has one part without rows."""
        if self._filled or not self._handed_over:
            self._hand_over()

    def _hand_over(self) -> None:
        self._take(event_table(self._block[: self._filled]))
        self._filled, self._handed_over = 0, True
