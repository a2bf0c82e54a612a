"""The notebooks run from the first to the last cell, and are kept without outputs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "results/notebooks").glob("*.ipynb"))


def test_there_are_three_without_outputs():
    assert [path.stem for path in NOTEBOOKS] == ["branches", "first-run", "own-machine"]
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        assert [cell["outputs"] for cell in cells if cell["cell_type"] == "code" and cell["outputs"]] == []


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")  # of the server of notebooks
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, kernels, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="pip install '.[test]'")
    nbformat = pytest.importorskip("nbformat", reason="pip install '.[test]'")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [o for cell in notebook.cells if cell.cell_type == "code" for o in cell.outputs]
    assert [o for o in shown if o.output_type == "error"] == []
    assert any("image/png" in o.get("data", {}) or "data:image/png" in str(o.get("data", {})) for o in shown)
