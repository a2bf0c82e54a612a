"""The springs of a machine where they sit, and what they make together: how they hold its x, y and φ."""

from __future__ import annotations

from functools import lru_cache
from itertools import permutations
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from vibroplat.config.coordinates import TURN
from vibroplat.config.schema import NonNegative, Positive, Real, Section, described

#: Rows of a matrix of x, y and φ.
Matrix = tuple[tuple[float, float, float], ...]

#: Smallest eigenvalue of a matrix of stiffness, scaled to a diagonal of ones, with which a machine still stands.
MIN_HOLD = 1e-9
#: Coordinates of the platform, what moves with one more than another is called, and the fraction of the kinetic energy
#: of a mode from which on a coordinate is named.
AXES = ("x", "y", "phi")
_MOVES = {"x": "x", "y": "y", "phi": "rotation"}
NAMED_FRACTION = 0.01


#: Ways to give the stiffness of a spring along y.
STIFFNESSES = ("stiffness_y_n_per_m", "sag_m", "natural_frequency_hz")


class Spring(Section):
    """A spring with its damper, or several that are alike at one place."""

    position_m: Annotated[list[Real], Field(min_length=2, max_length=2)] = described(
        ...,
        "p_s",
        "place [x, y] at which the spring holds the platform, measured from the platform's own centre of mass",
        "0.2 … 3 each",
    )
    stiffness_y_n_per_m: Positive | None = described(
        None, "c_s,y", "stiffness along y of each spring of this name", "natural frequency 2 … 4 Hz"
    )
    sag_m: Positive | None = described(
        None,
        "",
        "sag of the spring under its part of the weight of machine and material, instead of stiffness_y_n_per_m; all "
        "springs, those that are off too, carry equal parts",
        "0.01 … 0.05",
    )
    natural_frequency_hz: Positive | None = described(
        None,
        "",
        "natural frequency along y of the spring under its part of the mass of machine and material, instead of "
        "stiffness_y_n_per_m",
        "2 … 4",
    )
    stiffness_x_n_per_m: NonNegative | None = described(
        None, "c_s,x", "stiffness along x of each spring; this or stiffness_ratio must be given"
    )
    stiffness_ratio: NonNegative | None = described(
        None, "c_s,x / c_s,y", "stiffness along x divided by that along y, instead of stiffness_x_n_per_m", "0.4 … 1"
    )
    damping_x_n_s_per_m: NonNegative = described(
        0.0, "b_s,x", "damping along x of each spring", "damping ratio 0.02 … 0.1"
    )
    damping_y_n_s_per_m: NonNegative = described(
        0.0, "b_s,y", "damping along y of each spring", "damping ratio 0.02 … 0.1"
    )
    count: Annotated[int, Field(ge=1, le=1000)] = described(
        1, "", "number of springs at this place, all alike", "1 … 4"
    )
    off: bool = Field(False, description="true: the springs are broken or taken out, and hold nothing")

    alternatives: ClassVar[tuple[tuple[str, str], ...]] = (
        *((STIFFNESSES[i], STIFFNESSES[j]) for i, j in ((0, 1), (0, 2), (1, 2))),
        ("stiffness_x_n_per_m", "stiffness_ratio"),
    )

    @model_validator(mode="after")
    def _has_stiffnesses(self) -> Self:
        for ways in (STIFFNESSES, ("stiffness_x_n_per_m", "stiffness_ratio")):
            if not self._given().intersection(ways):
                raise ValueError(f"no {ways[0]} is given; allowed: {' or '.join(ways)}")
        return self


class PlacedSpring(NamedTuple):
    """Springs at a place.

    Attributes
    ----------
    place
        From the common centre of mass (m).
    stiffness, damping
        Of each along x and y (N/m, N·s/m); 0 of what is off.
    number
        How many there are.
    """

    place: tuple[float, float]
    stiffness: tuple[float, float]
    damping: tuple[float, float]
    number: int


class Suspension(NamedTuple):
    """Stiffness and damping of x, y and φ about the common centre of mass: symmetric matrices in SI units."""

    stiffness: Matrix
    damping: Matrix

    @property
    def stiffness_y(self) -> float:
        """Weight on the centre of mass divided by its sag (N/m): c_y, less what turning takes of it."""
        k = self.stiffness
        turning = k[2][2] - (k[0][2] ** 2 / k[0][0] if k[0][0] else 0.0)
        return k[1][1] - (k[1][2] ** 2 / turning if turning else 0.0)

    @property
    def holds(self) -> bool:
        """Whether a machine stands on it: all that has a spring of its own has one in all directions, and y has."""
        k = np.array(self.stiffness)
        sizes = np.diag(k)
        held = sizes > 0.0
        if not held[1]:
            return False
        scaled = (k / np.sqrt(np.outer(sizes, sizes), where=np.outer(held, held), out=np.ones((3, 3))))[held][:, held]
        return bool(np.linalg.eigvalsh(scaled)[0] > MIN_HOLD)


