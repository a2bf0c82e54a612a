"""A round: random scenes with both engines, a random sweep run in three ways, and figures."""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.image
import numpy as np
import pandas as pd
from common.random_scenes import Draw, drawn, random_scene
from stability.campaign import judged

from bench.processes import Done, Places, missing_dask
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.results.files import Result

ENGINES = ("native", "sundae")
#: Longest settling and measuring time of a point, in turns at the larger synchronous speed.
SETTLE, MEASURE = 40.0, 4.0
#: Most kills of a sweep that is resumed.
MOST_KILLS = 3

#: Between failures in a row; a failure may have semicolons.
SEPARATOR = " | "

#: A row of the table: what was done in a round.
Row = dict[str, Any]


class Size(NamedTuple):
    """How much is done in a round.

    Attributes
    ----------
    scenes
        Random scenes, each run with every engine.
    frequencies
        Points of each branch of the sweep.
    directions
        Directions of the sweep; with two values of the grid there are twice as many branches.
    restitutions
        Values of the grid.
    dask
        Whether the sweep also runs on dask.
    """

    scenes: int = 10
    frequencies: int = 4
    directions: tuple[str, ...] = ("up", "down")
    restitutions: tuple[float, ...] = (0.0, 0.4)
    dask: bool = True


def run_round(number: int, size: Size, directory: Path) -> Row:
    """Do the work of a round in an empty directory; number and size determine it, except for the moments of kills."""
    began, used = time.perf_counter(), processor_time()
    row: Row = {"round": number, "seed": seed(number)}
    scenes, tame = _scenes(number, size)
    with Places(directory) as places:
        swept = _sweep(number, size, places)
        figures = _figures(places, tame)
    parts = (scenes, swept, figures)
    failed = [line for part in parts for line in part.pop("failed")]
    for part in parts:
        row |= part
    row |= {"processor_s": processor_time() - used, "wall_s": time.perf_counter() - began}
    return row | {"failed": SEPARATOR.join(failed)}


def seed(number: int) -> int:
    """Return the seed of a round; the campaign has 0."""
    return number + 1


def processor_time() -> float:
    """Seconds of processor time of this process and of those of its children that it has waited for.

    Worker processes of a killed sweep are not among them.
    """
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)


# -- scenes ---------------------------------------------------------------------------------------------


def _scenes(number: int, size: Size) -> tuple[Row, Scene]:
    """Judge random scenes as the campaign does; also return one of them that reaches its end, to be drawn."""
    tame = None
    row: Row = {"runs": 0, "ended_early": 0, "steps": 0, "events": 0, "failed": []}
    for place in range(size.scenes):
        scene = random_scene(place, seed(number))
        for engine in ENGINES:
            try:
                found = judged(scene.replace({"solver.engine": engine}))
            except Exception as error:  # the soak is to find any of them, and goes on
                row["failed"].append(f"scene {place}, {engine}: {type(error).__name__}: {error}")
                continue
            row["runs"] += 1
            row["ended_early"] += found["outcome"] != "ok"
            row["steps"] += int(found["steps"] or 0)
            row["events"] += int(found["events"])
            if found["failed"]:
                row["failed"].append(f"scene {place}, {engine}: {found['failed']}")
            elif found["outcome"] == "ok":
                tame = tame or scene
    return row, tame or Scene()


# -- the sweep ------------------------------------------------------------------------------------------


def random_sweep(number: int, size: Size) -> Scene:
    """Draw a scene with a sweep below and above its supply frequency."""
    rng = np.random.default_rng((seed(number), size.scenes))  # the number after those of the scenes
    scene = drawn(Draw(rng), "swept")
    turn = 2.0 * np.pi / scene.speed_scale
    supply = scene.drive.supply_frequency_hz
    assert supply is not None  # it is drawn
    span = supply * float(rng.uniform(0.1, 0.5))
    step = span / max(size.frequencies - 1, 1)
    plan = {
        "supply_frequency_hz": {
            "start": supply - 0.5 * span,
            "stop": supply - 0.5 * span + step * (size.frequencies - 0.5),
            "step": step,
            "direction": list(size.directions),
        },
        "grid": {"contact.restitution": list(size.restitutions)},
        "kind": "bifurcation",
        "max_settle_s": SETTLE * turn,
        "measure_s": MEASURE * turn,
        "seed": number,
    }
    return Scene.from_tree(scene.to_tree() | {"sweep": plan})


