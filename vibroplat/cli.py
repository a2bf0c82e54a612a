"""The command line: exit code 0 done, 1 a run failed, 2 bad input. Heavy imports are in the commands."""

from __future__ import annotations

import gc
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroplat import __version__
from vibroplat.errors import VibroplatError

if TYPE_CHECKING:
    from vibroplat.scene import Scene
    from vibroplat.solver.trajectory import Trajectory

#: Exit code that typer makes of Ctrl-C.
INTERRUPTED = 130

app = typer.Typer(
    help="Simulate a vibrating platform with self-synchronizing exciters and material that may leave it.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


class TableFormat(StrEnum):
    """Formats of result tables."""

    parquet = "parquet"
    csv = "csv"


class PlotKind(StrEnum):
    """Figures of a run."""

    motion = "motion"
    force = "force"
    exciters = "exciters"


class BenchName(StrEnum):
    """What can be measured."""

    runtime = "runtime"
    precision = "precision"
    engines = "engines"


def main() -> None:
    """Run the command line and turn errors into one line and an exit code."""
    logging.basicConfig(format="vibroplat: %(message)s")
    # imports make very many objects that stay: looking for garbage among them takes a sixth of a short command
    gc.set_threshold(200_000)
    try:
        code = app(standalone_mode=False)
    except VibroplatError as error:
        sys.exit(_complain(str(error), 2))
    except Exception as error:
        # the base of typer's usage errors is not public; this method is what marks them
        if not hasattr(error, "format_message"):
            raise
        sys.exit(_complain(f"{error.format_message()} Try 'vibroplat --help'.", 2))
    if code == INTERRUPTED:
        _complain("interrupted; tables under their final names are whole", code)
    sys.exit(code if isinstance(code, int) else 0)


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


@app.command()
def run(
    config: Annotated[Path, typer.Argument(help="YAML configuration of a scene.")],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. run.duration_s=2."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory of the results.")] = Path("results"),
    format_: Annotated[TableFormat, typer.Option("--format", help="Format of the tables.")] = TableFormat.parquet,
) -> None:
    """Integrate one scene in time; write trajectory, events, summary and provenance."""
    from vibroplat.config import load_config, parse_overrides
    from vibroplat.provenance import provenance
    from vibroplat.tables import result_directory, write_json, write_table

    scene = load_config(config, parse_overrides(set_ or []))
    directory = result_directory(out, scene.name)
    _tell_of_compilation()
    with _progress(scene) as report:
        from vibroplat.solver.run import simulate

        result = simulate(scene, progress=report)
    write_table(result.trajectory, directory, "trajectory", format_.value)
    write_table(result.events, directory, "events", format_.value)
    write_json(provenance(scene, result.summary["engine"]), directory, "provenance")
    write_json(result.summary, directory, "summary")
    _print_summary(result, directory)
    if result.outcome != "ok":
        print(f"vibroplat: {result.outcome}: {result.summary['detail']}", file=sys.stderr)
        raise typer.Exit(1)


@app.command()
def plot(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="Result directory of a run.")],
    kind: Annotated[list[PlotKind] | None, typer.Option(help="Which figures; all without it.")] = None,
    start: Annotated[float | None, typer.Option(help="Begin of motion and force (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of motion and force (s).")] = None,
) -> None:
    """Draw the figures of a run from its tables alone."""
    from vibroplat.plots import plot_run

    wanted = [k.value for k in (kind or PlotKind)]
    for path in plot_run(directory, wanted, start, stop):
        print(path)


@app.command()
def bench(
    names: Annotated[
        list[BenchName] | None, typer.Argument(metavar="[NAME]...", help="runtime, precision, engines; all if none.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory of the results.")] = Path("results"),
    reference: Annotated[Path, typer.Option(help="Directory of reference tables.")] = Path("tests/reference"),
    repeats: Annotated[int, typer.Option(min=1, help="Runs of which the median is taken.")] = 5,
) -> None:
    """Measure run time, run time against error, engines against each other; tables and plots in OUT/bench."""
    from vibroplat.bench import report
    from vibroplat.bench.timing import machine
    from vibroplat.tables import result_directory

    directory = result_directory(out, "bench")
    print(machine())
    for name in names or list(BenchName):
        report.REPORTS[name.value](directory, reference, repeats)


@app.command()
def schema() -> None:
    """Print the JSON schema of a configuration, for editors."""
    import json

    from vibroplat.config import configuration_schema

    print(json.dumps(configuration_schema(), indent=2))


def _tell_of_compilation() -> None:
    """Say why the first run on a machine takes long."""
    from vibroplat.solver.engines import is_compiled

    if not is_compiled():
        print("vibroplat: compiling the numerical kernels, once, in about half a minute", file=sys.stderr)


@contextmanager
def _progress(scene: Scene) -> Iterator[Callable[[float, int], None] | None]:
    """Show a progress bar on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f}/{task.total:.6g} s, {task.fields[events]} events"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("loading kernels", total=scene.run.duration_s, events=0)

        def report(reached: float, events: int) -> None:
            bar.update(task, completed=reached, events=events, description=scene.name)

        yield report


def _print_summary(result: Trajectory, directory: Path) -> None:
    """Print what a user looks for first; everything is in summary.json."""
    summary = result.summary
    rows = [
        ("outcome", summary["outcome"], ""),
        ("simulated", summary["simulated_s"], "s"),
        ("excitation frequency", summary["excitation_frequency_hz"], "Hz"),
        ("phase difference", summary["phase_difference_rad"], "rad"),
        ("RMS x, y", [summary["rms_x_m"], summary["rms_y_m"]], "m"),
        ("RMS phi", summary["rms_phi_rad"], "rad"),
        ("contact force, largest", summary["contact_force_max_n"], "N"),
        ("impulse, largest", summary["impulse_max_n_s"] or None, "N s"),
        ("flight fraction", summary["flight_fraction"] if result.scene.has_contact else None, ""),
        ("liftoffs, impacts, latches", [summary[k] for k in ("liftoffs", "impacts", "latches")], ""),
        ("energy residual", summary["energy_residual"], ""),
        ("steps, residual calls", [summary["steps"], summary["residual_calls"]], ""),
        ("wall time", summary["wall_s"], "s"),
    ]
    for label, value, unit in rows:
        if value is not None:
            print(f"{label:<28}{_number(value)} {unit}".rstrip())
    print(f"{'tables':<28}{directory}")


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_number(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
