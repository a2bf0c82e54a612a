"""Layers from soft to rigid, from undamped to overdamped, from a tiny to many times the platform's mass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from common.known import GRAVITY, OMEGA, TURN

from stability.checks import NAMED, row, sound, spread_over, steady, with_engine
from vibroplat.bench.scenes import base
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales
from vibroplat.kernels.compiled import FloatArray
from vibroplat.motion.run import simulate

FREQUENCIES = (1.0, 3.0, 10.0, 18.5, 25.0, 60.0, 200.0, 1e3, 5e3, 20e3)
DAMPINGS = (0.0, 1e-3, 0.05, 0.5, 1.0, 5.0)
SHARES = (1e-6, 1e-3, 0.25, 1.0, 1e3)  # m_w2 / m_w1
MASS_RATIOS = (1e-6, 1e-3, 0.1, 1.0, 10.0)
TOLERANCE = 1e-8
#: Largest errors, over the tolerance: of coordinates over their scales, and of F_c over its amplitude.
ERROR = 1000.0
#: The same for lightly damped layers near resonance, whose motion grows throughout the run.
NEAR = 10.0
#: Amplitude of the exciters' force over the amplitude at lift-off.
MODEST = 0.3
#: Stiff (Hz), lightly damped layers, whose F_c may have an error of this share of its amplitude: they turn admissible
#: errors of their motion into force.
STIFF, RAGGED = 500.0, 2e-3
#: Relative difference of an RMS from that of a single layer, for layers stiff enough to act as one.
RIGID = 3e-3


def layers(count: int, engine: str) -> list[dict[str, Any]]:
    """Compare attached motion with the linear two-mass response, and stiff layers in flight with one layer.

    The exciters' rotors are heavy enough to keep their speed, and each run starts exactly on the linear response, so
    that an undamped layer does not ring.
    """
    cases = list(product(FREQUENCIES, DAMPINGS, SHARES, MASS_RATIOS))
    rows = [_linear(*case, engine) for case in spread_over(cases, count)]
    rows += [_rigid(f, engine) for f in (500.0, 2e3, 20e3)]
    return rows + [_ringing(zeta, engine) for zeta in (0.0, 1e-3, 0.05)]


def _linear(natural: float, damping: float, share: float, mass_ratio: float, engine: str) -> dict[str, Any]:
    """Follow an attached motion for ten turns from its linear response."""
    scene = with_engine(_smooth(natural, damping, share, mass_ratio), engine)
    response = Response.of(scene)
    # keep the minimum of F_c well above 0; response and scales are proportional to the unbalance
    radius = scene.machine.unbalance_radius_m * MODEST * response.weight / abs(response.force)
    scene = scene.replace({"machine.unbalance_radius_m": radius})
    response = Response.of(scene)
    scene = scene.replace({"run.initial": {"state": response.state()}})
    run = simulate(scene)
    limits = sound(scene, run.summary)
    if run.outcome == "ok":
        times = np.linspace(0.0, scene.run.duration_s, 1001)
        motion = run(times)
        scales = state_scales(scene)
        near = damping < 0.1 and 0.5 < TURN * natural / OMEGA < 2.0
        allowed = ERROR * TOLERANCE * (NEAR if near else 1.0)
        for column, exact, scale in (
            ("y_m", response.y(times), max(scales[1], abs(response.platform))),
            ("upper_m", response.upper(times), max(scales[6], abs(response.layer))),
            ("contact_force_n", response.contact_force(times), max(scene.force_scale, abs(response.force))),
        ):
            if column == "contact_force_n" and natural > STIFF and damping < 0.5:
                allowed = RAGGED
            limits[f"error_{column}"] = (float(np.abs(motion[column] - exact).max() / scale), allowed)
        limits["events"] = (run.summary["events"], 0.0)
    name = f"{natural:g} Hz, damping {damping:g}, m_w2/m_w1 {share:g}, mu {mass_ratio:g}"
    return row(name, run.outcome, limits, allowed={"ok", "solver-failure"})


def _smooth(natural: float, damping: float, share: float, mass_ratio: float) -> Scene:
    """Return the paper's machine without motors, with rotors heavy enough to keep their speed."""
    return base(TOLERANCE, 10.0 * TURN / OMEGA).replace(
        {
            "machine.rotor_inertia_kg_m2": 1e9,
            "motor": {"critical_torque_n_m": 0.0, "friction_radius_m": 0.0, "pole_pairs": 1},
            "drive.supply_frequency_hz": OMEGA / TURN,
            "material": {
                "mass_ratio": mass_ratio,
                "lower_share": 1.0 / (1.0 + share),
                "natural_frequency_hz": natural,
                "damping_ratio": damping,
            },
        }
    )


