"""Reproduce the paper by Panovko and Shokhin with one machine: its curves, its time histories, its claims judged.

The simulations are run in stages, each with its chains side by side: sweeps of the impact model, narrowing of
boundaries, β of the non-impact model, its sweeps, narrowing of further boundaries; for claims that fail, the same with
unprinted numbers changed; time histories. All are stored. What is judged and tabulated after them is read from these
results alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from vibroplat.config.reader import configurations, load_list
from vibroplat.config.scene import Scene
from vibroplat.integrate import engine_name
from vibroplat.paper.claims import cut, is_of_models, judge, scoreboard
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.judges import Claim
from vibroplat.paper.root_finding import match_beta, matched_frequency, narrow
from vibroplat.paper.scenes import BETA, IMPACT, NON_IMPACT, QUICK, SEED, claims, paper_scene
from vibroplat.paper.tables import histories, sync_bands
from vibroplat.results.files import write_result
from vibroplat.results.provenance import provenance
from vibroplat.study.branches import Branch, branches
from vibroplat.study.fingerprint import arithmetic
from vibroplat.study.pool import Pool, StoredChain, run_stored
from vibroplat.study.store import Record, Store
from vibroplat.study.sweep import Progress, branch_records, conditions, run_sweeps, tables

#: Sweeps of the impact model from which figures are drawn or claims judged.
SWEEPS = ("fig2", *IMPACT)
#: Columns of points from which their number and work are counted.
COUNTED = ["outcome", "simulated_s", "events"]
#: Settings of the sweeps with further seeds: upward only, as claims are judged by these branches, and without other
#: motions beside them, as no table shows these.
REPEATED: dict[str, Any] = {"sweep.supply_frequency_hz.direction": ["up"], "sweep.coexists": False}


@dataclass(frozen=True)
class Reproduction:
    """The results of one machine.

    Attributes
    ----------
    tables
        By name: curves, time histories, claims.
    beta, matched_hz
        β of the non-impact model (1/s) and the frequency (Hz) at which it makes RMS y of both models equal; None if
        there is none.
    points
        Outcome, simulated time (s) and events of all points of sweeps, of curves that figures share once.
    """

    tables: dict[str, pd.DataFrame]
    beta: float | None
    matched_hz: float | None
    points: pd.DataFrame

    def write(self, numbers: Mapping[str, Any], directory: Path) -> None:
        """Write the tables, and their provenance with the machine's numbers.

        Wall times are left out, so that a repeated reproduction gives the same files.
        """
        scene = paper_scene(SWEEPS[0], numbers)
        beta = {"beta_per_s": self.beta, "beta_matched_hz": self.matched_hz}
        written = {name: table.drop(columns="wall_s", errors="ignore") for name, table in self.tables.items()}
        origin = provenance(scene, engine_name(scene)) | beta
        write_result(directory, "paper", origin, written, form="csv")

    def overview(self, machine: str, seconds: float) -> Iterator[str]:
        """Yield the lines that summarize claims, machine and work; ``seconds`` is the wall time."""
        for _, row in self.tables["claims"].iterrows():
            yield f"{row['id']:<24}{row['verdict']:<32}{row['seeds']:<16}{row['measured']}"
        matched = "no β: 30.9 Hz is not reached in antiphase"
        if self.beta is not None:
            matched = f"β = {self.beta:.2f} 1/s makes RMS y equal at f = {self.matched_hz:.2f} Hz"
        yield f"{'machine':<24}{machine}; {matched}"
        count, simulated, events = len(self.points), self.points["simulated_s"].sum(), self.points["events"].sum()
        yield f"{'computed':<24}{count} points, {simulated:.6g} s of motion, {events} events"
        failed = (self.points["outcome"] != "ok").sum()
        yield f"{'not ok':<24}{failed} points, counted in the claims that they concern"
        yield f"{'wall time':<24}{seconds:.3g} s, {count / seconds:.3g} points per s"


class SharedRecords:
    """The points of a sweep's branches, of which some are those of another sweep's branch: the same curve."""

    def __init__(self, homes: Mapping[int, tuple[Branch, Store]]) -> None:
        self._homes = homes

    def read(self, number: int, /) -> Iterator[tuple[int, Record]]:
        """Yield places and records of a branch; see :meth:`vibroplat.study.store.Store.read`."""
        branch, store = self._homes[number]
        return store.read(branch.number)


def curve_of(branch: Branch) -> str:
    """Return what determines the points of a branch, as text: branches of several figures may be the same curve.

    Material, contact and the limit of events make no difference to a bare platform.
    """
    tree = branch.scene.to_tree()
    tree["sweep"] = {k: v for k, v in tree["sweep"].items() if k not in ("grid", "supply_frequency_hz")}
    if branch.scene.material.mass_ratio == 0.0:
        tree["solver"] = {k: v for k, v in tree["solver"].items() if k != "max_events_per_period"}
        tree |= {"material": None, "contact": None}
    tree["name"] = None
    return json.dumps([tree, branch.direction, branch.along], sort_keys=True)


@dataclass(eq=False)
class Trial:
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
    swept
        Its finished sweeps, by name: branches, and where their points are.
    points
        What is counted of the points that were computed for it, :data:`COUNTED`.
    store
        Where its points are.
    """

    name: str
    numbers: Mapping[str, Any]
    settings: Mapping[str, Any]
    names: tuple[str, ...] = IMPACT
    changes: Mapping[str, Any] = field(default_factory=dict)
    evidence: Evidence = field(default_factory=Evidence)
    swept: dict[str, tuple[list[Branch], SharedRecords]] = field(default_factory=dict)
    points: list[dict[str, Any]] = field(default_factory=list)
    store: Store = field(init=False)

    def scene(self, name: str) -> Scene:
        """Return the scene of one of its sweeps; that of the non-impact model has the β that was found."""
        changes = {BETA: self.evidence.beta} if name == NON_IMPACT and self.evidence.beta is not None else {}
        return paper_scene(name, {**self.numbers, **self.changes}, {**self.settings, **changes})


