"""Material on a deck whose motion is given: rest, slide, flight and landing by their closed forms.

A heavy platform swings freely on its springs, x = a cos(wt + p) along and y = b cos(wt + q) normal to the deck about
rest, and does not feel a block of 1e-12 of its mass. With s the block's place on the deck,

    slip of the sense z:  s'' = g_x - mu z (g_n + y'') - x'',    flight:  s'' = g_x - x'',  gap'' = -g_n - y'',

so that rates are sums of t and of the deck's own rates, and each event is a root of one known function of time (Sloot
and Kruyt, Powder Technology 87, 1996).
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from common.references import REFERENCES
from scipy.optimize import brentq

from vibroplat import Scene, load_config, simulate

GRAVITY, FREQUENCY = 9.81, 20.0
OMEGA = 2.0 * math.pi * FREQUENCY
#: Error of rates over the amplitude of the deck's, and of event times over a period.
ERROR = 1e-9
#: Times at which closed forms are looked at for a change of sign, in a period.
LOOKS = 20_000


@dataclass
class Deck:
    """A deck with a block on it; amplitudes in units of g/w², angles in rad."""

    along: float = 0.0
    normal: float = 0.0
    along_phase: float = 0.0
    normal_phase: float = 0.0
    friction: float = 0.3
    static: float = 0.0  # the same as friction unless larger
    decline: float = 0.0
    restitution: float = 0.0
    slip: float = 0.0  # of the block at the beginning, in units of g/w
    turns: float = 3.0

    def __post_init__(self):
        self.static = max(self.static, self.friction)
        self.along_gravity, self.gravity = GRAVITY * math.sin(self.decline), GRAVITY * math.cos(self.decline)
        self.duration = self.turns / FREQUENCY
        self.speed = GRAVITY / OMEGA * max(math.hypot(self.along, self.normal), abs(self.slip))

    def moved(self, t, order, *, normal=False):
        """Return a derivative of the deck's motion along or normal to itself."""
        size, phase = (self.normal, self.normal_phase) if normal else (self.along, self.along_phase)
        return size * GRAVITY * OMEGA ** (order - 2) * np.cos(OMEGA * t + phase + 0.5 * math.pi * order)

    def rate(self, t, since, rate, sense, friction):
        """Return s' of slip, or without friction of flight, that has begun at a time with a rate."""
        change = self.moved(t, 1) - self.moved(since, 1)
        pressed = self.gravity * (t - since) + self.moved(t, 1, normal=True) - self.moved(since, 1, normal=True)
        return rate + self.along_gravity * (t - since) - change - friction * sense * pressed

    def place(self, t, since, rate, sense, friction):
        """Return how far the block has slipped or flown along the deck since a time."""
        dt = t - since
        x, y = (self.moved(t, 0, normal=n) - self.moved(since, 0, normal=n) for n in (False, True))
        own = rate + self.moved(since, 1) + friction * sense * self.moved(since, 1, normal=True)
        return (
            own * dt + 0.5 * (self.along_gravity - friction * sense * self.gravity) * dt**2 - x - friction * sense * y
        )

    def gap(self, t, since, rate):
        """Return the height of a flight that has begun at a time with a rate of the gap."""
        fallen = 0.5 * self.gravity * (t - since) ** 2
        own = (rate + self.moved(since, 1, normal=True)) * (t - since)
        return own - fallen - (self.moved(t, 0, normal=True) - self.moved(since, 0, normal=True))

    def gap_rate(self, t, since, rate):
        return rate - self.gravity * (t - since) - self.moved(t, 1, normal=True) + self.moved(since, 1, normal=True)

    def pressing(self, t):
        return self.gravity + self.moved(t, 2, normal=True)

    def needed(self, t):
        """Return the force of friction over the block's mass that would hold it."""
        return self.moved(t, 2) - self.along_gravity

    def contact(self, t, rate):
        """Return mode and sense of contact at a time with a rate of slip."""
        if self.pressing(t) < 0.0:
            return "flight", 0.0
        if rate == 0.0:
            if abs(self.needed(t)) <= self.static * self.pressing(t):
                return "stick", 0.0
            return "slip", -math.copysign(1.0, self.needed(t))
        return "slip", math.copysign(1.0, rate)


def fall(function, begin, end):
    """Return where a function that is positive right after the beginning first falls through 0, or inf."""
    times = begin + np.arange(1, math.ceil((end - begin) * FREQUENCY * LOOKS) + 1) / (FREQUENCY * LOOKS)
    below = np.flatnonzero((function(times[1:]) <= 0.0) & (function(times[:-1]) > 0.0))
    return brentq(function, times[below[0]], times[below[0] + 1], xtol=1e-16, rtol=1e-15) if below.size else math.inf


