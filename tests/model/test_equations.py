"""The equations of motion derived anew: point masses, Lagrange, then the paper's first-order axes."""

from functools import cache

import numpy as np
import pytest

from vibroplat.model.graph import local, parameter, scalar, symbol
from vibroplat.model.impact import impulse_response
from vibroplat.model.parameters import PARAMETERS, parameters
from vibroplat.model.source import P, motor, resistance
from vibroplat.model.straight import PLACE_TEXTS, of_one, traced

from .helpers import EACH_PAIR, RECORDS, TIME, random_states, record_of, scene_of, settled, torque_by_quotient


@cache
def derived():
    """Derive the equations: (coordinates, rates, constants, torques, transport), mass matrix and forces.

    The rotation is exact all through the derivation and the axis is truncated only in the equations of
    motion, as the paper does: truncated in the energy already, J would grow with φ² and products of
    φ̇ with the linear axis would leave terms that the paper's equations do not have.
    """
    import sympy as sp

    # in the order of the full state; gap and upper are y_w1 and y_w2; axes from the platform's own centre
    coordinates = x, y, phi, phi1, phi2, gap, upper, along = sp.symbols("x y phi phi1 phi2 gap upper along", real=True)
    rates = vx, vy, vphi, w1, w2, _, vupper, _ = sp.symbols("vx vy vphi w1 w2 vgap vupper valong", real=True)
    exciters = m_r1, m_r2, r_1, r_2, j_1, j_2, x_1, y_1, x_2, y_2 = sp.symbols("m_r1 m_r2 r_1 r_2 J1 J2 X1 Y1 X2 Y2")
    common = sp.symbols("m_0 J_0 c_x c_y c_phi b_x b_y b_phi g m_w1 m_w2 c_w b_w")
    m_0, j_0, c_x, c_y, c_phi, b_x, b_y, b_phi, g, m_w1, m_w2, c_w, b_w = common
    torques = sp.symbols("torque1 torque2")
    # gravity along the deck, height of the deck, and mass of the material where it moves along that
    transport = slope, height, moving = sp.symbols("g_x h m_w")
    # springs beside the centre of mass, which couple x and y with the rotation
    couplings = c_x_phi, c_y_phi, b_x_phi, b_y_phi = sp.symbols("c_xphi c_yphi b_xphi b_yphi")
    # where the masses sit in the platform, the unbalances lumped at their axes; O is the centre of mass of these three
    masses = (m_0, m_r1, m_r2)
    places = [sp.Matrix([0, 0]), sp.Matrix([x_1, y_1]), sp.Matrix([x_2, y_2])]
    centre = sum((m * place for m, place in zip(masses, places, strict=True)), sp.zeros(2, 1)) / sum(masses)
    turn = sp.Matrix([[sp.cos(phi), -sp.sin(phi)], [sp.sin(phi), sp.cos(phi)]])
    offsets = (0 * centre, *(r * sp.Matrix([sp.cos(a), sp.sin(a)]) for r, a in ((r_1, phi1), (r_2, phi2))))
    bodies = [
        (m, sp.Matrix([x, y]) + turn * (place - centre) + offset)
        for m, place, offset in zip(masses, places, offsets, strict=True)
    ]
    bodies += [(m_w1, sp.Matrix([0, y + gap])), (m_w2, sp.Matrix([0, y + gap + upper]))]
    # kinetic and potential energy, and Rayleigh's dissipation function
    kinetic = (j_0 * vphi**2 + j_1 * w1**2 + j_2 * w2**2) / 2
    potential = (c_x * x**2 + c_y * y**2 + c_phi * phi**2 + c_w * upper**2) / 2
    dissipation = (b_x * vx**2 + b_y * vy**2 + b_phi * vphi**2 + b_w * vupper**2) / 2
    potential += (c_x_phi * x + c_y_phi * y) * phi
    dissipation += (b_x_phi * vx + b_y_phi * vy) * vphi
    q, v = sp.Matrix(coordinates), sp.Matrix(rates)
    for mass, position in bodies:
        velocity = position.jacobian(q) * v
        kinetic += mass * velocity.dot(velocity) / 2
        potential += mass * (g * position[1] - slope * position[0])
    over_ground = vx - height * vphi + rates[7]
    kinetic += moving * over_ground**2 / 2
    potential -= moving * slope * (x - height * phi + along)
    momenta = sp.Matrix([kinetic]).jacobian(v).T
    matrix = momenta.jacobian(v)
    forces = sp.Matrix([kinetic - potential]).jacobian(q).T - momenta.jacobian(q) * v
    forces -= sp.Matrix([dissipation]).jacobian(v).T
    forces += sp.Matrix([0, 0, 0, *torques, 0, 0, 0])

    def to_first_order(expression):
        """Put the axis turned to first order, (X₀ − φY₀, Y₀ + φX₀), into an equation of motion."""
        expanded = sp.expand(sp.expand(expression).subs(sp.cos(phi) ** 2, 1 - sp.sin(phi) ** 2))
        # squares must have cancelled to 1 (J is constant); what is left is an axis, linear in cos φ, sin φ
        assert sp.Poly(expanded, sp.sin(phi), sp.cos(phi)).total_degree() <= 1
        return expanded.subs({sp.sin(phi): phi, sp.cos(phi): 1})

    given = coordinates, rates, (*common, *exciters), torques, (*transport, *couplings)
    return given, matrix.applyfunc(to_first_order), forces.applyfunc(to_first_order)


