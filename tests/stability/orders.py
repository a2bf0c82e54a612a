"""Every public function after every other, for every kind of scene and engine, in one process.

What a process has computed before must not change a bit of what it computes. As a program it goes through random orders
until each function with each kind of scene has come directly after each other one, and prints what it found::

    PYTHONPATH=tests python -m stability.orders --calls 4000
"""

import argparse
import random

import numpy as np
import pandas as pd
from common.places import ROOT

import vibroplat
from vibroplat import load_config
from vibroplat.config.engines import ENGINES
from vibroplat.errors import VibroplatError

#: Columns that differ from call to call.
TIMES = {"wall_s", "cpu_s"}
SUPPLY = "drive.supply_frequency_hz"
STIFFNESS = "machine.stiffness_y_n_per_m"
#: Kinds of scenes: keys over those of the calibrated machine.
KINDS = {
    "bare": {"material.mass_ratio": 0.0},
    "one layer": {"material": {"mass_ratio": 0.1, "layers": 1}, "contact.restitution": 0.3},
    "two layers": {"material.mass_ratio": 0.2},
    "transport": {},
    "unequal": {"motors": [{"critical_torque_n_m": 1.2}, {"critical_torque_n_m": 1.1}], "material.mass_ratio": 0.1},
    "program": {
        "drive": {"program": [{"t_s": 0, SUPPLY.partition(".")[2]: 50.0}, {"t_s": 0.05, "off": True}]},
        "material.mass_ratio": 0.1,
    },
}
#: What studies are asked, as little as they take.
PLANS = {
    "sweep": {
        "over": {"key": STIFFNESS, "start": 470e3, "stop": 480e3, "count": 2},
        "max_settle_s": 0.5,
        "measure_s": 0.3,
    },
    "orbits": {"key": SUPPLY, "start": 46.0, "stop": 46.2, "max_points": 3},
    "find": {"key": STIFFNESS, "start": 460e3, "stop": 480e3, "scan": 2, "expression": "rms_y_m > 0.1"},
    "basins": {"initial_conditions": {"run.initial.phase_difference_rad": [-3.0, 3.0, 4]}, "max_turns": 200},
    "design": {"measures": ["rms_y_m"], "parameter_tolerances": {STIFFNESS: 0.01}, "samples": 2},
}


def scene_of(kind, engine):
    """Return the scene of a kind."""
    changes = KINDS[kind] | {"solver.engine": engine, "run.duration_s": 0.15} | PLANS
    base = "configs/examples/conveying.yaml" if kind == "transport" else "configs/machines/calibrated.yaml"
    supply = {} if kind in ("program", "transport") else {SUPPLY: 46.0}
    return load_config(ROOT / base, changes | supply)


def _of_run(scene):
    run = vibroplat.simulate(scene)
    return [run.trajectory, run.events, run(np.array([0.05, 0.1]))]


def _of_orbit(scene):
    found = vibroplat.orbit(scene)
    return [found.state, found.multipliers]


def _of_study(name):
    return lambda scene: list(getattr(vibroplat, name)(scene).tables.values())


#: Public functions, and what they return in numbers.
FUNCTIONS = {
    "simulate": _of_run,
    "orbit": _of_orbit,
    "variation": lambda scene: [vibroplat.variation(scene, keys=STIFFNESS).derivative],
    "lyapunov": lambda scene: [vibroplat.lyapunov(scene)],
    "check_run": lambda scene: [vibroplat.check_run(scene)],
    **{name: _of_study(name) for name in PLANS},
}


def bits(function, kind, engine):
    """Call a function with a scene of a kind, and return all bits of its result, or the line of its refusal."""
    try:
        found = FUNCTIONS[function](scene_of(kind, engine))
    except VibroplatError as refusal:
        return str(refusal)
    return "\n".join(_text(part) for part in found)


def _text(part):
    if isinstance(part, np.ndarray):
        return part.tobytes().hex()
    if isinstance(part, pd.DataFrame):
        return part.drop(columns=list(TIMES & set(part.columns))).to_csv()
    return str(part)


def cases():
    """List functions with kinds of scenes and engines; what makes many motions takes too long with ``sundae``."""
    studies = {*PLANS, "lyapunov"}
    return [
        (function, kind, engine)
        for function in FUNCTIONS
        for kind in KINDS
        for engine in ENGINES
        if engine != "sundae" or function not in studies
    ]


def tour(calls, seed=0):
    """Yield cases in a random order in which each comes directly after each other one before any does so twice."""
    rng, every = random.Random(seed), cases()
    others = {case: rng.sample(every, len(every)) for case in every}
    case = rng.choice(every)
    for _ in range(calls):
        yield case
        others[case] = others[case] or rng.sample(every, len(every))
        case = others[case].pop()


def changed(order, known):
    """Call cases in an order; yield each with the one before it if its bits are not the ``known`` ones."""
    before = None
    for case in order:
        found = bits(*case)
        if known.setdefault(case, found) != found:
            yield before, case
        before = case


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--calls", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    bad = list(changed(tour(given.calls, given.seed), {}))
    print(f"{given.calls} calls of {len(cases())} functions with scenes; with other bits than at first: {len(bad)}")
    for before, case in bad:
        print(f"{case} after {before}")


if __name__ == "__main__":
    main()
