"""The impact map against closed forms, linear solves and conservation laws; the chatter against many impacts."""

import numpy as np
import pytest

from vibroplat.model.impact import chatter_map, impact, impulse_response, kinetic_change, remaining_impacts
from vibroplat.model.parameters import IMPACT_LAWS, parameters

from .helpers import mass_matrix, random_states, scene_of

#: Machines, layers, restitution: each pair of a machine with another choice. An impact knows no supply.
CASES = [
    *(("paper", 1, 0.0), ("paper", 2, 0.3), ("paper", 2, 1.0), ("lopsided", 1, 0.8), ("lopsided", 2, 0.0)),
    *(("co-rotating", 1, 0.3), ("co-rotating", 2, 0.8), ("co-rotating", 1, 1.0)),
]

#: Rates of platform and exciters that laws know, in the order (x, y, φ, φ₁, φ₂).
PLACES = {"conservative": [0, 1, 2, 3, 4], "central": [0, 1, 3, 4], "printed": [0, 1, 3, 4]}


def approaching(seed, count=20):
    """Return full states at the end of a flight: gap a round-off away from 0, gap rate below 0."""
    states = random_states(seed, count)
    states[:, 5] = 1e-12
    states[:, 12] = -0.05 - np.abs(states[:, 12])
    return states


def struck(before, p, restitution=None):
    after = np.empty_like(before)
    impulse, loss = impact(before, after, p.restitution if restitution is None else restitution, p)
    return after, impulse, loss


def jump_by_linear_solve(before, scene, places):
    """Return (jump of the rates of platform and exciters, impulse), from the balance of momentum."""
    matrix = mass_matrix(before, scene)[np.ix_(places, places)]
    n = len(places)
    # 𝓜 Δv + P ê_y = 0 and, for the lower layer, m_w1 (Δẏ + Δẏ_w1) − P = 0
    system, right = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
    system[:n, :n] = matrix
    system[1, n] = 1.0
    system[n, 1] = scene.layer_masses[0]
    system[n, n] = -1.0
    right[n] = scene.layer_masses[0] * (1.0 + scene.contact.restitution) * before[12]
    solution = np.linalg.solve(system, right)
    jump = np.zeros(5)
    jump[places] = solution[:n]
    return jump, solution[n]


@pytest.mark.parametrize(("machine", "layers", "restitution"), CASES)
@pytest.mark.parametrize("law", IMPACT_LAWS)
def test_law_is_the_solution_of_the_momentum_balance(machine, layers, restitution, law):
    scene = scene_of(layers, machine, restitution=restitution, impact_law=law)
    p, m_w1 = parameters(scene), scene.layer_masses[0]
    for before in approaching(seed=21, count=10):
        before[[6, 13]] *= layers == 2
        kept = before.copy()
        after, impulse, loss = struck(before, p)
        jump, expected = jump_by_linear_solve(before, scene, PLACES[law])
        assert (after - before)[7:12] == pytest.approx(jump, rel=1e-12, abs=1e-13)
        assert impulse == pytest.approx(expected, rel=1e-13)
        assert impulse > 0.0
        assert loss == -kinetic_change(before, after, p)
        # positions stay, and the gap is pinned
        assert np.array_equal(before, kept)
        assert np.array_equal(after[:7], np.where(np.arange(7) == 5, 0.0, before[:7]))
        assert after[12] == -restitution * before[12]
        if layers == 1:
            assert after[13] == 0.0
        elif law == "printed":  # the upper layer takes the platform's jump along
            assert after[13] == pytest.approx(before[13] + (1.0 + restitution) * before[12], rel=1e-13, abs=1e-15)
        else:
            velocities = before[[8, 12, 13]]
            assert after[[8, 12, 13]].sum() == pytest.approx(velocities.sum(), abs=1e-14 * np.abs(velocities).max())
        if law != "conservative":
            assert after[9] == before[9]
            continue
        k_eff = 1.0 / np.linalg.inv(mass_matrix(before, scene))[1, 1]
        expected = 0.5 * k_eff * m_w1 / (k_eff + m_w1) * (1.0 - restitution**2) * before[12] ** 2
        before[7:12] = before[13] = 0.0  # without turning exciters no energies cancel
        _, impulse, loss = struck(before, p)
        assert loss == pytest.approx(expected, rel=1e-13, abs=1e-13 * impulse * -before[12])


