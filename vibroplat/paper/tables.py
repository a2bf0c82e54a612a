"""Tables of a reproduction besides curves and claims.

They are time histories, synchronization, the effect of the impact law, and contradictions between the paper's numbers
and its figures. The last are formulas without simulation or unprinted numbers: in steady antiphase the forces of both
exciters add along y. A stiff layer moves with the platform as one mass, with the amplitude
A = 2 m_r r ω²/√((c_y − (M + m_w)ω²)² + b_y²ω²), and leaves it if Aω² > g. At the vertical resonance each motor supplies
half of the power that the damper b_y takes, by the mean torque (m_r r)²ω³/b_y. If that is above the motor's critical
torque, the resonance captures the motor (Sommerfeld; Blekhman 2000).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from vibroplat.columns import Column, Columns
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import static_rest
from vibroplat.motion.run import simulate
from vibroplat.paper.evidence import EDGE, Evidence, F
from vibroplat.paper.scenes import BETA, paper_scene
from vibroplat.results.provenance import configuration_hash
from vibroplat.study.branches import SUPPLY
from vibroplat.study.pool import Pool, StoredChain, Task, Tasks, run_stored
from vibroplat.study.store import Record, Store

#: Frequencies (Hz) of the panels of Figs. 4, 5 and 7, and the scenes of their curves in the paper's numbering.
PANELS: dict[str, tuple[str, ...]] = {
    "fig4": ("25.75", "30.7", "38.75"),
    "fig5": ("25.75", "30.7", "38.75"),
    "fig7": ("25.75", "28.75", "30.7", "38.75"),
}
CURVES: dict[str, tuple[str, ...]] = {
    "fig4": ("mu0.1", "mu0.2", "mu0"),
    "fig5": ("mu0.1", "mu0.2"),
    "fig7": ("mu0.2", "mu0.2-R0.3", "mu0.2-R0.5", "mu0.2-nonimpact"),
}
#: Turns of exciter 1 that a time history shows, and its points per second.
SHOWN, RATE = 8, 2000.0

#: Frequencies (Hz) up to which motion is attached in the paper, by mass ratio.
LIFTOFF = {0.1: 24.5, 0.2: 24.0}
#: Lowest frequency (Hz) of the search for liftoff; the highest is the vertical resonance.
LOWEST = 10.0

#: The tables of Figs. 4, 5 and 7, a row for each time.
HISTORY: Columns = {
    "panel": Column("the paper's excitation frequency of the panel, in Hz"),
    "curve": Column("number of the curve in the paper"),
    "scene": Column("name of the scene"),
    "excitation_frequency_hz": Column("mean speed of both exciters"),
    "t_s": Column("time", "from a whole turn of exciter 1"),
    "y_m": Column("displacement along y", "from the static rest"),
    "gap_m": Column("gap", "empty without contact"),
}
#: The table ``sync-bands``, a row for each stretch of points with the same synchronization.
SYNC_BANDS: Columns = {
    "mass_ratio": Column("mass of the material over that of the machine"),
    "restitution": Column("coefficient of restitution"),
    "model": Column("contact model"),
    "law": Column("impact law"),
    "direction": Column("direction of the branch"),
    "sync": Column("synchronization of the exciters"),
    "points": Column("points of the stretch"),
    "first_hz": Column("excitation frequency of its first point"),
    "last_hz": Column("excitation frequency of its last point"),
    "first_supply_hz": Column("supply frequency of its first point"),
    "last_supply_hz": Column("supply frequency of its last point"),
    "rms_y_largest_m": Column("largest RMS of y"),
}
#: The table ``impact-laws``, a row for each law and restitution.
IMPACT_LAWS: Columns = {
    "impact_law": Column("impact law"),
    "restitution": Column("coefficient of restitution"),
    **{
        f"{side}_{kind}": Column(f"{kind} relative difference of RMS y {side} resonance", "from law conservative")
        for side in ("below", "above")
        for kind in ("largest", "mean")
    },
    "jump_hz": Column("excitation frequency where antiphase ends below the second resonance"),
    "jump_conservative_hz": Column("the same with law conservative"),
}
#: The table ``contradictions``, a row for each quantity.
CONTRADICTIONS: Columns = {
    "what": Column("a quantity"),
    "unit": Column("its unit"),
    "figures": Column("value that the paper's figures require"),
    "machine": Column("value that the machine has"),
}


def histories(numbers: Mapping[str, Any], beta: float | None, records: Store, workers: Pool) -> dict[str, pd.DataFrame]:
    """Return the tables of Figs. 4, 5 and 7; time histories that are not stored yet are simulated, each once.

    Without β of the non-impact model (1/s) the curves of this model are left out.
    """
    curves = {
        (figure, panel, number): f"f{panel}-{curve}"
        for figure, panels in PANELS.items()
        for panel in panels
        for number, curve in enumerate(CURVES[figure], 1)
        if beta is not None or not curve.endswith("nonimpact")
    }
    scenes = {
        name: paper_scene(name, numbers, {BETA: beta} if name.endswith("nonimpact") else None)
        for name in dict.fromkeys(curves.values())
    }
    chains = [StoredChain(_history(scene), records, configuration_hash(scene)) for scene in scenes.values()]
    shown = dict(zip(scenes, run_stored(chains, workers), strict=True))
    parts: dict[str, list[pd.DataFrame]] = {figure: [] for figure in PANELS}
    for (figure, panel, number), name in curves.items():
        parts[figure].append(shown[name].assign(panel=float(panel), curve=number)[list(HISTORY)])
    return {figure: pd.concat(tables, ignore_index=True) for figure, tables in parts.items()}


def _history(scene: Scene) -> Tasks[pd.DataFrame]:
    record = yield Task(history, (scene,))
    columns = list(HISTORY)[2:]
    return pd.DataFrame(record, columns=columns).astype(dict.fromkeys(columns[1:], "float64"))


def history(scene: Scene) -> Record:
    """Simulate a scene and return its last turns of exciter 1 as lists by column; without contact there is no gap."""
    run = simulate(scene)
    turns = run.section["t_s"].to_numpy()
    begin = turns[max(len(turns) - 1 - SHOWN, 0)] if len(turns) else 0.0
    times = np.arange(begin, run.segments[-1].end, 1.0 / RATE)
    rows = run(times)
    table = pd.DataFrame(
        {
            "scene": scene.name,
            "excitation_frequency_hz": run.summary["excitation_frequency_hz"],
            "t_s": np.round(times - begin, 9),
            "y_m": np.round(rows["y_m"] - static_rest(scene)[1], 9),
            "gap_m": np.round(rows["gap_m"], 9) if "gap_m" in rows else np.nan,
        }
    )
    return {str(name): column.tolist() for name, column in table.dropna(axis="columns", how="all").items()}


def sync_bands(evidence: Evidence) -> pd.DataFrame:
    """List the synchronization along each branch: a row for each stretch, with its first and last point.

    Upward and downward branches follow each other, so that their difference shows the hysteresis.
    """
    rows = []
    for key in sorted(evidence.courses):
        for sync, stretch in groupby(evidence.rows(key), key=lambda row: str(row["sync"])):
            points = list(stretch)
            ends = [points[place][column] for column in (F, SUPPLY) for place in (0, -1)]
            rows.append((*key, sync, len(points), *ends, max(row["rms_y_m"] for row in points)))
    return pd.DataFrame(rows, columns=list(SYNC_BANDS))


def impact_laws(evidence: Evidence, laws: Evidence) -> pd.DataFrame:
    """Compare the curves of each impact law with those of the conservative one, below and above resonance.

    The columns are the largest and the mean relative difference of RMS y at equal excitation frequencies, and jump_hz,
    where antiphase ends below the second resonance. The conservative law itself, computed again with another seed,
    shows how much of a difference is the scatter of non-periodic motion.

    Parameters
    ----------
    evidence
        Branches of the conservative law.
    laws
        Branches of all laws, with another seed.
    """
    rows = []
    for key in sorted(laws.courses):
        reference = key._replace(law="conservative")
        row = [key.law, key.restitution]
        for low, high in ((21.0, 31.0), (35.5, 40.0)):
            at = np.arange(low, high + 1e-9, EDGE)
            change = np.abs(laws.curve(key, at)[0] / evidence.curve(reference, at)[0] - 1.0)
            known = change[np.isfinite(change)]
            row += [known.max(), known.mean()] if known.size else [np.nan, np.nan]
        jumps = laws.jump(key), evidence.jump(reference)
        rows.append([*row, *(jump.before[F] if jump else np.nan for jump in jumps)])
    return pd.DataFrame(rows, columns=list(IMPACT_LAWS))


# -- contradictions ---------------------------------------------------------------------------------------


def acceleration(scene: Scene, mass_ratio: float, frequency: float) -> float:
    """Return the amplitude of the vertical acceleration of the platform with a stiff layer on it (m/s²)."""
    machine, omega = scene.machine, 2.0 * math.pi * frequency
    stiffness = machine.stiffness_y_n_per_m - (1.0 + mass_ratio) * scene.body.mass * omega**2
    resistance = math.hypot(stiffness, machine.damping_y_n_s_per_m * omega)
    return sum(scene.unbalances) * omega**4 / resistance if resistance > 0.0 else math.inf


def stiff_layer_liftoff(scene: Scene, mass_ratio: float) -> float:
    """Return the frequency (Hz) at which a stiff layer leaves the platform; nan if there is none below resonance."""
    machine, gravity = scene.machine, scene.machine.gravity_m_per_s2
    mass = (1.0 + mass_ratio) * scene.body.mass
    resonance = math.sqrt(machine.stiffness_y_n_per_m / mass) / (2.0 * math.pi)
    if not acceleration(scene, mass_ratio, LOWEST) < gravity < acceleration(scene, mass_ratio, resonance):
        return math.nan
    return float(brentq(lambda f: acceleration(scene, mass_ratio, f) - gravity, LOWEST, resonance))


def unbalance_for_liftoff(scene: Scene, mass_ratio: float, frequency: float) -> float:
    """Return the static moment m_r r (kg·m) with which a stiff layer leaves the platform at a frequency (Hz)."""
    return scene.unbalances[0] * scene.machine.gravity_m_per_s2 / acceleration(scene, mass_ratio, frequency)


def resonance_torque(scene: Scene) -> float:
    """Return the mean torque (N·m) that each motor needs at the vertical resonance."""
    machine = scene.machine
    omega = math.sqrt(machine.stiffness_y_n_per_m / scene.body.mass)
    damping = machine.damping_y_n_s_per_m
    return float(scene.unbalances[0] ** 2 * omega**3 / damping) if damping > 0.0 else math.inf


def contradictions(numbers: Mapping[str, Any]) -> pd.DataFrame:
    """Compare what the paper's figures require with what a machine has."""
    scene = paper_scene("fig2", numbers)
    rows: list[tuple[str, str, float, float]] = []
    for mu, f in LIFTOFF.items():
        rows.append((f"liftoff of a stiff layer, μ {mu:g}", "Hz", f, stiff_layer_liftoff(scene, mu)))
        what = f"m_r r for liftoff of a stiff layer at {f:g} Hz, μ {mu:g}"
        rows.append((what, "kg·m", unbalance_for_liftoff(scene, mu, f), scene.unbalances[0]))
    critical = min(exciter.critical_torque_n_m for exciter in scene.exciter_pair)
    rows.append(("torque of each motor at the vertical resonance, at most", "N·m", critical, resonance_torque(scene)))
    return pd.DataFrame(rows, columns=list(CONTRADICTIONS))
