"""The command line. Exit codes: 0 done, 1 a run failed, 2 bad input. Heavy imports happen inside the commands."""

from __future__ import annotations

import gc
import logging
import os
import sys
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from vibroplat import __version__
from vibroplat.errors import ConfigError, VibroplatError
from vibroplat.interrupts import KEPT
from vibroplat.progress import calibration_progress, run_progress, sweep_progress
from vibroplat.study import WAIT
from vibroplat.surroundings import COMPILING, is_short_of_memory, require_memory

if TYPE_CHECKING:
    from vibroplat.observe.trajectory import Trajectory
    from vibroplat.study.checking.agreement import RunCheck
    from vibroplat.study.checking.courses import Course
    from vibroplat.study.checking.sweeps import SweepCheck
    from vibroplat.study.execution import Pool

#: Failed points of a sweep that are reported one by one.
TOLD = 5


class _Commands(TyperGroup):
    """The group of commands.

    The default of ``--help`` is False: typer would load pydantic to convert None.
    """

    def get_help_option(self, ctx: Any) -> Any:
        option = super().get_help_option(ctx)
        if option is not None:
            option.default = False
        return option


app = typer.Typer(
    cls=_Commands,
    help="Simulate a vibrating platform with self-synchronizing exciters and material that may leave it.",
    invoke_without_command=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help, in half the time
)


class TableFormat(StrEnum):
    """Formats of result tables."""

    parquet = "parquet"
    csv = "csv"


class PlotKind(StrEnum):
    """Figures: the first three show a run, the others a sweep."""

    motion = "motion"
    force = "force"
    exciters = "exciters"
    response = "response"
    bifurcation = "bifurcation"
    map = "map"


class Abscissa(StrEnum):
    """Frequencies that a sweep is drawn over: capture by a resonance shows over that of the supply."""

    excitation = "excitation"
    supply = "supply"


