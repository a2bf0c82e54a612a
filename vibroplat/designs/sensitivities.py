"""Sensitivities: the derivatives of an orbit's measures by keys of its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from typing import Any

import numpy as np
import pandas as pd

from vibroplat.columns import TEXT, Column, Columns, is_angle
from vibroplat.config.keys import number_of
from vibroplat.config.plausibility import HINT
from vibroplat.config.scene import Scene
from vibroplat.config.schema import ANY, did_you_mean, in_lists, nodes
from vibroplat.continuation.first_orbit import OrbitError
from vibroplat.continuation.newton import NoConvergenceError
from vibroplat.continuation.orbit import Orbit, with_orbit_tolerance
from vibroplat.continuation.orbit_neighbourhood import OrbitNeighbourhood
from vibroplat.designs.motions import MotionNeighbourhood, settling_plan
from vibroplat.errors import ConfigError, errors_about
from vibroplat.kernels.compiled import FloatArray
from vibroplat.model import sensitivity
from vibroplat.model.parameters import Parameters, parameters
from vibroplat.model.sensitivity import CHOICES, flat, value_of, with_value
from vibroplat.report.data_sheet import columns
from vibroplat.study.branches import study_table
from vibroplat.study.point import MEASURED, measure_point
from vibroplat.study.store import Record

#: Measures that are printed of each orbit, if its scene has them.
PRINTED = (
    *("conveying_speed_m_per_s", "rms_x_m", "rms_y_m", "excitation_frequency_hz", "motor_power_w"),
    *("contact_force_max_n", "stability_margin"),
)
#: Residual of orbits whose measures are differentiated.
ORBIT_TOLERANCE = 1e-9
#: A measure over the largest of its kind that is round-off, as RMS x if the machine vibrates along y.
ROUND_OFF_RATIO = 1e-7
#: Change of a key, over its value, that tells whether the equations have it.
_KEY_CHANGE = 1e-6
#: The number of a section in which machines do not differ.
GRAVITY = "machine.gravity_m_per_s2"
#: Sections whose numbers enter the equations; those of ``transport`` have no derivatives along an orbit.
SECTIONS = (*sensitivity.SECTIONS, "transport")
#: Errors of a derivative up to which it may be 0.
MIN_SLOPE_ERRORS = 2.0

#: Result at values of keys: an orbit, or a settled motion if the scene has none.
Neighbourhood = OrbitNeighbourhood | MotionNeighbourhood

SENSITIVITIES: Columns = {
    "measure": Column(
        "name of the measure: a column of a sweep, or stability_margin",
        "stability_margin: 1 minus the magnitude of the largest Floquet multiplier",
        kind=TEXT,
    ),
    "key": Column("dotted key of the scene", kind=TEXT),
    "value": Column("value of the measure", "unit of the measure"),
    "derivative": Column(
        "derivative of the measure by the key, along the orbit", "unit of the measure / unit of the key"
    ),
    "elasticity": Column(
        "relative change of the measure divided by the relative change of the key",
        "derivative × key / measure; empty if the measure is 0 or an angle, whose zero is arbitrary, or the derivative "
        "not above two of its errors",
    ),
    "derivative_error": Column(
        "error of the derivative",
        "with transport: difference of derivatives over two changes of the key; empty along an orbit",
    ),
}


def varied_keys(scene: Scene) -> list[str]:
    """List the keys of a scene with numbers other than 0 that its equations depend on."""
    keys, p = [], _numbers(parameters(scene))
    for name, node in nodes(Scene).items():
        if node.is_section or name.partition(".")[0] not in SECTIONS:
            continue
        for key in _places(scene, name):
            value = value_of(scene, key)
            if not isinstance(value, float) or value == 0.0:
                continue
            try:
                changed = _numbers(parameters(with_value(scene, key.split("."), value * (1.0 + _KEY_CHANGE))))
            except ValueError:
                continue
            if (changed != p).any():
                keys.append(key)
    return keys


def _numbers(p: Parameters) -> FloatArray:
    """Return the numbers that enter the equations, those of transport too."""
    return np.append(flat(p), [p[name] for name in CHOICES[2:]])


def tolerances_of_keys(scene: Scene, given: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
    """Replace sections in tolerances by their numbers, and say in notes which of these have none.

    Left out are 0, gravity, other values than numbers, and numbers that may not be as much larger or smaller. A key
    that is given has its own tolerance. A section without numbers is a ConfigError.
    """
    tolerances, notes = dict[str, float](), list[str]()
    for name, size in given.items():
        if name not in SECTIONS:
            continue
        varied = [key for key in varied_keys(scene) if key.startswith(f"{name}.")]
        for key in varied:
            if key == GRAVITY or in_lists(key.split(".")) in given:  # of no machine; both exciters alike
                continue
            try:
                for end in (-size, size):
                    require_allowed(scene, name, key, value_of(scene, key) * (1.0 + end))
            except ConfigError:
                continue
            tolerances[key] = size
        if not tolerances.keys() & varied:
            sections = [one for one in SECTIONS if any(key.startswith(f"{one}.") for key in varied_keys(scene))]
            raise ConfigError(
                f"design.parameter_tolerances.{name} = {size}: the motion depends on no number of this section that "
                f"may vary so; allowed: {', '.join(sections)}, or a key"
            )
        known = tolerances.keys() | given.keys() | {GRAVITY}
        left = [k for k in _given_keys(scene, name) if not {k, in_lists(k.split("."))} & known]
        if left:
            notes.append(f"{HINT}no tolerance: {', '.join(left)} (0, no number, unused, or no such values allowed)")
    return tolerances | {key: size for key, size in given.items() if key not in SECTIONS}, notes


def _given_keys(scene: Scene, section: str) -> list[str]:
    """List the keys of a section that have a value, those in lists at each place."""
    names = [name for name, node in nodes(Scene).items() if name.startswith(f"{section}.") and not node.is_section]
    places = [place for name in names for place in _places(scene, name)]
    return [name for name in places if value_of(scene, name) is not None]


def _places(scene: Scene, name: str) -> list[str]:
    """Return a key, or where it is in a list or has names by users, the keys of a scene that it stands for."""
    if f".{ANY}." in name:
        return [name.replace(ANY, own, 1) for own in scene.springs or ()]
    return [name.replace(".N.", f".{i}.") for i in range(1 + (".N." in name))]


def require_keys(scene: Scene, keys: Sequence[str], where: str) -> None:
    """Refuse keys that cannot be varied (ConfigError)."""
    if scene.drive.program is not None:
        raise ConfigError("drive.program is given, but designs have a constant supply; allowed: supply_frequency_hz")
    allowed = varied_keys(scene)
    for key in keys:
        own = {key.replace(".N.", f".{index}.") for index in (0, 1)}
        first, *others = (value_of(scene, one) for one in own)
        if any(other != first for other in others):
            raise ConfigError(f"{where}.{key} has two values; allowed: equal ones, or a place instead of N")
        if number_of(key) is None:
            require_allowed(scene, where, key, 1.0)
        if number_of(key) is float and first == 0.0:
            raise ConfigError(f"{where}.{key} is 0 in this scene; allowed: another value")
        if not own <= {*allowed}:
            alike = [one for one in allowed if in_lists(one.split(".")) == in_lists(key.split("."))]
            raise ConfigError(f"{where}.{key} cannot be varied; allowed: {', '.join(alike or allowed)}")


def require_allowed(scene: Scene, what: str, key: str, value: float) -> None:
    """Refuse a value that a key of a scene cannot have (ConfigError)."""
    with errors_about(what):
        scene.replace({key: value})


def measured_names(scene: Scene) -> list[str]:
    """List the measures of a scene's orbits."""
    return [*(["stability_margin"] if scene.transport is None else []), *MEASURED, *columns(scene)]


