"""The command line: a module for each command, or for a few that belong together.

:mod:`~vibroplat.cli.program` has the program and its exit codes, :mod:`~vibroplat.cli.common` what several commands
share. Heavy imports happen inside the commands, so that ``--help`` stays quick.
"""

from vibroplat.cli.program import app, main

__all__ = ["app", "main"]