@cache
def lagrange():
    """Return a function of (coordinates, rates, constants, torques), without transport and couplings by springs."""
    import sympy as sp

    (coordinates, rates, constants, torques, more), matrix, forces = derived()
    plain = dict.fromkeys(more, 0)
    result = (matrix[:7, :7].subs(plain), forces[:7, :].subs(plain))
    return sp.lambdify((coordinates[:7], rates[:7], constants, torques), result, modules="numpy", cse=True)


#: The generalized force of F_c = 1: +1 on the lower layer's y + y_w1, −1 on the platform's y.
CONTACT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])


def keys_of_exciters(scene):
    """Return masses, radii, rotor inertias and axes (x₁, y₁, x₂, y₂) of both exciters, as the scene is given them."""
    m = scene.machine
    gamma = np.radians(m.exciter_angle_deg)
    x, y = m.exciter_distance_m * np.array([np.cos(gamma), np.sin(gamma)])
    masses, axes = 2 * [m.unbalance_mass_kg], [x, y, -x, y]
    if scene.exciters is None:
        return masses, 2 * [m.unbalance_radius_m], 2 * [m.rotor_inertia_kg_m2], axes
    if scene.exciters[0].position_m is not None:
        masses = [exciter.unbalance_mass_kg for exciter in scene.exciters]
        axes = np.ravel([exciter.position_m for exciter in scene.exciters])
    radii, rotors = zip(*((e.unbalance_radius_m, e.rotor_inertia_kg_m2) for e in scene.exciters), strict=True)
    return masses, radii, rotors, axes


def constants(scene):
    """Return the constants of :func:`lagrange` from what the scene is given."""
    m, material = scene.machine, scene.material
    exciters = np.concatenate(keys_of_exciters(scene))
    share = material.lower_share if material.layers == 2 else 1.0
    masses = material.mass_ratio * (m.platform_mass_kg + exciters[0] + exciters[1])
    lower, upper = share * masses, (1.0 - share) * masses
    spring = upper * (2.0 * np.pi * (material.natural_frequency_hz or 0.0)) ** 2
    damper = 2.0 * (material.damping_ratio or 0.0) * np.sqrt(spring * upper)
    return (
        *(m.platform_mass_kg, m.platform_inertia_kg_m2),
        *(m.stiffness_x_n_per_m, m.stiffness_y_n_per_m, m.stiffness_phi_n_m_per_rad),
        *(m.damping_x_n_s_per_m, m.damping_y_n_s_per_m, m.damping_phi_n_m_s_per_rad),
        *(m.gravity_m_per_s2, lower, upper, spring, damper),
        *exciters,
    )


