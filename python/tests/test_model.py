"""The forward model: its adjoint, known sums, frames, precision, and gradients in PyTorch and JAX."""

from dataclasses import replace

import numpy as np
import pytest

from kerrlight import (
    ForwardModel,
    Infall,
    Keplerian,
    Kerr,
    PowerLaw,
    Profile,
    Tabulated,
    screen,
)

from laws import LAW

RNG = np.random.default_rng(7)


def model(**more):
    observer = Kerr(0.6).observer(inclination_deg=50, radius=more.pop("radius", float("inf")))
    settings = {"r_min": 3.0, "r_max": 9.0, "times": [0.0, 15.0, 40.0], **more}
    return ForwardModel(observer, *screen(10, 22.0), **settings)


KINDS = {
    "plain": {},
    "redshift": {"redshift_power": 2.0},
    "slow light": {"slow_light": True, "injection_time": 5.0},
    "tilted": {"axis": [1.0, 0.0, 1.0], "velocity": PowerLaw(3.5, 0.2)},
    "table": {"velocity": Tabulated([3.0, 9.0], [0.1, 0.02]), "z_width": 4.0, "order": 5, "split": 2},
    "stokes": {"polarization": LAW, "slow_light": True},
    "infall": {"velocity": Infall(0.9, 0.3, 0.6), "redshift_power": 3.0},
    "profile": {"velocity": Profile([3.0, 6.0, 9.0], [0.2, 0.06, 0.04], [-0.1, -0.05, -0.01])},
    "only U": {"polarization": LAW, "stokes": "U"},
    "bhnerf": {"per_ray": 60, "radius": 1000.0},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("voxels", [False, True])
def test_adjoint(kind, voxels):
    of = model(**KINDS[kind])
    operator = of.voxels((9, 10, 11), 9.0) if voxels else of
    x, y = RNG.normal(size=operator.input_shape), RNG.normal(size=operator.output_shape)
    left, right = np.vdot(operator.apply(x), y), np.vdot(x, operator.vjp(y))
    assert abs(left - right) <= 1e-12 * np.linalg.norm(operator.apply(x)) * np.linalg.norm(y)
    half = operator.apply(x.astype(np.float32))
    assert half.dtype == np.float32
    np.testing.assert_allclose(half, operator.apply(x), rtol=1e-4, atol=1e-3)
    back = operator.vjp(y.astype(np.float32))
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, operator.vjp(y), rtol=1e-4, atol=1e-3)


def test_pixels_are_sums():
    of = model(redshift_power=2.0)
    emission = RNG.random(of.input_shape)
    expected = [
        np.bincount(of.pixels, of.weights * emission[frame], minlength=100) for frame in range(3)
    ]
    np.testing.assert_allclose(of.apply(emission).reshape(3, 100), expected, rtol=1e-13)


def test_a_ring_does_not_change():
    of = model()
    x, y, z = np.moveaxis(of.coordinates(), -1, 0)
    movie = of.apply(np.exp(-((np.hypot(x, y) - 6) ** 2) - z**2))
    np.testing.assert_allclose(movie[1:], [movie[0]] * 2, rtol=1e-10)
    np.testing.assert_allclose(of.coordinates(np.float32), of.coordinates(), atol=1e-5)
    np.testing.assert_allclose(of.coordinates()[0], of.positions, atol=1e-12)


def test_matter_turns_with_the_law():
    of = model(velocity=Keplerian(0.0))
    x, y, _ = of.positions.T
    r = np.linalg.norm(of.positions, axis=1)
    angle = np.arctan2(y, x) - 40.0 * r**-1.5
    pulled = of.coordinates()[2]
    np.testing.assert_allclose(pulled[:, 0], np.hypot(x, y) * np.cos(angle), atol=1e-10)
    np.testing.assert_allclose(pulled[:, 1], np.hypot(x, y) * np.sin(angle), atol=1e-10)


def test_flows():
    """Circular orbits are one end of the family of infall; matter that falls was farther out before."""
    circular = model(velocity=Infall(1.0, 1.0, 1.0), r_min=6.5)
    falling = model(velocity=Infall(1.0, 0.5, 0.5), r_min=6.5, r_max=15.0)
    known = model(velocity=Keplerian(), r_min=6.5)
    np.testing.assert_allclose(circular.coordinates(), known.coordinates(), atol=1e-6)
    # What came from outside of the region is dark.
    before, now = (np.linalg.norm(falling.coordinates()[frame], axis=-1) for frame in (1, 0))
    lit = falling.vjp(np.ones(falling.output_shape))[1] > 0
    assert 0 < lit.sum() < lit.size and (before[lit] > now[lit]).all() and before[lit].max() <= 15
    straight = model(velocity=Profile([3.0, 9.0], [0.0, 0.0], [-0.01, -0.01]))
    radius = np.linalg.norm(straight.positions, axis=-1)
    lit = straight.vjp(np.ones(straight.output_shape))[1] > 0
    expected = straight.positions * (1 + 0.15 / radius)[:, None]
    np.testing.assert_allclose(straight.coordinates()[1][lit], expected[lit], atol=1e-6)
    np.testing.assert_array_equal(lit, radius + 0.15 <= 9)


