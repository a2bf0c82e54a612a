"""Records how a result was made."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import vibroplat
from vibroplat.config.scene import Scene
from vibroplat.results.files import SCHEMA, hash_of

#: Entries of provenance on which the numbers of a result depend.
_SAME = ("vibroplat", "source_files", "configuration_sha256", "python", "platform", "libraries", "begins_from")
_LIBRARIES = ("scikit-sundae", "numpy", "numba", "llvmlite", "pandas", "pydantic", "pyarrow", "ruamel.yaml")


def provenance(scene: Scene, engine: str, origin: dict[str, Any] | None = None) -> dict[str, Any]:
    """Collect versions, the machine and the full configuration of a result, and the run that it continues from."""
    begins = {} if origin is None else {"begins_from": origin}
    return begins | {
        "schema": SCHEMA,
        "vibroplat": vibroplat.__version__,
        "git_commit": _commit(),
        "source_files": _sources(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "configuration_sha256": configuration_hash(scene),
        "engine": engine,
        "sundials": sundials_version(),
        "tolerance": scene.solver.tolerance,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "libraries": {name: _version(name) for name in _LIBRARIES},
        "configuration": scene.to_tree(),
    }


def is_current(saved: Mapping[str, Any], scene: Scene, origin: dict[str, Any] | None = None) -> bool:
    """Return whether a result with this provenance is what the present code would compute from a scene."""
    now = provenance(scene, "", origin)
    return all(saved.get(name) == now.get(name) for name in _SAME)


def configuration_hash(scene: Scene) -> str:
    """SHA-256 of the resolved configuration, independent of how it was written."""
    return hash_of(scene.to_tree())


def _sources() -> str:
    """Digest names, sizes and times of the package's source files."""
    package = Path(vibroplat.__file__).parent
    stats = [(file.relative_to(package).as_posix(), file.stat()) for file in sorted(package.rglob("*.py"))]
    stamps = [(name, one.st_size, one.st_mtime_ns) for name, one in stats]
    return hashlib.sha256(repr(stamps).encode()).hexdigest()[:16]


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def sundials_version() -> str | None:
    """Version of SUNDIALS inside scikit-sundae, if it can be read."""
    from vibroplat.integrate.sundials import UnavailableError, configuration  # noqa: PLC0415

    try:
        return configuration().get("SUNDIALS_VERSION")
    except UnavailableError:
        return None


def _commit() -> str | None:
    """Git commit of the package, with ``+`` if files have changed; None outside a checkout."""
    file = Path(__file__)
    here = file.parents[1]

    def git(*arguments: str) -> str:
        # a process that is killed meanwhile must not leave a lock in the repository
        command = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false", "-C", str(here), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=5).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", str(file.relative_to(here)))
        changed = git("status", "--porcelain", "--untracked-files=no", "--", ".")
        return git("rev-parse", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None
