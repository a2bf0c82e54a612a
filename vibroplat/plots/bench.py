"""Figure of benchmarks: run time against error."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vibroplat.plots.style import MARKERS, legend_below, new_figure, save, styled
from vibroplat.results.picture import CURVES, finite

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
        figure, axes = new_figure(len(cases), len(ERRORS), (11.0, 2.6 * len(cases) + 1.0))
        for row, case in zip(axes, cases, strict=True):
            row[0].set(title=case, ylabel="ms per simulated second")
            for axis, (column, label) in zip(row, ERRORS.items(), strict=True):
                known = (table["ms_per_s"] > 0.0) & (table.get(column, pd.Series(0.0, table.index)) > 0.0)
                runs = table[known & (table["case"] == case)]
                for i, engine in enumerate(engines):
                    of = runs[runs["engine"] == engine]
                    axis.plot(of.get(column, []), of["ms_per_s"], f"{MARKERS[i]}-", color=CURVES[i % 7], label=engine)
                scale = "log" if len(runs) else "linear"
                axis.set(xscale=scale, yscale=scale, xlabel=f"largest error of {label}", visible=len(runs) > 0)
                axis.invert_xaxis()
        figure.suptitle(
            f"run time over error; more accurate to the right, faster below\n{processor}", x=0.01, ha="left"
        )
        legend_below(figure, axes[0, 0].lines)
        return save(figure, directory, name)
