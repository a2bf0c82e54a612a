"""Arrows point down: from the paper to studies in general, never back."""

from __future__ import annotations

from pathlib import Path

import pytest

import vibroplat.study

STUDY = Path(vibroplat.study.__file__).parent


@pytest.mark.parametrize("path", sorted(STUDY.rglob("*.py")), ids=lambda path: path.stem)
def test_studies_know_nothing_of_the_paper(path):
    assert "paper" not in path.read_text(encoding="utf-8")
