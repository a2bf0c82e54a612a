"""Writes rows of the equations, their Jacobian and rates as straight code, for one motion and all systems.

What a system does not have is 0 in one text for all of them, and what only some have stands below a condition.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from types import SimpleNamespace
from typing import NamedTuple

from vibroplat.model.graph import (
    ZERO,
    Node,
    derivative,
    in_order,
    labelled,
    local,
    node,
    paired,
    scalar,
    substituted,
    symbol,
)
from vibroplat.model.source import P, Rows, equations, motor, resistance, unknowns

#: Coordinates: their places among those of a system, and what a system must have to have them.
PLACE_TEXTS = {
    "x": ("0", ""),
    "y": ("1", ""),
    "phi": ("2", ""),
    "angle_0": ("3", ""),
    "angle_1": ("4", ""),
    "gap": ("5", "flies"),
    "upper": ("upper", "two"),
    "along": ("n - 1", "slides"),
}
#: Rows, alike.
ROW_TEXTS = {name: (f"n + {place}", condition) for name, (place, condition) in PLACE_TEXTS.items()}
ROW_TEXTS |= {"gap": ("lower", "layers > 0"), "law": ("2 * n + 1", "touches")}
#: Forces of contact, alike.
FORCE_TEXTS = {"force": ("2 * n", "contact"), "friction": ("2 * n + 1", "touches")}
FRICTION = symbol("friction")

_HEAD = """
import numpy as np
from vibroplat.model.platform import Unbalance
from vibroplat.model.systems import ALGEBRAIC, DIFFERENTIAL, LAYERS, SENSE, SLIDES, UPPER
"""
#: What the texts know of a system.
_SYSTEM = """
    n, layers = DIFFERENTIAL[system] // 2, LAYERS[system]
    contact, slides, upper = ALGEBRAIC[system], SLIDES[system], UPPER[system]
    flies, two, touches = layers > 0 and not contact, layers == 2, slides and contact
    lower = 2 * n if contact else n + 5
    stuck = 1.0 if SENSE[system] == 0.0 else 0.0
    slips, sliding = 1.0 - stuck, p.kinetic_friction * SENSE[system]
