"""``vibroplat plot``: what is asked of it, measured data, formats, and the figures of the paper."""

import shutil

import numpy as np
import pandas as pd
import pytest
from common import commands
from common.places import ROOT

from vibroplat.errors import TableError, VibroplatError
from vibroplat.measured.data import read_data
from vibroplat.plots.command import plot_results
from vibroplat.plots.paper import FIGURES, MASSES, history
from vibroplat.plots.pictures import draw_picture
from vibroplat.results.result import Result

from .conftest import drawn


@pytest.mark.long
@pytest.mark.parametrize(("form", "begin"), [("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_the_same_figure_is_the_same_file_in_each_format(form, begin, saved, tmp_path):
    path = tmp_path / "new" / f"force.{form}"
    written = []
    for _ in range(2):
        options = ("--kind", "force", "--format", form, "--out", path.parent, "--dpi", "50")
        done = commands.command("plot", saved["two layers"], *options)
        assert (done.code, done.out, done.err) == (0, f"{path}\n", "")
        written.append(path.read_bytes())
    assert written[0].startswith(begin)
    assert written[0] == written[1]
    if form == "png":  # 8 inches at 50 dots each
        assert int.from_bytes(written[0][16:20]) == 400


@pytest.mark.parametrize(
    ("names", "kinds", "options", "line"),
    [
        (["run", "sweep"], [], {}, "hold no results of one command; allowed: several runs, or several sweeps"),
        (["sweep", "other"], ["map"], {}, "--kind map shows one sweep; allowed with 2 of them: response"),
        (["sweep"], [], {"start": 1.0}, "--start 1.0: no figure of DIR uses it; allowed: with a run"),
        (["run"], [], {"x": "supply"}, "uses it; allowed: with a sweep and branches of orbits"),
        (
            ["sweep"],
            ["force"],
            {},
            "--kind force shows a run, but DIR holds a sweep; allowed: response, bifurcation, map",
        ),
        (
            ["run"],
            ["motion", "map"],
            {},
            "but DIR holds a run; allowed: motion, conveying, force, exciters, loads, acceleration, spectrum, measured",
        ),
        (["nowhere"], [], {}, "DIR is not a directory; allowed: a result directory of vibroplat"),
    ],
)
def test_what_results_cannot_show_is_refused(names, kinds, options, line, saved, write_sweep, tmp_path):
    places = {"run": saved["bare"], "sweep": write_sweep(), "other": write_sweep(name="other")}
    chosen = [places.get(name, tmp_path / name) for name in names]
    with pytest.raises(VibroplatError) as caught:
        plot_results(chosen, kinds, **options)
    assert str(caught.value).replace(str(chosen[0]), "DIR").endswith(line)


# -- measured data --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("f,rms_y_m\n1,2\n", "no column of the horizontal axis in f, rms_y_m; allowed: excitation_frequency_hz"),
        ("excitation_frequency_hz,y\n1,2\n", "no column that a figure shows in excitation_frequency_hz, y; allowed: "),
        (
            "excitation_frequency_hz,rms_y_m\n1,big\n",
            "column rms_y_m holds 'big' in line 2; allowed: ",
        ),
        (
            "excitation_frequency_hz,rms_y_m\n1,1e308\n",
            "column rms_y_m holds 1e+308 in line 2; ",
        ),
        (
            f"excitation_frequency_hz,rms_y_m\n{10**31},1\n",
            "column excitation_frequency_hz holds 1e+31 in line 2; ",
        ),
        (
            "excitation_frequency_hz,rms_y_m\n23,1,0,002\n",
            "line 2 has more values than there are names; allowed: ",
        ),
        ("", "cannot be read: it is empty"),
        (None, "there is no such file"),
    ],
)
def test_data_that_cannot_be_drawn_are_refused(text, line, write_sweep, tmp_path):
    file = tmp_path / "rig.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(TableError) as caught:
        plot_results([write_sweep()], data=file)
    assert str(caught.value).replace(f"--data {file}", "").lstrip(": ").startswith(line)


@pytest.mark.parametrize("signs", [",.", ";.", ";,", "\t,"])
def test_data_are_laid_over_a_sweep_and_what_is_not_drawn_is_named(signs, write_sweep, tmp_path, caplog):
    """Whatever is between columns, and decimal commas where that is no comma."""
    file = tmp_path / "rig.csv"
    text = "excitation_frequency_hz|supply_frequency_hz|rms_y_m|who\n23.0|46|0.0002|me\n"
    file.write_text(text.replace(".", signs[1]).replace("|", signs[0]))
    (figure,) = drawn("sweep", write_sweep(), data=read_data(file)).values()
    axis = next(axis for axis in figure.axes if axis.get_ylabel() == "RMS $y$ (mm)")
    assert axis.lines[-1].get_ydata() == pytest.approx([0.2e-3])
    assert figure.legends[0].get_texts()[-1].get_text() == "measured: rig.csv"
    assert caplog.messages == [f"--data {file}: not drawn: who"]


# -- the paper ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper():
    """The tracked reproduction of the calibrated machine."""
    return Result.read(ROOT / "results" / "paper" / "calibrated", "paper")


def test_jumps_of_the_paper_are_arrows(paper):
    figure = FIGURES["fig2"](paper)
    assert sum("Fig. 2(a). $\\mu_w$ = 0" in jump.of for jump in figure.jumps) == 4  # two up, two down
    assert {line.get_color() for line in draw_picture(figure).axes[0].lines} == {MASSES[0.0]}


def test_differences_are_shown_of_curves_that_nearly_coincide():
    t = np.linspace(0.0, 0.1, 101)
    same = {"panel": 25.0, "excitation_frequency_hz": 25.0, "t_s": t}
    sizes = {1: 1.0, 2: 1.01, 3: 3.0}
    rows = [same | {"curve": n, "y_m": 1e-3 * size * np.sin(160.0 * t)} for n, size in sizes.items()]
    table = pd.concat([pd.DataFrame(row) for row in rows])

    class Found:
        def table(self, _):
            return table

    curves = [("1", "k"), ("2", "r"), ("3", "b")]
    main, below = draw_picture(history("fig4", "y_m", curves, "", near=0.2)(Found())).axes
    assert len(main.lines) == 3
    assert below.get_title(loc="left") == "Fig. 4(a), 2 minus 1"
    assert below.lines[-1].get_ydata() == pytest.approx(1e-5 * np.sin(160.0 * t))
    assert len(history("fig4", "y_m", curves, "")(Found()).panels) == 1


def test_plot_draws_the_paper_anew(paper, tmp_path, figures):
    place = tmp_path / "paper"
    shutil.copytree(paper.directory, place, ignore=shutil.ignore_patterns("*.png"))
    done = commands.command("plot", place, "--format", "svg")
    assert (done.code, done.err) == (0, "")
    assert [line.rpartition("/")[2] for line in done.out.splitlines()] == [f"{name}.svg" for name in FIGURES]
