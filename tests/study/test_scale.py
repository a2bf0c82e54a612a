"""Ten thousand points in one table, in memory that does not grow with their number."""

from __future__ import annotations

import gc
import tracemalloc

import numpy as np
import pyarrow.parquet as pq
import pytest
from common.places import LOADED

from vibroplat.results.tables import read_table
from vibroplat.study.branches import branches
from vibroplat.study.point import MEASURED, Point
from vibroplat.study.pool import Inline
from vibroplat.study.store import Store
from vibroplat.study.sweep import run_sweeps, write_sweep

from .helpers import planned

SECTION_POINTS = 64


def measured_at_once(scene, plan, state, key):
    """In the place of ``measure_point``: numbers that follow from the point's alone."""
    numbers = np.random.default_rng(key).random(len(MEASURED) + 14 + 2 * SECTION_POINTS).tolist()
    row = dict(zip(MEASURED, numbers, strict=False))
    row |= {"sync": "antiphase", "period": 1, "motion": "periodic", "settle_s": 1.0, "outcome": "ok", "detail": ""}
    row |= {"steps": 1, "residual_calls": 2, "events": 3, "simulated_s": numbers[0], "wall_s": 1e-3}
    heights, speeds = numbers[-2 * SECTION_POINTS : -SECTION_POINTS], numbers[-SECTION_POINTS:]
    return Point(row, numbers[len(MEASURED) : len(MEASURED) + 14], heights, speeds)


def sweep_of(points, directory, **plan):
    """Sweep so many quick points in ten branches and write the tables."""
    grid = {"material.mass_ratio": [0.1, 0.2, 0.3, 0.4, 0.5]}
    last = 0.9 + 0.1 * (points // 10)
    scene = planned(LOADED, 1.0, last, step=0.1, direction=["up", "down"], grid=grid, **plan)
    directory.mkdir()
    with Store(directory, {}) as store:
        run_sweeps([(branches(scene), store)], Inline())
        write_sweep(scene, branches(scene), store, directory, "parquet")


def largest_memory(*arguments, **plan):
    """Python's largest memory while it sweeps."""
    gc.collect()
    tracemalloc.start()
    try:
        sweep_of(*arguments, **plan)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["response", "bifurcation"])
def test_memory_does_not_grow_with_the_number_of_points(kind, tmp_path, monkeypatch):
    monkeypatch.setattr("vibroplat.study.point.measure_point", measured_at_once)
    sweep_of(100, tmp_path / "warm", kind=kind)
    few = largest_memory(2_000, tmp_path / "few", kind=kind)
    many = largest_memory(10_000, tmp_path / "many", kind=kind)
    assert many < 1.25 * few
    assert len(read_table(tmp_path / "many", "sweep")) == 10_000


def test_table_of_many_points_is_in_row_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("vibroplat.study.point.measure_point", measured_at_once)
    monkeypatch.setattr("vibroplat.study.sweep.CHUNK", 90)
    sweep_of(300, tmp_path / "points", kind="bifurcation")
    table = read_table(tmp_path / "points", "sweep")
    groups = pq.ParquetFile(tmp_path / "points/sweep.parquet").metadata
    assert groups.num_rows == len(table) == 300
    assert [groups.row_group(k).num_rows for k in range(groups.num_row_groups)] == [90, 90, 90, 30]
    assert table["branch"].tolist() == [branch for branch in range(10) for _ in range(30)]
    up = table[table["branch"] == 2]
    assert up["supply_frequency_hz"].tolist() == [round(1.0 + 0.1 * k, 1) for k in range(30)]
    assert up["rms_y_m"].tolist() == [
        np.random.default_rng((0, 1_000_000 + 100_000 * k)).random(len(MEASURED))[3] for k in range(30)
    ]
    section = read_table(tmp_path / "points", "section")
    assert len(section) == 300 * SECTION_POINTS
