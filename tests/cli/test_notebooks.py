"""The notebooks run from the first to the last cell, and show what they are kept with.

Write them again: ``jupyter execute --inplace results/notebooks/*.ipynb``.
"""

import json
import re
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "results/notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def shown(cells):
    """Texts of the outputs of all cells, and how many pictures there are."""
    outputs = [output for cell in cells if cell["cell_type"] == "code" for output in cell["outputs"]]
    texts = ["".join(o.get("data", {}).get("text/plain", o.get("text", ""))) for o in outputs]
    return texts, sum("data:image/png" in str(o) or "image/png" in o.get("data", {}) for o in outputs)


def words(line):
    return NUMBER.sub("", line).split()


def numbers(line):
    return [float(number) for number in NUMBER.findall(line)]


def test_there_are_three_with_outputs():
    assert [path.stem for path in NOTEBOOKS] == ["branches", "first-run", "own-machine"]
    for path in NOTEBOOKS:
        texts, pictures = shown(json.loads(path.read_text(encoding="utf-8"))["cells"])
        assert texts
        assert pictures


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")  # of the server of notebooks
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_shows_what_it_is_kept_with(path, kernels, tmp_path):
    """Lines may be added. Numbers may differ in their last digits, and what is below 1e-6 is round-off."""
    nbclient = pytest.importorskip("nbclient", reason="pip install '.[test]'")
    nbformat = pytest.importorskip("nbformat", reason="pip install '.[test]'")
    notebook = nbformat.read(path, as_version=4)
    (kept, pictures), cells = shown(notebook.cells), notebook.cells
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    found, drawn = shown(cells)
    assert drawn == pictures > 0
    lines = [(words(line), numbers(line)) for text in found for line in text.splitlines()]
    for line in (line for text in kept for line in text.splitlines()):
        assert any(words(line) == of and numbers(line) == pytest.approx(n, rel=1e-3, abs=1e-6) for of, n in lines), line
