"""The machine on the page: its drawing, which a browser without scripts shows at rest, and what moves it."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.config.suspension import placed_springs
from vibroplat.results.picture import CURVES

#: Half the platform's width, length of a spring between layers, largest of the force's arrow, room for motion: units of
#: the drawing.
HALF, BETWEEN, ARROW, ROOM = 100.0, 26.0, 62.0, 22.0
#: Shortest arm of an unbalance: how it turns must be seen on a long deck, too.
SMALLEST = 11.0
#: Where springs are whose places are not known, the shortest length of springs, and their turns with half the width of
#: these; distance of the floor from the platform, at least; and springs between layers.
SPRINGS, SPRING_LENGTH, SPRING_COILS, CLEARANCE = (-72.0, 72.0), 80.0, (7, 7.0), 30.0
BETWEENS, BETWEEN_COILS = (-52, 0, 52), (4, 5.0)
#: Half the width of material, and distance of the grains by which its motion along the deck is seen.
BED, GRAIN = 78.0, 26.0
#: Frames of a turn: the script draws what is between them.
FRAMES = 36
#: Columns that move the machine.
MOVING = ("x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", "gap_m", "upper_m", "along_m", "contact_force_n")
#: Largest of the whole numbers that curves are packed as.
STEPS = 65534
#: The button that stops it.
PLAY = '<button type="button" class="play" aria-pressed="true">Pause</button>'


def pack(values: npt.ArrayLike, least: float = 0.0) -> tuple[float, float, str]:
    """Return the smallest and the largest number, and all as base64 of 16-bit parts of their range; 65535 is missing.

    That is 1.5e-5 of the range: far less than a pixel. What varies by less than ``least`` has a mean alone.
    """
    numbers = np.asarray(values, dtype=float)
    known = numbers[np.isfinite(numbers)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
    if high - low <= least:
        mean = float(f"{0.5 * (low + high):.9g}")
        return mean, mean, ""
    with np.errstate(invalid="ignore"):
        parts = np.where(np.isfinite(numbers), (numbers - low) / (high - low or 1.0) * STEPS, STEPS + 1)
    return float(f"{low:.9g}"), float(f"{high:.9g}"), base64_of(parts)


def base64_of(parts: Any) -> str:
    """Return numbers up to 65535 as base64 of 16-bit ones."""
    return base64.b64encode(np.round(parts).astype("<u2").tobytes()).decode("ascii")


def moving(frames: pd.DataFrame, scene: Scene, hits: Sequence[Sequence[float]], **more: Any) -> dict[str, Any]:
    """Return what the script moves a machine through.

    Parameters
    ----------
    frames
        Values of :data:`MOVING` at equal parts of turns; those of the platform are counted from the static rest.
    scene
        Whose machine it is.
    hits
        Frames, with parts of them, at which material strikes, and its impulses (N·s).
    more
        Further entries.
    """
    scale, k = scale_of(machine_of(scene)), magnification(frames, machine_of(scene))
    unseen = 1e-4 * ROOM / (scale * k)
    least = dict.fromkeys(("x_m", "y_m", "gap_m", "upper_m"), unseen) | {"phi_rad": unseen / HALF * scale}
    turned = frames.assign(**{angle: np.mod(frames[angle], TURN) for angle in ("phi1_rad", "phi2_rad")})
    known = [name for name in MOVING if name in frames and frames[name].notna().any()]
    columns = {name: pack(turned[name], least.get(name, 0.0)) for name in known}
    return {"columns": columns, "frames": len(frames), "k": k, "hits": hits, **more}


def machine_of(scene: Scene) -> dict[str, Any]:
    """Return what the drawing of a machine needs; lengths in m."""
    return {
        "axes": scene.body.axes,
        "radii": [exciter.unbalance_radius_m for exciter in scene.exciter_pair],
        "directions": [exciter.direction for exciter in scene.exciter_pair],
        "layers": scene.layers,
        "conveys": scene.transport is not None,
        "lower_share": scene.material.lower_share if scene.layers == 2 else 1.0,
        "springs": None if scene.springs is None else [spring.place for spring in placed_springs(scene).values()],
        "off": [spring.off for spring in (scene.springs or {}).values()],
        "angle": 0.0 if scene.transport is None else scene.transport.angle,
        "half": _half_length(scene),
    }


def _half_length(scene: Scene) -> float:
    """Return half the length of the deck (m), as it is given, or that of a bar with its mass and moment of inertia."""
    length = None if scene.transport is None else scene.transport.deck_length_m
    bar = math.sqrt(3.0 * scene.machine.platform_inertia_kg_m2 / scene.machine.platform_mass_kg)
    return 0.5 * length if length is not None else bar


def scale_of(machine: Mapping[str, Any]) -> float:
    """Return units of the drawing in a metre."""
    reach = [abs(x) + 1.25 * radius for (x, _), radius in zip(machine["axes"], machine["radii"], strict=True)]
    reach += [abs(x) for x, _ in machine["springs"] or ()]
    return HALF / float(max(*reach, machine["half"], 1e-6))


class Sizes(NamedTuple):
    """Sizes of a machine's drawing.

    Attributes
    ----------
    scale
        Units in a metre.
    axes, radii
        Of the exciters.
    top, bottom
        Heights of the platform's edges over the centre of mass, normal to the deck.
    floor, above, aside
        Heights of the floor, and of what is above all parts that move; half the width of the drawing.
    heights
        Of the lower and the upper layer; 0 without one.
    angle
        Decline of the deck (rad): x and y are along and normal to it.
    springs
        Where springs hold the platform, along and normal to the deck.
    """

    scale: float
    axes: list[tuple[float, float]]
    radii: list[float]
    top: float
    bottom: float
    floor: float
    above: float
    aside: float
    heights: tuple[float, float]
    angle: float
    springs: list[tuple[float, float]]

    @classmethod
    def of(cls, machine: Mapping[str, Any]) -> Sizes:
        """Return the sizes of what :func:`machine_of` describes."""
        scale, layers, part = scale_of(machine), int(machine["layers"]), machine["lower_share"]
        axes = [(scale * x, scale * y) for x, y in machine["axes"]]
        radii = [max(scale * radius, SMALLEST) for radius in machine["radii"]]
        top = max(*(y + r for (_, y), r in zip(axes, radii, strict=True)), 0.0) + 13.0
        bottom = min(*(y - r for (_, y), r in zip(axes, radii, strict=True)), 3.0) - 17.0
        heights = (10.0 + 14.0 * part, 10.0 + 14.0 * (1.0 - part)) if layers == 2 else (22.0 if layers else 0.0, 0.0)
        over = top + (2.4 if layers else 1.0) * ROOM + sum(heights) + (BETWEEN if layers == 2 else 0.0) + 12.0
        places = machine["springs"]
        springs = [(x, bottom) for x in SPRINGS] if places is None else [(scale * x, scale * y) for x, y in places]
        angle = machine["angle"]
        corners = [upright((side * HALF, height), angle) for side in (-1.0, 1.0) for height in (bottom, over)]
        lowest, held = min(y for _, y in corners), min(upright(place, angle)[1] for place in springs)
        floor, above = min(lowest - CLEARANCE, held - SPRING_LENGTH), max(y for _, y in corners)
        aside = max(x for x, _ in corners) + 24.0
        return cls(scale, axes, radii, top, bottom, floor, above, aside, heights, angle, springs)


def upright(place: tuple[float, float], angle: float) -> tuple[float, float]:
    """Return a place along and normal to a deck that declines by an angle (rad) along and normal to the ground."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return place[0] * cosine + place[1] * sine, place[1] * cosine - place[0] * sine


