"""The sketch of the model: ``python -m tools.sketch results/model.svg`` draws it."""

import sys
from pathlib import Path

import numpy as np
from matplotlib.patches import Circle, Polygon, Rectangle

from vibroplat.plots.style import CONTACT, FORCE, MATERIAL, PLATFORM, Saving, new_figure, save

_GREY = "#555555"
#: Corners and centres in the units of the sketch.
_LEFT, _RIGHT, _BOTTOM, _TOP = -3.0, 3.0, 0.0, 0.5
_AXES = ((2.0, 1.1), (-2.0, 1.1))


def sketch():
    """Draw platform, springs, both exciters, layers of material and all symbols of the model."""
    figure, axes, _ = new_figure(1, 1, (7.6, 4.4))
    axis = axes[0, 0]
    axis.set_aspect("equal")
    axis.set_axis_off()
    _platform(axis)
    for number, centre in enumerate(_AXES, 1):
        _exciter(axis, number, centre)
    _material(axis)
    _coordinates(axis)
    axis.set_xlim(-5.2, 5.2)
    axis.set_ylim(-1.8, 4.1)
    return figure


def _platform(axis):
    """Draw the platform on its springs and dampers."""
    axis.add_patch(Rectangle((_LEFT, _BOTTOM), _RIGHT - _LEFT, _TOP - _BOTTOM, fc=CONTACT, ec=PLATFORM, lw=1.6))
    for side in (-1.0, 1.0):
        axis.add_patch(Polygon([(side * 1.7, _TOP), (side * 2.3, _TOP), (side * 2.0, 1.1)], fc=CONTACT, ec=PLATFORM))
        _spring(axis, (side * 2.4, -1.5), (side * 2.4, _BOTTOM))
        _damper(axis, (side * 1.9, -1.5), (side * 1.9, _BOTTOM))
        _ground(axis, (side * 2.15 - 0.6, -1.5), (side * 2.15 + 0.6, -1.5), down=True)
    _spring(axis, (_RIGHT, 0.25), (4.6, 0.25))
    _ground(axis, (4.6, -0.15), (4.6, 0.65), down=False)
    axis.text(2.7, -0.8, r"$c_y,\ b_y$", va="center")
    axis.text(3.8, -0.2, r"$c_x,\ b_x$", ha="center")
    axis.text(-3.95, -0.8, r"$c_\varphi,\ b_\varphi$", va="center")
    axis.text(-1.0, 0.23, r"$m_0,\ J_0$", ha="center", va="center", color=PLATFORM)


def _exciter(axis, number, centre):
    """Draw an exciter: axis, unbalance at radius r, the direction in which it turns, and ρ, γ₁ of the first."""
    angle = np.radians(50.0 if number == 1 else 130.0)
    x, y = centre
    tip = (x + 0.75 * np.cos(angle), y + 0.75 * np.sin(angle))
    axis.add_patch(Circle(centre, 0.75, fc="none", ec=_GREY, lw=0.8, ls=":"))
    axis.plot([x, tip[0]], [y, tip[1]], color=PLATFORM, lw=1.6)
    axis.add_patch(Circle(tip, 0.14, fc=PLATFORM, ec=PLATFORM))
    axis.add_patch(Circle(centre, 0.06, fc="white", ec=PLATFORM, zorder=3))
    outward = 1.0 if number == 1 else -1.0
    axis.text(tip[0] + 0.3 * outward, tip[1] + 0.12, "$m_r$", ha="center")
    axis.text(x + 0.48 * outward, y + 0.12, "$r$", ha="center")
    turn = np.radians(np.linspace(-60.0, 20.0, 30) if number == 1 else np.linspace(240.0, 160.0, 30))
    edge = np.array([x + 0.95 * np.cos(turn), y + 0.95 * np.sin(turn)])
    axis.plot(*edge, color=_GREY, lw=1.0)
    axis.annotate("", _place(edge, -1), _place(edge, -4), arrowprops={"arrowstyle": "->", "color": _GREY})
    axis.text(x + 1.15 * outward, y + 0.4, rf"$\varphi_{number}$", ha="center")
    if number == 1:
        axis.plot([0.0, x], [0.25, y], color=_GREY, lw=0.8, ls="--")
        axis.text(0.75, 0.72, r"$\rho$", color=_GREY)
        axis.text(0.85, 0.32, r"$\gamma_1$", color=_GREY)
        axis.plot([0.0, 1.3], [0.25, 0.25], color=_GREY, lw=0.8, ls="--")


