"""Figure of benchmarks: run time against error."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vibroplat.config import digits
from vibroplat.plots.style import head, legend_below, new_figure, save, styled
from vibroplat.results.picture import CURVES, finite

#: Error of coordinates at which engines are compared in the title.
ERROR = 1e-6
#: Errors shown, by column.
ERRORS = {
    "coordinates": "coordinates (over their scales)",
    "event_time_s": "event times (s)",
    "contact_force": "contact force (relative)",
}


def plot_precision(table: pd.DataFrame, directory: Path, name: str, processor: str = "") -> Path:
    """Draw run time against error, and return the file: a row for each case, a panel for each of its errors.

    The name of the ``processor`` stands with the title.
    """
    table = finite(table)
    engines, cases = (list(dict.fromkeys(table[column])) for column in ("engine", "case"))
    with styled():
        figure, axes, _ = new_figure(len(cases), len(ERRORS), (11.0, 2.6 * len(cases) + 1.0))
        for row, case in zip(axes, cases, strict=True):
            row[0].set(title=case, ylabel="ms per simulated second")
            for axis, (column, label) in zip(row, ERRORS.items(), strict=True):
                known = (table["ms_per_s"] > 0.0) & (table.get(column, pd.Series(0.0, table.index)) > 0.0)
                runs = table[known & (table["case"] == case)]
                for i, engine in enumerate(engines):
                    of = runs[runs["engine"] == engine]
                    axis.plot(of.get(column, []), of["ms_per_s"], ".-", lw=1.0, ms=4, color=CURVES[i % 7], label=engine)
                scale = "log" if len(runs) else "linear"
                axis.set(xscale=scale, yscale=scale, xlabel=f"largest error of {label}", visible=len(runs) > 0)
                axis.invert_xaxis()
        head(figure, fastest(table), f"run time over error; more accurate to the right, faster below; {processor}")
        legend_below(figure, axes[0, 0].lines)
        return save(figure, directory, name)


def fastest(table: pd.DataFrame) -> str:
    """Say which engine takes the least time in most cases, of runs whose coordinates are accurate to :data:`ERROR`."""
    good = table[(table["ms_per_s"] > 0.0) & (table["coordinates"] <= ERROR)] if "coordinates" in table else table[:0]
    best = good.groupby(["case", "engine"])["ms_per_s"].min()
    firsts = [rows.nsmallest(2).droplevel("case") for _, rows in best.groupby("case", sort=False)]
    names = pd.Series([str(rows.index[0]) for rows in firsts], dtype=object)
    if names.empty:
        return f"No run has an error of coordinates up to {ERROR:.0e}"
    name = names.mode()[0]
    ratios = [float(rows.iloc[1] / rows.iloc[0]) for rows in firsts if rows.index[0] == name and len(rows) > 1]
    told = f"At errors up to {ERROR:.0e} {name} is the fastest in {(names == name).sum()} of {len(names)} cases"
    return (
        f"{told}, {digits.interval(min(ratios), max(ratios), digits=2)} times as fast as the next" if ratios else told
    )
