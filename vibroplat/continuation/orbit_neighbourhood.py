"""A periodic orbit and its neighbourhood in keys of its scene: tangents, and orbits at other values of the keys.

The tangents du/dkey follow from one varied shot by the implicit function theorem, u′ = −J⁻¹ ∂R/∂key. An orbit at other
values starts from their prediction. If Newton's method fails or converges to another orbit, the step is divided. The
section is moved away from events at each step. With a fixed section, an event would eventually cross it, and the orbits
lost there would bias the sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from vibroplat.config.circular import differences
from vibroplat.config.engine_choice import with_second_engine
from vibroplat.config.scene import Scene
from vibroplat.continuation.first_orbit import MissedOrbitError, first_orbit
from vibroplat.continuation.newton import RANK_LIMIT, NewtonResult, NoConvergenceError, Problem, correct, fixed_border
from vibroplat.continuation.orbit import Orbit, measure_period, measures_of, read_guess, with_orbit_tolerance
from vibroplat.continuation.shooting import KEY_STEP_RATIO, Shooter
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.sensitivity import flat, value_of, with_values
from vibroplat.model.systems import FULL_SIZE
from vibroplat.observe.variation import Variation
from vibroplat.report.summary import LARGEST, STATISTICS
from vibroplat.study.point import ANTIPHASE_OF_ORBITS, shown_statistics

#: Minimum part of a step into which it is divided.
MIN_STEP_PART = 1.0 / 64.0
#: How far an orbit may be from its prediction, over the predicted change, or in scaled units: farther away
#: it is another one.
MAX_PREDICTION_ERROR, MAX_DISTANCE = 0.5, 0.02
#: Measures that take neither the data sheet nor the audit.
_STATISTICS = frozenset((*STATISTICS, *LARGEST, "stability_margin"))
#: Iterations of Newton's method.
MAX_ITERATIONS = 12


class _NearScene(NamedTuple):
    """A scene beside another one, and its parameters."""

    scene: Scene
    p: Parameters


class OrbitNeighbourhood:
    """A periodic orbit, and those at other values of some keys of its scene.

    Make one by :meth:`near`, or from what Newton's method has found with a shooter without keys. All that come from one
    another share its shooter, which the one who made it closes. None of them changes.

    Parameters
    ----------
    problem, result
        Of a shooter without keys, at the values of the keys.
    keys, values
        Dotted keys with continuous values, and their values here; those of the shooter's scene by default.

    Attributes
    ----------
    keys, values
        As given, the values as an array, shape (keys,).
    orbit
        The orbit as Newton's method leaves it; its section is as it was found.
    """

    def __init__(
        self,
        problem: Problem,
        result: NewtonResult,
        keys: Sequence[str],
        values: Sequence[float] | FloatArray | None = None,
    ) -> None:
        self.problem, self.orbit, self.keys = problem, result, tuple(keys)
        scene = problem.shooter.scene
        self.values: FloatArray = np.array([value_of(scene, k) for k in keys] if values is None else values, float)

    @classmethod
    def near(
        cls, scene: Scene, keys: Sequence[str], guess: Any = None, *, period: int = 1, tolerance: float = 1e-8
    ) -> OrbitNeighbourhood:
        """Find the orbit of a scene near a guess, as :func:`vibroplat.continuation.orbit.orbit` does.

        Raises
        ------
        OrbitError, ConfigError
            As there.
        """
        scene, begin = read_guess(scene, guess)
        if isinstance(guess, Orbit):
            period = guess.period

        def search(tried: Scene) -> OrbitNeighbourhood:
            shooter = Shooter(with_orbit_tolerance(tried, tolerance))
            try:
                return cls(*first_orbit(shooter, begin, period, (), tolerance), keys).recentre()
            except BaseException:
                shooter.close()
                raise

        return with_second_engine(scene, search, errors=(MissedOrbitError,))

    def close(self) -> None:
        """Free what the engine holds, for all that came from this one."""
        self.problem.shooter.close()

    @cached_property
    def scene(self) -> Scene:
        """The scene at the values of the keys; their ranges are not checked."""
        return self.problem.shooter.scene_at(dict(zip(self.keys, self.values.tolist(), strict=True)))

    @property
    def state(self) -> FloatArray:
        """Full state on the orbit, where the section is, shape (14,)."""
        return self.orbit.chart.unpack(self.orbit.u)[0]

    @property
    def period_s(self) -> float:
        """(s)."""
        return self.orbit.shot.duration

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Floquet multipliers but the 1 along the motion, the largest first."""
        return self.orbit.multipliers

    @property
    def margin(self) -> float:
        """How far the largest multiplier is inside the unit circle, 1 − |λ₁|; negative if the orbit is unstable."""
        return 1.0 - float(np.abs(self.multipliers[0])) if self.multipliers.size else 1.0

    @cached_property
    def measures(self) -> dict[str, Any]:
        """Measures of a sweep over the period, and ``margin``."""
        return measures_of(self.problem, self.orbit.shot, self.scene) | {"stability_margin": self.margin}

    def measured(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the measures of these names at least, and the synchronization; a few take less time than all."""
        if not _STATISTICS.issuperset(names):
            return self.measures
        measures = measure_period(self.problem, self.orbit.shot, self.scene, brief=True)
        shown = shown_statistics(measures, self.scene, ANTIPHASE_OF_ORBITS)
        return measures | shown | {"stability_margin": self.margin}

    @cached_property
    def tangents(self) -> FloatArray:
        """Derivatives of the unknowns ``orbit.u`` by all keys, shape (m, keys)."""
        return self._along([(flat(above.p) - flat(below.p)) / (2.0 * step) for step, above, below in self._scenes])

    def predict(self, values: Sequence[float] | FloatArray) -> FloatArray:
        """Unknowns of the orbit at other values of the keys, along the tangent, shape (m,)."""
        change = np.asarray(values, float) - self.values
        if not change.any():
            return self.orbit.u
        if "tangents" in vars(self):
            return np.asarray(self.orbit.u + self.tangents @ change)
        # one direction costs parameters twice, all keys cost them twice each
        step = KEY_STEP_RATIO / float(np.abs(change / np.where(self.values == 0.0, 1.0, self.values)).max())
        above, below = (parameters(self._scene(self.values + side * step * change)) for side in (1.0, -1.0))
        return np.asarray(self.orbit.u + self._along([(flat(above) - flat(below)) / (2.0 * step)])[:, 0])

    def correct(self, values: Sequence[float] | FloatArray) -> OrbitNeighbourhood:
        """Find the same orbit at other values of the keys: in one step, or in parts of it where that fails.

        Raises
        ------
        NoConvergenceError
            The orbit is lost on the way, as beyond a fold.
        """
        goal, here, done, part = np.array(values, float), self, 0.0, 1.0
        while done < 1.0:
            part = min(part, 1.0 - done)
            there = goal if done + part == 1.0 else self.values + (done + part) * (goal - self.values)
            try:
                here = here._step(there).recentre()
            except NoConvergenceError:
                part *= 0.5
                if part < MIN_STEP_PART:
                    raise
                continue
            done += part
            part *= 2.0
        return here

    def recentre(self) -> OrbitNeighbourhood:
        """Return the orbit with its section far from events: steps are long, and move them."""
        self.problem.shooter.motion.set_parameters(self._p)
        moved = self.problem.move_from_events(self.orbit, longest=True)
        if moved is None:
            return self
        try:
            result = correct(self.problem, *moved[:2], fixed_border(moved[0]), max_iterations=MAX_ITERATIONS)
        except NoConvergenceError:
            return self
        return self._at(result, self.values, self.scene, self._p)

    def prepare(self) -> None:
        """Compute the tangents, by which :meth:`predict` then predicts; worth it for several orbits."""
        _ = self.tangents

    def gradients(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Differentiate measures of the orbit, ``margin`` among them, by all keys; errors are not known.

        Returns the derivatives and nan, each of shape (names, keys). Derivatives are central differences of shots along
        the tangents, which need no iterations: such a shot is closed to second order in the step, and that cancels. A
        measure without a value gives nan.

        Raises
        ------
        NoConvergenceError
            A shot does not end.
        """
        slopes = np.empty((len(names), self.values.size))
        for k, (step, *sides) in enumerate(self._scenes):
            change = step * self.tangents[:, k]
            above, below = (
                self._measure(near, self.orbit.u + way, names)
                for near, way in zip(sides, (change, -change), strict=True)
            )
            slopes[:, k] = differences(names, above, below) / (2.0 * step)
        return slopes, np.full(slopes.shape, np.nan)

    @cached_property
    def _p(self) -> Parameters:
        return parameters(self.scene)

    @cached_property
    def _scenes(self) -> list[tuple[float, _NearScene, _NearScene]]:
        """For each key a step, and scenes so far above and below this one."""
        scenes = []
        for k, value in enumerate(self.values.tolist()):
            change = np.zeros_like(self.values)
            change[k] = step = KEY_STEP_RATIO * abs(value) or KEY_STEP_RATIO
            above, below = (self._scene(self.values + side * change) for side in (1.0, -1.0))
            scenes.append((step, _NearScene(above, parameters(above)), _NearScene(below, parameters(below))))
        return scenes

    @cached_property
    def _weights(self) -> FloatArray:
        """Weights of the section map's entries in the size of its largest multiplier, to first order in them."""
        values, right = np.linalg.eig(self.orbit.chart.section_map(self.orbit.shot))
        k = int(np.abs(values).argmax())
        slope = np.outer(np.linalg.inv(right)[k], right[:, k]) * (values[k].conj() / (abs(values[k]) or 1.0))
        return np.asarray(slope.real)

    def _measure(self, near: _NearScene, u: FloatArray, names: Sequence[str]) -> FloatArray:
        """Measure a period from unknowns on this section in a scene beside this one; the margin but for a constant."""
        shooter, chart, margin = self.problem.shooter, self.orbit.chart, "stability_margin" in names
        shooter.motion.set_parameters(near.p)
        state, seconds, _ = chart.unpack(u)
        shot = shooter.shot(state, seconds, full=margin, measured=True, events=False)
        if shot.outcome != "ok":
            raise NoConvergenceError(f"{shot.outcome}: {shot.detail}")
        measures = measure_period(self.problem, shot, near.scene, brief=_STATISTICS.issuperset(names))
        if margin:
            measures["stability_margin"] = -float((self._weights * chart.section_map(shot)).sum())
        return np.array([measures[name] for name in names], float)

    def _scene(self, values: FloatArray) -> Scene:
        """Change the values of the keys that are not those here."""
        changed = np.flatnonzero(values != self.values).tolist()
        return cast("Scene", with_values(self.scene, {self.keys[k]: float(values[k]) for k in changed}))

    def _step(self, values: FloatArray) -> OrbitNeighbourhood:
        """Find the orbit at other values by Newton's method from the prediction, with the Jacobian of this one."""
        u = self.predict(values)
        try:
            p = parameters(scene := self._scene(values))
        except ValueError as error:
            raise NoConvergenceError(f"no scene has these values: {error}") from None
        self.problem.shooter.motion.set_parameters(p)
        chart, jacobian = self.orbit.chart, self.orbit.jacobian
        result = correct(self.problem, chart, u, fixed_border(chart), jacobian, max_iterations=MAX_ITERATIONS)
        if np.abs(result.u - u).max() > max(MAX_PREDICTION_ERROR * np.abs(u - self.orbit.u).max(), MAX_DISTANCE):
            raise NoConvergenceError("Newton's method converged to another orbit", result.residuals)
        return self._at(result, values, scene, p)

    def _at(self, result: NewtonResult, values: FloatArray, scene: Scene, p: Parameters) -> OrbitNeighbourhood:
        """Make one of an orbit whose scene and parameters are known."""
        there = OrbitNeighbourhood(self.problem, result, self.keys, values)
        there.scene, there._p = scene, p
        return there

    def _along(self, directions: Sequence[FloatArray]) -> FloatArray:
        """Differentiate the unknowns along directions of the parameters, shape (count, directions), by one shot."""
        variation, motion, chart = Variation([self._p] * len(directions)), self.problem.shooter.motion, self.orbit.chart
        variation.begin(np.eye(FULL_SIZE), directions)
        motion.set_parameters(self._p)
        motion.reset(self.state)
        motion.to_time(self.period_s, [variation])
        if motion.outcome != "ok":
            raise NoConvergenceError(f"{motion.outcome}: {motion.detail}")
        by_keys = variation.derivative(motion.automaton)[chart.places, FULL_SIZE:] / chart.scales[:, np.newaxis]
        return np.asarray(np.linalg.lstsq(self.orbit.jacobian, -by_keys, rcond=RANK_LIMIT)[0])
