"""What several files of these tests share."""

from pathlib import Path

MACHINE = Path(__file__).with_name("machine.yaml")
MASS = "material.mass_ratio"
PLAN = {
    "key": "drive.supply_frequency_hz",
    "start": 47.0,
    "stop": 49.0,
    "step": {"first": 0.4, "max": 0.5},
    "grid": {MASS: [0.0, 0.1]},
}
#: Supply frequency of the machine at which material of a tenth of its mass lifts off (Hz).
LIFTOFF = 48.176451
