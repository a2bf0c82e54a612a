"""Reproduce the paper by Panovko and Shokhin with one machine: its curves, its time histories, its claims judged.

The simulations are run in stages, each with its chains side by side: sweeps of the impact model, narrowing of
boundaries, β of the non-impact model, its sweeps, narrowing of further boundaries, time histories. All are stored. What
is judged and tabulated after them is read from these results alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.reader import configurations, load_list
from vibroplat.config.scene import Scene
from vibroplat.paper.claims import judge
from vibroplat.paper.contradictions import contradictions
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.histories import by_figure, histories
from vibroplat.paper.narrowing import narrow
from vibroplat.paper.nonimpact import match_beta, matched_frequency
from vibroplat.paper.scoreboard import scoreboard
from vibroplat.paper.summaries import impact_laws, sync_bands
from vibroplat.paper.trial import (
    BETA,
    IMPACT,
    LAWS,
    MASS_RATIO,
    NON_IMPACT,
    QUICK,
    SEED,
    SHARED,
    claims,
    former_claims,
    paper_scene,
)
from vibroplat.study.branches import Branch, branches
from vibroplat.study.pool import Pool, StoredChain, run_stored
from vibroplat.study.store import Store
from vibroplat.study.sweep import Progress, conditions, run_sweeps, tables

#: Sweeps of the impact model from which figures are drawn or claims judged.
SWEEPS = ("fig2", *IMPACT)
#: Settings of the sweeps with further seeds: upward only, as claims are judged by these branches.
REPEATED: dict[str, Any] = {"sweep.supply_frequency_hz.direction": ["up"]}


@dataclass(frozen=True)
class Reproduction:
    """The results of one machine.

    Attributes
    ----------
    tables
        By name: curves, time histories, impact laws, claims.
    beta, matched_hz
        β of the non-impact model (1/s) and the frequency (Hz) at which it makes RMS y of both models equal; None if
        there is none.
    points, failed, simulated, events
        Number of points of the sweeps, how many of them did not end ``ok``, their simulated time (s) and their events.
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
    """Reproduce the paper with a machine.

    Parameters
    ----------
    numbers
        Dotted keys and values of the machine, which are laid over the paper's scenes.
    directory
        Where finished points are stored.
    workers
        Where points are simulated.
    seeds
        Seeds of the perturbations; figures are drawn with the first, claims are judged with each.
    resume, overwrite
        Whether to continue an unfinished reproduction, or to discard its points.
    progress
        Called after each point of the first stage with the numbers of finished branches, points and events.

    Raises
    ------
    ConfigError
        A number is not allowed, or unfinished work would be lost.
    TableError
        Points cannot be stored.
    """
    trials = _trials(numbers, seeds)
    with ExitStack() as stack:
        for trial in trials:
            place = directory / trial.name
            place.mkdir(parents=True, exist_ok=True)
            store = Store(place, trial.conditions(), resume=resume, overwrite=overwrite)
            trial.store = stack.enter_context(store)
        _simulate(trials, workers, progress)
        main = trials.machine[0]
        shown = histories(numbers, main.evidence.beta, main.store.part("histories"), workers)
        for trial in trials:
            trial.store.finish()
        return _results(trials, by_figure(shown))


def planned(numbers: Mapping[str, Any], seeds: Sequence[int] = (0,)) -> tuple[int, int]:
    """Return the numbers of branches and points of the first stage."""
    found = [b for trial in _trials(numbers, seeds) for name in trial.names for b in branches(trial.scene(name))]
    return len(found), sum(len(branch.frequencies) for branch in found)


# -- trials -----------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Trial:
    """Sweeps of the paper with one set of numbers and one seed.

    Attributes
    ----------
    name
        Name of its directory.
    numbers, changes, settings
        Numbers of the machine, changes of unprinted ones, settings of the sweeps.
    names
        Its sweeps of the impact model.
    evidence
        What has been found so far.
    sweeps
        By name: the branches of finished sweeps and where their points are.
    """

    name: str
    numbers: Mapping[str, Any]
    changes: Mapping[str, Any]
    settings: Mapping[str, Any]
    names: tuple[str, ...]
    evidence: Evidence = field(default_factory=Evidence)
    sweeps: dict[str, tuple[list[Branch], Store]] = field(default_factory=dict)
    store: Store = field(init=False)

    @property
    def seed(self) -> int:
        """Seed of the perturbations."""
        return int(self.settings[SEED])

    def scene(self, name: str) -> Scene:
        """Return the scene of one of its sweeps; that of the non-impact model has the β that was found."""
        changes = {BETA: self.evidence.beta} if name == NON_IMPACT and self.evidence.beta is not None else {}
        if self.names == IMPACT:  # no figure is drawn of it
            changes |= SHARED.get(name, {})
        return paper_scene(name, {**self.numbers, **self.changes}, {**self.settings, **changes})

    def conditions(self) -> dict[str, Any]:
        """Return what its points depend on."""
        return {name: conditions(self.scene(name)) for name in (*self.names, NON_IMPACT)}