def closed_form(deck):
    """Return events (time, kind) and pieces (time, mode, sense, rate of slip, place, rate of the gap) of a motion."""
    t, rate, place, gap_rate, events, pieces = 0.0, deck.slip * GRAVITY / OMEGA, 0.0, 0.0, [], []
    mode, sense = deck.contact(t, rate)
    while True:
        pieces.append((t, mode, sense, rate, place, gap_rate))
        begun, now = t, (t, rate, sense, deck.friction if mode == "slip" else 0.0)
        if mode == "stick":
            cones = [lambda at, z=z: deck.static * deck.pressing(at) + z * deck.needed(at) for z in (1.0, -1.0)]
            t, sense = min((fall(cone, begun, deck.duration), z) for cone, z in zip(cones, (1.0, -1.0), strict=True))
        elif mode == "slip":
            t = lifts = fall(deck.pressing, begun, deck.duration)
            if deck.friction > 0.0:
                t = min(lifts, fall(lambda at, now=now: now[2] * deck.rate(at, *now), begun, deck.duration))
        else:
            t = fall(lambda at, begun=begun, rose=gap_rate: deck.gap(at, begun, rose), begun, deck.duration)
        if t == math.inf:
            return events, pieces
        if mode == "stick":
            kind, mode = "slip", "slip"
        elif mode == "slip":
            rate, place, gap_rate = deck.rate(t, *now), place + deck.place(t, *now), 0.0
            kind, mode = "liftoff", "flight"
            if t < lifts:
                rate = 0.0
                mode, sense = deck.contact(t, 0.0)
                kind = "stick" if mode == "stick" else "reversal"
        else:
            strikes = -deck.gap_rate(t, begun, gap_rate)
            rate, place = deck.rate(t, *now), place + deck.place(t, *now)
            stops = (1.0 + deck.restitution) * deck.friction * strikes
            rate = math.copysign(max(abs(rate) - stops, 0.0), rate)
            kind, gap_rate = "impact", deck.restitution * strikes
            mode, sense = ("flight", 0.0) if gap_rate > 0.0 else deck.contact(t, rate)
        events.append((t, kind))


def rates_at(deck, pieces, times):
    begins = [piece[0] for piece in pieces]
    found = []
    for t in times:
        since, mode, sense, rate, place, _ = pieces[int(np.searchsorted(begins, t, side="right")) - 1]
        now = (t, since, rate, sense, deck.friction if mode == "slip" else 0.0)
        found.append((0.0, place) if mode == "stick" else (deck.rate(*now), place + deck.place(*now)))
    return np.array(found).T


def moved(deck, mass_ratio=1e-12):
    """Return the run of a machine whose deck moves so, with a block of a part of its mass."""
    tree = load_config(REFERENCES / "stick-slip-no-flight.yaml").to_tree()
    for section in ("exciters", "run"):
        del tree[section]
    body = {"platform_mass_kg": 1000.0, "platform_inertia_kg_m2": 1000.0, "unbalance_mass_kg": 1e-9}
    mass = 1000.0 + 2e-9
    stiffness, loaded = mass * OMEGA**2, (1.0 + mass_ratio) * mass
    springs = {"stiffness_x_n_per_m": stiffness, "stiffness_y_n_per_m": stiffness, "stiffness_phi_n_m_per_rad": 1e9}
    dampers = {f"damping_{what}": 0.0 for what in ("x_n_s_per_m", "y_n_s_per_m", "phi_n_m_s_per_rad")}
    friction = {"friction": deck.friction, "static_friction": deck.static}
    state = {
        "x_m": loaded * deck.along_gravity / stiffness + deck.moved(0.0, 0),
        "y_m": -loaded * deck.gravity / stiffness + deck.moved(0.0, 0, normal=True),
        "x_rate_m_per_s": deck.moved(0.0, 1),
        "y_rate_m_per_s": deck.moved(0.0, 1, normal=True),
        "along_rate_m_per_s": deck.slip * GRAVITY / OMEGA,
        "phi1_rad": 0.0,
        "phi2_rad": 0.0,
    }
    tree |= {
        "machine": {**body, **springs, **dampers, "gravity_m_per_s2": GRAVITY},
        "motor": {"critical_torque_n_m": 0.0},
        "material": {"mass_ratio": mass_ratio, "layers": 1},
        "contact": {"restitution": deck.restitution},
        "transport": {**friction, "deck_angle_deg": math.degrees(deck.decline), "deck_height_m": 0.0},
        "solver": {"engine": "taylor", "tolerance": 1e-13},
        "run": {"duration_s": deck.duration, "initial": {"state": state}},
    }
    return simulate(Scene.from_tree(tree))


