"""Representations written in Python: beside kerrlight's own, in fits and comparisons, and what goes wrong in them."""

import importlib.util
import json
import pathlib
import sys

import numpy as np
import pytest

import kerrlight
from kerrlight import Fit, compare

MODULE = '''
import numpy as np

import kerrlight


class Voxels(kerrlight.Representation):
    """Trilinear voxels of the cube |x| <= r_max, dark at first, as kerrlight's grid without an activation has them."""

    def __init__(self, region, *, nodes):
        self.nodes, self.low = int(nodes), -region.r_max
        self.spacing = 2 * region.r_max / (self.nodes - 1)
        self.parameters = self.nodes**3

    def initialise(self, seed):
        return np.zeros(self.parameters)

    def corners(self, points):
        at = (points.astype(float) - self.low) / self.spacing
        cell = np.clip(np.floor(at).astype(int), 0, self.nodes - 2)
        part = at - cell
        inside = ((at >= 0) & (at <= self.nodes - 1)).all(1)
        for corner in np.ndindex(2, 2, 2):
            weight = np.where(corner, part, 1 - part).prod(1) * inside
            yield np.ravel_multi_index((cell + corner).T, (self.nodes,) * 3), weight

    def eval(self, parameters, points):
        return sum(weight * parameters[node] for node, weight in self.corners(points))

    def vjp(self, parameters, points, cotangents, wants_points):
        assert not wants_points
        total = np.zeros(self.parameters)
        for node, weight in self.corners(points):
            np.add.at(total, node, weight * cotangents)
        return total, None


class Wrong(Voxels):
    def __init__(self, region, *, how):
        super().__init__(region, nodes=4)
        self.how = Wrong.given = how

    def eval(self, parameters, points):
        if self.how == "raises":
            raise RuntimeError("no light today")
        return {"shape": np.zeros(3), "kind": np.zeros(len(points), complex)}[self.how]
'''

QUICK = {
    "training": {"steps": 6, "log_every": 1, "start": "drawn", "batch": {"frames": 2}},
    "output.nodes": 12,
    "screen.pixels": 16,
    "simulation.observation.scans": 8,
}
RATES = {"rate": 0.01, "last_rate": 0.01}


