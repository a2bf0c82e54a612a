"""From round to round, for as long as wanted; a soak that was killed goes on with the round that it was in."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from bench.rounds import Row, Size, run_round
from vibroplat.study.fingerprint import code
from vibroplat.study.store import Store, digest

#: Processor time (s) of all rounds after which a long soak ends.
LONG = 24.0 * 3600.0
#: Chain of the store that holds the rows.
ROUNDS = "rounds"
#: Name of directories in which a round is at work.
_WORK = "round-"


def soak(
    directory: Path, *, seconds: float = 0.0, size: Size | None = None, tell: Callable[[Row], object] | None = None
) -> pd.DataFrame:
    """Do rounds and return the rows of all that are finished, with those of former soaks of the same code.

    Parameters
    ----------
    directory
        Where rounds are stored, in a directory for each version of the code and libraries.
    seconds
        Processor time of all rounds together until which it goes on; with 0 one more round is done.
    size
        How much is done in a round.
    tell
        Called with the row of each round that was done here.

    Raises
    ------
    TableError
        The store cannot be written, or another soak is using it.
    """
    size = size or Size()
    with Store(_place(directory, size), {"code": code(), "size": size._asdict()}, resume=True) as store:
        place = _place(directory, size)
        rows = dict(store.read(ROUNDS))
        enough = seconds or math.nextafter(_used(rows), math.inf)
        while _used(rows) < enough:
            number = next(n for n in range(len(rows) + 1) if n not in rows)
            with _work(place) as work:
                rows[number] = run_round(number, size, work)
            store.write(ROUNDS, number, rows[number])
            if tell is not None:
                tell(rows[number])
    return pd.DataFrame([rows[number] for number in sorted(rows)])


def _used(rows: dict[int, Row]) -> float:
    """Return the processor time (s) of rounds."""
    return float(sum(row["processor_s"] for row in rows.values()))


def _place(directory: Path, size: Size) -> Path:
    """Return where the rounds of this code are stored; those of other code count for nothing and are left alone."""
    place = directory / digest(code(), size)[:12]
    place.mkdir(parents=True, exist_ok=True)
    return place


@contextmanager
def _work(place: Path) -> Iterator[Path]:
    """Make an empty directory for a round; remove those of rounds that were killed."""
    for left in place.glob(f"{_WORK}*"):
        shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix=_WORK, dir=place, ignore_cleanup_errors=True) as work:
        yield Path(work).resolve()
