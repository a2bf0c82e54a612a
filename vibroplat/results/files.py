"""Results: the files that one command writes together, and the provenance that proves that they belong together.

``provenance.json`` says which command wrote a result, gives the result an id, and holds the SHA-256 of each of its
files, of whatever format. Readers refuse a file with another digest. A lock keeps two commands from replacing files at
the same time; the digests also hold where a file system has no locks, and find files that were damaged or changed.

A command of a scene writes into ``NAME/COMMAND``. Readers take that directory or ``NAME``, and also results that were
saved in ``NAME`` itself.

A directory holds the result of one command. Writing the result of another command there is an error.
"""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from vibroplat.config.kinds import KINDS
from vibroplat.errors import TableError
from vibroplat.frames import pd
from vibroplat.results.exports import exports
from vibroplat.results.locks import replacement_lock
from vibroplat.results.tables import (
    FORMATS,
    Format,
    Table,
    TableFile,
    as_written,
    json_writer,
    new_file,
    one_line_errors,
    open_file,
    put_in_place,
    read_json,
    read_parts,
    read_table,
    remove_file,
    text_writer,
)

#: Name of the file with finished tasks of a study, next to its result.
STORE = "points.sqlite"
#: The commands that write results, in the order in which results of one directory are told.
COMMANDS = ("run", *KINDS, "paper")
#: Version of the contents of result directories, the only one that is read.
SCHEMA = 4


def write_result(
    directory: Path,
    command: str,
    origin: Mapping[str, Any],
    tables: Mapping[str, Table | TableFile],
    documents: Mapping[str, Any] | None = None,
    *,
    form: Format,
    configurations: Mapping[str, str] | None = None,
) -> None:
    """Write the result of a command: all of its files or none.

    If the process is killed while it renames them, the last files are missing; old and new ones are never mixed.

    Parameters
    ----------
    directory
        Where the files are written.
    command
        The command that wrote them.
    origin
        Its provenance, to which the command, the id and the digests are added.
    tables, documents
        Tables, whole, in parts or written already, and contents of JSON files, by name. The last of all is renamed
        last.
    form
        Format of the tables; exports are written beside Parquet files.
    configurations
        Contents of YAML files, by name.

    Raises
    ------
    TableError
        A file cannot be written, another process holds the lock, or the directory holds the result of another command.
    """
    with ExitStack() as stack:
        files = _write_temporaries(stack, directory, command, tables, documents or {}, configurations or {}, form)
        digests = {path.name: _sha256(temporary) for path, temporary in files.items()}
        proof = dict(origin) | {"command": command, "result": uuid.uuid4().hex, "files": digests}
        with replacement_lock(directory):
            last, temporary = files.popitem()
            replaced = {f"{name}.{other}" for name in tables for other in FORMATS}
            replaced |= {f"{command}.xlsx", f"{command}.mat"}  # of :func:`export_result`, which has no digests
            old = (_files_to_replace(directory, command) | replaced) - digests.keys()
            path = directory / "provenance.json"
            with new_file(path, json_writer(proof)) as files[path]:
                put_in_place(files | {last: temporary})
            for name in old:
                remove_file(directory / name)


def export_result(directory: Path, command: str, form: str) -> list[Path]:
    """Write a finished result for another program into its directory, and return the new files.

    Raises
    ------
    TableError
        There is no such result, its tables are no Parquet files or damaged, or a file cannot be written.
    """
    saved = SavedFiles(directory, command)
    tables = {name: partial(saved.parts, name) for name in saved.names("parquet")}
    if not tables:
        raise TableError(f"{saved.directory} has no Parquet tables; allowed: a result of --format parquet")
    documents = {name: saved.document(name) for name in saved.names("json")}
    with ExitStack() as stack, as_written(saved.directory):
        files = {
            saved.directory / name: stack.enter_context(new_file(saved.directory / name, write))
            for name, write in exports(form, command, tables, documents).items()
        }
        with replacement_lock(saved.directory):
            put_in_place(files)
    return list(files)


def _write_temporaries(
    stack: ExitStack,
    directory: Path,
    command: str,
    tables: Mapping[str, Table | TableFile],
    documents: Mapping[str, Any],
    configurations: Mapping[str, str],
    form: Format,
) -> dict[Path, Path]:
    """Write files under temporary names, which are removed with the stack, and return these by the final ones."""
    files: dict[Path, Path] = {}
    finished: dict[str, Path] = {}
    for name, table in tables.items():
        if isinstance(table, TableFile):
            file = table
        else:
            file = stack.enter_context(TableFile(directory, name, form))
            file.extend(table)
        finished[name] = files[file.path] = file.finish()
    sources = {name: partial(read_parts, path.parent, path.stem) for name, path in finished.items()}
    for name, write in exports(form, command, sources, documents).items():
        files[directory / name] = stack.enter_context(new_file(directory / name, write))
    for name, value in documents.items():
        path = directory / f"{name}.json"
        files[path] = stack.enter_context(new_file(path, json_writer(value)))
    for name, text in configurations.items():
        path = directory / f"{name}.yaml"
        files[path] = stack.enter_context(new_file(path, text_writer(text)))
    return files


