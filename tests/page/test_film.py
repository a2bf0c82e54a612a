"""The film of a run: what it shows moves; what cannot be filmed is refused."""

import numpy as np
import pytest
from PIL import Image

from vibroplat.page import film


@pytest.mark.parametrize("kind", ["two layers", pytest.param("bare", marks=pytest.mark.long)])
def test_a_film_shows_the_last_turns(saved, tmp_path, monkeypatch, kind):
    monkeypatch.setattr(film, "FRAMES", 2)
    with Image.open(film.write_film(saved[kind], tmp_path / "machine.gif")) as written:
        assert (written.n_frames, written.size) == (4, (900, 380))
        shots = []
        for number in (0, 1):
            written.seek(number)
            shots.append(np.asarray(written.convert("RGB"), dtype=int))
    moved = np.abs(shots[1] - shots[0]).max(axis=2) > 60
    assert moved[:, :450].mean() > 0.005  # the machine, and not only the cursors beside it
    assert moved[:, 450:].any()


def test_what_cannot_be_filmed_is_refused_in_a_line(saved, command, here):
    line = "--out film.png: not a film; allowed: a name that ends with .gif"
    assert command("film", saved["bare"], "--out", "film.png") == (2, "", f"vibroplat: {line}\n")