@dataclass(frozen=True)
class Response:
    """Linear response of platform and layers in contact to the exciters in antiphase, and the static sag.

    Attributes
    ----------
    platform, layer, force
        Complex amplitudes of y, y_w2 (m) and F_c (N) of Im(… exp iωt).
    sag, layer_sag, weight
        Mean values of the three.
    """

    platform: complex
    layer: complex
    force: complex
    sag: float
    layer_sag: float
    weight: float

    @classmethod
    def of(cls, scene: Scene) -> Response:
        """Solve the two-mass system of a scene whose exciters rotate at OMEGA."""
        machine, (m1, m2) = scene.machine, scene.layer_masses
        stiffness, damping = scene.layer_spring
        coupling = m2 * (stiffness + 1j * OMEGA * damping)
        support = machine.stiffness_y_n_per_m + 1j * OMEGA * scene.damping_y
        matrix = [
            [support - OMEGA**2 * (machine.total_mass + m1), -coupling],
            [-(OMEGA**2) * m2, coupling - OMEGA**2 * m2],
        ]
        y, upper = np.linalg.solve(np.array(matrix), [sum(scene.unbalances) * OMEGA**2, 0.0])
        return cls(
            platform=complex(y),
            layer=complex(upper),
            force=complex(-(OMEGA**2) * m1 * y - coupling * upper),
            sag=-(machine.total_mass + m1 + m2) * GRAVITY / machine.stiffness_y_n_per_m,
            layer_sag=-GRAVITY / stiffness,
            weight=(m1 + m2) * GRAVITY,
        )

    def state(self) -> dict[str, float]:
        """Return the state at time 0, for a configuration."""
        return {
            "y_m": self.sag + self.platform.imag,
            "upper_m": self.layer_sag + self.layer.imag,
            "phi1_rad": 0.0,
            "phi2_rad": math.pi,
            "y_rate_m_per_s": OMEGA * self.platform.real,
            "upper_rate_m_per_s": OMEGA * self.layer.real,
            "phi1_rate_rad_per_s": OMEGA,
            "phi2_rate_rad_per_s": -OMEGA,
        }

    def y(self, times: FloatArray) -> FloatArray:
        """Platform (m)."""
        return _turning(self.sag, self.platform, times)

    def upper(self, times: FloatArray) -> FloatArray:
        """Upper layer (m)."""
        return _turning(self.layer_sag, self.layer, times)

    def contact_force(self, times: FloatArray) -> FloatArray:
        """F_c (N)."""
        return _turning(self.weight, self.force, times)


def _turning(mean: float, amplitude: complex, times: FloatArray) -> FloatArray:
    values: FloatArray = mean + (amplitude * np.exp(1j * OMEGA * times)).imag
    return values


def _rigid(natural: float, engine: str) -> dict[str, Any]:
    """Let stiff, well damped layers fly and land, and compare with a single layer of their mass."""
    two = with_engine(base(1e-6, 1.0), engine).replace(
        {"drive.supply_frequency_hz": 51.5, "material": {"natural_frequency_hz": natural, "damping_ratio": 5.0}}
    )
    single = {"mass_ratio": two.material.mass_ratio, "layers": 1}
    one = two.replace(material=single)
    found, expected = (steady(scene, 4.0, 2.0) for scene in (two, one))
    limits = sound(two, found)
    if found["outcome"] == "ok":
        for key in ("rms_y_m", "flight_fraction", "gap_max_m"):
            limits[f"{key}_off"] = (abs(found[key] / expected[key] - 1.0), RIGID)
    return row(f"as one layer, {natural:g} Hz", found["outcome"], limits)


def _ringing(damping: float, engine: str) -> dict[str, Any]:
    """Excite layers of 5 kHz that keep ringing: they are followed, or end with a named outcome."""
    changes = {
        "drive.supply_frequency_hz": 51.5,
        "material": {"natural_frequency_hz": 5e3, "damping_ratio": damping},
        "solver.max_events_per_period": 2000,
    }
    scene = with_engine(base(1e-5, 1.0), engine).replace(changes)
    summary = simulate(scene, keep="summary").summary
    return row(f"ringing at 5 kHz, damping {damping:g}", summary["outcome"], sound(scene, summary), allowed=NAMED)
