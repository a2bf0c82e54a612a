"""One periodic orbit of a scene, by Newton's method from a guess, and its motion over a period."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.config.arguments import Keys, validated
from vibroplat.config.computation import MIN_TOLERANCE_SUNDIALS
from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.digits import number, quantity
from vibroplat.config.engine_choice import chosen_engine, with_second_engine
from vibroplat.config.engines import uses_sundials
from vibroplat.config.plans import FREQUENCY, OrbitTolerance, Period
from vibroplat.config.scene import Scene, SceneArgument
from vibroplat.continuation.first_orbit import MissedOrbitError, OrbitError, first_orbit
from vibroplat.continuation.newton import NewtonResult, Problem
from vibroplat.continuation.shooting import Shooter, Shot, event_sequence_text
from vibroplat.errors import ConfigError
from vibroplat.extensions import figure_of, load_provided
from vibroplat.hybrid.modes import IMPACT
from vibroplat.hybrid.state import initial_state
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.sensitivity import with_value
from vibroplat.motion.initial_condition import end_of
from vibroplat.motion.run import simulate
from vibroplat.motion.variation import full_state
from vibroplat.report.summary import measure
from vibroplat.results.run import RunResult, load
from vibroplat.shooting.multipliers import n_unstable
from vibroplat.study.branches import SUPPLY
from vibroplat.study.point import ANTIPHASE_OF_ORBITS, row_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOG = logging.getLogger("vibroplat")

#: The tolerance of the integrator over that of an orbit, at most; that of SUNDIALS. Newton's method cannot get below
#: the scatter of shots from neighbouring states. Of a screen of 2.4 t, over two turns, that is 10 to 60 tolerances of
#: ``native``, so that a tenth is not enough; with ``taylor`` it is 5e-12 at any tolerance. Steps of a thousandth are so
#: short that the places of liftoffs suffer, by 2e-5 Hz instead of 1e-6.
INTEGRATOR_TOLERANCE_RATIO, SUNDIALS_TOLERANCE_RATIO = 0.1, 0.01
#: How often a step between two supplies is halved, at most.
MAX_HALVINGS = 6
#: Tolerance of orbits that are drawn, or confirm a sweep.
TOLERANCE = 1e-8


@dataclass(frozen=True, repr=False)
class Orbit:
    """A periodic orbit.

    Attributes
    ----------
    scene
        Scene of the orbit.
    state
        Full state on the orbit, shape (14,): :data:`vibroplat.config.coordinates.COORDINATES` and their rates.
    period, period_s
        Period, in turns of exciter 1 and in s.
    multipliers
        Floquet multipliers without the trivial multiplier 1, the largest magnitude first.
    residual
        Distance between the ends of the orbit (scaled units).
    sequence
        Event sequence, such as ``liftoff stick``; ``none`` if there are no events.
    measures
        Measures over a period, as in the table of a sweep.
    residuals
        Residuals of Newton's iterations (scaled units).
    distance
        Largest distance from the guess on the section (scaled units).
    """

    scene: Scene
    state: FloatArray
    period: int
    period_s: float
    multipliers: npt.NDArray[np.complex128]
    residual: float
    sequence: str
    measures: dict[str, Any]
    residuals: Sequence[float] = ()
    distance: float = math.nan

    def __repr__(self) -> str:
        kind = "stable" if self.stable else f"unstable ({self.unstable} multipliers outside the unit circle)"
        heights = [self.measures[f"rms_{axis}_m"] for axis in "xy"]
        lines = (
            f"Orbit of {self.scene.name}: period {self.period} ({quantity(self.period_s, 's', digits=9)}), {kind}",
            f"  event sequence        {self.sequence}",
            f"  excitation frequency  {quantity(self.excitation_frequency_hz, 'Hz', digits=9)}",
            f"  RMS x, y              {', '.join(quantity(one, 'm', largest=max(heights)) for one in heights)}",
            f"  largest multiplier    {number(max(map(abs, self.multipliers), default=0.0), 6)}",
            f"  residual              {self.residual:.1e} of scaled units",
        )
        return "\n".join(lines)

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle."""
        return n_unstable(self.multipliers)

    @property
    def stable(self) -> bool:
        """Whether the orbit is stable."""
        return self.unstable == 0

    @property
    def excitation_frequency_hz(self) -> float:
        """Turns of exciter 1 per second."""
        return self.period / self.period_s

    def plot(self) -> Figure:
        """Draw the orbit: speed over height, and the gap over the phase if there is material."""
        return figure_of(self)

    @validated(keys=Keys | None, measures=Keys | None)
    def sensitivities(self, keys: Sequence[str] | None = None, measures: Sequence[str] | None = None) -> pd.DataFrame:
        """Differentiate the measures of the orbit by keys of its scene, along the orbit.

        Parameters
        ----------
        keys
            Dotted keys with numbers other than 0. Default: all that the equations depend on.
        measures
            Columns of a sweep, or ``stability_margin``: 1 minus the magnitude of the largest multiplier.

        Returns
        -------
        pandas.DataFrame
            One row per measure and key: ``derivative`` and ``elasticity``, the relative change of the measure divided
            by the relative change of the key.

        Raises
        ------
        ConfigError
            The scene has no such key or measure.
        """
        table: pd.DataFrame = load_provided("sensitivities")(self, keys, measures)
        return table

    @cached_property
    def run(self) -> RunResult:
        """One period of the orbit, as a run with dense output."""
        return run_from(self.scene, self.state, self.period_s)


