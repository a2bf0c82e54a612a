"""Writes what the balances of energy and momentum, and the loads of the foundation, take from what resists coordinates.

Each is wanted as its mean over a time. Of a force that is linear it follows from the means of unknowns, of their
squares and their products; of what is left (*curved* terms), the mean is formed at samples of the unknowns.
"""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

from vibroplat.model.graph import ONE, STATIC, ZERO, Node, in_order, symbol
from vibroplat.model.source import P, holds, unknowns
from vibroplat.model.straight import PLACES, loads, of_system, text_of

#: A sum: constants by the products of what moves that they multiply.
Sum = dict[tuple[Node, ...], Node]

#: Columns of samples from which the means of curved terms are formed.
CURVED = 16


def force_on(name: str, *, foundation: bool = False) -> Node:
    """Return what resists a coordinate; with ``foundation`` as far as it acts on that."""
    p = SimpleNamespace(**vars(P) | {"damping_y": P.suspension_damping_y}) if foundation else P
    force: Node = getattr(holds(unknowns("q"), unknowns("v"), p), name)
    return P.upper_mass * force if name == "upper" else force


def name_of(n: Node) -> str:
    """Return what factors are sorted by: coordinates come before rates."""
    return str(n.args[0]) if n.op == "symbol" else n.op


def expanded(n: Node) -> Sum:
    """Multiply a node out."""
    if n.varies == STATIC:
        return {} if n.is_zero else {(): n}
    if n.op not in ("sum", "difference", "negative", "product"):
        return {(n,): ONE}
    parts, found = [expanded(x) for x in n.parts], Sum()
    if n.op == "product":
        terms = [(one + other, a * b) for (one, a), (other, b) in product(parts[0].items(), parts[1].items())]
    else:
        if n.op != "sum":
            parts[-1] = {factors: -constant for factors, constant in parts[-1].items()}
        terms = [term for part in parts for term in part.items()]
    for factors, constant in terms:
        key = tuple(sorted(factors, key=name_of))
        found[key] = found[key] + constant if key in found else constant
    return dict(sorted(found.items(), key=lambda term: [name_of(n) for n in term[0]]))


def is_damping(factors: tuple[Node, ...]) -> bool:
    """Whether a term of a force depends on rates."""
    return any(name_of(n)[:2] == "v_" for n in in_order(factors))


def dissipated(name: str) -> Sum:
    """Return the power that dampers on a coordinate take: the rate times what resists it by rates."""
    terms, rate = expanded(force_on(name)), symbol(f"v_{name}")
    return {(*factors, rate): constant for factors, constant in terms.items() if is_damping(factors)}


def elastic_energy() -> Node:
    """Return the energy in the springs: the integral of what resists coordinates without rates."""
    energy = ZERO
    for name in _RELATIVE:
        place = symbol(f"q_{name}")
        for factors, constant in expanded(force_on(name)).items():
            if is_damping(factors):
                continue
            if {*factors} - {place}:
                raise ValueError(f"a spring on {name} must be a polynomial of that coordinate: it has no energy else")
            power = place
            for n in factors:
                power = power * n
            energy = energy + (1.0 / (len(factors) + 1)) * constant * power
    return energy


def foundation_terms() -> list[tuple[str, Sum]]:
    """Return forces into the foundation along x and y and the moment, then their squares."""
    forces = [(name, force_on(name, foundation=True)) for name in ("x", "y", "phi")]
    return [(name, expanded(f)) for name, f in forces] + [(name, expanded(f * f)) for name, f in forces]


def curved() -> list[tuple[Node, ...]]:
    """Return all products whose means are formed from samples."""
    sums = [dissipated(name) for name in PLACES if name in _RELATIVE] + [terms for _, terms in foundation_terms()]
    found = dict.fromkeys(factors for terms in sums for factors in terms if not mean_of_unknowns(factors))
    if len(found) > CURVED:
        raise ValueError(f"more than {CURVED} terms of forces are not linear: raise balances.CURVED")
    return list(found)


