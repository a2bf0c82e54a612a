"""The program: Ctrl-C ends it with one line from the start, even while the command line is still loading."""

from __future__ import annotations

from vibroplat.system.interrupts import end_at_signals
from vibroplat.system.terminal import open_streams


def main() -> None:
    """Load the command line and run it."""
    open_streams()
    end_at_signals()
    from vibroplat.cli import main as run  # noqa: PLC0415  (loading it takes a while)

    run()


if __name__ == "__main__":
    main()