#: The trials of a machine: one for each seed, of the first of which figures are drawn; and coarse ones with unprinted
#: numbers changed, the first of which changes nothing, as a control.
Trials = tuple[list[Trial], list[Trial]]


def trials_of(numbers: Mapping[str, Any], seeds: Sequence[int]) -> Trials:
    """List the trials of a machine."""
    machine = [Trial("machine", numbers, {SEED: seeds[0]}, SWEEPS)]
    machine += [Trial(f"seed-{n}", numbers, {SEED: n, **REPEATED}) for n in seeds[1:]]
    alternatives = [{}, *load_list(configurations() / "claims" / "alternatives.yaml")]
    coarse = {**QUICK, SEED: seeds[0]}
    others = [Trial(f"alternative-{i}", numbers, coarse, changes=c) for i, c in enumerate(alternatives)]
    return machine, others


def planned(numbers: Mapping[str, Any], seeds: Sequence[int] = (0,)) -> tuple[int, int]:
    """Return the numbers of branches and points of the first stage."""
    machine, _ = trials_of(numbers, seeds)
    found = [b for trial in machine for name in trial.names for b in branches(trial.scene(name))]
    distinct = {curve_of(branch): len(branch.along) for branch in found}
    return len(distinct), sum(distinct.values())


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
    trials = machine, others = trials_of(numbers, seeds)
    main, every = machine[0], [*machine, *others]
    with ExitStack() as stack:
        for trial in every:
            place = directory / trial.name
            place.mkdir(parents=True, exist_ok=True)
            wanted = {name: conditions(trial.scene(name)) for name in (*trial.names, NON_IMPACT)}
            trial.store = stack.enter_context(Store(place, wanted, resume=resume, overwrite=overwrite))
            trial.store.require("arithmetic", arithmetic(engine_name(trial.scene(NON_IMPACT))))
        _sweep([(trial, name) for trial in machine for name in trial.names], workers, progress=progress)
        _narrow(machine, workers)
        _add_non_impact(machine, workers)
        _narrow(machine, workers)
        failing = [claim for claim in claims() if not any(judge(claim, trial.evidence).holds for trial in machine)]
        _sweep([(trial, name) for trial in others for name in trial.names], workers, failing)
        if any(map(is_of_models, failing)):
            _add_non_impact(others, workers)
        shown = histories(numbers, main.evidence.beta, main.store.part("histories"), workers)
        for trial in every:
            trial.store.finish()
        return _results(trials, shown)


def _sweep(
    wanted: Sequence[tuple[Trial, str]],
    workers: Pool,
    asked: Sequence[Claim] | None = None,
    progress: Progress | None = None,
) -> None:
    """Run sweeps of trials side by side, as far as claims ask for them, and add their branches to the evidence."""
    homes, sweeps = dict[str, tuple[Branch, Store]](), []
    for trial, name in wanted:
        found = branches(trial.scene(name))
        found = found if asked is None else [branch for branch in (cut(b, asked) for b in found) if branch.along]
        store = trial.store.part(name)
        places = {branch.number: homes.setdefault(curve_of(branch), (branch, store)) for branch in found}
        trial.swept[name] = found, SharedRecords(places)
        sweeps.append(([branch for branch in found if places[branch.number][0] is branch], store))
    run_sweeps(sweeps, workers, progress)
    for (trial, name), (own, _) in zip(wanted, sweeps, strict=True):
        found, shared = trial.swept[name]
        for branch in found:
            records = list(branch_records(branch, shared))
            trial.evidence.add(branch, records)
            if branch in own:
                trial.points += [{column: record["row"].get(column) for column in COUNTED} for record in records]


def _add_non_impact(trials: Sequence[Trial], workers: Pool) -> None:
    """Find β of the non-impact model for some trials, and run its sweeps where there is one."""
    chains = [StoredChain(match_beta(trial.evidence), trial.store.part("beta"), 0) for trial in trials]
    for trial, beta in zip(trials, run_stored(chains, workers), strict=True):
        trial.evidence.beta = beta
    _sweep([(trial, NON_IMPACT) for trial in trials if trial.evidence.beta is not None], workers)


def _narrow(machine: Sequence[Trial], workers: Pool) -> None:
    """Narrow the boundaries that matter to the claims and to β."""
    for trial in machine:
        matched_frequency(trial.evidence)
        for claim in claims():
            judge(claim, trial.evidence)
    narrow([(trial.evidence, trial.store.part("boundaries")) for trial in machine], workers)


def _results(trials: Trials, shown: Mapping[str, pd.DataFrame]) -> Reproduction:
    """Judge the claims and return all tables, and how much was simulated for them."""
    machine, others = trials
    main = machine[0]
    points = pd.DataFrame([point for trial in (*machine, *others) for point in trial.points], columns=COUNTED)
    results = {name: pd.concat(tables(*found), ignore_index=True) for name, found in main.swept.items()}
    results["sync-bands"] = sync_bands(main.evidence)
    seeds = {int(trial.settings[SEED]): trial.evidence for trial in machine}
    results["claims"] = scoreboard(seeds, [(trial.changes, trial.evidence) for trial in others])
    beta, matched = main.evidence.beta, matched_frequency(main.evidence)
    return Reproduction({**results, **shown}, beta, matched, points)