#: Coordinates that springs and dampers resist.
_RELATIVE = ("x", "y", "phi", "gap", "upper")


def mean_of_unknowns(factors: tuple[Node, ...]) -> str:
    """Write the mean of a product that follows from the unknowns' means; "" of a curved one."""
    if not 0 < len(factors) < 3 or any(n.op != "symbol" for n in factors):
        return ""
    (first, name), last = name_of(factors[0]).split("_", 1), name_of(factors[-1])
    place = PLACES[name][0] if first == "q" else f"n + {PLACES[name][0]}"
    if len(factors) == 1 or factors[0] is factors[1]:
        return f"means[{len(factors) - 1}, {place}]"
    return f"means[3, {place}]" if name in ("x", "y", "phi") and last == f"v_{name}" else ""


def mean_of(terms: Sum, *, sizes: bool = False) -> str:
    """Write the mean of a sum, or of the sizes of its terms."""
    texts = []
    for factors, constant in terms.items():
        mean = mean_of_unknowns(factors) or f"means[4, {curved().index(factors)}]"
        if sizes:
            mean = mean.replace("means[0", "means[2") if mean.startswith("means[0") else f"abs({mean})"
        text = text_of(constant, {})
        texts.append(f"({text}) * {mean}" if constant.op in ("sum", "difference") else f"{text} * {mean}")
    return " + ".join(texts) or "0.0"


def elastic() -> str:
    """Write the energy in the springs at a full state."""
    names = {symbol(f"q_{name}"): f"state[{i}]" for i, name in enumerate(("x", "y", "phi", "", "", "gap", "upper"))}
    return f"def elastic(state, p):\n    return {text_of(elastic_energy(), names)}\n"


def dissipation() -> str:
    """Write the powers that dampers take."""
    damped = [name for name in _RELATIVE if dissipated(name)]
    lines = [
        f"    out[{i}] = {mean_of(dissipated(name))}" + (f" if {PLACES[name][1]} else 0.0" if PLACES[name][1] else "")
        for i, name in enumerate(damped)
    ]
    return of_system("dissipation(means, system, out, p)", lines)


def resisting_forces() -> str:
    """Write the means of what resists x and y, and of the sizes of its terms."""
    terms = [expanded(force_on(name)) for name in ("x", "y")]
    pairs = [f"({mean_of(t)}, {mean_of(t, sizes=True)})" for t in terms]
    return f"def resisting_forces(means, n, p):\n    return {', '.join(pairs)}\n"


def add_foundation_forces() -> str:
    """Write sums over time of the forces into the foundation, then of their squares."""
    lines = [f"    sums[{i}] += duration * ({mean_of(t)})\n" for i, (_, t) in enumerate(foundation_terms())]
    return "def add_foundation_forces(sums, means, n, duration, p):\n" + "".join(lines)


def curved_means() -> str:
    """Write the means of curved terms from samples of the unknowns, whose first row is left out."""
    head, terms = "curved_means(samples, weights, nodes, system, out, p)", curved()
    if not terms:
        return f"def {head}:\n    pass\n"
    texts = []
    for factors in terms:
        whole = ONE
        for n in factors:
            whole = whole * n
        texts.append(text_of(whole, {}))
    within = [line.strip() for line in loads([n for factors in terms for n in factors])]
    within += [f"out[{i}] += weights[i] * ({text})" for i, text in enumerate(texts)]
    lines = [f"    out[:{len(terms)}] = 0.0", "    for i in range(nodes):", "        y = samples[i + 1]"]
    return of_system(head, [*lines, *(f"        {line}" for line in within)])


def foundation_forces() -> str:
    """Write the forces into the foundation along x and y."""
    texts = [text_of(force_on(name, foundation=True), {}) for name in ("x", "y")]
    return f"def foundation_forces(q_x, q_y, v_x, v_y, p):\n    return {', '.join(texts)}\n"
