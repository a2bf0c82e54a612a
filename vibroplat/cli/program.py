"""The program: its commands and error messages. Exit codes: 0 done, 1 a simulation failed, 2 bad input."""

from __future__ import annotations

import errno
import gc
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any, get_type_hints

import typer
from typer.core import TyperGroup

from vibroplat import __version__
from vibroplat.cli import bench, figures, reference, run, studies
from vibroplat.errors import VibroplatError
from vibroplat.system.interrupts import offer_resume, records_kept
from vibroplat.system.memory import is_short_of_memory, require_memory
from vibroplat.system.terminal import escape_streams

#: Options that print help.
HELP = ["-h", "--help"]
#: Why a stream cannot be written.
OUTPUT = {errno.EPIPE, errno.ENOSPC, errno.EIO, errno.EFBIG, errno.EBADF, getattr(errno, "EDQUOT", 0)}


#: Commands by purpose.
GROUPS: dict[str, tuple[Callable[..., Any], ...]] = {
    "Begin": (reference.new, reference.inspect),
    "Simulate": (run.run, *studies.COMMANDS),
    "Show results": (figures.plot, figures.report, figures.film, figures.export),
    "Verify": (studies.paper, bench.bench),
    "Look up": (reference.schema, reference.columns),
}


class _Commands(TyperGroup):
    """The group of commands.

    The default of its flags, ``--help`` and those of shell completion, is False: typer would load pydantic for None.
    """

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for title, group in GROUPS.items():
            commands = [self.commands[command.__name__] for command in group]
            with formatter.section(title):
                formatter.write_dl([(command.name, command.get_short_help_str(80)) for command in commands])

    def get_params(self, ctx: Any) -> Any:
        options = super().get_params(ctx)
        for option in options:
            if getattr(option, "is_flag", False) and option.default is None:
                option.default = False
        return options


app = typer.Typer(
    cls=_Commands,
    help="Simulate a vibrating platform with self-synchronizing exciters, and material that may lift off.",
    invoke_without_command=True,
    context_settings={"help_option_names": HELP},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help, in half the time
)


def main() -> None:
    """Run the command line and turn errors into one line and an exit code."""
    # imports create many objects that stay alive; collecting garbage among them takes a sixth of a short command
    gc.set_threshold(200_000)
    os.environ["MPLBACKEND"] = "Agg"  # figures are written to files, whatever the user draws with otherwise
    offer_resume(False)
    escape_streams()
    try:
        code = app(prog_name="vibroplat", standalone_mode=False)
        sys.stdout.flush()
    except VibroplatError as error:
        sys.exit(_complain(str(error), error.exit_code))
    except (MemoryError, ImportError, RuntimeError, OSError) as error:
        if is_short_of_memory(error):
            sys.exit(_complain(f"not enough memory{records_kept()}", 1))
        if not isinstance(error, OSError):
            raise
        sys.exit(_complain(_reason(error), 1))
    except Exception as error:
        # typer's base class of usage errors is not public; this method identifies them
        if not hasattr(error, "format_message"):
            raise
        command = getattr(getattr(error, "ctx", None), "command_path", "vibroplat")
        sys.exit(_complain(f"{error.format_message().rstrip('.')}. Try '{command} -h'.", 2))
    sys.exit(code if isinstance(code, int) else 0)


def _reason(error: OSError) -> str:
    """Describe an operating-system error; errors of standard output do not contain its name."""
    what = error.strerror or str(error)
    if error.errno in OUTPUT and not error.filename:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the rest of the output has nowhere to go
        return f"standard output cannot be written: {what}"
    return f"{f'{error.filename}: ' if error.filename else ''}{what}{records_kept()}"


def _complain(text: str, code: int) -> int:
    print(f"vibroplat: {' '.join(text.split())}", file=sys.stderr)
    return code


def _show_version(wanted: bool) -> None:
    if wanted:
        print(f"vibroplat {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())
    elif not {*HELP} & {*sys.argv}:
        import logging  # help needs none

        logging.basicConfig(format="vibroplat: %(message)s")
        # as in workers: further threads take 0.3 GB each and are of no use, but round sums otherwise
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        require_memory()


for group in GROUPS.values():
    for command in group:
        command.__annotations__ = get_type_hints(command, include_extras=True)  # typer would evaluate them three times
        app.command()(command)
