"""Builds the wheel: with the machine code of all kernels if VIBROPLAT_COMPILE is set, so that no run compiles any.

``VIBROPLAT_COMPILE=1 pip wheel --no-deps .`` takes about a minute and makes a wheel for this version of Python and
this kind of machine (cp311-cp311-linux_x86_64). Without the variable the wheel runs everywhere, and each machine
compiles what it needs at its first run, so that ``pip install .`` need not wait for kernels that are perhaps never
called. Editable installs have no machine code: their sources change.

There is no list of kernels: the commands below are run, and what is then in the cache goes into the wheel. The cache is
that of ``NUMBA_CACHE_DIR``, or an empty one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SHORT = ("--set", "run.duration_s=0.3")
SWEEP = ("--set", "sweep.supply_frequency_hz={start: 46.0, stop: 48.0, step: 2.0}", "--set", "sweep.max_settle_s=2.0")
FEW = ("--set", "basins.initial_conditions={run.initial.phase_difference_rad: [-3.0, 3.0, 4]}")
#: Commands that compute, of each kind, for an engine; the second argument is a file in the folder of configurations.
COMMANDS = {
    "native": (
        ("run", "quickstart.yaml", *SHORT),
        ("sweep", "quickstart.yaml", *SWEEP),
        ("orbits", "examples/branches.yaml", "--set", "orbits.stop=42.5"),
        ("basins", "examples/basins.yaml", *FEW),
    ),
    "taylor": (
        ("run", "quickstart.yaml", *SHORT),
        ("orbits", "examples/branches.yaml", "--set", "orbits.stop=46.0"),
        ("orbits", "examples/boundaries-mass.yaml", "--set", "orbits.stop=46.0"),
        ("basins", "examples/basins.yaml", *FEW),
        ("sweep", "quickstart.yaml", *SWEEP, "--check"),
    ),
}
#: Motions side by side on processors with shorter vectors; those of this machine are computed besides.
SHORTER = {"VIBROPLAT_LANES": "4"}
#: What can be computed from Python alone.
PYTHON = """
from vibroplat import load_config, lyapunov, simulate, variation
scene = load_config({config!r}, {{"solver.engine": {engine!r}, "run.duration_s": 0.3}})
run = simulate(scene)
run(0.1), run.trajectory, run.section, variation(scene, keys="machine.stiffness_y_n_per_m"), lyapunov(scene)
"""


def compile_all(root: Path, place: Path) -> Path:
    """Run it all with results in a place, and return the folder with the machine code."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    kept_in = os.environ.get("NUMBA_CACHE_DIR", str(place))
    environment = own | {"NUMBA_CACHE_DIR": kept_in, "NUMBA_DISABLE_INTEL_SVML": "1"}
    configs = root / "configs"

    def compute(engine: str) -> None:
        lines = [
            ["-m", "vibroplat", name, configs / config, *options, "--engine", engine, "--out", place / f"{engine}-{i}"]
            for i, (name, config, *options) in enumerate(COMMANDS[engine])
        ]
        lines.append(["-c", PYTHON.format(engine=engine, config=str(configs / "quickstart.yaml"))])
        for line in lines:
            # in this folder Python finds the package here, even if another one is installed
            for lanes in ({}, SHORTER) if "basins" in line else ({},):
                kept = environment | lanes
                subprocess.run([sys.executable, *line], cwd=root, env=kept, check=True, stdout=subprocess.DEVNULL)

    with ThreadPoolExecutor() as pool:
        list(pool.map(compute, COMMANDS))
    line = [sys.executable, "-c", "from vibroplat.kernels.cache import folder; print(folder())"]
    told = subprocess.run(line, cwd=root, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    return Path(told.stdout.strip())


class CustomBuildHook(BuildHookInterface):
    """Adds machine code to the wheel if ``VIBROPLAT_COMPILE`` asks for it."""

    def dependencies(self) -> list[str]:
        """Return what has to be installed for compiling: all that the package needs."""
        return self.metadata.core.dependencies if self._asked() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile all kernels, and add their machine code to the wheel."""
        if version == "editable" or not self._asked():
            return
        self._folder = tempfile.mkdtemp(prefix="vibroplat-wheel-")
        made = compile_all(Path(self.root), Path(self._folder))
        for file in made.glob("*.bin"):
            build_data["force_include"][str(file)] = f"vibroplat/kernels/machine_code/{made.name}/{file.name}"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the results of the commands."""
        shutil.rmtree(getattr(self, "_folder", ""), ignore_errors=True)

    @staticmethod
    def _asked() -> bool:
        return os.environ.get("VIBROPLAT_COMPILE", "") not in ("", "0")
