"""A GIF of the machine of a run in slow motion, with its curves."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.transforms import Affine2D
from PIL import Image

from vibroplat.config.coordinates import TURN
from vibroplat.config.scene import Scene
from vibroplat.errors import VibroplatError
from vibroplat.hybrid.state import static_rest
from vibroplat.kernels.compiled import FloatArray
from vibroplat.plots.histories import run_of
from vibroplat.plots.run import FROM_REST
from vibroplat.plots.style import head, new_figure, styled
from vibroplat.results.files import directory_of
from vibroplat.results.picture import BLUE, CURVES, VERMILION
from vibroplat.results.run import RunResult
from vibroplat.results.tables import as_written, replace_file, require_replaceable

#: Duration of a frame (ms).
FRAME = 50
#: Size of a picture (inch) and dots per inch.
SIZE, DPI = (9.0, 3.8), 100
#: Most pictures of a film.
MAX_PICTURES = 200
#: Number of colours of a GIF, and number of its pictures from which they are chosen.
COLOURS, SAMPLES = 64, 10
#: Room for the largest displacement, over half the width of the platform.
ROOM = 0.25

#: Draws the picture at a time (s).
Painter = Callable[[float], None]


def write_film(
    directory: Path,
    out: Path | None = None,
    start: float | None = None,
    stop: float | None = None,
    *,
    turns: float = 2.0,
    frames: int = 40,
) -> Path:
    """Film the machine of a run, with displacements magnified by a round number that the film shows.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat run``.
    out
        The film, ``.gif``. Default: ``machine.gif`` in DIR.
    start, stop
        Interval that is filmed (s). Default: the last turns.
    turns, frames
        How many turns, where no interval is given, and pictures of each.

    Raises
    ------
    VibroplatError
        There is no such result or nothing to film, or the format is unknown.
    """
    out = out or directory_of(directory, "run") / "machine.gif"
    if out.suffix != ".gif":
        raise VibroplatError(f"--out {out}: not a film; allowed: a name that ends with .gif")
    require_replaceable(out, b"GIF")
    with as_written(directory):
        first, *others = _film(directory, start, stop, turns, frames)
    look: dict[str, Any] = {"save_all": True, "append_images": others, "duration": FRAME, "loop": 0, "optimize": True}
    replace_file(out, lambda file: first.save(file, format="gif", **look))
    return out


def _film(directory: Path, start: float | None, stop: float | None, turns: float, frames: int) -> list[Image.Image]:
    """Return the pictures of a film; see :func:`write_film`."""
    run = run_of(RunResult.read(directory, "run"), start, stop)
    if run.scene is None:
        raise VibroplatError(f"{directory}: its configuration cannot be read; there is nothing to film")
    table = run.shown.drop_duplicates("t_s", keep="last")
    if not run.chosen and run.turns > turns:
        table = table[table["t_s"] >= table["t_s"].iloc[-1] - turns / run.turns * float(np.ptp(table["t_s"]))]
    turned = abs(float(np.ptp(table["phi1_rad"]))) / TURN
    times = np.linspace(
        table["t_s"].iloc[0], table["t_s"].iloc[-1], min(max(round(frames * turned), 2), MAX_PICTURES), endpoint=False
    )
    with styled():
        figure, paint = _scenery(run.name, run.scene, table)
        return _reduce_colours(_pictures(figure, paint, times))


def _pictures(figure: Figure, paint: Painter, times: FloatArray) -> list[Image.Image]:
    """Take pictures at these times (s); what stands still is drawn once."""
    canvas = FigureCanvasAgg(figure)
    moving = [artist for axis in figure.axes for artist in axis.get_children() if artist.get_animated()]
    canvas.draw()
    still, pictures = canvas.copy_from_bbox(figure.bbox), []
    for time in times:
        paint(time)
        canvas.restore_region(still)
        for artist in sorted(moving, key=Artist.get_zorder):
            artist.draw(canvas.get_renderer())
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return pictures


def _reduce_colours(pictures: list[Image.Image]) -> list[Image.Image]:
    """Give all pictures the same few colours, so that only what moves is stored anew."""
    width, height = pictures[0].size
    sample = Image.new("RGB", (width, SAMPLES * height))
    for number in range(SAMPLES):
        sample.paste(pictures[number * len(pictures) // SAMPLES], (0, number * height))
    palette = sample.quantize(COLOURS)
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]


def _scenery(name: str, scene: Scene, table: pd.DataFrame) -> tuple[Figure, Painter]:
    """Draw the machine at rest and its curves; return the figure and what moves both to a time (s)."""
    times = table["t_s"].to_numpy()
    columns = ["x_m", "y_m", "phi_rad", "phi1_rad", "phi2_rad", *(c for c in ("gap_m", "upper_m") if c in table)]
    moving = {column: table[column].to_numpy(dtype=float) for column in columns}
    if "upper_m" in moving:
        moving["upper_m"] = moving["upper_m"] - static_rest(scene)[6]
    figure, axes, _ = new_figure(2 if "gap_m" in table else 1, 2, SIZE, widths=(1.1, 1.0))
    stage = axes[0, 0]
    if len(axes) == 2:
        stage.remove()
        axes[1, 0].remove()
        stage = figure.add_subplot(axes[0, 0].get_gridspec()[:, 0])
    machine = _Machine(stage, scene, moving)
    head(figure, name)
    stage.set_title(f"displacements × {machine.magnification:g}")
    cursors = []
    for axis, (column, label, colour) in zip(
        axes[:, 1], (("y_m", FROM_REST, BLUE), ("gap_m", "gap (mm)", VERMILION)), strict=False
    ):
        axis.plot(times, 1e3 * moving[column], color=colour)
        axis.set(ylabel=label, xlim=(times[0], times[-1]))
        cursors.append(axis.axvline(times[0], color="black", lw=1.0, animated=True))
    axes[-1, 1].set_xlabel("$t$ (s)")
    figure.set_dpi(DPI)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # what moves leaves the layout as it is, which takes most of the time

    def paint(time: float) -> None:
        machine.move({column: float(np.interp(time, times, values)) for column, values in moving.items()})
        for cursor in cursors:
            cursor.set_xdata([time, time])

    return figure, paint


class _Machine:
    """The machine, drawn at its true size (m) with displacements magnified."""

    def __init__(self, axis: Axes, scene: Scene, moving: dict[str, FloatArray]) -> None:
        axes, radii = scene.body.axes, [exciter.unbalance_radius_m for exciter in scene.exciter_pair]
        self.axis, self.places, self.radii = axis, axes, radii
        self.half = half = max(abs(x) + 1.5 * r for (x, _), r in zip(axes, radii, strict=True))
        self.top = max(0.15 * half, *(y + 1.2 * r for (_, y), r in zip(axes, radii, strict=True)))
        self.bottom = min(-0.15 * half, *(y - 1.2 * r for (_, y), r in zip(axes, radii, strict=True)))
        sizes = [float(np.abs(moving[name]).max()) for name in moving if name.endswith("_m")]
        free = ROOM * half / max(*sizes, half * float(np.abs(moving["phi_rad"]).max()), 1e-9 * half)
        power = 10.0 ** math.floor(math.log10(free))
        self.magnification = power * next(step for step in (5.0, 2.0, 1.0) if step * power <= 1.0001 * free)
        self.floor = self.bottom - 0.9 * half
        self.body = Rectangle((-half, self.bottom), 2 * half, self.top - self.bottom, fc="#c9d3dc", ec="#333")
        self.springs = [axis.plot([], [], color="#333", lw=1.2)[0] for _ in range(2)]
        self.rims = [Circle((0.0, 0.0), r, fc="white", ec=CURVES[i]) for i, r in enumerate(radii)]
        self.arms = [axis.plot([], [], color=CURVES[i], lw=2.0, marker="o", markevery=[1])[0] for i in range(2)]
        heights = [0.15 * half + 0.2 * half * mass / sum(scene.layer_masses) for mass in scene.layer_masses if mass]
        self.slabs = [
            Rectangle((-0.8 * half, 0.0), 1.6 * half, height, fc=colour, ec="#333")
            for height, colour in zip(heights, ("#E9C46A", "#F1DCA7"), strict=False)
        ]
        for patch in (self.body, *self.rims, *self.slabs):
            axis.add_patch(patch)
        for part in (self.body, *self.rims, *self.slabs, *self.springs, *self.arms):
            part.set_animated(True)
        axis.axhline(self.floor, color="#777")
        axis.set(
            xlim=(-1.4 * half, 1.4 * half), ylim=(self.floor - 0.1 * half, self.top + half * (1.5 if heights else 0.4))
        )
        axis.set_aspect("equal")
        axis.set_axis_off()

    def move(self, now: dict[str, float]) -> None:
        """Draw it at values of the coordinates (m, rad)."""
        k, half = self.magnification, self.half
        pose = Affine2D().rotate(k * now["phi_rad"]).translate(k * now["x_m"], k * now["y_m"])
        for patch in (self.body, *self.slabs):
            patch.set_transform(pose + self.axis.transData)
        for i, (arm, rim) in enumerate(zip(self.arms, self.rims, strict=True)):
            x, y = pose.transform(self.places[i])
            angle = now[f"phi{i + 1}_rad"]
            rim.set_center((x, y))
            arm.set_data([x, x + self.radii[i] * math.cos(angle)], [y, y + self.radii[i] * math.sin(angle)])
        for side, spring in zip((-0.7, 0.7), self.springs, strict=True):
            x, y = pose.transform((side * half, self.bottom))
            part = np.linspace(0.0, 1.0, 14)
            aside = 0.06 * half * np.array([0, 0, *[1, -1] * 5, 0, 0])
            spring.set_data(side * half + part * (x - side * half) + aside, self.floor + part * (y - self.floor))
        base = self.top + k * now.get("gap_m", 0.0)
        for slab, lift in zip(self.slabs, (0.0, 0.15 * half + k * now.get("upper_m", 0.0)), strict=False):
            slab.set_y(base + max(lift, 0.0))
            base += slab.get_height()
