"""Makes a GIF of the moving machine from the page of a run: ``python -m tools.film DIR --out machine.gif``.

It needs Chromium, its driver, selenium, and ``tests`` on PYTHONPATH.
"""

import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from tools.browser import browser, open_page
from vibroplat.errors import VibroplatError
from vibroplat.page.report import write_report
from vibroplat.results.tables import replace_file

if TYPE_CHECKING:
    pass

#: Duration of a frame (ms), which browsers keep from 20 ms on.
FRAME = 50
#: Pictures from which the colours are chosen; a flash is in few of them.
SAMPLES = 20
#: Height of a picture (pixels): that of the first three panels.
HEIGHT = 364


def write_film(directory, out, turns, frames, width, colours):
    """Write a GIF of the last turns of a run.

    Parameters
    ----------
    directory
        Result directory of ``vibroplat run``.
    out
        The GIF.
    turns, frames
        Number of turns of the exciters, and of pictures of each of them.
    width
        Width of a picture (pixels).
    colours
        Number of colours; fewer make a smaller file.

    Raises
    ------
    VibroplatError
        There is no such result, or something is not installed.
    """
    with tempfile.TemporaryDirectory() as place, browser(width, HEIGHT) as driver:
        open_page(driver, write_report([directory], Path(place) / "page.html"))
        pictures = _pictures(driver, turns, frames)
    first, *others = _reduced(pictures, colours)
    replace_file(
        out,
        lambda path: first.save(
            path, format="gif", save_all=True, append_images=others, duration=FRAME, loop=0, optimize=True
        ),
    )
    return out


def _pictures(driver, turns, frames):
    """Take pictures at even times over the last whole turns."""
    from PIL import Image

    style = Path(__file__).with_name("film.css").read_text(encoding="utf-8")
    driver.execute_script(
        "document.head.append(Object.assign(document.createElement('style'), {textContent: arguments[0]}));", style
    )
    turn = driver.execute_script("return window.vibroplat.player && window.vibroplat.player.turn")
    if turn is None:
        raise VibroplatError("the run has no rows; there is nothing to film")
    end = driver.execute_script("return window.vibroplat.player.limits[1]")
    start = end - turns * turn
    show = "const done = arguments[2]; window.vibroplat.player.curves.show([arguments[0], arguments[1]]).then(done);"
    driver.execute_script("window.dispatchEvent(new Event('resize'));")
    driver.execute_async_script(show, start, end)
    pictures = []
    for number in range(turns * frames):
        driver.execute_script("window.vibroplat.player.seek(arguments[0]);", start + number * turn / frames)
        pictures.append(Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB"))
    return pictures


def _reduced(pictures, colours):
    """Give all pictures the same few colours, so that only what moves is stored anew."""
    from PIL import Image

    sample = Image.new("RGB", (pictures[0].width, SAMPLES * pictures[0].height))
    for number in range(SAMPLES):
        sample.paste(pictures[number * len(pictures) // SAMPLES], (0, number * pictures[0].height))
    palette = sample.quantize(colours)
    return [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]


def film(
    directory,
    out=Path("machine.gif"),
    turns=2,
    frames=40,
    width=900,
    colours=128,
):
    """Make a GIF of the moving machine and its curves from the page of a run."""
    try:
        print(write_film(directory, out, turns, frames, width, colours))
    except VibroplatError as error:
        raise SystemExit(f"vibroplat: {error}") from None


if __name__ == "__main__":
    typer.run(film)
