"""Returns of a Poincaré section that does not repeat: from where Newton's method may find orbits."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator

import numpy as np

from vibroplat.kernels.compiled import FloatArray

#: Largest number of turns of a few more returns: chaos that converges to an orbit of many turns passes near it before.
MAX_MORE_TURNS = 24
#: Largest distance of returns, in scaled units. How many are tried because they are the nearest of all, how
#: many because they are the nearest of a number of turns relative to returns after its divisors, and how many that are
#: longer. In chaos at 57 Hz nearly all returns after 6 turns belong to an orbit of 2 turns: those that are nearest show
#: a stable orbit of 6 turns, or the saddle beside it, in 0 of 40 windows, relative ones in 23.
MAX_DISTANCE, NEAREST_COUNT, RELATIVE_COUNT, MANY_TURNS_COUNT = 2.0, 6, 3, 2
#: Largest distance of a return relative to returns after divisors of its turns, which belong to shorter orbits.
MAX_RATIO = 0.7
#: How far apart returns of the same turns are, and how far from known orbits, relative to their own distances.
MIN_SEPARATION = 0.5
#: Growth of a distance until the next return, above which a relative return is not tried: an orbit near it is more
#: unstable than those whose sides are searched. In 200 windows of chaos of five scenes, this finds 134 instead of 137
#: stable orbits, by 2083 instead of 3014 trials.
MAX_GROWTH = 3.0
#: Returns that are candidates, for each number of turns.
MAX_CANDIDATES = 60


def near_returns(points: FloatArray, longest: int) -> Iterator[tuple[int, int]]:
    """Yield numbers of turns and places after which a section comes back to itself, for a trial each.

    First the nearest of all; then in rounds the nearest of each number of turns relative to its divisors, without those
    that MAX_GROWTH excludes; then long ones.

    Parameters
    ----------
    points
        Of the section, in scaled units, shape (turns, 14).
    longest
        Largest number of turns of most returns.
    """
    away = _distances(points, min(MAX_MORE_TURNS, len(points) - 1))
    tried: list[tuple[int, int]] = []

    def fresh(turns: int, place: int) -> bool:
        ways = [points[k : k + n] for n, k in tried if n == turns]
        return all(is_apart(points[place], way, float(away[turns, place])) for way in ways)

    def mild(trial: tuple[int, int]) -> bool:
        turns, place = trial
        again = place + turns
        return again >= len(points) - turns or bool(away[turns, again] <= MAX_GROWTH * away[trial])

    def some(candidates: Iterable[tuple[int, int]], most: int) -> Iterator[tuple[int, int]]:
        for trial in itertools.islice((one for one in candidates if fresh(*one)), most):
            tried.append(trial)
            yield trial

    short, own = range(1, min(longest, len(away) - 1) + 1), _relative(away)
    yield from some(_nearest(away, short), NEAREST_COUNT)
    rounds = {turns: _nearest(own, [turns]) for turns in short}
    for _ in range(RELATIVE_COUNT):
        for candidates in rounds.values():
            yield from filter(mild, some(candidates, 1))
    long = np.where(own < MAX_RATIO, away, np.inf)
    yield from some(_nearest(long, range(longest + 1, len(away))), MANY_TURNS_COUNT)


def is_apart(point: FloatArray, way: FloatArray, distance: float) -> bool:
    """Whether a point of the section, from which motion returns to this distance, is far from a motion's points."""
    return bool(np.abs(point - way).max(axis=1).min() > MIN_SEPARATION * distance)


def _distances(points: FloatArray, most: int) -> FloatArray:
    """Distance of each point from the one a number of turns later, shape (most + 1, turns); inf beyond MAX_DISTANCE."""
    found = np.full((most + 1, len(points)), np.inf)
    for turns in range(1, most + 1):
        found[turns, :-turns] = np.abs(points[turns:] - points[:-turns]).max(axis=1)
    found[found > MAX_DISTANCE] = np.inf
    return found


def _relative(away: FloatArray) -> FloatArray:
    """Distances relative to the least after a divisor of as many turns, or to MAX_DISTANCE; inf if beyond MAX_RATIO."""
    found = np.full_like(away, np.inf)
    for turns in range(1, len(away)):
        shorter = [away[n] for n in range(1, turns) if turns % n == 0]
        least = np.minimum(np.min(shorter, axis=0), MAX_DISTANCE) if shorter else MAX_DISTANCE
        found[turns] = away[turns] / np.maximum(least, np.finfo(float).tiny)
    found[found > MAX_RATIO] = np.inf
    return found


def _nearest(away: FloatArray, lengths: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield turns and places of some lengths, the nearest first."""
    found = [(away[n, k], n, int(k)) for n in lengths for k in np.argsort(away[n])[:MAX_CANDIDATES]]
    yield from ((turns, place) for distance, turns, place in sorted(found) if distance < np.inf)
