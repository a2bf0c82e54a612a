"""Writes the Taylor series of the equations, order by order, for one motion and for several side by side.

At order k the coefficients of coordinates, rates and of all that is stored are known up to k − 1, those of coordinates
and rates up to k. A node's *known* coefficient is that without the accelerations of order k, in which it is linear; the
rows' known coefficients are the right-hand sides from which the accelerations follow, and :meth:`Writer.newest` adds
what these are good for. Products of series are Cauchy's sums. Of an *early* product, one factor is a coordinate, or
sine or cosine of an angle, which are known two orders ahead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import partial
from textwrap import indent
from types import SimpleNamespace

from vibroplat.model.graph import HELD, MOVING, ONE, ZERO, Node, in_order, local, node, symbol, total
from vibroplat.model.source import P, Rows
from vibroplat.model.straight import FRICTION, traced

#: How many series of both exciters, and of the platform, may be factors of products.
PAIRS, SINGLES = 12, 10

#: The kernel, with places for what is written: statements before the loop over orders, and inside of it.
_KERNEL = """
from vibroplat.kernels.sines import sincos_pair
from vibroplat.kernels.lanes import align_stack, at, four, join, part, select, some, total, zero
from vibroplat.model.motor import both, sense_of
from vibroplat.model.platform import compliance, couplings, mobility, solve_rows
from vibroplat.model.series import SHARE
from vibroplat.model.sliding import add_friction, law, response


def {name}(motion, degree, room, p):
    y, v, quads, elapsed = motion.y, motion.v, room.quads, motion.t - p.since
    align_stack(y[2])
    none = zero(y[2])
    q_x, q_y, q_phi, q_gap, q_upper, second = y[0], y[1], y[2], y[5], y[6], y[4]
    v_x, v_y, v_phi, v_gap, v_upper, following = v[0], v[1], v[2], v[5], v[6], v[4]
    v_angle = join(v[3], v[4])
    a_x = a_y = a_phi = a_gap = a_upper = force = none
    a_angle = zero(v_angle)
    s_0, c_0, s_1, c_1 = sincos_pair(y[3], y[4])
    attached, flying, two = motion.attached, motion.flying, motion.two
    inverse = compliance(couplings(0, q_phi, s_0, c_0, p), couplings(1, q_phi, s_1, c_1, p), mobility(attached, p), p)
    sine_0, cosine_0 = join(s_0, s_1), join(c_0, c_1)
    sine_first, cosine_first = cosine_0 * v_angle, -(sine_0 * v_angle)
    sine_next, cosine_next, sine_1, cosine_1, speed_0 = sine_first, cosine_first, zero(v_angle), zero(v_angle), v_angle
    # rows are stored as they are loaded: a part of a row must else leave the processor before the whole comes back
    quads[0, 0], quads[1, 0] = four(q_x, q_y, q_phi, y[3]), four(v_x, v_y, v_phi, v[3])
{begin_along}{before}
    twice = 1.0
    {sine}[0], {cosine}[0], {sine}[1], {cosine}[1] = sine_0, cosine_0, sine_first, cosine_first
    for k in range(degree - 1):
{loops}
        share, order = SHARE[at(k + 1)], k + 1.0
        twofold = share * SHARE[at(k + 2)]
        sine_2 = order * (turned_s + cosine_1 * v_angle + cosine_next * speed_0)
        cosine_2 = -order * (turned_c + sine_1 * v_angle + sine_next * speed_0)
{lines}
        b_3, b_4 = part(-{angle})
        b = (-{x}, -{y}, -{phi}, b_3, b_4)
        lower, above = -{gap}, -{upper}
        solution = solve_rows(attached, motion.lower_share, b, lower, above, inverse, p)
{slide}        a, contact, opening, above = solution
        force = attached * contact
        a_x, a_y, a_phi, a_angle = a[0], a[1], a[2], join(a[3], a[4])
        a_gap, a_upper = flying * opening, two * above
        quads[at(k), 1] = four(second, q_gap, q_upper, force)
        quads[at(k + 2), 0] = four(a[0], a[1], a[2], a[3]) * twofold
{stores}
        q_x, q_y, q_phi = v_x * share, v_y * share, v_phi * share
        q_gap, q_upper = v_gap * share, v_upper * share
        v_x, v_y, v_phi, v_angle = a_x * share, a_y * share, a_phi * share, a_angle * share
        v_gap, v_upper = a_gap * share, a_upper * share
        second, following = following, a[4] * twofold
        sine_next, cosine_next = (sine_2 + cosine_0 * a_angle) * twofold, (cosine_2 - sine_0 * a_angle) * twofold
        sine_1, cosine_1 = sine_first, cosine_first
        {sine}[at(k + 2)], {cosine}[at(k + 2)] = sine_next, cosine_next
{ends}
        twice = 2.0
    share = SHARE[at(degree)]
    quads[at(degree - 1), 1] = four(second, q_gap, q_upper, none)
    quads[at(degree), 1] = four(following, v_gap * share, v_upper * share, none)
{end_along}"""
#: What transport adds before the loop, in it and behind it: s and F_t.
_BEGIN_ALONG = """    q_along, v_along = motion.y[8], motion.v[8]
    slope, height, material = motion.slope, motion.height, 1.0 / motion.share
    reply = response(inverse, height, attached * p.lower_mass, motion.share)
    friction_law = law(motion.stuck, motion.sliding, reply)
    a_along = friction = none
