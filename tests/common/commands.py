"""Commands in this process and in a process of their own, and how they end."""

import contextlib
import gc
import io
import os
import signal
import subprocess
import sys
import time
import traceback
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import psutil

from vibroplat.cli import main

PROGRAM = Path(sys.executable).with_name("vibroplat")

#: Most characters in a refusal.
LONGEST = 600


class Done(NamedTuple):
    """How a command has ended."""

    code: int
    out: str
    err: str


def command(*arguments):
    """Run the command line in this process, which spares the imports."""
    out, err = io.StringIO(), io.StringIO()
    threshold = gc.get_threshold()  # the program raises it
    with (
        mock.patch("sys.argv", ["vibroplat", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as ended:
            code = ended.code
        except Exception:  # Python would print it and exit with 1
            code = 1
            traceback.print_exc()
        finally:
            gc.set_threshold(*threshold)
    return Done(code, out.getvalue(), err.getvalue())


def process(*arguments, **options):
    """Run the command line as a user does."""
    line = [str(PROGRAM), *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False, **options)
    return Done(done.returncode, done.stdout, done.stderr)


def not_a_line(done, codes=(2,)):
    """Say what is wrong with the end of a command that was to end with one line for the user; "" where nothing is.

    Notes on the input may come before it.
    """
    lines = done.err.splitlines()
    if done.code not in codes:
        return f"exit code {done.code}, told {done.err[-300:]!r}"
    if any(not line.startswith("note: ") for line in done.out.splitlines()):
        return f"printed {done.out[:300]!r}"
    if len(lines) != 1 or not done.err.startswith("vibroplat: "):
        return f"told {done.err[-300:]!r}"
    if not lines[0].isprintable() or len(lines[0]) >= LONGEST:
        return f"told {len(lines[0])} characters: {lines[0][:300]!r}"
    return ""


def script(before=""):
    """Return the program as Python text, with something to do first."""
    (entry,) = entry_points(group="console_scripts", name="vibroplat")
    return f"{before}\nfrom {entry.module} import {entry.attr}\n{entry.attr}()\n"


_SENDING = """
import os, pkgutil, signal
holder, calls = pkgutil.resolve_name({holder!r}), 0
original = getattr(holder, {name!r})
def sending(*arguments, **options):
    global calls
    calls += 1
    if calls == {number} and not {after}:
        os.kill(0, {signal})
    result = original(*arguments, **options)
    if calls == {number} and {after}:
        os.kill(0, {signal})
    return result
setattr(holder, {name!r}, sending)
"""


def sending(signal_, function, number=1, *, after=False):
    """Text of a program that gets a signal when it calls a function, e.g. ``os:replace``, for the n-th time.

    Its whole process group gets the signal, as from a terminal, except SIGKILL, which only it gets.
    """
    holder, _, name = function.rpartition("." if "." in function.partition(":")[2] else ":")
    text = _SENDING.format(holder=holder, name=name, number=number, signal=int(signal_), after=after)
    return text if signal_ != signal.SIGKILL else text.replace("os.kill(0,", "os.kill(os.getpid(),")


class Child:
    """A command in a process group of its own, as a terminal starts it."""

    def __init__(self, place, *arguments, before=""):
        self.place = place
        self._out, self._err = ((place / f".{name}").open("w+") for name in ("out", "err"))
        line = [sys.executable, "-c", script(before), *map(str, arguments)]
        self.process = subprocess.Popen(line, cwd=place, stdout=self._out, stderr=self._err, start_new_session=True)

    def end(self, seconds=60.0):
        code = self.process.wait(timeout=seconds)
        for file in (self._out, self._err):
            file.seek(0)
        return Done(code, self._out.read(), self._err.read())

    def members(self):
        """Processes of its group that are alive."""
        found = []
        for process in psutil.process_iter(["status"]):
            with contextlib.suppress(psutil.NoSuchProcess, ProcessLookupError):
                if process.info["status"] != psutil.STATUS_ZOMBIE and os.getpgid(process.pid) == self.process.pid:
                    found.append(process)
        return found

    def close(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        for file in (self._out, self._err):
            file.close()
            Path(file.name).unlink(missing_ok=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def ended(place, *arguments, before=""):
    """Start a command and wait for its end; what it leaves running is killed."""
    with Child(place, *arguments, before=before) as child:
        return child.end()


def until(true, seconds=60.0):
    """Wait until something is true."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


def workers_of(pid=None):
    """Worker processes of a process, this one without ``pid``."""
    children = psutil.Process(pid).children(recursive=True)
    return [child for child in children if "workers import serve" in " ".join(child.cmdline())]
