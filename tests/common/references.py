"""Reference motions in files, known to 1e-12.

Each is ``NAME.yaml`` (the scene), ``NAME.trajectory.csv`` (without rows at events) and ``NAME.events.csv``.
"""

import pandas as pd

from common.places import ROOT
from vibroplat import load_config
from vibroplat.bench.measure import Reference

REFERENCES = ROOT / "tests/reference"


def load_reference(name):
    trajectory, events = (pd.read_csv(REFERENCES / f"{name}.{kind}.csv") for kind in ("trajectory", "events"))
    return Reference(name, load_config(REFERENCES / f"{name}.yaml"), trajectory, events)
