"""The paper by Panovko and Shokhin, reproduced: its curves, its time histories, its claims judged.

The work is done in stages, each of tasks side by side: sweeps of the impact model, boundaries narrowed, β of the
non-impact model, its sweeps and boundaries, time histories. What stages have computed is kept; judging is not work.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

import vibroplat
from vibroplat.config import configurations, load_list
from vibroplat.paper.claims import judge
from vibroplat.paper.contradictions import contradictions
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.histories import histories
from vibroplat.paper.narrowing import narrow
from vibroplat.paper.nonimpact import find_beta, matched_frequency
from vibroplat.paper.scoreboard import scoreboard
from vibroplat.paper.summaries import impact_laws, sync_bands
from vibroplat.paper.trial import (
    BETA,
    IMPACT,
    LAWS,
    MASS_RATIO,
    NON_IMPACT,
    QUICK,
    SHARED,
    claims,
    former_claims,
    paper_scene,
)
from vibroplat.scene import Scene
from vibroplat.study.branches import branches
from vibroplat.study.execution import Pool
from vibroplat.study.store import Store
from vibroplat.study.sweep import Progress, conditions, run_sweeps, tables
from vibroplat.study.tasks import Record, Task, run_tasks

#: Sweeps of a machine from which claims are judged or figures drawn, besides that of the non-impact model.
SWEEPS = ("fig2", *IMPACT)
#: Key of a scene that trials differ by.
SEED = "sweep.seed"
#: Sweeps with seeds beyond the first go upward only: claims are judged by these branches.
REPEATED: dict[str, Any] = {"sweep.supply_frequency_hz.direction": ["up"]}


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
    seeds: Sequence[int] = (0,),
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
    seeds
        Of the perturbations; figures are drawn with the first, claims judged with each.
    resume, overwrite
        Whether to go on with points that are there, or to drop those of an unfinished reproduction.
    progress
        Called with finished branches, points and events of the first stage.
    """
    machine, others, laws = _trials(numbers, seeds)
    judged = [*machine, *others]
    with ExitStack() as stack:
        files = _Files(directory, stack, resume, overwrite)
        files.refuse_unfinished(judged)
        _sweep({trial: trial.names for trial in (*judged, laws)}, files, workers, progress)
        _narrow(machine, laws, files, workers)
        _match(judged, files, workers)
        _sweep({trial: (NON_IMPACT,) for trial in judged if trial.evidence.beta is not None}, files, workers)
        _narrow(machine, laws, files, workers)
        beta = machine[0].evidence.beta
        kept = files.open(machine[0], "histories", {**numbers, BETA: beta})
        found = _tables(machine, others, laws) | histories(numbers, beta, kept, workers)
        files.finish()
        return _told([*judged, laws], found)


def _tables(machine: Sequence[_Trial], others: Sequence[_Trial], laws: _Trial) -> dict[str, pd.DataFrame]:
    """Return the tables of the first seed's curves and what they show, and the claims judged with all seeds."""
    main = machine[0]
    sweeps = {**main.sweeps, **laws.sweeps}
    found = {name: pd.concat(tables(*sweep), ignore_index=True) for name, sweep in sweeps.items()}
    found["sync-bands"] = sync_bands(main.evidence)
    found["impact-laws"] = impact_laws(main.evidence, laws.evidence)
    found["contradictions"] = contradictions(main.numbers)
    found["claims"] = scoreboard(
        {trial.seed: trial.evidence for trial in machine}, [(trial.changes, trial.evidence) for trial in others]
    )
    return found


def _told(trials: Sequence[_Trial], found: dict[str, pd.DataFrame]) -> Reproduction:
    """Return tables with how much was computed for them; the first trial is that of the figures."""
    every = [pd.concat(tables(*sweep)) for trial in trials for sweep in trial.sweeps.values()]
    return Reproduction(
        found,
        trials[0].evidence.beta,
        matched_frequency(trials[0].evidence, MASS_RATIO),
        sum(len(table) for table in every),
        int(sum((table["outcome"] != "ok").sum() for table in every)),
        float(sum(table["simulated_s"].sum() for table in every)),
        int(sum(table["events"].sum() for table in every)),
    )


def planned(numbers: Mapping[str, Any], seeds: Sequence[int] = (0,)) -> tuple[int, int]:
    """Return how many branches and points the first stage has."""
    machine, others, laws = _trials(numbers, seeds)
    found = [b for trial in (*machine, *others, laws) for name in trial.names for b in branches(trial.scene(name))]
    return len(found), sum(len(branch.frequencies) for branch in found)


