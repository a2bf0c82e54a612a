"""Scenes with closed-form solutions, and motions of scenes."""

import math
from contextlib import closing, contextmanager

from vibroplat.config.computation import Solver
from vibroplat.config.drive import Drive
from vibroplat.config.scene import Scene
from vibroplat.config.sections import Contact, Initial, Machine, Material, Motor, Run, State
from vibroplat.integrate import make_engine
from vibroplat.model.parameters import parameters
from vibroplat.motion.motion import Simulator

GRAVITY = 9.81
TURN = 2.0 * math.pi
OMEGA = TURN * 25.0
IDLE = Motor(critical_torque_n_m=0.0, friction_radius_m=0.0, pole_pairs=1)


@contextmanager
def motion_of(scene, *start):
    """A motion of a scene, from ``run.initial`` or another state; its engine is closed at the end."""
    p = parameters(scene)
    with closing(make_engine(scene, p)) as engine:
        yield Simulator(scene, p, engine, *start)


def ball_on_table(gamma, restitution=0.0, periods=40, tolerance=1e-10, phase=0.0, gap_rate=0.0, omega=OMEGA):
    """One thin layer of 1e-12 of the mass on a table s = A sin(ωt + phase), A ω²/g = gamma.

    The table is a platform of 1e6 kg on a soft spring without dampers, in its steady antiphase motion;
    rotors of huge inertia keep the exciters' speed constant.
    """
    mass, unbalance_mass = 1e6, 1e3
    stiffness = mass * (0.1 * omega) ** 2
    amplitude = gamma * GRAVITY / omega**2
    unbalance = amplitude * (mass * omega**2 - stiffness) / (2.0 * omega**2)
    angle = phase + math.pi  # above resonance the platform moves opposite to the unbalances
    state = State(
        y_m=-mass * GRAVITY / stiffness + amplitude * math.sin(phase),
        y_rate_m_per_s=amplitude * omega * math.cos(phase),
        phi1_rad=angle,
        phi2_rad=math.pi - angle,
        phi1_rate_rad_per_s=omega,
        phi2_rate_rad_per_s=-omega,
        gap_rate_m_per_s=gap_rate,
    )
    return Scene(
        name="ball-on-table",
        machine=Machine(
            platform_mass_kg=mass - 2.0 * unbalance_mass,
            platform_inertia_kg_m2=1e6,
            unbalance_mass_kg=unbalance_mass,
            unbalance_radius_m=unbalance / unbalance_mass,
            rotor_inertia_kg_m2=1e12,
            stiffness_y_n_per_m=stiffness,
            damping_x_n_s_per_m=0.0,
            damping_y_n_s_per_m=0.0,
            damping_phi_n_m_s_per_rad=0.0,
        ),
        motor=IDLE,
        material=Material(mass_ratio=1e-12, layers=1),
        contact=Contact(restitution=restitution),
        drive=Drive(supply_frequency_hz=omega / TURN),
        run=Run(duration_s=periods * TURN / omega, initial=Initial(state=state)),
        solver=Solver(tolerance=tolerance),
    )


def dropped_ball(restitution, height=1.0, tolerance=1e-10):
    """One layer dropped from rest on a motionless platform of 1e6 kg with hanging exciters."""
    machine = Machine(
        platform_mass_kg=1e6,
        platform_inertia_kg_m2=1e6,
        rotor_inertia_kg_m2=1.0,
        stiffness_y_n_per_m=1e12,
        damping_y_n_s_per_m=0.0,
    )
    state = State(
        y_m=-Scene(machine=machine).body.mass * GRAVITY / machine.stiffness_y_n_per_m,
        phi1_rad=-0.5 * math.pi,
        phi2_rad=-0.5 * math.pi,
        gap_m=height,
    )
    return Scene(
        name="dropped-ball",
        machine=machine,
        motor=IDLE,
        material=Material(mass_ratio=1e-12, layers=1),
        contact=Contact(restitution=restitution),
        run=Run(duration_s=1.1 * accumulation_time(restitution, height), initial=Initial(state=state)),
        solver=Solver(tolerance=tolerance),
    )


def accumulation_time(restitution, height=1.0):
    """t∞ = √(2h/g) (1 + R)/(1 − R)."""
    return math.sqrt(2.0 * height / GRAVITY) * (1.0 + restitution) / (1.0 - restitution)
