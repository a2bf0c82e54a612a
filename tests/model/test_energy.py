"""Energies against the powers that change them, along the motion."""

import numpy as np
import pytest

from vibroplat.model.energy import FORCE_SIZE, POWERS, elastic_energy, gravity_energy, kinetic_energy, powers
from vibroplat.model.impact import kinetic_change
from vibroplat.model.parameters import parameters

from .helpers import (
    EACH_MACHINE,
    EACH_RECORD,
    EACH_SYSTEM,
    TIME,
    central_difference,
    mass_matrix,
    random_states,
    record_of,
    scene_of,
    settled,
)

LAYERS = pytest.mark.parametrize("layers", [0, 1, 2])


def motion_of(system, state, p):
    """Return the derivative of a full state of this system."""
    _, yp, _, _ = settled(system, state[system.places], p)
    rates = np.zeros_like(state)
    rates[system.places] = yp[: system.differential]
    return rates


def rate_of(energy, state, rates, p):
    # an energy is a function of the state, so its derivative along the tangent is that in time
    return central_difference(lambda time: energy(state + time * rates, p), step=2e-5)


def powers_of(state, p):
    out = np.empty(FORCE_SIZE + 1)
    powers(TIME, state, out, p)
    return dict(zip(POWERS, out, strict=False))


def states_of(system, seed):
    """Return full states in which what the system does not have is 0."""
    return [system.full(system.unknowns(state)) for state in random_states(seed, count=20)]


def imbalance(system, state, p):
    """Return (rate of the energy less all powers but the truncation's, that power, largest power)."""
    rates = motion_of(system, state, p)
    energies = [rate_of(energy, state, rates, p) for energy in (kinetic_energy, elastic_energy, gravity_energy)]
    power = powers_of(state, p)
    losses = sum(value for name, value in power.items() if name.startswith(("damping", "resistance")))
    largest = np.max(np.abs([*energies, *power.values()]))
    return sum(energies) - (power["motor"] - losses), power["truncation"], largest


@EACH_RECORD
@EACH_SYSTEM
def test_energy_changes_by_the_powers_alone(system, machine):
    # attached as well: the contact force acts on both sides of a gap that stays closed, without power
    p = record_of(system.layers, machine)
    for state in states_of(system, seed=7):
        unexplained, truncation, largest = imbalance(system, state, p)
        # energies of up to ~1e2 J to round-off over 2e-5 s, against the powers of ~1e3 W that cancel
        assert abs(unexplained - truncation) < 1e-8 * largest


@EACH_RECORD
@EACH_SYSTEM
def test_without_the_truncation_the_balance_fails(system, machine):
    p = record_of(system.layers, machine)
    shares = []
    for state in states_of(system, seed=8):
        state[2], state[9] = 0.1, -10.0  # far beyond what the model is for, to make the term large
        unexplained, truncation, largest = imbalance(system, state, p)
        assert unexplained == pytest.approx(truncation, abs=1e-8 * largest)
        shares.append(abs(unexplained) / largest)
    # a projection of the axis may be small by chance, in the median it is not
    assert np.median(shares) > 1e-4


@pytest.mark.parametrize("still", [2, 9], ids=["phi", "phi_rate"])
@EACH_RECORD
@EACH_SYSTEM
def test_nothing_is_truncated_without_rotation(system, machine, still):
    p = record_of(system.layers, machine)
    for state in states_of(system, seed=9):
        state[still] = 0.0
        unexplained, truncation, largest = imbalance(system, state, p)
        assert truncation == 0.0
        assert abs(unexplained) < 1e-8 * largest


@EACH_SYSTEM
def test_dissipations_take_and_a_turning_motor_gives(system):
    scene = scene_of(system.layers)
    p = parameters(scene)
    for state in states_of(system, seed=11):
        state[10:12] = [130.0, -90.0]  # both below their synchronous speeds, each in its direction
        power = powers_of(state, p)
        assert power["motor"] > 0.0
        losses = {name: value for name, value in power.items() if name.startswith(("damping", "resistance"))}
        present = [name for name in losses if name != "damping_layers" or system.layers == 2]
        assert len(losses) == 5
        assert all(losses[name] > 0.0 for name in present)
    assert (losses["damping_layers"] > 0.0) == (system.layers == 2)


@EACH_MACHINE
@LAYERS
def test_kinetic_energy_is_that_of_the_mass_matrix(layers, machine):
    scene = scene_of(layers, machine)
    lower_mass, upper_mass = scene.layer_masses
    for state in random_states(seed=12, count=10):
        lower = state[8] + state[12]
        rates = state[7:12]
        expected = 0.5 * rates @ mass_matrix(state, scene) @ rates
        expected += 0.5 * (lower_mass * lower**2 + upper_mass * (lower + state[13]) ** 2)
        assert kinetic_energy(state, parameters(scene)) == pytest.approx(expected, rel=1e-13)


@EACH_MACHINE
@LAYERS
def test_kinetic_change_is_the_difference_of_energies(layers, machine):
    p = parameters(scene_of(layers, machine))
    for before, other in random_states(seed=13, count=20).reshape(10, 2, 14):
        after = np.append(before[:7], other[7:])
        energies = kinetic_energy(after, p), kinetic_energy(before, p)
        change = kinetic_change(before, after, p)
        assert change == pytest.approx(energies[0] - energies[1], abs=1e-13 * max(energies))


def test_kinetic_change_of_a_small_jump_keeps_its_digits():
    p = parameters(scene_of(2))
    (before,) = random_states(seed=14, count=1)
    after = before.copy()
    after[7:] *= 1.0 + 1e-9
    # T scales with the square: ΔT = ((1 + ε)² − 1) T, where the rates' own rounding leaves 1e-16/1e-9
    expected = ((1.0 + 1e-9) ** 2 - 1.0) * kinetic_energy(before, p)
    assert kinetic_change(before, after, p) == pytest.approx(expected, rel=1e-6)
