"""The data dictionary: pages that describe every key of a configuration and every column of the result tables.

Keys are described where they are defined (:mod:`vibroplat.config.scene`), columns where they are made.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, starmap

from vibroplat.columns import Column, Columns, unit_of
from vibroplat.config.keys import keys, yaml
from vibroplat.config.kinds import KINDS
from vibroplat.inspection.values import INSPECTION
from vibroplat.motion.run import SUMMARY
from vibroplat.observe.conveying import CONVEYING
from vibroplat.observe.tables import EVENTS, FOUNDATION_FORCES, TRAJECTORY, acceleration_columns
from vibroplat.paper.tables import TABLES as PAPER
from vibroplat.report.data_sheet import point_columns, whole_columns

_POINTS = point_columns()
#: All result tables except those of benchmarks, by the names of their files, in the order of the commands that write
#: them: a sentence on their rows, and their columns.
TABLES: dict[str, tuple[str, Columns]] = {
    "trajectory": (
        "`vibroplat run`: one row per sample; two rows at an event, before and after it.",
        {**TRAJECTORY, **acceleration_columns(["NAME"]), **FOUNDATION_FORCES},
    ),
    "events": ("`vibroplat run`: one row per event.", EVENTS),
    "summary.json": (
        "`vibroplat run`: values for the second half of the run, cut to whole turns or periods. Meanings that say "
        '"in the whole run" are the exception.',
        {**SUMMARY, **_POINTS, **whole_columns(_POINTS), **CONVEYING},
    ),
    "inspection": (
        "`vibroplat inspect` prints some of these numbers before any run; `Scene.inspect()` returns them, by name.",
        INSPECTION,
    ),
    **{name: table for kind in KINDS.values() for name, table in kind.load().described.items()},
    **PAPER,
}

#: Columns that an engineer reads first, in this order.
LEADING_COLUMNS = (
    *("outcome", "notes", "energy_residual"),
    *("sync", "motion", "period", "stable", "excitation_frequency_hz", "phase_difference_rad", "phase_coherence"),
    *("synchronized_at_s", "captured_by"),
    *("amplitude_y_m", "stroke_x_m", "stroke_y_m", "whole_stroke_y_m", "acceleration_max_m_per_s2", "gamma"),
    *("flight_fraction", "impacts_per_period", "impulse_max_n_s", "contact_force_max_n"),
    *("foundation_force_y_amplitude_n", "foundation_force_y_max_n", "whole_foundation_force_y_max_n"),
    *("motor_power_w", "motor_torque_1_max_n_m", "motor_torque_2_max_n_m", "slip_1", "slip_2"),
)


def configuration_page() -> str:
    """Return a page on all keys of a configuration, in Markdown."""
    lines = [
        "# Configuration",
        "",
        "All keys of a configuration, in YAML 1.2. Names end with their unit. `N` is a place in a list, counted from",
        "0: `exciters.0` is motor 1. `NAME` is any name, as `left` in `springs.left.off`. A key that is not given has",
        "its default. If the default is empty, the meaning describes the default. `extends: FILE` takes all keys from",
        "another file, whose name is relative to the extending file. Keys of the extending file override them, and",
        "`--set` overrides both. If two keys exclude each other, the overriding key is used:",
        "`--set exciters.1.unbalance_radius_m=0.06` replaces a static moment in the file. The symbols are those of",
        "[the model](model.md). Typical values are from screens and feeders in industry; `vibroplat new FILE",
        "--template screen` writes such a machine. Scaled units are defined in",
        "[How it works](method.md#scaled-units).",
        "This page is written by `vibroplat schema --markdown`.",
    ]
    sections = groupby(keys().values(), key=lambda key: key.name.partition(".")[0] if "." in key.name else "")
    for section, known in sections:
        rows = [(f"`{k.name}`", k.symbol, k.unit, yaml(k.default), k.typical, k.allowed, k.meaning) for k in known]
        lines += ["", f"## {section or 'Top level'}", ""]
        lines += _table(("key", "symbol", "unit", "default", "typical", "allowed", "meaning"), rows)
    return "\n".join(lines) + "\n"


def columns_page() -> str:
    """Return a page on all columns of result tables, in Markdown."""
    lines = [
        "# Columns of the result tables",
        "",
        "Names end with their unit; columns without a unit are texts, counts or pure numbers. Parquet files have units",
        "and meanings in the metadata of their fields; pandas tables have them in `DataFrame.attrs` (`units`,",
        "`meanings`). The symbols are those of [the model](model.md), scaled units are defined in",
        "[How it works](method.md#scaled-units). This page is written by `vibroplat columns`.",
        "",
        "## Read these first",
        "",
        "The outcome, synchronization, motion, flight and impacts, loads on the foundation, and motors.",
        "",
        *_table(("column", "unit", "meaning", "definition", "tables"), map(_row_of_all_tables, LEADING_COLUMNS)),
    ]
    for table, (about, described) in TABLES.items():
        lines += ["", f"## {table}", "", about, ""]
        lines += _table(("column", "unit", "meaning", "definition"), starmap(_row, described.items()))
    return "\n".join(lines) + "\n"


def _row(name: str, column: Column) -> tuple[str, ...]:
    """Return the cells of a column's row."""
    return f"`{name}`", unit_of(name), column.meaning, column.definition


def _row_of_all_tables(name: str) -> tuple[str, ...]:
    """Return the cells of a column in the first table that has it, and the names of all tables that have it."""
    tables = {table: described[name] for table, (_, described) in TABLES.items() if name in described}
    return *_row(name, next(iter(tables.values()))), ", ".join(tables)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield the lines of a table in Markdown."""
    for row in (head, ["---"] * len(head), *rows):
        cells = (cell.replace("|", "\\|") for cell in row)
        yield f"| {' | '.join(cells)} |"