def magnification(frames: pd.DataFrame, machine: Mapping[str, Any]) -> float:
    """Return the round number with which the largest displacement has the room that it needs."""
    scale = scale_of(machine)
    parts = {"x_m": 1.0, "y_m": 1.0, "gap_m": 0.7, "upper_m": 1.0, "phi_rad": HALF / scale}
    most = [part * float(frames[name].abs().max()) for name, part in parts.items() if name in frames]
    free = ROOM / scale / max([one for one in most if math.isfinite(one)], default=1.0) if any(most) else 1.0
    power = 10.0 ** math.floor(math.log10(free))
    return next(step * power for step in (5.0, 3.0, 2.0, 1.0) if step * power <= free * 1.0001)


# -- the drawing -------------------------------------------------------------------------------------------------------


def drawing(machine: Mapping[str, Any], label: str) -> str:
    """Return the drawing of a machine at rest; the script moves its groups by their classes."""
    s = Sizes.of(machine)
    sizes = {"scale": s.scale, "top": s.top, "bottom": s.bottom, "floor": s.floor, "between": BETWEEN, "arrow": ARROW}
    sizes |= {"bed": BED, "grain": GRAIN, "angle": s.angle}
    data = " ".join(f'data-{name}="{value:.4g}"' for name, value in sizes.items())
    high = f"{s.top - s.bottom:.1f}"
    body = f'<rect x="{-HALF}" y="{-s.top:.1f}" width="{2 * HALF}" height="{high}" rx="5" class="steel"/>'
    body += f'<path class="ink deck" d="M{-HALF} {-s.top:.1f}h{2 * HALF}"/><path class="ink" d="M-5 0h10M0 -5v10"/>'
    body += "".join(_exciter(n, s.axes[n], s.radii[n], machine["directions"][n]) for n in (0, 1))
    ground, hatches = s.aside - 28.0, np.arange(6.0 - s.aside + 28.0, s.aside - 28.0, 9.0)
    hatch = "".join(f"M{x:g} {-s.floor:.1f}l-6 7" for x in hatches)
    broken = machine["off"] or [False] * len(s.springs)
    springs = "".join(_spring(place, s, off) for place, off in zip(s.springs, broken, strict=True))
    return (
        f'<svg class="machine" viewBox="{-s.aside:g} {-s.above:.1f} {2.0 * s.aside + 14.0:g} '
        f'{s.above - s.floor + 12.0:.1f}" role="img" aria-label="{label}" {data}>'
        f'<path class="ground" d="M{-ground:g} {-s.floor:.1f}H{ground:g}{hatch}"/>'
        f'<g transform="rotate({math.degrees(s.angle):.4g})">'
        f'<g class="body">{body}{_layers(s.heights, s.top, machine["conveys"])}{_signs(s.top)}</g></g>{springs}</svg>'
    )


