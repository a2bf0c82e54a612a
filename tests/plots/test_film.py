"""The film of a run: what it shows moves; what cannot be filmed is refused."""

import numpy as np
import pytest
from PIL import Image

from vibroplat.plots.film import write_film


@pytest.mark.parametrize("kind", ["two layers", pytest.param("bare", marks=pytest.mark.long)])
def test_a_film_shows_the_last_turns(saved, tmp_path, kind):
    with Image.open(write_film(saved[kind], tmp_path / "machine.gif", turns=1, frames=4)) as film:
        assert (film.n_frames, film.size) == (4, (900, 380))
        shots = []
        for number in (0, 2):
            film.seek(number)
            shots.append(np.asarray(film.convert("RGB"), dtype=int))
    assert (np.abs(shots[1] - shots[0]).max(axis=2) > 60).mean() > 0.005  # what moves is more than a cursor


def test_what_cannot_be_filmed_is_refused_in_a_line(saved, command, here):
    line = "--out film.png: not a film; allowed: a name that ends with .gif"
    assert command("film", saved["bare"], "--out", "film.png") == (2, "", f"vibroplat: {line}\n")