def _material(axis):
    """Draw both layers above the platform, with the gap open."""
    axis.add_patch(Rectangle((-1.0, 1.7), 2.0, 0.45, fc="#f3dccb", ec=MATERIAL, lw=1.4))
    axis.add_patch(Rectangle((-1.0, 3.2), 2.0, 0.45, fc="#f3dccb", ec=MATERIAL, lw=1.4))
    axis.text(0.0, 1.92, "$m_{w1}$", ha="center", va="center", color=MATERIAL)
    axis.text(0.0, 3.42, "$m_{w2}$", ha="center", va="center", color=MATERIAL)
    _spring(axis, (-0.5, 2.15), (-0.5, 3.2))
    _damper(axis, (0.5, 2.15), (0.5, 3.2))
    axis.text(-0.75, 2.67, "$c_w$", ha="right", va="center")
    axis.text(0.75, 2.67, "$b_w$", va="center")
    axis.annotate("", (-0.55, 1.7), (-0.55, _TOP), arrowprops={"arrowstyle": "<->", "color": _GREY})
    axis.text(-0.65, 1.1, "$y_{w1}$", ha="right", va="center")
    axis.annotate("", (1.25, 3.9), (1.25, 3.2), arrowprops={"arrowstyle": "->", "color": _GREY})
    axis.text(1.35, 3.6, "$y_{w2}$", va="center")
    axis.annotate("", (0.1, 1.3), (0.1, _TOP), arrowprops={"arrowstyle": "<-", "color": FORCE, "lw": 1.6})
    axis.text(0.2, 1.25, "$F_c$", color=FORCE, va="center")


def _coordinates(axis):
    """Draw the axes x and y, the rotation φ and gravity."""
    arrow = {"arrowstyle": "->", "color": "black", "lw": 1.2}
    axis.annotate("", (-3.4, 2.6), (-4.4, 2.6), arrowprops=arrow)
    axis.annotate("", (-4.4, 3.6), (-4.4, 2.6), arrowprops=arrow)
    turn = np.radians(np.linspace(20.0, 70.0, 20))
    edge = np.array([-4.4 + 0.7 * np.cos(turn), 2.6 + 0.7 * np.sin(turn)])
    axis.plot(*edge, color="black", lw=1.0)
    axis.annotate("", _place(edge, -1), _place(edge, -3), arrowprops=arrow)
    for text, place in (("$x$", (-3.25, 2.55)), ("$y$", (-4.45, 3.7)), (r"$\varphi$", (-3.75, 3.1))):
        axis.text(*place, text)
    axis.annotate("", (3.9, 2.8), (3.9, 3.6), arrowprops=arrow)
    axis.text(4.0, 3.1, "$g$")


def _place(points, number):
    """Return one of the points of a line, shape (2, n)."""
    return float(points[0, number]), float(points[1, number])


def _spring(axis, start, end):
    """Draw a spring as a zigzag."""
    along = np.array([0.0, 0.2, *np.linspace(0.25, 0.75, 9), 0.8, 1.0])
    aside = 0.13 * np.array([0.0, 0.0, *(np.arange(9) % 2 * 2 - 1), 0.0, 0.0])
    way = np.subtract(end, start)
    across = np.array([-way[1], way[0]]) / np.hypot(*way)
    points = np.array(start)[:, np.newaxis] + np.outer(way, along) + np.outer(across, aside)
    axis.plot(*points, color=_GREY, lw=1.0)


def _damper(axis, start, end):
    """Draw an upright damper."""
    x, low, high = start[0], start[1], end[1]
    middle = 0.5 * (low + high)
    axis.plot([x, x], [low, middle - 0.2], color=_GREY, lw=1.0)
    axis.plot(
        [x - 0.15, x - 0.15, x + 0.15, x + 0.15],
        [middle + 0.15, middle - 0.2, middle - 0.2, middle + 0.15],
        color=_GREY,
        lw=1.0,
    )
    axis.plot([x - 0.12, x + 0.12], [middle, middle], color=_GREY, lw=1.4)
    axis.plot([x, x], [middle, high], color=_GREY, lw=1.0)


def _ground(axis, start, end, *, down):
    """Draw a piece of the fixed ground, hatched on one side."""
    axis.plot(*zip(start, end, strict=True), color="black", lw=1.2)
    for share in np.linspace(0.0, 1.0, 6):
        x, y = np.add(start, share * np.subtract(end, start))
        dx, dy = (-0.12, -0.16) if down else (0.16, -0.12)
        axis.plot([x, x + dx], [y, y + dy], color="black", lw=0.8)


if __name__ == "__main__":
    path = Path(sys.argv[1])
    print(save(sketch(), path.parent, path.stem, Saving("svg")))
