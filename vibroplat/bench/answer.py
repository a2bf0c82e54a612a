"""What benchmarks found, in a few lines: how many times as fast engines are, how errors fall, what studies cost."""

from __future__ import annotations

import pandas as pd

from vibroplat.config.digits import number
from vibroplat.results.answer import counted, in_columns

#: Most rows that are printed.
MAX_ROWS = 6


def brief_precision(table: pd.DataFrame, equal: pd.DataFrame | None) -> list[str]:
    """Return the answer of a comparison: run times at equal error, or errors by tolerance of a single engine.

    Parameters
    ----------
    table
        Errors and run times, as of :func:`vibroplat.bench.measure.precision`.
    equal
        Run times at equal errors, as of :func:`vibroplat.bench.measure.at_equal_error`; None if ``taylor`` has none.
    """
    failed = int(table["failed"].astype(str).ne("").sum())
    more = f"; {counted(failed, 'run')} FAILED" if failed else ""
    if equal is None:
        errors = table.pivot_table("coordinates", "case", "tolerance", sort=False).iloc[:, ::2]
        head = f"{counted(len(errors), 'case')}: error of coordinates, over their scales, by tolerance{more}"
        return [head, *_lines(errors.rename(columns="{:.0e}".format).map("{:.1e}".format))]
    first = equal.groupby(["case", "engine"], sort=False).first().reset_index()
    ratios = first.loc[first["engine"] != "taylor", "over_taylor"].dropna()
    ends = f" {number(ratios.min(), 2)} to {number(ratios.max(), 2)} times that of taylor" if len(ratios) else ""
    times = first.pivot_table("ms_per_s", "case", "engine", sort=False).map(number)
    return [f"processor time at equal error{ends}; ms per s of motion{more}", *_lines(times)]


def brief_costs(table: pd.DataFrame, name: str) -> list[str]:
    """Return the answer of a comparison of costs: processor time of each way, and its multiple of the first one's."""
    ratio = next(str(column) for column in table if str(column).startswith(("times_", "over_")))
    costs = table.set_index(table.columns[0])[["processor_s", ratio]].map(number)
    return [f"{name}: processor time, and multiples of it", *_lines(costs)]


def _lines(table: pd.DataFrame) -> list[str]:
    """Write the first rows of a table of texts."""
    rows = [
        ["", *map(str, table.columns)],
        *([str(name), *row] for name, row in zip(table.index, table.to_numpy(), strict=True)),
    ]
    return [f"  {line}" for line in in_columns(rows[: MAX_ROWS + 1])]