def placed_springs(scene: Any) -> dict[str, PlacedSpring]:
    """Return the springs of a scene by their names.

    Where the machine gives their sums, they are those of ``output.springs``, with equal parts of the stiffness along y.
    """
    x_c, y_c = scene.body.centre
    if scene.springs is None:
        if not scene.output.springs:
            return {}
        share = scene.machine.stiffness_y_n_per_m / (sum(scene.output.springs.values()) or 1)
        places = scene.named_points
        return {
            name: PlacedSpring(places[name], (0.0, share), (0.0, 0.0), n) for name, n in scene.output.springs.items()
        }
    loaded = scene.body.mass + scene.material_mass
    part = loaded / sum(spring.count for spring in scene.springs.values())
    placed = {}
    for name, spring in scene.springs.items():
        along_y = spring.stiffness_y_n_per_m
        if spring.sag_m is not None:
            along_y = part * scene.gravity[1] / spring.sag_m
        elif spring.natural_frequency_hz is not None:
            along_y = part * (TURN * spring.natural_frequency_hz) ** 2
        along_x = along_y * spring.stiffness_ratio if spring.stiffness_x_n_per_m is None else spring.stiffness_x_n_per_m
        damping = spring.damping_x_n_s_per_m, spring.damping_y_n_s_per_m
        (x, y), holds = spring.position_m, 0.0 if spring.off else 1.0
        parts = (holds * along_x, holds * along_y), (holds * damping[0], holds * damping[1])
        placed[name] = PlacedSpring((x - x_c, y - y_c), *parts, spring.count)
    return placed


def suspension(scene: Any) -> Suspension:
    """Put the springs of a scene together."""
    machine = scene.machine
    if scene.springs is None:
        stiffness = machine.stiffness_x_n_per_m, machine.stiffness_y_n_per_m, machine.stiffness_phi_n_m_per_rad
        damping = machine.damping_x_n_s_per_m, machine.damping_y_n_s_per_m, machine.damping_phi_n_m_s_per_rad
        return Suspension(_matrix(*stiffness, 0.0, 0.0), _matrix(*damping, 0.0, 0.0))
    springs = placed_springs(scene).values()
    return Suspension(*(_sum((s.place, s[i], s.number) for s in springs) for i in (1, 2)))


def _sum(parts: Any) -> Matrix:
    """Sum up what acts at places along x and y: the platform moves there by x − φY and y + φX."""
    x = y = phi = x_phi = y_phi = 0.0
    for (at_x, at_y), (along_x, along_y), count in parts:
        x += count * along_x
        y += count * along_y
        phi += count * (along_x * at_y * at_y + along_y * at_x * at_x)
        x_phi -= count * along_x * at_y
        y_phi += count * along_y * at_x
    return _matrix(x, y, phi, x_phi, y_phi)


def _matrix(x: float, y: float, phi: float, x_phi: float, y_phi: float) -> Matrix:
    return ((x, 0.0, x_phi), (0.0, y, y_phi), (x_phi, y_phi, phi))


class NaturalModes(NamedTuple):
    """Natural modes of x, y and φ on springs, without material: each near the coordinate that moves most in it.

    Attributes
    ----------
    shapes
        Displacements of x, y, φ in each mode, its column, in which its own coordinate is 1, shape (3, 3).
    fractions
        Fractions of the kinetic energy of each mode, its column, in x, y and φ.
    inertia, damping, stiffness
        Of each mode, shape (3,). Damping between different modes is left out.
    """

    shapes: NDArray[np.float64]
    fractions: NDArray[np.float64]
    inertia: NDArray[np.float64]
    damping: NDArray[np.float64]
    stiffness: NDArray[np.float64]

    @property
    def names(self) -> list[str]:
        """What moves in each mode: a coordinate, or as "x with rotation" one with others."""
        names = []
        for own, parts in zip(AXES, self.fractions.T.tolist(), strict=True):
            others = [
                _MOVES[one] for one, part in zip(AXES, parts, strict=True) if one != own and part > NAMED_FRACTION
            ]
            names.append(f"{_MOVES[own]} with {' and '.join(others)}" if others else own)
        return names

    @property
    def speeds(self) -> NDArray[np.float64]:
        """Natural angular frequencies (rad/s)."""
        return np.asarray(np.sqrt(self.stiffness / self.inertia))

    def of(self, coordinate: int) -> NDArray[np.intp]:
        """Return the places of the modes in which a coordinate moves."""
        return np.flatnonzero(self.fractions[coordinate] > NAMED_FRACTION)


def natural_modes(scene: Any) -> NaturalModes:
    """Find the natural modes of a scene: det(K − ω²M) = 0. Springs at the centre of mass leave coordinates apart."""
    return _modes((scene.platform_mass, scene.platform_mass, scene.body.inertia), scene.suspension, scene.damping_y)


@lru_cache(maxsize=64)
def _modes(masses: tuple[float, ...], springs: Suspension, damping_y: float) -> NaturalModes:
    """Find the natural modes of masses on springs; along y material may damp, too."""
    stiffness, damping = (np.array(matrix) for matrix in springs)
    damping[1, 1] = damping_y
    roots = np.sqrt(masses)
    _, vectors = np.linalg.eigh(stiffness / np.outer(roots, roots))
    order = max(permutations(range(3)), key=lambda order: float(np.prod(vectors[range(3), order] ** 2)))
    vectors = vectors[:, order]
    shapes = vectors / roots[:, np.newaxis]
    shapes /= np.diag(shapes)
    matrices = np.diag(masses), damping, stiffness
    return NaturalModes(shapes, vectors**2, *(np.einsum("ij,ik,kj->j", shapes, one, shapes) for one in matrices))
