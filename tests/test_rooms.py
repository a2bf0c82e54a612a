"""Arrows between the rooms of the package point down."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import vibroplat

PACKAGE = Path(vibroplat.__file__).parent
ROOMS = ("kernels", "model", "hybrid", "integrate", "observe", "motion", "study", "check", "continuation", "paper")


def imported(source):
    """Rooms that a file imports from, type annotations alone included."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        yield from (name.split(".")[1] for name in names if name.startswith("vibroplat."))


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_from_those_below(room):
    above = {*ROOMS[ROOMS.index(room) + 1 :], "bench", "plots", "page", "cli"}
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert files
    found = {(f.name, name) for f in files for name in imported(f) if name in above}
    assert found <= {("confirming.py", "continuation")}  # periodic orbits for a sweep's exponents: to be moved


def test_the_page_is_drawn_from_result_tables_alone():
    files = sorted((PACKAGE / "page").rglob("*.py"))
    assert files
    assert {(f.name, name) for f in files for name in imported(f) if name in {*ROOMS, "bench", "cli"}} == set()
