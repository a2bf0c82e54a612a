"""The space that tables of a run need, compared with what there is before anything is integrated."""

from __future__ import annotations

import shutil
from pathlib import Path

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.observe.table import column_count
from vibroplat.system.memory import SHARE, amount, available

#: Bytes of a number in memory and in a Parquet file, and about as many in CSV.
NUMBER, NUMBER_IN_CSV = 8, 20
#: Times that a table is in memory at most, when its parts are put together.
COPIES = 2


def require_disk(scene: Scene, directory: Path, form: str) -> None:
    """Refuse a run whose trajectory table does not fit on the disk.

    Raises
    ------
    ConfigError
        Rows at ``output.sample_rate_hz`` alone, without those at events, need more than is free.
    """
    free = float(shutil.disk_usage(directory).free)
    number = NUMBER_IN_CSV if form == "csv" else NUMBER
    _require(scene, number, free, f"on disk, where {amount(free)} are free")


def require_memory(scene: Scene) -> None:
    """Refuse a run that keeps a trajectory table in memory which has no room for it; raises ConfigError."""
    there = available()
    told = f"of memory with keep='table', where {amount(SHARE * there)} may be taken of {amount(there)} available"
    _require(scene, COPIES * NUMBER, SHARE * there, told)


def _require(scene: Scene, number: int, most: float, told: str) -> None:
    seconds, rate = scene.run.duration_s, scene.output.sample_rate_hz
    rows, columns = seconds * rate, column_count(scene)
    needed = rows * columns * number
    if needed > most:
        raise ConfigError(
            f"output.sample_rate_hz = {rate:g} asks for {rows:.3g} rows of {columns} columns in {seconds:g} s: "
            f"{amount(needed)} {told}; allowed: at most {rate * most / needed:.2g} Hz, or a shorter run.duration_s"
        )
