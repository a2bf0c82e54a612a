"""Killed at several moments and resumed with one job and two, answers are the same tables."""

import re
import signal

import pytest
from common.commands import ended, process, sending
from common.places import ROOT
from common.results import bits, read

from vibroplat.motion.run import load_kernels

pytestmark = [pytest.mark.usefixtures("kernels"), pytest.mark.faults]

HEAD = f"extends: {ROOT}/configs/machines/calibrated.yaml\nname: c\nsolver: {{engine: taylor}}\n"
PHASE, SPEED = "run.initial.phase_difference_rad", "run.initial.speed_ratio"
QUESTIONS = {
    "find": "drive: {supply_frequency_hz: 58.0}\nfind: {key: material.mass_ratio, start: 0.2, stop: 0.4, scan: 5, "
    "expression: rms_y_m > 7e-4, tolerance: 1.0e-3}\n",
    "basins": "drive: {supply_frequency_hz: 62.3}\nmaterial: {mass_ratio: 0.0}\n"
    f"basins: {{initial_conditions: {{{PHASE}: [-3.0, 3.0, 14], {SPEED}: [0.0, 1.1, 8]}}}}\n",
    "design": "drive: {supply_frequency_hz: 55.0}\nmaterial: {mass_ratio: 0.1}\ndesign: {keys: "
    "{machine.unbalance_radius_m: [0.018, 0.048], drive.supply_frequency_hz: [46.75, 60.5]}, minimize: motor_power_w, "
    'constraints: {rms_y_m: ">= 0.5e-3"}, parameter_tolerances: {machine.platform_mass_kg: 0.05}, '
    "samples: 6, starts: 2}\n",
    "orbits": "material: {mass_ratio: 0.2}\norbits: {key: drive.supply_frequency_hz, start: 42.0, stop: 64.0, "
    "switch: [], boundaries: {key: material.mass_ratio, start: 0.19, stop: 0.21, max_points: 4}}\n",
}
#: Where commands are killed, one after the other, and with how many jobs.
MOMENTS = [
    ("vibroplat.study.store:Store.write", {"number": 2}, 1),
    ("vibroplat.study.store:Store.write", {"number": 1, "after": True}, 2),
    ("vibroplat.study.store:Store.write", {"number": 3}, 1),
    ("os:replace", {"number": 2}, 2),
]


def tables(directory):
    return {path.name: bits(read(path)) for path in directory.glob("[a-z]*.parquet")}


@pytest.mark.parametrize("name", QUESTIONS)
def test_killed_and_resumed_with_one_job_and_two_the_answer_is_the_same(name, here):
    load_kernels("taylor")  # a command that compiles them says so
    (here / "c.yaml").write_text(HEAD + QUESTIONS[name])
    done = process(name, "c.yaml", "--out", "alone")  # here numpy may have several threads, which round otherwise
    assert (done.code, done.err) == (0, "")
    killed = 0
    for function, moment, jobs in MOMENTS:
        stop = sending(signal.SIGKILL, function, **moment)
        done = ended(here, name, "c.yaml", "--resume", "--jobs", jobs, before=stop)
        assert done.code in (0, -signal.SIGKILL), done.err
        killed += done.code != 0
    assert killed >= 3
    done = process(name, "c.yaml", "--resume", "--jobs", "2")
    assert (done.code, done.err) == (0, "")
    assert re.search(r", \d+ of the|\d+ .* from before", done.out), done.out
    found = tables(here / f"results/c/{name}")
    assert found
    assert found == tables(here / f"alone/c/{name}")
