"""Writes what balances and loads take from the forces that resist coordinates, each its own.

Means over a time of forces that are linear follow from the means of unknowns and of their squares, by their slopes
where all is 0. What *curved* forces have beyond that is added from samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from vibroplat.model.graph import ZERO, Node, derivative, local, scalar, substituted, symbol
from vibroplat.model.source import Holds, P, holds, unknowns
from vibroplat.model.straight import OF_ARRAYS, Output, at_rest, lines_of, loads, of_system, text_of

#: Most powers of coordinates in the force of a spring, and the place of linear terms in the sum over these.
MAX_POWER, LINEAR = 9, 2

#: The parameters of forces into the foundation: an added damping of the platform is none of them.
OF_FOUNDATION = SimpleNamespace(**vars(P) | {"damping_y": P.suspension_damping_y})
#: Coordinates whose springs and dampers are between platform and foundation, and the parameters that couple these.
GROUNDED = ("x", "y", "phi")
COUPLINGS = P.stiffness_x_phi, P.stiffness_y_phi, P.damping_x_phi, P.damping_y_phi


class Resistance(NamedTuple):
    """What resists a coordinate: its name, the coordinate, its rate, and the force."""

    name: str
    q: Node
    v: Node
    force: Node

    def slope(self, letter: str, name: str) -> Node:
        """Differentiate the force by a coordinate (q) or a rate (v)."""
        return derivative(self.force, symbol(f"{letter}_{name}"))

    @property
    def stiffness(self) -> Node:
        """Slope by the own coordinate where all is 0."""
        return at_rest(self.slope("q", self.name), "qv")

    @property
    def damping(self) -> Node:
        """Slope by the own rate where all is 0."""
        return at_rest(self.slope("v", self.name), "qv")

    @property
    def is_linear(self) -> bool:
        """Whether the force is linear in all coordinates and rates."""
        slopes = [self.slope(letter, name) for letter in "qv" for name in Holds._fields]
        return all(slope is at_rest(slope, "qv") for slope in slopes)

    @property
    def beyond(self) -> Node:
        """What the force is beyond the slopes by the own coordinate and rate."""
        if not self.is_linear:
            return self.force - (self.stiffness * self.q + self.damping * self.v)
        return self.by_others("q") + self.by_others("v")

    def by_others(self, letter: str) -> Node:
        """Sum up what other coordinates (q) or rates (v) do, where the force is linear."""
        force = ZERO
        for name in Holds._fields:
            if name != self.name:
                force = force + self.slope(letter, name) * symbol(f"{letter}_{name}")
        return force

    @property
    def damped(self) -> Node:
        """The part of the force that is 0 without rates, less that of the own linear damper."""
        if all(self.slope("v", name) is at_rest(self.slope("v", name), "qv") for name in Holds._fields):
            return self.by_others("v")
        return self.force - at_rest(self.force, "v") - self.damping * self.v


def resisted(p: SimpleNamespace = P) -> Iterator[Resistance]:
    """Go through what resists coordinates."""
    for name, force in holds(unknowns("q"), unknowns("v"), p)._asdict().items():
        yield Resistance(name, symbol(f"q_{name}"), symbol(f"v_{name}"), scalar(force))


def has_beyond() -> str:
    """Write whether forces are more than the slopes by the own coordinates: springs at the centre of mass are not."""
    nodes = [r.beyond for p in (P, OF_FOUNDATION) for r in resisted(p)]
    without = [substituted(node, dict.fromkeys(COUPLINGS, ZERO)) for node in nodes]
    couples = " or ".join(f"{text_of(one, {})} != 0.0" for one in COUPLINGS)
    return f"def has_beyond(p):\n    return {couples if all(node.is_zero for node in without) else 'True'}\n"


def damped() -> list[str]:
    """Return the names of coordinates with dampers."""
    return [r.name for r in resisted() if r.force is not at_rest(r.force, "v")]


def bent() -> list[bool]:
    """Return whether the forces into the foundation along x and y, and their moment, are not linear."""
    return [not r.is_linear for r in resisted(OF_FOUNDATION) if r.name in GROUNDED]


def slopes() -> str:
    """Write the slopes of what resists coordinates by these and by their rates, where all are 0."""
    stiffnesses, dampings = [], []
    for r in resisted():
        stiffnesses.append(text_of(r.stiffness, {}))
        dampings.append(text_of(r.damping, {}))
    return f"def slopes(p):\n    return ({', '.join(stiffnesses)}), ({', '.join(dampings)})\n"


def elastic() -> str:
    """Write the energy in the springs at a full state: what their forces do on the straight way to it from 0.

    A force of degree k in the coordinates does 1/(k + 1) of its product with the way.
    """
    places = {"x": 0, "y": 1, "phi": 2, "gap": 5, "upper": 6}
    energy, way, springs = ZERO, local("way"), {}
    for r in resisted():
        springs[r.name] = P.upper_mass * at_rest(r.force, "v") if r.name == "upper" else at_rest(r.force, "v")
    check_conservative(springs)
    for name, spring in springs.items():
        force, factorial = substituted(spring, {symbol(f"q_{one}"): way * symbol(f"q_{one}") for one in springs}), 1.0
        for k in range(1, MAX_POWER + 2):
            factorial *= k
            here = substituted(force, {way: ZERO})
            each = (
                [derivative(here, symbol(f"q_{one}")) * symbol(f"q_{one}") for one in springs]
                if k == LINEAR
                else [here]
            )
            for one in each:  # the square of a coordinate stays a product of its own, whatever couples it to others
                energy = energy + (1.0 / factorial) * (one * symbol(f"q_{name}"))
            force = derivative(force, way)
        if not force.is_zero:
            raise ValueError(f"a spring on {name} must be a polynomial of coordinates, up to power {MAX_POWER}")
    names = {symbol(f"q_{name}"): f"state[{place}]" for name, place in places.items()}
    return f"def elastic(state, p):\n    return {text_of(energy, names)}\n"


def check_conservative(springs: dict[str, Node]) -> None:
    """Raise ValueError if springs have no energy: of two coordinates, each must act on the other alike."""
    draw = np.random.default_rng(1).uniform
    names = {"np": np, "p": SimpleNamespace(**{name: draw(1.0, 2.0) for name in vars(P)})}
    names |= {f"q_{name}": draw(-1.0, 1.0) for name in springs}
    for one, other in combinations(springs, 2):
        slopes = derivative(springs[one], symbol(f"q_{other}")), derivative(springs[other], symbol(f"q_{one}"))
        there, back = (eval(text_of(slope, {}), names) for slope in slopes)
        if abs(there - back) > 1e-9 * (abs(there) + abs(back)):
            raise ValueError(f"springs on {one} and {other} have no energy: they act on each other differently")


def curved_means() -> str:
    """Write the means from samples of what forces have beyond slopes: power of dampers, force, and square of it."""
    head, outputs = "curved_means(samples, weights, nodes, system, out, p)", []
    for i, (r, on_foundation) in enumerate(zip(resisted(), resisted(OF_FOUNDATION), strict=True)):
        linear = on_foundation.stiffness * r.q + on_foundation.damping * r.v
        square = on_foundation.beyond * (on_foundation.beyond + 2.0 * linear)
        if r.beyond.is_zero:
            continue
        for k, value in enumerate((r.v * r.damped, r.beyond, square)):
            outputs.append(Output("", f"out[{k * len(Holds._fields) + i}]", value))
    if not outputs:
        return f"def {head}:\n    pass\n"
    within = ["y, weight = samples[i + 1], weights[i]", *loads(o.value for o in outputs)]
    within += lines_of([o._replace(value=local("weight") * o.value) for o in outputs])
    lines = [f"        {line.strip().replace('] = ', '] += ')}" for line in within]
    return of_system(head, ["    out[:] = 0.0", "    for i in range(nodes):", *lines])


def pulls_beyond() -> str:
    """Write what forces into the foundation are beyond the slopes, and add it to what stands in a row of quantities."""
    head, outputs = "add_pulls_beyond(samples, row, system, quantities, first, p)", []
    for i, r in enumerate(resisted(OF_FOUNDATION)):
        if r.name in GROUNDED and not r.beyond.is_zero:
            outputs.append(Output("", f"quantities[row, first + {i}]", r.beyond))
    if not outputs:
        return f"def {head}:\n    pass\n"
    lines = [line.replace("] = ", "] += ") for line in lines_of(outputs)]
    return of_system(head, ["    y = samples[row]", *loads(o.value for o in outputs), *lines])


def foundation_forces() -> str:
    """Write the forces into the foundation along x and y, and their moment."""
    texts = [text_of(r.force, {}, OF_ARRAYS) for r in resisted(OF_FOUNDATION) if r.name in GROUNDED]
    return f"def forces_into_foundation(q_x, q_y, q_phi, v_x, v_y, v_phi, p):\n    return {', '.join(texts)}\n"


def between_layers() -> str:
    """Write the force between the layers over the upper one's mass."""
    outputs = [Output("", "force", r.force) for r in resisted() if r.name == "upper"]
    lines = *loads(o.value for o in outputs), *lines_of(outputs), "    return force"
    return of_system("between_layers(y, system, p)", lines)


def resist() -> str:
    """Write what resists coordinates, and its slopes by coordinates."""
    forces, rows = [], []
    for r in resisted():
        forces.append(text_of(r.force, {}))
        rows.append(f"({', '.join(text_of(r.slope('q', name), {}) for name in Holds._fields)})")
    q, v = (", ".join(f"{letter}_{name}" for name in Holds._fields) for letter in "qv")
    return f"def resist(q, v, p):\n    {q} = q\n    {v} = v\n    return ({', '.join(forces)}), ({', '.join(rows)})\n"
