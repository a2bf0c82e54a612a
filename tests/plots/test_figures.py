"""Figures of several results, of measured data, in other formats, and those of the paper and of benchmarks."""

from __future__ import annotations

import shutil

import numpy as np
import pandas as pd
import pytest
from common import commands
from common.places import QUICKSTART
from matplotlib.collections import LineCollection

from vibroplat import load_config
from vibroplat.errors import TableError, VibroplatError
from vibroplat.plots.command import Wanted, plot_results
from vibroplat.plots.histories import history
from vibroplat.plots.names import run_parameters
from vibroplat.plots.paper import FIGURES, MASSES
from vibroplat.plots.run import plot_run
from vibroplat.plots.style import Saving
from vibroplat.plots.sweep import plot_sweep
from vibroplat.results.files import Result
from vibroplat.results.tables import read_json, read_table, write_json, write_table

PLAN = "sweep.supply_frequency_hz={start: 44, stop: 50, step: 2, direction: [up, down]}"


@pytest.fixture(scope="module")
def written(tmp_path_factory, kernels):
    """Two runs, a run from rest, and two sweeps."""
    place = tmp_path_factory.mktemp("place")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        for name, change in (("a", "contact.restitution=0"), ("b", "contact.restitution=0.5")):
            run = ("run", QUICKSTART, "--set", "run.duration_s=0.6", "--set", f"name={name}", "--set", change)
            assert commands.command(*run).code == 0
        for name, mass in (("soft", 0.1), ("hard", 0.2)):
            changes = (PLAN, f"sweep.grid={{material.mass_ratio: [{mass}]}}", f"name={name}", "sweep.max_settle_s=5")
            done = commands.command("sweep", QUICKSTART, *(x for c in changes for x in ("--set", c)))
            assert (done.code, done.err) == (0, "")
            assert f"material.mass_ratio {mass}, up\n  antiphase  " in done.out
    return place / "results"


def drawn(result, figures, kind, **options):
    plot_run(result, [kind], **options)
    return figures[kind]


# -- a run ----------------------------------------------------------------------------------------------


def test_motion_shows_the_range_over_the_whole_run_and_the_last_turns(written, figures):
    figure = drawn(written / "a", figures, "motion")
    titles = [axis.get_title(loc="left").splitlines()[-1] for axis in figure.axes[:2]]
    assert titles == ["whole run, range of values", "last turns, grey on the left"]
    table = read_table(written / "a", "trajectory")
    whole = figure.axes[0].collections[0].get_datalim(figure.axes[0].transData)
    assert (whole.y0, whole.y1) == pytest.approx((1e3 * table["y_m"].min(), 1e3 * table["y_m"].max()))
    assert whole.x1 - whole.x0 > 0.5
    assert np.ptp(figure.axes[1].lines[0].get_xdata()) < 0.41


def test_motion_shows_rocking_only_where_it_matters(written, figures):
    labels = [axis.get_ylabel() for axis in drawn(written / "a", figures, "motion").axes]
    assert labels == ["$y$ (mm)", "$y$ (mm)", "gap $y_{w1}$ (mm)", "gap $y_{w1}$ (mm)"]


def test_parameters_are_in_the_title(written, figures):
    figure = drawn(written / "b", figures, "force")
    assert figure.get_suptitle() == "b"
    assert figure.axes[0].get_title(loc="left") == r"$f_e$ = 51.5 Hz, $\mu_w$ = 0.2, two layers, $R$ = 0.5"


def test_what_is_switched_is_in_the_title():
    program = [{"t_s": 0.0, "supply_frequency_hz": 50.0}, {"t_s": 2.0, "exciter_2": "off"}, {"t_s": 3.5, "off": True}]
    scene = load_config(QUICKSTART, {"drive": {"program": program}})
    assert run_parameters(scene).startswith("$f_e$ = 50 Hz, motor 2 off at 2 s, motors off at 3.5 s, ")


def test_force_alone_is_refused_without_contact(runs, tmp_path):
    runs["bare"].save(tmp_path / "bare")
    with pytest.raises(TableError, match="has no contact force, as its scene is bare or non-impact"):
        plot_results([tmp_path / "bare"], Wanted(["force"]))


def test_impulses_are_stems_on_an_axis_of_their_own(written, figures):
    force, impulses = drawn(written / "a", figures, "force").axes
    assert [axis.get_ylabel() for axis in (force, impulses)] == ["contact force $F_c$ (N)", "impulse $P$ (N·s)"]
    events = read_table(written / "a", "events")
    strikes = events[(events["impulse_n_s"] > 0.0) & (events["t_s"] >= impulses.lines[0].get_xdata()[0])]
    assert impulses.lines[0].get_ydata().tolist() == strikes["impulse_n_s"].tolist()
    (stems,) = (c for c in impulses.collections if isinstance(c, LineCollection))
    assert len(stems.get_segments()) == len(strikes)
    assert all(segment[0][1] == 0.0 for segment in stems.get_segments())
    assert force.get_shared_x_axes().joined(force, impulses)
    assert not force.get_shared_y_axes().joined(force, impulses)
    assert not any(isinstance(c, LineCollection) for c in force.collections)
    assert impulses.get_position().y1 <= force.get_position().y0 + 1e-9  # below, not on it


