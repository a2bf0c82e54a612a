"""Curves as drawings inside the page: they stretch to any width, their texts are HTML and do not."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from vibroplat.config.digits import tick_text
from vibroplat.page.text import escape

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Units of a drawing along both axes, which the script reads values from: a screen has fewer points.
WIDTH, HEIGHT = 10_000, 3_000
#: Parts of the width in which a curve keeps its first, smallest, largest and last point, and parts of both axes in
#: which one of many dots is kept: about a point of a wide screen, and half the size of a dot.
COLUMNS, DOTS = 800, (400, 200)
#: Least range of an axis over its largest value, and of phases (rad): less is noise.
LEAST, LEAST_PHASE = 1e-3, math.radians(2.0)
#: Room above and below curves, over their range.
ROOM = 0.06
#: What stands between dollar signs in labels of figures, and its symbols.
_MATHEMATICS = re.compile(r"(?<!\\)\$(.*?)(?<!\\)\$")
_SYMBOLS = {"varphi": "φ", "Delta": "Δ", "mu": "μ", "zeta": "ζ", "gamma": "γ", "pi": "π", "omega": "ω", "sigma": "σ"}
#: Step of an axis of angles over more than half a turn (°).
QUARTER = 90.0
#: What the script shows of a pointer: a line, and what it chooses.
_UNSEEN = '<div class="cursor" hidden></div><div class="pick" hidden></div>'
#: Numbers on an axis, about, across and up.
TICKS = (6, 5)


def plain_text(label: str) -> str:
    """Return a label of a figure, in which mathematics stands between dollar signs, as plain text."""

    def spoken(match: re.Match[str]) -> str:
        inside = re.sub(r"\\([A-Za-z]+)", lambda word: _SYMBOLS.get(word[1], word[1]), match[1])
        return re.sub(r"[_{}]", "", inside)

    return _MATHEMATICS.sub(spoken, label).replace(r"\$", "$").replace("\n", " ")


# -- axes --------------------------------------------------------------------------------------------------------------


@dataclass
class Scale:
    """An axis between two values.

    Attributes
    ----------
    low, high
        Its ends (SI units).
    unit, factor
        In which its numbers are shown.
    label
        What is said below it.
    log
        Whether it is logarithmic; both ends are positive then.
    names
        What stands at 0, 1, 2 … instead of numbers.
    """

    low: float
    high: float
    unit: str = ""
    factor: float = 1.0
    _: KW_ONLY
    label: str = ""
    log: bool = False
    names: Sequence[str] = ()

    @classmethod
    def of(
        cls, values: Floats, unit: str, factor: float, *, least: float | None = None, log: bool = False, label: str = ""
    ) -> Scale:
        """Return an axis with room for some values, whose numbers are shown in a unit.

        With ``least`` it begins at 0 and goes at least to there.
        """
        known = values[np.isfinite(values)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
        if log and low > 0.0:
            part = (high / low) ** ROOM if high > low else 1.2
            return cls(low / part, high * part, unit, factor, label=label, log=True)
        if least is not None:
            low, high = min(low, 0.0), max(high, least)
        floor = LEAST_PHASE if unit == "°" else LEAST * max(abs(low), abs(high)) or 1.0
        missing = 0.5 * max(floor - (high - low), 0.0)
        room = missing + ROOM * (high - low + 2.0 * missing)
        return cls(low - room, high + room, unit, factor, label=label)

    def share(self, values: Any) -> Floats:
        """Return where values lie between the ends, which are 0 and 1."""
        numbers = np.asarray(values, dtype=float)
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.log(numbers / self.low) / math.log(self.high / self.low)
        return (numbers - self.low) / ((self.high - self.low) or 1.0)

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return round numbers on the axis: their places and texts."""
        if self.names:
            every = -(-len(self.names) // 14)
            return [(float(self.share(index)), name) for index, name in enumerate(self.names) if index % every == 0]
        low, high = self.low * self.factor, self.high * self.factor
        if self.log and high > 3.0 * low:
            powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            steps = (1, 2, 5) if len(powers) < 4 else (1,)
            ticks = [(step * 10.0**power, 10.0**power) for power in powers for step in steps]
            ticks = [(value, step) for value, step in ticks if low - 1e-9 * low <= value <= high * (1.0 + 1e-9)]
        else:
            step = QUARTER if self.unit == "°" and high - low > 2.0 * QUARTER else nice_step(high - low, most)
            ends = math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6)
            ticks = [(number * step, step) for number in range(ends[0], ends[1] + 1)]
        turn = 360.0 if self.unit == "°" else 0.0  # angles are told from -180 to 180, as in tables
        texts = [tick_text(value - turn * (value > 180.0), step) for value, step in ticks]
        return [(float(self.share(value / self.factor)), text) for (value, _), text in zip(ticks, texts, strict=True)]

    @property
    def attributes(self) -> str:
        """What the script is told of it: its ends in its unit, and its kind."""
        kind = "names" if self.names else "log" if self.log else "even"
        return f"{self.low * self.factor:.7g} {self.high * self.factor:.7g} {kind}"