def require_measures(scene: Scene, names: Sequence[str], where: str) -> None:
    """Refuse names that are no measures of a scene's orbits (ConfigError)."""
    allowed = measured_names(scene)
    for name in names:
        if name == "stability_margin" and name not in allowed:
            raise ConfigError(f"{where}: {name} needs an orbit; allowed: another measure, or no section transport")
        if name not in allowed:
            hint = did_you_mean(name, allowed)
            raise ConfigError(f"{where}: {name} is not a measure of this scene; {hint}allowed: {', '.join(allowed)}")


def settle_on_orbit(scene: Scene) -> Record:
    """Find the motion that a scene's motion converges to, and refuse one that is no orbit; any goes with transport.

    Returns
    -------
    record
        ``state``, ``motion``, ``period`` and ``sync``.

    Raises
    ------
    OrbitError
        It does not repeat, or ends early.
    """
    point = measure_point(scene, settling_plan(scene), None, (0,))
    row = point.row
    if point.state is None or not (row["period"] or scene.transport):
        what = row["motion"] if row["outcome"] == "ok" else f"{row['outcome']}: {row['detail']}"
        raise OrbitError(
            f"{scene.name} does not converge to a periodic orbit ({what}); allowed: a scene whose motion is periodic"
        )
    return {"state": point.state, "motion": row["motion"], "period": row["period"], "sync": row["sync"]}