def test_runs_are_laid_over_each_other_from_a_whole_turn_on(written, figures, tmp_path):
    paths = plot_run([written / "a", written / "b"], ["motion", "force", "exciters"], saving=Saving(directory=tmp_path))
    assert [path.name for path in paths] == ["motion-compared.png", "force-compared.png", "exciters-compared.png"]
    for line in figures["motion"].axes[1].lines:
        times = line.get_xdata()
        assert 0.0 <= times[0] < 1e-3
    assert [line.get_label() for line in figures["motion"].axes[1].lines] == ["a ($R$ = 0)", "b ($R$ = 0.5)"]
    for kind in ("motion", "force", "exciters"):
        named = [text.get_text() for text in figures[kind].legends[0].get_texts()]
        assert named[:2] == ["a ($R$ = 0)", "b ($R$ = 0.5)"]
    colours = {line.get_color() for line in figures["motion"].axes[1].lines}
    assert len(colours) == 2
    assert not figures["motion"].axes[1].patches  # contact of two runs cannot be shaded


# -- sweeps ---------------------------------------------------------------------------------------------


def test_sweeps_are_laid_over_each_other(written, figures):
    (path,) = plot_sweep([written / "soft", written / "hard"], [])
    assert path == written / "soft" / "response-compared.png"
    named = [text.get_text() for text in figures["response"].legends[0].get_texts()]
    assert named[:2] == [r"soft, $\mu_w$ = 0.1", r"hard, $\mu_w$ = 0.2"]
    lines = [line for line in figures["response"].axes[0].lines if line.get_linestyle() != "None"]
    assert len(lines) == 4
    path.unlink()


def test_a_key_that_one_sweep_does_not_vary_has_the_value_it_was_made_with(written, figures, tmp_path):
    plain = tmp_path / "plain"
    shutil.copytree(written / "hard", plain)
    write_table(read_table(plain, "sweep").drop(columns="material.mass_ratio"), plain, "sweep", "parquet")
    proof = read_json(plain, "provenance")
    proof["configuration"]["material"]["mass_ratio"] = 0.3
    del proof["files"]  # the digests
    write_json(proof, plain, "provenance")
    plot_results([written / "soft", plain], Wanted(saving=Saving(directory=tmp_path)))
    named = [text.get_text() for text in figures["response"].legends[0].get_texts()]
    assert named[:2] == [r"soft, $\mu_w$ = 0.1", r"plain, $\mu_w$ = 0.3"]


def test_x_is_the_supply_frequency_if_asked_for(written, figures, tmp_path):
    plot_results([written / "hard"], Wanted(x="supply", saving=Saving(directory=tmp_path)))
    axis = figures["response"].axes[0]
    assert axis.lines[0].get_xdata().tolist() == [44.0, 46.0, 48.0, 50.0]
    assert any(a.get_xlabel() == "supply frequency $f_e$ (Hz)" for a in figures["response"].axes)


def test_bands_are_written_beside_the_sweep(written):
    table = Result(written / "hard", "sweep").table("bands")
    assert table["branch"].unique().tolist() == [0, 1]
    assert {"band", "liftoff", "flight-end", "largest"} <= set(table["kind"])
    flight = table[table["kind"] == "liftoff"].iloc[0]
    assert flight["to_supply_frequency_hz"] - flight["from_supply_frequency_hz"] == 2.0


# -- measured data --------------------------------------------------------------------------------------


def test_data_are_laid_over_a_run_and_a_sweep(written, figures, tmp_path):
    file = tmp_path / "rig.csv"
    pd.DataFrame({"t_s": [0.4, 0.5], "y_m": [1e-4, -2e-4]}).to_csv(file, index=False)
    plot_results([written / "a"], Wanted(["motion"], data=file, saving=Saving(directory=tmp_path)))
    for axis in figures["motion"].axes[:2]:
        assert axis.lines[-1].get_ydata() == pytest.approx([0.1, -0.2])
        assert axis.lines[-1].get_label() == "measured: rig.csv"
    assert not any(line.get_marker() == "D" for axis in figures["motion"].axes[2:] for line in axis.lines)
    pd.DataFrame({"excitation_frequency_hz": [23.0], "rms_y_m": [2e-4]}).to_csv(file, index=False)
    plot_results([written / "hard"], Wanted(data=file, saving=Saving(directory=tmp_path)))
    assert figures["response"].axes[0].lines[-1].get_ydata() == pytest.approx([0.2])


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("f,rms_y_m\n1,2\n", "no column of the horizontal axis in f, rms_y_m; allowed: excitation_frequency_hz"),
        ("excitation_frequency_hz,y\n1,2\n", "no column that a figure shows in excitation_frequency_hz, y; allowed: "),
        ("excitation_frequency_hz,rms_y_m\n1,big\n", "column rms_y_m holds text; allowed: numbers"),
        ("", "cannot be read: No columns"),
    ],
)
def test_data_that_cannot_be_drawn_are_refused(text, line, written, tmp_path):
    file = tmp_path / "rig.csv"
    file.write_text(text)
    with pytest.raises(TableError) as caught:
        plot_results([written / "hard"], Wanted(data=file))
    assert str(caught.value).replace(f"--data {file}", "").lstrip(": ").startswith(line)


