"""Files of the repository that tests use."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
QUICKSTART = ROOT / "configs/quickstart.yaml"
#: A machine with two layers of material on it.
LOADED = ROOT / "tests/study/loaded.yaml"
#: Head of a configuration with it.
FLYING = f"extends: {LOADED}\n"
