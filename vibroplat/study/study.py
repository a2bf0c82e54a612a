"""A study of a scene: many motions, computed in chains of stored tasks, and the result made from them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from io import StringIO
from typing import Annotated, Any, ClassVar, NamedTuple, TypedDict, Unpack, get_type_hints

import numpy as np
from pydantic import Field
from ruamel.yaml import YAML

from vibroplat.columns import Columns
from vibroplat.config.arguments import instance_of, validated
from vibroplat.config.engine_choice import engine_note
from vibroplat.config.plausibility import by_severity, notes_on_inputs, notes_on_plan
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.integrate import engine_name
from vibroplat.results.result import Result
from vibroplat.study.fingerprint import package
from vibroplat.study.pool import Pool, Task, pool
from vibroplat.study.store import Record, Store

#: Largest allowed difference of a measure, relative to the larger of the measure and its scale. It is ten times the
#: error that remains after settling. At 214 points of Figs. 3 and 6 the orbits of ``taylor`` and ``native`` differ by
#: at most 2e-7.
ALLOWED = 1e-3
#: Maximum number of motions repeated in a cross-check; they are spread over the whole result.
MAX_CROSS_CHECKS = 20
#: Columns in which a repeated motion must agree; aperiodic motion is compared in the first column only.
COMPARED = ("sync", "motion", "period", "excitation_frequency_hz", "rms_x_m", "rms_y_m", "motor_power_w")

#: Function that is called with the numbers of finished and of known items.
Progress = Callable[[int, int], object]


class CrossCheckCase(NamedTuple):
    """A motion of a result that is repeated by another engine.

    Attributes
    ----------
    place
        Where it is, as "at μ = 0.1": no two have the same.
    task
        What repeats it; its record has a ``row``.
    row
        What its row must have.
    allowed
        Difference of a measure, over the larger of it and its scale, that is allowed.
    """

    place: str
    task: Task
    row: Record
    allowed: float = ALLOWED


class Study(ABC):
    """A study: its plan, read from the section of its kind and validated, and the computation of its result.

    Attributes
    ----------
    kind
        Its name in :data:`vibroplat.config.kinds.KINDS`.
    described
        Its tables by name: what their rows are, and their columns.
    counted
        What progress counts: ``points``, ``values``, …
    scene
        Whose section it is.
    """

    kind: ClassVar[str]
    described: ClassVar[Mapping[str, tuple[str, Columns]]]
    counted: ClassVar[str] = "points"
    scene: Scene

    @property
    def conditions(self) -> dict[str, Any]:
        """What stored records depend on."""
        return conditions(self.scene)

    def scenes(self) -> Iterable[Scene]:
        """Return the scenes whose input is checked for plausibility."""
        return [self.scene]

    def places(self) -> Sequence[str]:
        """Return in words how these scenes differ, or nothing if their notes say it."""
        return ()

    def input_notes(self) -> list[str]:
        """Return the notes on the study's input: unusual numbers, defaults, and keys without effect."""
        return [*notes_on_inputs(self.scenes(), self.places()), *notes_on_plan(self.scene, self.kind)]

    @abstractmethod
    def chains(self, store: Store) -> int:
        """Return the largest number of unfinished chains of tasks that run side by side."""

    @abstractmethod
    def run(self, store: Store, workers: Pool, progress: Progress) -> Result:
        """Run the tasks in chains (:func:`vibroplat.study.pool.run_stored`), and make the result.

        The result depends neither on the order in which workers finish nor on their number.
        """

    @abstractmethod
    def cross_check_cases(
        self, result: Result, store: Store, other: Callable[[Scene], Scene]
    ) -> Sequence[CrossCheckCase]:
        """Choose motions of the result to repeat with other scenes, for example with another engine."""


def conditions(scene: Scene) -> dict[str, Any]:
    """Return what the records of a study depend on: code, engine and configuration."""
    return package() | {"engine": engine_name(scene), "configuration": scene.to_tree()}


def configuration_text(scene: Scene, kind: str) -> str:
    """Return the YAML configuration of the best scene that a study has found, without the section of its kind."""
    tree = scene.to_tree() | {"name": f"{scene.name}-best"}
    del tree[kind]
    text = StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.dump(tree, text)
    return text.getvalue()


def note_computation(study: Study, result: Result) -> None:
    """Add those of a study to the notes of its result, the most severe first, below that on the engine."""
    others = by_severity([*result.answer.notes, *study.input_notes()])
    result.answer = result.answer._replace(notes=[engine_note(engine_name(result.scene)), *others])


def choose_evenly(places: Sequence[int], max_count: int = MAX_CROSS_CHECKS) -> list[int]:
    """Choose some of the places of a table, as far from each other as they can be."""
    chosen = np.linspace(0, max(len(places) - 1, 0), min(max_count, len(places))).round().astype(int)
    return [places[index] for index in np.unique(chosen).tolist()]


class Options(TypedDict, total=False):
    """How a study is run.

    Attributes
    ----------
    jobs
        Worker processes; with 1 the tasks run in this process.
    scheduler
        Address of a dask scheduler, whose workers are used instead.
    executor
        An executor of :mod:`concurrent.futures`, such as that of loky or mpi4py, whose workers are used instead.
    progress
        Called with the numbers of what is done and of all that is known.
    """

    jobs: Annotated[int, Field(ge=1)] | None
    scheduler: str | None
    executor: Executor
    progress: Progress


_OPTIONS = get_type_hints(Options, include_extras=True) | {
    "executor": instance_of(Executor, "an executor of concurrent.futures")
}


@validated(scene=SceneArgument, **_OPTIONS)
def run_study(kind: Callable[[Scene], Study], scene: Scene, **options: Unpack[Options]) -> Result:
    """Run the study of a scene and store nothing.

    Raises
    ------
    ConfigError
        The scene or an option is none, or the scheduler does not answer.
    NoWorkersError
        The scheduler or the executor is gone.
    IncompatibleWorkerError
        A worker would give other bits than this process.
    """
    study, progress = kind(scene), options.get("progress", lambda done, known: None)
    where = options.get("jobs", 1), options.get("scheduler"), options.get("executor")
    with Store(None, {}) as store, pool(*where, chains=study.chains(store)) as workers:
        result = study.run(store, workers, progress)
        result.tables.make_all()  # while there is a store
        note_computation(study, result)
        return result
