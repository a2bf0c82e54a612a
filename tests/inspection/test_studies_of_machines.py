"""Studies of machines as one buys them, without an engine: an answer, or a reason that is about the machine."""

import re

import pytest

from inspection.machines import machine
from vibroplat import basins, design, find, orbits
from vibroplat.errors import VibroplatError

SUPPLY = "drive.supply_frequency_hz"


def studies(supply):
    """Yield functions of studies and their plans, short ones."""
    settling = {"max_settle_s": 3.0, "measure_s": 0.5}
    yield design, {"parameter_tolerances": {"machine.stiffness_y_n_per_m": 0.05}, "samples": 4}
    yield orbits, {"key": SUPPLY, "start": supply, "stop": 0.97 * supply, "max_points": 6, "grid": {}}
    yield find, {"key": SUPPLY, "start": 0.95 * supply, "stop": supply, "scan": 2, "compare": "regime", **settling}
    yield (
        basins,
        {"initial_conditions": {"run.initial.phase_difference_rad": [-3.0, 3.0]}, "random": 4, "max_turns": 100},
    )


@pytest.mark.long
@pytest.mark.parametrize("number", [0, 7, 11])
def test_no_study_fails_because_of_its_engine(number):
    scene = machine(number).replace({"solver.engine": "auto"})
    reasons = list[str]()
    for study, plan in studies(scene.drive.largest_frequency):
        try:
            answer = study(scene.replace({study.__name__: plan})).answer
        except VibroplatError as error:
            reasons.append(str(error))
            continue
        assert answer.headline
        assert "computed by engine taylor" in answer.notes[0]
        assert not [line for line in answer.failures if "solver-failure" in line]
    assert not re.search("engine|solver-failure|residuals", " ".join(reasons)), reasons
