"""The Python of the documents runs as it stands."""

import importlib.util
import pathlib
import re

import numpy as np
import pytest

from kerrlight import Observation

PAGES = pathlib.Path(__file__).parents[2] / "docs" / "python"
# Steps of training are a few here.
SHORTER = {
    "range(1000)": "range(3)",
    '"training.steps": 500': '"training.steps": 3, "output.nodes": 16, "screen.pixels": 16, "training.start": "drawn"',
    "samples=1000": "samples=50",
}


def blocks(page):
    text = (PAGES / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def prepare(folder):
    """What the pages assume to be there: a file of visibilities, an image, a screen."""
    names = np.array([["AA", "LM"], ["AA", "PV"], ["LM", "PV"]])
    uv = np.array([[1e9, 2e9], [3e9, -1e9], [2e9, -3e9]])
    columns = ([4.0] * 3, names, uv, [1 + 1j, 0.5, -0.2j], [0.01] * 3)
    known = {"ra_hours": 12.5, "dec_deg": 12.4, "mjd": 57850, "frequency_hz": 2.3e11, "bandwidth_hz": 2e9}
    obs = Observation.of_stokes_i(*columns, integration=[10.0] * 3, source="M87", **known)
    obs.write(folder / "data.csv")
    alpha, beta = np.meshgrid(np.linspace(-8, 8, 5), np.linspace(-8, 8, 4), indexing="ij")
    screen = {"alpha": alpha, "beta": beta, "num_alpha": 5, "num_beta": 4}
    return {"np": np, "image": np.ones((64, 64)) / 4096, "obs": obs, **screen}


@pytest.mark.parametrize("page", sorted(path.name for path in PAGES.glob("*.md")))
def test_page(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = prepare(tmp_path)
    for block in blocks(page):
        missing = [
            module
            for module in re.findall(r"^import (torch|jax)$", block, re.MULTILINE)
            if importlib.util.find_spec(module) is None
        ]
        if "get_dataset" in block and importlib.util.find_spec("xarray") is None:
            missing.append("xarray")
        if missing:
            continue
        for long, short in SHORTER.items():
            block = block.replace(long, short)
        exec(compile(block, page, "exec"), names)
