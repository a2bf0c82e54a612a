"""The peers by name: how each runs a scene, with which settings, and whether it can be had here."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np

from vibroplat.bench.peers import siconos
from vibroplat.bench.peers.following import Followed, at_tolerance, follow, sampled
from vibroplat.config.scene import Scene
from vibroplat.integrate import make_engine
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model.parameters import parameters
from vibroplat.model.systems import FULL_SIZE
from vibroplat.motion.motion import Motion
from vibroplat.motion.run import SETTLE_SHARE, simulate

#: Runs a scene; states at the times given, or none in timed runs.
Runner = Callable[[FloatArray | None], Followed]


@dataclass(frozen=True)
class Peer:
    """One of those compared.

    Attributes
    ----------
    settings
        Tolerances, or steps (s), from coarse to fine.
    quick
        Those of the short summary.
    prepare
        Makes all that does not belong to a run, for a scene and a setting.
    module
        What must be installed for it, besides the package.
    """

    name: str
    settings: tuple[float, ...]
    quick: tuple[float, ...]
    prepare: Callable[[Scene, float], Runner]
    module: str = ""

    @property
    def missing(self) -> str:
        """Why the peer cannot be had here; empty if it can."""
        if self.module == "siconos":
            return siconos.available()
        if self.module and importlib.util.find_spec(self.module) is None:
            return f"{self.module} is not installed; it comes with vibroplat[bench]"
        return ""


#: An event of a run that keeps none.
_UNTOLD = (np.nan, "", np.nan)


def _vibroplat(scene: Scene, tolerance: float, engine: str = "native") -> Runner:
    """Our own; as for the others, a run does not include making the integrators, but does include its statistics."""
    scene = scene.replace({"solver": {"tolerance": tolerance, "engine": engine}})
    p, duration = parameters(scene), scene.run.duration_s

    def timed() -> Followed:
        with closing(make_engine(scene, p)) as made:
            motion = Motion(scene, p, made)
            began = time.perf_counter()
            motion.advance(duration, settle=SETTLE_SHARE * duration)
            wall = time.perf_counter() - began
        return Followed(np.empty((0, FULL_SIZE)), [], wall, wall, [_UNTOLD] * motion.events)

    def run(times: FloatArray | None) -> Followed:
        if times is None:
            return timed()
        found = simulate(scene)
        if found.summary["outcome"] != "ok":
            raise RuntimeError(found.summary["detail"])
        return sampled(found, times)

    return run


def _integrated(scene: Scene, tolerance: float, module: str, name: str) -> Runner:
    """Let an integrator of this directory follow a scene."""
    made = importlib.import_module(f"vibroplat.bench.peers.{module}")
    scene = at_tolerance(scene, tolerance)
    return partial(follow, scene, getattr(made, name)(scene, tolerance))


def _siconos(scene: Scene, accuracy: float, kind: str) -> Runner:
    return partial(siconos.run, scene, kind, accuracy)


def _peer(
    name: str, module: str, maker: str, settings: tuple[float, ...], quick: tuple[float, ...], library: str = ""
) -> Peer:
    return Peer(name, settings, quick, partial(_integrated, module=module, name=maker), library)


def _powers(first: int, last: int) -> tuple[float, ...]:
    """Tolerances 10⁻ᶠ … 10⁻ˡ."""
    return tuple(10.0**-n for n in range(first, last + 1))


PEERS = (
    Peer("vibroplat", _powers(4, 12), _powers(6, 10), _vibroplat),
    Peer("vibroplat, Taylor", _powers(3, 13), _powers(3, 8), partial(_vibroplat, engine="taylor")),
    _peer("scikit-sundae, Python callbacks", "callbacks", "Callbacks", _powers(4, 9), _powers(7, 9)),
    _peer("scipy DOP853", "ivp", "DOP853", _powers(4, 10), _powers(6, 9)),
    _peer("scipy LSODA", "ivp", "LSODA", _powers(5, 11), _powers(6, 9)),
    _peer("scipy Radau", "ivp", "RADAU", _powers(4, 8), _powers(5, 8)),
    _peer("heyoka", "taylor", "Taylor", _powers(3, 12), _powers(4, 8), "heyoka"),
    _peer("PathSim", "blocks", "PathSim", _powers(3, 9), _powers(5, 8), "pathsim"),
    Peer("Siconos, event-driven", (1e-6, 1e-8, 1e-10), (), partial(_siconos, kind="event-driven"), "siconos"),
    Peer("Siconos, Moreau–Jean", (1e-3, 3e-4, 1e-4), (), partial(_siconos, kind="time-stepping"), "siconos"),
)
