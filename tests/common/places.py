"""Files of the repository that tests use."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
#: The quickstart with the default engine.
QUICKSTART = ROOT / "tests/common/quickstart.yaml"
#: A machine with two layers of material on it.
LOADED = ROOT / "tests/study/loaded.yaml"
#: Head of a configuration with it.
FLYING = f"extends: {LOADED}\n"
#: The same with a sweep of 22 points up and down, whose section may be gone on with.
SWEPT = (
    f"extends: {LOADED}\nname: c\nrun: {{duration_s: 0.3}}\nsweep:\n"
    "  supply_frequency_hz: {start: 46.0, stop: 51.0, step: 0.5, direction: [up, down]}\n  measure_s: 0.5\n"
)