def test_dark_before_the_injection():
    of = model(slow_light=True, injection_time=5.0)
    lit = of.times[:, None] - of.delays >= 5.0
    assert lit.any() and not lit.all()
    np.testing.assert_array_equal(of.vjp(np.ones(of.output_shape)) > 0, lit)


def test_light_of_a_toroidal_field_is_polarised_radially():
    """Far from the hole and seen from above, the electric vector points away from it: at the north it is along north
    (Q > 0), at the east along east (Q < 0), at the north-east half way (U > 0). East is towards -α."""
    observer = Kerr(0.0).observer(inclination_deg=0)
    alpha, beta = [0.0, -60.0, -42.4, 42.4], [60.0, 0.0, 42.4, 42.4]
    at_rest = PowerLaw(60.0, 1e-9)
    of = ForwardModel(
        observer, alpha, beta, r_min=50.0, r_max=70.0, z_width=3.0, velocity=at_rest, polarization=LAW
    )
    assert of.stokes == "IQU" and of.output_shape == (1, 3, 4)
    i, q, u = of.apply(np.ones(of.input_shape))[0]
    np.testing.assert_allclose(q / (0.5 * i), [1, -1, 0, 0], atol=0.02)
    np.testing.assert_allclose(u / (0.5 * i), [0, 0, 1, -1], atol=0.02)


def test_factors_of_stokes_parameters():
    of = model(polarization=LAW)
    i, q, u = of.factors
    np.testing.assert_allclose(np.hypot(q, u), 0.5 * i, rtol=1e-12)
    plain = model(redshift_power=2.0)
    np.testing.assert_allclose(i * of.weights, plain.weights, rtol=1e-10)
    emission = RNG.random(of.input_shape)
    movie = of.apply(emission)
    np.testing.assert_allclose(movie[:, 0], plain.apply(emission), rtol=1e-10)
    alone = model(polarization=LAW, stokes="U")
    np.testing.assert_array_equal(alone.apply(emission)[:, 0], movie[:, 2])
    assert model().factors.shape == (0, of.nodes)


def test_frames():
    of = model()
    emission = RNG.random(of.input_shape)
    part = of.at([2, 0])
    assert part.times.tolist() == [40.0, 0.0] and part.output_shape == (2, 10, 10)
    np.testing.assert_array_equal(part.apply(emission[[2, 0]]), of.apply(emission)[[2, 0]])
    np.testing.assert_array_equal(part.coordinates(), of.coordinates()[[2, 0]])
    volume = RNG.random((8, 8, 8))
    np.testing.assert_array_equal(
        of.at([1]).voxels(8, 9.0).apply(volume), of.voxels(8, 9.0).apply(volume)[[1]]
    )
    for frames in (slice(1, None), of.times > 0, np.array([1, 2])):
        np.testing.assert_array_equal(of.at(frames).times, [15.0, 40.0])
    assert of.at(-1).times.tolist() == [40.0]
    for wrong in ([0.7], ["0"], [], [True]):
        with pytest.raises(TypeError, match="frames"):
            of.at(wrong)
    with pytest.raises(IndexError):
        of.at([3])


