"""Energies against the powers that change them, along the motion."""

import numpy as np
import pytest

from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lanes import load_2, store
from vibroplat.model.energy import FORCE, FORCE_SIZE, POWERS, energies, exciter_powers, powers
from vibroplat.model.impact import kinetic_change
from vibroplat.model.motor import motor_torques
from vibroplat.model.parameters import parameters
from vibroplat.model.springs import curved_means, foundation_forces, slopes
from vibroplat.observe.loads import add_forces

from .helpers import (
    EACH_PAIR,
    SETUPS,
    TIME,
    central_difference,
    mass_matrix,
    random_states,
    record_of,
    scene_of,
    settled,
)

KINETIC, ELASTIC, GRAVITY, MOMENTUM = range(4)


def states_of(system, seed, count=8):
    """Return full states in which what the system does not have is 0."""
    return [system.full(system.unknowns(state)) for state in random_states(seed, count)]


def rates_of(system, state, p):
    """Return the rates of energies and momentum along the motion: they are functions of the state."""
    _, yp, _, _ = settled(system, state[system.places], p)
    tangent = np.zeros_like(state)
    tangent[system.places] = yp[: system.differential]
    return central_difference(lambda time: np.array(energies(state + time * tangent, p)[:4]), step=2e-5)


@compiled
def exciters(state, p, out):
    speed = load_2(state, 0, 10)
    found = exciter_powers(motor_torques(TIME, speed, p), speed, load_2(state, 0, 3), state[2], state[9], p)
    for i, both in enumerate((found.motor - found.held, found.truncation, found.resistance)):
        store(both, out, i, 0)


@compiled
def curve(samples, out, p):
    curved_means(samples, np.ones(1), 1, 4, out, p)


@compiled
def load(sums, means, p):
    stiffness, damping = slopes(p)
    add_forces(sums, means, np.array([stiffness, (damping[0], p.suspension_damping_y, damping[2], 0.0, 0.0)]), 7, 1.0)


def means_of(state, p):
    """Return means over no time."""
    means = np.zeros((5, 16))
    means[:3, :14], means[3, :4] = (state, state**2, abs(state)), state[:4] * state[7:11]
    curve(np.array([state, state]), means[4], p)
    return means


def powers_of(state, p):
    out, each = np.empty(FORCE_SIZE + 1), np.empty((3, 2))
    exciters(state, p, each)
    powers(tuple(each.sum(axis=1)), means_of(state, p), 7, 4, out, p)
    return dict(zip(POWERS, out, strict=False)), out[FORCE], out[FORCE_SIZE]


@EACH_PAIR
def test_energy_and_momentum_change_by_powers_and_forces_alone(system, machine):
    """Attached as well: the contact force acts on both sides of a gap that stays closed, without power."""
    p, shares = record_of(system.layers, machine), []
    states = states_of(system, seed=7)
    for state in states[4:]:
        state[2], state[9] = 0.1, -10.0  # far beyond what the model is for, to make the truncation's term large
    states += [state.copy() for state in states[:2]]
    states[-2][2] = states[-1][9] = 0.0
    for state in states:
        rates = rates_of(system, state, p)
        power, force, size = powers_of(state, p)
        losses = sum(value for name, value in power.items() if name.startswith(("damping", "resistance")))
        largest = np.max(np.abs([*rates[:MOMENTUM], *power.values()]))
        unexplained = rates[:MOMENTUM].sum() - (power["motor"] - losses)
        # energies of up to ~1e2 J to round-off over 2e-5 s, against the powers of ~1e3 W that cancel
        assert abs(unexplained - power["truncation"]) < 1e-8 * largest
        assert rates[MOMENTUM] == pytest.approx(force, abs=1e-7 * max(size, abs(state[10:12]).max()))
        shares.append(abs(power["truncation"]) / largest)
    # a projection of the axis may be small by chance, in the median it is not; nothing is truncated without rotation
    assert np.median(shares[4:8]) > 1e-4
    assert shares[8:] == [0.0, 0.0]


def check_foundation(p):
    """Sums of the forces into the foundation, and of their squares, are those of the forces themselves."""
    for state in random_states(seed=3, count=4):
        sums, force = np.zeros(6), np.array(foundation_forces(*state[:3], *state[7:10], p))
        load(sums, means_of(state, p), p)
        assert sums[:3] == pytest.approx(force, rel=1e-12)
        assert sums[3:] == pytest.approx(force**2, rel=1e-12)


def test_loads_of_the_foundation_are_the_forces_that_are_shown():
    check_foundation(parameters(scene_of(2, model="non-impact", viscous_per_mass_per_s=70.0)))


@pytest.mark.parametrize(("machine", "layers"), list(zip(SETUPS, (0, 1, 2, 2, 2), strict=True)))
def test_kinetic_energy_is_that_of_the_mass_matrix(machine, layers):
    scene = scene_of(layers, machine)
    (lower_mass, upper_mass), p = scene.layer_masses, parameters(scene)
    for state, other in random_states(seed=12, count=20).reshape(10, 2, 14):
        lower, rates = state[8] + state[12], state[7:12]
        expected = 0.5 * rates @ mass_matrix(state, scene) @ rates
        expected += 0.5 * (lower_mass * lower**2 + upper_mass * (lower + state[13]) ** 2)
        assert energies(state, p)[KINETIC] == pytest.approx(expected, rel=1e-13)
        after = np.append(state[:7], other[7:])
        both = energies(after, p)[KINETIC], expected
        assert kinetic_change(state, after, p) == pytest.approx(both[0] - both[1], abs=1e-13 * max(both))


def test_kinetic_change_of_a_small_jump_keeps_its_digits():
    p = parameters(scene_of(2))
    (before,) = random_states(seed=14, count=1)
    after = before.copy()
    after[7:] *= 1.0 + 1e-9
    # T scales with the square: ΔT = ((1 + ε)² − 1) T, where the rates' own rounding leaves 1e-16/1e-9
    expected = ((1.0 + 1e-9) ** 2 - 1.0) * energies(before, p)[KINETIC]
    assert kinetic_change(before, after, p) == pytest.approx(expected, rel=1e-6)
