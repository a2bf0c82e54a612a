"""The systems of equations: which unknowns each has, and how a scene picks them.

A *system* is a mode together with the number of layers. States cross between systems as the *full
state* of 14 numbers — the seven coordinates of :data:`vibroplat.config.coordinates.COORDINATES`, then their rates —
in which what a scene does not have is 0. With transport two numbers follow: where the material is along the deck, s,
and its rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from vibroplat.config.coordinates import Mode
from vibroplat.config.scene import Scene
from vibroplat.kernels.compiled import FloatArray, compiled

FULL_SIZE = 14
GAP, GAP_RATE = 5, 12  # places in the full state
#: Places behind it of where material is along the deck and its rate, in scenes with transport, and numbers of all.
ALONG, ALONG_RATE, MOVING_SIZE = 14, 15, 16
#: Most unknowns of a system.
UNKNOWNS = 16


@dataclass(frozen=True)
class System:
    """One system of equations.

    Attributes
    ----------
    index
        The number by which compiled code knows the system.
    places
        Places of the differential unknowns in the full state, shape (2n,).
    """

    index: int
    mode: Mode
    layers: int
    places: npt.NDArray[np.int64]

    @property
    def differential(self) -> int:
        """Number of differential unknowns, 2n."""
        return len(self.places)

    @property
    def algebraic(self) -> bool:
        """Whether F_c is an unknown (behind the differential ones), and with transport F_t (then the last)."""
        return self.mode not in (Mode.BARE, Mode.FLIGHT)

    @cached_property
    def slides(self) -> bool:
        """Whether the material moves along the deck."""
        return ALONG in self.places.tolist()

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.differential + self.algebraic * (1 + self.slides)

    @property
    def full_size(self) -> int:
        """How many numbers a full state has."""
        return MOVING_SIZE if self.slides else FULL_SIZE

    def unknowns(self, state: FloatArray) -> FloatArray:
        """Pick this system's unknowns from a full state; F_c is left at 0."""
        y = np.zeros(self.size)
        y[: self.differential] = state[self.places]
        return y

    def full(self, y: FloatArray) -> FloatArray:
        """Return the full states of unknowns of shape (…, size), as shape (…, 14), with transport (…, 16)."""
        state = np.zeros((*y.shape[:-1], self.full_size))
        state[..., self.places] = y[..., : self.differential]
        return state


def _places(mode: Mode, layers: int, *, slides: bool) -> npt.NDArray[np.int64]:
    """Places in the full state of the coordinates that a mode has, then of their rates."""
    coordinates = [0, 1, 2, 3, 4, *[GAP] * (mode is Mode.FLIGHT), *[GAP + 1] * (layers == 2)]
    rates = [FULL_SIZE // 2 + c for c in coordinates]
    along = [[ALONG], [ALONG_RATE]] if slides else [[], []]
    return np.array([*coordinates, *along[0], *rates, *along[1]], dtype=np.int64)


#: Modes, and whether the material moves along the deck in them.
_MODES = (
    *((Mode.BARE, False), (Mode.ATTACHED, False), (Mode.FLIGHT, False)),
    *((Mode.STICK, True), (Mode.SLIP_PLUS, True), (Mode.SLIP_MINUS, True), (Mode.FLIGHT, True)),
)
#: Those with material have a system for one layer and one for two.
SYSTEMS: tuple[System, ...] = tuple(
    System(index, mode, layers, _places(mode, layers, slides=slides))
    for index, (mode, slides, layers) in enumerate(
        (mode, slides, layers) for mode, slides in _MODES for layers in ((0,) if mode is Mode.BARE else (1, 2))
    )
)


def systems(scene: Scene) -> dict[Mode, System]:
    """Return the systems of a scene by mode; a scene without contact has the bare one alone."""
    slides, layers, modes = scene.transport is not None, scene.layers, scene.modes
    return {s.mode: s for s in SYSTEMS if s.layers == layers and s.mode in modes and s.slides == slides}


#: The same facts by number, for compiled code: places in the full state, then −1.
LAYERS = np.array([s.layers for s in SYSTEMS])
ALGEBRAIC = np.array([s.algebraic for s in SYSTEMS])
SIZES = np.array([s.size for s in SYSTEMS])
DIFFERENTIAL = np.array([s.differential for s in SYSTEMS])
PLACES = np.array([[*s.places, *[-1] * (UNKNOWNS - s.differential)] for s in SYSTEMS])
#: Whether the material moves along the deck, and whether it sticks to it; its sense in slip, otherwise 0; place of y_w2
#: among the unknowns, if any.
SLIDES = np.array([s.slides for s in SYSTEMS])
STICKS = np.array([s.mode is Mode.STICK for s in SYSTEMS])
SENSE = np.array([{Mode.SLIP_PLUS: 1.0, Mode.SLIP_MINUS: -1.0}.get(s.mode, 0.0) for s in SYSTEMS])
UPPER = np.array([s.differential // 2 - 1 - s.slides for s in SYSTEMS])
#: Columns of coordinates in a Taylor series: their places in the full state, with the eighth left to F_c.
SERIES_COLUMNS = np.where(PLACES == ALONG, 8, PLACES)


@compiled
def gather(system: int, state: FloatArray, y: FloatArray) -> None:
    """Fill the differential unknowns of a system from a full state."""
    for i in range(DIFFERENTIAL[system]):
        y[i] = state[PLACES[system, i]]


@compiled
def scatter(system: int, y: FloatArray, state: FloatArray) -> None:
    """Fill a full state from a system's unknowns; what the system does not have is 0."""
    for i in range(state.size):
        state[i] = 0.0
    for i in range(DIFFERENTIAL[system]):
        state[PLACES[system, i]] = y[i]