def test_columns_of_data_that_no_figure_shows_are_named(written, figures, tmp_path, caplog):
    file = tmp_path / "rig.csv"
    file.write_text("excitation_frequency_hz,supply_frequency_hz,rms_y_m,who\n23,46,1e-4,me\n")
    plot_results([written / "hard"], Wanted(data=file, saving=Saving(directory=tmp_path)))
    assert caplog.messages == [f"--data {file}: not drawn: who"]


# -- files ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("form", "begin"), [("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_formats_and_places(form, begin, written, tmp_path):
    done = commands.command("plot", written / "a", "--kind", "force", "--format", form, "--out", tmp_path / "new")
    path = tmp_path / "new" / f"force.{form}"
    assert (done.code, done.out, done.err) == (0, f"{path}\n", "")
    content = path.read_bytes()
    assert content.startswith(begin)
    again = commands.command("plot", written / "a", "--kind", "force", "--format", form, "--out", tmp_path / "new")
    assert again.code == 0
    assert path.read_bytes() == content


def test_dots_per_inch(written, tmp_path):
    sizes = []
    for dpi in (50, 100):
        saving = Saving(dpi=dpi, directory=tmp_path)
        (path,) = plot_run(written / "a", ["force"], saving=saving)
        sizes.append(int.from_bytes(path.read_bytes()[16:20]))
    assert sizes[1] == 2 * sizes[0]


# -- refused --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "wanted", "line"),
    [
        (["a", "hard"], Wanted(), "hold no results of one command; allowed: several runs, or several sweeps"),
        (["soft", "hard"], Wanted(["map"]), "--kind map shows one sweep; allowed with 2 of them: response"),
        (["hard"], Wanted(start=1.0), "--start 1.0: no figure of DIR heeds it; allowed: with a run"),
        (
            ["a"],
            Wanted(x="supply"),
            "--x supply: no figure of DIR heeds it; allowed: with a sweep and branches of orbits",
        ),
    ],
)
def test_what_results_cannot_show_is_refused(names, wanted, line, written):
    with pytest.raises(VibroplatError) as caught:
        plot_results([written / name for name in names], wanted)
    assert str(caught.value).replace(str(written / names[0]), "DIR").endswith(line)


# -- the paper ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paper():
    """The tracked reproduction of the calibrated machine."""
    return Result(QUICKSTART.parents[1] / "results" / "paper" / "calibrated", "paper")


def test_jumps_of_the_paper_are_vertical_arrows(paper):
    figure = FIGURES["fig2"](paper)
    arrows = [text for text in figure.axes[0].texts if text.arrow_patch is not None]
    assert len(arrows) == 4  # two up, two down
    assert all(arrow.xy[0] == arrow.get_position()[0] for arrow in arrows)


def test_a_mass_has_one_colour_in_all_figures_of_the_paper(paper):
    two, three, four, five = (FIGURES[f"fig{n}"](paper) for n in (2, 3, 4, 5))
    assert {line.get_color() for line in two.axes[0].lines} == {MASSES[0.0]}
    assert [line.get_color() for line in four.axes[0].lines] == list(MASSES.values())
    assert [line.get_color() for line in five.axes[0].lines] == list(MASSES.values())[:2]
    for axis, colour in zip(three.axes[1:], MASSES.values(), strict=True):
        assert {line.get_color() for line in axis.lines} == {colour}


def test_differences_are_shown_of_curves_that_nearly_coincide(tmp_path):
    t = np.linspace(0.0, 0.1, 101)
    rows = [
        {
            "panel": 25.0,
            "curve": curve,
            "excitation_frequency_hz": 25.0,
            "t_s": t,
            "y_m": 1e-3 * size * np.sin(160.0 * t),
        }
        for curve, size in ((1, 1.0), (2, 1.01), (3, 3.0))
    ]
    table = pd.concat([pd.DataFrame(row) for row in rows])

    class Found:
        def table(self, _):
            return table

    curves = [("1", "k"), ("2", "r"), ("3", "b")]
    figure = history("fig4", "y_m", curves, "", near=0.2)(Found())
    main, below = figure.axes
    assert len(main.lines) == 3
    assert below.get_ylabel().startswith("2 minus 1")
    assert below.lines[-1].get_ydata() == pytest.approx(0.01 * np.sin(160.0 * t))
    assert len(history("fig4", "y_m", curves, "")(Found()).axes) == 1


def test_plot_draws_the_paper_anew(paper, tmp_path, figures):
    place = tmp_path / "paper"
    shutil.copytree(paper.directory, place, ignore=shutil.ignore_patterns("*.png"))
    done = commands.command("plot", place, "--format", "svg")
    assert (done.code, done.err) == (0, "")
    assert [line.rpartition("/")[2] for line in done.out.splitlines()] == [f"{name}.svg" for name in FIGURES]
