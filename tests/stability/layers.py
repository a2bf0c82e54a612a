"""Layers from soft to rigid, from undamped to overdamped, from a tiny to many times the platform's mass."""

import math
from itertools import product

import numpy as np
from common.known import GRAVITY, OMEGA, TURN

from stability.checks import row, sound, spread_over, steady, with_engine
from vibroplat.bench.measure import base
from vibroplat.hybrid.state import state_scales
from vibroplat.motion.run import simulate

FREQUENCIES = (1.0, 3.0, 10.0, 18.5, 25.0, 60.0, 200.0, 1e3, 5e3, 20e3)
DAMPINGS = (0.0, 1e-3, 0.05, 0.5, 1.0, 5.0)
SHARES = (1e-6, 1e-3, 0.25, 1.0, 1e3)  # m_w2 / m_w1
MASS_RATIOS = (1e-6, 1e-3, 0.1, 1.0, 10.0)
TOLERANCE = 1e-8
#: Largest errors, over the tolerance: of coordinates over their scales, and of F_c over its amplitude; and how much
#: larger they are for lightly damped layers near resonance, whose motion grows throughout the run.
ERROR, NEAR = 1000.0, 10.0
#: Amplitude of the exciters' force over the amplitude at lift-off.
MODEST = 0.3
#: Stiff (Hz), lightly damped layers, whose F_c may have an error of this share of its amplitude: they turn admissible
#: errors of their motion into force.
STIFF, RAGGED = 500.0, 2e-3
#: Places at which a motion is compared.
SAMPLES = 1000
#: Relative difference of an RMS from that of a single layer, for layers stiff enough to act as one.
RIGID = 3e-3


def layers(count, engine):
    """Compare attached motion with the linear two-mass response, and stiff layers in flight with one layer.

    The exciters' rotors are heavy enough to keep their speed, and each run starts exactly on the linear response, so
    that an undamped layer does not ring.
    """
    cases = list(product(FREQUENCIES, DAMPINGS, SHARES, MASS_RATIOS))
    rows = [_linear(*case, engine) for case in spread_over(cases, count)]
    return rows + [_rigid(f, engine) for f in (500.0, 2e3, 20e3)[: count // 8]]


def _linear(natural, damping, share, mass_ratio, engine):
    """Follow an attached motion for ten turns from its linear response."""
    scene = with_engine(base(TOLERANCE, 10.0 * TURN / OMEGA), engine).replace(
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
    # keep the minimum of F_c well above 0; response and scales are proportional to the unbalance
    weight, force = response(scene)["contact_force_n"]
    radius = scene.machine.unbalance_radius_m * MODEST * weight / abs(force)
    scene = scene.replace({"machine.unbalance_radius_m": radius})
    exact = response(scene)
    state = {"phi1_rad": 0.0, "phi2_rad": math.pi, "phi1_rate_rad_per_s": OMEGA, "phi2_rate_rad_per_s": -OMEGA}
    for name in ("y", "upper"):
        mean, amplitude = exact[f"{name}_m"]
        state |= {f"{name}_m": mean + amplitude.imag, f"{name}_rate_m_per_s": OMEGA * amplitude.real}
    scene = scene.replace({"run.initial": {"state": state}, "output.sample_rate_hz": SAMPLES / scene.run.duration_s})
    run = simulate(scene, keep="table")  # a layer of 20 kHz takes more steps than dense output is kept of
    limits = sound(scene, run.summary)
    if run.outcome == "ok":
        motion, scales = run.trajectory, state_scales(scene)
        times = motion["t_s"].to_numpy()
        near = damping < 0.1 and 0.5 < TURN * natural / OMEGA < 2.0
        allowed = ERROR * TOLERANCE * (NEAR if near else 1.0)
        least = {"y_m": scales[1], "upper_m": scales[6], "contact_force_n": scene.force_scale}
        for column, (mean, amplitude) in exact.items():
            if column == "contact_force_n" and natural > STIFF and damping < 0.5:
                allowed = RAGGED
            error = np.abs(motion[column] - mean - (amplitude * np.exp(1j * OMEGA * times)).imag).max()
            limits[f"error_{column}"] = (float(error / max(least[column], abs(amplitude))), allowed)
        limits["events"] = (run.summary["events"], 0.0)
    name = f"{natural:g} Hz, damping {damping:g}, m_w2/m_w1 {share:g}, mu {mass_ratio:g}"
    return row(name, run.outcome, limits, allowed={"ok", "solver-failure"})


def response(scene):
    """Linear response to the exciters in antiphase: by column, the mean and the amplitude A of Im(A exp iωt)."""
    machine, (m1, m2) = scene.machine, scene.layer_masses
    stiffness, damping = scene.layer_spring
    coupling = m2 * (stiffness + 1j * OMEGA * damping)
    support = machine.stiffness_y_n_per_m + 1j * OMEGA * scene.damping_y
    matrix = [[support - OMEGA**2 * (scene.body.mass + m1), -coupling], [-(OMEGA**2) * m2, coupling - OMEGA**2 * m2]]
    y, upper = np.linalg.solve(np.array(matrix), [sum(scene.unbalances) * OMEGA**2, 0.0])
    return {
        "y_m": (-(scene.body.mass + m1 + m2) * GRAVITY / machine.stiffness_y_n_per_m, y),
        "upper_m": (-GRAVITY / stiffness, upper),
        "contact_force_n": ((m1 + m2) * GRAVITY, -(OMEGA**2) * m1 * y - coupling * upper),
    }


def _rigid(natural, engine):
    """Let stiff, well damped layers fly and land, and compare with a single layer of their mass."""
    two = with_engine(base(1e-6, 1.0), engine).replace(
        {"drive.supply_frequency_hz": 51.5, "material": {"natural_frequency_hz": natural, "damping_ratio": 5.0}}
    )
    one = two.replace(material={"mass_ratio": two.material.mass_ratio, "layers": 1})
    found, expected = (steady(scene, 4.0, 2.0) for scene in (two, one))
    limits = sound(two, found)
    if found["outcome"] == "ok":
        for key in ("rms_y_m", "flight_fraction", "gap_max_m"):
            limits[f"{key}_off"] = (abs(found[key] / expected[key] - 1.0), RIGID)
    return row(f"as one layer, {natural:g} Hz", found["outcome"], limits)