def run_from(scene: Scene, state: FloatArray, seconds: float) -> RunResult:
    """Simulate for some seconds from a full state, shape (14,), exactly as it is."""
    changes = {"run.duration_s": seconds, "run.perturbation": 0.0}
    return simulate(with_initial_state(scene, state).replace(changes), engine=make_engine)


@validated(scene=SceneArgument, period=Period, tolerance=OrbitTolerance)
def orbit(scene: Scene, guess: Any = None, *, period: int = 1, tolerance: float = 1e-8) -> Orbit:
    """Find a periodic orbit by shooting and Newton's method; the logger ``vibroplat`` warns if it is unstable.

    Parameters
    ----------
    scene
        Scene with a constant supply.
    guess
        Initial guess. None: the motion settles from ``run.initial``. Otherwise:

        * full state, shape (14,), or a mapping of its names, as a row of a trajectory;
        * :class:`Orbit`, finished run or its directory: speeds are scaled to this supply, from an orbit in steps;
        * row of ``branches``, ``special`` or ``sweep``: its keys and its state, or the motion settled from its phase.
    period
        Number of turns of exciter 1 in a period.
    tolerance
        Largest residual (scaled units).

    Raises
    ------
    OrbitError
        No orbit converged near the guess, or the orbit repeats after fewer turns.
    ConfigError
        The scene has a supply program, the guess is none of these, or another argument is out of its range.

    Examples
    --------
    >>> from vibroplat import Scene, orbit
    >>> found = orbit(Scene())
    >>> found.sequence, found.stable
    ('none', True)
    """
    try:
        result = orbit_near(scene, guess, period, tolerance)
    except OrbitError:
        if not isinstance(guess, Orbit) or guess.scene.drive == scene.drive:
            raise
        result = _continue_over_supply(scene, guess, period, tolerance)
    if not result.stable:
        size = abs(result.multipliers[0])
        _LOG.warning("the orbit is unstable: its largest Floquet multiplier has magnitude %.4g", size)
    return result


def _continue_over_supply(scene: Scene, guess: Orbit, period: int, tolerance: float) -> Orbit:
    """Find an orbit from that of another supply, in steps that are halved where one is too far for Newton's method.

    Where no step is short enough, the motion settles from the guess.
    """
    now, end, reached = guess.scene.drive.largest_frequency, scene.drive.largest_frequency, guess
    step = 0.5 * (end - now)
    shortest = step * 0.5**MAX_HALVINGS
    while now != end:
        after = end if abs(end - now) <= abs(step) else now + step
        try:
            reached = orbit_near(scene.replace({FREQUENCY: after}), reached, period, tolerance)
        except OrbitError:
            step *= 0.5
            if abs(step) < abs(shortest):
                break
            continue
        now, step = after, 2.0 * step
    else:
        return reached
    begin = _scale_speeds(guess.state, guess.scene, scene)
    result = orbit_near(with_initial_state(scene, begin), None, period, tolerance)
    _LOG.warning("Newton's method did not converge from the guess; the motion settled from it to this orbit")
    return replace(result, scene=with_orbit_tolerance(scene, tolerance))


def orbit_near(scene: Scene, guess: Any, period: int, tolerance: float) -> Orbit:
    """Find an orbit as :func:`orbit` does, by one search with each engine, and say nothing of its stability."""
    scene, begin = read_guess(scene, guess)
    return with_second_engine(
        scene, lambda tried: _search_orbit(tried, begin, period, tolerance), errors=(MissedOrbitError,)
    )


def _search_orbit(scene: Scene, begin: FloatArray | None, period: int, tolerance: float) -> Orbit:
    """Find an orbit by one search (:func:`orbit_near`)."""
    scene = with_orbit_tolerance(scene, tolerance)
    with closing(Shooter(scene)) as shooter:
        problem, result = first_orbit(shooter, begin, period, (), tolerance)
        state, seconds, _ = result.chart.unpack(result.u)
        return Orbit(
            scene=scene,
            state=state,
            period=abs(problem.turns[0]),
            period_s=seconds,
            multipliers=result.multipliers,
            residual=result.residuals[-1],
            sequence=event_sequence_text(result.event_sequence),
            measures=measures_of_orbit(problem, result),
            residuals=result.residuals,
            distance=float(np.abs((state - result.chart.base) / shooter.scales).max()),
        )


