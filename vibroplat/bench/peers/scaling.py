"""What a run costs as scenes grow: simulated time, events, number of scenes, memory, the whole paper."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

import numpy as np
import pandas as pd

from vibroplat.bench.peers.peers import Peer
from vibroplat.bench.peers.precision import timed
from vibroplat.bench.scenes import base, kinds
from vibroplat.bench.timing import side_by_side
from vibroplat.config.reader import configurations
from vibroplat.study.sweep import sweep

#: Tolerance at which everything here is run.
TOLERANCE = 1e-6

#: A program that says how much memory its peer takes when loaded, and a run more than that at most (kB). What the
#: system counts for the process since it began: the counter of getrusage begins with that of its parent.
_MEMORY = """
import sys
from vibroplat.bench.peers.peers import PEERS
from vibroplat.bench.scenes import kinds
peer = next(peer for peer in PEERS if peer.name == sys.argv[1])
def most():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
def run(seconds):
    peer.prepare(kinds({tolerance}, seconds)["impacts, f_e 50"], {tolerance})(None)
run(0.1)
before = most()
run(float(sys.argv[2]))
print(before, most() - before)
"""


def simulated_time(peers: Sequence[Peer], repeats: int, lengths: Sequence[float] = (1.0, 10.0, 100.0)) -> pd.DataFrame:
    """Run time against simulated time, in contact and with impacts; a linear cost has the same ms per s throughout."""
    runners = {
        (name, peer.name, seconds): peer.prepare(kinds(TOLERANCE, seconds)[name], TOLERANCE)
        for name in ("attached, f_e 46", "impacts, f_e 50")
        for seconds in lengths
        for peer in peers
    }
    rows = [
        {"scene": name, "peer": peer, "simulated_s": seconds, "wall_s": wall}
        for (name, peer, seconds), (wall, _) in timed(runners, repeats).items()
    ]
    return pd.DataFrame(rows).assign(ms_per_s=lambda table: 1e3 * table["wall_s"] / table["simulated_s"])


def events_per_second(repeats: int, seconds: float = 10.0) -> pd.DataFrame:
    """Run time against the number of restarts, over supply frequencies and restitutions; with steps and residuals."""
    found = {
        (restitution, supply): base(TOLERANCE, seconds).replace(
            {"drive.supply_frequency_hz": supply, "contact.restitution": restitution}
        )
        for restitution in (0.0, 0.3, 0.5)
        for supply in (46.0, 50.0, 54.0, 58.0, 66.0, 78.0)
    }
    rows = []
    for (restitution, supply), (walls, summary) in side_by_side(found, repeats).items():
        row = {"restitution": restitution, "supply_frequency_hz": supply, "outcome": summary["outcome"]}
        counts = {f"{key}_per_s": summary[key] / seconds for key in ("events", "restarts", "steps", "residual_calls")}
        rows.append(row | counts | {"ms_per_s": 1e3 * statistics.median(walls) / seconds})
    return pd.DataFrame(rows)


def scenes(repeats: int, counts: Sequence[int] = (16, 64, 256)) -> pd.DataFrame:
    """Run time of sweeps over so many restitutions, 5 s of motion each, on one and on two cores."""
    rows = []
    for count in counts:
        plan = {
            "supply_frequency_hz": {"start": 50.0, "stop": 50.0, "step": 1.0},
            "grid": {"contact.restitution": np.linspace(0.0, 0.5, count).tolist()},
            "settle_s": 4.0,
            "measure_s": 1.0,
        }
        scene = base(TOLERANCE, 1.0).replace({"sweep": plan})
        for jobs in (1, 2):
            walls = []
            for _ in range(repeats):
                began = time.perf_counter()
                sweep(scene, jobs=jobs)
                walls.append(time.perf_counter() - began)
            rows.append({"scenes": count, "jobs": jobs, "wall_s": statistics.median(walls)})
    return pd.DataFrame(rows)


def memory(peers: Sequence[Peer], seconds: Sequence[float] = (10.0, 50.0)) -> pd.DataFrame:
    """Memory of a process that has the peer loaded, and what a run of an impacting scene adds (MB); Linux only."""
    rows = []
    program = _MEMORY.format(tolerance=TOLERANCE)
    for peer in peers:
        for length in seconds:
            done = subprocess.run(
                [sys.executable, "-c", program, peer.name, str(length)], capture_output=True, text=True, check=True
            )
            loaded, added = (int(number) / 1024.0 for number in done.stdout.split())
            rows.append({"peer": peer.name, "simulated_s": length, "loaded_mb": loaded, "added_mb": added})
    return pd.DataFrame(rows)


#: The paper's commands.
FIG_3 = ("Fig. 3: three masses, up and down", ("sweep", str(configurations() / "paper" / "fig3.yaml")))
WHOLE_PAPER = ("whole paper, calibrated machine", ("paper", "--machine", "calibrated"))


def paper(
    commands: Sequence[tuple[str, tuple[str, ...]]] = (FIG_3, WHOLE_PAPER),
    engines: Sequence[str] = ("native", "taylor"),
) -> pd.DataFrame:
    """Wall time of the paper's commands as a user gives them, on all cores, with each engine."""
    jobs = str(os.cpu_count() or 1)
    rows = []
    for name, arguments in commands:
        for engine in engines:
            with tempfile.TemporaryDirectory() as room:
                given = (*arguments, "--engine", engine, "--jobs", jobs, "--out", room)
                began = time.perf_counter()
                done = subprocess.run([sys.executable, "-m", "vibroplat", *given], capture_output=True, check=False)
                wall = time.perf_counter() - began
            rows.append(
                {"what": name, "engine": engine, "jobs": int(jobs), "wall_s": wall, "exit_code": done.returncode}
            )
    return pd.DataFrame(rows)