"""
_SIGNS = {"sum": "+", "difference": "-", "product": "*"}
_CALLS = {"sine": "np.sin({})", "cosine": "np.cos({})", "inverse": "0.0 if {0} == 0.0 else 1.0 / ({0})"}
_CALLS |= {"sense": "np.copysign(1.0, {})", "negative": "-{}"}
#: The same for arrays of Python.
OF_ARRAYS = _CALLS | {"inverse": "np.where({0} == 0.0, 0.0, 1.0 / np.where({0} == 0.0, 1.0, {0}))"}
#: The same for lanes.
_OF_LANES = {
    "inverse": "select({0} == 0.0, 0.0, 1.0 / ({0}))",
    "sense": "select({} < 0.0, -1.0, 1.0)",
    "negative": "-{}",
}
#: What stands in brackets inside of others: as their first and as their second part.
_LOOSE: dict[tuple[str, int], tuple[str, ...]] = {
    **dict.fromkeys([("sum", 0), ("difference", 0)], ()),
    # what exactly cancels between exciters that mirror each other must be added up first
    **dict.fromkeys([("sum", 1), ("difference", 1)], ("sum", "difference")),
    ("product", 0): ("sum", "difference"),
    ("product", 1): ("sum", "difference", "product", "negative"),
}
#: Names that the texts use otherwise.
_TAKEN = ("n", "layers", "contact", "slides", "upper", "flies", "two", "touches", "lower", "stuck", "slips", "sliding")
#: What is always given a name.
_NAMED = ("sine", "cosine", "inverse", "sense")


class Output(NamedTuple):
    """Where a number is stored, and below which condition."""

    condition: str
    place: str
    value: Node


def traced(p: SimpleNamespace = P, friction: Node = FRICTION) -> tuple[Rows, dict[str, Node]]:
    """Trace the equations: rows of pairs, and all coordinates, rates and accelerations by their names."""
    motion = {letter: unknowns(letter) for letter in "qva"}
    rows = labelled(equations, *motion.values(), symbol("force"), friction, p)
    return rows, {f"{letter}_{name}": n for letter, of in motion.items() for name, n in vars(of).items()}


def of_one(rows: Rows) -> dict[str, Node]:
    """Return the rows by their names, with those of both exciters one by one."""
    found = {name: scalar(row) for name, row in rows._asdict().items() if name != "angle"}
    return found | {f"angle_{i}": scalar(rows.angle, i) for i in (0, 1)}


def lines_of(outputs: list[Output], calls: Mapping[str, str] = _CALLS) -> Iterator[str]:
    """Write statements, those below conditions after the others; what is used more than once has a name."""
    names: dict[Node, str] = {}
    uses = Counter(part for n in in_order(o.value for o in outputs) for part in n.parts)
    uses.update(o.value for o in outputs)
    uses.update(n.parts[0] for n in [*uses] if n.op == "inverse")
    outputs = sorted(outputs, key=lambda o: o.condition)
    taken = {*_TAKEN}
    for condition, group in groupby(outputs, key=lambda o: o.condition):
        known, stores = dict(names), list(group)
        indent = "        " if condition else "    "
        if condition:
            yield f"    if {condition}:"
        for n in in_order(o.value for o in stores):
            if n.parts and n not in known and (uses[n] > 1 or n.op in _NAMED) and n.op != "negative":
                text = text_of(n, known, calls)
                known[n] = name_of(n, taken)
                yield f"{indent}{known[n]} = {text}"
        for output in stores:
            yield f"{indent}{output.place} = {text_of(output.value, known, calls)}"
        if not condition:
            names = known


def name_of(n: Node, taken: set[str]) -> str:
    """Choose a name that is not taken yet."""
    stem = n.label or n.op
    name, number = stem, 1
    while name in taken:
        number += 1
        name = f"{stem}_{number}" if stem[-1].isalpha() else f"{stem}_v{number}"
    taken.add(name)
    return name


def text_of(n: Node, names: dict[Node, str], calls: Mapping[str, str] = _CALLS) -> str:
    """Write an expression."""
    if n in names:
        return names[n]
    if n.op == "number":
        return repr(n.args[0])
    if n.op == "parameter":
        return f"both(p.{n.args[0]})" if n.pair else f"p.{n.args[0]}"
    if not n.parts:
        return str(n.args[0])
    texts = [text_of(x, names, calls) for x in n.parts]
    if n.op not in _SIGNS:
        inside = f"({texts[0]})" if n.op == "negative" and " " in texts[0] else texts[0]
        return calls[n.op].format(inside)
    loose = [x not in names and x.op in _LOOSE[n.op, i] for i, x in enumerate(n.parts)]
    a, b = (f"({text})" if within else text for text, within in zip(texts, loose, strict=True))
    return f"{a} {_SIGNS[n.op]} {b}"


#: Where coordinates, rates and accelerations are.
_UNKNOWNS = {"q": "y[{}]", "v": "y[n + {}]", "a": "yp[n + {}]"}


def loads(values: Iterable[Node]) -> Iterator[str]:
    """Write where the unknowns that are needed come from."""
    needed = {n.args[0] for n in in_order(values) if n.op in ("symbol", "local")}
    for letter, where in _UNKNOWNS.items():
        for name, (place, condition) in PLACE_TEXTS.items():
            if f"{letter}_{name}" in needed:
                otherwise = f" if {condition} else 0.0" if condition else ""
                yield f"    {letter}_{name} = {where.format(place)}{otherwise}"
    for name, (place, condition) in FORCE_TEXTS.items():
        if name in needed:
            yield f"    {name} = y[{place}] if {condition} else 0.0"
    if "elapsed" in needed:
        yield "    elapsed = t - p.since"


def of_system(head: str, lines: Iterable[str]) -> str:
    """Write a function of a system from its name with arguments and its lines."""
    return f"{_HEAD}\n\ndef {head}:{_SYSTEM}" + "".join(f"{line}\n" for line in lines)


def write(head: str, outputs: list[Output], *before: str) -> str:
    """Write a function of a system from its name with arguments and what it stores."""
    return of_system(head, [*loads(o.value for o in outputs), *before, *lines_of(outputs)])


def all_rows() -> str:
    """Write F(t, y, y′)."""
    found = of_one(traced()[0])
    outputs = [Output(ROW_TEXTS[name][1], f"res[{ROW_TEXTS[name][0]}]", row) for name, row in found.items()]
    kinematic = "    for i in range(n):", "        res[i] = yp[i] - y[n + i]"
    return write("all_rows(system, t, y, yp, res, p)", outputs, *kinematic)


def dynamic_jacobian() -> str:
    """Write the dynamic rows of ∂F/∂y + c_j ∂F/∂y′."""
    outputs, cj = [], local("cj")
    for name, row in of_one(traced()[0]).items():
        (place, has), columns = ROW_TEXTS[name], []
        for other, (column, condition) in PLACE_TEXTS.items():
            q, v, a = (derivative(row, symbol(f"{letter}_{other}")) for letter in "qva")
            columns += [(column, condition, q), (f"n + {column}", condition, v + cj * a)]
        columns += [(column, condition, derivative(row, symbol(f))) for f, (column, condition) in FORCE_TEXTS.items()]
        for column, condition, value in columns:
            if not value.is_zero:
                both = " and ".join(filter(None, dict.fromkeys((has, condition))))
                outputs.append(Output(both, f"jac[{place}, {column}]", value))
    clear = "    for i in range(n, y.size):", "        for j in range(y.size):", "            jac[i, j] = 0.0"
    return write("dynamic_jacobian(system, t, y, yp, cj, jac, p)", outputs, *clear)


def mass_matrix() -> str:
    """Write what multiplies the n accelerations in the dynamic rows without that of F_c."""
    outputs = []
    for name, row in of_one(traced()[0]).items():
        place, has = PLACE_TEXTS.get(name, ("", "never"))
        for other, (column, condition) in PLACE_TEXTS.items():
            value = derivative(row, symbol(f"a_{other}"))
            if not value.is_zero and has != "never":
                both = " and ".join(filter(None, dict.fromkeys((has, condition))))
                outputs.append(Output(both, f"mass[{place}, {column}]", value))
    clear = "    for i in range(n):", "        for j in range(n):", "            mass[i, j] = 0.0"
    return write("mass_matrix(system, y, mass, p)", outputs, *clear)


def at_rest(n: Node, letters: str) -> Node:
    """Return a node where coordinates (q), rates (v) or accelerations (a) and forces of contact are 0."""
    absent = [f"{letter}_{name}" for name in PLACE_TEXTS for letter in letters] + [*FORCE_TEXTS]
    return substituted(n, {symbol(name): ZERO for name in absent})


def loads_on_rows() -> str:
    """Write the right-hand sides of the dynamic rows: forces, with their signs, as they are without acceleration."""
    found = of_one(traced()[0])
    outputs = [
        Output(ROW_TEXTS[name][1], f"b[{ROW_TEXTS[name][0]}]", -at_rest(row, "a"))
        for name, row in found.items()
        if name != "law"
    ]
    return write("loads(system, t, y, b, p)", outputs)


def rates_of_rows() -> str:
    """Write minus the rates of the dynamic rows at constant accelerations and forces of contact."""
    outputs = []
    for name, row in of_one(traced()[0]).items():
        rate = derivative(row, local("elapsed"))
        for other in PLACE_TEXTS:
            for before, after in (("q", "v"), ("v", "a")):
                rate = rate + derivative(row, symbol(f"{before}_{other}")) * symbol(f"{after}_{other}")
        if name != "law":
            outputs.append(Output(ROW_TEXTS[name][1], f"b[{ROW_TEXTS[name][0]}]", -rate))
    return write("rates_of_rows(system, t, y, yp, b, p)", outputs)


def couplings() -> str:
    """Write how exciter i couples with the platform in the mass matrix, from sine and cosine of its angle."""
    rows, found = traced()
    row = scalar(rows.angle, "i")
    angle = scalar(found["q_angle"], "i")
    names = {node("sine", angle): "sine", node("cosine", angle): "cosine", symbol("q_phi"): "phi"}
    values = [text_of(derivative(row, symbol(f"a_{name}")), names) for name in ("x", "y", "phi")]
    return f"{_HEAD}\n\ndef couplings(i, phi, sine, cosine, p):\n    return Unbalance({', '.join(values)})\n"


def torque_of_one() -> str:
    """Write the torque of exciter i's motor."""
    found = scalar(labelled(motor, symbol("speed"), P), "i")
    lines = "\n".join(lines_of([Output("", "torque", found)]))
    return f"{_HEAD}\n\ndef torque_of_one(i, t, speed, p):\n    elapsed = t - p.since\n{lines}\n    return torque\n"


def of_lanes(head: str, law: Callable[[Node, SimpleNamespace], Node]) -> str:
    """Write a torque of both exciters side by side, at one time or several."""
    found = paired(labelled(law, symbol("speed", pair=True), P))
    lines = "\n".join(lines_of([Output("", "torque", found)], _OF_LANES))
    imports = "from vibroplat.kernels.lanes import select\nfrom vibroplat.model.motor import both\n"
    return f"{imports}\n\ndef {head}:\n    elapsed = t - p.since\n{lines}\n    return torque\n"


def torques() -> str:
    """Write the torques of the motors."""
    return of_lanes("motor_torques(t, speed, p)", motor)


def resistances() -> str:
    """Write the resistances to rotation."""
    return of_lanes("resistances(speed, p)", resistance).replace("    elapsed = t - p.since\n", "")
