"""Random sweeps that are disturbed give the same table bit for bit; ``ROUNDS=1000`` makes a soak of it."""

import json
import os
import signal
from subprocess import TimeoutExpired

import matplotlib.image
import numpy as np
import pytest
from common import clusters
from common.commands import Child
from common.random_scenes import Draw, drawn
from common.results import bits

from vibroplat.config.scene import Scene
from vibroplat.results.files import SavedFiles

pytestmark = [pytest.mark.campaign, pytest.mark.usefixtures("kernels")]

#: Longest time of a command (s); one that takes longer hangs.
LONGEST = 3600.0
#: Most kills of a sweep, or of workers during one; dask gives a task up whose worker died more often.
MOST_KILLS = 3


def random_sweep(number):
    """Draw a scene with a sweep below and above its supply frequency; the seed 0 is that of random scenes."""
    rng = np.random.default_rng((number + 1, 0))
    scene = drawn(Draw(rng), "swept")
    turn, supply = 2.0 * np.pi / scene.speed_scale, scene.drive.supply_frequency_hz
    span = supply * float(rng.uniform(0.1, 0.5))
    start = supply - 0.5 * span
    along = {"start": start, "stop": start + 0.9 * span, "step": 0.3 * span, "direction": ["up", "down"]}
    plan = {
        "supply_frequency_hz": along,
        "grid": {"contact.restitution": [0.0, 0.4]},
        "kind": "bifurcation",
        "max_settle_s": 40.0 * turn,
        "measure_s": 4.0 * turn,
        "seed": number,
    }
    return Scene.from_tree(scene.to_tree() | {"sweep": plan})


def killed(here, *arguments, moments):
    """Run a command that is killed so many seconds after each of its starts, and resumed at last."""
    for moment in moments:
        with Child(here, *arguments, "--resume") as child:
            try:
                return child.end(moment)
            except TimeoutExpired:
                os.killpg(child.process.pid, signal.SIGKILL)
    with Child(here, *arguments, "--resume") as child:
        return child.end(LONGEST)


def on_dask(here, *arguments, between, rng):
    """Run a sweep on two workers, which are killed now and then."""
    with (
        clusters.scheduler(here) as (address, _),
        clusters.worker(here, address),
        clusters.worker(here, address),
        Child(here, *arguments, "--scheduler", address) as child,
    ):
        for _ in range(MOST_KILLS):
            try:
                return child.end(between * rng.uniform(0.5, 1.5))
            except TimeoutExpired:
                clusters.kill_workers(address)  # their nannies start others
        return child.end(LONGEST)


@pytest.mark.parametrize("number", range(int(os.environ.get("ROUNDS", "2"))))
def test_disturbed_sweep_gives_the_same_table(number, here):
    pytest.importorskip("distributed")
    (here / "swept.yaml").write_text(json.dumps(random_sweep(number).to_tree()))
    rng = np.random.default_rng()  # no two soaks kill at the same moments
    with Child(here, "sweep", "swept.yaml", "--out", "inline") as child:
        done = child.end(LONGEST)
    assert done.code in (0, 1)
    assert "Traceback" not in done.err
    expected = SavedFiles(here / "inline/swept", "sweep").table("sweep")
    seconds = 0.5 * float(expected["wall_s"].sum()) + 3.0
    moments = seconds * rng.uniform(0.2, 1.0, rng.integers(1, MOST_KILLS + 1))
    ways = {
        "killed": killed(here, "sweep", "swept.yaml", "--jobs", "2", "--out", "killed", moments=moments),
        "dask": on_dask(here, "sweep", "swept.yaml", "--out", "dask", between=0.4 * seconds, rng=rng),
    }
    for way, ended in ways.items():
        assert ended.code == done.code, ended.err
        assert bits(SavedFiles(here / way / "swept", "sweep").table("sweep")) == bits(expected)
    if (expected["outcome"] == "ok").any():
        with Child(here, "plot", "inline/swept") as child:
            assert child.end(LONGEST).code == 0
        for name in ("response", "bifurcation"):
            assert np.ptp(matplotlib.image.imread(here / f"inline/swept/sweep/{name}.png")[..., :3]) > 0.0
