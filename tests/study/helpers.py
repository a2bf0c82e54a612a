"""What several files of these tests share."""

from pathlib import Path

from vibroplat import load_config, sweep
from vibroplat.study.pool import Task

#: A bare machine.
MACHINE = Path(__file__).parents[1] / "machines" / "damped.yaml"
#: Two of the machines that are shipped.
DAMPED = Path(__file__).parents[2] / "configs" / "machines" / "damped.yaml"
CALIBRATED = DAMPED.with_name("calibrated.yaml")

#: Non-periodic motion of the machine.
CHAOTIC = {"material.mass_ratio": 0.2, "material.damping_ratio": 0.005, "drive.supply_frequency_hz": 62.5}


def planned(config, start, stop=None, *, step=0.5, direction="up", changes=None, **plan):
    """Load a configuration as a sweep over these supply frequencies; ``plan`` are other keys of ``sweep``."""
    frequencies = {"start": start, "stop": start if stop is None else stop, "step": step, "direction": direction}
    scene = load_config(config).model_copy(update={"sweep": None})
    return scene.replace({**(changes or {}), "sweep": {"supply_frequency_hz": frequencies, **plan}})


def swept(config, start, stop=None, **options):
    """Sweep a configuration in this process; see :func:`planned`."""
    return sweep(planned(config, start, stop, **options)).sweep


class Calls:
    """A chain of calls that are known beforehand."""

    def __init__(self, *calls):
        self.calls = calls
        self.results = []

    @property
    def next(self):
        return None if self.done else Task(*self.calls[len(self.results)])

    @property
    def done(self):
        return len(self.results) == len(self.calls)

    def accept(self, result):
        self.results.append(result)