def follow(state, accelerations, p):
    """Follow impact by impact until one sticks or their speed is 1e-13 of the first.

    The mass matrix stays that of the first state, which is what `chatter` assumes. Returns (state, duration, impulse,
    loss).
    """
    state, angles, slowest = state.copy(), state[2:5].copy(), 1e-13 * state[12]
    sums = np.zeros(3)
    while state[12] > slowest:
        flight = 2.0 * state[12] / -accelerations[5]
        state[:7] += flight * state[7:] + 0.5 * flight**2 * accelerations
        state[7:] += flight * accelerations
        at_impact = state.copy()
        at_impact[2:5] = angles
        after, impulse, loss = struck(at_impact, p, 0.0 if -state[12] < p.sticking_speed else None)
        state[7:], state[5] = after[7:], 0.0
        sums += flight, impulse, loss
    return state, *sums


#: Law, machine, layers, restitution and sticking speed: none, one that some of the impacts after a rebound of 0.02 m/s
#: are slower than, one that all are.
LATCHES = [
    *(("conservative", "paper", 2, 0.6, 0.0), ("conservative", "lopsided", 1, 0.9, 0.006)),
    *(("conservative", "co-rotating", 2, 0.3, 0.03), ("conservative", "paper", 1, 0.0, 0.0)),
    *(("central", "paper", 2, 0.6, 0.006), ("central", "lopsided", 1, 0.3, 0.0), ("central", "paper", 2, 0.7, 0.03)),
    *(("printed", "paper", 2, 0.6, 0.0), ("printed", "paper", 2, 0.9, 0.006), ("printed", "paper", 2, 0.6, 0.03)),
]


@pytest.mark.parametrize(("law", "machine", "layers", "restitution", "sticking"), LATCHES)
def test_latch_is_the_sum_of_all_impacts(law, machine, layers, restitution, sticking):
    contact = {"restitution": restitution, "restitution_threshold_m_per_s": sticking, "impact_law": law}
    p = parameters(scene_of(layers, machine, **contact))
    (before,) = random_states(seed=30, count=1)
    before[5], before[12] = 0.0, 0.02
    accelerations = np.array([30.0, 20.0, 150.0, 900.0, -700.0, -35.0, 15.0])  # of a flight that comes back
    before[[6, 13]] *= layers == 2
    accelerations[6] *= layers == 2
    wanted, *sums = follow(before, accelerations, p)
    after, response = np.empty(14), np.empty(7)
    duration, impulse, loss = chatter_map(before, accelerations, after, p)
    assert (duration, impulse) == pytest.approx(tuple(sums[:2]), rel=1e-10)
    if law == "conservative" or machine == "paper":  # other laws on lopsided machines: cancelled to fewer digits
        assert loss == pytest.approx(sums[2], rel=1e-10)
    assert after[5] == after[12] == 0.0
    impulse_response(before, response, p)
    jumps = np.abs(accelerations) * duration + impulse * np.abs(response)
    scale = np.append(duration * (np.abs(before[7:]) + jumps), jumps)
    # relative to what moves each coordinate and rate while the impacts go on; one layer has no upper one
    assert np.all(np.abs(after - wanted) <= 1e-10 * scale)


@pytest.mark.parametrize(
    ("sticking_speed", "left"), [(0.0, np.inf), (3.0, 1), (0.99, 2), (0.3, 3), (0.24, 4), (0.001, 11), (5e-324, 1076)]
)
def test_impacts_are_counted_until_one_sticks(sticking_speed, left):
    """They approach at 1, 0.5, 0.25, … m/s."""
    assert (
        remaining_impacts(1.0, parameters(scene_of(1, restitution=0.5, restitution_threshold_m_per_s=sticking_speed)))
        == left
    )