def _sweep(number: int, size: Size, places: Places) -> Row:
    """Run a sweep without disturbance, then killed and resumed, then on workers that come and go."""
    row: Row = {"points": 0, "points_ok": 0, "sweep_kills": 0, "worker_kills": 0, "left_out": "", "failed": []}
    config = _written(places, random_sweep(number, size))
    rng = np.random.default_rng()  # no two soaks kill at the same moments
    began = time.perf_counter()
    try:
        code = places.run("sweep", config, "--out", "inline")
        seconds = time.perf_counter() - began
        expected = _table(places, "inline")
        row |= {"points": len(expected), "points_ok": int((expected["outcome"] == "ok").sum())}
        row["failed"] += _draw(places, "inline/swept", ["response", "bifurcation"]) if row["points_ok"] else []
    except VibroplatError as error:
        return row | {"failed": [f"sweep: {error}"]}
    ways: dict[str, Callable[[], Done]] = {
        "killed": lambda: places.run_with_kills(
            ["sweep", config, "--jobs", "2", "--out", "killed"],
            [float(moment) for moment in rng.uniform(0.2, 1.0, rng.integers(1, MOST_KILLS + 1)) * seconds],
        ),
        "dask": lambda: places.run_on_dask(["sweep", config, "--out", "dask"], rng, 0.4 * seconds),
    }
    row["left_out"] = missing_dask() if size.dask else "dask"
    if row["left_out"]:
        del ways["dask"]
    for way, run in ways.items():
        try:
            done = run()
            row["sweep_kills" if way == "killed" else "worker_kills"] += done.kills
            if done.code != code:
                row["failed"].append(f"sweep, {way}: exit code {done.code} instead of {code}")
            if differing := differences(expected, _table(places, way)):
                row["failed"].append(f"sweep, {way}: other values of {differing}")
        except VibroplatError as error:
            row["failed"].append(f"sweep, {way}: {error}")
    return row


def _table(places: Places, way: str) -> pd.DataFrame:
    return Result(places.directory / way / "swept", "sweep").table("sweep")


def differences(expected: pd.DataFrame, found: pd.DataFrame) -> str:
    """Name the columns of two tables whose bits differ, wall times left out; "" where none do."""
    if list(expected.columns) != list(found.columns) or len(expected) != len(found):
        return f"rows or columns: {found.shape} instead of {expected.shape}"
    return ", ".join(str(c) for c in expected if c != "wall_s" and not _same_bits(expected[c], found[c]))


def _same_bits(one: pd.Series, other: pd.Series) -> bool:
    if one.dtype != other.dtype:
        return False
    if one.dtype.kind == "f":  # 0.0 equals -0.0
        return one.to_numpy().tobytes() == other.to_numpy().tobytes()
    return one.equals(other)


# -- figures --------------------------------------------------------------------------------------------


def _figures(places: Places, scene: Scene) -> Row:
    """Run a scene by the command line and draw all figures of it."""
    failed = []
    try:
        config = _written(places, scene.replace({"name": "drawn"}))
        if places.run("run", config, "--out", "run"):
            failed.append("run: exit code 1 for a scene that reaches its end")
        failed += _draw(places, "run/drawn", ["motion", "exciters", *(["force"] if scene.has_contact else [])])
    except VibroplatError as error:
        failed.append(f"run: {error}")
    return {"failed": failed}


def _draw(places: Places, result: str, wanted: list[str]) -> list[str]:
    """Draw the figures of a result; say which are not there or not whole."""
    if places.run("plot", result):
        return [f"plot {result}: exit code 1"]
    return [f"{result}/{name}.png: {what}" for name in wanted if (what := flaw(places.directory / result, name))]


def flaw(directory: Path, name: str) -> str:
    """Say what is wrong with a figure; "" if it can be read to its end and shows something."""
    try:
        picture: Any = matplotlib.image.imread(directory / f"{name}.png")
    except (OSError, SyntaxError, ValueError) as error:
        return str(error) or type(error).__name__
    return "" if np.ptp(picture[..., :3]) > 0.0 else "empty"


def _written(places: Places, scene: Scene) -> str:
    """Write a scene as a configuration (JSON is YAML); return the name of the file."""
    file = places.directory / f"{scene.name}.yaml"
    file.write_text(json.dumps(scene.to_tree()), encoding="utf-8")
    return file.name
