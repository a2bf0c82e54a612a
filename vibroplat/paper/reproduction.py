"""Reproduce the paper by Panovko and Shokhin with one machine: its curves, its time histories, its claims judged.

The simulations are run in stages, each with its chains side by side: sweeps of the impact model, narrowing of
boundaries, β of the non-impact model, its sweeps, narrowing of further boundaries; for claims that fail, the same with
unprinted numbers changed; time histories. All are stored. What is judged and tabulated after them is read from these
results alone.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from vibroplat.config.digits import quantity
from vibroplat.config.reader import configurations, load_list
from vibroplat.config.scene import Scene
from vibroplat.paper.claims import cut, is_of_models, judge, scoreboard
from vibroplat.paper.evidence import Evidence
from vibroplat.paper.judges import Claim
from vibroplat.paper.root_finding import match_beta, matched_frequency, narrow
from vibroplat.paper.scenes import BETA, IMPACT, NON_IMPACT, QUICK, SEED, claims, paper_scene
from vibroplat.paper.tables import TABLES, histories, sync_bands
from vibroplat.results.answer import Answer
from vibroplat.results.result import Result
from vibroplat.study.branches import SweepBranch, branches
from vibroplat.study.pool import Pool, StoredChain, run_stored
from vibroplat.study.store import Store, digest
from vibroplat.study.study import CrossCheckCase, Progress, Study, conditions
from vibroplat.study.sweep import branch_records, point_cases, run_branches, sweep_table

#: Sweeps of the impact model from which figures are drawn or claims judged.
SWEEPS = ("fig2", *IMPACT)
#: Columns of points from which their number and work are counted.
COUNTED = ["outcome", "simulated_s", "events"]
#: Settings of the sweeps with further seeds: upward only, as claims are judged by these branches.
REPEATED: dict[str, Any] = {"sweep.supply_frequency_hz.direction": ["up"]}


def curve_of(branch: SweepBranch) -> str:
    """Return a digest of what determines the points of a branch: branches of several figures may be the same curve.

    Material, contact and the limit of events make no difference to a bare platform.
    """
    tree = branch.scene.to_tree()
    tree["sweep"] = {k: v for k, v in tree["sweep"].items() if k not in ("grid", "supply_frequency_hz")}
    if branch.scene.material.mass_ratio == 0.0:
        tree["solver"] = {k: v for k, v in tree["solver"].items() if k != "max_events_per_period"}
        tree |= {"material": None, "contact": None}
    tree["name"] = None
    return digest(json.dumps([tree, branch.direction, branch.key_values], sort_keys=True))


@dataclass(eq=False)
class Trial:
    """Sweeps of the paper with one set of numbers and one seed.

    Attributes
    ----------
    name
        Its name among the trials.
    numbers, changes, settings
        Numbers of the machine, changes of unprinted ones, settings of the sweeps.
    names
        Its sweeps of the impact model.
    evidence
        What has been found so far.
    swept
        The branches of its finished sweeps, by name.
    points
        What is counted of the points that were computed for it, :data:`COUNTED`.
    """

    name: str
    numbers: Mapping[str, Any]
    settings: Mapping[str, Any]
    names: tuple[str, ...] = IMPACT
    changes: Mapping[str, Any] = field(default_factory=dict)
    evidence: Evidence = field(default_factory=Evidence)
    swept: dict[str, list[SweepBranch]] = field(default_factory=dict)
    points: list[dict[str, Any]] = field(default_factory=list)

    def scene(self, name: str) -> Scene:
        """Return the scene of one of its sweeps; that of the non-impact model has the β that was found."""
        changes = {BETA: self.evidence.beta} if name == NON_IMPACT and self.evidence.beta is not None else {}
        return paper_scene(name, {**self.numbers, **self.changes}, {**self.settings, **changes})


#: The trials of a machine: one for each seed, of the first of which figures are drawn; and coarse ones with unprinted
#: numbers changed, the first of which changes nothing, as a control.
Trials = tuple[list[Trial], list[Trial]]


class PaperStudy(Study):
    """The reproduction of the paper with a machine.

    Parameters
    ----------
    numbers
        Dotted keys and values of the machine, which are laid over the paper's scenes.
    seeds
        Seeds of the perturbations; figures are drawn with the first, claims are judged with each.
    machine
        Name of the machine.

    Raises
    ------
    ConfigError
        A number is not allowed.
    """

    kind = "paper"
    described = TABLES

    def __init__(self, numbers: Mapping[str, Any], seeds: Sequence[int] = (0,), machine: str = "machine") -> None:
        self.numbers, self.seeds, self.machine = numbers, seeds, machine
        self.scene = paper_scene(SWEEPS[0], numbers)
        for trial in self.trials()[0]:
            for name in trial.names:
                trial.scene(name)

    def trials(self) -> Trials:
        """List the trials."""
        machine = [Trial("machine", self.numbers, {SEED: self.seeds[0]}, SWEEPS)]
        machine += [Trial(f"seed-{n}", self.numbers, {SEED: n, **REPEATED}) for n in self.seeds[1:]]
        alternatives = [{}, *load_list(configurations() / "claims" / "alternatives.yaml")]
        coarse = {**QUICK, SEED: self.seeds[0]}
        others = [Trial(f"alternative-{i}", self.numbers, coarse, changes=c) for i, c in enumerate(alternatives)]
        return machine, others

    @property
    def conditions(self) -> dict[str, Any]:
        """What the records of each trial's sweeps depend on."""
        every = itertools.chain(*self.trials())
        return {t.name: {name: conditions(t.scene(name)) for name in (*t.names, NON_IMPACT)} for t in every}

    def chains(self, store: Store) -> int:
        """Return the number of branches of the first stage, of curves that figures share once."""
        drawn = [b for trial in self.trials()[0] for name in trial.names for b in branches(trial.scene(name))]
        return len({curve_of(branch) for branch in drawn})

    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Run all stages, and judge the claims.

        Wall times are left out of the tables, so that a repeated reproduction gives the same files.
        """
        trials = machine, others = self.trials()
        main, coarse = machine[0], store.namespace("coarse")
        _sweep([(trial, name) for trial in machine for name in trial.names], store, workers, progress=progress)
        _narrow(machine, store, workers)
        _add_non_impact(machine, store, workers)
        _narrow(machine, store, workers)
        failing = [claim for claim in claims() if not any(judge(claim, trial.evidence).holds for trial in machine)]
        _sweep([(trial, name) for trial in others for name in trial.names], coarse, workers, failing)
        if any(map(is_of_models, failing)):
            _add_non_impact(others, coarse, workers)
        shown = histories(self.numbers, main.evidence.beta, store.namespace("histories"), workers)
        tables = {**_tables(trials, store), **shown}
        self._swept = main.swept
        beta, matched = main.evidence.beta, matched_frequency(main.evidence)
        written = {name: table.drop(columns="wall_s", errors="ignore") for name, table in tables.items()}
        facts = {"beta_per_s": beta, "beta_matched_hz": matched}
        lines = self._lines(trials, beta, matched)
        headline, short = _short(self.machine, tables["claims"], lines)
        answer = Answer(lines, list(_verdicts(tables["claims"])), headline=headline, short=short)
        return Result("paper", self.scene, written, answer, facts=facts)

    def cross_check_cases(self, result: Result, store: Store, other: Callable[[Scene], Scene]) -> list[CrossCheckCase]:
        """Choose points of Fig. 3; see :func:`vibroplat.study.sweep.point_cases`."""
        return point_cases(self._swept["fig3"], store, other)

    def _lines(self, trials: Trials, beta: float | None, matched_hz: float | None) -> dict[str, str]:
        """Summarize the machine and the work."""
        points = pd.DataFrame([point for trial in itertools.chain(*trials) for point in trial.points], columns=COUNTED)
        matched = "no β: 30.9 Hz is not reached in antiphase"
        if beta is not None:
            matched = f"β = {quantity(beta, '1/s')} makes RMS y equal at f = {quantity(matched_hz, 'Hz')}"
        simulated, events = points["simulated_s"].sum(), points["events"].sum()
        return {
            "machine": f"{self.machine}; {matched}",
            "computed": f"{len(points)} points, {quantity(simulated, 's')} of motion, {events} events",
            "not ok": f"{(points['outcome'] != 'ok').sum()} points, counted in the claims that they concern",
        }


def _short(machine: str, table: pd.DataFrame, lines: Mapping[str, str]) -> tuple[str, list[str]]:
    """Return how many claims hold with a machine, and how the others fail."""
    counts = table["verdict"].astype(str).str.partition(", without")[0].value_counts()
    good = int(counts.get("reproduced", 0))
    others = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if verdict != "reproduced")
    short = [others, lines["machine"].partition("; ")[2], f"{lines['computed']}; not ok: {lines['not ok']}"]
    return f"{machine}: {good} of {len(table)} claims of the paper reproduced", [line for line in short if line]


def _verdicts(table: pd.DataFrame) -> Iterator[str]:
    """Yield a line for each claim."""
    for _, row in table.iterrows():
        yield f"{row['id']:<24}{row['verdict']:<32}{row['seeds']:<16}{row['measured']}"


def _sweep(
    wanted: Sequence[tuple[Trial, str]],
    store: Store,
    workers: Pool,
    asked: Sequence[Claim] | None = None,
    progress: Progress = lambda done, known: None,
) -> None:
    """Run sweeps of trials side by side, as far as claims ask for them, and add their branches to the evidence."""
    curves: dict[str, SweepBranch] = {}
    for trial, name in wanted:
        parts = branches(trial.scene(name))
        parts = parts if asked is None else [branch for branch in (cut(b, asked) for b in parts) if branch.key_values]
        trial.swept[name] = [replace(branch, name=curve_of(branch)) for branch in parts]
        for branch in trial.swept[name]:
            curves.setdefault(branch.name, branch)
    run_branches(list(curves.values()), store, workers, progress)
    for trial, name in wanted:
        for branch in trial.swept[name]:
            records = list(branch_records(branch, store))
            trial.evidence.add(branch, records)
            if curves.pop(branch.name, None) is not None:
                trial.points += [{column: record["row"].get(column) for column in COUNTED} for record in records]


def _add_non_impact(trials: Sequence[Trial], store: Store, workers: Pool) -> None:
    """Find β of the non-impact model for some trials, and run its sweeps where there is one."""
    chains = [StoredChain(match_beta(trial.evidence), store, f"{trial.name} beta") for trial in trials]
    for trial, beta in zip(trials, run_stored(chains, workers), strict=True):
        trial.evidence.beta = beta
    _sweep([(trial, NON_IMPACT) for trial in trials if trial.evidence.beta is not None], store, workers)


def _narrow(machine: Sequence[Trial], store: Store, workers: Pool) -> None:
    """Narrow the boundaries that matter to the claims and to β."""
    for trial in machine:
        matched_frequency(trial.evidence)
        for claim in claims():
            judge(claim, trial.evidence)
    narrow([(trial.evidence, store.namespace(f"{trial.name} boundaries")) for trial in machine], workers)


def _tables(trials: Trials, store: Store) -> dict[str, pd.DataFrame]:
    """Judge the claims, and return all tables but the time histories."""
    machine, others = trials
    main = machine[0]
    tables = {name: sweep_table(swept, store) for name, swept in main.swept.items()}
    tables["sync-bands"] = sync_bands(main.evidence)
    seeds = {int(trial.settings[SEED]): trial.evidence for trial in machine}
    tables["claims"] = scoreboard(seeds, [(trial.changes, trial.evidence) for trial in others])
    return tables
