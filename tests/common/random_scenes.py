"""Random scenes over wide ranges of all parameters and initial states."""

import numpy as np

from vibroplat.config.coordinates import COORDINATES, RATES
from vibroplat.config.reader import nest
from vibroplat.config.scene import Scene
from vibroplat.hybrid.state import state_scales

#: Duration of each scene in turns at the larger synchronous speed, unless told.
TURNS = 20.0
#: Events within a turn that end a scene: enough for an accumulation, few enough if nothing accumulates.
STORM = 500


def random_scene(number, seed=0, *, as_bought=False, turns=TURNS):
    """Draw a scene; number and seed determine it, but for its duration.

    ``as_bought``: some have exciters of their own, programs, starts from rest.
    """
    draw = Draw(np.random.default_rng((seed, number)))
    machine, others = draw.machine(), draw.material() | draw.contact() | draw.solver()
    motors = draw.motors()
    if as_bought and draw.chance(0.4):
        motors = draw.exciters(machine)
    scene = Scene.from_tree(nest(machine | others) | {"name": f"random-{number}"} | motors)
    duration = turns * 2.0 * np.pi / scene.speed_scale
    scene = scene.replace({"run": {"duration_s": duration, "initial": draw.initial(scene)}})
    if as_bought and draw.chance(0.2):
        scene = scene.replace({"run.initial": {"speed_ratio": 0.0}})
    return scene.replace({"drive": {"program": draw.program(scene)}}) if as_bought and draw.chance(0.25) else scene


