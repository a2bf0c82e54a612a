"""Small results written by hand: of a sweep and of orbits."""

import json

import numpy as np
import pandas as pd

from common.places import QUICKSTART
from vibroplat import load_config
from vibroplat.results.files import SCHEMA, write_result
from vibroplat.results.tables import read_json, write_table


def origin(name, **changes):
    return {"schema": SCHEMA, "configuration": load_config(QUICKSTART, {"name": name, **changes}).to_tree()}


def sweep_table():
    """Two mass ratios, up and down, with a jump at 46 Hz and a failed point."""
    rows = []
    for branch, (ratio, direction) in enumerate((r, d) for r in (0.0, 0.2) for d in ("up", "down")):
        for supply in np.arange(42.0, 50.0):
            high = supply < 46.0
            rows.append(
                {
                    "supply_frequency_hz": supply,
                    "material.mass_ratio": ratio,
                    "direction": direction,
                    "branch": branch,
                    "relative_rotation": "counter-rotating",
                    "excitation_frequency_hz": 0.49 * supply,
                    "rms_x_m": 1e-6,
                    "rms_y_m": (4e-3 if high else 1e-3) + 1e-5 * supply,
                    "phase_difference_rad": -3.1 if high else 0.1,
                    "sync": "antiphase" if high else "in-phase",
                    "motion": "chaotic" if supply == 44.0 else "periodic",
                    "period": 1,
                    "gap_max_m": 1e-3 * ratio,
                    "outcome": "too-many-events" if supply == 49.0 and ratio else "ok",
                }
            )
    return pd.DataFrame(rows)


def branch(count=21, **columns):
    """A smooth branch in antiphase, with some of its columns changed."""
    supply = 42.0 + 0.5 * np.arange(count)
    table = pd.DataFrame(
        {
            "supply_frequency_hz": supply,
            "material.mass_ratio": 0.2,
            "direction": "up",
            "branch": 0,
            "excitation_frequency_hz": 0.5 * supply,
            "rms_x_m": 1e-9,
            "rms_y_m": 1e-3 / (60.0 - supply),
            "rms_phi_rad": 0.0,
            "phase_difference_rad": np.pi,
            "sync": "antiphase",
            "flight_fraction": 0.0,
            "contact_force_max_n": 60.0,
            "outcome": "ok",
        }
    )
    return table.assign(**columns)


def after(place, before, then, count=21):
    """A column that changes at a place."""
    return np.where(np.arange(count) < place, before, then)


def branches():
    """A branch with a fold: stable, unstable beyond it, stable again."""
    along = np.linspace(0.0, 1.0, 31)
    supply = 50.0 + 6.0 * along - 18.0 * along * (along - 0.4) * (along - 0.8)
    stable = (along < 0.35) | (along > 0.7)
    return pd.DataFrame(
        {
            "supply_frequency_hz": supply,
            "branch": 0,
            "parent": -1,
            "point": np.arange(along.size),
            "excitation_frequency_hz": 0.5 * supply,
            "period": 1,
            "period_s": 2.0 / supply,
            "rms_x_m": 1e-6,
            "rms_y_m": 1e-3 * (1.0 + along),
            "phase_difference_rad": np.pi - along,
            "motor_power_w": 10.0,
            "sequence": "liftoff impact",
            "stable": stable,
            "n_unstable": np.where(stable, 0, 1),
            "multiplier_1_re": np.where(stable, 0.4, 1.3),
            "multiplier_1_im": 0.0,
            "multiplier_2_re": 0.1,
            "multiplier_2_im": 0.2,
        }
    )


def special(table):
    """The fold, and the end of the branch."""
    rows = table.iloc[[11, 30]]
    return pd.DataFrame(
        {
            "branch": 0,
            "kind": ["fold", "grazing"],
            "supply_frequency_hz": rows["supply_frequency_hz"].to_numpy(),
            "excitation_frequency_hz": rows["excitation_frequency_hz"].to_numpy(),
            "period": 1,
            "point": rows["point"].to_numpy(),
            "y_m": [0.0, 1e-4],
        }
    )


def boundaries():
    """A boundary of each of two kinds."""
    ratio = np.linspace(0.0, 0.3, 7)
    columns = {"branch": 0, "supply_frequency_hz": 50.0 + 10.0 * ratio, "material.mass_ratio": ratio}
    more = {"excitation_frequency_hz": 25.0, "period": 1, "n_unstable": 0}
    kinds = enumerate(("fold", "liftoff"))
    parts = [pd.DataFrame({"curve": curve, "kind": kind, **columns, **more}) for curve, kind in kinds]
    return pd.concat(parts, ignore_index=True)


def write_sweep(directory):
    directory.mkdir(parents=True)
    write_result(directory, "sweep", origin("swept"), {"sweep": sweep_table()}, form="parquet")
    return directory


def write_orbits(directory):
    directory.mkdir(parents=True)
    table = branches()
    tables = {"branches": table, "special": special(table), "boundaries": boundaries()}
    second = {"key": "material.mass_ratio", "start": 0.0, "stop": 0.3}
    plan = {"key": "drive.supply_frequency_hz", "start": 50.0, "stop": 56.0, "boundaries": second}
    write_result(directory, "orbits", origin("followed", orbits=plan), tables, form="parquet")
    return directory


def rename(directory, name, note):
    """Give a run without digests another name and another note, as another program could have written them."""
    summary = read_json(directory, "summary") | {"name": name, "notes": [note]}
    (directory / "summary.json").write_text(json.dumps(summary))
    write_table(pd.read_parquet(directory / "events.parquet").assign(kind=note), directory, "events", "parquet")
    return directory
