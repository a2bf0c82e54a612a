"""The equations of motion, once: what kernels are written from. ``python -m vibroplat.model.written`` prints these.

Numbers in brackets are those of the paper's equations; ``results/method.md`` lists where they depart from the print.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

from vibroplat.config.kloss import kloss
from vibroplat.model.graph import ZERO, Node, circle, local, parameter, ramp, size, symbol, total
from vibroplat.model.parameters import PARAMETERS

#: Coordinates: x, y, φ, both φᵢ, y_w1, y_w2, and s along the deck.
NAMES = ("x", "y", "phi", "angle", "gap", "upper", "along")

#: The parameters of :mod:`vibroplat.model.parameters`; those of two exciters are pairs.
P = SimpleNamespace(**{name: parameter(name, pair=PARAMETERS[name].shape == (2,)) for name in PARAMETERS.names or ()})

#: Contact along the deck, as a mode has it: whether the material sticks, or slips (1, otherwise 0), and μ_k σ.
STUCK, SLIPS, SLIDING = local("stuck"), local("slips"), local("sliding")


class Rows(NamedTuple):
    """Left sides of the dynamic rows, which are 0: inertia times acceleration less forces."""

    x: Node  # of the platform (N, N, N·m)
    y: Node
    phi: Node
    angle: Node  # of both exciters (N·m)
    gap: Node  # of the lower layer (N)
    upper: Node  # of the upper layer, over its mass (m/s²)
    along: Node  # of the material along the deck (N)
    law: Node  # of contact along the deck (N)


def unknowns(letter: str) -> SimpleNamespace:
    """Return coordinates (q), rates (v) or accelerations (a)."""
    return SimpleNamespace(**{name: symbol(f"{letter}_{name}", pair=name == "angle") for name in NAMES})


def motor(speed: Node, p: SimpleNamespace) -> Node:
    """Torque of the motors at their speeds, counter-clockwise (1): that of Kloss, under a supply that may change."""
    slip, critical = ramp(p.speed, p.speed_ramp) - p.direction * speed, ramp(p.slip_speed, p.slip_ramp)
    torque: Node = p.direction * kloss(slip, critical, p.torque)
    return torque


def resistance(speed: Node, p: SimpleNamespace) -> Node:
    """Resistance to rotation, k_R k φ̇|φ̇|: proportional to the centrifugal force."""
    return p.friction * (speed * size(speed))


class Holds(NamedTuple):
    """What resists coordinates: springs and dampers, of which those on x, y and φ act on the foundation."""

    x: Node  # of the platform (N, N, N·m)
    y: Node
    phi: Node
    gap: Node  # between platform and lower layer (N)
    upper: Node  # between the layers, over the upper one's mass (m/s²)


def holds(q: SimpleNamespace, v: SimpleNamespace, p: SimpleNamespace) -> Holds:
    """State what resists coordinates, in directions opposite to them."""
    hold_x, hold_phi = p.damping_x * v.x + p.stiffness_x * q.x, p.damping_phi * v.phi + p.stiffness_phi * q.phi
    hold_y = p.damping_y * v.y + p.stiffness_y * q.y
    # springs beside the centre of mass
    hold_x = hold_x + (p.damping_x_phi * v.phi + p.stiffness_x_phi * q.phi)
    hold_y = hold_y + (p.damping_y_phi * v.phi + p.stiffness_y_phi * q.phi)
    hold_phi = hold_phi + (p.damping_x_phi * v.x + p.stiffness_x_phi * q.x)
    hold_phi = hold_phi + (p.damping_y_phi * v.y + p.stiffness_y_phi * q.y)
    hold_gap = ZERO
    spring = p.layer_stiffness * q.upper + p.layer_damping * v.upper
    return Holds(hold_x, hold_y, hold_phi, hold_gap, spring)


def equations(
    q: SimpleNamespace, v: SimpleNamespace, a: SimpleNamespace, force: Node, friction: Node, p: SimpleNamespace
) -> Rows:
    """State the equations of all modes, with F_c and F_t on the material; what a mode has not is 0."""
    sine, cosine, sine_2, cosine_2 = circle(q.angle, v.angle, a.angle)
    net = motor(v.angle, p) - resistance(v.angle, p)
    # accelerations of platform and of the exciters' axes (X₀ − φY₀, Y₀ + φX₀), against gravity along x and y
    level, lifted = a.x - p.slope, a.y + p.gravity
    turning = v.phi * v.phi
    centre, third = q.phi * a.phi + turning, q.phi * turning
    ax = level - p.axis_y * a.phi - p.axis_x * centre + p.axis_y * third
    ay = lifted + p.axis_x * a.phi - p.axis_y * centre - p.axis_x * third
    turned = p.axis_x * sine_2 - p.axis_y * cosine_2
    curved = total(p.unbalance * (p.axis_y * sine_2 + p.axis_x * cosine_2))
    hold = holds(q, v, p)
    lower = lifted + a.gap
    pressed = force - hold.gap  # what the deck exerts on the lower layer, and the lower layer on the deck
    return Rows(
        # (2)
        x=p.mass * level + hold.x + total(p.unbalance * cosine_2) + friction,
        y=p.mass * lifted + hold.y + total(p.unbalance * sine_2) + pressed,
        phi=p.inertia * a.phi
        + hold.phi
        + total(p.deck * net + p.unbalance * turned)
        - q.phi * curved
        - p.deck_height * friction,
        # (3)
        angle=p.exciter_inertia * a.angle + p.unbalance * (cosine * ay - sine * ax) - net,
        # (4), and (6) in contact
        gap=p.lower_mass * lower - p.upper_mass * hold.upper - pressed,
        upper=lower + a.upper + hold.upper,
        # material along the deck: stick holds it, in slip friction is that of Coulomb
        along=p.material_mass * (level - p.deck_height * a.phi + a.along) - friction,
        law=STUCK * (p.material_mass * a.along) + SLIPS * (friction + SLIDING * force),
    )