class Draw:
    """Random values of a scene's keys.

    Sizes are log-uniform about those of the paper's rig, and what may be 0 is 0 in one scene of eight.
    """

    def __init__(self, rng):
        self._rng = rng

    def size(self, middle, decades, *, zero=False):
        """Draw a number within some decades of a central value, or 0."""
        drawn = middle * 10.0 ** self._rng.uniform(-decades, decades)
        return 0.0 if zero and self._rng.random() < 0.125 else float(drawn)

    def one_of(self, *choices):
        return choices[self._rng.integers(len(choices))]

    def chance(self, share):
        return self._rng.random() < share

    def machine(self):
        mass = self.size(12.42, 2.0)
        stiffness = 470e3 * mass / 12.42
        damping = 400.0 * mass / 12.42
        radius = self.size(0.09, 1.0)
        return {
            "machine.platform_mass_kg": mass,
            "machine.platform_inertia_kg_m2": mass * self.size(0.11 / 12.42, 1.0),
            "machine.unbalance_mass_kg": mass * self.size(0.0036, 1.0),
            "machine.unbalance_radius_m": radius,
            "machine.rotor_inertia_kg_m2": mass * radius**2 * self.size(0.008, 2.0),
            "machine.exciter_distance_m": self.size(0.128, 1.0, zero=True),
            "machine.exciter_angle_deg": self._rng.uniform(-180.0, 180.0),
            "machine.stiffness_x_n_per_m": stiffness * self.size(1.0, 1.5, zero=True),
            "machine.stiffness_y_n_per_m": stiffness * self.size(1.0, 1.5),
            "machine.stiffness_phi_n_m_per_rad": stiffness * self.size(0.004, 1.5, zero=True),
            "machine.damping_x_n_s_per_m": damping * self.size(1.0, 2.0, zero=True),
            "machine.damping_y_n_s_per_m": damping * self.size(1.0, 2.0, zero=True),
            "machine.damping_phi_n_m_s_per_rad": damping * self.size(0.002, 2.0, zero=True),
            "machine.gravity_m_per_s2": self.size(9.81, 2.0, zero=True),
            "drive.supply_frequency_hz": self.size(50.0, 0.7),
        }

    def motors(self):
        """Draw one motor for both exciters, or two."""

        def motor():
            return {
                "critical_torque_n_m": self.size(1.2, 1.5, zero=True),
                "critical_slip": self.size(0.15, 0.8),
                "pole_pairs": int(self._rng.integers(1, 5)),
                "friction_radius_m": self.size(5e-5, 2.0, zero=True),
            }

        return {"motors": [motor(), motor()]} if self._rng.random() < 0.25 else {"motor": motor()}

    def exciters(self, machine):
        """Draw two exciters as one buys them, about those that a machine has, which then has none of its own."""
        radius, inertia = (machine.pop(f"machine.{key}") for key in ("unbalance_radius_m", "rotor_inertia_kg_m2"))
        mass, distance = machine["machine.unbalance_mass_kg"], machine["machine.exciter_distance_m"]
        frequency, poles = machine["drive.supply_frequency_hz"], int(self._rng.integers(1, 4))

        def exciter():
            slip, ratio = self._rng.uniform(0.01, 0.1), self._rng.uniform(1.5, 4.0)
            speed = frequency / poles * (1.0 - slip)
            plate = {
                "rated_power_w": 2.0 * np.pi * speed * self.size(0.5, 1.5),
                "rated_speed_rpm": 60.0 * speed,
                "breakdown_ratio": ratio,
                "rated_frequency_hz": frequency,
            }
            position = {"position_m": [distance * float(k) for k in self._rng.standard_normal(2)]}
            size = {"unbalance_radius_m": radius} if self.chance(0.5) else {"static_moment_kg_m": mass * radius}
            rotation = {"rotation": self.one_of("clockwise", "counter-clockwise")}
            return {
                "rotor_inertia_kg_m2": self.size(inertia, 0.2),
                "unbalance_mass_kg": self.size(mass, 0.2),
                "pole_pairs": poles,
                "friction_radius_m": self.size(5e-5, 2.0, zero=True),
                **size,
                **(plate if self.chance(0.5) else {"critical_torque_n_m": self.size(1.2, 1.5), "critical_slip": slip}),
                **(position if self.chance(0.7) else {}),
                **(rotation if self.chance(0.3) else {}),
            }

        return {"exciters": [exciter(), exciter()]}

    def program(self, scene):
        """Draw a supply that changes, jumps and goes off and on."""
        length, frequency = scene.run.duration_s, scene.drive.supply_frequency_hz
        times = sorted(float(share) * length for share in self._rng.random(3))
        changed = [max(frequency * self._rng.uniform(0.0, 1.3), 1e-3) for _ in range(2)]
        ramp = [{"t_s": t, "supply_frequency_hz": f} for t, f in zip(times[:2], changed, strict=True)]
        switch = {"t_s": times[2], self.one_of("exciter_1", "exciter_2"): "off"}
        return [{"t_s": 0.0, "supply_frequency_hz": frequency}, *ramp, switch]

    def material(self):
        return {
            "material.mass_ratio": self.size(10.0**-2.5, 3.5, zero=True),
            "material.layers": self.one_of(1, 2, 2),
            "material.lower_share": self._rng.uniform(1e-3, 1.0 - 1e-3),
            "material.natural_frequency_hz": self.size(140.0, 2.15),
            "material.damping_ratio": self.size(0.02, 2.4, zero=True),
        }

    def contact(self):
        restitution = self.one_of(0.0, 1.0, self._rng.random(), self._rng.random(), 1.0 - self.size(1e-3, 2.0))
        return {
            "contact.model": self.one_of(*["impact"] * 7, "non-impact"),
            "contact.restitution": restitution,
            "contact.impact_law": self.one_of("conservative", "conservative", "central", "printed"),
            "contact.viscous_per_mass_per_s": self.size(24.0, 1.0, zero=True),
        }

    def solver(self):
        tolerance = self.size(1e-6, 3.0)
        self._rng.integers(4)  # not used: without it all numbered scenes would be others
        return {"solver.tolerance": tolerance, "solver.max_events_per_period": STORM}

    def initial(self, scene):
        """Draw the initial state: rotating exciters on a platform at rest, or any state within the scene's scales."""
        turn = self._rng.uniform(-np.pi, np.pi, 2)
        if self._rng.random() < 0.4:
            return {
                "phase_difference_rad": float(turn[0]),
                "phi1_rad": float(turn[1]),
                "speed_ratio": self._rng.uniform(-0.5, 1.5),
            }
        decades = self._rng.uniform(-2.0, 1.5)
        state = np.array(self._rng.standard_normal(14)) * state_scales(scene) * 10.0**decades
        state[3:5], state[5], state[10:12] = turn, abs(state[5]), state[10:12] / 10.0**decades
        if self._rng.random() < 0.5:
            state[5], state[12] = 0.0, abs(state[12])
        names = (*COORDINATES, *RATES)
        here = [i for index in scene.coordinates for i in (index, index + 7)]
        return {"state": {names[i]: float(state[i]) for i in here}}