def test_refusals():
    of = model()
    for call, words in [
        (lambda: model(r_min=9.0), "r_max"),
        (lambda: model(axis=[0, 0, 0]), "axis"),
        (lambda: model(order=17), "order = 17"),
        (lambda: model(per_ray=50), "finite radius"),
        (lambda: model(r_min=100.0, r_max=101.0), "no ray meets the region"),
        (lambda: model(velocity=Infall(2.0, 0.5, 0.5)), "xi"),
        (lambda: model(velocity=Profile([3.0, 9.0], [0.1], [0.0, 0.0])), "angular"),
        (lambda: model(polarization=LAW, redshift_power=2.0), "redshift_power = 2"),
        (lambda: model(polarization=LAW, stokes="IV"), 'stokes = "V"'),
        (lambda: model(polarization=LAW, stokes="II"), 'stokes = "II"'),
        (lambda: model(polarization=replace(LAW, fraction=2.0)), "polarization.fraction = 2"),
        (lambda: of.apply(np.zeros(3)), "emission has the shape"),
        (lambda: of.vjp(np.zeros(3)), "cotangent has the shape"),
        (lambda: of.voxels(1, 9.0), "shape = 1 is not allowed"),
        (lambda: of.voxels(8, -9.0), "low"),
        (lambda: model(times=[]), "times"),
        (lambda: model(times=[[0.0, 1.0]]), "times"),
        (lambda: model(times=[0.0, np.nan]), "times = nan"),
        (lambda: model(stokes="QU"), "needs polarization"),
        (lambda: of.apply(np.ma.masked_array(np.zeros(of.input_shape), True)), "masked"),
        (lambda: of.apply(np.ma.masked_array(np.zeros(of.input_shape, np.float32), True)), "masked"),
        (lambda: screen(0, 9.0), "pixels = 0"),
        (lambda: screen(8, -1.0), "width = -1"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value)
    for call in (lambda: screen(3.5, 1.0), lambda: model(velocity="keplerian"), lambda: model(order=2.5)):
        with pytest.raises(TypeError, match="not allowed"):
            call()
    with pytest.raises(TypeError, match="real numbers"):
        of.apply(np.zeros(of.input_shape, dtype=complex))


def test_torch():
    torch = pytest.importorskip("torch")
    import kerrlight.torch

    of = model()
    for operator in (of, of.voxels(5, 9.0)):
        values = torch.rand(operator.input_shape, dtype=torch.float64, requires_grad=True)
        movie = kerrlight.torch.apply(operator, values)
        (movie**2).sum().backward()
        expected = operator.vjp(2 * operator.apply(values.detach().numpy()))
        np.testing.assert_allclose(values.grad.numpy(), expected, rtol=1e-12)
    few = ForwardModel(Kerr(0.6).observer(inclination_deg=50), [4.0], [1.0], r_min=3.0, r_max=9.0)
    values = torch.rand(few.input_shape, dtype=torch.float64, requires_grad=True)
    function = lambda x: kerrlight.torch.apply(few, x) ** 2
    assert torch.autograd.gradcheck(function, values)
    assert torch.autograd.gradgradcheck(function, values)
    single = kerrlight.torch.apply(few, values.float())
    assert single.dtype == torch.float32


def test_jax():
    jax = pytest.importorskip("jax")
    import kerrlight.jax
    from kerrlight import Fourier

    jnp = jax.numpy
    of = model()
    values = jnp.asarray(RNG.random(of.input_shape), dtype=jnp.float32)
    loss = jax.jit(lambda x: (kerrlight.jax.apply(of, x) ** 2).sum())
    slope = jax.grad(loss)(values)
    expected = of.vjp(2 * of.apply(np.asarray(values)))
    np.testing.assert_allclose(slope, expected, rtol=1e-4, atol=1e-4)
    with pytest.raises(ValueError, match="values have the shape"):
        jax.jit(lambda x: kerrlight.jax.apply(of, x))(values[0])
    with pytest.raises(TypeError, match="complex64"):
        kerrlight.jax.apply(of, values.astype(jnp.complex64))
    movies = jax.vmap(lambda x: kerrlight.jax.apply(of, x))(jnp.stack([values, 2 * values]))
    np.testing.assert_allclose(movies[1], 2 * movies[0], rtol=1e-5)
    jax.config.update("jax_enable_x64", True)
    try:
        fourier = Fourier((10, 10), 100.0, RNG.normal(size=(7, 2)) * 3e9)
        data = jnp.asarray(RNG.normal(size=7) + 1j * RNG.normal(size=7))
        image = jnp.asarray(RNG.random((10, 10)))
        loss = jax.jit(lambda x: (jnp.abs(kerrlight.jax.apply(fourier, x) - data) ** 2).sum())
        direction = RNG.normal(size=(10, 10))
        slope = float((jax.grad(loss)(image) * direction).sum())
        ends = [float(loss(image + step * direction)) for step in (1e-4, -1e-4)]
        assert abs(slope - (ends[0] - ends[1]) / 2e-4) < 1e-9 * abs(slope) + 1e-9
    finally:
        jax.config.update("jax_enable_x64", False)


def test_a_network_trains_through_rays():
    torch = pytest.importorskip("torch")
    import kerrlight.torch

    of = model()
    at = torch.from_numpy(of.coordinates(np.float32)) / 9.0
    truth = torch.exp(-8 * ((at - torch.tensor([0.6, 0.0, 0.0])) ** 2).sum(-1))
    movie = kerrlight.torch.apply(of, truth)
    torch.manual_seed(1)
    layers = [torch.nn.Linear(3, 32), torch.nn.Tanh(), torch.nn.Linear(32, 1), torch.nn.Softplus()]
    network = torch.nn.Sequential(*layers)
    rates = torch.optim.Adam(network.parameters(), 1e-2)
    losses = []
    for _ in range(60):
        rates.zero_grad()
        loss = ((kerrlight.torch.apply(of, network(at)[..., 0]) - movie) ** 2).mean()
        loss.backward()
        rates.step()
        losses.append(loss.item())
    assert losses[-1] < 0.1 * losses[0]
