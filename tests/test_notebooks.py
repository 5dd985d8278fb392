"""The notebooks of examples/notebooks run from top to bottom, and are stored without what they show."""

import json
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from html_page import Page

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    """Its own checks hold; it shows small pictures and pages, and neither lines of Warp nor warnings."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook, timeout=None, kernel_name="python3", resources={"metadata": {"path": path.parent}}
    ).execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    shown = [output.data for output in outputs if "data" in output]
    assert any("image/png" in data for data in shown)
    for data in shown:
        if "application/vnd.jupyter.widget-view+json" in data:
            continue  # a viewer, with a still scene for the saved notebook
        if "text/html" in data:
            page = Page(data["text/html"])
            assert page.open == [] and "script" not in {tag for tag, _ in page.tags}
        assert all(len(json.dumps(content)) < 600_000 for content in data.values())
    said = "".join(output.text for output in outputs if output.output_type == "stream")
    assert "Warp 1" not in said and "Module " not in said and "that is a blow" not in said, said


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    """A change of it is a change of what it says; nothing that it showed once grows old in it."""
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert notebook.cells[0].cell_type == "markdown" and notebook.cells[0].source.startswith("# ")
    for cell in notebook.cells:
        assert cell.cell_type == "markdown" or (cell.outputs == [] and cell.execution_count is None)


def test_there_are_five():
    """The folder was found."""
    assert len(NOTEBOOKS) == 5
