from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from vibroplat import load_config
from vibroplat.cli import main
from vibroplat.errors import ConfigError
from vibroplat.flow.warm import load_kernels
from vibroplat.study.branches import branches

PROGRAM = Path(sys.executable).with_name("vibroplat")


@pytest.fixture
def complaint(here):
    """Load a text as the configuration c.yaml and list its branches; return what the user is told."""

    def told(text):
        (here / "c.yaml").write_text(text, encoding="utf-8")
        with pytest.raises(ConfigError) as caught:
            branches(load_config("c.yaml"))
        line = str(caught.value)
        assert len(line.splitlines()) == 1
        return line

    return told


@pytest.fixture(scope="session", autouse=True)
def kernels():
    """Compile what a motion needs, so that the command line need not tell that it does."""
    load_kernels()


@pytest.fixture(scope="session")
def vibroplat():
    """Run the command line as a user does."""

    def run(*arguments, **options):
        command = [str(PROGRAM), *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)

    return run


class Done(NamedTuple):
    """How a command has ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def command(monkeypatch, capsys):
    """Run the command line in this process, which spares the imports."""

    def run(*arguments):
        monkeypatch.setattr("sys.argv", ["vibroplat", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return Done(ended.value.code, *capsys.readouterr())

    return run