def nice_step(span: float, most: int) -> float:
    """Return 1, 2 or 5 times a power of ten that divides an interval into at most ``most`` parts."""
    part = span / max(most, 1)
    if not (part > 0.0 and math.isfinite(part)):
        return 1.0
    power = 10.0 ** math.floor(math.log10(part))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= part * 0.999)


# -- less than there is ------------------------------------------------------------------------------------------------


def thin(x: Floats, y: Floats, columns: int = COLUMNS) -> tuple[Floats, Floats]:
    """Return a curve in shares of its axes with all that can be seen.

    Of neighbours in one column of points, these are the first, the smallest, the largest and the last one.
    """
    if len(x) <= 4 * columns:
        return x, y
    column = np.where(np.isfinite(x) & np.isfinite(y), np.floor(np.nan_to_num(x) * columns), np.nan)
    first = np.ones(len(x), dtype=bool)
    first[1:] = ~(column[1:] == column[:-1])
    starts = np.flatnonzero(first)
    ends, order = np.append(starts[1:], len(x)) - 1, np.lexsort((y, np.cumsum(first)))
    chosen = np.unique([starts, ends, order[starts], order[ends]])
    return x[chosen], y[chosen]


def distinct_dots(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return dots in shares of the axes of which no two cover each other, ordered so that their path is short."""
    number = np.unique(np.round(x * DOTS[0]).astype(int) * (DOTS[1] + 1) + np.round(y * DOTS[1]).astype(int))
    across, up = np.divmod(number, DOTS[1] + 1)
    return across / DOTS[0], up / DOTS[1]


def path(x: Floats, y: Floats) -> str:
    """Return a curve in shares of its axes as a path: whole numbers, each from the one before; gaps break it."""
    across, down = np.round(x * WIDTH), np.round((1.0 - y) * HEIGHT)
    known = np.isfinite(across) & np.isfinite(down)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    commands = ""
    for first, after in zip(ends[::2], ends[1::2], strict=True):
        places = np.stack([across[first:after], down[first:after]], axis=1).astype(int)
        steps = np.diff(places, axis=0)
        steps = steps[steps.any(axis=1)]
        if len(steps):
            commands += f"M{places[0, 0]} {places[0, 1]}l" + " ".join(f"{a} {b}" for a, b in steps.tolist())
    return commands.replace(" -", "-")


def dot_path(x: Floats, y: Floats) -> str:
    """Return dots in shares of their axes as a path of lines without length."""
    steps = np.diff(np.round([x * WIDTH, (1.0 - y) * HEIGHT]).astype(int), prepend=0).T.tolist()
    return "".join(f"m{a} {b}h0" for a, b in steps).replace("m", "M", 1).replace(" -", "-")


# -- a drawing ---------------------------------------------------------------------------------------------------------


class Plot:
    """Curves over one axis, drawn one after the other; values are in SI units.

    Parameters
    ----------
    title
        What is said above it.
    x, y
        Its axes.
    look
        Class of the figure.
    """

    def __init__(self, title: str, x: Scale, y: Scale, look: str = "") -> None:
        self.title, self.x, self.y, self.look = title, x, y, look
        self.height = self.note = ""
        self.columns = COLUMNS
        self.key: Sequence[str] = ()
        self.hits = ""
        self._drawn: list[str] = []
        self._texts: list[str] = []

    def curve(
        self, x: Any, y: Any, name: str, colour: str, *, dash: str = "", width: float = 1.5, pale: bool = False
    ) -> None:
        """Draw a curve; where values are missing, and where phases jump by most of a turn, it is broken."""
        across, up = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if self.y.unit == "°":
            far = np.flatnonzero(np.abs(np.diff(up)) > math.pi) + 1
            across, up = np.insert(across, far, np.nan), np.insert(up, far, np.nan)
        places = thin(self.x.share(across), self.y.share(up), self.columns)
        looks = (f"stroke:{colour}", dash and f"stroke-dasharray:{dash}", f"stroke-width:{width:g}")
        self._add("curve", path(*places), name, *looks, "opacity:.45" * pale)

    def band(self, x: Any, low: Any, high: Any, name: str, colour: str) -> None:
        """Fill what is between two curves."""
        across, down, up = self.x.share(x), self.y.share(low), self.y.share(high)
        known = np.isfinite(across + down + up)
        there, back = (across[known], up[known]), (across[known][::-1], down[known][::-1])
        line = path(*(np.concatenate(pair) for pair in zip(there, back, strict=True)))
        self._add("band", line and f"{line}z", name, f"fill:{colour}33", f"stroke:{colour}")

    def dots(
        self,
        x: Any,
        y: Any,
        name: str,
        colour: str,
        *,
        size: float = 3.5,
        hollow: bool = False,
        pale: bool = False,
    ) -> None:
        """Draw dots, of which those that would be covered are left out."""
        across, up = self.x.share(x), self.y.share(y)
        known = (np.abs(across - 0.5) <= 0.5 + 1e-9) & (np.abs(up - 0.5) <= 0.5 + 1e-9)
        line = dot_path(*distinct_dots(across[known], up[known]))
        looks = (f"stroke:{colour}", f"stroke-width:{size:g}", "opacity:.6" * pale)
        self._add("dots", line, name, *looks)
        if hollow:
            self._add("dots", line, "", "stroke:#fff", f"stroke-width:{size - 2.0:g}")

    def box(
        self, x: tuple[float, float], y: tuple[float, float], colour: str, tip: str = "", opacity: float = 1.0
    ) -> None:
        """Fill a rectangle between values."""
        (a, b), (c, d) = ((float(v) for v in scale.share(ends)) for scale, ends in ((self.x, x), (self.y, y)))
        sizes = abs(b - a) * WIDTH, abs(d - c) * HEIGHT
        attributes = f'x="{min(a, b) * WIDTH:.0f}" y="{(1.0 - max(c, d)) * HEIGHT:.0f}" '
        attributes += f'width="{sizes[0]:.0f}" height="{sizes[1]:.0f}"'
        more = f' opacity="{opacity:g}"' if opacity != 1.0 else ""
        ending = f"><title>{escape(tip)}</title></rect>" if tip else "/>"
        self._drawn.append(f'<rect {attributes} fill="{colour}"{more}{ending}')

    def rule(self, text: str = "", *, x: float | None = None, y: float | None = None, dash: str = "2 3") -> None:
        """Draw a line of reference across at a value of one axis."""
        scale, value = (self.y, y) if x is None else (self.x, x)
        position = float(scale.share(value))
        if not 0.0 <= position <= 1.0:
            return
        line = f"M0 {(1.0 - position) * HEIGHT:.0f}h{WIDTH}" if x is None else f"M{position * WIDTH:.0f} 0v{HEIGHT}"
        self._drawn.append(f'<path class="rule" style="stroke-dasharray:{dash}" d="{line}"/>')
        if text:
            where = f"right:2px;top:{1.0 - position:.2%}" if x is None else f"left:{position:.2%};top:13px"
            self._texts.append(f'<span class="note" style="{where}">{escape(text)}</span>')

    def mark(self, x: float, y: float, text: str = "", symbol: str = "", colour: str = "") -> None:
        """Put a ring, or a symbol, at a point, with a text beside it."""
        across, style = self._place(x, y)
        if symbol and style:
            look = f"{style};color:{colour}" if colour else style
            self._texts.append(f'<b class="symbol" title="{escape(text)}" style="{look}">{escape(symbol)}</b>')
        elif style:
            side = "before" if across > 0.6 else "after"
            span = f'<span class="mark {side}" style="{style}">{escape(text)}</span>'
            self._texts.append(f'<i style="{style}"></i>{span}')

    def word(self, x: float, y: float, text: str, colour: str) -> None:
        """Write a text about a point."""
        across, style = self._place(x, y)
        if style:
            side = "" if 0.12 < across < 0.88 else " after" if across < 0.5 else " before"
            self._texts.append(f'<span class="word{side}" style="{style};color:{colour}">{escape(text)}</span>')

    def _place(self, x: float, y: float) -> tuple[float, str]:
        """Return the share of a point across, and its place as a style; "" where it is outside."""
        across, up = float(self.x.share(x)), float(self.y.share(y))
        inside = abs(across - 0.5) <= 0.5 + 1e-9 and abs(up - 0.5) <= 0.5 + 1e-9
        return across, f"left:{across:.2%};top:{1.0 - up:.2%}" if inside else ""

    def jump(self, x: Any, y: Any, colour: str) -> None:
        """Draw a thin line between two points, with a head at the second one."""
        self._add("curve", path(self.x.share(x), self.y.share(y)), "", f"stroke:{colour}", "stroke-width:.8")
        self.mark(x[1], y[1], "jump", "▴" if y[1] > y[0] else "▾", colour)

    def _add(self, kind: str, line: str, name: str, *looks: str) -> None:
        named = f' data-n="{escape(name)}"' if name else ""
        if line:
            self._drawn.append(f'<path class="{kind}"{named} style="{";".join(filter(None, looks))}" d="{line}"/>')

    def html(self) -> str:
        """Return the figure."""
        across, up = self.x.ticks(TICKS[0]), self.y.ticks(TICKS[1] if not self.y.names else len(self.y.names))
        grid = "" if self.y.names else "".join(f"M0 {(1.0 - at) * HEIGHT:.0f}h{WIDTH}" for at, _ in up)
        numbers = "".join(f'<span class="yt" style="top:{1.0 - at:.2%}">{escape(text)}</span>' for at, text in up)
        numbers += "".join(f'<span class="xt" style="left:{at:.2%}">{escape(text)}</span>' for at, text in across)
        label = f"{self.x.label} ({self.x.unit})" if self.x.label and self.x.unit else self.x.label or self.x.unit
        size, hits = (f' style="{self.height}"' if self.height else ""), (f" data-p='{self.hits}'" if self.hits else "")
        units = f'data-u="{escape(self.y.unit)}" data-xu="{escape(self.x.unit)}"'
        data = f'data-x="{self.x.attributes}" data-y="{self.y.attributes}" {units}{hits}'
        notes = f"{escape(self.y.unit)} {''.join(self.key)} {escape(self.note)}"
        title = f"<figcaption><b>{escape(self.title)}</b> {notes}</figcaption>"
        texts = f'<div class="on">{"".join(self._texts)}</div></div>{numbers}<span class="xl">{escape(label)}</span>'
        return (
            f'<figure class="plot {self.look}"{size} {data}>{title}<div class="area"><div class="clip">'
            f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none"><path class="grid" d="{grid}"/>'
            f"{''.join(self._drawn)}</svg>{texts}<output></output>{_UNSEEN}</div></figure>"
        )