@dataclass(frozen=True)
class _Trials:
    """All trials of a machine.

    Attributes
    ----------
    machine
        A trial for each seed; figures are drawn of the first.
    others
        Coarse trials with unprinted numbers changed; the first changes nothing, as a control.
    laws
        The trial of the impact laws. Its seed is not that of the figures, so that the difference of the conservative
        law from itself shows the scatter.
    """

    machine: list[_Trial]
    others: list[_Trial]
    laws: _Trial

    @property
    def judged(self) -> list[_Trial]:
        """The trials by which claims are judged."""
        return [*self.machine, *self.others]

    def __iter__(self) -> Iterator[_Trial]:
        return iter([*self.judged, self.laws])


def _trials(numbers: Mapping[str, Any], seeds: Sequence[int]) -> _Trials:
    """List the trials of a machine."""
    machine = [_Trial("machine", numbers, {}, {SEED: seeds[0]}, SWEEPS)]
    machine += [_Trial(f"seed-{n}", numbers, {}, {SEED: n, **REPEATED}, IMPACT) for n in seeds[1:]]
    alternatives = [{}, *load_list(configurations() / "claims" / "alternatives.yaml")]
    others = [
        _Trial(f"alternative-{i}", numbers, changes, {**QUICK, SEED: seeds[0]}, IMPACT)
        for i, changes in enumerate(alternatives)
    ]
    return _Trials(machine, others, _Trial("laws", numbers, {}, {SEED: seeds[0] + 1}, (LAWS,)))


# -- simulation -------------------------------------------------------------------------------------------


def _simulate(trials: _Trials, workers: Pool, progress: Progress | None) -> None:
    """Simulate what the evidence of all trials needs, stage by stage."""
    _sweep({trial: trial.names for trial in trials}, workers, progress)
    _narrow(trials, workers)
    _match(trials.judged, workers)
    _sweep({trial: (NON_IMPACT,) for trial in trials.judged if trial.evidence.beta is not None}, workers)
    _narrow(trials, workers)


def _sweep(wanted: Mapping[_Trial, tuple[str, ...]], workers: Pool, progress: Progress | None = None) -> None:
    """Run sweeps of trials side by side and add their branches to the evidence."""
    begun = []
    for trial, names in wanted.items():
        for name in names:
            trial.sweeps[name] = branches(trial.scene(name)), trial.store.part(name)
            begun.append((trial, trial.sweeps[name]))
    run_sweeps([sweep for _, sweep in begun], workers, progress)
    for trial, sweep in begun:
        trial.evidence.add(*sweep)


def _narrow(trials: _Trials, workers: Pool) -> None:
    """Narrow the boundaries that matter to the claims, to β and to the comparison of the impact laws."""
    main, laws = trials.machine[0].evidence, trials.laws.evidence

    def of_main(evidence: Evidence) -> None:
        _judge_all(evidence)
        impact_laws(evidence, laws)

    def of_laws(evidence: Evidence) -> None:
        impact_laws(main, evidence)

    reads = [of_main, *[_judge_all] * (len(trials.machine) - 1), of_laws]
    narrow(
        [
            (trial.evidence, read, trial.store.part("boundaries"))
            for trial, read in zip([*trials.machine, trials.laws], reads, strict=True)
        ],
        workers,
    )


def _judge_all(evidence: Evidence) -> None:
    """Read what the claims and β depend on."""
    matched_frequency(evidence, MASS_RATIO)
    for claim in (*claims(), *former_claims()):
        judge(claim, evidence)


def _match(trials: Sequence[_Trial], workers: Pool) -> None:
    """Find β of the non-impact model for each trial."""
    chains = [StoredChain(match_beta(t.evidence, MASS_RATIO), t.store.part("beta"), 0) for t in trials]
    for trial, beta in zip(trials, run_stored(chains, workers), strict=True):
        trial.evidence.beta = beta


# -- results ----------------------------------------------------------------------------------------------


def _results(trials: _Trials, shown: Mapping[str, pd.DataFrame]) -> Reproduction:
    """Judge the claims and return all tables, and how much was simulated for them."""
    main, laws = trials.machine[0], trials.laws
    sweeps = {**main.sweeps, **laws.sweeps}
    found = {name: pd.concat(tables(*sweep), ignore_index=True) for name, sweep in sweeps.items()}
    found["sync-bands"] = sync_bands(main.evidence)
    found["impact-laws"] = impact_laws(main.evidence, laws.evidence)
    found["contradictions"] = contradictions(main.numbers)
    found["claims"] = scoreboard(
        {trial.seed: trial.evidence for trial in trials.machine},
        [(trial.changes, trial.evidence) for trial in trials.others],
    )
    every = [pd.concat(tables(*sweep)) for trial in trials for sweep in trial.sweeps.values()]
    return Reproduction(
        {**found, **shown},
        main.evidence.beta,
        matched_frequency(main.evidence, MASS_RATIO),
        sum(len(table) for table in every),
        int(sum((table["outcome"] != "ok").sum() for table in every)),
        float(sum(table["simulated_s"].sum() for table in every)),
        int(sum(table["events"].sum() for table in every)),
    )
