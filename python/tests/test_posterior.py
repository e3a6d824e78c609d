"""Draws around a fit."""

import numpy as np
import pytest

from kerrlight import Fit, Posterior

LINEAR = {
    "representation.kind": "linear-grid",
    "representation.linear-grid.nodes": 10,
    "linear": {"rounds": 2, "iterations": 20},
    "screen.pixels": 16,
    "output.nodes": 10,
}


def test_draws(tmp_path):
    fit = Fit(folder=tmp_path / "run", set=LINEAR).run(progress=False)
    with pytest.raises(FileNotFoundError, match="holds no posterior"):
        Posterior(fit.folder / "posterior")
    with pytest.raises(ValueError, match="samples = 1"):
        fit.posterior(1)
    few = fit.posterior(2, progress=False)
    more = fit.posterior(3, progress=False)
    assert (len(few), len(more)) == (2, 3)
    draws = np.array([volume.emission for volume in more], dtype=float)
    np.testing.assert_allclose(more.mean.emission, draws.mean(0), atol=1e-5 * draws.max())
    np.testing.assert_allclose(more.deviation.emission, draws.std(0, ddof=1), atol=1e-4 * draws.max())
    np.testing.assert_array_equal(few[-1].emission, more[1].emission)
    assert more.features[0].radius.value > 0 and more.features[0].light.error >= 0
    assert more.geometries == {} and more.summary["samples"] == 3
    assert more.report().path.is_file() and "3 draws" in repr(more)
    with pytest.raises(ValueError, match="the geometry is known"):
        more.interval("spin")
    with pytest.raises(IndexError):
        more[3]


def test_geometries(tmp_path):
    """What a posterior of a geometry holds, read back."""
    (tmp_path / "posterior.json").write_text('{"samples": 4, "geometry": {"spin": {}, "inclination_deg": {}}}')
    rows = ["spin,inclination_deg,chi2", *(f"{0.1 * k},{60 + k},1.0" for k in range(4))]
    (tmp_path / "geometries.csv").write_text("\n".join(rows) + "\n")
    geometries = Posterior(tmp_path).geometries
    assert list(geometries) == ["spin", "inclination_deg"]
    np.testing.assert_allclose(geometries["spin"], [0.0, 0.1, 0.2, 0.3])
    assert Posterior(tmp_path).interval("inclination_deg", 0.5) == (60.75, 62.25)
