"""A formula of results/README.md with which the paper's numbers contradict its figures, beside a simulation."""

import math

import pytest
from study.helpers import swept

from vibroplat.paper.scenes import machine_numbers, paper_scene

PRINTED = paper_scene("fig2", machine_numbers("printed"))


def acceleration(scene, mass_ratio, frequency):
    """Amplitude of the platform's vertical acceleration (m/s²) at a frequency (Hz), with a stiff layer on it."""
    machine, omega = scene.machine, 2.0 * math.pi * frequency
    stiffness = machine.stiffness_y_n_per_m - (1.0 + mass_ratio) * scene.body.mass * omega**2
    return sum(scene.unbalances) * omega**4 / abs(stiffness + 1j * omega * machine.damping_y_n_s_per_m)


def test_stiff_layer_leaves_the_platform_where_the_formula_says(tmp_path):
    """A layer of 1 kHz is nearly stiff: attached just below, in flight just above."""
    frequency, radius = 24.674, 0.0263
    lighter = PRINTED.replace({"machine.unbalance_radius_m": radius})
    assert acceleration(lighter, 0.1, frequency) == pytest.approx(9.81, rel=1e-3)
    machine = tmp_path / "stiff.yaml"
    machine.write_text(
        f"machine: {{unbalance_radius_m: {radius}, damping_y_n_s_per_m: 40.0}}\n"
        "material: {mass_ratio: 0.1, natural_frequency_hz: 1000.0, damping_ratio: 0.5}\n"
    )
    rows = [swept(machine, 2.0 * (frequency + off), perturbation=0.0).iloc[0] for off in (-0.1, 0.1)]
    assert rows[0]["excitation_frequency_hz"] < frequency < rows[1]["excitation_frequency_hz"]
    assert rows[0]["flight_fraction"] == 0.0 < rows[1]["flight_fraction"]
