"""Sweeps: branches of continued points are measured side by side and become one table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from typing import Unpack

import pandas as pd

from vibroplat.columns import PHASE_COLUMN, VIBRATION_PATTERN, Column, Columns
from vibroplat.config.digits import interval, quantity
from vibroplat.config.plans import FREQUENCY
from vibroplat.config.plausibility import HINT, split_severity
from vibroplat.config.scene import Scene
from vibroplat.integrate.interface import WORK
from vibroplat.observe.conveying import CONVEYING
from vibroplat.report.data_sheet import SHEET, more_columns, point_columns
from vibroplat.report.summary import MEASURES
from vibroplat.results.answer import Answer, counted
from vibroplat.results.result import Result
from vibroplat.study.answer import short_answer, sync_counts
from vibroplat.study.bands import BANDS, band_lines, bands
from vibroplat.study.branches import (
    BRANCH,
    EXCITATION,
    SUPPLY,
    SweepBranch,
    branches,
    column_of,
    place_words,
    scene_at,
    study_table,
)
from vibroplat.study.point import (
    ERRORS,
    LOAD_MEASURES,
    MOTION_MEASURES,
    POINT,
    SweepPoint,
    failed_record,
    measure_point,
    point_task,
)
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import CorruptRecordError, Record, Store
from vibroplat.study.study import ALLOWED, COMPARED, CrossCheckCase, Options, Progress, Study, choose_evenly, run_study

#: Columns of the table after the swept keys.
COLUMNS = (
    *("direction", "branch", "relative_rotation"),
    *MOTION_MEASURES,
    *("sync", "motion", "period", "multiplier_max"),
    *LOAD_MEASURES,
    *("lyapunov_per_s", "lyapunov_error_per_s"),
    *ERRORS.values(),
    *("settle_s", "outcome", "detail", "notes", "steps", "residual_calls", "events", "simulated_s", "wall_s"),
)
#: What they mean; the swept keys come first, each as in a configuration.
SWEEP: Columns = {
    SUPPLY: Column("supply frequency"),
    **BRANCH,
    **{name: column for name, column in {**MEASURES, **POINT, **WORK}.items() if name in COLUMNS},
    **SHEET,
}
_KEYS: Columns = {
    SUPPLY: SWEEP[SUPPLY],
    "…": Column("values of the grid's keys and of sweep.over (instead of the supply), by dotted name"),
}
#: Columns of a point with which those of a bifurcation diagram begin.
_PLACE: Columns = {name: SWEEP[name] for name in ("direction", "branch", EXCITATION)}
#: Tables of a bifurcation diagram: the numbers in records that they hold, and the column of these.
_DIAGRAMS: dict[str, tuple[str, Columns]] = {
    "section": ("section_y", {"y_m": Column("y at a whole turn of exciter 1")}),
    "impacts": (
        "impact_speeds",
        {"impact_speed_m_per_s": Column("speed of an impact", "rate at which the gap closes, before the impact")},
    ),
}
#: How many rows of a table are made at a time.
PART_ROWS = 2000
#: The tables of a sweep: what their rows are, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "sweep": (
        "`vibroplat sweep`: one row per point.",
        {**_KEYS, **{name: SWEEP[name] for name in (*COLUMNS, *SHEET)}, **point_columns(), **CONVEYING},
    ),
    "bands": (
        "`vibroplat sweep`: bands of synchronization, jumps, liftoffs, the largest amplitude along y, and failed "
        "points of each branch. If another key is swept, its name follows `from_` and `to_`.",
        {"…": _KEYS["…"], **BRANCH, **BANDS},
    ),
    "section": (
        "`vibroplat sweep` with `kind: bifurcation`: the last turns of each point.",
        {**_KEYS, **_PLACE, **_DIAGRAMS["section"][1]},
    ),
    "impacts": (
        "`vibroplat sweep` with `kind: bifurcation`: the last impacts of each point.",
        {**_KEYS, **_PLACE, **_DIAGRAMS["impacts"][1]},
    ),
}


class SweepStudy(Study):
    """A sweep over the supply frequencies, or another key, and the grid of a section ``sweep``.

    Raises
    ------
    ConfigError
        The scene has no sweep, or a value of its grid is not allowed.
    """

    kind = "sweep"
    described = TABLES

    def __init__(self, scene: Scene) -> None:
        self.scene, self.branches = scene, branches(scene)

    def scenes(self) -> Iterator[Scene]:
        """Yield the scenes at the ends of branches; small supply frequencies are usual."""
        for branch in self.branches:
            if branch.direction == self.branches[0].direction:  # those of the other direction have the same ends
                for end in (max,) if branch.swept == FREQUENCY else (min, max):
                    yield branch.scene.replace({branch.swept: end(branch.key_values)})

    def chains(self, store: Store) -> int:
        """Return the number of branches whose points are not all stored."""
        stored = store.lengths()
        return sum(stored.get(branch.chain, 0) < len(branch.key_values) for branch in self.branches)

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Measure the points of all branches."""
        run_branches(self.branches, store, workers, progress)
        points = sweep_table(self.branches, store)
        diagram = {
            name: partial(diagram_parts, self.branches, store, key, columns)
            for name, (key, columns) in _DIAGRAMS.items()
            if self.branches[0].plan.kind == "bifurcation"
        }
        banded = bands(points)
        headline, short = short_answer(points, banded)
        notes, failed = notes_on_points(points), failures(points)
        answer = Answer(overview(points), list(band_lines(banded)), notes, failed, headline, short)
        return Result("sweep", self.scene, {**diagram, "bands": banded, "sweep": points}, answer)

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose points of all branches; see :func:`point_cases`."""
        return point_cases(self.branches, store, other)


STUDY = SweepStudy


def sweep(scene: Scene, **options: Unpack[Options]) -> Result:
    """Measure the steady motion of a scene at each value of a key, for each combination of a grid.

    The section ``sweep`` of the scene has the supply frequencies or another key, and the grid. Each point continues the
    motion of the previous point of its branch, settles and is measured: on its periodic orbit if there is one.

    Parameters
    ----------
    scene
        Scene with a section ``sweep``.
    options
        Any of :class:`vibroplat.study.study.Options`:

        * ``jobs``: number of worker processes;
        * ``scheduler``: address of a dask scheduler, whose workers are used instead;
        * ``executor``: any executor of :mod:`concurrent.futures`, whose workers are used instead: that of loky or
          mpi4py, or ``client.get_executor()`` of dask;
        * ``progress``: function that is called with the numbers of finished and of all points.

    Returns
    -------
    Result
        Table ``sweep`` has one row per point, ordered by branches and by points of a branch. Table ``bands`` has one
        row per band. With ``kind: bifurcation`` there are tables ``section`` and ``impacts``.

    Raises
    ------
    ConfigError
        The scene has no section ``sweep``, a value of its grid is not allowed, or the scheduler does not answer.
    NoWorkersError
        The scheduler or the executor is gone.
    IncompatibleWorkerError
        A worker has other versions and would compute other bits than this process.

    Examples
    --------
    >>> from vibroplat import Scene, sweep
    >>> scene = Scene().replace({"sweep.supply_frequency_hz": {"start": 45.0, "stop": 46.0}})
    >>> sweep(scene).sweep["outcome"].tolist()
    ['ok', 'ok', 'ok']
    """
    return run_study(SweepStudy, scene, **options)


def run_branches(
    planned: Sequence[SweepBranch], store: Store, workers: Pool, progress: Progress = lambda done, known: None
) -> None:
    """Run branches side by side and store their points; points that are stored already are not repeated.

    ``progress`` is called with the numbers of finished and of all points.
    """
    points, planned_points = 0, sum(len(branch.key_values) for branch in planned)

    def count(_: Record) -> None:
        nonlocal points
        points += 1

    def tell(_: int) -> None:
        progress(points, planned_points)

    chains = [StoredChain(branch_points(branch, count), store, branch.chain) for branch in planned]
    run_stored(chains, workers, tell)


def branch_points(branch: SweepBranch, take: Callable[[Record], object]) -> Tasks[None]:
    """Measure the points of a branch, each begun with the state in which the last good one ended.

    ``take`` is called with the record of each point.
    """
    state: list[float] | None = None
    for index, value in enumerate(branch.key_values):
        state = branch.begin(state, index)
        record = yield Task(point_along, (branch.scene, value, state, branch.perturbation_key(value)), failed_record)
        state = record["state"] or state
        take(record)


def point_along(first: Scene, value: float, state: list[float] | None, key: tuple[int, ...]) -> SweepPoint:
    """Measure a point of a branch, from the scene of its first one and the value of the swept key.

    Tasks do not hold the scenes of points: making these takes ten times as long as finding a stored record.
    """
    plan = first.sweep
    assert plan is not None
    return measure_point(scene_at(first, plan.swept.key, value), plan, state, key)


def branch_records(branch: SweepBranch, store: Store) -> Iterator[Record]:
    """Yield the records of all points of a branch.

    Raises
    ------
    CorruptRecordError
        One is missing or damaged.
    """
    count = 0
    for index, record in store.read(branch.chain):
        if index != count or count == len(branch.key_values):
            break
        yield record
        count += 1
    if count < len(branch.key_values):
        raise CorruptRecordError(f"point {count} of branch {branch.number} is not stored; --resume computes it")


def point_cases(planned: Sequence[SweepBranch], store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
    """Choose points, as far from each other as they can be, that start as they did and must give the same motion.

    Left out are points that are undecided, and chaotic ones: another engine may lead them to another attractor.
    """
    rows = enumerate(row for *_, row in _starts(planned, store))
    decided = [n for n, row in rows if row.get("motion") not in (None, "undecided", "chaotic")]
    chosen = {*choose_evenly(decided)}
    cases = []
    for number, (branch, index, state, row) in enumerate(_starts(planned, store)):
        if number in chosen:
            value = branch.key_values[index]
            task = point_task(other(branch.at(index)), branch.plan, state, branch.perturbation_key(value))
            keys = {column_of(branch.swept): value, **branch.grid}
            swept = ", ".join(f"{key} = {at}" for key, at in keys.items())
            known = {name: row[name] for name in (*COMPARED, PHASE_COLUMN)}
            # a motion that was not measured on its orbit is as far from it as settling leaves it
            left = 0.0 if row.get("multiplier_max") is not None else branch.plan.settle_tolerance
            where = f"at {swept}, branch {branch.number} ({branch.direction})"
            cases.append(CrossCheckCase(where, task, known, max(ALLOWED, 10.0 * left)))
    return cases


def _starts(
    planned: Sequence[SweepBranch], store: Store
) -> Iterator[tuple[SweepBranch, int, list[float] | None, Record]]:
    """Yield each point of a finished sweep: its branch and place, the state with which it began, and its row."""
    for branch in planned:
        state: list[float] | None = None
        for index, record in enumerate(branch_records(branch, store)):
            state = branch.begin(state, index)
            yield branch, index, state, record["row"]
            state = record["state"] or state


# -- tables -----------------------------------------------------------------------------------------------


def sweep_table(planned: Sequence[SweepBranch], store: Store) -> pd.DataFrame:
    """Make the table of a sweep, in the order of branches and points.

    Raises
    ------
    CorruptRecordError
        A record is missing or damaged.
    """
    columns = {**{name: SWEEP[name] for name in (*COLUMNS, *SHEET)}, **more_columns(planned[0].scene)}
    return pd.concat(_parts(planned, store, columns, lambda record: [record["row"]]), ignore_index=True)


def diagram_parts(planned: Sequence[SweepBranch], store: Store, key: str, columns: Columns) -> Iterator[pd.DataFrame]:
    """Yield the parts of a table of a bifurcation diagram; its column has the numbers of a ``key`` of records."""
    (column,) = columns

    def rows(record: Record) -> list[Record]:
        return [{EXCITATION: record["row"].get(EXCITATION), column: value} for value in record[key]]

    return _parts(planned, store, {**_PLACE, **columns}, rows)


def _parts(
    planned: Sequence[SweepBranch], store: Store, columns: Columns, rows_of: Callable[[Record], list[Record]]
) -> Iterator[pd.DataFrame]:
    """Yield the rows of all records in parts, at least one, as tables with the swept keys and these columns."""
    key, grid = column_of(planned[0].swept), planned[0].plan.grid
    meant = {**SWEEP, **columns}
    rows = (
        {key: value, **branch.grid, "direction": branch.direction, "branch": branch.number, **row}
        for branch in planned
        for value, record in zip(branch.key_values, branch_records(branch, store), strict=True)
        for row in rows_of(record)
    )
    part, first = list(islice(rows, PART_ROWS)), True
    while part or first:
        yield study_table(part, [key, *grid, *columns], meant, grid)
        part, first = list(islice(rows, PART_ROWS)), False


# -- for the user -----------------------------------------------------------------------------------------


def overview(table: pd.DataFrame) -> dict[str, str]:
    """Summarize a sweep table in a few lines: label and text."""
    frequency, height = table[EXCITATION], table["rms_y_m"]
    lines = {
        "synchronization": synchronizations(table),
        "simulated": f"{quantity(table['simulated_s'].sum(), 's')}, {table['events'].sum()} events, "
        f"{table['steps'].sum()} steps",
    }
    if height.notna().any():
        lines |= {
            "excitation frequency": interval(frequency.min(), frequency.max(), "Hz"),
            "RMS y": f"{quantity(height.min(), 'm', largest=height.max())} … {quantity(height.max(), 'm')}",
            "energy residual": f"at most {table['energy_residual'].max():.1e} of the energy converted",
        }
    return lines


def synchronizations(table: pd.DataFrame) -> str:
    """Count the kinds of synchronization, and say what the machine does in each."""
    shakes = {kind: f" ({what})" for kind, what in VIBRATION_PATTERN.items()}
    kinds = sync_counts(table)
    return ", ".join(f"{sync} {count}{shakes.get((rotation, sync), '')}" for rotation, sync, count in kinds)


def failures(table: pd.DataFrame) -> list[str]:
    """Describe each point that did not end ``ok``: its outcome, its place in the sweep and the reason."""
    swept = list(table.columns[: list(table.columns).index("direction") + 1])
    return [
        f"{row['outcome']} at {', '.join(f'{key} {row[key]}' for key in swept)}: {reason}"
        for _, row in table[table["outcome"] != "ok"].iterrows()
        for reason in [str(row["detail"]).partition(", state [")[0]]  # without the numbers of its last state
    ]


def notes_on_points(table: pd.DataFrame) -> list[str]:
    """Sum up the notes in a sweep table, each kind once with its points and an example, and what is undecided."""
    lines: list[str] = []
    key = str(table.columns[0])
    noted = table[table["notes"].notna() & (table["notes"] != "")]
    notes = (
        noted[[key]].assign(note=noted["notes"].astype("str").str.split("; ")).explode("note").astype({"note": "str"})
    )
    for _, rows in notes.groupby(notes["note"].str.replace(r"\d[\d.e+-]*", "", regex=True), sort=False):
        count, low, high = rows.index.nunique(), rows[key].min(), rows[key].max()
        count_text = "1 point" if count == 1 else f"{count} points"
        first = ", the first" if count > 1 else ""
        note = rows["note"].iloc[0]
        begin, text = split_severity(note)
        lines.append(f"{begin}{count_text} at {place_words(key, low, high)}{first}: {text}")
    unknown = int((table["motion"] == "non-periodic").sum())
    if unknown and "conveying_speed_m_per_s" in table:
        lines.append(
            f"{HINT}{counted(unknown, 'point')} may be chaotic or not: exponents are not computed with transport"
        )
    chaotic = int((table["motion"] == "chaotic").sum())
    if chaotic:
        least = float(table.loc[table["motion"] == "chaotic", "simulated_s"].min())
        lines.append(
            f"{HINT}{counted(chaotic, 'chaotic point')}: other attractors were not looked for: basins; chaos that ends "
            f"only after the {quantity(least, 's')} for which they were followed looks alike"
        )
    undecided = table[(table["motion"] == "undecided") & (table["outcome"] == "ok")]
    for _, row in undecided.head(1).iterrows():
        several = len(undecided) > 1
        longer = "measure_s" if "turns measured" in row["detail"] else "max_settle_s"
        which = f"{len(undecided)} points are undecided, the first" if several else "1 point is undecided,"
        lines.append(f"{which} at {place_words(key, row[key])}: {row['detail']}; sweep.{longer} may help")
    return lines
