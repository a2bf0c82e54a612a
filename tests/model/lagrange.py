"""The equations of motion derived anew by sympy, which takes long to load: import this inside of tests."""

from functools import cache

import numpy as np
import sympy as sp

#: In the order of the full state; gap and upper are y_w1 and y_w2.
COORDINATES = sp.symbols("x y phi phi1 phi2 gap upper", real=True)
RATES = sp.symbols("vx vy vphi w1 w2 vgap vupper", real=True)
EXCITERS = sp.symbols("m_r1 m_r2 r_1 r_2 J_d1 J_d2 X_1 Y_1 X_2 Y_2")  # axes from the platform's own centre
CONSTANTS = (*sp.symbols("m_0 J_0 c_x c_y c_phi b_x b_y b_phi g m_w1 m_w2 c_w b_w"), *EXCITERS)
TORQUES = sp.symbols("torque1 torque2")


def point_masses():
    """Return (mass, position) of platform, unbalances and layers; O is the centre of mass of the first three."""
    x, y, phi, phi1, phi2, gap, upper = COORDINATES
    m_0, m_w1, m_w2 = CONSTANTS[0], *CONSTANTS[9:11]
    m_r1, m_r2, r_1, r_2, _, _, x_1, y_1, x_2, y_2 = EXCITERS
    # where the masses sit in the platform, from its own centre, the unbalances lumped at their axes
    masses = (m_0, m_r1, m_r2)
    places = [sp.Matrix([0, 0]), sp.Matrix([x_1, y_1]), sp.Matrix([x_2, y_2])]
    centre = sum((m * place for m, place in zip(masses, places, strict=True)), sp.zeros(2, 1)) / sum(masses)
    turn = sp.Matrix([[sp.cos(phi), -sp.sin(phi)], [sp.sin(phi), sp.cos(phi)]])
    arms = ((r_1, phi1), (r_2, phi2))
    offsets = (0 * centre, *(r * sp.Matrix([sp.cos(angle), sp.sin(angle)]) for r, angle in arms))
    machine = [
        (m, sp.Matrix([x, y]) + turn * (place - centre) + offset)
        for m, place, offset in zip(masses, places, offsets, strict=True)
    ]
    return [*machine, (m_w1, sp.Matrix([0, y + gap])), (m_w2, sp.Matrix([0, y + gap + upper]))]


def energies():
    """Return kinetic energy, potential energy and Rayleigh's dissipation function."""
    x, y, phi, *_, upper = COORDINATES
    vx, vy, vphi, w1, w2, _, vupper = RATES
    _, J_0, c_x, c_y, c_phi, b_x, b_y, b_phi, g, _, _, c_w, b_w = CONSTANTS[:13]
    J_d1, J_d2 = EXCITERS[4:6]
    kinetic = (J_0 * vphi**2 + J_d1 * w1**2 + J_d2 * w2**2) / 2
    potential = (c_x * x**2 + c_y * y**2 + c_phi * phi**2 + c_w * upper**2) / 2
    dissipation = (b_x * vx**2 + b_y * vy**2 + b_phi * vphi**2 + b_w * vupper**2) / 2
    for mass, position in point_masses():
        velocity = position.jacobian(COORDINATES) * sp.Matrix(RATES)
        kinetic += mass * velocity.dot(velocity) / 2
        potential += mass * g * position[1]
    return kinetic, potential, dissipation


def to_first_order(expression):
    """Put the axis turned to first order, (X₀ − φY₀, Y₀ + φX₀), into an equation of motion."""
    phi = COORDINATES[2]
    expanded = sp.expand(sp.expand(expression).subs(sp.cos(phi) ** 2, 1 - sp.sin(phi) ** 2))
    # squares must have cancelled to 1 (J is constant); what is left is an axis, linear in cos φ, sin φ
    assert sp.Poly(expanded, sp.sin(phi), sp.cos(phi)).total_degree() <= 1
    return expanded.subs({sp.sin(phi): phi, sp.cos(phi): 1})


@cache
def lagrange():
    """Return a function of (coordinates, rates, constants, torques) that gives mass matrix and forces.

    The rotation is exact all through the derivation and the axis is truncated only in the equations of
    motion, as the paper does: truncated in the energy already, J would grow with φ² and products of
    φ̇ with the linear axis would leave terms that the paper's equations do not have.
    """
    kinetic, potential, dissipation = energies()
    q, v = sp.Matrix(COORDINATES), sp.Matrix(RATES)
    momenta = sp.Matrix([kinetic]).jacobian(v).T
    mass = momenta.jacobian(v)
    forces = sp.Matrix([kinetic - potential]).jacobian(q).T - momenta.jacobian(q) * v
    forces -= sp.Matrix([dissipation]).jacobian(v).T
    forces += sp.Matrix([0, 0, 0, *TORQUES, 0, 0])
    arguments = (COORDINATES, RATES, CONSTANTS, TORQUES)
    result = (mass.applyfunc(to_first_order), forces.applyfunc(to_first_order))
    return sp.lambdify(arguments, result, modules="numpy", cse=True)


def contact_direction():
    """Return the generalized force of F_c = 1: +1 on the lower layer's y + y_w1, −1 on the platform's y."""
    y, gap = COORDINATES[1], COORDINATES[5]
    work = sp.Matrix([(y + gap) - y])
    return np.array(work.jacobian(COORDINATES), dtype=float).ravel()
