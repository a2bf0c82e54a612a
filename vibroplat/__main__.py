"""The program: Ctrl-C ends it with a line from its first moment on, also while the command line is loaded."""

from __future__ import annotations

from vibroplat.interrupts import ending_at_once


def main() -> None:
    """Load the command line, and run it."""
    with ending_at_once():
        from vibroplat.cli import main as run  # noqa: PLC0415  (what takes long to load)

    run()


if __name__ == "__main__":
    main()
