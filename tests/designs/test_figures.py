"""Figures of designs: elasticities, samples, evaluations with a Pareto front, and what has little to show."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from vibroplat.config.questions import DesignPlan
from vibroplat.errors import TableError
from vibroplat.plots.designs import design_figure

ROOT = Path(__file__).parents[2]
CONFIG = """
extends: {machine}
solver: {{engine: taylor}}
drive: {{supply_frequency_hz: 55.0}}
material: {{mass_ratio: 0.1}}
design: {{{plan}}}
"""
MASS, RADIUS = "machine.platform_mass_kg", "machine.unbalance_radius_m"
PLANS = {
    "samples": f"keys: {{{MASS}: [10, 14]}}, parameter_tolerances: {{{MASS}: 0.01}}, samples: 8",
    "evaluations": f"keys: {{{RADIUS}: [0.018, 0.048]}}, minimize: motor_power_w, "
    "constraints: {rms_y_m: '>= 0.5e-3'}, "
    "starts: 1, pareto: {rms_y_m: [0.4e-3, 0.5e-3, 9e-3]}",
}


@pytest.mark.parametrize("kind", PLANS)
def test_a_result_has_the_figures_of_its_tables(kind, command, figures, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = CONFIG.format(machine=ROOT / "configs/machines/calibrated.yaml", plan=PLANS[kind])
    (tmp_path / "c.yaml").write_text(text, encoding="utf-8")
    assert command("design", "c.yaml", "--out", ".").code == 0
    assert command("plot", "c").code == 0
    assert set(figures) == {"sensitivities", kind}
    bars = figures["sensitivities"].axes[0]
    assert [tick.get_text() for tick in bars.get_yticklabels()] == [
        "platform mass" if kind == "samples" else "unbalance radius"
    ]
    (legend,) = figures[kind].legends
    labels = {text.get_text() for text in legend.get_texts()}
    if kind == "samples":
        assert labels == {"stable", "nominal"}
        assert sum(patch.get_height() for patch in figures[kind].axes[0].patches) == 8
    else:
        assert labels >= {"keeps all bounds", "best", "bound", "Pareto front", "bound that nothing keeps"}
    done = command("plot", "c", "--kind", "samples")
    if kind == "samples":
        assert done.code == 0
    else:
        assert (done.code, "c holds no table samples; allowed: sensitivities, evaluations" in done.err) == (2, True)


def test_many_tolerances_leave_all_panels_their_width():
    keys = [f"machine.{name}_{way}" for name in ("stiffness", "damping") for way in ("x_n_per_m", "y_n_per_m", "phi")]
    plan = DesignPlan.model_construct(
        parameter_tolerances=dict.fromkeys([*keys, *(f"{key}_2" for key in keys)], 0.05), minimize=None
    )
    random = np.random.default_rng(0)
    samples = pd.DataFrame({name: random.random(20) for name in ("rms_x_m", "rms_y_m", "motor_power_w")})
    table = pd.DataFrame({"measure": samples.columns, "key": MASS, "value": 0.5, "elasticity": 1.0})
    figure = design_figure("d", None, plan, {"sensitivities": table, "samples": samples.assign(stable=True)}, "samples")
    FigureCanvasAgg(figure).draw()
    assert figure.axes[0].get_title("left").endswith(", 2\N{NO-BREAK SPACE}more")
    gaps = np.diff([axis.get_position().x0 for axis in figure.axes])
    assert gaps[0] == pytest.approx(gaps[1], rel=0.05)


def test_a_front_without_lost_bounds_leaves_no_gap_below():
    plan = DesignPlan(keys={MASS: [1.0, 2.0]}, minimize="motor_power_w", constraints={"rms_y_m": ">= 1e-3"})
    rows = pd.DataFrame({"rms_y_m": [1e-3, 2e-3], "motor_power_w": [1.0, 2.0], "feasible": True, "best": [True, False]})
    tables = {"evaluations": rows.assign(start=0), "pareto": rows.assign(bound=rows["rms_y_m"])}
    figure = design_figure("d", None, plan, tables, "evaluations")
    assert all(len(line.get_xdata()) for line in figure.axes[0].lines)


def test_what_has_little_to_show_says_so():
    table = pd.DataFrame({"measure": ["rms_x_m"], "key": [MASS], "value": [0.0], "elasticity": [np.nan]})
    tables = {"sensitivities": table}
    figure = design_figure("d", None, DesignPlan(), tables, "sensitivities")
    assert [text.get_text() for text in figure.axes[0].texts] == ["no measure has elasticities"]
    samples = pd.DataFrame({"sample": [0], "stable": [False], "stability_margin": [np.nan], "rms_x_m": [np.nan]})
    figure = design_figure(
        "d", None, DesignPlan(parameter_tolerances={MASS: 0.1}), tables | {"samples": samples}, "samples"
    )
    assert [text.get_text() for text in figure.axes[0].texts] == ["no measure varies"]
    plan = DesignPlan(keys={MASS: [1.0, 2.0]}, minimize="motor_power_w", constraints={"stability_margin": ">= 0.1"})
    nothing = pd.DataFrame(
        {name: np.empty(0) for name in ("start", MASS, "motor_power_w", "stability_margin", "feasible", "best")}
    )
    figure = design_figure("d", None, plan, tables | {"evaluations": nothing}, "evaluations")
    assert "every start lost the orbit" in [text.get_text() for text in figure.axes[0].texts]
    with pytest.raises(TableError, match="d holds no table pareto; allowed: sensitivities"):
        design_figure("d", None, plan, tables, "pareto")
