"""The program: Ctrl-C ends it with a line from its first moment on, also while the command line is loaded."""

from __future__ import annotations

import os
import signal


def _end(number: int, _: object) -> None:
    os.write(2, b"vibroplat: interrupted; nothing was begun\n")
    os._exit(128 + number)


def main() -> None:
    """Load the command line, and run it."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:  # as in the background
        signal.signal(signal.SIGINT, _end)
    from vibroplat.cli import main as run  # noqa: PLC0415  (what takes long to load)

    signal.signal(signal.SIGINT, before)
    run()


if __name__ == "__main__":
    main()
