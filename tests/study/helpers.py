"""What several files of these tests share."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import psutil

from vibroplat import load_config, sweep

#: A bare machine, and one with two layers of material on it.
LOADED = Path(__file__).with_name("loaded.yaml")
MACHINE = Path(__file__).parents[1] / "machines" / "damped.yaml"
#: One of the machines that are shipped.
DAMPED = Path(__file__).parents[2] / "configs" / "machines" / "damped.yaml"
#: Head of a configuration.
FLYING = f"extends: {LOADED}\n"

#: Non-periodic motion of the machine.
CHAOTIC = {"material.mass_ratio": 0.2, "material.damping_ratio": 0.005, "drive.supply_frequency_hz": 62.5}


def planned(config, start, stop=None, *, step=0.5, direction="up", changes=None, **plan):
    """Load a configuration as a sweep over these supply frequencies; ``plan`` are other keys of ``sweep``."""
    frequencies = {"start": start, "stop": start if stop is None else stop, "step": step, "direction": direction}
    scene = load_config(config).model_copy(update={"sweep": None})
    return scene.replace({**(changes or {}), "sweep": {"supply_frequency_hz": frequencies, **plan}})


def swept(config, start, stop=None, **options):
    """Sweep a configuration in this process; see :func:`planned`."""
    return sweep(planned(config, start, stop, **options))


def bits(table):
    """All of a table but wall times, each number as the text that reads back as the same number."""
    return table.drop(columns="wall_s", errors="ignore").to_csv(index=False)


def finished_points(directory):
    """Number of points that a running sweep has on disk."""
    try:
        base = sqlite3.connect(f"file:{directory}/points.sqlite?mode=ro", uri=True)
        try:
            return base.execute("SELECT COUNT(*) FROM records").fetchone()[0]
        finally:
            base.close()
    except sqlite3.OperationalError:
        return 0


def loky_workers(pid=None):
    """Worker processes that loky has started from a process, this one without ``pid``."""
    children = psutil.Process(pid).children(recursive=True)
    return [child for child in children if "loky.backend.popen_loky_posix" in " ".join(child.cmdline())]