def _spring(place: tuple[float, float], s: Sizes, off: bool) -> str:
    """Return a spring from the floor to its place on the platform; one that is off is pale."""
    x, y = upright(place, s.angle)
    length = y - s.floor
    pale = ' opacity="0.25"' if off else ""
    return (
        f'<g class="spring" data-x="{place[0]:.4g}" data-y="{place[1]:.4g}" data-length="{length:.4g}"{pale} '
        f'transform="translate({x:.4g} {-s.floor:.1f})">{_coil(length, *SPRING_COILS)}</g>'
    )


def coil(length: float, turns: int, width: float) -> list[tuple[float, float]]:
    """Return the points of a spring that stands on 0 and is so long."""
    ends = min(7.0, 0.15 * length)
    step = (length - 2.0 * ends) / (2 * turns)
    zigzag = [(width if i % 2 else -width, ends + (i + 0.5) * step) for i in range(2 * turns)]
    return [(0.0, 0.0), (0.0, ends), *zigzag, (0.0, length - ends), (0.0, length)]


def _coil(length: float, turns: int, width: float) -> str:
    """Return a spring as a path."""
    points = "L".join(f"{x:g} {-y:.1f}" for x, y in coil(length, turns, width))
    return f'<path class="ink" d="M{points}"/>'


def _exciter(number: int, axis: tuple[float, float], radius: float, direction: float) -> str:
    """Return an exciter: its circle, which way it turns, and the arm with the unbalance, which points along x."""
    inner, colour = 0.55 * radius, CURVES[number]
    x, y = inner * math.cos(0.9), inner * math.sin(0.9)
    head = f"translate({x:.1f} {-y:.1f}) rotate(50)" if direction < 0 else f"translate({-x:.1f} {-y:.1f}) rotate(130)"
    return (
        f'<g transform="translate({axis[0]:.1f} {-axis[1]:.1f})"><circle r="{radius:.1f}" class="path"/>'
        f'<path class="way" d="M{-x:.1f} {-y:.1f}A{inner:.1f} {inner:.1f} 0 0 1 {x:.1f} {-y:.1f}"/>'
        f'<path class="way" d="M-4 -3L1.5 0L-4 3" transform="{head}"/>'
        f'<g class="arm" transform="rotate(-90)"><path d="M0 0H{radius:.1f}" stroke="{colour}" stroke-width="2.4"/>'
        f'<circle cx="{radius:.1f}" r="6.5" fill="{colour}"/></g><circle r="3" fill="#333"/>'
        f'<text y="{radius + 11.5:.1f}" text-anchor="middle" fill="{colour}">{number + 1}</text></g>'
    )


def _layers(heights: tuple[float, float], top: float, conveys: bool) -> str:
    """Return the layers of material on the platform, with grains if it moves along the deck."""
    markup = ""
    for name, height, base in (("lower", heights[0], top), ("upper", heights[1], top + heights[0] + BETWEEN)):
        if height:
            box = f'x="{-BED:g}" y="{-base - height:.1f}" width="{2 * BED:g}" height="{height:.1f}" rx="2"'
            middle = f"{-base - 0.5 * height:.1f}"
            dots = "".join(f"M{x:g} {middle}h0" for x in np.arange(-BED + 0.5 * GRAIN, BED, GRAIN))
            grains = f'<path class="grains" data-at="{middle}" d="{dots}"/>' if conveys else ""
            markup += f'<g class="{name}"><rect {box} class="{name}-layer"/>{grains}</g>'
    high, spring = f"{top + heights[0]:.1f}", _coil(BETWEEN, *BETWEEN_COILS)
    coils = (f'<g class="between" data-at="{x}" transform="translate({x} -{high})">{spring}</g>' for x in BETWEENS)
    return markup + (f'<g class="lower" data-base="{high}">{"".join(coils)}</g>' if heights[1] else "")


def _signs(top: float) -> str:
    """Return the force of contact and the flash of an impact, which are hidden at rest."""
    rays = [(0.62 if ray % 2 else 1.0, math.pi * ray / 14.0) for ray in range(28)]
    star = "L".join(f"{102.0 * size * math.cos(a):.0f} {13.0 * size * math.sin(a):.0f}" for size, a in rays)
    return (
        f'<g class="flash" visibility="hidden" transform="translate(0 {-top:.1f})"><path d="M{star}Z"/></g>'
        f'<g class="force" visibility="hidden" transform="translate(-26 {-top:.1f})"><path class="shaft"/>'
        '<path class="head" d="M-6.5 2L0 -10L6.5 2Z"/></g>'
    )


def as_json(data: Any) -> str:
    """Return JSON in which no character has a meaning in HTML."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
