"""Every figure of every degenerate table: no panel vanishes, nothing is cut off, and what is known is seen."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from common import handmade
from common.places import QUICKSTART
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from vibroplat import load_config
from vibroplat.config.kinds import KINDS
from vibroplat.errors import TableError
from vibroplat.plots import run
from vibroplat.plots.command import draw_results
from vibroplat.plots.style import styled
from vibroplat.results.result import Answer, Result
from vibroplat.results.run import RunResult

from .conftest import diagram, sweep_table

MASS = "material.mass_ratio"
FREQUENCIES = ["supply_frequency_hz", "excitation_frequency_hz"]
ORBITS = {
    "orbits": {
        "key": "drive.supply_frequency_hz",
        "start": 50.0,
        "stop": 56.0,
        "boundaries": {"key": MASS, "start": 0.0, "stop": 0.3},
    }
}
FIND = {"find": {"key": "motor.critical_torque_n_m", "start": 0.4, "stop": 8.0}}
RATIO, TURNED = "run.initial.speed_ratio", "run.initial.phase_difference_rad"
BASINS = {"basins": {"initial_conditions": {TURNED: [-3.0, 3.0, 6], RATIO: [0.0, 1.0, 5]}}}
SHARES = {"key": MASS, "values": [0.0, 0.2]}
RADIUS = "machine.unbalance_radius_m"
DESIGN = {
    "design": {
        "keys": {RADIUS: [0.02, 0.05]},
        "minimize": "motor_power_w",
        "constraints": {"rms_y_m": ">= 1e-3"},
        "parameter_tolerances": {"machine.platform_mass_kg": 0.05},
    }
}
#: Dots per inch of the pictures that are looked at, and the least width and height of a panel (inch).
DPI, LEAST = 60, (0.8, 0.4)

# -- tables ------------------------------------------------------------------------------------------------------------


def numbers(table):
    """Columns that are measured: those that can be lost, or be any number."""
    names = [name for name in table.select_dtypes("number") if name not in (*FREQUENCIES, *KEYS)]
    return [name for name in names if table[name].dtype == float]


KEYS = ("t_s", "branch", "parent", "point", "period", "curve", "panel", MASS)


def filled(value, *names):
    """All measures, or the columns of these names, have one value."""
    return lambda table: table.assign(**{n: value for n in numbers(table) if not names or n in names})


def times(factor, *names):
    return lambda table: table.assign(**{n: factor * table[n] for n in names or numbers(table) if n in table})


def some(value):
    """One value of each measure is another one."""

    def change(table):
        found = table.copy()
        found.loc[found.index[len(found) // 2 : len(found) // 2 + 1], numbers(found)] = value
        return found

    return change


def without(*names):
    return lambda table: table.drop(columns=[name for name in names if name in table])


def rows(chosen):
    return lambda table: table.iloc[chosen]


def where(column, *values):
    return lambda table: table[table[column].isin(values)] if column in table else table


def text(column, value):
    return lambda table: table.assign(**{column: value}) if column in table else table


def every(*changes):
    def change(table):
        for one in changes:
            table = one(table)
        return table

    return change


def failed(table):
    if "outcome" not in table:
        return table
    return filled(np.nan)(table).assign(outcome="too-many-events", sync=None, excitation_frequency_hz=np.nan)


#: How tables are altered, by what they are then.
CASES = {
    "as they are": lambda table: table,
    "no rows": rows(slice(0, 0)),
    "one row": rows(slice(0, 1)),
    "three rows": rows(slice(0, 3)),
    "one branch of one point": lambda table: (
        pd.concat([table.iloc[:1], table[table["branch"] != table["branch"].iloc[0]]]) if "branch" in table else table
    ),
    "no numbers": filled(np.nan),
    "one number missing": some(np.nan),
    "all infinite": filled(np.inf),
    "zero": filled(0.0),
    "nearly equal": every(filled(0.3), some(0.3 + 1e-15)),
    "huge": times(1e30),
    "one huge": some(1e30),
    "never lands": every(text("mode", "flight"), filled(1e-3, "gap_m"), filled(0.0, "contact_force_n", "impulse_n_s")),
    "no events": where("kind"),
    "no optional columns": without(
        "gap_m", "contact_force_n", "x_m", "phi_rad", "motion", "flight_fraction", "gap_max_m"
    ),
    "standing still": filled(0.0, "phi1_rate_rad_per_s", "phi2_rate_rad_per_s", "phi1_rad", "phi2_rad"),
    "all failed": failed,
    "never synchronous": every(text("sync", "none"), text("motion", "chaotic"), text("period", 0)),
}

# -- figures -----------------------------------------------------------------------------------------------------------


def drawn_run(kind, count=1):
    def draw(change, tables):
        whole = tables["run"]
        table, events = change(whole.trajectory), change(whole.events)
        changed = RunResult(whole.scene, whole.summary | {"name": "run"}, table=table)
        changed.events = events
        ((_, figure),) = draw_results([changed] * count, [kind])
        return figure

    return draw


def drawn_study(command, kind, keys=(), named=""):
    """Draw a picture of tables in memory; ``named`` are those of a study that has several."""

    def draw(change, tables):
        held = {name: change(table) for name, table in tables[named or command].items()}
        if command == "orbits":
            held["special"] = held["special"].loc[held["special"]["point"] < len(held["branches"])]
        elif command == "sweep":
            held["section"] = diagram(held["sweep"], "y_m")
            held["impacts"] = diagram(held["sweep"], "impact_speed_m_per_s")
        result = Result(command, load_config(QUICKSTART, dict(keys)), held, Answer())
        ((_, figure), *_) = draw_results([result], [kind])
        return figure

    return draw


FIGURES = {
    **{kind: drawn_run(kind) for kind in run.FIGURES},
    "force of two": drawn_run("force", 2),
    **{kind: drawn_study("sweep", kind) for kind in KINDS["sweep"].figures.split()},
    **{kind: drawn_study("orbits", kind, ORBITS) for kind in KINDS["orbits"].figures.split()},
    "thresholds": drawn_study("find", "thresholds", FIND),
    "basins": drawn_study("basins", "basins", BASINS),
    "shares": drawn_study("basins", "basins", {"basins": BASINS["basins"] | {"over": SHARES}}, "shares"),
    **{kind: drawn_study("design", kind, DESIGN) for kind in KINDS["design"].figures.split()},
}


def studies():
    """Tables of thresholds, basins and designs."""
    share = np.linspace(0.0, 1.0, 30)
    motion = {"rms_x_m": 1e-3 * share, "rms_y_m": 2e-3 - 1e-3 * share, "motor_power_w": 4.0 + share}
    orbit = {"sync": "antiphase", "motion": "periodic", "period": 1, "outcome": "ok", "phase_difference_rad": np.pi}
    scan = pd.DataFrame({"motor.critical_torque_n_m": 0.4 + 7.6 * share, "reason": "scan", **motion, **orbit})
    scan.loc[scan.index >= 15, ["sync", "phase_difference_rad"]] = ["in-phase", 0.0]
    found = pd.DataFrame({"kind": ["jump"], "value": [4.3], "below": [4.2], "above": [4.4]})
    found = found.assign(mixed_low=np.nan, mixed_high=np.nan, below_sync="antiphase", above_sync="in-phase")
    grid = [(turned, ratio) for turned in np.linspace(-3.0, 3.0, 6) for ratio in np.linspace(0.0, 1.0, 5)]
    starts = pd.DataFrame(grid, columns=[TURNED, RATIO])
    starts = starts.assign(turns=100, attractor=np.where(starts[TURNED].abs() < 2.0, "in-phase", "antiphase"))
    starts["attractor"] += ", period 1"
    attractors = pd.DataFrame({"attractor": ["in-phase, period 1", "antiphase, period 1"], "count": [20, 10]})
    attractors = attractors.assign(
        fraction=[0.67, 0.33], fraction_low=[0.5, 0.2], fraction_high=[0.8, 0.5], rms_x_m=[1e-3, 0.0],
        rms_y_m=[0.0, 2e-3], phase_difference_rad=[0.0, np.pi], motion="periodic", period=1, outcome="ok",
        excitation_frequency_hz=25.0,
    )  # fmt: skip
    over = pd.concat([attractors.assign(**{MASS: mass}) for mass in (0.0, 0.2)], ignore_index=True)
    evaluations = pd.DataFrame({"start": 0, RADIUS: 0.02 + 0.03 * share, **motion, "period": 1})
    evaluations = evaluations.assign(stability_margin=0.01, objective=evaluations["motor_power_w"])
    evaluations = evaluations.assign(feasible=share < 0.5, best=np.arange(30) == 3)
    samples = pd.DataFrame({"sample": np.arange(30), "machine.platform_mass_kg": 12.0 + share, **motion})
    samples = samples.assign(stable=True, regime="antiphase, period 1", stability_margin=0.01 + 0.001 * share)
    keys = [(m, key) for m in ("rms_y_m", "motor_power_w") for key in (RADIUS, "machine.platform_mass_kg")]
    sensitivities = pd.DataFrame(keys, columns=["measure", "key"]).assign(value=1.0, elasticity=[1.0, -0.5, 2.0, 0.1])
    return {
        "find": {"scan": scan, "thresholds": found},
        "basins": {"attractors": attractors, "starts": starts},
        "shares": {"attractors": over, "starts": starts.assign(**{MASS: 0.0})},
        "design": {"sensitivities": sensitivities, "samples": samples, "evaluations": evaluations},
    }


@pytest.fixture(scope="module")
def tables(runs):
    found = sweep_table()
    branches = handmade.branches()
    followed = {"branches": branches, "special": handmade.special(branches), "boundaries": handmade.boundaries()}
    return studies() | {"run": runs["two layers"], "sweep": {"sweep": found}, "orbits": followed}


# -- what is looked at -------------------------------------------------------------------------------------------------


def faults(figure):
    """What a reader of a figure would call broken."""
    figure.set_dpi(DPI)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., :3]
    whole = figure.bbox
    for axis in (axis for axis in figure.axes if axis.get_visible() and axis.axison):
        box = axis.get_window_extent()
        name = axis.get_ylabel() or axis.get_title(loc="left") or "a panel"
        if min(box.x0, box.y0) < -1.0 or box.x1 > whole.x1 + 1.0 or box.y1 > whole.y1 + 1.0:
            yield f"{name} lies outside"
        if not hasattr(axis, "_colorbar"):
            if box.width < LEAST[0] * DPI or box.height < LEAST[1] * DPI:
                yield f"{name} has {box.width:.0f} by {box.height:.0f} pixels"
            elif _has_data(axis) and not _ink(picture, box):
                yield f"{name} shows nothing"
    written = [(one, one.get_window_extent()) for one in _seen(figure)]
    for one, box in written:
        if box.x0 < -2.0 or box.y0 < -2.0 or box.x1 > whole.x1 + 2.0 or box.y1 > whole.y1 + 2.0:
            yield f"{one.get_text()!r} is cut"
    for (one, a), (other, b) in combinations(written, 2):
        if min(a.x1, b.x1) - max(a.x0, b.x0) > 2.0 and min(a.y1, b.y1) - max(a.y0, b.y0) > 2.0:
            yield f"{one.get_text()!r} and {other.get_text()!r} lie on each other"


def _seen(figure):
    """Texts that are drawn: of labels of ticks, those within the limits of their axis."""
    hidden = set()
    for axis in figure.axes:
        if not (axis.get_visible() and axis.axison):
            hidden |= {*(axis if not axis.get_visible() else axis.xaxis).findobj(Text), *axis.yaxis.findobj(Text)}
            continue
        for line in (axis.xaxis, axis.yaxis):
            drawn = {label for tick in line._update_ticks() for label in (tick.label1, tick.label2)}
            hidden |= {*line.findobj(Text)} - drawn - {line.label, line.get_offset_text()}
    return [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip() and one not in hidden]


def _has_data(axis):
    """Whether an axis has points that can be drawn."""
    for line in axis.lines:
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        known = np.isfinite(x) & np.isfinite(y)
        ranges = [np.ptp(v[known]) > 1e-9 * np.abs(v[known]).max() for v in (x, y) if known.any()]
        if line.get_transform() == axis.transData and any(ranges):
            return True
    return False


def _ink(picture, box):
    """Whether something darker than the grid is inside a panel."""
    height = picture.shape[0]
    inside = picture[int(height - box.y1) + 2 : int(height - box.y0) - 2, int(box.x0) + 3 : int(box.x1) - 2]
    return bool((inside.min(axis=2) < 170).any())


def look(figure, case, tables):
    """Draw, and return what is broken. A case that alters nothing here is not looked at; refusals are of one line."""
    altered = [case == "as they are"]

    def change(table):
        found = CASES[case](table)
        altered.append(not found.equals(table))
        return found

    with styled():
        try:
            drawn = FIGURES[figure](change, tables)
        except TableError as told:
            return [] if len(str(told).splitlines()) == 1 else [f"{told} has several lines"]
        return sorted({*faults(drawn)}) if any(altered) else []


#: Pairs that are looked at each time: what was broken once, one of each kind.
PAIRS = [
    ("motion", "never lands"),
    ("force of two", "never lands"),
    ("exciters", "all infinite"),
    ("multipliers", "no numbers"),
    ("branches", "no numbers"),
    ("boundaries", "no events"),
    ("multipliers", "huge"),
    ("response", "three rows"),
    ("thresholds", "no numbers"),
    ("basins", "one row"),
    ("shares", "all failed"),
    ("loads", "one huge"),
    ("basins", "one huge"),
    ("samples", "one row"),
    ("evaluations", "no rows"),
    ("sensitivities", "zero"),
]


@pytest.mark.parametrize(("figure", "case"), PAIRS)
def test_a_figure_of_a_degenerate_table_is_whole(figure, case, tables):
    assert look(figure, case, tables) == []


@pytest.mark.campaign
@pytest.mark.parametrize("figure", FIGURES)
def test_a_figure_of_any_degenerate_table_is_whole(figure, tables):
    assert {case: told for case in CASES if (told := look(figure, case, tables))} == {}
