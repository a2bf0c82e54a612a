"""The best values of keys: the minimum of a measure within bounds of others, by orbits and their gradients.

Each search follows the orbit of the scene as given. What violates the bounds is made small first, so that a box without
any design that keeps them is found out; then the measure, both by sequential quadratic programming (SLSQP, Kraft 1988).
With tolerances the scene counts at either end of each, one tolerance at a time, and the worst of these scenes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing

import numpy as np

from vibroplat.columns import COUNT, FLAG, Column, Columns, name_regime
from vibroplat.config.circular import bound_scale, differences
from vibroplat.config.scene import Scene
from vibroplat.config.study_plans import VIOLATION_TOLERANCE, DesignPlan
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.designs.motions import settling_plan
from vibroplat.designs.samples import sobol_points
from vibroplat.designs.sensitivities import Neighbourhood, local_orbit
from vibroplat.kernels.compiled import FloatArray
from vibroplat.study.point import measure_point
from vibroplat.study.store import Record
from vibroplat.system.workers import one_thread

#: Iterations of a search, fewer while a violation is made small, and its tolerance. Searches that came into the bounds,
#: in five boxes, took 2 to 15.
MAX_ITERATIONS, MAX_VIOLATION_ITERATIONS, SEARCH_TOLERANCE = 60, 20, 1e-8
#: Minimum scale of a bound of ``margin``, in which a hundredth is much.
MIN_MARGIN_SCALE = 0.02
#: How often a start at which the orbit is lost is moved half way to the scene as given.
MAX_HALVINGS = 6
#: What the objective and violations grow by where the orbit is lost: steps there are shortened.
LOST_PENALTY = 10.0

EVALUATIONS: Columns = {
    "start": Column("number of the starting point", kind=COUNT),
    "objective": Column("measure to minimize, in the worst case within the tolerances", "unit of the measure"),
    "violation": Column(
        "largest violation of a bound", "relative to the bound, or half a turn if it is of an angle, in the worst case"
    ),
    "feasible": Column("whether all constraints are satisfied", kind=FLAG),
    "best": Column("whether this is the best design", kind=FLAG),
}
PARETO: Columns = {
    "bound": Column("value of the varied bound"),
    "objective": EVALUATIONS["objective"],
    "feasible": EVALUATIONS["feasible"],
}


#: For each measure 1 if its bound is the least value, −1 if the largest, and the bound.
Bounds = Mapping[str, Sequence[float]]


class DesignProblem:
    """Measures of the orbits of a scene over the box of its keys, with what the plan makes of them.

    Places are in [0, 1] along each key, on a logarithmic scale where its range is positive.
    """

    def __init__(self, scene: Scene, names: Sequence[str], known: Record, bounds: Bounds) -> None:
        plan = scene.plan_of("design")
        keys, self.names = list(plan.keys), list(names)
        self.low, self.high = np.array(list(plan.keys.values()), float).T
        self.log = self.low > 0.0
        self._ends = np.where(self.log, self.low, 1.0), np.where(self.log, self.high, 2.0)  # those of logarithms
        self.local = local_orbit(scene, [*keys, *(k for k in plan.parameter_tolerances if k not in keys)], known)
        self.size, ends = (
            len(keys),
            [(k, 1.0 + side * s) for k, s in plan.parameter_tolerances.items() for side in (-1.0, 1.0)],
        )
        self.factors = np.array([[f if key == k else 1.0 for key in self.local.keys] for k, f in [("", 1.0), *ends]])
        if "stability_margin" in self.names:  # an unstable orbit is no design
            bounds = {"stability_margin": (1.0, 0.0), **bounds}
        self._signs, limits = np.array(list(bounds.values()), float).reshape(-1, 2).T
        self._limits, self._bounded, self._bounds = limits, [self.names.index(name) for name in bounds], list(bounds)
        scales = np.array([bound_scale(name, limit) or 1.0 for name, limit in zip(bounds, limits, strict=True)])
        self._scales = np.where(
            [name == "stability_margin" for name in bounds], np.maximum(np.abs(limits), MIN_MARGIN_SCALE), scales
        )
        self._least, self._aims = self.names.index(plan.minimize), [self.names.index(plan.minimize), *self._bounded]
        self._unit = abs(self.local.measures[plan.minimize] or 0.0) or 1.0
        self._known: list[Neighbourhood] = [self.local]
        self._found: dict[bytes, list[Neighbourhood] | None] = {}
        self._slopes: dict[int, FloatArray] = {}  # of those that are known, which stay
        self.rows: list[Record] = []

    def values(self, point: FloatArray) -> FloatArray:
        """Values of the keys at a place."""
        low, high = self._ends
        return np.where(self.log, low * (high / low) ** point, self.low + point * (self.high - self.low))

    def place(self, values: FloatArray) -> FloatArray:
        """Place of values of the keys, in the box."""
        low, high = self._ends
        log_fraction = np.log(np.where(self.log, values, low) / low) / np.log(high / low)
        return np.clip(np.where(self.log, log_fraction, (values - self.low) / (self.high - self.low)), 0.0, 1.0)

    def at(self, point: FloatArray) -> list[Neighbourhood] | None:
        """Orbits at a place, one for each scene of the spread; None if one is lost or lacks a measure."""
        name = point.tobytes()
        if name not in self._found:
            values, orbits = np.append(self.values(point), self.local.values[self.size :]), list[Neighbourhood]()
            try:
                for factor in self.factors:
                    wanted = values * factor
                    near = min(self._known, key=lambda k: float(np.abs((wanted - k.values) / self.local.values).max()))
                    orbits.append(near.correct(wanted))
                    self._known.append(orbits[-1])
                    if not np.isfinite(self._measures(orbits[-1])[self._aims]).all():
                        raise NoConvergenceError("a measure has no value there")
            except NoConvergenceError:
                orbits.clear()
            self._found[name] = orbits or None
            if orbits:
                own = {key: float(v) for key, v in zip(self.local.keys[: self.size], values, strict=False)}
                excess = self.violation(point)
                marks = {"objective": self.worst(point), "violation": excess, "feasible": excess <= VIOLATION_TOLERANCE}
                self.rows.append(own | self.measures_at(point) | marks)
        return self._found[name]

    def _measures(self, local: Neighbourhood) -> FloatArray:
        return np.array([local.measures[name] for name in self.names], float)

    def measures_at(self, point: FloatArray) -> Record:
        """Measures of the scene without tolerances at a place."""
        orbits = self.at(point)
        assert orbits is not None
        return {name: orbits[0].measures[name] for name in self.names}

    def bounds(self, point: FloatArray) -> FloatArray:
        """How far inside the bounds each scene is, in scales: shape (scenes · bounds,)."""
        orbits = self.at(point)
        assert orbits is not None
        measures = [self._measures(k)[self._bounded] for k in orbits]
        inside = [differences(self._bounds, values, self._limits) for values in measures]
        return np.concatenate([self._signs * apart / self._scales for apart in inside])

    def violation(self, point: FloatArray) -> float:
        """Largest violation of a bound."""
        return max(float(-self.bounds(point).min(initial=0.0)), 0.0)

    def objective(self, point: FloatArray) -> FloatArray:
        """Return the measure to minimize, relative to its size in the scene as given, shape (scenes,)."""
        orbits = self.at(point)
        assert orbits is not None
        return np.array([self._measures(k)[self._least] for k in orbits]) / self._unit

    def worst(self, point: FloatArray) -> float:
        """Return the measure to minimize, in the worst scene."""
        return float(self.objective(point).max()) * self._unit

    def gradients(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Differentiate bounds and objective by the place."""
        orbits = self.at(point)
        assert orbits is not None
        low, high = self._ends
        stretched = np.where(self.log, self.values(point) * np.log(high / low), self.high - self.low)
        bounds, objective = [], []
        for local, factor in zip(orbits, self.factors, strict=True):
            slopes = self._gradients(local) * stretched * factor[: self.size]
            bounds.append((self._signs / self._scales)[:, np.newaxis] * slopes[self._bounded])
            objective.append(slopes[self._least] / self._unit)
        return np.concatenate(bounds), np.array(objective)

    def _gradients(self, local: Neighbourhood) -> FloatArray:
        if id(local) not in self._slopes:
            self._slopes[id(local)] = np.nan_to_num(local.gradients(self.names)[0][:, : self.size])
        return self._slopes[id(local)]

    def search(self, start: FloatArray) -> FloatArray | None:
        """Find the best place from a start; None if no bounds can be kept, or the orbit is lost at once."""
        for _ in range(MAX_HALVINGS):
            if self.at(start) is not None:
                break
            start = 0.5 * (start + self.place(self.local.values[: self.size]))
        else:
            return None
        if self.violation(start) > VIOLATION_TOLERANCE:
            start = self._least_of(start, first=True)
        return self._least_of(start, first=False) if self.violation(start) <= VIOLATION_TOLERANCE else None

    def _least_of(self, start: FloatArray, *, first: bool) -> FloatArray:
        """Make the violation least, ``first``, or the objective within the bounds.

        The unknown behind the place is at least the violation, or the objective, of all scenes.
        """
        from scipy.optimize import minimize  # noqa: PLC0415  (half a second to import)

        good = start

        def inside(u: FloatArray) -> FloatArray:
            nonlocal good
            lost = self.at(u[:-1]) is None
            good = good if lost else u[:-1].copy()
            bounds, objective = self.bounds(good), self.objective(good)
            inside_by = bounds + u[-1] if first else np.append(bounds, u[-1] - objective)
            return np.asarray(inside_by - LOST_PENALTY * lost)

        def slopes(u: FloatArray) -> FloatArray:
            bounds, objective = self.gradients(u[:-1] if self.at(u[:-1]) is not None else good)
            if first:
                return np.column_stack([bounds, np.ones(len(bounds))])
            rows = np.concatenate([bounds, -objective])
            return np.column_stack([rows, np.append(np.zeros(len(bounds)), np.ones(len(objective)))])

        last = np.eye(start.size + 1)[-1]
        begin = self.violation(start) if first else float(self.objective(start).max())
        with one_thread():  # of the LAPACK of scipy, which has just been loaded
            solution = minimize(
                lambda u: u[-1],
                np.append(start, begin),
                jac=lambda _: last,
                constraints={"type": "ineq", "fun": inside, "jac": slopes},
                bounds=[*[(0.0, 1.0)] * start.size, (0.0 if first else None, None)],
                method="SLSQP",
                options={"maxiter": MAX_VIOLATION_ITERATIONS if first else MAX_ITERATIONS, "ftol": SEARCH_TOLERANCE},
            ).x[:-1]
        ends = [point for point in (np.clip(solution, 0.0, 1.0), start) if self.at(point) is not None]
        if first:
            return min(ends, key=self.violation)
        feasible = [point for point in ends if self.violation(point) <= VIOLATION_TOLERANCE * 10.0]
        return min(feasible or ends, key=lambda point: float(self.objective(point).max()))