def with_orbit_tolerance(scene: Scene, tolerance: float) -> Scene:
    """Return the scene with a tolerance of the integrator that orbits of a tolerance need.

    Raises
    ------
    ConfigError
        It has a drive program.
    """
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given; orbits and basins need a constant supply; allowed: one frequency")
    finest = INTEGRATOR_TOLERANCE_RATIO * tolerance
    if uses_sundials(chosen_engine(scene)):
        finest = max(SUNDIALS_TOLERANCE_RATIO * tolerance, MIN_TOLERANCE_SUNDIALS)
    finest = min(scene.solver.tolerance, finest)
    return cast("Scene", with_value(scene, ["solver", "tolerance"], finest))  # in its range as both are


def with_initial_state(scene: Scene, state: FloatArray) -> Scene:
    """Return a scene that begins at a full state, shape (14,)."""
    names = (*COORDINATES, *RATES)
    present = [*scene.coordinates, *(7 + i for i in scene.coordinates)]
    return scene.replace({"run.initial": {"state": {names[i]: float(state[i]) for i in present}}})


def read_guess(scene: Scene, guess: Any) -> tuple[Scene, FloatArray | None]:
    """Read what a user gives as a guess; what :func:`orbit` says of it.

    Returns
    -------
    scene, state
        The scene at the keys of a row, and a full state, shape (14,). It is None if the motion is to settle: from the
        phase difference of a row that has no state.

    Raises
    ------
    ConfigError
        It is nothing of the kind.
    """
    names = (*COORDINATES, *RATES)
    if guess is None:
        return scene, None
    if isinstance(guess, str | Path):
        state, finished = end_of(Path(guess), scene).state, load(guess)
        assert isinstance(finished, RunResult)  # or it would have been refused
        return scene, _scale_speeds(state, finished.scene, scene)
    if isinstance(guess, RunResult | Orbit):
        return scene, _scale_speeds(guess.state if isinstance(guess, Orbit) else guess.final_state, guess.scene, scene)
    if isinstance(guess, Mapping | pd.Series):
        given = {name: float(guess[name]) for name in names if name in guess and pd.notna(guess[name])}
        if "excitation_frequency_hz" in guess:  # a row of a table of this scene
            values = {str(key): value for key, value in guess.items() if "." in str(key)}
            if SUPPLY in guess:
                values[FREQUENCY] = float(guess[SUPPLY])
            phase = guess.get("phase_difference_rad")
            if RATES[0] not in guess and phase is not None and np.isfinite(phase):
                values["run.initial.phase_difference_rad"] = float(phase)
            scene = scene.replace(values)
            if RATES[0] not in guess:
                return scene, None
        if given:
            own = initial_state(scene).tolist()
            return scene, np.array([given.get(name, value) for name, value in zip(names, own, strict=True)])
    elif isinstance(guess, Sequence | np.ndarray):
        return scene, full_state(guess, scene)
    raise ConfigError("guess is not a state; allowed: 14 numbers, a row of a trajectory or of a sweep, a run, an orbit")


def _scale_speeds(state: FloatArray, source: Scene, scene: Scene) -> FloatArray:
    """Return the state of a scene with its rates scaled to the synchronous speed of another."""
    ratio = 1.0 if source.drive.program else scene.speed_scale / source.speed_scale
    return np.concatenate([state[:7], ratio * state[7:]])


def measures_of_orbit(problem: Problem, result: NewtonResult) -> dict[str, Any]:
    """Return the measures of a sweep over the period of an orbit, as in its rows."""
    shooter, (*_, values) = problem.shooter, result.chart.unpack(result.u)
    return measures_of(problem, result.shot, shooter.scene_at(dict(zip(shooter.keys, values, strict=True))))


def measures_of(problem: Problem, shot: Shot, scene: Scene) -> dict[str, Any]:
    """Return the measures of a sweep over a measured shot of an orbit's period."""
    return row_of(measure_period(problem, shot, scene), scene, near=ANTIPHASE_OF_ORBITS)


def measure_period(problem: Problem, shot: Shot, scene: Scene, *, brief: bool = False) -> dict[str, Any]:
    """Gather measures over the period of a scene's orbit; see :func:`vibroplat.report.summary.measure`."""
    first, second = (abs(n) / shot.duration for n in problem.turns)
    speeds = {"excitation_frequency_hz": 0.5 * (first + second), "frequency_split_hz": first - second}
    impacts = float(shot.part.measures.marks["measured"][IMPACT]) / abs(problem.turns[0])
    return measure(shot.part, scene, brief=brief, known=shot.known) | speeds | {"impacts_per_period": impacts}
