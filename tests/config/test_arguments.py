"""Arguments of public functions are validated at the door, in one line, as keys of a configuration are."""

import math

import numpy as np
import pytest

import vibroplat
from vibroplat import Scene, check_run, load, load_config, lyapunov, orbit, simulate, sweep, variation
from vibroplat.errors import ConfigError

SCENE = Scene().replace({"solver.engine": "taylor", "sweep.supply_frequency_hz": {"start": 45.0, "stop": 45.5}})
SHORT = SCENE.replace({"run.duration_s": 0.1})
NO_SCENE = "scene = 'base.yaml'; allowed: a Scene, as load_config(FILE) returns one"


@pytest.mark.parametrize("name", ["simulate", "variation", "orbit", "lyapunov", "check_run", "sweep", "find", "basins"])
def test_the_name_of_a_file_is_no_scene(name):
    with pytest.raises(ConfigError) as caught:
        getattr(vibroplat, name)("base.yaml")
    assert str(caught.value) == NO_SCENE


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: orbit(SCENE, period=10**9), "period = 1000000000; allowed: at most 64"),
        (lambda: orbit(SCENE, period=0), "period = 0; allowed: at least 1"),
        (lambda: orbit(SCENE, tolerance=0), "tolerance = 0; allowed: at least 1e-11"),
        (lambda: orbit(SCENE, [1.0, 2.0]), "state has the shape (2,); allowed: (14,), a full state"),
        (lambda: orbit(SCENE, object()), "guess is not a state; allowed: 14 numbers, "),
        (lambda: orbit(SCENE).sensitivities(5), "keys = 5; allowed: dotted keys, as drive.supply_frequency_hz"),
        (lambda: variation(SCENE, seconds=-1), "seconds = -1; allowed: more than 0.0"),
        (lambda: variation(SCENE, seconds=math.nan), "seconds = nan; allowed: a finite number"),
        (lambda: variation(SCENE, "abc"), "state = 'abc'; allowed: 14 numbers"),
        (lambda: variation(SCENE, [math.inf] * 14), "state = [inf, inf, inf, inf, "),
        (lambda: lyapunov(SCENE, [1.0]), "state has the shape (1,); allowed: (14,), a full state"),
        (lambda: simulate(SCENE, keep="all"), "keep = 'all'; allowed: 'segments', 'table', 'events' or 'summary'"),
        (lambda: simulate(SCENE, variation=5), "variation = 5; allowed: dotted keys, as drive.supply_frequency_hz"),
        (lambda: simulate(SCENE, sink=(1, 2)), "sink = (1, 2); allowed: two functions, or two files of tables"),
        (lambda: simulate(SCENE, start=[1.0]), "start = [1.0]; allowed: a Start"),
        (lambda: simulate(SCENE, engine="taylor"), "engine = 'taylor'; allowed: a function"),
        (lambda: check_run(SCENE, other=5), "other = 5; allowed: a function"),
        (lambda: sweep(SCENE, jobs=0), "jobs = 0; allowed: at least 1"),
        (lambda: sweep(SCENE, executor=5), "executor = 5; allowed: an executor of concurrent.futures"),
        (
            lambda: sweep(SCENE, job=2),
            "unknown key job; did you mean jobs? allowed: scene, jobs, scheduler",
        ),
        (lambda: simulate(SHORT).save(5), "directory = 5; allowed: the name of a file or directory"),
        (lambda: simulate(SHORT).save("x", "foo"), "form = 'foo'; allowed: 'parquet', 'csv'"),
        (lambda: simulate(SHORT).plot("foo"), "kind = 'foo'; allowed: motion, conveying, force, exciters, loads"),
        (lambda: simulate(SHORT).plot(size=5), "option size is unknown; allowed: start, stop"),
        (lambda: load(5), "directory = 5; allowed: the name of a file or directory"),
        (lambda: load_config(5), "path = 5; allowed: the name of a file or directory"),
        (lambda: SCENE.replace(5), "5 is no mapping; allowed: dotted keys and their values"),
        (lambda: Scene.from_tree(5), "scene = 5; allowed: a section of keys and values"),
    ],
)
def test_an_argument_is_refused_in_a_line(call, line):
    with pytest.raises(ConfigError) as caught:
        call()
    assert str(caught.value).startswith(line)


def test_numbers_of_numpy_are_numbers():
    assert orbit(SCENE, period=np.int64(1), tolerance=np.float64(1e-8)).period == 1
