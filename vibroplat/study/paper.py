"""The paper by Panovko and Shokhin, reproduced: its curves, its time histories, its claims judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.config import configurations, load_list
from vibroplat.scene import Scene
from vibroplat.solver.initial import static_rest
from vibroplat.solver.run import simulate
from vibroplat.study.branches import SUPPLY, branches
from vibroplat.study.claims import EDGE, Claim, Finding, judge
from vibroplat.study.evidence import Evidence, F
from vibroplat.study.execution import Pool
from vibroplat.study.nonimpact import find_beta, matched_frequency
from vibroplat.study.store import Store
from vibroplat.study.sweep import Progress, conditions, run_sweeps, tables
from vibroplat.study.trial import BETA, IMPACT, MASS_RATIO, NON_IMPACT, QUICK, claims, paper_scene

#: Sweep of the impact laws, and all whose tables are written, besides that of the non-impact model.
LAWS = "laws"
SWEEPS = ("fig2", *IMPACT, LAWS)

#: Frequencies of the time histories' panels and, by figure, files of their curves in the paper's numbering.
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
#: Turns of exciter 1 that a time history shows, and its points a second.
SHOWN, RATE = 8, 2000.0


@dataclass(frozen=True)
class Reproduction:
    """What came of one machine.

    Attributes
    ----------
    tables
        By name: curves, time histories, impact laws, claims.
    beta, matched_hz
        β of the non-impact model (1/s) and the frequency at which it makes RMS y equal, or None where there is none.
    points, failed, simulated, events
        How many points there are, how many did not end ``ok``, over how many seconds of motion, with how many events.
    """

    tables: dict[str, pd.DataFrame]
    beta: float | None
    matched_hz: float | None
    points: int
    failed: int
    simulated: float
    events: int


def reproduce(
    numbers: Mapping[str, Any],
    directory: Path,
    workers: Pool,
    *,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Reproduction:
    """Run all of the paper with a machine's numbers.

    Parameters
    ----------
    numbers
        Dotted keys and values that are laid over the paper's scenes.
    directory
        Where finished points are kept.
    workers
        Where points are computed.
    resume, overwrite
        Whether to go on with points that are there, or to drop those of an unfinished reproduction.
    progress
        Called with finished branches, points and events; branches of the non-impact model come last.
    """
    trials = _trials(numbers)
    main = trials[0]
    with ExitStack() as stack:

        def open_sweep(trial: _Trial, name: str, changes: Mapping[str, Any] | None = None) -> tuple[Scene, Store]:
            scene = trial.scene(name, changes)
            place = directory / f"{trial.prefix}{name}"
            place.mkdir(parents=True, exist_ok=True)
            store = stack.enter_context(Store(place, conditions(scene), resume=resume, overwrite=overwrite))
            trial.sweeps[name] = scene, store
            return scene, store

        run_sweeps([open_sweep(trial, name) for trial in trials for name in trial.names], workers, progress)
        for trial in trials:
            for name in trial.names:
                if name != LAWS:
                    trial.evidence.add(*trial.sweeps[name])
            trial.evidence.beta = find_beta(trial.evidence, MASS_RATIO)
        matchable = [trial for trial in trials if trial.evidence.beta is not None]
        run_sweeps([open_sweep(trial, NON_IMPACT, {BETA: trial.evidence.beta}) for trial in matchable], workers)
        for trial in matchable:
            trial.evidence.add(*trial.sweeps[NON_IMPACT])
        laws = Evidence()
        laws.add(*main.sweeps[LAWS])

        found = {name: pd.concat(tables(*sweep), ignore_index=True) for name, sweep in main.sweeps.items()}
        found |= {figure: histories(figure, numbers, main.evidence.beta) for figure in PANELS}
        found["sync-bands"] = sync_bands(main.evidence)
        found["impact-laws"] = impact_laws(main.evidence, laws)
        found["claims"] = scoreboard(main.evidence, [(trial.changes, trial.evidence) for trial in trials[1:]])
        every = [pd.concat(tables(*sweep)) for trial in trials for sweep in trial.sweeps.values()]
    return Reproduction(
        found,
        main.evidence.beta,
        matched_frequency(main.evidence, MASS_RATIO),
        sum(len(table) for table in every),
        int(sum((table["outcome"] != "ok").sum() for table in every)),
        float(sum(table["simulated_s"].sum() for table in every)),
        int(sum(table["events"].sum() for table in every)),
    )


def planned(numbers: Mapping[str, Any]) -> tuple[int, int]:
    """Return how many branches and points there are before those of the non-impact model."""
    found = [branch for trial in _trials(numbers) for name in trial.names for branch in branches(trial.scene(name))]
    return len(found), sum(len(branch.frequencies) for branch in found)


@dataclass
class _Trial:
    """The paper's sweeps with one set of numbers, its changes laid over the machine's; coarse but for the first."""

    prefix: str
    numbers: Mapping[str, Any]
    changes: Mapping[str, Any]
    names: tuple[str, ...]
    coarse: Mapping[str, Any]
    evidence: Evidence
    sweeps: dict[str, tuple[Scene, Store]] = field(default_factory=dict)

    def scene(self, name: str, changes: Mapping[str, Any] | None = None) -> Scene:
        """Return the scene of one of its sweeps."""
        return paper_scene(name, {**self.numbers, **self.changes}, {**self.coarse, **(changes or {})})


def _trials(numbers: Mapping[str, Any]) -> list[_Trial]:
    """List the machine itself, then, in coarse sweeps, itself as a control and with unprinted numbers changed."""
    alternatives = [{}, *load_list(configurations() / "claims" / "alternatives.yaml")]
    return [_Trial("", numbers, {}, SWEEPS, {}, Evidence())] + [
        _Trial(f"alternative{i}-", numbers, changes, IMPACT, QUICK, Evidence(narrowed=False))
        for i, changes in enumerate(alternatives)
    ]


# -- time histories ---------------------------------------------------------------------------------------


def histories(figure: str, numbers: Mapping[str, Any], beta: float | None) -> pd.DataFrame:
    """Return the time histories of a figure: the last turns of exciter 1, time counted from a whole one.

    The columns are panel (the paper's frequency), curve (its number), scene, excitation_frequency_hz, t_s,
    y_m (from the static rest) and gap_m. Curves of the non-impact model are left out where there is no β.
    """
    parts = []
    for panel in PANELS[figure]:
        for number, curve in enumerate(CURVES[figure], 1):
            if curve.endswith("nonimpact") and beta is None:
                continue
            scene = paper_scene(f"f{panel}-{curve}", numbers, {BETA: beta} if curve.endswith("nonimpact") else None)
            parts.append(history(scene).assign(panel=float(panel), curve=number))
    table = pd.concat(parts, ignore_index=True)
    return table[["panel", "curve", "scene", "excitation_frequency_hz", "t_s", "y_m", "gap_m"]]


def history(scene: Scene) -> pd.DataFrame:
    """Simulate a scene and return its last turns of exciter 1."""
    run = simulate(scene)
    turns = run.section["t_s"].to_numpy()
    begin = turns[max(len(turns) - 1 - SHOWN, 0)] if len(turns) else 0.0
    times = np.arange(begin, run.segments[-1].end, 1.0 / RATE)
    rows = run(times)
    return pd.DataFrame(
        {
            "scene": scene.name,
            "excitation_frequency_hz": run.summary["excitation_frequency_hz"],
            "t_s": np.round(times - begin, 9),
            "y_m": np.round(rows["y_m"] - static_rest(scene)[1], 9),
            "gap_m": np.round(rows["gap_m"], 9) if "gap_m" in rows else np.nan,
        }
    )


# -- bands and impact laws --------------------------------------------------------------------------------


def sync_bands(evidence: Evidence) -> pd.DataFrame:
    """List how the exciters turn along each branch: a row for each stretch, with its first and last point.

    Branches upward and downward stand one after the other, so their difference is the hysteresis.
    """
    rows = []
    for key, course in sorted(evidence.courses.items()):
        for sync, stretch in groupby(course.rows, key=lambda row: str(row["sync"])):
            points = list(stretch)
            first, last = points[0], points[-1]
            rows.append(
                key._asdict()
                | {
                    "sync": sync,
                    "points": len(points),
                    "first_hz": first[F],
                    "last_hz": last[F],
                    "first_supply_hz": first[SUPPLY],
                    "last_supply_hz": last[SUPPLY],
                    "rms_y_largest_m": max(row["rms_y_m"] for row in points),
                }
            )
    return pd.DataFrame(rows)


def impact_laws(evidence: Evidence, laws: Evidence) -> pd.DataFrame:
    """Compare the curves of each impact law with that of `conservative`, below and above resonance.

    The differences are those of RMS y over that of `conservative` at equal excitation frequencies, largest and
    mean; jump_hz is where antiphase ends below the second resonance. `conservative` itself, computed once more with
    other perturbations, tells how much of a difference is the scatter of motions that are not periodic.
    """
    rows = []
    for key in sorted(laws.courses):
        reference = key._replace(law="conservative")
        row: dict[str, Any] = {"impact_law": key.law, "restitution": key.restitution}
        for name, low, high in (("below", 21.0, 31.0), ("above", 35.5, 40.0)):
            at = np.arange(low, high + 1e-9, EDGE)
            change = np.abs(laws.curve(key, "rms_y_m", at) / evidence.curve(reference, "rms_y_m", at) - 1.0)
            known = change[np.isfinite(change)]
            row[f"{name}_largest"] = known.max() if known.size else np.nan
            row[f"{name}_mean"] = known.mean() if known.size else np.nan
        for label, source, which in (("jump_hz", laws, key), ("jump_conservative_hz", evidence, reference)):
            jump = source.end_of(which, "antiphase", 20.0)
            row[label] = jump.before[F] if jump else np.nan
        rows.append(row)
    return pd.DataFrame(rows)


# -- scoreboard -------------------------------------------------------------------------------------------


def scoreboard(evidence: Evidence, others: Sequence[tuple[Mapping[str, Any], Evidence]]) -> pd.DataFrame:
    """Judge every claim: id, figure, what is expected, what was measured, verdict, and why where it fails.

    A claim that fails but holds with other values of what the paper does not print depends on an unprinted
    number; the line says with which. The others are judged by coarser sweeps. Where these let the claim hold with
    the machine's own numbers as well (the set without changes), they cannot tell, and are not asked.
    """
    rows = []
    for claim in claims():
        finding = judge(claim, evidence)
        verdict, why = "reproduced", ""
        if not finding.holds:
            verdict, why = _explain(claim, [(changes, judge(claim, other)) for changes, other in others])
        rows.append(
            {
                "id": claim["id"],
                "figure": claim["fig"],
                "expected": expected(claim),
                "measured": finding.measured,
                "verdict": verdict,
                "why": why,
            }
        )
    return pd.DataFrame(rows)


def _explain(claim: Claim, findings: Sequence[tuple[Mapping[str, Any], Finding]]) -> tuple[str, str]:
    """Give the verdict of a claim that fails, and a line why."""
    if any(finding.holds for changes, finding in findings if not changes):
        return "not reproduced", "in coarser steps it holds with the same numbers, so other numbers cannot be tried"
    holding = [(changes, finding) for changes, finding in findings if finding.holds]
    if holding:
        changes, finding = holding[0]
        more = f" (and with {len(holding) - 1} of the other sets)" if len(holding) > 1 else ""
        return "depends on an unprinted number", f"holds with {_told(changes)}{more}: {finding.measured}"
    findings = [(changes, finding) for changes, finding in findings if changes]
    changes, nearest = max(findings, key=lambda pair: pair[1].score)
    others = f"nor with any of {len(findings)} other sets of unprinted numbers"
    return "not reproduced", f"{others}; nearest {_told(changes)}: {nearest.measured}"


def _told(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{key.split('.')[-1]} {value:g}" for key, value in changes.items())


def expected(claim: Claim) -> str:
    """Say a claim in words."""
    parts = [f"{symbol} {_range(claim[key])}" for symbol, key in (("μ", "mu"), ("R", "R")) if key in claim]
    if "f" in claim:
        parts.append(f"f {_range(claim['f'])} Hz" + (f" ± {claim['tol']:g}" if "tol" in claim else ""))
    return f"{', '.join(parts)}: {claim.get('regime') or claim['text']}"


def _range(value: Any) -> str:
    if not isinstance(value, Sequence):
        return f"{value:g}"
    return f"{value[0]:g}" if value[0] == value[-1] else " … ".join(f"{v:g}" for v in (value[0], value[-1]))


def matched(found: Reproduction) -> str:
    """Say what came of matching the non-impact model."""
    if found.beta is None or found.matched_hz is None:
        return "no β: 30.9 Hz is not reached in antiphase"
    return f"β = {found.beta:.2f} 1/s makes RMS y equal at f = {found.matched_hz:.2f} Hz"
