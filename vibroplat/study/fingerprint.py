"""What the bits of a result depend on besides its task: code, libraries, and the arithmetic of the machine.

Points that two versions of the package have measured look alike and differ. Each task therefore travels with the
fingerprint of the process that sent it, and a worker with another one refuses it, whenever that worker has joined. For
the same reason a study is resumed only where code and arithmetic are those that began it.

Machines are compared by what they compute, not by the names of their processors. Kernels are compiled for a generic
processor, and all machines that can run that code give the same bits; on others a product and a sum may be rounded
otherwise. And the C library, numpy and BLAS choose variants of their functions by processor, which differ in the last
bits. Basins also depend on how many motions go side by side (:func:`vibroplat.kernels.target.lanes`): an attractor that
one of them finds is known to the others from then on, and how far they are by then depends on their number.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import math
import os
import pickle
import platform
import sys
from collections.abc import Mapping
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

import vibroplat
from vibroplat.config.scene import Scene
from vibroplat.integrate import make_engine, native_library
from vibroplat.kernels.target import lanes, processor
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator
from vibroplat.observe.measures import WITH_EXTREMES
from vibroplat.report.summary import measure
from vibroplat.results.provenance import sundials_version
from vibroplat.system.workers import one_thread

Fingerprint = Mapping[str, str]

#: Libraries that compute.
LIBRARIES: Final = ("scikit-sundae", "numpy", "scipy", "numba", "llvmlite")
#: What records of a study were made with: code and arithmetic.
NAMES: Final = ("vibroplat", "source files", "Python", "platform", *LIBRARIES, "LAPACK", "lanes", "arithmetic")
#: A motion with impacts, which multiply a change of the last bit, and how long it is followed (s).
REFERENCE: Final = {
    "material": {"mass_ratio": 0.2, "layers": 1},
    "contact.restitution": 0.3,
    "drive.supply_frequency_hz": 55.0,
}
REFERENCE_S = 0.5
#: How many numbers each function is tried with.
TRIAL_COUNT = 2000
#: Rows of the matrix that LAPACK is tried with.
LAPACK_SIZE = 60


def run_checked(expected: Fingerprint, work: bytes) -> dict[str, Any]:
    """Do a task on a worker, if it would give the same bits in the process that sent it.

    ``work`` is the pickled task, function and arguments. It is unpickled last, as other code could not read it. The
    answer holds its ``result``, the ``error`` that it raised, or why it was ``refused``.
    """
    # machine code is compiled and run for the arithmetic, which is not worth the time where anything else differs
    other = difference(expected, code()) or difference(expected, fingerprint())
    if other:
        return {"refused": f"process {os.getpid()} on {platform.node()}: {other}"}
    try:
        function, arguments = pickle.loads(work)
        with one_thread():
            return {"result": function(*arguments)}
    except Exception as error:
        return {"error": error}


def fingerprint() -> Fingerprint:
    """Return all that the bits of a result depend on besides its task, by name."""
    return code() | {"arithmetic": arithmetic(), "LAPACK": lapack(), "lanes": str(lanes())}


def difference(expected: Fingerprint, actual: Fingerprint) -> str:
    """Say what differs among the names that both have; "" where nothing does."""
    differing = [name for name in expected if name in actual and actual[name] != expected[name]]
    return ", ".join(f"{name} {actual[name]} (here {expected[name]})" for name in differing)


@cache
def code() -> dict[str, str]:
    """Return versions of code, libraries and platform, by name, and which engine ``native`` is."""
    return package() | {
        "SUNDIALS": sundials_version() or "unknown",
        "engine": "sundae" if native_library() is None else "native",
    }


@cache
def package() -> dict[str, str]:
    """Return versions of code, libraries and platform, by name, as far as they can be told without SUNDIALS."""
    return {
        "vibroplat": vibroplat.__version__,
        "source files": _sources()[:16],
        "Python": f"{platform.python_implementation()} {sys.version_info.major}.{sys.version_info.minor}",
        "platform": f"{platform.system()} {platform.machine()}",
        **{name: importlib.metadata.version(name) for name in LIBRARIES},
    }


@cache
def arithmetic(engine: str = "native") -> str:
    """Digest what this machine computes: a short motion by an engine, and the functions of libraries."""
    text = json.dumps([_motion(engine), _functions()])  # that of a number gives back its bits
    return f"{hashlib.sha256(text.encode()).hexdigest()[:16]} on {processor()[0]}"


@cache
def lapack() -> str:
    """Digest what scipy's own LAPACK computes, which optimizes designs."""
    from scipy import linalg  # noqa: PLC0415  (a quarter of a second to import)

    a = np.random.default_rng(0).uniform(0.0, 1.0, (LAPACK_SIZE, LAPACK_SIZE))
    with one_thread():
        results = [linalg.solve(a, a[0]), linalg.lstsq(a[:, ::2], a[0])[0], linalg.qr(a)[1]]
    return hashlib.sha256(b"".join(part.tobytes() for part in results)).hexdigest()[:16]


def _sources() -> str:
    """Digest of the package's source files."""
    package = Path(vibroplat.__file__).parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        text = source.read_bytes()
        digest.update(f"{source.relative_to(package).as_posix()} {len(text)} ".encode() + text)
    return digest.hexdigest()


def _motion(engine: str) -> list[Any]:
    """Return what is measured of the reference motion, and its last state."""
    scene = Scene().replace(REFERENCE | {"solver.engine": engine})
    p = parameters(scene)
    with closing(make_engine(scene, p)) as integrator:
        motion = Simulator(scene, p, integrator)
        part = motion.advance(REFERENCE_S, scope=WITH_EXTREMES)
        return [motion.outcome, motion.events, motion.state.tolist(), measure(part, scene)]


def _functions() -> list[Any]:
    """Return values of the functions of libraries that tasks use."""
    x = np.random.default_rng(0).uniform(0.0, 10.0, TRIAL_COUNT)
    pairs = list(zip(x.tolist(), x[::-1].tolist(), strict=True))
    one = [[f(a) for a, _ in pairs] for f in (math.sin, math.cos, math.exp, math.log, math.log2)]
    two = [[f(a, b) for a, b in pairs] for f in (math.pow, math.atan2, math.hypot)]
    arrays = [f(x).tolist() for f in (np.sin, np.cos, np.exp, lambda a: np.angle(np.exp(1j * a)))]
    norms = [float(np.linalg.norm(row)) for row in x.reshape(-1, 10)]
    return [one, two, arrays, norms, np.linalg.inv(x[:196].reshape(14, 14)).tolist(), float(x.sum())]
