"""Where a run is: the records that compiled code reads and changes, the steps that an integrator hands over, scales.

A step holds every unknown as a polynomial in the fraction of the step, so its readers need not know the method. Steps
are written to arrays of fixed length, which are overwritten during the run: memory does not grow with the run. An
observer that keeps a trajectory copies them. A *piece* is a sequence of steps in one mode, without an event between
them.

Absolute tolerances follow from the scales of a scene. Only the machine and its drive enter these, never the state, so
that two runs of one machine are integrated alike wherever they start, and a change of units changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import ALONG, COORDINATES, RATES, Mode
from vibroplat.config.scene import Scene
from vibroplat.config.sections import Initial
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray, compiled, copy
from vibroplat.kernels.lines import in_lines
from vibroplat.kernels.polynomial import stretch
from vibroplat.model.parameters import Parameters, parameters, plain
from vibroplat.model.springs import resist
from vibroplat.model.systems import FULL_SIZE, GAP, MOVING_SIZE, UNKNOWNS, System

#: Steps that one segment may need after its last one: that of chatter, and one to spare.
MARGIN = 2

#: Columns of polynomials: as many as the largest system has unknowns, made up to whole vectors of the processor.
WIDTH = 16

#: Minimum degree of the polynomials, that of chatter.
CUBIC = 3

#: Places of x, y, φ, y_w1, y_w2 in the full state, and their rates at rest.
RELATIVE, _STILL = [0, 1, 2, GAP, GAP + 1], (0.0,) * 5
#: Most of Newton's steps to the static rest; linear springs take one.
MAX_REST_STEPS = 100

# How a piece continues the previous one.
AFTER_EVENT, RESTARTED, CUT = range(3)

#: A piece.
PIECE = np.dtype(
    [
        ("first", np.int64),  # its steps [first, end)
        ("end", np.int64),
        ("system", np.int64),
        ("origin", np.float64),  # of its times (s)
        ("until", np.float64),  # when it ends (s)
        ("turns", np.float64, 2),  # whole turns taken off both exciter angles (rad)
        ("joined", np.int64),  # how it continues from the piece before
        ("events", np.int64),  # in the list then
    ],
    align=True,
)

#: Steps and closed pieces so far, and where the open piece begins.
USED = np.dtype([("steps", np.int64), ("first", np.int64), ("pieces", np.int64)], align=True)


class Steps(NamedTuple):
    """Steps and the pieces they make.

    The polynomials of a step are in s = (t − start)/length. A system uses the first columns of ``c``; what is in the
    others means nothing.
    """

    start: FloatArray  # of each step since the origin of its piece (s), shape (rows,)
    length: FloatArray  # its duration (s), shape (rows,)
    c: FloatArray  # coefficients, shape (rows, degree + 1, WIDTH)
    ends: FloatArray  # unknowns at the ends of the steps, shape (rows, WIDTH)
    pieces: npt.NDArray[np.void]  # closed ones, records of PIECE
    used: Any  # a record of USED

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return self.c.shape[1] - 1


def empty_steps(rows: int, degree: int) -> Steps:
    """Make room for steps with polynomials of a degree."""
    return Steps(
        np.zeros(rows),
        np.zeros(rows),
        in_lines((rows, degree + 1, WIDTH)),
        in_lines((rows, WIDTH)),
        np.zeros(rows, PIECE),
        np.zeros(1, USED)[0],
    )


@compiled
def rewind(steps: Steps) -> None:
    """Forget the steps; an open piece goes on with the next ones."""
    steps.used.steps = steps.used.first = steps.used.pieces = 0


@compiled
def end_at(steps: Steps, row: int, share: float, end: FloatArray) -> None:
    """Let a step end at fraction ``share`` of it, or beyond, with the unknowns ``end`` there."""
    c, degree = steps.c[row], steps.c.shape[1] - 1
    stretch(c, degree, share)
    steps.length[row] *= share
    for j in range(end.size):
        reached = c[0, j]
        for k in range(1, degree + 1):
            reached += c[k, j]
        c[2, j] += end[j] - reached
    copy(end, steps.ends[row])


@compiled
def fill_cubic(c: FloatArray, step: float, y0: FloatArray, y1: FloatArray, yp0: FloatArray, yp1: FloatArray) -> None:
    """Fill the coefficients of the cubic through values and rates at both ends of a step; higher ones are 0."""
    for j in range(y0.size):
        rise, rate_0, rate_1 = y1[j] - y0[j], step * yp0[j], step * yp1[j]
        c[0, j], c[1, j] = y0[j], rate_0
        c[2, j] = 3.0 * rise - 2.0 * rate_0 - rate_1
        c[3, j] = rate_0 + rate_1 - 2.0 * rise
    for k in range(4, c.shape[0]):
        for j in range(y0.size):
            c[k, j] = 0.0


# Outcomes of a run.
RUNNING, OK, SOLVER_FAILURE, NON_FINITE, INCONSISTENT, TOO_MANY_EVENTS, OUTSIDE_MODEL, OUT_OF_MEMORY = range(8)

# How far the start of a mode at the present state is prepared; integers of numpy, see :mod:`vibroplat.hybrid.modes`.
_NUMBERS: Any = np.arange(3)
STALE, CONSISTENT, DIFFERENTIATED = _NUMBERS

#: How many modes there are.
MODE_COUNT = len(Mode)

#: A run (times in s).
RUN = np.dtype(
    [
        ("now", np.float64),
        ("end", np.float64),  # of the run, as far as it is asked for
        ("origin", np.float64),  # when the segment began
        ("until", np.float64),  # longest the segment may take
        ("longest", np.float64),  # segment without an event
        ("period", np.float64),  # turn of the larger synchronous speed
        ("speed", np.float64),  # the larger synchronous speed (rad/s)
        ("tolerance", np.float64),
        ("force_noise", np.float64),  # contact forces below this are round-off of larger ones (N)
        ("force_error", np.float64),  # and below this errors of the state (N), see force_noise()
        ("gap_scale", np.float64),  # (m)
        ("slowest", np.float64),  # impact with a rebound (m/s)
        ("target", np.float64),  # angle of exciter 1 with all its turns at which the run ends, or nan (rad)
        ("mode", np.int64),
        ("outcome", np.int64),
        ("final", np.int64),  # whether reaching ``until`` ends the run
        ("joined", np.int64),  # how the piece continues the previous one
        ("zeros", np.int64),  # of the guard at the segment's start that are known
        ("other_zeros", np.int64),  # of the second guard of contact with friction
        ("fallen", np.int64),  # which of its guards has fallen, 0 or 1
        ("accumulating", np.int64),  # whether chatter is to be summed up before the next segment
        ("events", np.int64),  # rows in the event list
        ("unread", np.int64),  # 0: somebody reads the steps; else they may be left out, and segments are counted from 1
        ("restarts", np.int64),
        ("state", np.float64, MOVING_SIZE),  # full state; without transport its last two numbers are 0
        ("turns", np.float64, 2),  # whole turns taken off its exciter angles (rad)
        ("atol", np.float64, UNKNOWNS),  # absolute tolerances of the segment's unknowns
        ("systems", np.int64, MODE_COUNT),  # number of the system of each mode; −1 for one that the scene does not have
        ("tolerances", np.float64, (MODE_COUNT, UNKNOWNS)),  # absolute tolerances of each mode's unknowns
        ("fresh", np.int64, MODE_COUNT),  # how far each mode's start is prepared
        ("y", np.float64, (MODE_COUNT, UNKNOWNS)),  # start of each mode: unknowns, first and second derivatives
        ("yp", np.float64, (MODE_COUNT, UNKNOWNS)),
        ("ypp", np.float64, (MODE_COUNT, UNKNOWNS)),
    ],
    align=True,
)

#: An event.
EVENT = np.dtype(
    [
        ("t", np.float64),  # when (s)
        ("kind", np.int64),
        ("rate_before", np.float64),  # of the gap (m/s)
        ("rate_after", np.float64),
        ("impulse", np.float64),  # (N·s)
        ("loss", np.float64),  # of energy (J)
        ("force_after", np.float64),  # F_c (N)
        ("mode_after", np.int64),
        ("impacts", np.int64),  # that it stands for
        ("slip_before", np.float64),  # rate of the material along the deck (m/s)
        ("slip_after", np.float64),
        ("friction_impulse", np.float64),  # (N·s)
        ("friction_after", np.float64),  # F_t (N)
    ],
    align=True,
)


class Automaton(NamedTuple):
    """A run of the hybrid automaton."""

    p: Any  # parameters of the scene
    run: Any  # a record of RUN
    recent: FloatArray  # times of the last restarts (s), as many as may lie within a period
    events: npt.NDArray[np.void]  # since the list was read, records of EVENT
    steps: Steps  # since they were read
    start: int  # address of :func:`vibroplat.hybrid.starts.start_callback`
    parameters: int  # address of p


#: Local tolerance of F_c in units of its scale, over the tolerance of the run. Ten costs no accuracy of
#: F_c, whose error is that of the state it follows from; less takes more steps where it is in the error test.
FORCE_TOLERANCE_RATIO = 10.0

#: Local tolerance of rates in units of their scales, over the tolerance of the run. At equal errors of
#: coordinates, F_c and event times 2 takes a tenth fewer steps than 1; 4 gains nothing more.
RATE_TOLERANCE_RATIO = 2.0

#: Local tolerances in flight, over those of the other modes. A landing turns an error of the gap into one of
#: time by its speed, which may be small: at equal errors of event times this takes a tenth fewer steps than 1.
FLIGHT_TOLERANCE_RATIO = 0.1

#: Relative error that round-off leaves of what is integrated: the least relative tolerance.
ROUND_OFF = 100.0 * float(np.finfo(float).eps)

#: Round-off of F_c in units of its scale, and the largest error of F_c that a run may have.
FORCE_NOISE, FORCE_ERROR = 1e-12, 0.05

#: Most halvings of a tolerance in low flights; those lower than 4⁻³⁰ of the scale are not followed.
MAX_TOLERANCE_HALVINGS = 30


def state_scales(scene: Scene) -> FloatArray:
    """Scales of the full state, shape (14,), with transport (16,).

    With ω₀ the larger synchronous speed, and the largest of a program: lengths (k₁+k₂)/M (what both unbalances move
    the platform by far above resonance), and g/ω₀² where larger for gap and upper layer; rotation (k₁+k₂)ρ/J, with ρ
    the largest distance of an exciter's axis from the platform's centre of mass; exciters 1 rad; rates ω₀ times these.
    """
    return np.array(scene.state_scales)


def absolute_tolerances(scene: Scene, system: System) -> FloatArray:
    """Absolute tolerances of a system's unknowns, shape (size,)."""
    atol = np.empty(system.size)
    atol[: system.differential] = state_scales(scene)[system.places]
    atol[system.differential // 2 : system.differential] *= RATE_TOLERANCE_RATIO
    atol[system.differential :] = FORCE_TOLERANCE_RATIO * scene.force_scale
    if system.mode is Mode.FLIGHT:
        atol *= FLIGHT_TOLERANCE_RATIO
    return scene.solver.tolerance * atol


def force_spread(scene: Scene, p: Parameters | None = None) -> float:
    """Change of F_c (N) when the state changes by its scales: the effect of state errors on the force.

    With layers or motors that are stiff compared with the excitation it is much larger than the forces themselves.
    ``p`` are the scene's parameters, if they are at hand.
    """
    scales = scene.state_scales
    lower, upper = scene.layer_masses
    rates = [RATE_TOLERANCE_RATIO * scale for scale in scales[7:14]]
    at, moving = ([values[place] for place in RELATIVE] for values in (scales, rates))
    resisting = resist(at, moving, plain(parameters(scene) if p is None else p))[0]
    motors = max(scene.unbalances) * scene.fastest_decay * rates[3]
    return float(scene.force_scale + upper * resisting[4] + lower / scene.body.mass * (resisting[1] + motors))


def force_noise(scene: Scene, p: Parameters | None = None) -> float:
    """Contact forces up to this (N) are noise: what errors of the state within the tolerance, or round-off, leave.

    At a liftoff F_c has either sign within it. In 400 random scenes F_c was never below zero by more than 5e-5 of it.
    """
    admitted = min(scene.solver.tolerance * force_spread(scene, p), FORCE_ERROR * scene.force_scale)
    return max(admitted, FORCE_NOISE * scene.force_scale)


@compiled
def halvings(tolerance: float, height: float, scale: float, sure: bool) -> int:
    """How often the gap rate's tolerance is halved in a flight much lower than the scale of lengths.

    An absolute error of the gap moves a landing at speed v by its ratio to v, so the many low flights
    of accumulating impacts need a gap as accurate against their own height: its tolerance is divided by
    4ⁿ, that of its rate by 2ⁿ. Gap and rate start from 0, so they keep full relative precision in any low flight.
    ``sure`` says whether the flight is known to stay below ``height`` (m); otherwise a tighter tolerance could fall
    below round-off.
    """
    share = max(height / scale, 4.0**-MAX_TOLERANCE_HALVINGS if sure else ROUND_OFF / tolerance)
    return min(int(-0.5 * math.log2(share)), MAX_TOLERANCE_HALVINGS) if share < 1.0 else 0


def static_rest(scene: Scene, p: Parameters | None = None) -> FloatArray:
    """Full state of platform and material at rest on the static sag, exciters at angle 0.

    ``p`` are the scene's parameters, if they are at hand. Raises ConfigError as :func:`rest_under`.
    """
    state = np.zeros(FULL_SIZE if scene.transport is None else MOVING_SIZE)
    slope, gravity = scene.gravity
    lower, upper = scene.layer_masses
    total = scene.platform_mass + lower + upper
    loads = [total * slope, -total * gravity, 0.0, 0.0, -gravity if scene.layers == 2 else 0.0]
    if scene.transport is not None:
        loads[2] = -scene.transport.deck_height_m * (lower + upper) * slope
    state[RELATIVE] = rest_under(loads, parameters(scene) if p is None else p)
    return state


def rest_under(loads: Sequence[float], p: Parameters) -> list[float]:
    """Find where springs hold forces on x, y (N) and φ (N·m), on y_w1 and, over its mass (m/s²), on y_w2.

    Springs are unstressed at 0. Linear ones, each on its own coordinate, take one step of Newton's method. A coordinate
    without a spring does not move.

    Raises
    ------
    vibroplat.errors.ConfigError
        The springs do not hold the forces.
    """
    numbers, coordinates = plain(p), [0.0] * len(loads)
    for _ in range(MAX_REST_STEPS):
        found, slopes = resist(coordinates, _STILL, numbers)
        held = [i for i in range(len(loads)) if slopes[i][i] != 0.0]
        missing = [loads[i] - found[i] for i in held]
        if max(map(abs, missing)) <= ROUND_OFF * max(map(abs, loads)):
            return coordinates
        steps = [force / slopes[i][i] for i, force in zip(held, missing, strict=True)]
        if any(slopes[i][j] != 0.0 for i in held for j in held if i != j):
            steps = np.linalg.solve([[slopes[i][j] for j in held] for i in held], missing).tolist()
        for i, step in zip(held, steps, strict=True):
            coordinates[i] += step
    raise ConfigError(f"no static rest: the springs do not hold {loads[1]:g} N along y")


def initial_state(scene: Scene, initial: Initial | None = None, p: Parameters | None = None) -> FloatArray:
    """Full state, shape (14,), with transport (16,), that ``run.initial`` asks for, or another start of the scene.

    For one that goes on from another run it is static rest. ``p`` are the scene's parameters, if they are at hand.
    """
    initial = initial or scene.run.initial
    state = static_rest(scene, p)
    if initial.state is None:
        speeds = scene.synchronous_speeds_at(scene.drive.at(0.0).frequency_at(0.0))
        state[3:5] = initial.angles(scene.phase_weights[1], scene.hanging_angle)
        for i, exciter in enumerate(scene.exciter_pair):
            state[10 + i] = initial.speed_ratio * exciter.direction * speeds[i]
        return state
    for place, name in enumerate((*COORDINATES, *RATES, *ALONG)[: state.size]):
        value = getattr(initial.state, name)
        if value is not None:
            state[place] = value
    return state


def perturb_state(state: FloatArray, scene: Scene, share: float, key: tuple[int, ...]) -> FloatArray:
    """Return a state, shape (14,), with the rates of platform and exciters changed by normal random numbers.

    Their standard deviation is ``share`` in scaled units; the numbers of ``key`` determine them. A symmetric
    motion that has lost stability would otherwise stay symmetric for ever.
    """
    return perturb_states(state[np.newaxis], scene, share, [key])[0]


def perturb_states(states: FloatArray, scene: Scene, share: float, keys: Sequence[tuple[int, ...]]) -> FloatArray:
    """Do as :func:`perturb_state` for several states, shape (states, 14), each with a key of its own."""
    if share == 0.0:
        return states
    changed, scales = states.copy(), share * state_scales(scene)[7:12]
    for state, key in zip(changed, keys, strict=True):
        state[7:12] += scales * np.random.default_rng(key).standard_normal(5)
    return changed