"""
_SLIDE = """        free_along = -{along} * motion.share
        solution, a_along, friction = add_friction(solution, free_along, height, attached, reply, friction_law)
        a_along = (1.0 - motion.stuck) * a_along
        quads[at(k), 2], q_along = four(q_along, friction, none, none), v_along * share
        quads[at(k + 1), 2], v_along = four(q_along, none, none, none), a_along * share
"""
_END_ALONG = """    quads[at(degree - 1), 2] = four(q_along, none, none, none)
    quads[at(degree), 2] = four(v_along * share, none, none, none)
"""

#: What transport has of the parameters, by their names in the texts.
_LOCALS = ("slope", "height", "material")
#: Names that the texts use otherwise.
_TAKEN = """y v p a b k j i m s c w n order share twofold twice free second following lower above contact opening
inverse elapsed slope height material room motion speed sine cosine friction force none quads degree reply attached
flying two solution"""


class Writer:
    """What is known while a series is written."""

    def __init__(self, rows: Rows, angle: Node) -> None:
        self.rows = {name: row for name, row in rows._asdict().items() if name != "law"}
        self.nodes = list(in_order(self.rows.values()))
        self.uses = Counter(x for n in self.nodes for x in n.parts)
        self.has_newest: dict[Node, bool] = {}
        for n in self.nodes:
            newest = n.op == "symbol" and (n.args[0][:2] == "a_" or n.args[0] in ("force", "friction"))
            self.has_newest[n] = newest or any(self.has_newest[x] for x in n.parts)
        self.before: dict[str, str] = {}  # statements before the loop: names and texts
        self.shifts: list[str] = []  # statements at its end
        self.ends = ["if k < 3:", "    pass"]  # where coefficients of polynomials follow each other
        self.lines: list[str] = []  # of known coefficients
        self.stems: dict[Node, str] = {}
        self.names: dict[Node, str] = {}  # of what has been written, as a constant or as a known coefficient
        self.slots: dict[Node, str] = {}  # of factors: where their whole coefficients are stored
        self.first: list[Node] = []  # factors whose coefficients of order 0 are wanted
        self.sums: list[tuple[str, str, bool, bool]] = []  # name, term, whether half of it is formed, whether of pairs
        self.speed, self.sine, self.cosine = symbol("v_angle", pair=True), node("sine", angle), node("cosine", angle)
        self.has_newest |= {self.speed: False, self.sine: False, self.cosine: False}
        for n in (self.sine, self.cosine, self.speed):
            self.slot(n)

    def stem(self, n: Node) -> str:
        """Return a node's name, which no other has."""
        if n not in self.stems:
            stem = n.label or (n.args[0] if n.op in ("symbol", "parameter") else n.op)
            taken = {*self.stems.values(), *_TAKEN.split()}
            self.stems[n] = next(name for i in range(len(taken) + 1) if (name := f"{stem}{i or ''}") not in taken)
        return self.stems[n]

    def slot(self, n: Node) -> str:
        """Return where the coefficients of a factor are stored."""
        if n not in self.slots:
            kind, most = ("pair", PAIRS) if n.pair else ("single", SINGLES)
            number = sum(other.pair == n.pair for other in self.slots)
            if number == most:
                raise ValueError(
                    f"more than {most} series of kind {kind} are factors: raise recurrences.{kind.upper()}S"
                )
            self.slots[n] = f"room.{kind}_{number}"
        return self.slots[n]

    def full(self, n: Node) -> str:
        """Name a factor's last whole coefficient."""
        self.slot(n)
        return str(n.args[0]) if n.op == "symbol" and self.has_newest[n] else f"{self.stem(n)}_full"

    def constant(self, n: Node) -> str:
        """Write what does not move; what is more than a number of the parameters is found before the loop."""
        if n in self.names:
            return self.names[n]
        if n.op in ("number", "local") or (n.op == "parameter" and not n.pair):
            return f"{'p.' if n.op == 'parameter' else ''}{n.args[0]}"
        if n.op == "sense":
            return self.sense(n)
        parts = [self.constant(x) for x in n.parts]
        text = f"both(p.{n.args[0]})" if n.op == "parameter" else _joined(n, parts)
        if n.varies == HELD:
            return f"({text})"
        self.before[self.stem(n)] = text
        self.names[n] = self.stem(n)
        return self.names[n]

    def sense(self, n: Node) -> str:
        """Write the sense of a rate; of one that is 0 it is that of the first order that is not."""
        speed, name = str(n.parts[0].args[0]), self.stem(n)
        self.before |= {name: f"sense_of({speed})", f"{name}_rests": f"some({speed} == 0.0)"}
        self.shifts += [f"if {name}_rests:", f"    {name} = select({name} == 0.0, sense_of({speed}), {name})"]
        self.names[n] = name
        return name

    def finite(self, n: Node) -> list[str]:
        """Return the coefficients of what is a polynomial of time, none of all else."""
        if n.varies < MOVING:
            return [self.constant(n)]
        if n.op == "ramp":
            value, rate = (self.constant(x) for x in n.parts)
            self.before.setdefault(f"{self.stem(n)}_0", f"{value} + {rate} * elapsed")
            return [f"{self.stem(n)}_0", rate]
        if n.op != "product" or not all(x.op == "ramp" or x.varies < MOVING for x in n.parts):
            return []
        a, b = (self.finite(x) for x in n.parts)
        orders = range(len(a) + len(b) - 1)
        return [" + ".join(f"{a[i]} * {b[k - i]}" for i in range(len(a)) if 0 <= k - i < len(b)) for k in orders]

    def register(self, n: Node, coefficients: list[str]) -> str:
        """Write a polynomial of time as the coefficient that is due, which the next one follows."""
        names = [f"{self.stem(n)}_now", *(f"{self.stem(n)}_in_{i}" for i in range(1, len(coefficients)))]
        self.before |= dict(zip(names, coefficients, strict=True))
        self.ends.append(f"    {', '.join(names)} = {', '.join([*names[1:], _nothing(n)])}")
        self.names[n] = names[0]
        return names[0]

    def at_zero(self, n: Node) -> str:
        """Write the coefficient of order 0 of what has no accelerations."""
        if n.varies < MOVING:
            return self.constant(n)
        if n in (self.sine, self.cosine):
            return f"{n.op}_0"
        name = f"{self.stem(n)}_0"
        if name not in self.before:
            text = str(n.args[0]) if n.op == "symbol" else ""
            text = text or [*self.finite(n), ""][0] or _joined(n, [self.at_zero(x) for x in n.parts])
            self.before.setdefault(name, text)
        return name

    def known(self, n: Node) -> str:
        """Write a node's known coefficient; "" for none."""
        if n in self.names and n.varies == MOVING:
            return self.names[n]
        if n.is_zero or (self.has_newest[n] and not n.parts):
            return ""
        if n.op in ("symbol", "sine_2", "cosine_2"):
            return str(n.args[0]) if n.op == "symbol" else n.op
        coefficients = self.finite(n)
        if coefficients:
            return f"{self.stem(n)}_now" if f"{self.stem(n)}_now" in self.before else self.register(n, coefficients)
        if n.op in ("product", "quotient"):
            text = self.product(n) if n.op == "product" else self.quotient(n)
        else:
            text = _joined(n, [self.known(x) for x in n.parts])
        if text and (self.uses[n] > 1 or n.label or n in self.slots or "_middle" in text):
            self.names[n] = self.stem(n)
            self.lines.append(f"{self.stem(n)} = {text}")
            return self.stem(n)
        return text

    def product(self, n: Node) -> str:
        """Write the known coefficient of a product."""
        a, b = n.parts
        if a.varies < MOVING:
            known = self.known(b)
            return known and f"{self.constant(a)} * {_within(known)}"
        for one, other in ((a, b), (b, a)):
            if one.op == "ramp":
                value, rate = self.finite(one)
                last = self.full(other)
                return f"{value} * {_within(self.known(other))} + {rate} * {last}"
        if a is b:
            return f"{self.middle(n, a, b)} + twice * {self.at_zero(a)} * {_within(self.known(a))}"
        one, other = (b, a) if self.has_newest[a] or self.is_early(b) else (a, b)
        known = self.known(other)
        newest = f" + {self.at_zero(one)} * {_within(known)}" if known else ""
        if self.is_early(one):
            return f"{self.middle(n, one, other)} + {self.rate_at_zero(one)} * {self.full(other)}{newest}"
        return f"{self.middle(n, one, other)} + {_within(self.known(one))} * {self.start(other)}{newest}"

    def is_early(self, n: Node) -> bool:
        """Whether a factor is known two orders ahead."""
        return n in (self.sine, self.cosine) or (n.op == "symbol" and n.args[0][:2] == "q_")

    def rate_at_zero(self, n: Node) -> str:
        """Name the coefficient of order 1 of an early factor."""
        if n.op != "symbol":
            return f"{n.op}_first"
        return self.at_zero(symbol(f"v_{n.args[0][2:]}", pair=n.pair))

    def quotient(self, n: Node) -> str:
        """Write the known coefficient of a quotient, which is 0 where what divides is 0."""
        a, b = n.parts
        self.before[f"{self.stem(n)}_share"] = f"select({self.at_zero(b)} == 0.0, 0.0, 1.0 / {self.at_zero(b)})"
        middle = self.middle(n, b, n)
        known, below = self.known(a), self.known(b)
        return f"({known} - ({middle} + {_within(below)} * {self.start(n)})) * {self.stem(n)}_share"

    def middle(self, n: Node, a: Node, b: Node) -> str:
        """Let the middle terms of a product be summed up."""
        places = ("[i]", "[m]") if self.is_early(a) else ("[earlier]", "[later]")
        places = ("[i]", "[m]") if a is b else places
        term = f"{self.slot(a)}{places[0]} * {self.slot(b)}{places[1]}"
        self.sums.append((f"{self.stem(n)}_middle", term, a is b, n.pair))
        return f"{self.stem(n)}_middle"

    def start(self, n: Node) -> str:
        """Name the coefficient of order 0 of a factor, 0 until it is known."""
        self.slot(n)
        if n not in self.first:
            self.first.append(n)
            self.before[f"{self.stem(n)}_start"] = _nothing(n)
        return f"{self.stem(n)}_start"

    def newest(self, n: Node) -> str:
        """Write what the newest accelerations add to a node."""
        texts = []
        for (newest, totalled), slope in self.slopes(n).items():
            text = str(newest.args[0]) if slope is ONE else f"{_within(self.at_zero(slope))} * {newest.args[0]}"
            texts.append(f"total({text})" if totalled else text)
        return " + ".join(texts)

    def slopes(self, n: Node) -> dict[tuple[Node, bool], Node]:
        """Return by what the newest accelerations count in a node, and whether those of both exciters are added up."""
        if n.op == "symbol" or not self.has_newest[n]:
            return {(n, False): ONE} if self.has_newest[n] else {}
        if n.op in ("sine_2", "cosine_2"):
            return {(n.parts[2], False): self.cosine if n.op == "sine_2" else -self.sine}
        found = [self.slopes(x) for x in n.parts]
        if n.op == "total":
            return {(s, s.pair): c if s.pair else total(c) for (s, _), c in found[0].items()}
        if n.op in ("product", "quotient"):
            one = n.parts[0 if found[1] else 1]
            if self.has_newest[one] or (n.op == "quotient" and found[1]):
                raise ValueError("the equations must be linear in accelerations and forces of contact")
            slopes = found[0] or found[1]
            return {key: c / one if n.op == "quotient" else one * c for key, c in slopes.items()}
        if n.op in ("negative", "difference"):
            found[-1] = {key: -c for key, c in found[-1].items()}
        joined = dict(found[0])
        for key, c in (found[1] if len(found) > 1 else {}).items():
            joined[key] = joined[key] + c if key in joined else c
        return joined

    def stores(self) -> Iterator[str]:
        """Write how the whole coefficients of factors follow from the accelerations, and store them."""
        for n, slot in list(self.slots.items()):
            if n in (self.sine, self.cosine):
                continue
            if n.op != "symbol" or not self.has_newest[n]:
                self.before[self.full(n)] = _nothing(n)
                yield f"{self.full(n)} = {' + '.join(filter(None, (self.known(n), self.newest(n))))}"
            if not self.is_early(n):
                yield f"{slot}[at(k)] = {self.full(n)}"
        if self.first:
            yield "if k == 0:"
            yield from (f"    {self.start(n)} = {self.full(n)}" for n in self.first)

    def loops(self) -> Iterator[str]:
        """Write the loops that sum up the middle terms of products: of squares half of them are formed."""
        sine, cosine, speed = (self.slots[n] for n in (self.sine, self.cosine, self.speed))
        yield "turned_s = turned_c = zero(v_angle)"
        yield from (f"{name} = {'zero(v_angle)' if pair else 'none'}" for name, _, _, pair in self.sums)
        yield "for j in range(2, k + 1):"
        yield "    i, m, earlier, later = at(j), at(k - j), at(j - 1), at(k - j + 1)"
        yield f"    s, c, w = {sine}[i], {cosine}[i], {speed}[later]"
        yield "    turned_s, turned_c = turned_s + c * w, turned_c + s * w"
        short = {f"{sine}[i]": "s", f"{cosine}[i]": "c"}
        for name, term, half, _ in self.sums:
            first, _, second = term.partition(" * ")
            if not half:
                yield f"    {name} += {short.get(first, first)} * {second}"
        halves = [(name, term) for name, term, half, _ in self.sums if half]
        if halves:
            yield "for j in range(1, (k + 1) // 2):"
            yield "    i, m = at(j), at(k - j)"
            yield from (f"    {name} += {term}" for name, term in halves)
            yield from (f"{name} += {name}" for name, _ in halves)
            yield "if k > 1 and k % 2 == 0:"
            yield "    i = m = at(k // 2)"
            yield from (f"    {name} += {term}" for name, term in halves)


