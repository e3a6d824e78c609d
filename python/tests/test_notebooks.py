"""The notebooks run from their first cell to their last, with fewer steps."""

import json
import pathlib
import re

import pytest

NOTEBOOKS = sorted((pathlib.Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
SHORTER = {
    '"training.steps": 300': '"training.steps": 20, "output.nodes": 16, "screen.pixels": 20',
    "range(1, 201)": "range(1, 31)",
}


def code(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    names = {}
    for k, cell in enumerate(code(path)):
        if re.search(r"^import jax$", cell, re.MULTILINE):
            pytest.importorskip("jax")
        for long, short in SHORTER.items():
            cell = cell.replace(long, short)
        exec(compile(cell, f"{path.stem}, cell {k + 1}", "exec"), names)
    for number in plt.get_fignums():
        plt.figure(number).savefig(tmp_path / f"{path.stem}_{number}.png", dpi=50)
    plt.close("all")
    if "history" in names:
        assert names["history"][-1] < 0.5 * names["history"][0]
    if path.stem != "5_a_network_through_our_rays":
        assert list(tmp_path.glob("*"))