# -- trials -----------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Trial:
    """Sweeps of the paper with one set of numbers and one seed.

    Attributes
    ----------
    name
        Of its directory.
    numbers, changes, settings
        The machine's numbers; unprinted ones that are changed; how the sweeps are made.
    names
        Sweeps of the impact model.
    """

    name: str
    numbers: Mapping[str, Any]
    changes: Mapping[str, Any]
    settings: Mapping[str, Any]
    names: tuple[str, ...]
    evidence: Evidence = field(default_factory=Evidence)
    sweeps: dict[str, tuple[Scene, Store]] = field(default_factory=dict)

    @property
    def seed(self) -> int:
        """Seed of the perturbations."""
        return int(self.settings[SEED])

    def scene(self, name: str) -> Scene:
        """Return the scene of one of its sweeps, with the β that was found for that of the non-impact model."""
        changes = {BETA: self.evidence.beta} if name == NON_IMPACT else {}
        if self.names == IMPACT:  # no figure is drawn of it
            changes |= SHARED.get(name, {})
        return paper_scene(name, {**self.numbers, **self.changes}, {**self.settings, **changes})


def _trials(numbers: Mapping[str, Any], seeds: Sequence[int]) -> tuple[list[_Trial], list[_Trial], _Trial]:
    """List the trials of the machine, one a seed; the coarse ones with unprinted numbers changed; that of the laws.

    The first coarse trial changes nothing, as a control. The laws have another seed than the figures: what the
    conservative one differs by from itself is scatter.
    """
    machine = [_Trial("machine", numbers, {}, {SEED: seeds[0]}, SWEEPS)]
    machine += [_Trial(f"seed-{n}", numbers, {}, {SEED: n, **REPEATED}, IMPACT) for n in seeds[1:]]
    alternatives = [{}, *load_list(configurations() / "claims" / "alternatives.yaml")]
    others = [
        _Trial(f"alternative-{i}", numbers, changes, {**QUICK, SEED: seeds[0]}, IMPACT)
        for i, changes in enumerate(alternatives)
    ]
    return machine, others, _Trial("laws", numbers, {}, {SEED: seeds[0] + 1}, (LAWS,))


# -- stages -----------------------------------------------------------------------------------------------


@dataclass
class _Files:
    """Stores of a reproduction, open while it runs."""

    directory: Path
    stack: ExitStack
    resume: bool
    overwrite: bool
    opened: dict[Path, Store] = field(default_factory=dict)

    def open(self, trial: _Trial, name: str, conditions: Mapping[str, Any]) -> Store:
        """Open a store of a trial, or return it if it is open."""
        place = self.directory / trial.name / name
        if place not in self.opened:
            place.mkdir(parents=True, exist_ok=True)
            rest = {"vibroplat": vibroplat.__version__, **conditions}
            store = Store(place, rest, resume=self.resume, overwrite=self.overwrite)
            self.opened[place] = self.stack.enter_context(store)
        return self.opened[place]

    def refuse_unfinished(self, trials: Sequence[_Trial]) -> None:
        """Complain of unfinished work in later stages before sweeps that are finished are begun anew."""
        for trial in trials:
            for name in ("boundaries", "beta"):
                self.open(trial, name, _rest(trial))

    def finish(self) -> None:
        """Note in all stores that nothing is missing."""
        for store in self.opened.values():
            store.finish()


def _sweep(
    wanted: Mapping[_Trial, tuple[str, ...]], files: _Files, workers: Pool, progress: Progress | None = None
) -> None:
    """Run sweeps of trials side by side and take them into their evidence."""
    begun = []
    for trial, names in wanted.items():
        for name in names:
            scene = trial.scene(name)
            trial.sweeps[name] = scene, files.open(trial, name, conditions(scene))
            begun.append((trial, trial.sweeps[name]))
    run_sweeps([sweep for _, sweep in begun], workers, progress)
    for trial, sweep in begun:
        trial.evidence.add(*sweep)


def _narrow(machine: Sequence[_Trial], laws: _Trial, files: _Files, workers: Pool) -> None:
    """Narrow the boundaries that are asked for when a machine's trials are judged and its impact laws compared."""
    for trial in machine:
        matched_frequency(trial.evidence, MASS_RATIO)
        for claim in (*claims(), *former_claims()):
            judge(claim, trial.evidence)
    impact_laws(machine[0].evidence, laws.evidence)
    trials = [*machine, laws]
    narrow([(trial.evidence, files.open(trial, "boundaries", _rest(trial))) for trial in trials], workers)


def _match(trials: Sequence[_Trial], files: _Files, workers: Pool) -> None:
    """Find β of the non-impact model for each trial."""
    tasks = [Task(files.open(trial, "beta", _rest(trial)), 0, _beta, trial.evidence) for trial in trials]
    for trial, record in zip(trials, run_tasks(tasks, workers), strict=True):
        trial.evidence.beta = record["beta"]


def _beta(evidence: Evidence) -> Record:
    return {"beta": find_beta(evidence, MASS_RATIO)}


def _rest(trial: _Trial) -> dict[str, Any]:
    """Return what a trial's evidence rests on besides its sweeps, whose stores have their own conditions."""
    return {**trial.numbers, **trial.changes, **trial.settings}


def matched(found: Reproduction) -> str:
    """Say what came of matching the non-impact model."""
    if found.beta is None or found.matched_hz is None:
        return "no β: 30.9 Hz is not reached in antiphase"
    return f"β = {found.beta:.2f} 1/s makes RMS y equal at f = {found.matched_hz:.2f} Hz"
