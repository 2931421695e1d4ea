"""The notebooks have the format of Jupyter, no outputs, and cells that run."""

import contextlib
import io
import json
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "examples").glob("*.ipynb"))


def cells(path):
    """(kind, text) of each cell; Jupyter's format 4.5."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    for cell in notebook["cells"]:
        assert cell["cell_type"] in ("markdown", "code")
        assert cell["cell_type"] == "markdown" or (cell["outputs"], cell["execution_count"]) == ([], None)
        yield cell["cell_type"], "".join(cell["source"])


@pytest.fixture
def names(request, tmp_path, monkeypatch):
    """What the code cells of a notebook leave behind."""
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    with contextlib.redirect_stdout(io.StringIO()):
        for number, (kind, text) in enumerate(cells(request.param)):
            if kind == "code":
                exec(compile(text, f"{request.param.name}, cell {number}", "exec"), names)
    yield names
    plt.close("all")


def test_there_is_a_notebook():
    assert [path.stem for path in NOTEBOOKS] == ["first_steps"]


@pytest.mark.tier2
@pytest.mark.parametrize("names", NOTEBOOKS, indirect=True, ids=lambda path: path.stem)
def test_the_first_steps_have_the_results_of_the_other_pages(names):
    assert names["run"].events[0].time == pytest.approx(12.267789, abs=1e-6)
    assert names["fastest"].duration == pytest.approx(0.78024, rel=1e-4)
    assert names["sweep"].column("lock.time")[0] == pytest.approx(19.2176, abs=1e-4)
    assert len(names["axes"].lines) == 3
