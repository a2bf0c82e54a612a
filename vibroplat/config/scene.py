"""The scene: everything that is simulated, in SI units, immutable and validated when it is built.

Field names are the keys of a YAML configuration and end with their unit. The models below are the only
place that defines a key, its type, its default and its range. Derived quantities (masses, inertias,
scales) are properties; their docstrings give the symbols of the equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import islice
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, model_validator

from vibroplat.config.arguments import instance_of
from vibroplat.config.body import RigidBody, rigid_body
from vibroplat.config.computation import Output, Solver
from vibroplat.config.consistency import given_elsewhere, require_consistent
from vibroplat.config.coordinates import MAX_NAMED_POINTS, TURN, Mode
from vibroplat.config.drive import Drive, SupplyInterval
from vibroplat.config.fit_plan import FitPlan
from vibroplat.config.plans import OrbitsPlan, SweepPlan
from vibroplat.config.reader import merge, nest
from vibroplat.config.schema import NAME, PERTURBATION, PLAIN_NAME, POINT_NAME, Section, described, explain
from vibroplat.config.sections import (
    OF_EXCITERS,
    ROTATIONS,
    Contact,
    Exciter,
    Machine,
    Material,
    Motor,
    Run,
    Transport,
)
from vibroplat.config.study_plans import PLANS, BasinsPlan, DesignPlan, FindPlan
from vibroplat.config.suspension import PlacedSpring, Spring, Suspension, natural_modes, placed_springs, suspension
from vibroplat.errors import ConfigError
from vibroplat.extensions import load_provided

#: Sections from which the numbers of exciters and rigid body come, the names of both, and of what else is kept.
EXCITERS_FROM = frozenset(("machine", "motor", "motors", "exciters"))
_FOUND = frozenset(("exciter_pair", "body"))
_SCALES = (
    "suspension",
    "unbalances",
    "synchronous_speeds",
    "speed_scale",
    "length_scale",
    "force_scale",
    "state_scales",
)
#: Sections on which none of this depends.
_APART = frozenset(("run", "solver"))


def _plain(value: Any) -> Any:
    """Turn a section, or a list of some or some by names, into the keys and values that it was given."""
    if isinstance(value, dict):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value.model_dump(exclude_unset=True, by_alias=True) if isinstance(value, BaseModel) else value


class Scene(Section):
    """The full physical setup of one run.

    Examples
    --------
    >>> scene = Scene(material=Material(mass_ratio=0.1, natural_frequency_hz=18.5, damping_ratio=0.05))
    >>> scene.modes
    (<Mode.ATTACHED: 0>, <Mode.FLIGHT: 1>)
    >>> scene.replace({"material.mass_ratio": 0.0}).modes
    (<Mode.BARE: 2>,)
    """

    name: Annotated[str, Field(min_length=1, max_length=100, pattern=NAME)] = Field(
        "scene",
        json_schema_extra={"pattern": PLAIN_NAME},
        description="name of the results' directory; not given: that of the file",
    )
    machine: Machine = Field(Machine(), description="platform, springs and exciters")
    motor: Motor | None = described(None, "", "both motors")
    motors: Annotated[list[Motor], Field(min_length=2, max_length=2)] | None = Field(
        None, description="a list of both motors if they differ, instead of motor"
    )
    exciters: Annotated[list[Exciter], Field(min_length=2, max_length=2)] | None = Field(
        None,
        description="a list of both exciters if they differ, instead of motor and of the machine's radius and rotor "
        "inertia",
    )
    springs: Annotated[dict[Annotated[str, Field(pattern=POINT_NAME)], Spring], Field(min_length=1)] | None = Field(
        None,
        description="springs of the platform by their names, where they sit, instead of the machine's stiffnesses and "
        "dampings, whose springs act at the common centre of mass; forces are reported for as many of them as fit "
        f"beside output.points, {MAX_NAMED_POINTS} together",
    )
    material: Material = Field(Material(), description="the material on the platform")
    contact: Contact = Field(Contact(), description="contact between material and platform")
    transport: Transport | None = described(
        None, "", "motion of the material along the deck; not given: it moves along y only"
    )
    drive: Drive = Field(Drive(), description="the supply of the motors")
    run: Run = Field(Run(), description="duration and start of a run")
    solver: Solver = Field(Solver(), description="accuracy and integrator")
    output: Output = Field(Output(), description="tables")

    sweep: SweepPlan | None = described(None, "", "what vibroplat sweep does")
    orbits: OrbitsPlan | None = described(None, "", "what vibroplat orbits does")
    find: FindPlan | None = described(None, "", "what vibroplat find does")
    basins: BasinsPlan | None = described(None, "", "what vibroplat basins does")
    design: DesignPlan | None = described(None, "", "what vibroplat design does")
    fit: FitPlan | None = described(None, "", "what vibroplat fit does")

    alternatives = (("motor", "motors"), ("motor", "exciters"), ("motors", "exciters"))

    @model_validator(mode="before")
    @classmethod
    def _default_motor(cls, given: Any) -> Any:
        if isinstance(given, dict) and all(given.get(name) is None for name in ("motor", "motors", "exciters")):
            return given | {"motor": Motor()}
        return given

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        self.__dict__.update(info.context or {})
        require_consistent(self)
        return self

    @cached_property
    def set_keys(self) -> tuple[str, ...]:
        """Keys that were set over those of a file, by ``--set`` or ``overrides``; one without effect is told."""
        return ()

    # -- structure of the scene -------------------------------------------------------------------------

    @property
    def has_contact(self) -> bool:
        """Whether material can press on the platform and lift off."""
        return self.material.is_there and self.contact.model == "impact"

    @property
    def layers(self) -> int:
        """Number of moving layers: 0 (bare, non-impact), 1 or 2."""
        return self.material.layers if self.has_contact else 0

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes of this scene."""
        if self.transport is not None:
            return (Mode.STICK, Mode.SLIP_PLUS, Mode.SLIP_MINUS, Mode.FLIGHT)
        return (Mode.ATTACHED, Mode.FLIGHT) if self.has_contact else (Mode.BARE,)

    @property
    def gravity(self) -> tuple[float, float]:
        """Gravity along the deck, towards +x, and normal to it (m/s²)."""
        g, angle = self.machine.gravity_m_per_s2, 0.0 if self.transport is None else self.transport.angle
        return (g * math.sin(angle), g * math.cos(angle)) if angle else (0.0, g)

    @property
    def hanging_angle(self) -> float:
        """Angle of an unbalance that hangs straight down (rad), to the x axis, which declines with the deck."""
        return -0.5 * math.pi + (0.0 if self.transport is None else self.transport.angle)

    @property
    def coordinates(self) -> tuple[int, ...]:
        """Indices into :data:`vibroplat.config.coordinates.COORDINATES` of the coordinates of this scene."""
        return (0, 1, 2, 3, 4, 5, 6)[: 5 + self.layers]

    # -- derived quantities -------------------------------------------------------------------------

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy the scene, with some sections changed; what follows from these is found anew."""
        copied = super().model_copy(update=update, deep=deep)
        changed = EXCITERS_FROM.intersection(update or ())
        stale = {*(() if _APART.issuperset(update or ()) else _SCALES), *(_FOUND if changed else ())}
        if changed == {"machine"} and all(
            getattr(copied.machine, name) == getattr(self.machine, name) for name in (*OF_EXCITERS, "unbalance_mass_kg")
        ):
            stale.discard("exciter_pair")  # the platform's numbers are none of theirs
        for name in stale:
            copied.__dict__.pop(name, None)
        return copied

    @cached_property
    def exciter_pair(self) -> tuple[Exciter, Exciter]:
        """Exciters 1 and 2, however the scene gives their numbers."""
        common = {} if self.exciters is not None else {name: getattr(self.machine, name) for name in OF_EXCITERS}
        given = self.exciters or self.motors or [self.motor or Motor()] * 2
        first, second = (
            Exciter.model_construct(**{"rotation": rotation, **numbers.model_dump(exclude_none=True), **common})
            for numbers, rotation in zip(given, ROTATIONS, strict=True)
        )
        common_mass = self.machine.unbalance_mass_kg
        return first.resolved(common_mass), second.resolved(common_mass)

    @cached_property
    def body(self) -> RigidBody:
        """Platform and unbalances as one rigid body."""
        return rigid_body(self.machine, self.exciter_pair)

    @property
    def named_points(self) -> dict[str, tuple[float, float]]:
        """The points of ``output.points`` from the common centre of mass (m), by their names."""
        x_c, y_c = self.body.centre
        return {name: (x - x_c, y - y_c) for name, (x, y) in self.output.points.items()}

    @cached_property
    def suspension(self) -> Suspension:
        """What all springs and dampers between platform and foundation make together."""
        return suspension(self)

    @cached_property
    def measured_points(self) -> dict[str, tuple[float, float]]:
        """The named points, then the places of springs, from the common centre of mass (m): as many as are measured."""
        springs = {} if self.springs is None else placed_springs(self)
        points = self.named_points | {f"springs.{name}": spring.place for name, spring in springs.items()}
        return dict(islice(points.items(), MAX_NAMED_POINTS))

    @cached_property
    def measured_springs(self) -> dict[str, tuple[int, PlacedSpring]]:
        """The springs whose forces are reported, by their names, and the numbers of their points."""
        numbers, prefix = {name: i for i, name in enumerate(self.measured_points)}, "springs." * bool(self.springs)
        springs = {f"{prefix}{name}": spring for name, spring in placed_springs(self).items()}
        return {name.removeprefix(prefix): (numbers[name], of) for name, of in springs.items() if name in numbers}

    @property
    def co_rotating(self) -> bool:
        """Whether both exciters are driven in the same sense of rotation."""
        first, second = self.exciter_pair
        return first.direction == second.direction

    @property
    def rotation(self) -> str:
        """Relative rotation of the exciters: ``counter-rotating`` or ``co-rotating``."""
        return "co-rotating" if self.co_rotating else "counter-rotating"

    @property
    def has_mirrored_exciters(self) -> bool:
        """Whether the exciters have equal static moments and are mirror images of each other, as near as 1e-6."""
        (x_1, y_1), (x_2, y_2) = self.body.axes
        first, second = self.unbalances
        apart = math.hypot(x_1 + x_2, y_1 - y_2)
        return apart <= 1e-6 * self.body.distance and abs(first - second) <= 1e-6 * first

    @property
    def phase_weights(self) -> tuple[float, float]:
        """Weights of φ₁ and φ₂ in the phase difference: φ₁ + φ₂ if counter-rotating, φ₁ − φ₂ if co-rotating."""
        return 1.0, -1.0 if self.co_rotating else 1.0

    @cached_property
    def unbalances(self) -> tuple[float, float]:
        """The static moments k_i = m_i r_i of both exciters (kg·m)."""
        first, second = (
            mass * exciter.unbalance_radius_m for mass, exciter in zip(self.body.masses, self.exciter_pair, strict=True)
        )
        return first, second

    @property
    def exciter_inertias(self) -> tuple[float, float]:
        """J_e,i = J_d,i + m_i r_i² (kg·m²)."""
        first, second = (
            exciter.rotor_inertia_kg_m2 + mass * exciter.unbalance_radius_m**2
            for mass, exciter in zip(self.body.masses, self.exciter_pair, strict=True)
        )
        return first, second

    @cached_property
    def synchronous_speeds(self) -> tuple[float, float]:
        """ω_0 = 2π f_e / P of both motors (rad/s), at the largest supply frequency of a program."""
        return self.synchronous_speeds_at(self.drive.largest_frequency)

    def synchronous_speeds_at(self, frequency: float) -> tuple[float, float]:
        """ω_0 of both motors (rad/s) at a supply frequency (Hz)."""
        first, second = (TURN * frequency / exciter.pole_pairs for exciter in self.exciter_pair)
        return first, second

    def driven(self, begin: float, end: float) -> tuple[bool, bool]:
        """Whether each motor drives its exciter at some time between two (s): it is on, has a torque and a supply."""
        return self._switched_on([supply for supply in self._supplies(begin, end) if supply.frequency or supply.ramp])

    def braked(self, begin: float, end: float) -> bool:
        """Whether motors only brake between two times (s): they are on, and their supply has 0 Hz."""
        return any(self._switched_on(self._supplies(begin, end))) and not any(self.driven(begin, end))

    def _supplies(self, begin: float, end: float) -> list[SupplyInterval]:
        """Return the supplies between two times (s)."""
        intervals = self.drive.intervals
        return [one for one in intervals if one.end > begin and (one.start < end or one.start <= begin)]

    def _switched_on(self, supplies: Sequence[SupplyInterval]) -> tuple[bool, bool]:
        """Whether each motor has a torque and is on in one of the supplies."""
        first, second = (
            exciter.critical_torque_n_m > 0.0 and any(supply.driven[i] for supply in supplies)
            for i, exciter in enumerate(self.exciter_pair)
        )
        return first, second

    @property
    def start_perturbation(self) -> float:
        """Initial perturbation: without it, a symmetric motion would stay symmetric for ever, even if it is unstable.

        By default nothing disturbs a machine whose motors are off.
        """
        run, initial = self.run, self.run.initial
        if run.perturbation is not None:
            return run.perturbation
        given = initial.state is not None or initial.from_ is not None
        return 0.0 if given or not any(self.driven(0.0, run.duration_s)) else PERTURBATION

    @cached_property
    def speed_scale(self) -> float:
        """The larger of both ω_0 (rad/s)."""
        return max(self.synchronous_speeds)

    @cached_property
    def length_scale(self) -> float:
        """(k_1 + k_2)/M, the platform's amplitude far above resonance (m)."""
        return sum(self.unbalances) / self.body.mass

    @cached_property
    def force_scale(self) -> float:
        """Weight of the material plus its inertia force at the scales of length and speed (N)."""
        inertia = self.length_scale * self.speed_scale**2
        return sum(self.layer_masses) * (self.machine.gravity_m_per_s2 + inertia)

    @cached_property
    def state_scales(self) -> tuple[float, ...]:
        """Scales of the full state; see :func:`vibroplat.hybrid.state.state_scales`."""
        speed, length = self.speed_scale, self.length_scale
        flight = max(length, self.machine.gravity_m_per_s2 / speed**2)
        arm = max(self.body.distance, *(exciter.unbalance_radius_m for exciter in self.exciter_pair))
        rotation = sum(self.unbalances) * arm / self.body.inertia
        coordinates = (length, length, rotation, 1.0, 1.0, flight, flight)
        moving = () if self.transport is None else (length, speed * length)
        return (*coordinates, *(speed * scale for scale in coordinates), *moving)

    @property
    def oscillators(self) -> NDArray[np.float64]:
        """Inertias, dampings and stiffnesses of x, y, φ, shape (3, 3), without material that may lift off.

        Springs beside the common centre of mass couple these (:attr:`suspension`): then each is that of one coordinate
        while the others are held.
        """
        damping, stiffness = (np.diag(matrix) for matrix in self.suspension[::-1])
        masses = [self.platform_mass, self.platform_mass, self.body.inertia]
        return np.array([masses, [damping[0], self.damping_y, damping[2]], stiffness])

    @property
    def fastest_decay(self) -> float:
        """Largest decay rate (1/s) of the platform's modes and the exciters' speeds, each taken alone."""
        _, _, masses, damping, stiffness = natural_modes(self)
        half = 0.5 * (damping / masses)
        rates: list[float] = (half + np.sqrt(np.maximum(half * half - stiffness / masses, 0.0))).tolist()
        for exciter, inertia in zip(self.exciter_pair, self.exciter_inertias, strict=True):
            slope = 2.0 * exciter.critical_torque_n_m / exciter.critical_slip_speed(self.drive.largest_frequency)
            rates.append(slope / inertia)
        return max(rates)

    @property
    def material_mass(self) -> float:
        """m_w = μ_w M (kg)."""
        given = self.material.mass_kg
        return self.material.mass_ratio * self.body.mass if given is None else given

    @property
    def mass_ratio(self) -> float:
        """μ_w = m_w / M."""
        given = self.material.mass_kg
        return self.material.mass_ratio if given is None else given / self.body.mass

    @property
    def layer_masses(self) -> tuple[float, float]:
        """(m_w1, m_w2) (kg); (0, 0) without contact."""
        if self.layers == 0:
            return 0.0, 0.0
        lower = self.material_mass * (self.material.lower_share if self.layers == 2 else 1.0)
        return lower, self.material_mass - lower if self.layers == 2 else 0.0

    @property
    def layer_spring(self) -> tuple[float, float]:
        """(c_w / m_w2, b_w / m_w2) in 1/s² and 1/s; (0, 0) with fewer than two layers."""
        if self.layers < 2:
            return 0.0, 0.0
        mass = self.layer_masses[1]
        material = self.material
        if material.natural_frequency_hz is not None:
            stiffness = (TURN * material.natural_frequency_hz) ** 2
        else:
            assert material.stiffness_n_per_m is not None  # ensured by the validator
            stiffness = material.stiffness_n_per_m / mass
        if material.damping_ratio is not None:
            return stiffness, 2.0 * material.damping_ratio * math.sqrt(stiffness)
        return stiffness, (material.damping_n_s_per_m or 0.0) / mass

    @property
    def platform_mass(self) -> float:
        """Mass that moves with the platform (kg): M, plus a fraction of m_w in the non-impact model."""
        if self.contact.model == "non-impact":
            return self.body.mass + self.contact.added_mass_share * self.material_mass
        return self.body.mass

    @property
    def damping_y(self) -> float:
        """b_y, plus β m_w in the non-impact model (N·s/m)."""
        damping = self.suspension.damping[1][1]
        if self.contact.model == "non-impact":
            return damping + self.contact.viscous_per_mass_per_s * self.material_mass
        return damping

    def plan_of(self, kind: str) -> Any:
        """Return the section of a kind of study; raises ConfigError if the scene has none."""
        plan, model = getattr(self, kind), PLANS[kind]
        if plan is None:
            required = [name for name, field in model.model_fields.items() if field.is_required()]
            first = ", ".join(f"{name}: …" for name in required or [name for name, _ in model.alternatives][:1])
            raise ConfigError(f"this configuration has no {kind} section; add {kind}: {{{first}}}")
        return plan

    def require_orbits(self, what: str, instead: str = "run, sweep, find, basins and design") -> None:
        """Refuse what needs periodic orbits or derivatives of a motion where there are none.

        Raises
        ------
        vibroplat.errors.ConfigError
            The scene has transport.
        """
        if self.transport is not None:
            raise ConfigError(
                f"{what} cannot be computed with transport: slip and stick have no derivatives yet; allowed: "
                f"{instead}, which follow motions, or no section transport"
            )

    def replace(self, changes: Mapping[str, Any] | None = None, /, **sections: Any) -> Scene:
        """Return a new scene with some keys changed; it is validated like a configuration.

        Parameters
        ----------
        changes
            Dotted keys and their values, e.g. ``{"drive.supply_frequency_hz": 46.0}``.
        **sections
            Nested values by section, e.g. ``drive={"supply_frequency_hz": 46.0}``. If two keys exclude
            each other (stiffness and natural frequency), the new one replaces the old one. The numbers of exciters
            are changed by their places, as ``{"exciters.1.critical_slip": 0.1}``, with N in both.

        Raises
        ------
        vibroplat.errors.ConfigError
            A key is unknown or a value is not allowed.
        """
        given = {key: _plain(value) for key, value in sections.items()}
        nested = nest(changes or {})
        # other sections stay the objects that they are: it saves time and, with many scenes, memory
        changed, known = {*given, *nested}, self.__dict__
        if not EXCITERS_FROM.isdisjoint(changed):  # these replace one another
            changed, known = changed | EXCITERS_FROM, {}
        if "springs" in changed:
            changed.add("machine")
        present = ((name, getattr(self, name)) for name in self.model_fields_set)
        tree = {name: _plain(section) if name in changed else section for name, section in present}
        kept = {"set_keys": self.set_keys} | {name: known[name] for name in _FOUND & known.keys()}
        return Scene._checked(merge(merge(tree, given), nested), kept)

    def inspect(self) -> dict[str, float | str]:
        """Find what follows from this scene without a run; see :class:`vibroplat.inspection.values.Inspection`."""
        values: dict[str, float | str] = load_provided("inspect")(self)
        return values

    def to_tree(self) -> dict[str, Any]:
        """Return all keys as nested plain values, including defaults; the inverse of :meth:`from_tree`."""
        tree = self.model_dump(mode="json", exclude_none=True, by_alias=True)
        self.leave_out_replaced(tree)
        for name in given_elsewhere(self):
            del tree["machine"][name]
        return tree

    @classmethod
    def from_tree(cls, tree: Mapping[str, Any], set_keys: Iterable[str] = ()) -> Scene:
        """Build a scene from nested plain values, as a configuration file holds them.

        Notes name those of ``set_keys``, dotted keys that were set over the file's, which have no effect.

        Raises
        ------
        vibroplat.errors.ConfigError
            One line with the key, the value and what is allowed.
        """
        return cls._checked(tree, {"set_keys": tuple(set_keys)})

    @classmethod
    def _checked(cls, tree: Mapping[str, Any], known: Mapping[str, Any] | None = None) -> Scene:
        """Build a scene from nested values, with what is known already of its exciters and its body."""
        try:
            return cls.model_validate(tree, context=known)
        except ValidationError as error:
            raise ConfigError(explain(error, cls)) from None


#: A scene that is given to a function.
SceneArgument = instance_of(Scene, "a Scene, as load_config(FILE) returns one")