class FigureFormat(StrEnum):
    """Formats of figures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


class BenchName(StrEnum):
    """Names of the benchmarks."""

    runtime = "runtime"
    precision = "precision"
    engines = "engines"
    sweeps = "sweeps"
    stability = "stability"
    soak = "soak"
    peers = "peers"
    taylor = "taylor"


# Options shared by several commands.
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. run.duration_s=2. May be repeated."),
]
EngineName = Annotated[
    str | None, typer.Option("--engine", metavar="NAME", help="Integrator, short for --set solver.engine=NAME.")
]
Out = Annotated[Path, typer.Option(help="Directory for the results.")]
Format = Annotated[TableFormat, typer.Option("--format", help="File format of the tables.")]
Jobs = Annotated[int, typer.Option(min=1, help="Number of worker processes.")]
Resume = Annotated[bool, typer.Option("--resume", help="Resume an interrupted command.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Discard an unfinished command's points and start over.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Run on a dask cluster: address of its scheduler, e.g. tcp://host:8786.")
]
Wait = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="S", help="With --scheduler: end after S seconds without a worker. After 5 s a line says so."
    ),
]


def main() -> None:
    """Run the command line and turn errors into one line and an exit code."""
    logging.basicConfig(format="vibroplat: %(message)s")
    # imports create many objects that stay alive; collecting garbage among them takes a sixth of a short command
    gc.set_threshold(200_000)
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
    except VibroplatError as error:
        sys.exit(_complain(str(error), error.exit_code))
    except (MemoryError, ImportError, RuntimeError, OSError) as error:
        if is_short_of_memory(error):
            sys.exit(_complain(f"not enough memory; {KEPT}", 1))
        if not isinstance(error, OSError):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # the rest of the output has nowhere to go
        sys.exit(_complain(f"standard output cannot be written: {error.strerror or error}", 1))
    except Exception as error:
        # typer's base class of usage errors is not public; this method identifies them
        if not hasattr(error, "format_message"):
            raise
        sys.exit(_complain(f"{error.format_message()} Try 'vibroplat --help'.", 2))
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
    elif "--help" not in sys.argv:
        require_memory()


@app.command()
def run(
    config: Annotated[Path, typer.Argument(help="Configuration file (YAML).")],
    set_: Settings = None,
    engine: EngineName = None,
    check: Annotated[
        bool, typer.Option("--check", help="Run the scene with another engine too, and compare both; six runs in all.")
    ] = False,
    out: Out = Path("results"),
    format_: Format = TableFormat.parquet,
) -> None:
    """Simulate one scene in time.

    Writes trajectory, events, summary and provenance to OUT/NAME and prints the summary. With --check, exit code 1 says
    that two engines disagree.
    """
    from vibroplat.config import load_config, parse_overrides
    from vibroplat.flow.beginning import beginning
    from vibroplat.provenance import provenance
    from vibroplat.results import write_result
    from vibroplat.tables import GrowingTable, result_directory

    scene = load_config(config, parse_overrides(set_ or [], engine))
    beginning(scene)  # what is wrong with it is told before anything is written or compiled
    source = scene.run.initial.from_
    if source is not None and Path(source).resolve() == (out / scene.name).resolve():
        raise ConfigError(f"run.initial.from = {source!r} is where this run would be written; allowed: another name")
    directory = result_directory(out, scene.name)
    _tell_of_compilation(scene.solver.engine)
    from vibroplat.flow.keeping import Sink
    from vibroplat.flow.space import require_disk

    require_disk(scene, directory, format_.value)
    if check:
        from vibroplat.study.checking.changes import require_other_engine

        require_other_engine(scene)
    _load_kernels(scene.solver.engine)
    trajectory, events = (GrowingTable(directory, name, format_.value) for name in ("trajectory", "events"))
    with trajectory, events:
        with run_progress(scene.name, scene.run.duration_s) as report:
            from vibroplat.flow.run import simulate

            sink = Sink(trajectory.append, events.append)
            if check:
                from vibroplat.study.checking.courses import Course

                course = Course(scene, sink).run(report)
            result = course.result if check else simulate(scene, keep="summary", sink=sink, progress=report)
        found = _check_run(course) if check and result.outcome != "out-of-memory" else None
        summary = result.summary | {"notes": result.notes} | ({} if found is None else {"check": found.to_tree()})
        origin = provenance(scene, summary["engine"], result.origin)
        tables = {"trajectory": trajectory, "events": events}
        write_result(directory, "run", origin, tables, {"summary": summary}, form=format_.value)
    _print_summary(result, directory)
    _print_notes(result.notes)
    if found is not None:
        for label, text in found.lines().items():
            print(f"{label:<28}{text}")
    if result.outcome != "ok":
        print(f"vibroplat: {result.outcome}: {result.summary['detail']}", file=sys.stderr)
    if found is not None and not found.agrees:
        print(f"vibroplat: engines disagree {found.disagreement}", file=sys.stderr)
    if result.outcome != "ok" or (found is not None and not found.agrees):
        raise typer.Exit(1)


def _check_run(course: Course) -> RunCheck:
    """Compare a finished run with that of another engine."""
    from vibroplat.study.checking.runs import RUNS, compared

    scene = course.scene
    with run_progress(f"{scene.name}, check", RUNS * scene.run.duration_s) as report:
        return compared(course, progress=report)


@app.command()
def sweep(
    config: Annotated[Path, typer.Argument(help="Configuration file with a sweep section.")],
    set_: Settings = None,
    engine: EngineName = None,
    check: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Repeat this share of the points with another engine, and compare both."),
    ] = None,
    out: Out = Path("results"),
    jobs: Jobs = 1,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    format_: Format = TableFormat.parquet,
) -> None:
    """Sweep over supply frequencies and a grid of values.

    Writes a table with one row per point to OUT/NAME. With --check, exit code 1 says that two engines disagree.
    """
    from vibroplat.config import load_config, parse_overrides
    from vibroplat.study.branches import branches
    from vibroplat.study.choice import chosen, require_share

    if check is not None:
        require_share(check)
    scene = load_config(config, parse_overrides(set_ or [], engine))
    planned = branches(scene)
    places = [] if check is None else chosen(scene, check)
    _require_scheduler(scheduler)
    from vibroplat.results import Result, read_provenance
    from vibroplat.study.store import Store
    from vibroplat.tables import result_directory

    directory = result_directory(out, scene.name)
    if resume and (directory / "provenance.json").exists():
        read_provenance(directory, "sweep")
    _tell_of_compilation(scene.solver.engine)
    from vibroplat.study import report
    from vibroplat.study.checking.changes import require_other_engine
    from vibroplat.study.checking.sweeps import check_points
    from vibroplat.study.execution import pool
    from vibroplat.study.sweep import conditions, run_sweeps

    engines = [scene.solver.engine, *([require_other_engine(scene)] if places else [])]

    points = sum(len(branch.frequencies) for branch in planned)
    began = time.perf_counter()
    with Store(directory, conditions(scene), resume=resume, overwrite=overwrite) as store:
        stored = store.lengths()
        left = sum(stored.get(branch.number, 0) < len(branch.frequencies) for branch in planned)
        _load_kernels(*engines)
        found = None
        with pool(jobs, scheduler, wait=wait, chains=max(left, len(places))) as workers:
            with sweep_progress(scene.name, len(planned), points) as progress:
                run_sweeps([(scene, store)], workers, progress)
            known, seconds = store.reused, time.perf_counter() - began
            if places:
                with sweep_progress(f"{scene.name}, check", len(places), len(places)) as progress:
                    found = check_points(scene, places, store, store.part("check"), workers, progress=progress)
        store.finish()
        report.write_sweep(scene, store, directory, format_.value, check=None if found is None else found.to_tree())
    table = Result(directory, "sweep").table("sweep")
    resumed = f", {known} of the points from before" if known else ""
    for label, text in report.overview(table).items():
        print(f"{label:<28}{text}")
    print(f"{'wall time':<28}{seconds:.3g} s, {(points - known) / seconds:.3g} points per s{resumed}")
    print(f"{'tables':<28}{directory}")
    for line in report.band_report(Result(directory, "sweep").table("bands")):
        print(line)
    _print_notes(report.notes_on_branches(planned) + report.notes_on_points(table))
    failed = report.failures(table)
    _complain_of(failed, f"{len(failed)} of {points} points failed")
    if (found is not None and not _print_check(found)) or failed:
        raise typer.Exit(1)


def _print_check(found: SweepCheck) -> bool:
    """Print what the check of a sweep has found; return whether the engines agree."""
    for label, text in found.lines():
        print(f"{label:<28}{text}")
    for row in found.reclassified[:TOLD]:
        print(f"  {row}")
    _complain_of(found.disagreements, f"engines disagree at {len(found.disagreements)} of {len(found.checked)} points")
    return found.agrees


def _complain_of(lines: list[str], total: str) -> None:
    """Print the first of some lines and their total, if there are any."""
    for line in lines[:TOLD]:
        print(f"vibroplat: {line}", file=sys.stderr)
    if lines:
        print(f"vibroplat: {total}", file=sys.stderr)


@app.command()
def paper(
    machine: Annotated[
        list[str] | None, typer.Option(help="A machine from configs/machines. Default: printed and calibrated.")
    ] = None,
    set_: Settings = None,
    engine: EngineName = None,
    out: Out = Path("results"),
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of worker processes. Default: all cores.")] = None,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    seeds: Annotated[int, typer.Option(min=1, help="Number of perturbation seeds that each claim is judged with.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="The first seed; figures are drawn with it.")] = 0,
) -> None:
    """Reproduce the paper.

    Computes figures 2-7 and their tables, and compares each claim of the paper with what was measured.
    """
    _tell_of_compilation(engine)
    from vibroplat.config import parse_overrides
    from vibroplat.paper.trial import machine_numbers, paper_scene

    changes = parse_overrides(set_ or [], engine)
    chosen = {name: {**machine_numbers(name), **changes} for name in machine or ("printed", "calibrated")}
    _require_scheduler(scheduler)
    from vibroplat.paper.reproduction import SWEEPS, planned
    from vibroplat.study.execution import pool

    tried = range(seed, seed + seeds)
    chains = max(planned(numbers, tried)[0] for numbers in chosen.values())
    _load_kernels(*sorted({paper_scene(SWEEPS[0], numbers).solver.engine for numbers in chosen.values()}))
    with pool(jobs, scheduler, wait=wait, chains=chains) as workers:
        for name, numbers in chosen.items():
            _reproduce(name, numbers, out, workers, tried, resume=resume, overwrite=overwrite)


def _reproduce(
    name: str, numbers: dict[str, Any], out: Path, workers: Pool, seeds: range, *, resume: bool, overwrite: bool
) -> None:
    """Reproduce the paper with one machine; write its tables and figures and print an overview."""
    from vibroplat.paper import report, reproduction
    from vibroplat.plots.paper import plot_paper
    from vibroplat.tables import result_directory

    directory = result_directory(out / "paper", name)
    began = time.perf_counter()
    branches, points = reproduction.planned(numbers, seeds)
    with sweep_progress(name, branches, points) as progress:
        found = reproduction.reproduce(
            numbers, directory / "points", workers, seeds=seeds, resume=resume, overwrite=overwrite, progress=progress
        )
    report.write_reproduction(found, numbers, directory)
    figures = plot_paper(directory)
    for line in report.overview(name, found, time.perf_counter() - began):
        print(line)
    print(f"{'tables and figures':<24}{directory}, {len(figures)} figures")


@app.command()
def calibrate(
    config: Annotated[
        Path | None, typer.Argument(help="Configuration of a machine with a calibration section.")
    ] = None,
    out: Out = Path("results"),
    jobs: Jobs = 1,
    generations: Annotated[int | None, typer.Option(min=0, help="Number of generations of the search.")] = None,
    resume: Resume = False,
    overwrite: Overwrite = False,
    scheduler: Scheduler = None,
    wait: Wait = WAIT,
    engine: EngineName = None,
) -> None:
    """Fit the numbers the paper does not print to its claims.

    Writes a table with one row per evaluation to OUT/calibration.
    """
    _tell_of_compilation(engine)
    from vibroplat.config import ENGINE, configurations, parse_overrides
    from vibroplat.paper.calibration.plan import load_plan

    overrides = {} if generations is None else {"generations": generations}
    path = config or configurations() / "claims" / "calibration.yaml"
    fixed, plan = load_plan(path, overrides, parse_overrides([], engine))
    _require_scheduler(scheduler)
    from vibroplat.paper.calibration import reading, search
    from vibroplat.paper.report import write_calibration
    from vibroplat.study.execution import pool
    from vibroplat.study.store import Store
    from vibroplat.tables import result_directory

    directory = result_directory(out, "calibration")
    total = plan.evaluations + plan.confirmations
    with Store(directory, search.conditions(fixed), resume=resume, overwrite=overwrite) as store:
        _load_kernels(fixed.get(ENGINE, "auto"))
        opened = pool(jobs, scheduler, wait=wait, chains=plan.side_by_side)
        with opened as workers, calibration_progress(total) as progress:
            found = search.calibrate(fixed, plan, store, workers, progress)
        store.finish()
        tables = {"evaluations": found.evaluations, "confirmation": found.confirmation}
        tables["left-out"] = reading.left_out(found.evaluations, plan)
        tables["spread"] = reading.spread(found.evaluations, plan)
        write_calibration(tables, directory)  # before the store lets another calibration in
    for label, text in reading.overview(found.evaluations, tables["left-out"], tables["spread"]).items():
        print(f"{label:<40}{text}")
    print(f"{'tables':<40}{directory}")


@app.command()
def plot(
    directories: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...", help="Result directory of a run, a sweep or the paper; several are laid over each other."
        ),
    ],
    kind: Annotated[list[PlotKind] | None, typer.Option(help="Figures to draw. Default: all.")] = None,
    start: Annotated[float | None, typer.Option(help="Start of the interval that figures of a run show (s).")] = None,
    stop: Annotated[float | None, typer.Option(help="End of that interval (s).")] = None,
    x: Annotated[Abscissa | None, typer.Option(help="Horizontal axis of a sweep. Default: excitation.")] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Measured data to lay over: CSV, columns as in the tables.")
    ] = None,
    format_: Annotated[FigureFormat, typer.Option("--format", help="Format of the figures.")] = FigureFormat.png,
    dpi: Annotated[int | None, typer.Option(min=10, max=2400, help="Dots per inch. Default: 130.")] = None,
    out: Annotated[Path | None, typer.Option(help="Directory for the figures. Default: the first DIR.")] = None,
) -> None:
    """Draw the figures of a run, a sweep or the paper, or lay several runs or sweeps over each other.

    Only the tables in DIR are read; nothing is simulated.
    """
    from vibroplat.plots.command import Wanted, plot_results
    from vibroplat.plots.style import Saving

    kinds = [k.value for k in kind or []]
    saving = Saving(format_.value, dpi, out)
    wanted = Wanted(kinds, start, stop, None if x is None else x.value, data, saving)
    for path in plot_results(directories, wanted):
        print(path)


@app.command()
def bench(
    names: Annotated[
        list[BenchName] | None,
        typer.Argument(
            metavar="[NAME]...", help="runtime, precision, engines, sweeps, stability, soak, peers, taylor."
        ),
    ] = None,
    out: Out = Path("results"),
    long: Annotated[
        bool,
        typer.Option(
            "--long",
            help="Run all benchmarks, the soak with one round. Soak --long: rounds until they have taken 24 hours of "
            "processor time; one that was stopped is resumed.",
        ),
    ] = False,
    reference: Annotated[Path, typer.Option(help="Directory of the reference tables.")] = Path("tests/reference"),
    repeats: Annotated[int, typer.Option(min=1, help="Number of runs; their median is reported.")] = 5,
) -> None:
    """Measure run time and accuracy.

    Writes tables and plots to OUT/benchmarks. Without a name it compares peers at equal error, in two minutes.
    """
    _tell_of_compilation()
    from vibroplat.bench import report
    from vibroplat.bench.timing import machine
    from vibroplat.tables import result_directory

    soaking = long and names == [BenchName.soak]
    if names and long and not soaking:
        raise VibroplatError(f"{names[0].value} --long: --long runs every bench; allowed: names, --long, soak --long")
    if (long and not soaking) or not names or {BenchName.peers, BenchName.taylor} & {*names}:
        report.require_oracle()
    _load_kernels()
    directory = result_directory(out, "benchmarks")
    print(machine())
    if not (names or long):
        report.report_summary(directory, reference, repeats)
    if soaking:
        from vibroplat.bench.soak.soak import LONG

        report.report_soak(directory, reference, repeats, LONG)
        return
    for name in BenchName if long else names or []:
        report.REPORTS[name.value](directory, reference, repeats)


@app.command()
def schema() -> None:
    """Print the JSON schema of a configuration, for editors."""
    import json

    from vibroplat.config import configuration_schema

    print(json.dumps(configuration_schema(), indent=2))


def _work(summary: dict[str, Any]) -> list[tuple[str, Any, str]]:
    """Return the rows on the work done; engine ``taylor`` has no residual."""
    if summary["residual_calls"] is None:
        return [("steps", summary["steps"], "")]
    return [("steps, residual calls", [summary["steps"], summary["residual_calls"]], "")]


def _tell_of_compilation(engine: str | None = None) -> None:
    """Say why the first run on a machine takes long; some kernels are compiled as soon as they are imported."""
    import vibroplat.kernels.compiled  # noqa: F401  (refuses where compilation is switched off)
    from vibroplat.kernels.cache import is_compiled, notice

    if not is_compiled(engine or "auto"):
        told = notice() or "this happens once and takes about half a minute"
        require_memory(COMPILING, "compiling the kernels for the first time")
        print(f"vibroplat: compiling the numerical kernels; {told}", file=sys.stderr)


def _load_kernels(*engines: str) -> None:
    """Compile or load what a motion needs by these engines, once, before workers would each do so."""
    from vibroplat.flow.warm import load_kernels

    for engine in engines or ("auto",):
        load_kernels(engine)
    gc.freeze()  # what is loaded stays: the garbage collector need not look at it


def _require_scheduler(address: str | None) -> None:
    """Refuse an address without a scheduler before the kernels are loaded, which may take long."""
    if address is not None:
        from vibroplat.study.cluster import require_scheduler

        require_scheduler(address)


def _print_summary(result: Trajectory, directory: Path) -> None:
    """Print the most important results, first those of the measured part; summary.json holds all of them."""
    summary = result.summary
    kinds = ("liftoffs", "impacts", "latches")
    phases = "phi1-phi2" if result.scene.co_rotating else "phi1+phi2"
    rows = [
        ("outcome", summary["outcome"], ""),
        ("start", _start(result), ""),
        ("simulated", summary["simulated_s"], "s"),
        ("measured", _window(summary), ""),
        ("excitation frequency", summary["excitation_frequency_hz"], "Hz"),
        ("speeds of the exciters", _speeds(summary), "Hz"),
        (f"phase difference {phases}", *_phase(summary)),
        ("RMS x, y", [summary["rms_x_m"], summary["rms_y_m"]], "m"),
        ("RMS phi", summary["rms_phi_rad"], "rad"),
        ("contact force, largest", summary["contact_force_max_n"], "N"),
        ("gap, largest", summary["gap_max_m"] or None, "m"),
        ("impulse, largest", summary["impulse_max_n_s"] or None, "N s"),
        ("flight fraction", summary["flight_fraction"] if result.scene.has_contact else None, ""),
        ("liftoffs, impacts, latches", [summary[f"measured_{kind}"] for kind in kinds], ""),
        ("whole run: these counts", [summary[kind] for kind in kinds], ""),
        ("whole run: phi, largest", summary["phi_max_rad"], "rad"),
        ("whole run: energy residual", summary["energy_residual"], ""),
        *_work(summary),
        ("wall time", summary["wall_s"], "s"),
    ]
    for label, value, unit in rows:
        if value is not None:
            print(f"{label:<28}{_number(value)} {unit}".rstrip())
    print(f"{'tables':<28}{directory}")


def _start(result: Trajectory) -> str:
    """Describe how a run began."""
    share, seed, origin = result.summary["perturbation"], result.scene.run.seed, result.origin
    changed = f"rates perturbed by {share:g} of their scales, seed {seed}" if share else "not perturbed"
    return changed if origin is None else f"where {origin['directory']} ended, {origin['t_s']:g} s; {changed}"


def _speeds(summary: dict[str, Any]) -> list[float] | None:
    """Return the mean speeds of both exciters (Hz) where they differ."""
    mean, split = summary["excitation_frequency_hz"], summary["frequency_split_hz"]
    return [mean + 0.5 * split, mean - 0.5 * split] if mean and abs(split) > 1e-3 * mean else None


def _phase(summary: dict[str, Any]) -> tuple[float | str | None, str]:
    """Return the mean phase difference with its unit, unless it drifts so much that it has no mean."""
    from vibroplat.observe.summary import COHERENCE

    drifts = summary["phase_coherence"] is not None and summary["phase_coherence"] < COHERENCE
    return ("drifts", "") if drifts else (summary["phase_difference_rad"], "rad")


def _window(summary: dict[str, Any]) -> str:
    """Describe the measured part of a run."""
    first, last, turns = (summary[f"measured_{key}"] for key in ("from_s", "to_s", "turns"))
    if last <= first:
        return f"nothing: the run ended before {_number(first)} s"
    return f"{_number(first)} … {_number(last)} s, {turns or 'no'} whole turn{'' if turns == 1 else 's'}"


def _print_notes(notes: list[str]) -> None:
    """Print what is to be noted, a line each."""
    for note in notes:
        print(f"note: {note}")


def _number(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_number(v) for v in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
