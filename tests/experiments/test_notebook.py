"""The notebook that walks the loop runs from top to bottom, and no step shows more than two screens."""

from __future__ import annotations

import base64
import re
import struct
from pathlib import Path
from typing import Any

import pytest

nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed: pip install 'auvnn[test]'")
nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: pip install 'auvnn[test]'")
pytest.importorskip("ipykernel", reason="ipykernel is not installed: pip install 'auvnn[test]'")

PATH = Path(__file__).resolve().parents[2] / "experiments" / "notebook" / "loop.ipynb"
# A screen holds about 45 lines of text; a figure as high as that is 900 pixels at 150 per inch of a screen of 100.
SCREEN, PIXELS = 45, 1350


@pytest.fixture(scope="module")
def cells(tmp_path_factory) -> list[Any]:
    """Return the code cells after they have run in a kernel of their own."""
    notebook = nbformat.read(PATH, as_version=4)
    folder = tmp_path_factory.mktemp("notebook")
    with pytest.MonkeyPatch.context() as patch:
        # The kernel starts elsewhere: it is to find the package that is being tested, and to run it as users do.
        patch.setenv("PYTHONPATH", str(PATH.parents[2]))
        patch.setenv("AUVNN_ENGINE", "auto")
        client = nbclient.NotebookClient(
            notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
        )
        client.execute()
    assert (folder / "better" / "model.yaml").is_file() and (folder / "report.html").is_file()
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def lines(output: Any) -> float:
    """Return how many lines of a screen an output takes: text as it wraps at 110, HTML by its rows, figures by height."""
    if output.output_type == "stream":
        return sum(1 + len(line) // 110 for line in output.text.splitlines())
    data = output.get("data", {})
    if "image/png" in data:
        _, height = struct.unpack(">II", base64.b64decode(data["image/png"])[16:24])
        return SCREEN * height / PIXELS
    if "text/html" in data:
        rows = re.findall(r"<div>.*?</div>|<tr>.*?</tr>", data["text/html"], re.DOTALL)
        return sum(1 + len(re.sub("<[^>]*>", "", row)) // 110 for row in rows)
    return sum(1 + len(line) // 110 for line in data.get("text/plain", "").splitlines())


def test_every_step_shows_something_and_at_most_two_screens(cells):
    for cell in cells:
        total = sum(lines(output) for output in cell.outputs)
        assert 0 < total <= 2 * SCREEN, f"{cell.source}: {total:.0f} lines"


def test_nothing_is_said_on_standard_error(cells):
    assert not [o.text for cell in cells for o in cell.outputs if o.get("name") == "stderr"]


def test_the_current_is_named_and_the_error_falls(cells):
    shown = {cell.source.splitlines()[-1]: cell.outputs[-1].data for cell in cells}
    assert "named: ocean_current" in shown["diagnosis"]["text/html"]
    assert "accepted" in shown["better"]["text/plain"] and "v_north" in shown["better"]["text/html"]
    assert "smallest error over 5 s of free running: with the current" in shown["both"]["text/html"]


def test_figures_are_pictures_in_a_notebook(cells):
    plots = [cell for cell in cells if ".plot()" in cell.source]
    assert len(plots) >= 4 and all("image/png" in cell.outputs[-1].data for cell in plots)


def test_the_notebook_is_kept_without_outputs():
    notebook = nbformat.read(PATH, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)