def run_search(
    scene: Scene,
    names: Sequence[str],
    known: Record,
    bounds: Bounds,
    number: int,
    begin: dict[str, float] | None,
) -> Record:
    """Search from the start of a number, or from values of the keys.

    Returns
    -------
    record
        ``rows`` of the table of evaluations, and the ``best``: its ``values`` of the keys, ``measures``, and
        ``objective`` in the worst scene; None if the bounds cannot be kept.
    """
    plan: DesignPlan = scene.plan_of("design")
    model = DesignProblem(scene, names, known, bounds)
    with closing(model.local):
        if begin is not None:
            start = model.place(np.array(list(begin.values())))
        elif number == 0:
            start = model.place(model.local.values[: model.size])
        else:
            start = 0.5 * (sobol_points(plan.seed, model.size, number, number + 1)[0] + 1.0)
        point, best = model.search(start), None
        if point is not None:
            values = dict(zip(plan.keys, model.values(point).tolist(), strict=True))
            best = {"objective": model.worst(point), "values": values, "measures": model.measures_at(point)}
        return {"rows": [{"start": number, **row} for row in model.rows], "best": best}


def measure_design(scene: Scene, known: Record, values: dict[str, float]) -> Record:
    """Measure the attractor that a design reaches from the initial condition of a run, as in a sweep.

    Returns
    -------
    record
        ``row`` of a sweep, ``name_regime``, and whether it is that of the scene as given.
    """
    other = scene.replace(values)
    row = measure_point(other, settling_plan(other), None, (0,)).row
    if row["outcome"] != "ok":
        return {"row": {}, "regime": row["outcome"], "same": False}
    regime = name_regime(row)
    return {"row": row, "regime": regime, "same": regime == name_regime(known)}