def _nothing(n: Node) -> str:
    """Write a coefficient that is 0."""
    return "zero(v_angle)" if n.pair else "none"


def _within(text: str) -> str:
    """Write a text inside of another."""
    return f"({text})" if " " in text else text


def _joined(n: Node, texts: list[str]) -> str:
    """Write a node from texts of its parts, some of which may be empty."""
    if not any(texts):
        return ""
    if n.op == "total":
        return f"total({texts[0]})"
    if n.op == "negative":
        return f"-{_within(texts[0])}"
    a, b = texts
    if n.op in ("product", "quotient"):
        return f"{_within(a)} {'*' if n.op == 'product' else '/'} {_within(b)}"
    if n.op == "sum":
        return f"{a} + {b}" if a and b else a or b
    return f"{a} - {_within(b)}" if a and b else a or f"-{_within(b)}"


def series(*, transport: bool) -> str:
    """Write the kernel that expands motions, with transport or without."""
    names = ("slope", "deck_height", "material_mass")
    along = {name: local(short) if transport else ZERO for name, short in zip(names, _LOCALS, strict=True)}
    rows, found = traced(SimpleNamespace(**vars(P) | along), FRICTION if transport else ZERO)
    w = Writer(rows, found["q_angle"])
    known = {name: _within(w.known(row) or "none") for name, row in w.rows.items()}
    stores = [*w.stores()]
    ahead = [f"{slot}[at(k + 1)] = {n.args[0]}" for n, slot in w.slots.items() if n.op == "symbol" and w.is_early(n)]
    before = [f"{name} = {text}" for name, text in w.before.items()]
    blocks = {"loops": [*w.loops()], "lines": w.lines, "stores": stores, "ends": [*ahead, *w.ends, *w.shifts]}
    return _KERNEL.format(
        name="expand_along" if transport else "expand_plain",
        sine=w.slots[w.sine],
        cosine=w.slots[w.cosine],
        before=indent("\n".join(before), "    "),
        begin_along=_BEGIN_ALONG if transport else "",
        slide=_SLIDE.format(**known) if transport else "",
        end_along=_END_ALONG if transport else "",
        **{name: indent("\n".join(lines), "        ") for name, lines in blocks.items()},
        **known,
    )


plain, along = partial(series, transport=False), partial(series, transport=True)
