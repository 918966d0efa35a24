"""The example notebook runs from its first cell to its last, in the folder it is made for."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "sample_runs" / "example.ipynb"


def shown(cell: dict, names: dict) -> object:
    """Run a cell, and return what a notebook would show: the value of its last expression."""
    import ast

    tree = ast.parse("".join(cell["source"]))
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, str(NOTEBOOK), "exec"), names)  # noqa: S102 - that is what it is for
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)  # noqa: S307


def test_every_cell_runs_and_shows_what_its_text_says(monkeypatch):
    monkeypatch.chdir(ROOT)
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict = {}
    values = [shown(cell, names) for cell in cells if cell["cell_type"] == "code"]
    assert [one.label for one in names["result"].settings] == ["1", "10", "20"]
    pages = [value._repr_html_() for value in values if hasattr(value, "_repr_html_")]
    assert len(pages) == 7  # inspection, result, frame, figure, signals, second result, comparison
    assert names["again"].parameters["r_m1"][0] > 0.0
    assert [cell["outputs"] for cell in cells if cell["cell_type"] == "code"] == 7 * [[]]


@pytest.mark.parametrize("name", ["paper", "valves", "two_dampers", "vehicle", "next_test"])
def test_the_gallery_runs(monkeypatch, name) -> None:
    """Each notebook, cell by cell; what it promises it asserts itself."""
    monkeypatch.chdir(ROOT)
    text = (ROOT / "sample_runs" / f"{name}.ipynb").read_text(encoding="utf-8")
    names: dict = {}
    for cell in json.loads(text)["cells"]:
        if cell["cell_type"] == "code":
            shown(cell, names)
            assert cell["outputs"] == []
    import matplotlib.pyplot as plt

    plt.close("all")
