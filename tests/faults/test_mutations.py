"""Thousands of spoiled configurations: each becomes a scene, or one line and exit code 2, soon, and nothing else."""

from __future__ import annotations

import json
import math
import os
import socket
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from common.commands import SOON, Done, command, not_a_line, script
from common.limits import cpu_seconds
from common.places import QUICKSTART

from vibroplat import Scene, load_config
from vibroplat.errors import ConfigError
from vibroplat.study.branches import branches

from .mutations import lay_out, seeds, spoiled

SEED = 20
#: Branches that are listed to see that they can be.
LISTED = 200

#: Calls of the operating system that would change something; files opened for writing are noticed too.
_DOING = ("os.system", "os.exec", "os.fork", "os.posix_spawn", "subprocess.", "shutil.", "socket.", "webbrowser.")
_DOING += tuple(f"os.{name}" for name in ("mkdir", "remove", "rename", "rmdir", "link", "symlink", "truncate", "chmod"))
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Watch:
    """Notices what is done to the world; hooks cannot be taken away, so that it sleeps at other times."""

    def __init__(self):
        self.done, self._awake = [], False
        sys.addaudithook(self._notice)

    def _notice(self, event, arguments):
        if not self._awake:
            return
        writing = event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITING
        if writing or event.startswith(_DOING):
            self.done.append(f"{event} {arguments!r}")

    def __enter__(self):
        self.done, self._awake = [], True
        return self

    def __exit__(self, *_):
        self._awake = False


@pytest.fixture(scope="module")
def watched():
    return Watch()


@pytest.fixture
def place(here, monkeypatch):
    """A directory with all configurations, for spoiled ones to be written into."""
    inner = here / "outer/inner"
    lay_out(inner)
    monkeypatch.chdir(inner)
    return inner


def tried(path, number):
    """Load a file, and let the commands refuse a share of what is refused; return what it became and what is wrong."""
    try:
        scene = load_config(path)
    except ConfigError as error:
        told = [Done(2, "", f"vibroplat: {error}\n")]
        if number % 2 == 0:
            told.append(command("run", path))
        if number % 4 == 0:
            told.append(command("sweep", path))
        return "refused", next(filter(None, map(not_a_line, told)), "")
    return "scene", _unusable(scene, path)


def _unusable(scene, path):
    """Say what cannot be done with a scene that was accepted."""
    if Path(scene.name).name != scene.name or scene.name in (".", "..") or not scene.name.isprintable():
        return f"name {scene.name!r}"
    tree = scene.to_tree()
    if Scene.from_tree(tree) != scene or Scene.from_tree(json.loads(json.dumps(tree, allow_nan=False))) != scene:
        return "does not come back from its tree"
    if scene.sweep is None:
        return not_a_line(command("sweep", path))
    if math.prod(map(len, scene.sweep.grid.values())) <= LISTED:
        try:
            branches(scene)
        except ConfigError:
            return not_a_line(command("sweep", path))
    return ""


def files_under(place):
    return sorted(str(path.relative_to(place)) for path in place.rglob("*"))


def fuzz(place, numbers, watched):
    """Try the spoiled files of these numbers; return counts, times (s) and what is wrong, by number."""
    texts = seeds()
    counts, slowest, wrong = Counter(), [], {}
    for directory in {directory for directory, _ in texts}:
        (place / directory / "c.yaml").write_text("")
    outer = place.parents[1]
    before = files_under(outer)
    tried(place / "c.yaml", 0)  # what is loaded late is loaded now
    for number in numbers:
        directory, content = spoiled(texts, SEED, number)
        path = place / directory / "c.yaml"
        path.write_bytes(content)
        began = time.process_time()
        try:
            with watched, cpu_seconds(20.0):
                became, problem = tried(path, number)
        except Exception as error:
            became, problem = "error", f"{type(error).__name__}: {error}"[:200]
        seconds = time.process_time() - began
        counts[became] += 1
        slowest.append((seconds, number))
        if problem or watched.done:
            wrong[number] = (problem, watched.done, content[:300])
        path.write_text("")
    assert files_under(outer) == before
    return counts, sorted(slowest, reverse=True), wrong


