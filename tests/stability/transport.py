"""Random scenes in which the material slides along the deck."""

import math

import numpy as np
from common.random_scenes import random_scene

from stability.campaign import FINER, FINEST, LESS, are_apart, explained, paired
from stability.checks import NAMED, row, sound, with_engine
from vibroplat.check import with_other_engine
from vibroplat.hybrid.state import FORCE_ERROR
from vibroplat.motion.run import simulate

#: Part of the steepest slope on which friction holds the material that decks have at most.
STEEPEST = 0.95
#: Largest rate against the sense of slip, over the scale of speeds and the root of the tolerance.
AGAINST = 0.1
#: Times at which motions are compared with the accurate one.
SAMPLES = 200


def transport(count, engine):
    """Run random scenes with friction: each ends by name, forces stay in Coulomb's cone, balances close.

    Those of ``native`` are also run by the other engine. Where sequences of events or ends differ, the check of a run
    decides: it allows what repetitions with other tolerances and disturbed starts show errors to grow to, down to
    tolerances of 1e-12, and events that such an error adds or removes (``vibroplat.check.events.marginal_events``).
    What is left is a failure, unless finer runs come to the accurate motion (:func:`converges`).
    """
    return [judged_moving(number, engine) for number in range(count)]


def converges(scene):
    """Whether finer runs come nearer to the accurate motion, at least as the root of their tolerance, until they part.

    Errors of all steps add up where a hardly damped layer rings for hundreds of periods, of which repetitions of the
    run show little.
    """
    exact = simulate(scene.replace({"solver": {"engine": "taylor", "tolerance": FINEST}}))
    tolerances = [share * scene.solver.tolerance for share in (1.0, *FINER[:2])]
    runs = [simulate(scene.replace({"solver.tolerance": tolerance})) for tolerance in tolerances]
    until = min(min(paired(run, exact).differ_s, run.summary["simulated_s"]) for run in runs)
    times = np.linspace(0.0, 0.9 * min(until, exact.summary["simulated_s"]), SAMPLES)
    there = [run(times)[["gap_m", "along_m", "y_m"]] for run in (exact, *runs)]
    errors = np.array([np.abs(found - there[0]).max() for found in there[1:]])
    least = tolerances[0] * scene.length_scale
    return bool((errors[1:] <= np.maximum(LESS * FINER[0] ** 0.5 * errors[:-1], least)).all())


def moving(number):
    """Draw a scene with transport; the number determines it."""
    scene, rng = random_scene(number), np.random.default_rng((77, number))
    friction = 0.0 if rng.random() < 0.08 else float(10.0 ** rng.uniform(-1.3, 0.3))
    static = friction * (1.0 if rng.random() < 0.5 else float(rng.uniform(1.0, 1.6)))
    steepest = math.degrees(math.atan(static))
    angle = 0.0 if rng.random() < 0.3 else STEEPEST * steepest * float(rng.uniform(-1.0, 1.0))
    height = 0.0 if rng.random() < 0.3 else 0.5 * scene.body.distance * float(rng.uniform(-1.0, 1.0))
    section = {"friction": friction, "static_friction": static, "deck_angle_deg": angle, "deck_height_m": height}
    changes = {"transport": section, "contact.model": "impact", "contact.impact_law": "conservative"}
    if not scene.material.mass_ratio:
        changes |= {"material.mass_ratio": float(10.0 ** rng.uniform(-2.0, 0.0)), "material.layers": 1}
    return scene.replace(changes | {"solver.tolerance": 1e-8})


def judged_moving(number, engine):
    scene = with_engine(moving(number), engine)
    run = simulate(scene)
    limits = sound(scene, run.summary)
    if run.outcome in ("ok", "inaccurate"):
        table, friction = run.trajectory, scene.transport.largest_friction
        beyond = table["friction_force_n"].abs() - friction * table["contact_force_n"].clip(lower=0.0)
        most = max(limits["pull_n"][1], FORCE_ERROR * scene.force_scale) * max(1.0, friction)
        limits["cone_n"] = (max(float(beyond.max()), 0.0), most)
        speed = AGAINST * math.sqrt(scene.solver.tolerance) * scene.length_scale * scene.speed_scale
        for sign, mode in ((1.0, "slip+"), (-1.0, "slip-")) if friction else ():
            rates = sign * table.loc[table["mode"] == mode, "along_rate_m_per_s"]
            limits[f"against {mode}"] = (max(-float(rates.min()), 0.0) if len(rates) else 0.0, speed)
    if engine == "native" and are_apart(run, simulate(with_other_engine(scene), keep="events")):
        limits["disagreements"] = (float(not (explained(scene).agrees or converges(scene))), 0.0)
    return row(scene.name, run.outcome, limits, allowed=NAMED)
