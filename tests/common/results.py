"""What commands leave in a directory of results."""

import json
import re
import sqlite3

import pandas as pd

#: Files that commands leave under their final names.
FINAL = re.compile(
    r"(trajectory|events|sweep|section|impacts|bands|branches|special|boundaries)\.(parquet|csv)"
    r"|(summary|orbits|provenance)\.json|\w+\.png"
)
#: What the finished tasks of a study are kept in. A kill while a store
#: is made leaves the journal of what was under way; the next command undoes that.
KEPT = {f"points.{end}" for end in ("sqlite", "sqlite-wal", "sqlite-shm", "sqlite-journal", "lock")} | {"files.lock"}
#: Tables that are not finished.
TEMPORARY = re.compile(r"\.[\w-]+-[0-9a-f]{16}\.(parquet|csv|json|png)")


def read(path):
    """Read a file under a final name to its end; raises where it is not whole."""
    if path.suffix == ".parquet":
        return pd.read_parquet(path)
    if path.suffix == ".csv":
        text = path.read_text()
        assert text.endswith("\n"), f"{path.name} breaks off"
        return pd.read_csv(path)
    if path.suffix == ".json":
        return json.loads(path.read_text())
    content = path.read_bytes()
    assert content.startswith(b"\x89PNG\r\n\x1a\n"), f"{path.name} is no figure"
    assert content.endswith(b"IEND\xaeB`\x82"), f"{path.name} breaks off"
    return content


def left(directory):
    """Read all that is under final names; return it by name, and the names of temporaries."""
    found, temporaries = {}, []
    for path in sorted(directory.iterdir()) if directory.is_dir() else ():
        if TEMPORARY.fullmatch(path.name):
            temporaries.append(path.name)
        elif path.name not in KEPT:
            assert FINAL.fullmatch(path.name), f"{path.name} is none of ours"
            found[path.name] = read(path)
    return found, temporaries


def unproven(directory):
    """Forget the digests of a result's files, so that its tables may be changed."""
    path = directory / "provenance.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "files": None}))
    return directory


def edited(directory, name, /, **changes):
    """Change entries of a JSON file of a result; None takes one out."""
    path = directory / f"{name}.json"
    entries = json.loads(path.read_text()) | changes
    path.write_text(json.dumps({key: value for key, value in entries.items() if value is not None}))
    return directory


def of_kind(directory, kind):
    """Let the plan of a sweep ask for another figure."""
    tree = json.loads((directory / "provenance.json").read_text())["configuration"]
    return edited(directory, "provenance", configuration=tree | {"sweep": tree["sweep"] | {"kind": kind}})


def bits(table):
    """All of a table but wall times, each number as the text that reads back as the same number."""
    return table.drop(columns="wall_s", errors="ignore").to_csv(index=False)


def finished_points(directory, text=""):
    """Number of points that a running sweep has on disk, of those with a text in them."""
    try:
        (file,) = directory.glob("*.sqlite") if directory.is_dir() else ["nothing"]
        base = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        try:
            return base.execute("SELECT COUNT(*) FROM records WHERE instr(record, ?)", (text,)).fetchone()[0]
        finally:
            base.close()
    except (sqlite3.OperationalError, ValueError):
        return 0
