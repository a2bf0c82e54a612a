"""A GIF of the machine of a run in slow motion, with its curves."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Affine2D, Transform
from PIL import Image

from vibroplat.config.coordinates import TURN
from vibroplat.config.digits import shown_unit
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.page import machine
from vibroplat.plots.axes import label_axis
from vibroplat.plots.histories import run_of
from vibroplat.plots.run_picture import FROM_REST
from vibroplat.plots.style import head, new_figure, styled
from vibroplat.results.files import directory_of
from vibroplat.results.picture import BLUE, CURVES, VERMILION
from vibroplat.results.run import RunResult
from vibroplat.results.tables import as_written, replace_file, require_replaceable

#: Frames per second.
RATE = 20
#: Turns that are filmed if no interval is chosen, pictures of a turn, and most pictures of a film.
TURNS, FRAMES, MAX_PICTURES = 2.0, 40, 200
#: Size of a picture (inch) and dots per inch.
SIZE, DPI = (9.0, 3.8), 100
#: Number of colours of a GIF.
COLOURS = 64


def write_film(directory: Path, out: Path | None = None, start: float | None = None, stop: float | None = None) -> Path:
    """Film the machine of a run, with displacements magnified by a round number that the film shows.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat run``.
    out
        The film, ``.gif``. Default: ``machine.gif`` in DIR.
    start, stop
        Interval that is filmed (s). Default: the last turns.

    Raises
    ------
    VibroplatError
        There is no such result or nothing to film, or the format is unknown.
    """
    out = out or directory_of(directory, "run") / "machine.gif"
    if out.suffix != ".gif":
        raise VibroplatError(f"--out {out}: not a film; allowed: a name that ends with .gif")
    require_replaceable(out, b"GIF")
    with as_written(directory), styled():
        run = run_of(RunResult.read(directory, "run"), start, stop)
        if run.scene is None:
            raise VibroplatError(f"{directory}: its configuration cannot be read; there is nothing to film")
        table = run.shown.drop_duplicates("t_s", keep="last")
        end = float(table["t_s"].iloc[-1])
        if not run.chosen and run.turns > TURNS:
            table = table[table["t_s"] >= end - TURNS / run.turns * float(np.ptp(table["t_s"]))]
        count = round(FRAMES * abs(float(np.ptp(table["phi1_rad"]))) / TURN)
        times = np.linspace(float(table["t_s"].iloc[0]), end, min(max(count, 2), MAX_PICTURES), endpoint=False)
        film = FuncAnimation(*_scenery(run.name, run.scene, table), times)
        replace_file(out, lambda file: film.save(str(file), _FewColours(RATE), dpi=DPI))
    return out


class _FewColours(PillowWriter):
    """Gives all pictures the same few colours, so that only what moves is stored anew."""

    _frames: list[Image.Image]

    def finish(self) -> None:
        """Write the file."""
        pictures = [picture.convert("RGB") for picture in self._frames]
        palette = pictures[len(pictures) // 2].quantize(COLOURS)
        self._frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
        super().finish()


def _scenery(name: str, scene: Scene, table: pd.DataFrame) -> tuple[Figure, Callable[[float], None]]:
    """Draw the machine and its curves; return the figure and what moves both to a time (s)."""
    figure, axes, _ = new_figure(2 if "gap_m" in table else 1, 2, SIZE, widths=(1.1, 1.0))
    for axis in axes[:, 0]:
        axis.remove()
    move = _machine(figure.add_subplot(axes[0, 0].get_gridspec()[:, 0]), scene, table)
    head(figure, name)
    times, cursors = table["t_s"].to_numpy(), []
    curves = ("y_m", FROM_REST, BLUE), ("gap_m", "gap", VERMILION)
    for axis, (column, label, colour) in zip(axes[:, 1], curves, strict=False):
        axis.plot(times, table[column], color=colour)
        axis.set_xlim(times[0], times[-1])
        label_axis(axis.yaxis, column, shown_unit(column, float(table[column].abs().max())), label)
        cursors.append(axis.axvline(times[0], color="black", lw=1.0))
    axes[-1, 1].set_xlabel("$t$ (s)")
    figure.set_dpi(DPI)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # what moves leaves the layout as it is, which takes most of the time

    def show(time: float) -> None:
        move({name: float(np.interp(time, times, table[name])) for name in machine.MOVING if name in table})
        for cursor in cursors:
            cursor.set_xdata([time, time])

    return figure, show


def _machine(axis: Axes, scene: Scene, table: pd.DataFrame) -> Callable[[dict[str, float]], None]:
    """Draw the machine as the page does; return what moves it to coordinates (m, rad)."""
    drawn = machine.machine_of(scene)
    s, magnified = machine.Sizes.of(drawn), machine.magnification(table, drawn)
    k, half, bed = magnified * s.scale, machine.HALF, machine.BED
    slabs = [Rectangle((-bed, 0.0), 2 * bed, height, fc="#E9C46A", ec="#333") for height in s.heights if height]
    rims = [Circle(at, r, fc="white", ec=colour) for at, r, colour in zip(s.axes, s.radii, CURVES, strict=False)]
    solids = [Rectangle((-half, s.bottom), 2 * half, s.top - s.bottom, fc="#c9d3dc", ec="#333"), *rims, *slabs]
    for patch in solids:
        axis.add_patch(patch)
    look: dict[str, Any] = {"lw": 2.0, "marker": "o", "markevery": [1]}
    arms = [axis.plot([0.0, r], [0.0, 0.0], color=CURVES[i], **look)[0] for i, r in enumerate(s.radii)]
    feet = [machine.upright(place, s.angle) for place in s.springs]
    lengths = [y - s.floor for _, y in feet]
    coils = (np.transpose(machine.coil(length, *machine.SPRING_COILS)) for length in lengths)
    springs = [axis.plot(*coil, color="#333", lw=1.2)[0] for coil in coils]
    for spring, off in zip(springs, drawn["off"], strict=False):
        spring.set_alpha(0.25 if off else 1.0)
    coil = np.transpose(machine.coil(machine.BETWEEN, *machine.BETWEEN_COILS))
    between = [axis.plot(*coil, color="#333", lw=0.6)[0] for _ in machine.BETWEENS if len(slabs) == 2]
    axis.axhline(s.floor, color="#777")
    axis.set(xlim=(-s.aside, s.aside), ylim=(s.floor - 12.0, s.above), aspect="equal")
    axis.set_title(f"displacements × {magnified:g}")
    axis.set_axis_off()

    def move(now: dict[str, float]) -> None:
        pose = Affine2D().rotate(magnified * now["phi_rad"]).translate(k * now["x_m"], k * now["y_m"]).rotate(-s.angle)
        moved: dict[Artist, Transform] = dict.fromkeys(solids, pose)
        for arm, at, column in zip(arms, s.axes, ("phi1_rad", "phi2_rad"), strict=True):
            moved[arm] = Affine2D().rotate(now[column] - s.angle).translate(*pose.transform(at))
        for spring, place, (x, _), length in zip(springs, s.springs, feet, lengths, strict=True):
            aside, up = (pose.transform(place) - (x, s.floor)) / length
            moved[spring] = Affine2D([[1.0, aside, x], [0.0, up, s.floor], [0.0, 0.0, 1.0]])
        low = s.top + k * now.get("gap_m", 0.0)
        foot, apart = low + s.heights[0], max(machine.BETWEEN + k * now.get("upper_m", 0.0), 3.0)
        for spring, x in zip(between, machine.BETWEENS, strict=False):
            moved[spring] = Affine2D([[1.0, 0.0, x], [0.0, apart / machine.BETWEEN, foot], [0.0, 0.0, 1.0]]) + pose
        for slab, y in zip(slabs, (low, foot + apart), strict=False):
            slab.set_y(y)
        for artist, transform in moved.items():
            artist.set_transform(transform + axis.transData)

    return move
