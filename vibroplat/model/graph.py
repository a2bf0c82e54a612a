"""Expressions as a graph, into which the equations of motion are traced.

A node is a number that depends on the motion, or a pair of numbers, one for each exciter. Equal expressions are one
node. The writers of kernels walk over the graph: :mod:`vibroplat.model.straight`, :mod:`vibroplat.model.recurrences`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from operator import add, mul, neg, sub
from types import FrameType
from typing import Any

#: How a node varies along the motion: not at all, only where an exciter begins to turn, or at all times.
STATIC, HELD, MOVING = range(3)

#: How leaves vary; all other nodes vary as the one that varies most among those that they are made of.
_LEAVES = {"sense": HELD, "symbol": MOVING, "ramp": MOVING}


class Node:
    """An expression: what is done with which other nodes. It is made by operators and by the functions below."""

    def __init__(self, op: str, args: tuple[Any, ...], *, pair: bool) -> None:
        self.op, self.args, self.pair = op, args, pair
        self.varies: int = _LEAVES.get(op, max((n.varies for n in self.parts), default=STATIC))
        self.label = ""

    @property
    def parts(self) -> list[Node]:
        """The nodes that this one is made of."""
        return [x for x in self.args if isinstance(x, Node)]

    @property
    def is_zero(self) -> bool:
        """Whether the node is the number 0."""
        return self.op == "number" and self.args[0] == 0.0

    def __add__(self, other: Node | float) -> Node:
        return _add(self, lift(other))

    def __radd__(self, other: float) -> Node:
        return _add(lift(other), self)

    def __sub__(self, other: Node | float) -> Node:
        return _add(self, -lift(other))

    def __rsub__(self, other: float) -> Node:
        return _add(lift(other), -self)

    def __mul__(self, other: Node | float) -> Node:
        return _multiply(self, lift(other))

    def __rmul__(self, other: float) -> Node:
        return _multiply(lift(other), self)

    def __truediv__(self, other: Node) -> Node:
        return ZERO if self.is_zero else node("quotient", self, other)

    def __neg__(self) -> Node:
        if self.op == "negative":
            return self.parts[0]
        return lift(-self.args[0]) if self.op == "number" else node("negative", self)


_NODES: dict[tuple[Any, ...], Node] = {}


def node(op: str, *args: Any, pair: bool | None = None) -> Node:
    """Return the node of an expression, the same one for equal expressions."""
    if pair is None:
        pair = any(x.pair for x in args if isinstance(x, Node))
    key = op, pair, *args
    if key not in _NODES:
        _NODES[key] = Node(op, args, pair=pair)
    return _NODES[key]


def lift(x: Node | float) -> Node:
    """Return the node of a number."""
    return x if isinstance(x, Node) else node("number", float(x))


ZERO, ONE = lift(0.0), lift(1.0)


def _add(a: Node, b: Node) -> Node:
    if a.is_zero:
        return b
    if b.is_zero:
        return a
    return node("difference", a, b.parts[0]) if b.op == "negative" else node("sum", a, b)


def _multiply(a: Node, b: Node) -> Node:
    if ZERO in (a, b) or ONE in (a, b):
        return ZERO if ZERO in (a, b) else (b if a is ONE else a)
    if a.op == "negative" or b.op == "negative":
        return -(-a * b) if a.op == "negative" else -(a * -b)
    if a.varies < MOVING and b.op == "product" and b.parts[0].varies < MOVING:
        return node("product", a * b.parts[0], b.parts[1])
    if a.varies < MOVING or b.varies < MOVING:
        return node("product", a, b)
    for one, other in ((a, b), (b, a)):  # what does not move stands before products of what moves
        if one.op == "product" and one.parts[0].varies < MOVING:
            return one.parts[0] * (one.parts[1] * other)
    return node("product", a, b)


def symbol(name: str, *, pair: bool = False) -> Node:
    """Return the node of an unknown: a coordinate, a rate, an acceleration or a force."""
    return node("symbol", name, pair=pair)


def parameter(name: str, *, pair: bool = False) -> Node:
    """Return the node of a field of the parameters."""
    return node("parameter", name, pair=pair)


def local(name: str) -> Node:
    """Return the node of a constant that the written kernel has found itself."""
    return node("local", name, pair=False)


def ramp(value: Node, rate: Node) -> Node:
    """Return a number that is linear in the time since the supply was last changed."""
    return node("ramp", value, rate)


def total(x: Node) -> Node:
    """Add up the numbers of both exciters."""
    return node("total", x, pair=False) if x.pair else 2.0 * x


def size(x: Node) -> Node:
    """Return the absolute value of a rate, which keeps its sense within a step."""
    return node("sense", x) * x


def circle(angle: Node, rate: Node, acceleration: Node) -> tuple[Node, Node, Node, Node]:
    """Return sine and cosine of an angle, and their second derivatives by time."""
    motion = angle, rate, acceleration
    return node("sine", angle), node("cosine", angle), node("sine_2", *motion), node("cosine_2", *motion)


def in_order(roots: Iterable[Node]) -> Iterator[Node]:
    """Go through all nodes that some are made of, each after its parts."""
    seen: set[Node] = set()

    def visit(n: Node) -> Iterator[Node]:
        if n not in seen:
            seen.add(n)
            for part in n.parts:
                yield from visit(part)
            yield n

    for root in roots:
        yield from visit(root)


def labelled(function: Callable[..., Any], *args: Any) -> Any:
    """Call a function that makes nodes, and label them with the names of the variables in its file."""

    def look(frame: FrameType, event: str, _: Any) -> None:
        if event == "return" and frame.f_code.co_filename == function.__code__.co_filename:
            for name, value in frame.f_locals.items():
                if isinstance(value, Node) and not value.label:
                    value.label = name

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        return function(*args)
    finally:
        sys.setprofile(before)


# -- numbers alone, and their derivatives ----------------------------------------------------------------------


@cache
def scalar(n: Node, i: int | str = 0) -> Node:
    """Return the node for exciter i, with nodes for numbers alone in the place of pairs."""
    if n.op in ("symbol", "parameter"):
        name = n.args[0]
        found = node(n.op, (f"{name}[{i}]" if n.op == "parameter" else f"{name}_{i}") if n.pair else name)
    elif n.op == "total":
        found = scalar(n.parts[0], 0) + scalar(n.parts[0], 1)
    else:
        found = _numbers(n, [scalar(x, i) for x in n.parts])
    if n.label and not found.label:
        found.label = f"{n.label}_{i}" if n.pair else n.label
    return found


def paired(n: Node) -> Node:
    """Return a node for both exciters of what operators and functions of numbers alone can do."""
    return _numbers(n, [paired(x) for x in n.parts]) if n.parts else n


def _numbers(n: Node, x: list[Node]) -> Node:
    """Rebuild a node from numbers in the place of its parts."""
    if n.op == "ramp":
        return x[0] + x[1] * local("elapsed")
    if n.op in ("sine_2", "cosine_2"):
        angle, rate, acceleration = x
        sine, cosine, square = node("sine", angle), node("cosine", angle), rate * rate
        return cosine * acceleration - sine * square if n.op == "sine_2" else -(sine * acceleration) - cosine * square
    return _again(n, x)


_OPERATORS: dict[str, Callable[..., Node]] = {"sum": add, "difference": sub, "product": mul, "negative": neg}


def _again(n: Node, x: list[Node]) -> Node:
    """Make a node anew from other parts."""
    if n.op in _OPERATORS:
        return _OPERATORS[n.op](*x)
    if n.op == "quotient":
        return x[0] * node("inverse", x[1])
    return node(n.op, *x) if x else n


@cache
def derivative(n: Node, by: Node) -> Node:
    """Return the derivative of a node without pairs by another, that of a sense by its argument being 0."""
    if n is by:
        return ONE
    x = n.parts
    d = [derivative(part, by) for part in x]
    if all(part.is_zero for part in d) or n.op == "sense":
        return ZERO
    if n.op == "product":
        return d[0] * x[1] + x[0] * d[1]
    if n.op == "inverse":
        return -(n * n * d[0])
    if n.op in ("sine", "cosine"):
        return node("cosine", x[0]) * d[0] if n.op == "sine" else -(node("sine", x[0]) * d[0])
    return _again(n, d)


def substituted(n: Node, values: dict[Node, Node]) -> Node:
    """Return a node without pairs with others in the place of some symbols."""

    @cache
    def walk(n: Node) -> Node:
        if n in values:
            return values[n]
        return _again(n, [walk(x) for x in n.parts])

    return walk(n)
