"""What benchmarks found, in a few lines: how many times as fast engines are, how errors fall, what studies cost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from vibroplat.config.digits import number
from vibroplat.results.answer import counted, in_columns

#: Most rows that are printed, and tolerances whose errors are.
MAX_ROWS, TOLERANCES = 7, (1e-4, 1e-6, 1e-8, 1e-10)


def brief_precision(table: pd.DataFrame, equal: pd.DataFrame | None) -> list[str]:
    """Return the answer of a comparison: run times at equal error, or errors by tolerance of a single engine.

    Parameters
    ----------
    table
        Errors and run times, as of :func:`vibroplat.bench.measure.precision`.
    equal
        Run times at equal errors, as of :func:`vibroplat.bench.measure.at_equal_error`; None if ``taylor`` has none.
    """
    failed = table["failed"].astype(str).ne("").sum()
    more = f"; {counted(int(failed), 'run')} FAILED" if failed else ""
    if equal is None:
        return [f"{counted(table['case'].nunique(), 'case')}: error of coordinates by tolerance{more}", *_errors(table)]
    first = equal.groupby(["case", "engine"], sort=False).first().reset_index()
    ends = list(_ends(first.loc[first["engine"] != "taylor"].groupby("engine", sort=False)["over_taylor"]))
    told = [f"{number(low, 2)} to {number(high, 2)} times that of taylor ({name})" for name, low, high in ends]
    return [f"processor time at equal error: {'; '.join(told) or 'of taylor alone'}{more}", *_times(first)]


def brief_costs(table: pd.DataFrame, name: str) -> list[str]:
    """Return the answer of a comparison of costs: processor time of each way, and its multiple of the first one's."""
    label, ratio = str(table.columns[0]), next(str(c) for c in table if str(c).startswith(("times_", "over_")))
    parts = zip(table[label].astype(str), table["processor_s"], table[ratio], strict=True)
    rows = [[way, f"{number(seconds)} s", f"× {number(times)}"] for way, seconds, times in parts][:MAX_ROWS]
    return [f"{name}: processor time, and multiple of that of {rows[0][0]}", *(f"  {row}" for row in in_columns(rows))]


def _ends(groups: Any) -> Iterator[tuple[str, float, float]]:
    for engine, values in groups:
        if values.notna().any():
            yield str(engine), values.min(), values.max()


def _times(first: pd.DataFrame) -> Iterator[str]:
    """Yield a table of run times (ms per simulated second) at equal error."""
    engines = list(first["engine"].unique())
    rows = [["ms per s of motion", "error", *engines]]
    for case, own in list(first.groupby("case", sort=False))[:MAX_ROWS]:
        times = own.set_index("engine")["ms_per_s"]
        rows.append([str(case), f"{own['error'].iloc[0]:.0e}", *(number(times.get(engine)) for engine in engines)])
    yield from (f"  {line}" for line in in_columns(rows))


def _errors(table: pd.DataFrame) -> Iterator[str]:
    """Yield a table of errors of coordinates, over their scales, by tolerance."""
    rows = [["tolerance", *(f"{tolerance:.0e}" for tolerance in TOLERANCES)]]
    for case, own in list(table.groupby("case", sort=False))[:MAX_ROWS]:
        errors = [own.loc[(own["tolerance"] / tolerance - 1.0).abs() < 1e-6, "coordinates"] for tolerance in TOLERANCES]
        rows.append([str(case), *(f"{one.iloc[0]:.1e}" if len(one) else "" for one in errors)])
    yield from (f"  {line}" for line in in_columns(rows))
