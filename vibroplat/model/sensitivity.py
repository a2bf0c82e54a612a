"""Derivatives by parameters: the direction dp of a key in the space of parameters, and how kernels follow it.

They do by a complex step: with records of :data:`COMPLEX` the kernels of the model run with p + ih dp, and the
imaginary part of what they give is h times the derivative, to round-off (Squire and Trapp 1998). Variational equations
do so (:mod:`vibroplat.observe.variation`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vibroplat.config.scene import Scene
from vibroplat.errors import ConfigError
from vibroplat.kernels.compiled import FloatArray, compiled
from vibroplat.model.parameters import PARAMETERS, Parameters, blank_record, parameters, record_words

#: Names of the fields that enter the equations as numbers; the others are choices, say where the equations
#: hold, or are of transport, which has no derivatives yet.
CHOICES = (
    *("safe_rotation", "impact_law"),
    *("slope", "deck_height", "kinetic_friction", "static_friction", "material_mass", "material_share"),
)
NUMBERS = tuple(name for name in PARAMETERS.names or () if name not in CHOICES)
#: How many numbers they are; they are the first of the record.
_WIDTH = int(np.zeros(1, PARAMETERS).itemsize // 8 - len(CHOICES))

#: The record of parameters with complex numbers.
COMPLEX = np.dtype(
    [(name, complex if name in NUMBERS else of.base, of.shape) for name, (of, *_) in (PARAMETERS.fields or {}).items()],
    align=True,
)

#: Sections of a scene whose numbers enter the equations.
SECTIONS = ("machine", "motor", "motors", "exciters", "springs", "drive", "material", "contact")

#: Nodes of the polynomials in a key, as many as are needed, and their largest error over the largest value.
NODES, INTERPOLATION_TOLERANCE = (4, 32), 1e-14

#: Size h of the imaginary part: its square vanishes beside 1.
IMAGINARY = 1e-30

#: Step in a key, over its value. Differences of order 8 leave (4e-3)⁸ and round-off over 4e-3: some 1e-13.
STEP = 4e-3
_WEIGHTS = ((1, 4.0 / 5.0), (2, -1.0 / 5.0), (3, 4.0 / 105.0), (4, -1.0 / 280.0))


def parameter_direction(scene: Scene, key: str) -> Parameters:
    """Differentiate the parameters of a scene by one of its keys, as ``material.mass_ratio``.

    The difference may pass the end of a key's range, as at R = 0: the parameters are smooth functions there too.

    Raises
    ------
    vibroplat.errors.ConfigError
        The scene has no such key with a number that varies continuously, or the material vanishes at its value.
    """
    path = key.split(".")
    value = value_of(scene, key)
    if path[0] not in SECTIONS or not isinstance(value, float):
        raise ConfigError(
            f"{key} = {value} cannot be varied; allowed: a key of this scene with a continuous value, "
            f"in {', '.join(SECTIONS)}"
        )
    step = STEP * abs(value) or STEP
    dp = blank_record()
    for n, weight in _WEIGHTS:
        above, below = (with_value(scene, path, value + side * n * step) for side in (1, -1))
        if not above.layers == below.layers == scene.layers:
            raise ConfigError(f"{key} = {value} cannot be varied; allowed: a value at which there is material")
        p_above, p_below = parameters(above), parameters(below)
        for name in NUMBERS:
            dp[name] += weight * (p_above[name] - p_below[name]) / step
    return dp


def value_of(section: Any, key: str) -> Any:
    """Look a dotted key up; None if there is none. With N for a place in a list, it is that of the first."""
    for name in key.split("."):
        if isinstance(section, list):
            place = "0" if name == "N" else name
            section = section[int(place)] if place.isdecimal() and int(place) < len(section) else None
        elif isinstance(section, dict):
            section = section.get(name)
        else:
            section = getattr(section, name) if name in getattr(type(section), "model_fields", ()) else None
    return section


def with_value(section: Any, path: Sequence[str], value: float) -> Any:
    """Copy a section with one key changed, without a check of its range."""
    return with_values(section, {".".join(path): value})


def with_values(section: Any, values: Mapping[str, float]) -> Any:
    """Copy a section with dotted keys changed, without a check of their ranges: each section inside it once.

    N for a place in a list stands for all of them.
    """
    if "" in values or not values:
        return values.get("", section)
    inside: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        name, _, rest = key.partition(".")
        inside.setdefault(name, {})[rest] = value
    if isinstance(section, list):
        everywhere = inside.pop("N", {})
        return [with_values(one, everywhere | inside.get(str(i), {})) for i, one in enumerate(section)]
    if isinstance(section, dict):
        return {name: with_values(one, inside.get(name, {})) for name, one in section.items()}
    return section.model_copy(update={name: with_values(getattr(section, name), of) for name, of in inside.items()})


class Course(NamedTuple):
    """The parameters of a scene over a range of one key, by Chebyshev's polynomials: a thousandth of the work of each.

    Attributes
    ----------
    low, high
        The range; there is none if both are nan.
    c, rates
        Coefficients of the numbers that enter the equations, and of their derivatives by the key, shape (nodes, n).
    words
        A record of the scene's parameters as numbers, the first n of which :func:`go_along` changes.
    """

    low: float
    high: float
    c: FloatArray
    rates: FloatArray
    words: FloatArray


#: Where no key has a range.
NO_COURSE = Course(math.nan, math.nan, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1))


def course_of(scene: Scene, key: str, low: float, high: float) -> Course:
    """Return the course of the parameters; none where it does not agree with those of scenes to round-off."""
    path = key.split(".")

    def values(x: FloatArray) -> FloatArray:
        at = 0.5 * (low + high) + 0.5 * x * (high - low)
        return np.array([flat(parameters(with_value(scene, path, value))) for value in at.tolist()])

    between: FloatArray = np.cos(np.pi * np.arange(1, 6) / 6.0)
    expected = values(between)
    for count in NODES:
        nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
        at_nodes = values(nodes)
        c = np.linalg.solve(np.polynomial.chebyshev.chebvander(nodes, count - 1), at_nodes)
        apart = np.abs(np.polynomial.chebyshev.chebvander(between, count - 1) @ c - expected)
        if (apart <= INTERPOLATION_TOLERANCE * np.abs(at_nodes).max(axis=0)).all():
            rates = np.zeros(c.shape)
            rates[:-1] = 2.0 / (high - low) * np.polynomial.chebyshev.chebder(c)
            return Course(low, high, np.asarray(c, float), rates, record_words(parameters(scene)))
    return NO_COURSE


@compiled
def go_along(course: Course, value: float, slope: FloatArray) -> bool:
    """Fill the parameters at a value of the key, and their derivatives by it; False if it is out of the range."""
    if not course.low <= value <= course.high:
        return False
    x = (2.0 * value - course.low - course.high) / (course.high - course.low)
    before, now = x, 1.0  # Chebyshev's polynomials of two orders
    for j in range(slope.size):
        course.words[j] = slope[j] = 0.0
    for i in range(course.c.shape[0]):
        for j in range(slope.size):
            course.words[j] += now * course.c[i, j]
            slope[j] += now * course.rates[i, j]
        before, now = now, 2.0 * x * now - before
    return True


def flat(p: Any) -> Any:
    """View the numbers that enter the equations, of a record or an array of records, along a last axis."""
    records = np.asarray(p)
    numbers = records.reshape(records.shape or 1).view(complex if records.dtype == COMPLEX else float)
    return numbers.reshape(*records.shape, -1)[..., :_WIDTH]
