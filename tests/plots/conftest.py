import shutil

import numpy as np
import pandas as pd
import pytest
from common import handmade
from common.places import QUICKSTART
from common.results import unproven

from vibroplat import load_config, simulate
from vibroplat.measured.data import read_data
from vibroplat.plots.command import draw_results
from vibroplat.results.files import write_result
from vibroplat.results.run import load


def drawn(command, *directories, kinds=(), **options):
    """Figures of results of a command by name."""
    return dict(draw_results([load(place, command) for place in directories], kinds, **options))


@pytest.fixture(scope="session")
def moved(kernels, tmp_path_factory):
    """Directory of a run whose trajectory has accelerations, of the centre of mass and of a point."""
    asked = {"run.duration_s": 0.25, "output": {"accelerations": True, "points": {"tip": [0.3, 0.4]}}}
    place = tmp_path_factory.mktemp("moved") / "moved"
    simulate(load_config(QUICKSTART, asked)).save(place)
    return place


@pytest.fixture
def data_file(tmp_path):
    """Write columns of a table over time as measured data, whose shift in time is to be found."""

    def write(table, *columns):
        table[["t_s", *columns]].to_csv(tmp_path / "rig.csv", index=False)
        return read_data(f"{tmp_path / 'rig.csv'}:t=t_s,{','.join(f'{c}={c}' for c in columns)},shift=fit")

    return write


@pytest.fixture
def result(saved, tmp_path):
    """A copy of a run whose files may be changed."""
    return unproven(shutil.copytree(saved["two layers"], tmp_path / "result"))


def sweep_table():
    """Two mass ratios, up and down; with material there is flight, and a point has failed."""
    table = handmade.sweep_table()
    mass = table["material.mass_ratio"]
    found = table.assign(
        rms_phi_rad=1e-5,
        motor_power_w=30.0 + table["supply_frequency_hz"],
        contact_force_max_n=200.0 * mass,
        flight_fraction=2.0 * mass,
        period=np.where(table["motion"] == "chaotic", 0, 1 + table["branch"] % 3),
    )
    failed = found["outcome"] != "ok"
    measures = found.columns[list(found.columns).index("branch") + 1 :].difference(["outcome", "motion"])
    found[measures] = found[measures].astype(object).mask(failed, np.nan).infer_objects()
    return found


def diagram(table, column):
    """A table of five points for each point of a sweep."""
    many = table.loc[table.index.repeat(5)].reset_index(drop=True)
    return many.assign(**{column: 1e-3 * np.sin(np.arange(len(many)))})


@pytest.fixture
def write_sweep(tmp_path):
    """Write a result of a sweep, or of a bifurcation diagram, from its tables."""

    def write(table=None, kind="response", name="swept", **diagrams):
        directory = tmp_path / name
        directory.mkdir(exist_ok=True)
        tables = {"sweep": sweep_table() if table is None else table, **diagrams}
        origin = handmade.origin(name, **{"sweep.kind": kind, "sweep.lyapunov": kind == "response"})
        write_result(directory, "sweep", origin, tables, form="parquet")
        return directory

    return write


@pytest.fixture
def followed(tmp_path):
    """Result of branches of orbits, with boundaries."""
    return unproven(handmade.write_orbits(tmp_path / "followed"))


def data_of(line):
    """The data of a line, two rows."""
    return np.array([line.get_xdata(), line.get_ydata()], dtype=float)


def texts(legend):
    return [text.get_text() for text in legend.get_texts()]


def table_line(table, column, factor=1.0):
    """What a line shows of a table."""
    return pd.DataFrame({"t": table["t_s"], "y": factor * table[column]}).to_numpy().T