def expected(system, state, scene, added=0.0):
    """Return accelerations of the system's coordinates and F_c by Lagrange's equations, with forces that are added."""
    moving = [int(c) for c in system.places[: system.differential // 2]]
    given = constants(scene)
    unbalances = np.multiply(given[13:15], given[15:17])
    turning = {"counter-clockwise": 1.0, "clockwise": -1.0}
    directions = [turning[one.rotation] for one in scene.exciters] if scene.exciters else [1.0, -1.0]
    exciters = zip(scene.exciters or scene.motors, directions, state[10:12], unbalances, strict=True)
    frequency = scene.drive.supply_frequency_hz
    if scene.drive.program is not None:
        frequency = np.interp(TIME, *zip(*((e.t_s, e.supply_frequency_hz) for e in scene.drive.program), strict=True))
    torques = [  # less the resistance k_R m_r r φ̇²
        torque_by_quotient(motor, frequency, direction, w) - np.sign(w) * motor.friction_radius_m * unbalance * w**2
        for motor, direction, w, unbalance in exciters
    ]
    mass, forces = lagrange()(state[:7], state[7:], given, torques)
    mounts = [exciter.mounted_on for exciter in scene.exciters or ()]
    forces[2] -= sum(torque for torque, mount in zip(torques, mounts, strict=False) if mount == "deck")
    rows, columns = moving, mass[:, moving]
    if system.algebraic:
        # ÿ_w1 = 0 takes the place of an unknown acceleration, F_c that of the unknown
        rows = [*moving, 5]
        columns = np.column_stack([columns, -CONTACT])
    return np.linalg.solve(columns[rows], (forces[:, 0] + added)[rows])


@EACH_PAIR
def test_accelerations_and_contact_force_are_those_of_lagrange(system, machine):
    scene, p = scene_of(system.layers, machine), record_of(system.layers, machine)
    n = system.differential // 2
    wanted, got = [], []
    for full in random_states(seed=1, count=24):
        state = system.full(system.unknowns(full))
        y, yp, _, _ = settled(system, state[system.places], p)
        got.append(np.append(yp[n : 2 * n], y[2 * n :]))
        wanted.append(expected(system, state, scene))
    # each acceleration, and F_c, relative to the largest of its kind over the states; two linear solves
    # of condition ~1e4 and sums that cancel leave some 1e-14
    scale = np.max(np.abs(wanted), axis=0)
    assert np.all(scale > 0.0)
    assert np.max(np.abs(np.array(got) - wanted) / scale) < 1e-12


@pytest.mark.parametrize("machine", RECORDS)
def test_response_to_an_impulse_is_that_of_the_derived_mass_matrix(machine):
    scene, p = scene_of(2, machine), record_of(2, machine)
    given, response = constants(scene), np.empty(7)
    for state in random_states(seed=6, count=10):
        mass, _ = lagrange()(state[:7], state[7:], given, (0.0, 0.0))
        wanted = np.linalg.solve(mass, CONTACT)
        reduced = impulse_response(state, response, p)
        np.testing.assert_allclose(response, wanted, rtol=1e-12, atol=1e-13 * np.abs(wanted).max())
        assert reduced == pytest.approx(1.0 / wanted[5], rel=1e-13)
    mass, _ = lagrange()(np.zeros(7), np.zeros(7), constants(scene_of(0, machine)), (0.0, 0.0))
    listed = [scene.body.mass, scene.body.mass, scene.body.inertia, *scene.exciter_inertias]
    assert np.diag(mass)[:5] == pytest.approx(listed, rel=1e-14)
    # with φ₁ = φ₂ = 0 each unbalance lies beside its axis, and couples with y by its static moment
    assert mass[1, 3:5] == pytest.approx(scene.unbalances, rel=1e-14)


def as_sympy(n, known):
    """Return a node of the graph as an expression; ``known`` are nodes that have one."""
    import sympy as sp

    if n in known:
        return known[n]
    parts = [as_sympy(x, known) for x in n.parts]
    if n.op == "number":
        return sp.nsimplify(n.args[0])
    if n.op in ("symbol", "parameter", "local"):
        raise AssertionError(f"{n.args[0]} is not in the derivation")
    return {
        "sum": lambda a, b: a + b,
        "difference": lambda a, b: a - b,
        "product": lambda a, b: a * b,
        "negative": lambda a: -a,
        "inverse": lambda a: 1 / a,
        "sine": sp.sin,
        "cosine": sp.cos,
        "sense": sp.sign,
    }[n.op](*parts)


def test_the_source_states_lagranges_equations():
    """All rows, symbol by symbol, with transport; exact to first order in φ, as the axes are."""
    import sympy as sp

    (q, v, constants, torques, (slope, height, moving, *couplings)), matrix, forces = derived()
    m_0, j_0, c_x, c_y, c_phi, b_x, b_y, b_phi, g, m_w1, m_w2, c_w, b_w = constants[:13]
    masses, radii, rotors, axes = constants[13:15], constants[15:17], constants[17:19], constants[19:]
    mass, a, (contact, friction) = m_0 + sum(masses), sp.symbols("a:8", real=True), sp.symbols("F_c F_t")
    decks = sp.symbols("delta1 delta2")
    centre = [sum(m * axes[2 * i + k] for i, m in enumerate(masses)) / mass for k in (0, 1)]
    arms = [[axes[2 * i + k] - centre[k] for k in (0, 1)] for i in (0, 1)]
    inertia = (
        j_0 + m_0 * sum(c**2 for c in centre) + sum(m * (x**2 + y**2) for m, (x, y) in zip(masses, arms, strict=True))
    )
    fields = {"mass": mass, "inertia": inertia, "gravity": g, "slope": slope, "deck_height": height}
    fields |= {"material_mass": moving, "stiffness_x": c_x, "stiffness_y": c_y, "stiffness_phi": c_phi}
    fields |= {"damping_x": b_x, "damping_y": b_y, "damping_phi": b_phi, "lower_mass": m_w1, "upper_mass": m_w2}
    fields |= dict(
        zip(("stiffness_x_phi", "stiffness_y_phi", "damping_x_phi", "damping_y_phi"), couplings, strict=True)
    )
    fields |= {"layer_stiffness": c_w / m_w2, "layer_damping": b_w / m_w2}
    known = {parameter(name): value for name, value in fields.items()} | {symbol("force"): contact}
    known[symbol("friction")] = friction
    for letter, values in (("q", q), ("v", v), ("a", a)):
        known |= {symbol(f"{letter}_{name}"): value for name, value in zip(PLACE_TEXTS, values, strict=True)}
    rows, found = traced()
    net = motor(found["v_angle"], P) - resistance(found["v_angle"], P)
    for i in (0, 1):
        pair = {"unbalance": masses[i] * radii[i], "exciter_inertia": rotors[i] + masses[i] * radii[i] ** 2}
        pair |= {"axis_x": arms[i][0], "axis_y": arms[i][1], "deck": decks[i]}
        known |= {parameter(f"{name}[{i}]"): value for name, value in pair.items()} | {scalar(net, i): torques[i]}
    row = {name: as_sympy(n, known) for name, n in of_one(rows).items() if name != "law"}
    # from rows of each body to those of coordinates, which move all that is carried along
    row["upper"] *= m_w2
    row["gap"] += row["upper"]
    row["y"] += row["gap"]
    row["x"] += row["along"]
    row["phi"] -= height * row["along"]
    reaction = sum(deck * torque for deck, torque in zip(decks, torques, strict=True))
    others = sp.Matrix([0, 0, -reaction, 0, 0, contact, 0, friction])
    for name, expected in zip(PLACE_TEXTS, matrix * sp.Matrix(a) - forces - others, strict=True):
        difference = sp.expand(row[name] - expected).subs(
            {sp.cos(angle) ** 2: 1 - sp.sin(angle) ** 2 for angle in q[3:5]}
        )
        assert sp.cancel(sp.expand(difference)) == 0, name


def test_torques_in_the_source_are_those_of_kloss_and_of_bearings():
    import sympy as sp

    speed, w_0, direction, critical, torque, friction = sp.symbols("w w_0 sigma Delta M_c k", real=True)
    fields = {"speed": w_0, "speed_ramp": 0, "direction": direction, "slip_speed": critical, "slip_ramp": 0}
    fields |= {"torque": torque, "friction": friction}
    known = {parameter(f"{name}[0]"): value for name, value in fields.items()}
    known |= {symbol("w_0"): speed, local("elapsed"): 0}
    slip = w_0 - direction * speed
    given = symbol("w", pair=True)
    expected = direction * 2 * torque / (slip / critical + critical / slip)
    assert sp.simplify(as_sympy(scalar(motor(given, P)), known) - expected) == 0
    assert sp.simplify(as_sympy(scalar(resistance(given, P)), known) - friction * speed * sp.Abs(speed)) == 0


def test_non_impact_model_is_a_bare_platform_with_friction_and_mass_added():
    contact = {"model": "non-impact", "viscous_per_mass_per_s": 70.0, "added_mass_share": 0.4}
    added, bare = parameters(scene_of(2, **contact)), parameters(scene_of(0))
    m_w = 0.2 * bare.mass
    bare.damping_y += 70.0 * m_w
    bare.mass += 0.4 * m_w
    for name in PARAMETERS.names:
        assert added[name] == pytest.approx(bare[name], rel=1e-14), name