#: Decks by what the block does on them.
CASES = {
    "rests": Deck(along=0.29, turns=1.0),
    "slides and sticks": Deck(along=0.5),
    "slides both ways": Deck(along=0.9),
    "holds on longer than it slides": Deck(along=0.5, friction=0.2, static=0.4),
    "slides down a deck to rest": Deck(along=0.1, slip=0.4, decline=0.2),
    "slides up a deck and rests": Deck(along=0.1, normal=0.2, slip=-0.4, decline=0.2, static=0.5),
    "slips on a steep deck while it is light": Deck(normal=0.5, decline=0.25),
    "is carried forth by a line of action": Deck(along=0.7, normal=0.6),
    "is carried back by a turning deck": Deck(along=0.6, normal=0.5, normal_phase=0.5 * math.pi),
    "is thrown, lands sliding": Deck(along=2.2, normal=1.3, friction=0.15),
    "is thrown, lands sticking": Deck(along=0.8, normal=1.6, friction=0.5),
    "is thrown down a deck": Deck(along=1.7, normal=1.4, friction=0.25, decline=0.2),
    "is thrown up a deck": Deck(along=2.0, normal=1.5, friction=0.6, decline=-0.25),
    "bounces": Deck(along=1.0, normal=4.0, friction=0.05, restitution=0.8, turns=1.5),
    "is thrown on a smooth deck": Deck(along=1.0, normal=1.5, friction=0.0),
}


@pytest.mark.parametrize("name", CASES)
def test_a_block_moves_as_by_closed_forms(name):
    deck = CASES[name]
    events, pieces = closed_form(deck)
    run = moved(deck)
    assert run.events["kind"].to_list() == [kind for _, kind in events]
    np.testing.assert_allclose(run.events["t_s"], [t for t, _ in events], rtol=0.0, atol=ERROR / FREQUENCY)
    times = np.linspace(0.0, deck.duration, 200)
    apart = np.abs(times[:, np.newaxis] - np.array([-1.0, *(t for t, _ in events)])).min(axis=1)
    times = times[apart > 1e-6 / FREQUENCY]  # which side of an event is not asked
    rate, place = rates_at(deck, pieces, times)
    there = run(times)
    np.testing.assert_allclose(there["along_rate_m_per_s"], rate, rtol=0.0, atol=ERROR * deck.speed)
    np.testing.assert_allclose(there["along_m"], place, rtol=0.0, atol=ERROR * deck.speed / OMEGA)


@pytest.mark.parametrize("throw", [math.sqrt(1.0 + math.pi**2), 2.0])
def test_the_throw_of_a_sticky_block(throw):
    """Lift-off where sin = 1/throw; with throw² = 1 + pi² the flight ends when the deck begins to throw again.

    In each landing a block of 1e-9 of the platform's mass takes 2e-9 of its velocity: flights grow shorter by 1e-9.
    """
    run = moved(Deck(normal=-throw, friction=5.0, turns=4.0), mass_ratio=1e-9)
    kinds, turns = run.events["kind"].to_numpy(), FREQUENCY * run.events["t_s"].to_numpy()
    left, landed = turns[kinds == "liftoff"], turns[kinds == "impact"]
    # y = -A cos wt moves up from its lowest place: y'' = A w² cos wt falls through -g
    assert np.cos(2.0 * math.pi * left[:3]) == pytest.approx(-1.0 / throw, abs=1e-8)
    if throw > 3.0:
        assert landed - left[: len(landed)] == pytest.approx(1.0, abs=1e-8)


def test_boundless_friction_adds_the_mass_along_the_deck():
    deck, ratio = Deck(along=0.5, friction=1e9, turns=8.0), 0.7
    run = moved(deck, mass_ratio=ratio)
    times = np.linspace(0.0, deck.duration, 100)
    size = deck.along * GRAVITY / OMEGA**2
    swings = size * np.cos(OMEGA * times / math.sqrt(1.0 + ratio))
    np.testing.assert_allclose(run(times)["x_m"], swings, rtol=0.0, atol=1e-9 * size)
    assert run.events.empty
