"""Builds the wheel: with the machine code of all kernels if VIBROPLAT_COMPILE is set, so that no run compiles any.

``VIBROPLAT_COMPILE=1 pip wheel --no-deps .`` takes about two minutes and makes a wheel for this Python and this kind of
machine (cp311-cp311-linux_x86_64). Without it the wheel is the same for all, and each machine compiles what it needs at
its first run: ``pip install .`` would otherwise wait for kernels that its user may never call. Editable installs never
bring machine code, as their sources change.

Which kernels there are is not listed: the commands below are run, and what they compile is taken.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SHORT = ("--set", "run.duration_s=0.3")
SWEEP = ("--set", "sweep.supply_frequency_hz={start: 46.0, stop: 48.0, step: 2.0}", "--set", "sweep.max_settle_s=2.0")
#: A command of each kind that computes; the second argument is in the folder of configurations.
COMMANDS = (
    ("run", "quickstart.yaml", "--engine", "native", *SHORT),
    ("run", "quickstart.yaml", "--engine", "taylor", *SHORT),
    ("sweep", "quickstart.yaml", "--engine", "native", *SWEEP),
    ("sweep", "quickstart.yaml", "--engine", "taylor", *SWEEP, "--set", "sweep.confirm=orbits", "--check", "0.3"),
    ("orbits", "examples/branches.yaml", "--engine", "taylor", "--set", "orbits.stop=46.0"),
    ("orbits", "examples/boundaries-mass.yaml", "--engine", "taylor", "--set", "orbits.stop=46.0"),
    ("orbits", "examples/branches.yaml", "--engine", "native", "--set", "orbits.stop=42.5"),
)
#: The same from Python: what no command does.
PYTHON = """
from vibroplat import load_config, lyapunov, simulate, variation
for engine in ("native", "taylor"):
    scene = load_config({config!r}, {{"solver.engine": engine, "run.duration_s": 0.3}})
    run = simulate(scene)
    run(0.1), run.trajectory, run.section, variation(scene, keys="machine.stiffness_y_n_per_m"), lyapunov(scene)
"""


def compile_all(root: Path, place: Path) -> Path:
    """Run it all, and return the folder of what it compiled."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    environment = own | {"NUMBA_CACHE_DIR": str(place), "NUMBA_DISABLE_INTEL_SVML": "1"}
    configs = root / "configs"
    lines = [
        ["-m", "vibroplat", name, str(configs / config), *options, "--out", str(place / f"results-{i}")]
        for i, (name, config, *options) in enumerate(COMMANDS)
    ]
    for line in (*lines, ["-c", PYTHON.format(config=str(configs / "quickstart.yaml"))]):
        # Python looks through the folder it is started in first, whatever is installed
        subprocess.run([sys.executable, *line], cwd=root, env=environment, check=True, stdout=subprocess.DEVNULL)
    (made,) = (place / "vibroplat").glob("kernels-*")
    return made


class CustomBuildHook(BuildHookInterface):
    """Adds machine code to the wheel, where it is asked for."""

    def dependencies(self) -> list[str]:
        """Return what compiling takes: all that the package needs."""
        return self.metadata.core.dependencies if self._asked() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and add what was compiled."""
        if version == "editable" or not self._asked():
            return
        self._folder = tempfile.mkdtemp(prefix="vibroplat-wheel-")
        made = compile_all(Path(self.root), Path(self._folder))
        for file in made.glob("*.bin"):
            if ".inside-" not in file.name:  # for compiling other kernels
                build_data["force_include"][str(file)] = f"vibroplat/kernels/machine_code/{made.name}/{file.name}"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what is in the wheel now."""
        shutil.rmtree(getattr(self, "_folder", ""), ignore_errors=True)

    @staticmethod
    def _asked() -> bool:
        return os.environ.get("VIBROPLAT_COMPILE", "") not in ("", "0")
