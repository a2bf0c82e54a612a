"""What a worker must have in common with the process that sends it tasks."""

import json
import math
import os
import pickle
import platform
import shutil
import subprocess
import sys

import pytest
from common.clusters import PACKAGE

import vibroplat
from vibroplat.study import fingerprint

#: Prints what a process of its own has.
TELL = "import json; from vibroplat.study.fingerprint import *; print(json.dumps(fingerprint() | code()))"
#: Changes of the environment that make libraries choose what they have for lesser processors.
LESSER = {"C library": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA"}, "BLAS": {"OPENBLAS_CORETYPE": "Prescott"}}


def work(function, *arguments):
    return pickle.dumps((function, arguments))


def of_a_process(path=PACKAGE.parent, **environment):
    """The fingerprint of a process with the package of a directory."""
    environment = os.environ | {"PYTHONPATH": str(path)} | environment
    line = [sys.executable, "-c", TELL]
    return json.loads(
        subprocess.run(line, cwd=path, env=environment, capture_output=True, text=True, check=True).stdout
    )


@pytest.fixture(scope="module")
def mine(kernels):
    return fingerprint.fingerprint()


def test_same_fingerprint_gives_the_result_or_the_error_of_the_task(mine):
    assert fingerprint.run_checked(mine, work(math.sqrt, 4.0)) == {"result": 2.0}
    error = fingerprint.run_checked(mine, work(math.sqrt, -1.0))["error"]
    assert (type(error), str(error)) == (ValueError, "math domain error")


def test_each_difference_is_refused_by_name_before_the_task_is_read(mine):
    libraries = {"SUNDIALS", "scikit-sundae", "numpy", "scipy", "numba", "llvmlite", "LAPACK", "engine"}
    machine = {"platform", "arithmetic", "lanes"}
    assert {"vibroplat", "source files", "Python"} | libraries | machine <= set(mine)
    for name in mine:
        found = fingerprint.run_checked({**mine, name: "other"}, b"not a pickle")
        assert found == {"refused": f"process {os.getpid()} on {platform.node()}: {name} {mine[name]} (here other)"}


def test_all_differences_of_what_both_know_are_named():
    assert fingerprint.difference({"a": "1", "b": "2"}, {"a": "3", "b": "4"}) == "a 3 (here 1), b 4 (here 2)"
    assert fingerprint.difference({"a": "1", "b": "1"}, {"a": "1", "c": "2"}) == ""


def test_a_changed_line_anywhere_changes_the_source_files(tmp_path, monkeypatch):
    before = fingerprint._sources()
    shutil.copytree(PACKAGE, tmp_path / "vibroplat", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(vibroplat, "__file__", str(tmp_path / "vibroplat/__init__.py"))
    assert fingerprint._sources() == before
    for file in ("study/point.py", "__init__.py"):
        with (tmp_path / "vibroplat" / file).open("a") as source:
            source.write("# changed\n")
        now = fingerprint._sources()
        assert now != before
        before = now


def test_reference_motion_has_impacts(kernels):
    outcome, events, _, measures = fingerprint._motion("auto")
    assert (outcome, measures["impacts"] > 5) == ("ok", True)
    assert events > measures["impacts"]


@pytest.mark.long
def test_another_process_has_the_same_fingerprint(mine):
    assert of_a_process(OPENBLAS_NUM_THREADS="2") == mine


@pytest.mark.long
@pytest.mark.parametrize("library", LESSER)
def test_library_that_computes_otherwise_is_another_arithmetic(library, mine):
    found = of_a_process(**LESSER[library])
    if found == mine:
        pytest.skip("this machine's library has no other variant")
    assert [name for name in mine if found[name] != mine[name]] in (["arithmetic"], ["arithmetic", "LAPACK"])
