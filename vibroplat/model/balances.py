"""Writes what balances and loads take from the forces that resist coordinates, each its own.

Means over a time of forces that are linear follow from the means of unknowns and of their squares, by their slopes
where all is 0. What *curved* forces have beyond that is added from samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

from vibroplat.model.graph import ONE, STATIC, ZERO, Node, derivative, local, substituted, symbol
from vibroplat.model.source import Holds, P, holds, unknowns
from vibroplat.model.straight import Output, at_rest, lines_of, loads, of_system, text_of

#: Most powers of a coordinate in the force of a spring.
MAX_POWER = 9


def resisted(p: SimpleNamespace = P) -> Iterator[tuple[str, Node, Node, Node]]:
    """Go through coordinates: their names, themselves, their rates and what resists them."""
    for name, force in holds(unknowns("q"), unknowns("v"), p)._asdict().items():
        yield name, symbol(f"q_{name}"), symbol(f"v_{name}"), force


def damped() -> list[str]:
    """Return the names of coordinates with dampers."""
    return [name for name, _, v, force in resisted() if not derivative(force, v).is_zero]


def slopes() -> str:
    """Write the slopes of what resists coordinates by these and by their rates, where all are 0."""
    texts = []
    for k in (0, 1):
        each = [at_rest(derivative(force, (q, v)[k]), "qv") for _, q, v, force in resisted()]
        texts.append(f"({', '.join(text_of(n, {}) for n in each)})")
    return f"def slopes(p):\n    return {', '.join(texts)}\n"


def elastic() -> str:
    """Write the energy in the springs at a full state, by the Taylor series of their forces."""
    places = {"x": 0, "y": 1, "phi": 2, "gap": 5, "upper": 6}
    energy, names = ZERO, {symbol(f"q_{name}"): f"state[{place}]" for name, place in places.items()}
    for name, q, _, force in resisted():
        spring, power, factorial = at_rest(force, "v"), ONE, 1.0
        for k in range(1, MAX_POWER + 2):
            power, factorial = power * q, factorial * k
            constant = substituted(spring, {q: ZERO})
            if constant.varies != STATIC:
                break
            energy = energy + (1.0 / factorial) * (P.upper_mass * constant if name == "upper" else constant) * power
            spring = derivative(spring, q)
        if not spring.is_zero:
            raise ValueError(f"a spring on {name} must be a polynomial of that alone, up to power {MAX_POWER}")
    return f"def elastic(state, p):\n    return {text_of(energy, names)}\n"


def curved_means() -> str:
    """Write the means from samples of what forces have beyond slopes: power of dampers, force, and square of it."""
    head, outputs = "curved_means(samples, weights, nodes, system, out, p)", []
    for i, (_, q, v, force) in enumerate(resisted()):
        stiffness, damping = (at_rest(derivative(force, by), "qv") for by in (q, v))
        if (stiffness, damping) == (derivative(force, q), derivative(force, v)):
            continue
        linear = stiffness * q + damping * v
        beyond, power = force - linear, v * (force - at_rest(force, "v") - damping * v)
        if damping is derivative(force, v):
            power = ZERO
        for k, value in enumerate((power, beyond, beyond * (beyond + 2.0 * linear))):
            outputs.append(Output("", f"out[{k * len(Holds._fields) + i}]", value))
    if not outputs:
        return f"def {head}:\n    pass\n"
    within = ["y, weight = samples[i + 1], weights[i]", *loads(o.value for o in outputs)]
    within += lines_of([o._replace(value=local("weight") * o.value) for o in outputs])
    lines = [f"        {line.strip().replace('] = ', '] += ')}" for line in within]
    return of_system(head, ["    out[:] = 0.0", "    for i in range(nodes):", *lines])


def foundation_forces() -> str:
    """Write the forces into the foundation along x and y; an added damping of the platform is none of them."""
    p = SimpleNamespace(**vars(P) | {"damping_y": P.suspension_damping_y})
    texts = [text_of(force, {}) for name, _, _, force in resisted(p) if name in ("x", "y")]
    return f"def foundation_forces(q_x, q_y, v_x, v_y, p):\n    return {', '.join(texts)}\n"