@pytest.mark.parametrize(
    "numbers",
    [
        pytest.param(range(40), id="40"),
        pytest.param(range(300, 500), id="200", marks=pytest.mark.long),
        pytest.param(range(3300, 13_300), id="10000", marks=pytest.mark.campaign),
    ],
)
def test_spoiled_configuration_becomes_a_scene_or_one_line(numbers, place, watched, capsys):
    counts, slowest, wrong = fuzz(place, numbers, watched)
    with capsys.disabled():
        print(f"\n{len(numbers)} files: {dict(counts)}, {len(wrong)} wrong; slowest {slowest[:3]}")
    kinds = Counter(problem[:60] for problem, _, _ in wrong.values())
    assert wrong == {}, (kinds, dict(list(wrong.items())[:5]))
    # some files are read three times
    late = [(seconds, number) for seconds, number in slowest if seconds > (1 if number % 2 else 3) * SOON]
    assert late == []
    assert min(counts["refused"], counts["scene"]) > len(numbers) // 10


def test_watch_notices_what_is_done(watched, here):
    with watched:
        (here / "made").mkdir()
        (here / "written").write_text("x")
        os.system("true")
    assert [event.split()[0] for event in watched.done] == ["os.mkdir", "open", "os.system"]
    (here / "more").mkdir()
    assert len(watched.done) == 3


# -- files without an end -------------------------------------------------------------------------------

#: Most memory of a refusal (bytes): what reads on and on ends there and not with the machine.
MEMORY = 3 * 2**30
#: Longest time of the program with its start (s).
STARTED = 6.0


def limited(*arguments, cwd):
    """Run the command line with little memory and time; None where it did not end."""
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))"
    line = [sys.executable, "-c", script(limit), *map(str, arguments)]
    try:
        done = subprocess.run(line, capture_output=True, text=True, timeout=STARTED, check=False, cwd=cwd)
    except subprocess.TimeoutExpired:
        return None
    return Done(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize(
    ("way", "file"),
    [
        ("extended", "fifo"),
        pytest.param("extended", "/dev/zero", marks=pytest.mark.long),
        pytest.param("itself", "socket", marks=pytest.mark.long),
    ],
)
def test_file_without_an_end_is_refused(way, file, here):
    os.mkfifo(here / "fifo")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
    (here / "c.yaml").write_text(f"extends: {file}\n")
    done = limited("run", file if way == "itself" else "c.yaml", cwd=here)
    assert done is not None, "did not end"
    assert not_a_line(done) == ""


def test_grid_of_far_too_many_branches_is_refused_soon(here):
    """Few values make very many combinations."""
    keys = ("contact.restitution", "material.mass_ratio", "material.damping_ratio", "material.lower_share")
    grid = ", ".join(f"{key}: [{', '.join(str(0.001 * k) for k in range(1, 101))}]" for key in keys)
    (here / "c.yaml").write_text(
        f"extends: {QUICKSTART}\nsweep: {{supply_frequency_hz: {{start: 50, stop: 51}}, grid: {{{grid}}}}}\n"
    )
    with cpu_seconds(5.0):
        done = command("sweep", "c.yaml")
    assert not_a_line(done) == ""


@pytest.mark.usefixtures("kernels")
def test_grid_that_no_table_can_hold_is_refused_by_a_run_too(here):
    """A run does not look at the sweep, but writes it down."""
    for grid in ("{contact.restitution: [.nan]}", '{"a\\ud800": [1]}', '{"run.\\ud800": [1]}'):
        plan = f"sweep: {{supply_frequency_hz: {{start: 50, stop: 51}}, grid: {grid}}}\n"
        (here / "c.yaml").write_text(f"run: {{duration_s: 0.01}}\n{plan}")
        assert not_a_line(command("run", "c.yaml")) == ""
        assert not (here / "results").exists()
