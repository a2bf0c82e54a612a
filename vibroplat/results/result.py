"""The result of a command, just computed or read from its files: tables, answer, provenance, figures, files."""

from __future__ import annotations

import html
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from vibroplat.config.arguments import FileName, validated
from vibroplat.config.kinds import noun_of
from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError, TableError, escape_controls
from vibroplat.extensions import figure_of
from vibroplat.frames import pd
from vibroplat.results.answer import Answer
from vibroplat.results.files import SCHEMA, STORE, SavedFiles, commands_in, directory_of, write_result
from vibroplat.results.labels import is_number
from vibroplat.results.provenance import provenance
from vibroplat.results.tables import FORMATS, Format, as_written, result_directory

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Result:
    """The result of a command.

    Its tables are attributes by their names, as in ``result.thresholds``; all of them are in :attr:`tables`.

    Parameters
    ----------
    command
        Name of the command, such as ``sweep``.
    scene
        Simulated scene.
    tables
        Tables by name, or functions that yield their parts; the last table is written last.
    answer
        Printed answer.
    documents, configurations
        Contents of further JSON and YAML files, by name.
    facts
        Further entries of provenance.

    Attributes
    ----------
    command
        Name of the command.
    check
        Result of the cross-check by another engine, as plain values; None without a cross-check.
    label
        Name of the result beside other results.
    """

    check: Mapping[str, Any] | None = None
    label: str = ""
    #: Its files, if it was read from them.
    saved: SavedFiles | None = None

    def __init__(
        self,
        command: str,
        scene: Scene,
        tables: Mapping[str, pd.DataFrame | Callable[[], Iterable[pd.DataFrame]]],
        answer: Answer,
        *,
        documents: Mapping[str, Any] | None = None,
        configurations: Mapping[str, str] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        self.command, self._facts = command, facts or {}
        stored = Answer.from_tree(answer.to_tree())
        known = {"scene": scene, "tables": Tables(tables), "answer": stored, "documents": documents or {}}
        self.__dict__ |= known | {"configurations": configurations or {}}

    @classmethod
    def read(cls, directory: str | Path, command: str) -> Self:
        """Read the result of a command from a directory; tables are read at first use.

        Raises
        ------
        TableError
            The directory has no such result, or it is unfinished or has an unknown schema.
        """
        path = Path(directory)
        if not path.is_dir():
            raise TableError(f"{path} is not a directory; allowed: a result directory of vibroplat")
        if (directory_of(path, command) / STORE).exists() and command not in commands_in(path):
            raise TableError(f"{path} holds unfinished work; continue it by the same command with --resume")
        result = cls.__new__(cls)
        with as_written(path):
            result.command, result.saved = command, SavedFiles(path, command)
        result.check = result.saved.provenance.get("check")
        return result

    def _as_written(self) -> AbstractContextManager[None]:
        """Name the directory in errors at what was read from it."""
        return nullcontext() if self.directory is None else as_written(self.directory)

    # -- what it holds ------------------------------------------------------------------------------

    @cached_property
    def scene(self) -> Scene:
        """Simulated scene; raises TableError if the configuration is lost or from an incompatible version."""
        try:
            return Scene.from_tree(self.given())
        except (TypeError, AttributeError, ConfigError) as error:
            raise TableError(f"the configuration in {self.place}: {error}") from None

    @property
    def known_scene(self) -> Scene | None:
        """What was simulated, if that is known."""
        try:
            return self.scene
        except TableError:
            return None

    @cached_property
    def tables(self) -> Tables:
        """Tables by name."""
        saved = self._read
        return Tables({name: partial(_whole, saved, name) for name in saved.names(*FORMATS)})

    @cached_property
    def documents(self) -> Mapping[str, Any]:
        """Contents of its JSON files, by name."""
        return {name: self._read.document(name) for name in self._read.names("json")}

    @cached_property
    def configurations(self) -> Mapping[str, str]:
        """Contents of its YAML files, by name."""
        return {name: self._read.configuration(name) for name in self._read.names("yaml")}

    @property
    def _read(self) -> SavedFiles:
        """The files that were read."""
        assert self.saved is not None
        return self.saved

    @cached_property
    def answer(self) -> Answer:
        """Printed answer."""
        return Answer.from_tree(self.provenance.get("answer"))

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance: versions, machine, configuration, printed answer and cross-check."""
        if self.saved is not None:
            return self.saved.provenance
        more: dict[str, Any] = {**self._facts, "answer": self.answer.to_tree()}
        if self.check is not None:
            more["check"] = self.check
        from vibroplat.integrate import engine_name  # noqa: PLC0415  (of results that are read, no engine is needed)

        return provenance(self.scene, engine_name(self.scene)) | more

    @property
    def directory(self) -> Path | None:
        """Where it was read."""
        return None if self.saved is None else self.saved.directory

    @property
    def place(self) -> str:
        """What messages call it: its directory, or the name of its scene."""
        return self.name if self.saved is None else str(self.saved.directory)

    @property
    def name(self) -> str:
        """Name in figures: name of the directory of the scene's results, or of the scene."""
        return self.scene.name if self.home is None else self.home.name

    @property
    def home(self) -> Path | None:
        """Directory of the results of all commands of the scene, if it was read."""
        if self.directory is None:
            return None
        path = self.directory.resolve()
        return path.parent if path.name == self.command else path

    def __getattr__(self, name: str) -> pd.DataFrame:
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self.tables:
            raise AttributeError(f"{noun_of(self.command)} has no table {name}; allowed: {', '.join(self.tables)}")
        return self.tables[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.tables]

    # -- as figures and the page read it ------------------------------------------------------------

    def given(self, *path: str) -> Any:
        """Return the configuration, or a section or value of it; raises TableError if it is not there."""
        value: Any = self.provenance.get("configuration")
        for name in path:
            value = value.get(name) if isinstance(value, dict) else None
        if value is None or not (path or isinstance(value, dict)):
            raise TableError(f"{self.place}/provenance.json is not the provenance of {noun_of(self.command)}")
        return value

    def columns(
        self, name: str, texts: Collection[str], numbers: Collection[str] = (), optional: Collection[str] = ()
    ) -> pd.DataFrame:
        """Return a table; it must have these columns of texts and of numbers, and numbers in optional ones it has."""
        return self._checked(name, self.table(name), texts, numbers, optional)

    def table(self, name: str) -> pd.DataFrame:
        """Return a table; raises TableError if there is none of that name."""
        if name not in self.tables:
            raise TableError(f"{self.place} holds no {name} table; allowed: {', '.join(self.tables)}")
        return self.tables[name]

    def column_parts(
        self, name: str, texts: Collection[str], numbers: Collection[str], optional: Collection[str] = ()
    ) -> Iterator[pd.DataFrame]:
        """Yield these columns of a table in parts, which must be as in :meth:`columns`; all that a new result has."""
        wanted = (*texts, *numbers, *optional)
        for part in self.tables.parts(name) if self.saved is None else self.saved.parts(name, wanted):
            yield self._checked(name, part, texts, numbers, optional)

    def _checked(
        self,
        name: str,
        table: pd.DataFrame,
        texts: Collection[str],
        numbers: Collection[str],
        optional: Collection[str],
    ) -> pd.DataFrame:
        """Return a table that has columns of texts, of numbers, and maybe optional ones of numbers."""
        begin = f"the {name} table in {self.place} has no"
        for column in (*texts, *numbers):
            if column not in table:
                raise TableError(f"{begin} column {column}")
        for column in (*numbers, *(column for column in optional if column in table)):
            if not (is_number(table[column]) or table[column].empty):
                raise TableError(f"{begin} numbers in column {column}")
        return table

    # -- to look at and to hand on ------------------------------------------------------------------

    def __repr__(self) -> str:
        """Return what the command prints."""
        return escape_controls(f"vibroplat {self.command} {self.name}\n{self.answer}")

    def _repr_html_(self) -> str:
        """Return what the command prints, for a notebook."""
        return f"<pre>{html.escape(repr(self))}</pre>"

    def plot(self, kind: str | None = None, **options: Any) -> Figure:
        """Draw a figure.

        Parameters
        ----------
        kind
            Which one, as ``--kind`` of ``vibroplat plot``. Default: the first one that the result has.
        options
            As ``vibroplat plot`` has them for such a result.

        Raises
        ------
        ConfigError
            The result has no such figure or option.
        TableError
            There is nothing to draw.
        """
        with self._as_written():
            return figure_of(self, kind, **options)

    @validated(directory=FileName, form=Format)
    def save(self, directory: str | Path, form: Format = "parquet") -> Path:
        """Write the result into a directory, as its command does; :func:`vibroplat.load` reads it.

        Raises
        ------
        ConfigError
            An argument is not allowed.
        TableError
            A file cannot be written.
        """
        path = Path(directory)
        result_directory(path.parent, path.name)
        tables = {name: self.tables.parts(name) for name in self.tables}
        more = {"documents": self.documents, "configurations": self.configurations}
        origin = self.provenance | {"schema": SCHEMA}  # one that was loaded may have another
        with self._as_written():
            write_result(path, self.command, origin, tables, form=form, **more)
        return path


class Tables(Mapping[str, "pd.DataFrame"]):
    """Tables by name, each of which is made or read once, when it is first asked for.

    Parameters
    ----------
    sources
        Tables, or functions that yield the parts of one.
    """

    def __init__(self, sources: Mapping[str, pd.DataFrame | Callable[[], Iterable[pd.DataFrame]]]) -> None:
        self._sources = sources
        self._known: dict[str, pd.DataFrame] = {}

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._known:
            first, *others = self.parts(name)
            self._known[name] = pd.concat([first, *others], ignore_index=True) if others else first
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in self._sources

    def __iter__(self) -> Iterator[str]:
        return iter(self._sources)

    def __len__(self) -> int:
        return len(self._sources)

    def make_all(self) -> None:
        """Make all tables, and forget what they are made from."""
        self._sources = dict(self)

    def parts(self, name: str) -> Iterable[pd.DataFrame]:
        """Return a table in parts, at least one, which are not kept; one that was made already as a whole."""
        source = self._known.get(name, self._sources[name])
        return source() if callable(source) else [source]


def _whole(saved: SavedFiles, name: str) -> list[pd.DataFrame]:
    return [saved.table(name)]
