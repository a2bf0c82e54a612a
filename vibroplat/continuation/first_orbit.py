"""The search for a first orbit: guesses, Newton's method from each of them, and why none was found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from vibroplat.config.circular import wrap
from vibroplat.config.coordinates import TURN
from vibroplat.config.engine_choice import FAILED, may_succeed
from vibroplat.continuation.newton import NewtonResult, NoConvergenceError, Problem, correct_moving_section
from vibroplat.continuation.shooting import Shooter
from vibroplat.errors import VibroplatError
from vibroplat.kernels.compiled import FloatArray
from vibroplat.motion.initial_condition import initial_condition

#: Turns of exciter 1 after which a motion that settles is tried as a guess, one after the other.
SETTLING_TURNS = (24, 96, 384)
#: Residual of a motion that has settled, in scaled units, beyond which it does not repeat.
MAX_SETTLED_RESIDUAL = 1e-3
#: What helps then.
ADVICE = "continue one from where the motion is periodic (vibroplat orbits), or pass a guess"
#: Relative difference of the period by the speed on the section from that by the next turns, up to which it is as good.
MAX_RIPPLE = 0.02
#: Residual, over the tolerance, within which an orbit repeats after fewer turns.
REPEAT_RATIO = 1e4
#: Periods over which turns of both exciters are compared where no orbit is found, and how far from whole they may be.
COMPARED_PERIODS, MAX_SLIP_TURNS = 1000, 4e-4


class OrbitError(VibroplatError):
    """No periodic orbit was found; the message contains the cause and the last residuals."""

    exit_code = 2


class MissedOrbitError(OrbitError):
    """Newton's method did not converge, or the integrator failed: another engine may find an orbit."""


def first_orbit(
    shooter: Shooter, guess: FloatArray | None, period: int, units: Sequence[float], tolerance: float
) -> tuple[Problem, NewtonResult]:
    """Find an orbit near a full state, or the motion that settles, at the values that the shooter has."""
    missed = NoConvergenceError("")
    for tries, state in enumerate(chain(guesses(shooter, guess), shooter.returns(period) if guess is None else ())):
        try:
            problem, result = _from_state(shooter, state, period, units, tolerance)
        except NoConvergenceError as error:
            missed = error
            continue
        turns = smallest_period(problem, result, period)
        if turns == period:
            return problem, result
        if tries < len(SETTLING_TURNS):  # or a return, and the next one may be another orbit
            raise OrbitError(f"orbits.period = {period} but the motion repeats after {turns}; allowed: {turns}")
    last = ", ".join(f"{r:.1e}" for r in missed.residuals[-4:]) or "none"
    reason = _describe_slip(shooter, state, period)
    repeats = guess is not None or (missed.residuals and missed.residuals[0] <= MAX_SETTLED_RESIDUAL)
    why = missed.why
    if not repeats:
        why = f"the motion that settles does not repeat after {period} turns; {missed.why}; {ADVICE}"
    text = f"no orbit of period {period} near the guess: {reason or why}; last residuals: {last}"
    if reason or (missed.residuals and not repeats):  # it is the motion, whatever the engine
        raise OrbitError(text)
    raise MissedOrbitError(text + may_succeed(shooter.scene))


def _describe_slip(shooter: Shooter, state: FloatArray, period: int) -> str:
    """Say so if exciter 2 does not make whole turns in a period of the motion from a state; else ""."""
    scene = shooter.scene
    shot = shooter.shot(state, COMPARED_PERIODS * period * TURN / scene.speed_scale)
    first, second = shot.state[3:5] - state[3:5]
    turns = period * second / max(abs(first), TURN)
    if shot.outcome != "ok" or abs(first) < TURN or abs(turns - round(turns)) < MAX_SLIP_TURNS:
        return ""
    poles = [exciter.pole_pairs for exciter in scene.exciter_pair]
    unequal = f"; their motors have {poles[0]} and {poles[1]} pole pairs" if poles[0] != poles[1] else ""
    return (
        f"exciters are not synchronized: exciter 2 makes {abs(turns):.4g} turns in {period} of exciter 1; allowed: "
        f"whole turns{unequal}"
    )


def guesses(shooter: Shooter, guess: FloatArray | None) -> Iterator[FloatArray]:
    """Yield full states on the section, φ₁ = 0, to begin with: after a state, or while the motion settles."""
    scene, motion = shooter.scene, shooter.motion
    if guess is None:
        motion.reset(initial_condition(scene).state)
        done = 0
        for turns in SETTLING_TURNS:
            motion.to_section(turns - done, 4.0 * turns * TURN / scene.speed_scale)
            done = turns
            if motion.outcome != "ok":
                kind = MissedOrbitError if motion.outcome in FAILED else OrbitError
                raise kind(f"the motion ended while it settled: {motion.outcome}: {motion.detail}")
            state = motion.state
            yield state
            motion.reset(state)  # the search has moved it
        return
    motion.reset(guess)
    if not motion.to_section(1, 4.0 * TURN / scene.speed_scale):
        raise OrbitError("exciter 1 does not turn; allowed: a motion whose exciters turn")
    yield motion.state


def _from_state(
    shooter: Shooter, state: FloatArray, period: int, units: Sequence[float], tolerance: float
) -> tuple[Problem, NewtonResult]:
    """Find the orbit near a state on the section."""
    state = state.copy()
    state[3:5] -= TURN * np.round(state[3:5] / TURN)
    seconds = period * TURN / max(abs(state[10]), 1e-6 * shooter.scene.speed_scale)
    try:
        return _from_shot(shooter, state, seconds, units, tolerance)
    except NoConvergenceError:  # the speed of exciter 1 on the section may be far from its mean
        shooter.motion.reset(state)
        turns = shooter.motion.to_section(period, 4.0 * seconds)
        mean = shooter.motion.now
        if not turns or abs(mean - seconds) <= MAX_RIPPLE * seconds:
            raise
    return _from_shot(shooter, state, mean, units, tolerance)


def _from_shot(
    shooter: Shooter, state: FloatArray, seconds: float, units: Sequence[float], tolerance: float
) -> tuple[Problem, NewtonResult]:
    """Find the orbit near a state on the section whose period is about so many seconds."""
    shot = shooter.shot(state, seconds)
    if shot.outcome != "ok":
        raise NoConvergenceError(f"{shot.outcome}: {shot.detail}")
    turns = np.round((shot.state[3:5] - state[3:5]) / TURN).astype(int).tolist()
    if not turns[0]:
        raise NoConvergenceError("exciter 1 makes no turn")
    problem = Problem(shooter, turns, units, tolerance)
    chart = problem.chart(state, shot.begins)
    u = chart.pack(state, shot.duration, [shooter.held[key] for key in shooter.keys])
    return problem, correct_moving_section(problem, chart, u, 20)


def smallest_period(problem: Problem, result: NewtonResult, period: int) -> int:
    """Return the turns of exciter 1 after which an orbit repeats that closes after a period."""
    state, seconds, _ = result.chart.unpack(result.u)
    for turns in range(1, period):
        if period % turns == 0:
            difference = problem.shooter.shot(state, seconds * turns / period).state - state
            difference[3:5] = wrap(difference[3:5])
            scaled = (difference / problem.shooter.scales)[result.chart.places]
            if np.abs(scaled).max() < REPEAT_RATIO * problem.tolerance:
                return turns
    return period