def local_orbit(scene: Scene, keys: Sequence[str], known: Record) -> Neighbourhood:
    """Find the orbit to which a scene's motion has converged, with its neighbourhood; with transport, the motion."""
    if scene.transport is not None:
        try:
            return MotionNeighbourhood(with_orbit_tolerance(scene, ORBIT_TOLERANCE), keys, known)
        except NoConvergenceError as error:
            raise OrbitError(f"{scene.name} does not stay as it settled: {error}") from None
    return OrbitNeighbourhood.near(scene, keys, known["state"], period=known["period"], tolerance=ORBIT_TOLERANCE)


def orbit_sensitivities(scene: Scene, keys: Sequence[str], names: Sequence[str], known: Record) -> Record:
    """Differentiate measures of a scene's orbit by keys: ``rows`` of the table, and its ``measures``."""
    with closing(local_orbit(scene, keys, known)) as local:
        return {"rows": rows(local, names), "measures": local.measures | {"stable": local.margin > 0.0}}


def measure_at(scene: Scene, values: Mapping[str, float]) -> Record:
    """Measure the orbit of a scene at other values of some keys, to which it is followed: a ``row``."""
    with closing(local_orbit(scene, list(values), settle_on_orbit(scene))) as local:
        return {"row": local.correct(list(values.values())).measures}


def rows(local: Neighbourhood, names: Sequence[str]) -> list[dict[str, Any]]:
    """Make the rows of the table of sensitivities of an orbit."""
    names = [name for name in names if local.measures.get(name) is not None]
    try:
        slopes, errors = local.gradients(names)
    except NoConvergenceError as error:
        raise OrbitError(f"the measures cannot be differentiated: {error}") from None
    table_rows = []
    for name, by_key, off in zip(names, slopes.tolist(), errors.tolist(), strict=True):
        nominal = local.measures[name]
        kind = [
            abs(v) for n, v in local.measures.items() if isinstance(v, float) and n.split("_")[0] == name.split("_")[0]
        ]
        significant = nominal and not is_angle(name) and abs(nominal) > ROUND_OFF_RATIO * max(kind)
        for key, value, slope, wrong in zip(local.keys, map(float, local.values), by_key, off, strict=True):
            sure = significant and not abs(slope) <= MIN_SLOPE_ERRORS * wrong  # nan of an orbit
            numbers = (slope, slope * value / nominal if sure else np.nan, wrong)
            words = (name, key, nominal, *(None if np.isnan(number) else number for number in numbers))
            table_rows.append(dict(zip(SENSITIVITIES, words, strict=True)))
    return table_rows


def sensitivities(
    orbit: Orbit, keys: Sequence[str] | None = None, measures: Sequence[str] | None = None
) -> pd.DataFrame:
    """Differentiate measures of an orbit by keys; see :meth:`vibroplat.Orbit.sensitivities`."""
    keys = varied_keys(orbit.scene) if keys is None else [keys] if isinstance(keys, str) else keys
    measures = [measures] if isinstance(measures, str) else measures
    require_keys(orbit.scene, keys, "keys")
    require_measures(orbit.scene, measures or (), "measures")
    with closing(OrbitNeighbourhood.near(orbit.scene, keys, orbit, tolerance=ORBIT_TOLERANCE)) as local:
        return table(rows(local, PRINTED if measures is None else measures))


def table(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Make the table of sensitivities."""
    return study_table(rows, list(SENSITIVITIES), SENSITIVITIES)
