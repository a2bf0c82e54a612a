"""Figures of designs: elasticities, samples, evaluations with a Pareto front, and what has little to show."""

import numpy as np
import pandas as pd
import pytest
from common.places import ROOT

from vibroplat import Scene, design, load_config
from vibroplat.errors import TableError
from vibroplat.plots.command import draw_results
from vibroplat.results.result import Answer, Result

KEYS = {"solver.engine": "taylor", "drive.supply_frequency_hz": 55.0, "material.mass_ratio": 0.1}
MASS, RADIUS = "machine.platform_mass_kg", "machine.unbalance_radius_m"
BEST = {"keys": {MASS: [1.0, 2.0]}, "minimize": "motor_power_w", "constraints": {"rms_y_m": ">= 1e-3"}}
LOST = "bound that nothing keeps"
PLANS = {
    "samples": {"keys": {MASS: [10.0, 14.0]}, "parameter_tolerances": {MASS: 0.01}, "samples": 8},
    "evaluations": {
        "keys": {RADIUS: [0.018, 0.048]},
        "minimize": "motor_power_w",
        "constraints": {"rms_y_m": ">= 0.5e-3"},
        "starts": 1,
        "pareto": {"rms_y_m": [0.4e-3, 0.5e-3, 9e-3]},
    },
}


@pytest.mark.parametrize(("kind", "key"), [("samples", "platform mass"), ("evaluations", "unbalance radius")])
def test_a_result_has_the_figures_of_its_tables(kind, key):
    result = design(load_config(ROOT / "configs/machines/calibrated.yaml", KEYS | {"design": PLANS[kind]}))
    bars, figure = result.plot().axes[0], result.plot(kind)
    assert [tick.get_text() for tick in bars.get_yticklabels()] == [key]
    legends = [*figure.legends, *(one for axis in figure.axes if (one := axis.get_legend()))]
    labels = {text.get_text() for legend in legends for text in legend.get_texts()}
    if kind == "samples":
        assert labels == {"antiphase, period 1", "nominal"}
        dots, *rings = (line for line in figure.axes[0].lines if line.get_marker() == "o")
        assert len(dots.get_xdata()) == 8
        assert (np.diff(dots.get_xdata()) >= 0.0).all()
        assert [ring.get_ydata()[0] for ring in rings] == [5, 50, 95]
    else:
        assert labels >= {"best: the least that keeps all bounds", "RMS y ≥ 0.5 mm", "Pareto front", LOST}
        assert any(label.startswith("keeps all bounds (") for label in labels)
        assert figure.get_suptitle().startswith("Best: motor power ")
        with pytest.raises(TableError, match="holds no table samples; allowed: sensitivities, evaluations"):
            result.plot("samples")


def drawn(plan, kind, **tables):
    """The figure of tables in memory."""
    scene = Scene().replace({"name": "d", "design": plan})
    ((_, figure),) = draw_results([Result("design", scene, tables, Answer())], [kind])
    return figure


def elastic(**measures):
    """A table of sensitivities by one key."""
    names, values = list(measures), list(measures.values())
    return pd.DataFrame({"measure": names, "key": MASS, "value": 0.5, "elasticity": values})


def test_what_has_little_to_show_says_so():
    table = elastic(rms_x_m=np.nan)
    figure = drawn({}, "sensitivities", sensitivities=table)
    assert figure.axes[0].get_title("left").endswith("no measure has elasticities")
    samples = pd.DataFrame(
        {"sample": [0], "stable": [False], "regime": "lost", "stability_margin": [np.nan], "rms_x_m": [np.nan]}
    )
    figure = drawn({"parameter_tolerances": {MASS: 0.1}}, "samples", sensitivities=table, samples=samples)
    assert "no measure varies" in figure.axes[0].get_title("left")
    nothing = {name: np.empty(0) for name in ("start", MASS, "motor_power_w", "rms_y_m", "feasible", "best")}
    figure = drawn(BEST, "evaluations", sensitivities=table, evaluations=pd.DataFrame(nothing))
    assert "every start lost the orbit" in figure.axes[0].get_title("left")
    with pytest.raises(TableError, match="d holds no table samples; allowed: sensitivities"):
        drawn({}, "samples", sensitivities=table)


def test_rings_of_samples_are_told_in_the_units_of_their_axes():
    samples = pd.DataFrame({"sample": range(41), "stable": True, "regime": "antiphase, period 1"})
    samples = samples.assign(motor_power_w=np.linspace(1800.0, 2200.0, 41), rms_y_m=np.linspace(1e-3, 2e-3, 41))
    table = elastic(motor_power_w=1.0, rms_y_m=1.0)
    figure = drawn({"parameter_tolerances": {MASS: 0.1}}, "samples", sensitivities=table, samples=samples)
    told = {axis.get_xlabel(): [text.get_text() for text in axis.texts] for axis in figure.axes if axis.axison}
    assert told["RMS $y$ (mm)"] == ["1.05 mm", "1.50 mm", "1.95 mm"]
    assert ["1.82 kW", "2.00 kW", "2.18 kW"] in [*told.values()]
    labels = [text.get_text() for one in figure.legends for text in one.get_texts()]
    labels += [text.get_text() for axis in figure.axes if (one := axis.get_legend()) for text in one.get_texts()]
    assert labels.count("nominal") == 1


def test_rings_of_phases_that_pass_the_end_of_their_axis_lie_among_their_samples():
    away = np.linspace(-0.4, 0.4, 41)
    samples = pd.DataFrame({"sample": range(41), "stable": True, "regime": "intermediate, period 1"})
    samples = samples.assign(phase_difference_rad=away - 0.5 * np.pi)
    table = elastic(phase_difference_rad=np.nan)
    figure = drawn({"parameter_tolerances": {MASS: 0.1}}, "samples", sensitivities=table, samples=samples)
    (axis,) = (axis for axis in figure.axes if axis.axison)
    assert [text.get_text() for text in axis.texts] == ["−111 °", "−90 °", "−69 °"]


def test_samples_are_judged_by_the_bounds_in_the_units_of_their_axes():
    random = np.random.default_rng(0)
    samples = pd.DataFrame({"sample": range(40), "stable": True, "regime": "antiphase, period 1"})
    samples = samples.assign(rms_y_m=np.linspace(0.8e-3, 1.6e-3, 40), motor_power_w=4.0 + 1e-4 * random.random(40))
    table = pd.concat([elastic(rms_y_m=1.0, motor_power_w=1.0)])
    rows = pd.DataFrame({"start": 0, "rms_y_m": [1.1e-3], "motor_power_w": 4.0, "feasible": True, "best": True})
    plan = BEST | {"parameter_tolerances": {MASS: 0.1}}
    figure = drawn(plan, "samples", sensitivities=table, samples=samples, evaluations=rows)
    (axis,) = (axis for axis in figure.axes if axis.axison)  # what hardly varies is told
    told = axis.get_title("left").splitlines()
    assert told[-2:] == ["hardly varies: motor power 4.00 W", "RMS y ≥ 1 mm: 75 % keep it"]
    assert [line.get_xdata()[0] for line in axis.lines if line.get_marker() == "None"] == pytest.approx([1.1e-3, 1e-3])