@pytest.fixture
def voxels(tmp_path, monkeypatch):
    """The module in the current folder, which is on the path of the processes that fits start."""
    (tmp_path / "own_voxels.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield "own_voxels:Voxels"
    sys.modules.pop("own_voxels", None)


def losses(fit):
    return np.array([step.loss for step in fit.log])


def test_the_same_fit_as_with_the_grid_of_the_program(voxels):
    ours = {"kind": voxels, "own": {"settings": {"nodes": 12}, **RATES}}
    mine = Fit(folder="mine", set={**QUICK, "representation": ours}).run(progress=False)
    theirs = {"kind": "grid", "activation": "linear", "grid": {"nodes": 12, **RATES}}
    grid = Fit(folder="grid", set={**QUICK, "representation": theirs}).run(progress=False)
    # Sums in single precision have another order here, and Adam divides by their size.
    np.testing.assert_allclose(losses(mine), losses(grid), rtol=1e-3)
    assert losses(mine)[-1] < losses(mine)[0]
    bright = grid.volume.emission.max()
    np.testing.assert_allclose(mine.volume.emission, grid.volume.emission, atol=0.02 * bright)


def test_stopped_and_resumed(voxels):
    own = {"settings": {"nodes": 8}, **RATES}
    chosen = {**QUICK, "representation": {"kind": f"{pathlib.Path('own_voxels.py')}:Voxels", "own": own}}
    whole = Fit(folder="whole", set=chosen).run(progress=False)

    def stop(step):
        if step.step >= 2:
            raise StopIteration

    parts = Fit(folder="parts", set=chosen)
    with pytest.raises(StopIteration):
        parts.run(stop, progress=False)
    again = Fit.open("parts").run(progress=False)
    np.testing.assert_array_equal(again.volume.emission, whole.volume.emission)


def test_takes_part_in_a_comparison(voxels):
    own = {"representation": {"kind": voxels, "own": {"settings": {"nodes": 8}, **RATES}}}
    grid = {"representation": {"kind": "grid", "activation": "linear", "grid": {"nodes": 8, **RATES}}}
    levels = [{"name": "mine", "set": own}, {"name": "grid", "set": grid}]
    pathlib.Path("fit.toml").write_text(Fit().settings, encoding="utf-8")
    experiment = {
        "title": "Mine and theirs",
        "question": "Are they the same?",
        "reading": ["Two cases."],
        "seeds": 1,
        "fit": "fit.toml",
        "factor": [{"name": "representation", "level": levels}],
        "table": [{"title": "Loss", "caption": "Of all data.", "value": "loss", "rows": ["representation"]}],
    }
    done = compare(experiment, "both", set=QUICK, progress=False)
    mine, theirs = sorted(done.rows(), key=lambda row: row["representation"], reverse=True)
    assert (mine["representation"], theirs["representation"]) == ("mine", "grid")
    assert mine["status"] == theirs["status"] == "done"
    assert mine["loss"] == pytest.approx(theirs["loss"], rel=1e-3)
    if importlib.util.find_spec("pandas") is not None:
        assert done.table()["loss"].tolist() == [row["loss"] for row in done.rows()]
    assert done.fit(0).volume.emission.shape == (12, 12, 12)
    assert "Mine and theirs" in done.report().path.read_text(encoding="utf-8")


def test_infinite_settings_arrive(voxels):
    how = [np.inf, -np.inf, 2.5, "inf"]
    Fit(set={**QUICK, "representation": {"kind": "own_voxels:Wrong", "own": {"settings": {"how": how}, **RATES}}})
    assert sys.modules["own_voxels"].Wrong.given == how


def test_levels_stay_beside_results_of_their_name(tmp_path):
    found = {"steps": 30, "loss": 0.5, "verdict": {"outcome": "explained"}}
    case = {"levels": {"steps": "few"}, "seed": 1, "status": "done", "results": found}
    text = json.dumps({"title": "Steps", "quick": False, "cases": [case]})
    (tmp_path / "results.json").write_text(text, encoding="utf-8")
    expected = {"steps": "few", "seed": 1, "status": "done", "verdict": "explained", "loss": 0.5}
    assert kerrlight.Comparison(tmp_path).rows() == [expected]


def test_what_goes_wrong(voxels, capfd):
    def fit(**chosen):
        return Fit(folder="wrong", set={**QUICK, "representation": chosen})

    for chosen, words in [
        ({"kind": "no_such_module:Voxels"}, "No module named 'no_such_module'"),
        ({"kind": "own_voxels:Nothing"}, "has no attribute 'Nothing'"),
        ({"kind": voxels}, "nodes"),
        ({"kind": voxels, "own": {"settings": {"nodes": 8, "colour": 1}}}, "colour"),
    ]:
        with pytest.raises(ValueError) as refused:
            fit(**chosen)
        assert words in str(refused.value) and "representation.kind" in str(refused.value)
    for how, words in [
        ("raises", "no light today"),
        ("shape", "Wrong.eval gives the shape (3,)"),
        ("kind", "complex128, not real"),
    ]:
        with pytest.raises(kerrlight.FitError) as failed:
            Fit(
                folder=f"wrong-{how}",
                set={**QUICK, "representation": {"kind": "own_voxels:Wrong", "own": {"settings": {"how": how}}}},
            ).run(progress=False)
        assert words in str(failed.value) and failed.value.__cause__ is not None
    assert capfd.readouterr().err == ""


JAX = '''
import jax
import jax.numpy as jnp

import kerrlight.jax


class Blobs(kerrlight.jax.Representation):
    chunk = 4096

    def __init__(self, region, *, count):
        self.region, self.count = region, int(count)

    def initial(self, key):
        return {"at": 6 * jax.random.uniform(key, (self.count, 3), minval=-1.0), "light": jnp.full(self.count, 0.1)}

    def emission(self, parameters, points):
        offset = points[:, None] - parameters["at"]
        return jnp.exp(-0.5 * (offset**2).sum(-1)) @ parameters["light"] ** 2
'''


def derivatives(own):
    """Both gradients beside central differences, over several batches and their remainder."""
    random = np.random.default_rng(3)
    parameters = np.asarray(own.initialise(5), dtype=np.float32)
    points = random.uniform(-6, 6, (150, 3)).astype(np.float32)
    cotangents = random.normal(size=150).astype(np.float32)
    first, second = own.vjp(parameters, points, cotangents, True)
    step_p, step_x = random.normal(size=len(parameters)), random.normal(size=points.shape)
    ends = [
        np.dot(cotangents, own.eval((parameters + h * step_p).astype("f4"), (points + h * step_x).astype("f4")))
        for h in (1e-2, -1e-2)
    ]
    slope = np.dot(first, step_p) + (second * step_x).sum()
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-2, rel=5e-3)
    alone, none = own.vjp(parameters, points, cotangents, False)
    np.testing.assert_array_equal(alone, first)
    assert none is None


def test_jax(tmp_path, monkeypatch):
    pytest.importorskip("jax")
    (tmp_path / "own_blobs.py").write_text(JAX, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    import own_blobs

    own = own_blobs.Blobs(kerrlight.Region(2.0, 8.0, np.inf), count=7)
    own.chunk = 64
    derivatives(own)
    starts = [own.initialise(seed) for seed in (0, 2**33, 2**63, 2**64 - 2)]
    assert all((one != other).any() for one, other in zip(starts, starts[1:]))
    chosen = {"kind": "own_blobs:Blobs", "own": {"settings": {"count": 16}, **RATES}}
    settings = {**QUICK, "representation": chosen, "training.batch": {"frames": 8}}
    fit = Fit(folder="run", set=settings).run(progress=False)
    assert losses(fit)[-1] < losses(fit)[0]


def test_torch(monkeypatch):
    torch = pytest.importorskip("torch")
    import kerrlight.torch

    class Plain(kerrlight.torch.Representation):
        def network(self):
            layers = [torch.nn.Linear(3, 16), torch.nn.SiLU(), torch.nn.Linear(16, 1), torch.nn.Softplus()]
            return torch.nn.Sequential(*layers)

        def emission(self, network, points):
            return network(points / 8)[:, 0]

    seeded = []
    monkeypatch.setattr(torch.cuda, "manual_seed_all", seeded.append)
    own, before = Plain(), torch.random.get_rng_state()
    starts = [own.initialise(seed) for seed in (5, 5, 2**64 - 1)]
    assert (starts[0] == starts[1]).all() and (starts[0] != starts[2]).any()
    # Neither the caller's random numbers nor those of graphics devices begin anew.
    assert torch.equal(torch.random.get_rng_state(), before) and not seeded
    derivatives(own)