class SavedFiles:
    """The files of a command's result in a directory. All that is read belongs together.

    Parameters
    ----------
    directory
        Where it is, or the directory above; see :func:`directory_of`.
    command
        The command that wrote it.

    Attributes
    ----------
    directory
        Where it is.
    provenance
        How it was made.

    Raises
    ------
    TableError
        There is no such result, or it has another schema.
    """

    def __init__(self, directory: Path, command: str) -> None:
        self.directory, self.command = directory_of(directory, command), command
        self.provenance = read_provenance(self.directory)
        if self.provenance.get("command", command) != command:
            raise TableError(f"{directory} holds a result of {self.provenance['command']}; allowed: one of {command}")
        files = self.provenance.get("files")
        # without digests, files that somebody has edited by hand can be read
        self._digests = {str(name): str(digest) for name, digest in files.items()} if isinstance(files, dict) else None

    def names(self, *forms: str) -> list[str]:
        """Return the names of the files that have one of these endings."""
        files = [path.name for path in self.directory.iterdir()] if self._digests is None else self._digests
        return [Path(name).stem for name in files if Path(name).suffix.removeprefix(".") in forms]

    def table(self, name: str) -> pd.DataFrame:
        """Read a table; raises :class:`TableError` if it is missing, damaged or of another result."""
        return read_table(self.directory, name, self._digests)

    def parts(self, name: str, columns: Collection[str] | None = None, *, last: bool = False) -> Iterator[pd.DataFrame]:
        """Read a table in parts; see :func:`vibroplat.results.tables.read_parts`."""
        return read_parts(self.directory, name, self._digests, columns, last=last)

    def document(self, name: str) -> Any:
        """Read a JSON file; raises :class:`TableError` if it is missing, damaged or of another result."""
        return read_json(self.directory, name, self._digests)

    def configuration(self, name: str) -> str:
        """Read a YAML file, as :meth:`document`."""
        with open_file(self.directory / f"{name}.yaml", self._digests) as file:
            return file.read().decode("utf-8")


def commands_in(directory: Path) -> list[str]:
    """Return the commands whose finished results a directory holds, itself or in directories of their names."""
    return [name for name in COMMANDS if name in (_command_of(directory), _command_of(directory / name))]


def directory_of(directory: Path, command: str) -> Path:
    """Return where a command's result is: in a directory of its name if there is one, or in the directory."""
    own = directory / command
    return own if _command_of(own) == command or (own.is_dir() and _command_of(directory) != command) else directory


def _command_of(directory: Path) -> str | None:
    """Return the command whose result lies in a directory itself, if any."""
    origin = read_json(directory, "provenance") if (directory / "provenance.json").exists() else None
    return origin.get("command") if isinstance(origin, dict) else None


def read_provenance(directory: Path) -> dict[str, Any]:
    """Return the provenance of the result in a directory; refuse other schemas."""
    if not (directory / "provenance.json").exists():
        raise TableError(f"{directory} holds no finished result: it has no provenance.json")
    origin = read_json(directory, "provenance")
    schema = origin.get("schema") if isinstance(origin, dict) else None
    if type(schema) is not int or schema != SCHEMA:
        raise TableError(f"{directory} holds results of schema {schema}; this version reads schema {SCHEMA}")
    return dict(origin)


def hash_of(tree: Mapping[str, Any]) -> str:
    """SHA-256 of nested values, independent of the order of their keys."""
    return hashlib.sha256(json.dumps(tree, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _files_to_replace(directory: Path, command: str) -> set[str]:
    """Return the names of the files in the result of a command that is about to be replaced, as far as it can be read.

    That of another command is not replaced (TableError).
    """
    try:
        origin = read_json(directory, "provenance")
    except TableError:
        origin = None
    known = origin if isinstance(origin, dict) else {}
    if known.get("command", command) != command:
        raise TableError(f"{directory} holds a result of {known['command']}; allowed: another directory")
    files = known.get("files")
    return {name for name in files if name == Path(name).name} if isinstance(files, dict) else set()


def _sha256(path: Path) -> str:
    with one_line_errors(path, "read"), path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
